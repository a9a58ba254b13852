#include "overlap/shape_gradient.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "methods/choose.h"
#include "methods/clipping/clip.h"
#include "methods/round/round.h"

namespace overlapper {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

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

/// The part of the common surface that each body of a pair owns, m², by slices. NaN if slices give up.
std::array<double, 2> owned_areas(const Overlap& overlap) {
  const Arrangement at = arranged(overlap.bodies());
  const Vec3 inside = overlap.centroid() - at.reference;
  const auto round = measure_by_slices({at.relative[0], at.relative[1], at.reference, wide(inside)});
  std::array<double, 2> areas{kNaN, kNaN};
  if (round) areas[at.order[0]] = round->first_area, areas[at.order[1]] = round->area - round->first_area;
  return areas;
}

/// True if the surface of the body moves out at the speed 1 as its radius grows.
bool grows_by_radius(const Shape& shape) {
  return std::holds_alternative<Sphere>(shape) || std::holds_alternative<Capsule>(shape) ||
         std::holds_alternative<RoundedHull>(shape);
}

/// The derivatives by the numbers of shapes of a pair with a round body.
std::vector<Vec3> gradient_of_round_pair(const Overlap& overlap) {
  const std::span<const Placed> bodies = overlap.bodies();
  const bool by_radius = grows_by_radius(bodies[0].shape) || grows_by_radius(bodies[1].shape);
  const std::array<double, 2> owned = by_radius ? owned_areas(overlap) : std::array{kNaN, kNaN};
  std::vector<Vec3> found;
  for (int i = 0; i < 2; ++i) {
    const Shape& shape = bodies[i].shape;
    if (!bounded(shape)) found.push_back({norm(overlap.measures().pulls[i].force), 0, 0});
    else if (!grows_by_radius(shape)) found.push_back({kNaN, kNaN, kNaN});
    else found.push_back({owned[i], std::holds_alternative<Capsule>(shape) ? kNaN : 0, 0});
  }
  return found;
}

std::vector<Vec3> gradient_of_polyhedra(const Overlap& overlap) {
  const std::span<const Placed> bodies = overlap.bodies();
  std::optional<SideAreas> clipped;
  if (overlap.pair() && (overlap.way() == Way::kClipping || overlap.way() == Way::kWideClipping))
    clip(bodies[0], bodies[1], &clipped);
  std::vector<Vec3> found =
      clipped ? std::vector<Vec3>(clipped->begin(), clipped->end()) : areas_of_sides(overlap.boundary(), bodies);
  for (size_t i = 0; i < bodies.size(); ++i)
    if (polytope_of(bodies[i].shape)) found[i] = {kNaN, kNaN, kNaN};
  return found;
}

}  // namespace

std::vector<Vec3> shape_gradient(const Overlap& overlap) {
  const size_t count = overlap.bodies().size();
  if (overlap.status() != Status::kOverlapping) return std::vector<Vec3>(count);
  if (polyhedral(overlap.bodies())) return gradient_of_polyhedra(overlap);
  return overlap.pair() ? gradient_of_round_pair(overlap) : std::vector<Vec3>(count, {kNaN, kNaN, kNaN});
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
