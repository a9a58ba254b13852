#include "overlap/centroid_gradient.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "geometry/cancellation.h"
#include "geometry/constants.h"
#include "overlap/facet_sections.h"
#include "overlap/revolved_surface.h"
#include "overlap/rounded_surface.h"
#include "overlap/shape_gradient.h"

namespace overlapper {
namespace {

constexpr Mat3 kZeros{{0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
constexpr Vec3 kNoNumbers{kNoDerivative, kNoDerivative, kNoDerivative};

/// Integrals over the part of the surface that a body owns. Places x are about the centroid, and n is the normal.
struct SurfaceMoments {
  Mat3 first = kZeros;                                 ///< ∫ x nᵀ dA
  std::array<Mat3, 3> second{kZeros, kZeros, kZeros};  ///< for each coordinate j: ∫ x_j x nᵀ dA
  Mat3 by_size = kZeros;                               ///< ∫ x sᵀ dA with the speeds s by the numbers of the shape
};

/// The axial vector of a matrix: x × n for x nᵀ.
Vec3 turning(const Mat3& m) { return {m.row1.z - m.row2.y, m.row2.x - m.row0.z, m.row0.y - m.row1.x}; }

std::array<Vec3, 3> rows(const Mat3& m) { return {m.row0, m.row1, m.row2}; }

double largest(const Mat3& m) {
  return std::max({max_component(abs(m.row0)), max_component(abs(m.row1)), max_component(abs(m.row2))});
}

/// `lever` leads from the body's position to the centroid.
CentroidGradient gradient_of(const SurfaceMoments& moments, Vec3 lever, double volume) {
  CentroidGradient found;
  const std::array<Vec3, 3> first = rows(moments.first), by_size = rows(moments.by_size);
  for (int j = 0; j < 3; ++j)
    found.pose[j] = gradient_row({first[j] / volume, (turning(moments.second[j]) + cross(lever, first[j])) / volume});
  found.shape = {Vec3{} + by_size[0] / volume, Vec3{} + by_size[1] / volume, Vec3{} + by_size[2] / volume};
  return found;
}

CentroidGradient filled(double value) {
  CentroidGradient all;
  for (auto& row : all.pose) row.fill(value);
  const Vec3 row{value, value, value};
  all.shape = {row, row, row};
  return all;
}

/// Derivatives that are not known.
CentroidGradient unknown() { return filled(kNoDerivative); }

/// Changes each number to of(number, other, column). Columns of poses are 0 to 5, and those of shapes 6 to 8.
template <class Of>
void combine(CentroidGradient& by, const CentroidGradient& other, Of of) {
  for (int j = 0; j < 3; ++j)
    for (int k = 0; k < 6; ++k) by.pose[j][k] = of(by.pose[j][k], other.pose[j][k], k);
  const auto row = [&](Vec3& one, Vec3 two) { one = {of(one.x, two.x, 6), of(one.y, two.y, 7), of(one.z, two.z, 8)}; };
  row(by.shape.row0, other.shape.row0), row(by.shape.row1, other.shape.row1), row(by.shape.row2, other.shape.row2);
}

void add_difference(CentroidGradient& errors, const CentroidGradient& one, const CentroidGradient& two) {
  CentroidGradient apart = one;
  combine(apart, two, [](double a, double b, int) { return std::abs(a - b); });
  combine(errors, apart, [](double error, double more, int) { return error + more; });
}

/// The error of each number of a shape, and 0 for numbers that do not exist.
Vec3 for_numbers(const Shape& shape, double error) {
  const int count = numbers_of(shape);
  return {error, count > 1 ? error : 0, count > 2 ? error : 0};
}

/// Bounds of the errors of the sums over the part of a body.
struct SumErrors {
  double first = 0;   ///< m³, of ∫ x nᵀ dA
  double second = 0;  ///< m⁴, of ∫ x_j x nᵀ dA
  double volume = 0;  ///< m³
  Vec3 by_size;       ///< of ∫ x s dA; 0 for numbers that do not exist

  /// The errors of derivatives.
  CentroidGradient errors_of(const CentroidGradient& values, Vec3 lever, double of_volume) const {
    const double least = of_volume - volume;
    CentroidGradient errors = values;
    const double turned = second + norm(lever) * first;
    combine(errors, values, [&](double, double value, int k) {
      return ((k < 3 ? first : k < 6 ? turned : by_size[k - 6]) + volume * std::abs(value)) / least;
    });
    return errors;
  }
};

/// The speeds of a facet by the numbers of its owner's shape, a box or a half-space.
Vec3 speeds_of_facet(const Placed& body, Vec3 normal) {
  const int axis = bounded(body.shape) ? axis_across(body, normal) : 0;
  return {axis == 0 ? 1.0 : 0, axis == 1 ? 1.0 : 0, axis == 2 ? 1.0 : 0};
}

std::vector<CentroidGradient> of_polyhedra(std::span<const Placed> bodies, const Region& region) {
  const Mat3& axes = region.frame.axes;
  const PolytopeMoments in_frame = moments(region.polytope);
  const Vec3 centre = in_frame.first_moment / in_frame.volume;
  std::vector<Vec3> corners;
  for (Vec3 y : region.polytope.vertices) corners.push_back(axes * (y - centre));
  std::vector<SurfaceMoments> sums(bodies.size());
  for (int f = 0; f < region.polytope.facets(); ++f) {
    cancellation_point();
    const auto& [normal, slack, rounding, owner] = region.facets[f];
    const auto ring = region.polytope.facet(f);
    Vec3 first;
    Mat3 second = kZeros;
    for (size_t i = 1; i + 1 < ring.size(); ++i) {
      const Vec3 p = corners[ring[0]], q = corners[ring[i]], r = corners[ring[i + 1]], sum = p + q + r;
      const double area = dot(cross(q - p, r - p), normal) / 2;
      first += area / 3 * sum;
      for (Vec3 x : {p, q, r, sum}) second = second + outer(area / 12 * x, x);
    }
    SurfaceMoments& of_owner = sums[owner];
    of_owner.first = of_owner.first + outer(first, normal);
    const std::array<Vec3, 3> products = rows(second);
    for (int j = 0; j < 3; ++j) of_owner.second[j] = of_owner.second[j] + outer(products[j], normal);
    of_owner.by_size = of_owner.by_size + outer(first, speeds_of_facet(bodies[owner], normal));
  }
  const double volume = determinant(axes) * in_frame.volume;
  std::vector<CentroidGradient> found;
  for (size_t i = 0; i < bodies.size(); ++i) {
    const Vec3 lever = region.reference - bodies[i].position + region.frame.origin + axes * centre;
    found.push_back(gradient_of(sums[i], lever, volume));
    if (polytope_of(bodies[i].shape)) found.back().shape = unknown().shape;
  }
  return found;
}

std::vector<CentroidGradient> errors_of_polyhedra(const Overlap& overlap) {
  const std::span<const Placed> bodies = overlap.bodies();
  const Region& finest = overlap.finest_region();
  const std::vector<CentroidGradient> values = of_polyhedra(bodies, finest);
  const std::vector<CentroidGradient> stated = centroid_gradient(overlap);
  const StatedWithErrors measured = measured_with_errors(finest, bodies);
  const double radius = measured.radius, displaced = measured.displaced * measured.stated.area;
  std::vector<CentroidGradient> found;
  for (size_t i = 0; i < bodies.size(); ++i) {
    const double first = measured.errors.gradient[i][0] * radius + displaced;
    const SumErrors sums{first, (first + displaced) * radius, measured.errors.volume,
                         for_numbers(bodies[i].shape, first)};
    found.push_back(sums.errors_of(values[i], measured.stated.centroid - bodies[i].position, overlap.volume()));
    add_difference(found.back(), values[i], stated[i]);
  }
  return found;
}

/// Infinite where there are values.
std::vector<CentroidGradient> without_bounds(std::span<const Placed> bodies, std::vector<CentroidGradient> values) {
  for (size_t i = 0; i < bodies.size(); ++i) {
    const Vec3 of_numbers = for_numbers(bodies[i].shape, kInfinity);
    combine(values[i], values[i], [&](double value, double, int k) {
      return std::isnan(value) ? value : k < 6 ? kInfinity : of_numbers[k - 6];
    });
  }
  return values;
}

/// A pair with a round body. Places x are about the centroid.
///
/// The part of the surface that a body owns ends at the seam. The rays from the centroid to the seam and the part
/// together are closed. On the rays, x · n is zero. Gauss's and Stokes' theorems therefore give
/// ∫ x nᵀ dA = (d I + ∮ x (x × dx)ᵀ) / 3 and ∫ x_j x_k n dA = (m_j e_k + m_k e_j + ∮ x_j x_k x × dx) / 4,
/// for d = ∫ x · n dA and m = ∫ x (x · n) dA. For both bodies together, d is three times the volume, and m is zero.
/// Only one body therefore needs d and m.
class RoundPair {
 public:
  explicit RoundPair(const Overlap& overlap)
      : overlap_(overlap), bodies_(overlap.bodies()), centroid_(overlap.centroid()) {}

  /// Errors, too, if wanted.
  std::vector<CentroidGradient> found(std::vector<CentroidGradient>* errors = nullptr) {
    if (errors) *errors = {unknown(), unknown()};
    if (!std::ranges::all_of(bodies_, has_sums)) return {unknown(), unknown()};
    std::optional<Borders> borders = borders_of(overlap_);
    if (!borders) return {unknown(), unknown()};
    border_ = std::move(borders->seam), rims_ = std::move(borders->rims);
    add_seam();
    for (const int i : {0, 1}) look_at(i);
    complete(known_, sums_[known_]);
    SurfaceSums rest;
    rest.distance = 3 * overlap_.volume() - sums_[known_].distance, rest.moment = -sums_[known_].moment;
    complete(1 - known_, rest);
    std::vector<CentroidGradient> both;
    for (const int i : {0, 1}) {
      add_sizes(i);
      both.push_back(gradient_of(moments_[i], lever(i), overlap_.volume()));
    }
    if (errors) *errors = errors_of(both);
    return both;
  }

 private:
  /// False for kinds of round bodies whose surface cannot be summed.
  static bool has_sums(const Placed& body) {
    const Shape& shape = body.shape;
    return !smooth(shape) || stretched(shape) || revolution(shape) || polytope_of(shape);
  }

  void add_seam() {
    for (const int i : {0, 1})
      for (const BorderNode& node : border_[i]) {
        const Vec3 x = node.place, turned = cross(x, node.step);
        SurfaceMoments& sums = moments_[i];
        sums.first = sums.first + outer(x / 3, turned);
        for (int j = 0; j < 3; ++j) sums.second[j] = sums.second[j] + outer(x[j] / 4 * x, turned);
      }
  }

  /// Finds the sums of a body by its own surface.
  void look_at(int i) {
    const Shape& shape = bodies_[i].shape;
    SurfaceSums& sums = sums_[i];
    if (!smooth(shape)) {
      for (const FacetSection& face : facet_sections(overlap_, i, centroid_)) {
        const double distance = dot(face.normal, face.first);
        sums.distance += distance, sums.moment += distance / face.area * face.first;
        by_faces_ = by_faces_ + outer(face.first, face.normal);
        if (!polytope_of(shape))
          moments_[i].by_size = moments_[i].by_size + outer(face.first, speeds_of_facet(bodies_[i], face.normal));
      }
      known_ = flat_ = i;
    } else {
      const bool rounded_hull = std::holds_alternative<RoundedHull>(shape);
      sums = rounded_hull ? rounded_surface(overlap_, i, centroid_, border_[i], rims_[i])
                          : revolved_surface(bodies_[i], bodies_[1 - i], centroid_, border_[i]);
      if (known_ < 0 || simplicity(shape) > simplicity(bodies_[known_].shape)) known_ = i;
    }
  }

  /// Faces have the smallest errors, and ends of cylinders the largest.
  static int simplicity(const Shape& shape) {
    if (!smooth(shape)) return 3;
    if (std::holds_alternative<RoundedHull>(shape)) return -1;
    const auto round = revolution(shape);
    return !round || (round->round_ends && round->half_length == 0) ? 2 : round->round_ends ? 1 : 0;
  }

  void complete(int i, const SurfaceSums& sums) {
    const double d = sums.distance / 3;
    const Vec3 m = sums.moment / 4;
    SurfaceMoments& of = moments_[i];
    of.first = of.first + Mat3{{d, 0, 0}, {0, d, 0}, {0, 0, d}};
    const std::array<Vec3, 3> axes{Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}};
    for (int j = 0; j < 3; ++j) {
      const Mat3 across{m[j] * axes[0], m[j] * axes[1], m[j] * axes[2]};
      of.second[j] = of.second[j] + across + outer(m, axes[j]);
    }
  }

  /// ∫ x_j n y dA along each own axis, for y about the body's position: columns by axes.
  Mat3 stretching(int i) const {
    const Mat3& rotation = bodies_[i].pose.rotation;
    const Vec3 to_centroid = apply_transposed(rotation, lever(i));
    const std::array<Vec3, 3> first = rows(moments_[i].first);
    std::array<Vec3, 3> found;
    for (int j = 0; j < 3; ++j) {
      const Mat3 second = transposed(rotation) * moments_[i].second[j] * rotation;
      found[j] =
          Vec3{second.row0.x, second.row1.y, second.row2.z} + scaled(to_centroid, apply_transposed(rotation, first[j]));
    }
    return {found[0], found[1], found[2]};
  }

  /// The factor of ∫ x n · axis dA in ∫ x s dA for the length of a capsule, unless the surface has parts of both ends.
  /// The surface has no part of an end if the seam does not pass it, and the other body does not have its pole.
  std::optional<double> share_of_length(int i, double half) const {
    const Vec3 axis = bodies_[i].pose.rotation * Vec3{0, 0, 1};
    const Placed other = bodies_[1 - i].seen_from(centroid_);
    double share = 0;
    int ends = 0;
    for (const int side : {1, -1}) {
      const Vec3 away = side * axis, pole = (half + std::get<Capsule>(bodies_[i].shape).radius) * away - lever(i);
      const auto on_end = [&](const BorderNode& node) { return dot(away, node.place + lever(i)) >= half; };
      const bool within = !(signed_distance(other.ray_exit({}, pole), pole) > 0);
      if (within || std::ranges::any_of(border_[i], on_end)) share = side / 2.0, ++ends;
    }
    return ends < 2 ? std::optional(share) : std::nullopt;
  }

  void add_sizes(int i) {
    const Shape& shape = bodies_[i].shape;
    Mat3& by_size = moments_[i].by_size;
    const auto by = [&](Vec3 one, Vec3 two) { by_size = transposed({one, two, {}}); };
    const Mat3 along = transposed(stretching(i));
    if (const Ellipsoid* ellipsoid = std::get_if<Ellipsoid>(&shape)) {
      const Vec3 h = ellipsoid->half_axes;
      by_size = transposed({along.row0 / h.x, along.row1 / h.y, along.row2 / h.z});
    } else if (const Sphere* sphere = std::get_if<Sphere>(&shape)) {
      by((along.row0 + along.row1 + along.row2) / sphere->radius, {});
    } else if (const Cylinder* cylinder = std::get_if<Cylinder>(&shape)) {
      by((along.row0 + along.row1) / cylinder->radius, along.row2 / cylinder->length);
    } else if (const Capsule* capsule = std::get_if<Capsule>(&shape)) {
      // Half of the length moves each end. Radius and length together scale the capsule.
      const std::optional<double> share = share_of_length(i, capsule->length / 2);
      const Vec3 axis = bodies_[i].pose.rotation * Vec3{0, 0, 1}, scaled_up = along.row0 + along.row1 + along.row2;
      const Vec3 by_length = share ? *share * (moments_[i].first * axis) : sums_[i].by_length;
      const Vec3 by_radius = (scaled_up - capsule->length * by_length) / capsule->radius;
      one_end_[i] = share.has_value(), apart_[i] = norm(by_radius - sums_[i].by_radius);
      by(by_radius, capsule->length > 0 ? by_length : kNoNumbers);
    } else if (std::holds_alternative<RoundedHull>(shape)) {
      by(sums_[i].by_radius, {});
    } else if (polytope_of(shape)) {
      by_size = {kNoNumbers, kNoNumbers, kNoNumbers};
    }
  }

  Vec3 lever(int i) const { return centroid_ - bodies_[i].position; }

  /// m³: how far results that should be the same are apart, as an error of ∫ x nᵀ dA; m⁴: of ∫ x_j x nᵀ dA.
  std::array<double, 2> residuals(double radius) const {
    Vec3 gap, force, turned = turning(moments_[0].first);
    for (const BorderNode& node : border_[0]) gap += node.step, force += cross(node.place, node.step) / 2;
    const auto row = overlap_.gradient()[0];
    const Vec3 of_slices{row[0], row[1], row[2]}, moment{row[3], row[4], row[5]};
    const double missing = norm(gap) * radius + norm(force - of_slices);
    const double first = missing * radius + norm(turned + cross(lever(0), of_slices) - moment) +
                         std::abs(sums_[0].distance + sums_[1].distance - 3 * overlap_.volume());
    return {2 * first + (flat_ < 0 ? 0 : largest(by_faces_ - moments_[flat_].first)),
            2 * (first * radius + norm(sums_[0].moment + sums_[1].moment))};
  }

  std::vector<CentroidGradient> errors_of(const std::vector<CentroidGradient>& values) const {
    const Errors& errors = overlap_.errors();
    const double radius = std::sqrt(most_distance2(overlap_.inertia(), overlap_.volume()));
    const double displaced = errors.centroid * overlap_.area() + errors.volume;
    const auto [first, second] = residuals(radius);
    const std::vector<Vec3> areas = shape_gradient(overlap_);
    std::vector<CentroidGradient> found;
    for (int i = 0; i < 2; ++i) {
      SumErrors sums;
      sums.volume = errors.volume;
      sums.first = errors.gradient[i][0] * radius + displaced + first;
      sums.second = (errors.gradient[i][0] * radius + 3 * displaced) * radius + second;
      const double of_sums = radius * std::abs(sums_[i].area - areas[i].x);
      sums.by_size = errors_by_size(i, sums, 2 * (of_sums + apart_[i]));
      found.push_back(sums.errors_of(values[i], lever(i), overlap_.volume()));
    }
    return found;
  }

  /// `of_sums`: m³, of sums over the surface itself.
  Vec3 errors_by_size(int i, const SumErrors& sums, double of_sums) const {
    const Shape& shape = bodies_[i].shape;
    const Vec3 arm = abs(apply_transposed(bodies_[i].pose.rotation, lever(i)));
    const Vec3 along = sums.first * arm + Vec3{sums.second, sums.second, sums.second};
    if (const Ellipsoid* ellipsoid = std::get_if<Ellipsoid>(&shape)) {
      const Vec3 h = ellipsoid->half_axes;
      return {along.x / h.x, along.y / h.y, along.z / h.z};
    }
    if (const Sphere* sphere = std::get_if<Sphere>(&shape))
      return {(along.x + along.y + along.z) / sphere->radius, 0, 0};
    if (const Cylinder* cylinder = std::get_if<Cylinder>(&shape))
      return {(along.x + along.y) / cylinder->radius, along.z / cylinder->length, 0};
    const Capsule* capsule = std::get_if<Capsule>(&shape);
    if (capsule && one_end_[i]) {
      const double scaled_up = along.x + along.y + along.z;
      return {(scaled_up + capsule->length * sums.first) / capsule->radius, sums.first, 0};
    }
    return for_numbers(shape, sums.first + (smooth(shape) ? of_sums : 0));
  }

  const Overlap& overlap_;
  std::span<const Placed> bodies_;
  Vec3 centroid_;
  std::array<std::vector<BorderNode>, 2> border_, rims_;
  std::array<SurfaceMoments, 2> moments_;
  std::array<SurfaceSums, 2> sums_;
  std::array<bool, 2> one_end_{};  ///< a capsule's surface has a part of one end at most
  std::array<double, 2> apart_{};  ///< m³, of two ways to ∫ x dA over a capsule
  int known_ = -1;                 ///< the body whose sums count
  int flat_ = -1;                  ///< the body without round parts
  Mat3 by_faces_ = kZeros;         ///< ∫ x nᵀ dA over its part
};

}  // namespace

std::vector<CentroidGradient> centroid_gradient(const Overlap& overlap) {
  const size_t bodies = overlap.bodies().size();
  if (overlap.status() != Status::kOverlapping) return std::vector<CentroidGradient>(bodies);
  if (polyhedral(overlap.bodies())) return of_polyhedra(overlap.bodies(), overlap.drawn());
  if (overlap.pair()) return RoundPair(overlap).found();
  return std::vector<CentroidGradient>(bodies, unknown());
}

std::vector<CentroidGradient> centroid_gradient_errors(const Overlap& overlap) {
  const std::span<const Placed> bodies = overlap.bodies();
  if (overlap.method() == Method::kPaper) {
    const Overlap judge({bodies.begin(), bodies.end()}, overlap.tolerance(), Method::kAuto);
    std::vector<CentroidGradient> errors = centroid_gradient_errors(judge);
    const std::vector<CentroidGradient> stated = centroid_gradient(overlap), judged = centroid_gradient(judge);
    for (size_t i = 0; i < bodies.size(); ++i) add_difference(errors[i], stated[i], judged[i]);
    return errors;
  }
  if (overlap.status() == Status::kSeparated) return std::vector<CentroidGradient>(bodies.size());
  const bool known = overlap.status() == Status::kOverlapping && overlap.volume_error() < overlap.volume();
  if (known && polyhedral(bodies)) return errors_of_polyhedra(overlap);
  std::vector<CentroidGradient> errors(bodies.size(), unknown());
  if (known && overlap.pair()) RoundPair(overlap).found(&errors);
  if (!known) errors = without_bounds(bodies, centroid_gradient(overlap));
  return errors;
}

}  // namespace overlapper
