#include "overlap/shape_gradient.h"

#include <algorithm>
#include <cmath>

#include "methods/choose.h"
#include "methods/clipping/clip.h"
#include "methods/round/round.h"
#include "shapes/tangents.h"

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

Vec3 along(int axis, double value) { return {axis == 0 ? value : 0, axis == 1 ? value : 0, axis == 2 ? value : 0}; }

/// How many numbers describe the size of a shape; a hull has its vertices instead.
int numbers_of(const Shape& shape) {
  if (std::holds_alternative<Capsule>(shape) || std::holds_alternative<Cylinder>(shape)) return 2;
  if (std::holds_alternative<Box>(shape) || std::holds_alternative<Ellipsoid>(shape)) return 3;
  return std::holds_alternative<Hull>(shape) ? 3 : 1;
}

std::vector<Vec3> areas_of_sides(const Boundary& boundary, std::span<const Placed> bodies) {
  std::vector<Vec3> areas(bodies.size());
  for (int f = 0; f < static_cast<int>(boundary.planes.size()); ++f) {
    const int owner = boundary.owner[f];
    const bool box = std::holds_alternative<Box>(bodies[owner].shape);
    areas[owner] += along(box ? axis_across(bodies[owner], boundary.planes[f].normal) : 0, area_of(boundary, f));
  }
  return areas;
}

/// Slices of a pair that overlaps, with a part of its surface that counts.
class SlicedSurface {
 public:
  explicit SlicedSurface(const Overlap& overlap)
      : at_(arranged(overlap.bodies())), inside_(wide(overlap.centroid() - at_.reference)) {}

  /// m²: the part of the common surface that a body owns. NaN if slices give up.
  double owned(int body) const {
    if (!whole_) whole_ = measures({});
    const auto& found = *whole_;
    return !found ? kNoDerivative : at_.order[0] == body ? found->first_area : found->area - found->first_area;
  }
  /// m²: the area of the faces of a body across its own axis k.
  double faces(int body, int k) const {
    const auto found = measures(counted(body, k));
    return found ? found->first_area : kNoDerivative;
  }
  /// m²: the area vector of the end of a capsule, along the axis that points to this end.
  double end(int body) const {
    const auto surface = counted(body, 2);
    const auto found = measures(surface);
    return found ? dot(found->pull.force, surface.axis) : kNoDerivative;
  }

 private:
  using Found = std::optional<pieces::RoundMeasures>;

  pieces::CountedSurface counted(int body, int k) const {
    const int place = at_.order[0] == body ? 0 : 1;
    return {place, at_.relative[place].pose.rotation * tangents::axis(k)};
  }
  Found measures(std::optional<pieces::CountedSurface> surface) const {
    return measure_by_slices({.a = at_.relative[0],
                              .b = at_.relative[1],
                              .reference = at_.reference,
                              .inside = inside_,
                              .counted = surface});
  }

  Arrangement at_;
  WideVector inside_;
  mutable std::optional<Found> whole_;
};

/// The derivatives by the numbers of shapes of a pair with a round body.
std::vector<Vec3> gradient_of_round_pair(const Overlap& overlap) {
  const std::span<const Placed> bodies = overlap.bodies();
  // Stretched balls are not cut into pieces.
  const bool pieces = !stretched(bodies[0].shape) && !stretched(bodies[1].shape);
  const SlicedSurface surface(overlap);
  std::vector<Vec3> found;
  for (int i = 0; i < 2; ++i) {
    const Shape& shape = bodies[i].shape;
    const auto faces = [&](int k) { return pieces ? surface.faces(i, k) : kNoDerivative; };
    const Vec3 force = overlap.measures().pulls[i].force;
    if (!bounded(shape)) {
      found.push_back({norm(force), 0, 0});
    } else if (std::holds_alternative<Box>(shape)) {
      found.push_back({faces(0), faces(1), faces(2)});
    } else if (std::holds_alternative<Sphere>(shape) || std::holds_alternative<RoundedHull>(shape)) {
      found.push_back({surface.owned(i), 0, 0});
    } else if (std::holds_alternative<Capsule>(shape)) {
      // Half of the length moves each end. The area vectors of both ends add up to the force along the axis.
      const bool ball = std::get<Capsule>(shape).length == 0;
      const double along = dot(bodies[i].pose.rotation * tangents::axis(2), force);
      found.push_back({surface.owned(i), pieces && !ball ? surface.end(i) - along / 2 : kNoDerivative, 0});
    } else if (std::holds_alternative<Cylinder>(shape)) {
      const double ends = faces(2);
      found.push_back({surface.owned(i) - ends, ends / 2, 0});
    } else {
      found.push_back({kNoDerivative, kNoDerivative, kNoDerivative});
    }
  }
  return found;
}

/// The numbers of a shape, by the facets of an enclosing polytope. The area of a facet counts with the speed at which
/// its plane moves out.
std::vector<Vec3> gradient_of_group(const Overlap& overlap) {
  const std::span<const Placed> bodies = overlap.bodies();
  const Boundary& boundary = overlap.boundary();
  std::vector<Vec3> found = areas_of_sides(boundary, bodies);
  for (int f = 0; f < static_cast<int>(boundary.planes.size()); ++f) {
    const int owner = boundary.owner[f];
    const Shape& shape = bodies[owner].shape;
    const Vec3 axis = bodies[owner].pose.rotation * tangents::axis(2);
    const double area = area_of(boundary, f), along = std::abs(dot(boundary.planes[f].normal, axis));
    if (std::holds_alternative<Capsule>(shape)) found[owner].y += area * along / 2;
    if (!std::holds_alternative<Cylinder>(shape)) continue;
    // Planes of a cylinder are across its axis, or along it.
    if (along > 0.5) found[owner] += {-area, area / 2, 0};
  }
  for (size_t i = 0; i < bodies.size(); ++i)
    if (std::holds_alternative<Ellipsoid>(bodies[i].shape) || std::holds_alternative<Hull>(bodies[i].shape))
      found[i] = {kNoDerivative, kNoDerivative, kNoDerivative};
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
    if (polytope_of(bodies[i].shape)) found[i] = {kNoDerivative, kNoDerivative, kNoDerivative};
  return found;
}

}  // namespace

int axis_across(const Placed& box, Vec3 normal) {
  const Vec3 local = abs(apply_transposed(box.pose.rotation, normal));
  return local.x >= local.y && local.x >= local.z ? 0 : local.y >= local.z ? 1 : 2;
}

std::vector<Vec3> shape_gradient(const Overlap& overlap) {
  const size_t count = overlap.bodies().size();
  if (overlap.status() != Status::kOverlapping) return std::vector<Vec3>(count);
  if (polyhedral(overlap.bodies())) return gradient_of_polyhedra(overlap);
  return overlap.pair() ? gradient_of_round_pair(overlap) : gradient_of_group(overlap);
}

std::vector<Vec3> shape_gradient_errors(const Overlap& overlap) {
  const std::span<const Placed> bodies = overlap.bodies();
  const std::vector<Vec3> found = shape_gradient(overlap);
  const bool overlapping = overlap.status() == Status::kOverlapping, flat = polyhedral(bodies);
  const bool enclosed = overlapping && !flat && !overlap.pair();
  std::vector<Vec3> sides;
  if (overlapping && flat) sides = areas_of_sides(overlap.boundary(), bodies);
  const Errors errors = enclosed ? measured_with_errors(overlap.region(), bodies).errors : overlap.errors();
  std::vector<Vec3> bounds;
  for (size_t i = 0; i < bodies.size(); ++i) {
    // Numbers of round bodies are differences of two areas at most.
    const double area = (flat ? 1 : 2) * errors.gradient[i][0];
    const int numbers = numbers_of(bodies[i].shape);
    const auto bound = [&](int k) {
      if (k >= numbers) return 0.0;
      const double apart = sides.empty() ? 0 : std::abs(found[i][k] - sides[i][k]);
      return std::isnan(found[i][k]) ? kNoDerivative : area + apart;
    };
    bounds.push_back({bound(0), bound(1), bound(2)});
  }
  return bounds;
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
