
#include "geometry/constants.h"
#include "methods/round/pieces/piece.h"

namespace overlapper::pieces {
namespace {

/// A cap, with integrals about its tip: along the normal n of its disc, which leads away from the tip, and across n.
struct Cap {
  double height, volume, disc;
  Vec3 n, tip;
  double first, along, across;  ///< ∫ p dV, ∫ p² dV and ∫ q² dV

  Cap(const Round& ball, const Wall* wall) {
    const double r = ball.radius;
    const WideVector normal = wall ? wall->normal : wide(Vec3{0, 0, 1});
    height = wall ? (DoubleDouble{r} + wall->slack - dot(normal, ball.centre)).head : 2 * r;  // without cancellation
    n = rounded(normal), tip = rounded(ball.centre - DoubleDouble{r} * normal);
    const double h2 = height * height, h3 = h2 * height;
    volume = kPi * h2 * (r - height / 3), first = kPi * h3 * (2 * r / 3 - height / 4);
    along = kPi * h3 * height * (r / 2 - height / 5);
    across = kPi / 4 * h3 * (4 * r * r / 3 - r * height + h2 / 5);
    disc = wall ? kPi * height * (2 * r - height) : 0;
  }
};

/// Adds second moments. A shallow cap is much smaller along its axis than across it.
void add_second_moments(const Cap& cap, Moments& sum) {
  const double volume = cap.volume, first = cap.first, along = cap.along, across = cap.across;
  const Vec3 n = cap.n, tip = cap.tip;
  const auto square = [&](double p, double u, double v, double w) {
    return volume * p * p + 2 * first * p * u + along * u * u + across * (v * v + w * w);
  };
  const auto product = [&](double p, double q, double u, double v) {
    return volume * p * q + first * (p * v + q * u) + (along - across) * u * v;
  };
  sum.squares += {square(tip.x, n.x, n.y, n.z), square(tip.y, n.y, n.z, n.x), square(tip.z, n.z, n.x, n.y)};
  sum.products += {product(tip.y, tip.z, n.y, n.z), product(tip.z, tip.x, n.z, n.x), product(tip.x, tip.y, n.x, n.y)};
}

/// The sizes of the terms of the moments.
Moments sizes_of(const Cap& cap) {
  const double volume = cap.volume, first = cap.first, along = cap.along, across = cap.across;
  const Vec3 n = cap.n, tip = cap.tip;
  const Vec3 p = abs(tip), u = abs(n), diagonal = scaled(u, u);
  const Vec3 other{diagonal.y + diagonal.z, diagonal.z + diagonal.x, diagonal.x + diagonal.y};
  Moments sizes{volume, first * u + volume * p, {}, {}};
  sizes.squares = volume * scaled(p, p) + 2 * first * scaled(p, u) + along * diagonal + across * other;
  const auto size = [&](double a, double b, double v, double w) {
    return volume * a * b + first * (a * w + b * v) + (along + across) * v * w;
  };
  sizes.products = {size(p.y, p.z, u.y, u.z), size(p.z, p.x, u.z, u.x), size(p.x, p.y, u.x, u.y)};
  return sizes;
}

void add_areas(const Cap& cap, const Round& ball, const Wall* wall, const quadric::Stretch* stretch, Totals& totals) {
  const double curved = 2 * kPi * ball.radius * cap.height;
  if (stretch) {
    const quadric::Stretch::Cap stretched = stretch->cap(cap.n, cap.height);
    totals.add_area(ball.owner, stretched.area), totals.area_error += stretched.error;
  } else {
    totals.add_area(ball.owner, curved);
  }
  if (wall) totals.add_area(wall->owner, stretch ? stretch->area(cap.disc * cap.n) : cap.disc);
  totals.border += curved + cap.disc;
}

/// The force on the ball acts along a line through its centre and the tip.
void add_forces(const Cap& cap, const Round& ball, const Wall* wall, const quadric::Stretch* stretch, Totals& totals) {
  const Vec3 force = cap.disc * cap.n;
  const Vec3 moment = stretch ? stretch->moment(cap.tip + cap.height * cap.n, force) : cross(cap.tip, force);
  const auto act = [&](int body, double side) {
    if (body == 0) totals.pull += side * force, totals.moment += side * moment;
    if (body != slicing::kCut) totals.unbalanced += side * force;
  };
  act(ball.owner, -1);
  if (wall) act(wall->owner, 1);
}

/// A disc. Its area is negative if it is seen from behind; `square` is the square of its radius.
void add_disc(Vec3 centre, Vec3 normal, double area, double square, const PatchView& view, PatchSums& patch) {
  const double w = area * dot(normal, view.normal), quarter = square / 4;
  const double u = view.u0 + dot(centre, view.u), v = view.v0 + dot(centre, view.v);
  const auto second = [&](Vec3 p, Vec3 q) { return quarter * (dot(p, q) - dot(p, normal) * dot(q, normal)); };
  patch.add(w, w * u, w * v, w * (u * u + second(view.u, view.u)), w * (u * v + second(view.u, view.v)),
            w * (v * v + second(view.v, view.v)));
}

}  // namespace

void add_cap(const Round& ball, const Wall* wall, const PieceSetting& setting, Sums& sums) {
  const Cap cap(ball, wall);
  if (setting.common && setting.common->excludes(cap.tip + cap.first / cap.volume * cap.n)) return;
  Totals& totals = sums.totals;
  totals.volume += cap.volume;
  totals.error += 32 * DBL_EPSILON * cap.volume;
  add_areas(cap, ball, wall, setting.stretch, totals);
  totals.first += cap.volume * cap.tip + cap.first * cap.n;
  add_second_moments(cap, totals);
  if (setting.stretch) totals.sizes += sizes_of(cap);
  add_forces(cap, ball, wall, setting.stretch, totals);
  const int owner = setting.view.owner;
  if (sums.patch && wall && (ball.owner == owner || wall->owner == owner))
    add_disc(cap.tip + cap.height * cap.n, cap.n, ball.owner == owner ? -cap.disc : cap.disc, cap.disc / kPi,
             setting.view, *sums.patch);
}

}  // namespace overlapper::pieces
