#include "shapes/half_space.h"

#include <cfloat>

#include "geometry/constants.h"
#include "shapes/limits.h"
#include "shapes/solid.h"
#include "shapes/wide_body.h"

namespace overlapper {

using namespace tangents;

HalfSpace HalfSpace::make(Vec3 normal, double offset) {
  require(finite(normal), "normal must be finite");
  require(std::isfinite(offset), "offset must be finite");
  const double length = norm(normal);
  require(length > 0, "normal must not be zero");
  require(length > kSmallest && length < kLargest, "normal must be of a length between 1e-25 and 1e25");
  require(std::abs(offset) / length < kLargest, "offset must be closer to the origin than 1e25 m");
  // A normal of length 1 but for its last bits stays as given, so that a plane that is read back keeps its bits.
  if (std::abs(length - 1) <= 2 * DBL_EPSILON) return {{normal, offset}, normal, offset};
  return {{normal / length, offset / length}, normal, offset};
}

Vec3 HalfSpace::support(Vec3 direction) const {
  const double along = dot(unit(direction), plane.normal);
  if (along > 0 && norm2(cross(unit(direction), plane.normal)) == 0) return plane.offset * plane.normal;
  return kInfinity * Vec3{sign(direction.x), sign(direction.y), sign(direction.z)};
}

double HalfSpace::volume() const { return kInfinity; }

Bounds HalfSpace::bounds(const Pose& pose) const {
  const Plane placed = pose * plane;
  const Vec3 touch = placed.offset * placed.normal;
  // A tilt counts: nothing bounds how far the half-space goes along it. Up to rounding, a turn makes none.
  const auto along = [&](int i) {
    return std::abs(placed.normal[(i + 1) % 3]) <= kUnit && std::abs(placed.normal[(i + 2) % 3]) <= kUnit;
  };
  const auto limit = [&](int i, double side) {
    return side * placed.normal[i] == 1 && along(i) ? touch[i] : side * kInfinity;
  };
  return {{limit(0, -1), limit(1, -1), limit(2, -1)}, {limit(0, 1), limit(1, 1), limit(2, 1)}};
}

void HalfSpace::place(Solid& solid, const Pose* pose, double beyond) const {
  solid.resize(0, 1, beyond);
  const Plane placed = pose ? *pose * plane : plane;
  solid.set_plane(0, placed.normal, placed.offset);
  solid.edges = {};
}

std::optional<WidePlane> HalfSpace::unit_facet(int) const {
  const DoubleDouble length = norm(wide(given_normal));
  const bool as_given = norm2(plane.normal - given_normal) == 0;
  // A normal of nearly unit length defines a direction, and the offset counts along that direction.
  return WidePlane{unit(wide(given_normal)), DoubleDouble{as_given ? plane.offset : given_offset} / length};
}

WideVector HalfSpace::wide_core_support(const WideVector&) const {
  const WidePlane exactly = *unit_facet(0);
  return exactly.offset * exactly.normal;
}

WidePlane HalfSpace::wide_tightest(const WideVector&, const WideTriangles&) const {
  const WideVector given = wide(given_normal);
  return {unit(given), DoubleDouble{given_offset} / norm(given)};
}

void HalfSpace::append_wide_planes(const WideBody& body, std::vector<WidePlane>& planes) const {
  planes.push_back(body.tightest(WideVector{}));
}

}  // namespace overlapper
