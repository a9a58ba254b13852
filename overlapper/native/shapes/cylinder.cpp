#include "shapes/cylinder.h"

#include <algorithm>
#include <numbers>

#include "shapes/cutter.h"
#include "shapes/inscribed.h"
#include "shapes/limits.h"

namespace overlapper {

using namespace tangents;

Cylinder Cylinder::make(double radius, double length) {
  require_size(radius, "radius");
  require_size(length, "length");
  require_ratio(std::min(radius, length), std::max(radius, length), "radius and length");
  return {radius, length};
}

Vec3 Cylinder::support(Vec3 d) const {
  const double r = radial(d);
  const double z = sign(d.z) * length / 2;
  return r > 0 ? Vec3{radius * d.x / r, radius * d.y / r, z} : Vec3{radius, 0, z};
}

Plane Cylinder::ray_exit(Vec3 origin, Vec3 d) const {
  const double half = length / 2, dd = d.x * d.x + d.y * d.y;
  const Plane cap{{0, 0, sign(d.z)}, half};
  if (dd == 0) return cap;
  const double t = leave_disc(origin.x * origin.x + origin.y * origin.y, origin.x * d.x + origin.y * d.y, dd, radius);
  const Vec3 side = origin + t * d;
  return std::abs(side.z) > half ? cap : tangent({side.x, side.y, 0}, {}, radius);
}

Plane Cylinder::tightest(Vec3 point) const {
  const double r = radial(point);
  if (std::abs(point.z) - length / 2 >= r - radius) return {{0, 0, sign(point.z)}, length / 2};
  return {r > 0 ? Vec3{point.x / r, point.y / r, 0} : Vec3{1, 0, 0}, radius};
}

double Cylinder::volume() const { return std::numbers::pi * radius * radius * length; }

WideVector Cylinder::wide_core_support(const WideVector& d) const {
  const WideVector beside = norm(across(d)).head > 0 ? unit(across(d)) : wide_axis(0);
  return DoubleDouble{radius} * beside + WideVector{{}, {}, {sign(d.z) * length / 2}};
}

WidePlane Cylinder::wide_ray_exit(const WideVector& origin, const WideVector& d) const {
  const double half = length / 2;
  const WidePlane cap{DoubleDouble{sign(d.z)} * wide_axis(2), {half}};
  const DoubleDouble beside = norm(across(d));
  if (!(beside.head > 0)) return cap;
  const WideVector side = leave_ball(across(origin), across(d), radius);
  const DoubleDouble t = dot(side - across(origin), across(d)) / (beside * beside);
  if (abs(origin.z + t * d.z) > DoubleDouble{half}) return cap;
  return tangent(side, {}, radius, wide_axis(0));
}

WidePlane Cylinder::wide_tightest(const WideVector& p, const WideTriangles&) const {
  const DoubleDouble past_cap = abs(p.z) - DoubleDouble{length / 2}, past_side = norm(across(p)) - DoubleDouble{radius};
  if (!(past_cap < past_side)) return {DoubleDouble{sign(p.z)} * wide_axis(2), {length / 2}};
  return tangent(across(p), {}, radius, wide_axis(0));
}

void Cylinder::give_pieces(Cutter& cutter) const {
  cutter.begin();
  cutter.cylinder({}, wide_axis(2), radius, length / 2);
  for (const double sign : {-1.0, 1.0}) cutter.face({{{}, {}, {sign}}, {length / 2}});
  cutter.end();
}

Hull Cylinder::inscribed(double tolerance) const {
  const int n = corners_of_circle(tolerance, "cylinder");
  std::vector<Vec3> points;
  append_circle(radius, -length / 2, n, points);
  append_circle(radius, length / 2, n, points);
  return hull_within(points);
}

}  // namespace overlapper
