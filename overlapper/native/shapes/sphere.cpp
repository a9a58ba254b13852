#include "shapes/sphere.h"

#include <numbers>

#include "shapes/cutter.h"
#include "shapes/inscribed.h"
#include "shapes/limits.h"

namespace overlapper {

using namespace tangents;

Sphere Sphere::make(double radius) {
  require_size(radius, "radius");
  return Sphere(radius);
}

Plane Sphere::ray_exit(Vec3 origin, Vec3 direction) const {
  const double t = leave_disc(norm2(origin), dot(origin, direction), norm2(direction), radius);
  return tangent(origin + t * direction, {}, radius);
}

Plane Sphere::tightest(Vec3 point) const { return tangent(norm2(point) > 0 ? point : Vec3{0, 0, 1}, {}, radius); }

double Sphere::volume() const { return 4.0 / 3.0 * std::numbers::pi * radius * radius * radius; }

WidePlane Sphere::wide_ray_exit(const WideVector& origin, const WideVector& direction) const {
  return tangent(leave_ball(origin, direction, radius), {}, radius, wide_axis(2));
}

WidePlane Sphere::wide_tightest(const WideVector& point, const WideTriangles&) const {
  return tangent(point, {}, radius, wide_axis(2));
}

void Sphere::give_pieces(Cutter& cutter) const { cutter.whole_ball(radius); }

Hull Sphere::inscribed(double tolerance) const { return hull_within(points_of_capsule(radius, 0, tolerance)); }

}  // namespace overlapper
