#include <algorithm>
#include <cfloat>

#include "methods/round/lenses/integrate.h"
#include "methods/round/lenses/lenses.h"

namespace overlapper::lenses {
namespace {

WideVector scaled_by(Vec3 a, const WideVector& b) {
  return {DoubleDouble{a.x} * b.x, DoubleDouble{a.y} * b.y, DoubleDouble{a.z} * b.z};
}

SecondBall second_ball(const slicing::Round& round, Vec3 half_axes) {
  const DoubleDouble radius{round.radius};
  SecondBall second;
  if (round.ball) {
    second.k = {{DoubleDouble{half_axes.x} / radius, {}, {}},
                {{}, DoubleDouble{half_axes.y} / radius, {}},
                {{}, {}, DoubleDouble{half_axes.z} / radius}};
  } else {
    const WideVector u = unit(cross(round.axis, wide(any_orthogonal(rounded(round.axis)))));
    second.k = {scaled_by(half_axes, u) / radius, scaled_by(half_axes, cross(round.axis, u)) / radius, {}};
    second.cylinder = true;
  }
  second.middle = second.k * round.centre;
  return second;
}

/// m² of the round's surface per angle and distance between slices. In the world, too, sections of the round are
/// circles, and angles are the same.
double area_rate(const slicing::Round& round, Vec3 across, Vec3 half_axes) {
  const Vec3 steep{across.x / half_axes.x, across.y / half_axes.y, across.z / half_axes.z};
  return round.radius / (round.ball ? norm(steep) : std::abs(dot(steep, rounded(round.axis))));
}

}  // namespace

bool contains_part(const InEllipsoid& of, const slicing::Round& round, std::span<const slicing::Wall> walls) {
  const Vec3 centre = rounded(of.centre);
  Vec3 middle = centre;
  double square = 1;
  for (const slicing::Wall& wall : walls) {
    const Vec3 normal = rounded(wall.normal);
    const double beyond = overlapper::dot(normal, centre) - wall.slack.head;
    if (beyond > 0 && 1 - beyond * beyond < square) square = 1 - beyond * beyond, middle = centre - beyond * normal;
  }
  const SecondBall second = second_ball(round, of.stretch.half_axes);
  const Vec3 off = rounded(second.k * wide(middle) - second.middle);
  double stretch = 0;  // bound of the square of the length of K u for a unit vector u
  for (const WideVector& row : {second.k.row0, second.k.row1, second.k.row2}) stretch += norm2(rounded(row));
  constexpr double kShallow = 0.05, kInside = 1 - 1e-6;
  return square <= kShallow && norm(off) + std::sqrt(std::max(0.0, square) * stretch) <= kInside;
}

namespace {

/// A part is measured again about its centroid if its error is larger, relative to its own volume and to its share of
/// all volume.
constexpr double kFineForPart = 1e-12;
/// A part is measured more closely if a larger fraction of the volume may be missing. This is half of kOfRules.
constexpr double kClosed = kOfRules / 2;

/// A part by slices of one direction, about an origin.
struct Measured {
  Discs discs;
  Integral integral;
  pieces::Totals totals;
  Vec3 origin;

  const Sums& sums() const { return integral.sums; }
  double volume() const { return totals.volume; }
  double off() const { return totals.open + totals.error; }
  /// The direction in which the part leads from slice to slice.
  Vec3 leading() const {
    const Moments& m = sums().moments;
    const Vec3 mean = m.first / m.volume;
    const double square = m.squares.x / m.volume - mean.x * mean.x;
    return unit(discs.along_axes(
        {square, m.products.z / m.volume - mean.x * mean.y, m.products.y / m.volume - mean.z * mean.x}));
  }
  /// ∫ y Nᵀ dA over the ball's part of the surface, about the inner point.
  Mat3 moved() const { return discs.moved_along_axes(sums().moved) + outer(origin, discs.along_axes(sums().force)); }
};

/// The part of a round inside walls, in an ellipsoid.
struct PartOfRound {
  const InEllipsoid& of;
  const slicing::Round& round;
  std::span<const slicing::Wall> walls;
  Wanted wanted;

  /// No value if the part cannot be measured.
  std::optional<Measured> measured(bool other, bool closely) const {
    Wanted what = wanted;
    what.closely = closely;
    return measured(of.centre, second_ball(round, of.stretch.half_axes), walls, what, other, {}, {});
  }
  /// The same about the centroid, with the foot along the part. The inner point may be far from the part, and places
  /// that count from there have fewer digits.
  std::optional<Measured> measured_again(const Measured& before) const {
    const Vec3 origin = before.totals.first / before.volume();
    const WideVector step = wide(origin);
    slicing::Round moved_round = round;
    moved_round.centre = round.centre - step;
    std::vector<slicing::Wall> moved_walls(walls.begin(), walls.end());
    for (slicing::Wall& wall : moved_walls) wall.slack = wall.slack - dot(wall.normal, step);
    Wanted moved_wanted = wanted;
    moved_wanted.closely = true;
    if (wanted.view) {
      moved_wanted.view->u0 += dot(wanted.view->u, origin);
      moved_wanted.view->v0 += dot(wanted.view->v, origin);
    }
    return measured(of.centre - step, second_ball(moved_round, of.stretch.half_axes), moved_walls, moved_wanted, false,
                    before.leading(), origin);
  }

 private:
  std::optional<Measured> measured(const WideVector& centre, const SecondBall& second,
                                   std::span<const slicing::Wall> within, const Wanted& what, bool other, Vec3 leading,
                                   Vec3 origin) const {
    std::optional<Discs> found = discs(centre, second, within, other, leading);
    if (!found) return std::nullopt;
    found->misplaced = of.misplaced / (kRoundings * DBL_EPSILON);
    found->second_area = area_rate(round, found->normal, of.stretch.half_axes);
    Measured result{*found, integrate(*found, what), {}, origin};
    const Sums& part = result.sums();
    const double volume = part.moments.volume;
    if (!(volume > 0)) return result;
    pieces::Totals& totals = result.totals;
    static_cast<Moments&>(totals) = part.moments.along({found->normal, found->x, found->y});
    totals.error = result.integral.error + kRoundings * DBL_EPSILON * (part.blur + volume) + kOfRules * volume +
                   2 * found->oval * part.oval;
    totals.border = part.border;
    totals.unbalanced = found->along_axes(part.force + part.second_force + part.cut_force);
    totals.open = pieces::missing(totals);
    static_cast<Moments&>(totals) = totals.seen_from(origin);
    return result;
  }
};

}  // namespace

bool add_part(InEllipsoid& of, const slicing::Round& round, std::span<const slicing::Wall> walls, pieces::Sums& sums) {
  pieces::Totals& totals = sums.totals;
  Wanted wanted;
  if (of.with_area) wanted.first = &of.stretch;
  wanted.view = of.view;
  wanted.closing = true;
  wanted.volume = totals.volume, wanted.border = totals.border;
  const PartOfRound whole{of, round, walls, wanted};
  std::optional<Measured> found = whole.measured(false, false);
  if (!found) return false;
  const auto keep_better = [&](std::optional<Measured> again) {
    if (again && again->volume() > 0 && again->off() < found->off()) found = std::move(again);
  };
  const auto is_open = [&](double limit) { return found->totals.open > limit * (totals.volume + found->volume()); };
  // Volumes are accurate before area vectors are.
  if (is_open(kClosed)) keep_better(whole.measured(false, true));
  // A part of the surface may be hidden between slices of one direction.
  if (is_open(pieces::kMostOpen)) keep_better(whole.measured(true, true));
  if (!(found->volume() > 0)) return true;
  if (const double error = found->totals.error;
      error > kFineForPart * std::max(found->volume(), (totals.volume + found->volume()) / of.parts))
    keep_better(whole.measured_again(*found));
  const Discs& discs = found->discs;
  const Sums& part = found->sums();
  pieces::Totals more = found->totals;
  more.unbalanced = discs.along_axes(part.force + part.second_force);
  more.area = part.first_area + part.second_area;
  more.first_area = part.first_area;
  more.pull = discs.along_axes(part.force);
  more.moment = discs.moment(part.moved, of.stretch) + of.stretch.moment(found->origin, more.pull);
  of.ball_moved = of.ball_moved + found->moved();
  of.second_force += discs.along_axes(part.second_force);
  totals.add(more);
  totals.sizes += Moments{more.volume, abs(more.first), more.squares, abs(more.products)};
  totals.area_error += found->integral.area_error;
  of.moved = std::max(of.moved, round.radius * (kRoundings * DBL_EPSILON + 2 * discs.oval) * part.terms);
  if (sums.patch) {
    const auto& p = part.patch;
    sums.patch->add(p[0], p[1], p[2], p[3], p[4], p[5]);
  }
  return true;
}

}  // namespace overlapper::lenses
