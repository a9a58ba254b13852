#include "overlap/shape_gradient.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "methods/clipping/clip.h"

namespace overlapper {
namespace {

/// m²: the area of each facet of the polytope.
double area_of(const Boundary& boundary, int facet) {
  const auto ring = boundary.facet(facet);
  const auto corner = [&](int i) { return boundary.vertices[ring[i]]; };
  Vec3 twice;
  for (int i = 1; i + 1 < static_cast<int>(ring.size()); ++i)
    twice += cross(corner(i) - corner(0), corner(i + 1) - corner(0));
  return std::sqrt(norm2(twice)) / 2;
}

/// The axis of a box that is across a facet with this normal.
int axis_across(const Placed& box, Vec3 normal) {
  const Vec3 local = abs(apply_transposed(box.pose.rotation, normal));
  return local.x >= local.y && local.x >= local.z ? 0 : local.y >= local.z ? 1 : 2;
}

Vec3 along(int axis, double value) { return {axis == 0 ? value : 0, axis == 1 ? value : 0, axis == 2 ? value : 0}; }

std::vector<Vec3> areas_of_sides(const Boundary& boundary, std::span<const Placed> bodies) {
  std::vector<Vec3> areas(bodies.size());
  for (int f = 0; f < static_cast<int>(boundary.planes.size()); ++f) {
    const int owner = boundary.owner[f];
    const bool box = std::holds_alternative<Box>(bodies[owner].shape);
    areas[owner] += along(box ? axis_across(bodies[owner], boundary.planes[f].normal) : 0, area_of(boundary, f));
  }
  return areas;
}

}  // namespace

std::vector<Vec3> shape_gradient(const Overlap& overlap) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  const std::span<const Placed> bodies = overlap.bodies();
  std::vector<Vec3> found(bodies.size());
  if (overlap.status() == Status::kOverlapping) {
    std::optional<SideAreas> clipped;
    if (overlap.pair() && (overlap.way() == Way::kClipping || overlap.way() == Way::kWideClipping))
      clip(bodies[0], bodies[1], &clipped);
    if (clipped) found.assign(clipped->begin(), clipped->end());
    else if (polyhedral(bodies)) found = areas_of_sides(overlap.boundary(), bodies);
  }
  const bool known = overlap.status() != Status::kOverlapping || polyhedral(bodies);
  for (size_t i = 0; i < bodies.size(); ++i) {
    const bool box = std::holds_alternative<Box>(bodies[i].shape), half = !bounded(bodies[i].shape);
    if (half && !known) found[i].x = norm(overlap.measures().pulls[i].force);
    else if (!(box || half) || (box && !known)) found[i] = {kNaN, kNaN, kNaN};
  }
  return found;
}

PairGradient pair_gradient(const Placed& a, const Placed& b, double tolerance) {
  PairGradient found;
  std::optional<SideAreas> sides;
  const std::optional<Measures> at_once = measure_at_once(a, b, &sides);
  if (at_once && at_once->status == Status::kSeparated) return found;
  if (at_once && at_once->measured && sides)
    return {at_once->volume, {gradient_row(at_once->pulls[0]), gradient_row(at_once->pulls[1])}, *sides};
  const Overlap overlap(a, b, tolerance, Method::kAuto);
  found.volume = overlap.volume();
  const auto pose = overlap.gradient();
  const auto shape = shape_gradient(overlap);
  std::ranges::copy(pose, found.pose.begin());
  std::ranges::copy(shape, found.shape.begin());
  return found;
}

}  // namespace overlapper
