#include "shapes/capsule.h"

#include <numbers>
#include <string>

#include "shapes/cutter.h"
#include "shapes/inscribed.h"
#include "shapes/limits.h"

namespace overlapper {

using namespace tangents;

Capsule Capsule::make(double radius, double length) {
  require_size(radius, "radius");
  require(std::isfinite(length), "length must be finite");
  require(length >= 0, [&] { return "length must not be negative, it is " + std::to_string(length); });
  require(length < kLargest, "length must be less than 1e25 m");
  require_ratio(radius, length, "radius and length");
  return {radius, length};
}

Plane Capsule::ray_exit(Vec3 origin, Vec3 d) const {
  const double half = length / 2, dd = d.x * d.x + d.y * d.y;
  double past = d.z;
  if (dd > 0) {
    const double t = leave_disc(origin.x * origin.x + origin.y * origin.y, origin.x * d.x + origin.y * d.y, dd, radius);
    const Vec3 side = origin + t * d;
    if (std::abs(side.z) <= half) return tangent({side.x, side.y, 0}, {}, radius);
    past = side.z;
  }
  // The ray meets the infinite cylinder past one end, so it has left through the ball around that end.
  const Vec3 end{0, 0, sign(past) * half};
  const Vec3 q = origin - end;
  // Lagrange's identity. From afar, the difference of dot(q, d)² and |q|² |d|² would cancel.
  const double discriminant = std::max(0.0, norm2(d) * radius * radius - norm2(cross(q, d)));
  const double t = (std::sqrt(discriminant) - dot(q, d)) / norm2(d);
  Vec3 outward = q + t * d;
  // Near the start of the end cap, rounding may put the exit just before it. The tangents of that ball would cut off
  // the other end.
  if (outward.z * end.z < 0) outward.z = 0;
  return tangent(outward, end, radius);
}

Plane Capsule::tightest(Vec3 point) const {
  const Vec3 core{0, 0, std::clamp(point.z, -length / 2, length / 2)};
  const Vec3 outward = point - core;
  return tangent(norm2(outward) > 0 ? outward : Vec3{1, 0, 0}, core, radius);
}

std::vector<Vec3> Capsule::core_corners() const {
  if (length > 0) return {{0, 0, -length / 2}, {0, 0, length / 2}};
  return {{}};
}

void Capsule::append_core_surface(const std::vector<char>&, CoreSurface& surface) const {
  if (length > 0) surface.ridges.push_back({0, 1, -1, -1});
}

double Capsule::volume() const { return std::numbers::pi * radius * radius * (length + 4.0 / 3.0 * radius); }

WideVector Capsule::wide_core_support(const WideVector& d) const { return {{}, {}, {sign(d.z) * length / 2}}; }

WidePlane Capsule::wide_ray_exit(const WideVector& origin, const WideVector& d) const {
  /// Like leave_ball(), but from a point that may be outside; takes the far one of two crossings.
  const auto leave_cap = [&](const WideVector& q) {
    const WideVector beside = cross(q, d);
    const DoubleDouble dd = dot(d, d);
    DoubleDouble square = dd * two_product(radius, radius) - dot(beside, beside);
    if (square.head < 0) square = {};
    return q + ((sqrt(square) - dot(q, d)) / dd) * d;
  };
  const double half = length / 2;
  DoubleDouble past = d.z;
  if (norm(across(d)).head > 0) {
    const DoubleDouble t_length = norm(across(d));
    const WideVector side = leave_ball(across(origin), across(d), radius);
    const DoubleDouble t = dot(side - across(origin), across(d)) / (t_length * t_length);
    const DoubleDouble z = origin.z + t * d.z;
    if (!(abs(z) > DoubleDouble{half})) return tangent(across(side), {}, radius, wide_axis(0));
    past = z;
  }
  const WideVector end{{}, {}, {sign(past) * half}};
  WideVector outward = leave_cap(origin - end);
  if (outward.z.head * end.z.head < 0) outward.z = {};
  return tangent(outward, end, radius, wide_axis(2));
}

WidePlane Capsule::wide_tightest(const WideVector& p, const WideTriangles&) const {
  const DoubleDouble half{length / 2};
  const DoubleDouble z = p.z > half ? half : p.z < -half ? -half : p.z;
  const WideVector core{{}, {}, z};
  return tangent(p - core, core, radius, wide_axis(0));
}

/// A cylinder and two half balls.
void Capsule::give_pieces(Cutter& cutter) const {
  if (length == 0) return cutter.whole_ball(radius);
  const double half = length / 2;
  cutter.begin();
  cutter.cylinder({}, wide_axis(2), radius, half);
  for (const double sign : {-1.0, 1.0}) cutter.cut({{{}, {}, {sign}}, {half}});
  cutter.end();
  for (const double sign : {-1.0, 1.0}) {
    cutter.begin();
    cutter.ball({{}, {}, {sign * half}}, radius);
    cutter.cut({{{}, {}, {-sign}}, {-half}});
    cutter.end();
  }
}

Hull Capsule::inscribed(double tolerance) const {
  return hull_within(points_of_capsule(radius, length / 2, tolerance));
}

}  // namespace overlapper
