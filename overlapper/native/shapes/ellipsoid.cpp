#include "shapes/ellipsoid.h"

#include <algorithm>
#include <array>
#include <numbers>

#include "shapes/cutter.h"
#include "shapes/inscribed.h"
#include "shapes/limits.h"

namespace overlapper {

using namespace tangents;

namespace {

int shortest_axis(Vec3 h) { return h.x <= h.y && h.x <= h.z ? 0 : h.y <= h.z ? 1 : 2; }

Vec3 divided(Vec3 v, Vec3 h) { return {v.x / h.x, v.y / h.y, v.z / h.z}; }
WideVector divided(const WideVector& v, Vec3 by) {
  return {v.x / DoubleDouble{by.x}, v.y / DoubleDouble{by.y}, v.z / DoubleDouble{by.z}};
}
WideVector scaled(Vec3 by, const WideVector& v) {
  return {DoubleDouble{by.x} * v.x, DoubleDouble{by.y} * v.y, DoubleDouble{by.z} * v.z};
}

WidePlane wide_supporting(Vec3 half_axes, const WideVector& outward) {
  const WideVector normal = unit(outward);
  return {normal, norm(scaled(half_axes, normal))};
}

/// A point in an ellipsoid's coordinates, in units of its shortest half axis, with the shortest axis last.
///
/// At a foot of the point p on the surface, n ∝ p / (τ + s), with s = g² − 1 for the half axes g. The image of that
/// foot on the unit ball is u = g p / (τ + s), so |u| = 1. τ is not negative for the nearest foot (Eberly 2013), and
/// negative for the foot across the shortest axis.
struct ScaledPoint {
  std::array<int, 3> axis;
  std::array<double, 3> g, s, p;

  ScaledPoint(Vec3 half_axes, Vec3 point) {
    const int last = shortest_axis(half_axes);
    axis = {(last + 1) % 3, (last + 2) % 3, last};
    const double shortest = half_axes[last];
    for (int i = 0; i < 3; ++i) {
      const double h = half_axes[axis[i]];
      g[i] = h / shortest;
      s[i] = (h - shortest) / shortest * (g[i] + 1);
      p[i] = point[axis[i]] / shortest;
    }
  }

  /// A component of the point of the unit ball; 0 for 0 / 0, at the centre of an axis.
  double u(int i, double tau) const { return p[i] != 0 ? g[i] * p[i] / (tau + s[i]) : 0; }

  Vec3 normal(double tau, double last) const {
    std::array<double, 3> n;
    for (int i = 0; i < 2; ++i) n[axis[i]] = u(i, tau) / g[i];
    n[axis[2]] = last;
    return unit(Vec3{n[0], n[1], n[2]});
  }

  /// The square of the last component, 1 less the others, if the point lies in the plane across the shortest axis and τ
  /// is zero. Negative if the nearest foot lies in that plane, too.
  double left() const {
    const double x = u(0, 0), y = u(1, 0);
    return 1 - x * x - y * y;
  }

  /// The greatest τ with |u| = 1, by Newton's method for 1 / |u|. It starts where one component alone has length 1, and
  /// only approaches.
  double nearest() const {
    double tau = 0;
    for (int i = 0; i < 3; ++i) tau = std::max(tau, g[i] * std::abs(p[i]) - s[i]);
    constexpr int kMostSteps = 100;
    for (int step = 0; step < kMostSteps; ++step) {
      double square = 0, slope = 0;
      for (int i = 0; i < 3; ++i) {
        const double part = u(i, tau);
        square += part * part;
        if (part != 0) slope += part * part / (tau + s[i]);
      }
      const double next = tau + (std::sqrt(square) - 1) * square / slope;
      if (!(next > tau)) break;
      tau = next;
    }
    return tau;
  }

  /// The least negative τ, if one lies above the poles of the other axes. |u|² is convex between.
  std::optional<double> across() const {
    double tau = -std::abs(p[2]);
    constexpr int kMostSteps = 100;
    for (int step = 0; step < kMostSteps; ++step) {
      if (!(tau + std::min(s[0], s[1]) > 0)) return std::nullopt;
      double square = 0, slope = 0;
      for (int i = 0; i < 3; ++i) {
        const double part = u(i, tau);
        square += part * part;
        if (part != 0) slope -= 2 * part * part / (tau + s[i]);
      }
      if (!(square > 1)) return tau;
      if (!(slope > 0)) return std::nullopt;
      const double next = tau - (square - 1) / slope;
      if (!(next < tau)) return tau;
      tau = next;
    }
    return tau;
  }
};

}  // namespace

Ellipsoid Ellipsoid::make(Vec3 half_axes) {
  for (int i = 0; i < 3; ++i) require_size(half_axes[i], "half_axes");
  require_ratio(half_axes[shortest_axis(half_axes)], max_component(half_axes), "half_axes");
  return Ellipsoid(half_axes);
}

double Ellipsoid::volume() const { return 4.0 / 3.0 * std::numbers::pi * half_axes.x * half_axes.y * half_axes.z; }

Vec3 Ellipsoid::support(Vec3 direction) const {
  const Vec3 on_ball = unit(scaled(half_axes, unit(direction)));
  return scaled(half_axes, on_ball);
}

Mat3 Ellipsoid::core_slope(Vec3 direction) const {
  // (M − p pᵀ) / √(d · M d), with M the squares of the half axes and p = M d / √(d · M d) the point.
  const Vec3 h = half_axes, square = scaled(h, h);
  const double reach = norm(scaled(h, direction));
  const Vec3 p = scaled(square, direction) / reach;
  const Vec3 row0 = Vec3{square.x, 0, 0} - p.x * p, row1 = Vec3{0, square.y, 0} - p.y * p,
             row2 = Vec3{0, 0, square.z} - p.z * p;
  return {row0 / reach, row1 / reach, row2 / reach};
}

Plane Ellipsoid::supporting(Vec3 outward) const {
  const Vec3 normal = unit(outward);
  return {normal, norm(scaled(half_axes, normal))};
}

Plane Ellipsoid::ray_exit(Vec3 origin, Vec3 direction) const {
  const Vec3 q = divided(origin, half_axes), d = unit(divided(direction, half_axes));
  const double along = dot(q, d), inside = std::max(0.0, 1 - norm2(q));
  const double root = std::sqrt(along * along + inside);
  const double t = along > 0 ? inside / (along + root) : root - along;
  return supporting(divided(q + t * d, half_axes));
}

std::vector<Vec3> Ellipsoid::ways_out(Vec3 point) const {
  const ScaledPoint seen(half_axes, point);
  if (seen.p[2] == 0 && seen.left() > 0) {
    const double last = std::sqrt(seen.left());
    return {seen.normal(0, last), seen.normal(0, -last)};
  }
  const double tau = seen.nearest();
  const auto normal = [&](double at) { return seen.normal(at, seen.u(2, at)); };
  if (seen.p[2] == 0) return {normal(tau)};
  const std::optional<double> other = seen.across();
  if (!other) return {normal(tau)};
  return {normal(tau), normal(*other)};
}

Plane Ellipsoid::tightest(Vec3 point) const { return supporting(ways_out(point)[0]); }

WideVector Ellipsoid::wide_core_support(const WideVector& direction) const {
  return ball() ? WideVector{} : scaled(half_axes, unit(scaled(half_axes, direction)));
}

WidePlane Ellipsoid::wide_ray_exit(const WideVector& origin, const WideVector& direction) const {
  const WideVector on_ball = leave_ball(divided(origin, half_axes), unit(divided(direction, half_axes)), 1);
  return wide_supporting(half_axes, divided(on_ball, half_axes));
}

WidePlane Ellipsoid::wide_tightest(const WideVector& point, const WideTriangles&) const {
  // Where the slack is least, an error of the normal changes it only to second order: doubles are accurate enough.
  return wide_supporting(half_axes, wide(ways_out(rounded(point))[0]));
}

void Ellipsoid::give_pieces(Cutter& cutter) const { cutter.whole_ball(ball() ? half_axes.x : 1); }

Hull Ellipsoid::inscribed(double tolerance) const {
  std::vector<Vec3> points = points_of_capsule(1, 0, tolerance);
  for (Vec3& p : points) p = overlapper::scaled(half_axes, p);
  return hull_within(points);
}

}  // namespace overlapper
