#include "overlap/shape_gradient.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "methods/choose.h"
#include "methods/clipping/clip.h"
#include "methods/round/round.h"
#include "overlap/facet_sections.h"
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

/// Derivatives by numbers, and bounds of their errors.
struct WithErrors {
  std::vector<Vec3> value, error;
};

constexpr Vec3 kNone{kNoDerivative, kNoDerivative, kNoDerivative};

/// A pair with an ellipsoid. If a body is stretched along an axis, its surface moves out at the speed n x of the place
/// x and the normal n along that axis. Half axes, half extents, and the numbers of cylinders stretch.
class EllipsoidPair {
 public:
  explicit EllipsoidPair(const Overlap& overlap)
      : overlap_(overlap), bodies_(overlap.bodies()), reference_(overlap.centroid()) {
    if (smooth(bodies_[0].shape) && smooth(bodies_[1].shape)) {
      known_ = find_by_slices();
      return;
    }
    flat_ = smooth(bodies_[0].shape) ? 1 : 0;
    faces_ = facet_sections(overlap, flat_, reference_);
    Mat3& moved = moved_[flat_];
    moved = {{}, {}, {}};
    Vec3 force = -overlap.measures().pulls[flat_].force;
    for (const FacetSection& face : faces_) {
      moved = moved + outer(face.first, face.normal), force += face.area * face.normal;
      face_error_ += face.error;
    }
    face_error_ += norm(force);
    moved_[1 - flat_] = whole() - moved;
  }

  WithErrors found(double area_error, double volume_error) const {
    WithErrors result;
    for (int i = 0; i < 2; ++i) {
      const std::array<Vec3, 2> of_body = numbers(i);
      const Vec3 size = of_body[1];
      result.value.push_back(of_body[0]);
      const double area = 2 * area_error + face_error_;
      const auto error = [&](int k) {
        if (std::isnan(of_body[0][k])) return kNoDerivative;
        return size[k] == 0 ? 0 : area * (1 + levers(i, k) / size[k]) + volume_error / size[k];
      };
      result.error.push_back({error(0), error(1), error(2)});
      if (!known_) result.value.back() = result.error.back() = kNone;
    }
    return result;
  }

 private:
  /// Derivatives, and the lengths that products of places and areas are divided by; 0 for numbers that do not exist.
  std::array<Vec3, 2> numbers(int i) const {
    const Shape& shape = bodies_[i].shape;
    const Vec3 force = overlap_.measures().pulls[i].force, d = stretching(i);
    if (const Ellipsoid* own = std::get_if<Ellipsoid>(&shape)) {
      const Vec3 h = own->half_axes;
      return {Vec3{d.x / h.x, d.y / h.y, d.z / h.z}, h};
    }
    if (const Box* own = std::get_if<Box>(&shape)) {
      Vec3 areas;
      for (const FacetSection& face : faces_) areas += along(axis_across(bodies_[i], face.normal), face.area);
      return {areas, own->half_extents};
    }
    if (const Cylinder* own = std::get_if<Cylinder>(&shape))
      return {Vec3{(d.x + d.y) / own->radius, d.z / own->length, 0}, Vec3{own->radius, own->length, 0}};
    if (const Capsule* own = std::get_if<Capsule>(&shape)) {
      // Radius and length together scale the capsule.
      const double all = d.x + d.y + d.z, by_length = (all - own->radius * owned_[i]) / own->length;
      return {Vec3{owned_[i], own->length > 0 ? by_length : kNoDerivative, 0}, Vec3{own->radius, own->length, 0}};
    }
    if (!bounded(shape)) return {Vec3{norm(force), 0, 0}, Vec3{reach(bodies_[1 - i].shape), 0, 0}};
    if (polytope_of(shape) && !smooth(shape)) return {kNone, Vec3{1, 1, 1}};
    return {Vec3{owned_[i], 0, 0}, Vec3{core_radius(shape), 0, 0}};
  }
  /// m: how much farther than the number itself a place may be that the number's derivative depends on.
  double levers(int i, int k) const {
    const Capsule* capsule = std::get_if<Capsule>(&bodies_[i].shape);
    return capsule && k == 1 ? 4 * capsule->reach() : 0;
  }
  Mat3 whole() const {
    const double volume = overlap_.volume();
    return {{volume, 0, 0}, {0, volume, 0}, {0, 0, volume}};
  }
  /// ∫ n x dA along each own axis, about the body's position.
  Vec3 stretching(int i) const {
    const Placed& body = bodies_[i];
    const Mat3 axes = transposed(body.pose.rotation);
    const Vec3 middle = body.position - reference_, force = overlap_.measures().pulls[i].force;
    const Mat3 own = axes * (moved_[i] - outer(middle, force)) * body.pose.rotation;
    return {own.row0.x, own.row1.y, own.row2.z};
  }

  bool find_by_slices() {
    const Arrangement at = arranged(bodies_);
    const auto ball = [](const Placed& body) {
      return std::holds_alternative<Ellipsoid>(body.shape) || std::holds_alternative<Sphere>(body.shape);
    };
    Mat3 first;
    const pieces::SlicedPair pair{.a = at.relative[0],
                                  .b = at.relative[1],
                                  .reference = at.reference,
                                  .inside = wide_difference(reference_, at.reference),
                                  .moved = &first};
    if (!stretched(bodies_[0].shape) && !stretched(bodies_[1].shape) && ball(bodies_[0]) && ball(bodies_[1])) {
      find_caps();
      return true;
    }
    const bool lenses = ball(bodies_[0]) && ball(bodies_[1]);
    const auto found = lenses ? lenses::measure_lenses(pair) : lenses::measure_in_parts(pair);
    if (!found) return false;
    const int of_first = at.order[0];
    moved_[of_first] = first, moved_[1 - of_first] = whole() - first;
    owned_[of_first] = found->first_area, owned_[1 - of_first] = found->area - found->first_area;
    return true;
  }

  /// Both parts of the surface are caps of balls.
  void find_caps() {
    const SlicedSurface surface(overlap_);
    for (int i = 0; i < 2; ++i) {
      owned_[i] = surface.owned(i);
      const double radius = revolution(bodies_[i].shape)->radius, square = radius * radius;
      const double height = owned_[i] / (2 * std::numbers::pi * square);  // in radii
      const double ahead = 2 * std::numbers::pi * square * height * (1 - height + height * height / 3);
      const double aside = (owned_[i] - ahead) / 2;
      const Vec3 force = overlap_.measures().pulls[i].force, n = unit(force);
      const Mat3 own = outer((ahead - aside) * n, n) + Mat3{{aside, 0, 0}, {0, aside, 0}, {0, 0, aside}};
      const Mat3 by_radius{radius * own.row0, radius * own.row1, radius * own.row2};
      moved_[i] = by_radius + outer(bodies_[i].position - reference_, force);
    }
  }

  const Overlap& overlap_;
  std::span<const Placed> bodies_;
  Vec3 reference_;
  std::array<Mat3, 2> moved_;      ///< ∫ x nᵀ dA over each body's part, about the reference
  std::array<double, 2> owned_{};  ///< m², if both are smooth
  int flat_ = -1;
  std::vector<FacetSection> faces_;  ///< of the flat body
  double face_error_ = 0;
  bool known_ = true;
};

bool with_ellipsoid(std::span<const Placed> bodies) {
  return std::ranges::any_of(bodies, [](const Placed& b) { return std::holds_alternative<Ellipsoid>(b.shape); });
}

/// The derivatives by the numbers of shapes of a pair with a round body.
std::vector<Vec3> gradient_of_round_pair(const Overlap& overlap) {
  const std::span<const Placed> bodies = overlap.bodies();
  if (with_ellipsoid(bodies)) return EllipsoidPair(overlap).found(0, 0).value;
  const SlicedSurface surface(overlap);
  std::vector<Vec3> found;
  for (int i = 0; i < 2; ++i) {
    const Shape& shape = bodies[i].shape;
    const auto faces = [&](int k) { return surface.faces(i, k); };
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
      found.push_back({surface.owned(i), !ball ? surface.end(i) - along / 2 : kNoDerivative, 0});
    } else if (std::holds_alternative<Cylinder>(shape)) {
      const double ends = faces(2);
      found.push_back({surface.owned(i) - ends, ends / 2, 0});
    } else {
      found.push_back(kNone);
    }
  }
  return found;
}

/// The speed at which the tangent plane of an ellipsoid with this unit normal moves out, by its half axes.
Vec3 speeds_of_plane(const Placed& body, Vec3 half_axes, Vec3 normal) {
  const Vec3 own = apply_transposed(body.pose.rotation, normal), reach = scaled(half_axes, own);
  return scaled(reach, own) / norm(reach);
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
    if (const Ellipsoid* own = std::get_if<Ellipsoid>(&shape)) {
      const Vec3 speeds = speeds_of_plane(bodies[owner], own->half_axes, boundary.planes[f].normal);
      found[owner] += area * (speeds - Vec3{1, 0, 0});
    }
    if (!std::holds_alternative<Cylinder>(shape)) continue;
    // Planes of a cylinder are across its axis, or along it.
    if (along > 0.5) found[owner] += {-area, area / 2, 0};
  }
  for (size_t i = 0; i < bodies.size(); ++i)
    if (std::holds_alternative<Hull>(bodies[i].shape)) found[i] = kNone;
  return found;
}

/// The numbers of ellipsoids in a group by the speed n x / a of a surface that is stretched along a half axis a. NaN
/// for other bodies.
std::vector<Vec3> stretched_in_group(const Overlap& overlap) {
  const std::span<const Placed> bodies = overlap.bodies();
  const Boundary& boundary = overlap.boundary();
  std::vector<Vec3> found;
  for (const Placed& body : bodies) found.push_back(std::holds_alternative<Ellipsoid>(body.shape) ? Vec3{} : kNone);
  for (int f = 0; f < static_cast<int>(boundary.planes.size()); ++f) {
    const Placed& body = bodies[boundary.owner[f]];
    const Ellipsoid* own = std::get_if<Ellipsoid>(&body.shape);
    if (!own) continue;
    const auto ring = boundary.facet(f);
    const auto corner = [&](int i) { return boundary.vertices[ring[i]] - body.position; };
    const Vec3 normal = boundary.planes[f].normal;
    Vec3 first;
    for (int i = 1; i + 1 < static_cast<int>(ring.size()); ++i) {
      const double twice = dot(cross(corner(i) - corner(0), corner(i + 1) - corner(0)), normal);
      first += twice / 6 * (corner(0) + corner(i) + corner(i + 1));
    }
    const Vec3 moved =
        scaled(apply_transposed(body.pose.rotation, normal), apply_transposed(body.pose.rotation, first));
    const Vec3 h = own->half_axes;
    found[boundary.owner[f]] += {moved.x / h.x, moved.y / h.y, moved.z / h.z};
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
    if (polytope_of(bodies[i].shape)) found[i] = kNone;
  return found;
}

}  // namespace

int axis_across(const Placed& box, Vec3 normal) {
  const Vec3 local = abs(apply_transposed(box.pose.rotation, normal));
  return local.x >= local.y && local.x >= local.z ? 0 : local.y >= local.z ? 1 : 2;
}

int numbers_of(const Shape& shape) {
  if (std::holds_alternative<Capsule>(shape) || std::holds_alternative<Cylinder>(shape)) return 2;
  if (std::holds_alternative<Box>(shape) || std::holds_alternative<Ellipsoid>(shape)) return 3;
  return std::holds_alternative<Hull>(shape) ? 3 : 1;
}

std::vector<Vec3> shape_gradient(const Overlap& overlap) {
  const size_t count = overlap.bodies().size();
  if (overlap.status() != Status::kOverlapping) return std::vector<Vec3>(count);
  if (polyhedral(overlap.bodies())) return gradient_of_polyhedra(overlap);
  return overlap.pair() ? gradient_of_round_pair(overlap) : gradient_of_group(overlap);
}

std::vector<Vec3> shape_gradient_errors(const Overlap& overlap) {
  const std::span<const Placed> bodies = overlap.bodies();
  const bool overlapping = overlap.status() == Status::kOverlapping, flat = polyhedral(bodies);
  if (overlapping && overlap.pair() && with_ellipsoid(bodies)) {
    const auto& of_areas = overlap.errors().gradient;
    return EllipsoidPair(overlap).found(std::max(of_areas[0][0], of_areas[1][0]), overlap.errors().volume).error;
  }
  const std::vector<Vec3> found = shape_gradient(overlap);
  const bool enclosed = overlapping && !flat && !overlap.pair();
  std::vector<Vec3> second;
  if (overlapping && flat) second = areas_of_sides(overlap.boundary(), bodies);
  if (enclosed) second = stretched_in_group(overlap);
  const Errors errors = enclosed ? measured_with_errors(overlap.region(), bodies).errors : overlap.errors();
  std::vector<Vec3> bounds;
  for (size_t i = 0; i < bodies.size(); ++i) {
    // Numbers of round bodies are differences of two areas at most.
    const double area = (flat ? 1 : 2) * errors.gradient[i][0];
    const int numbers = numbers_of(bodies[i].shape);
    const auto bound = [&](int k) {
      if (k >= numbers) return 0.0;
      const bool twice = !second.empty() && !std::isnan(second[i][k]);
      const double apart = twice ? std::abs(found[i][k] - second[i][k]) : 0;
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
