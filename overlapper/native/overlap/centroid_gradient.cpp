#include "overlap/centroid_gradient.h"

#include "geometry/cancellation.h"
#include "overlap/shape_gradient.h"

namespace overlapper {
namespace {

constexpr Mat3 kZeros{{0, 0, 0}, {0, 0, 0}, {0, 0, 0}};

/// Integrals over the part of the surface that a body owns. Places x are about the centroid, and n is the normal.
struct SurfaceMoments {
  Mat3 first = kZeros;                                 ///< ∫ x nᵀ dA
  std::array<Mat3, 3> second{kZeros, kZeros, kZeros};  ///< for each coordinate j: ∫ x_j x nᵀ dA
  Mat3 by_size = kZeros;                               ///< ∫ x sᵀ dA with the speeds s by the numbers of the shape
};

/// The axial vector of a matrix: x × n for x nᵀ.
Vec3 turning(const Mat3& m) { return {m.row1.z - m.row2.y, m.row2.x - m.row0.z, m.row0.y - m.row1.x}; }

std::array<Vec3, 3> rows(const Mat3& m) { return {m.row0, m.row1, m.row2}; }

/// `lever` leads from the body's position to the centroid.
CentroidGradient gradient_of(const SurfaceMoments& moments, Vec3 lever, double volume) {
  CentroidGradient found;
  const std::array<Vec3, 3> first = rows(moments.first), by_size = rows(moments.by_size);
  for (int j = 0; j < 3; ++j)
    found.pose[j] = gradient_row({first[j] / volume, (turning(moments.second[j]) + cross(lever, first[j])) / volume});
  found.shape = {Vec3{} + by_size[0] / volume, Vec3{} + by_size[1] / volume, Vec3{} + by_size[2] / volume};
  return found;
}

/// Derivatives that are not known.
CentroidGradient unknown() {
  CentroidGradient none;
  for (auto& row : none.pose) row.fill(kNoDerivative);
  constexpr Vec3 kRow{kNoDerivative, kNoDerivative, kNoDerivative};
  none.shape = {kRow, kRow, kRow};
  return none;
}

/// The speeds of a facet by the numbers of its owner's shape, a box or a half-space.
Vec3 speeds_of_facet(const Placed& body, Vec3 normal) {
  const int axis = bounded(body.shape) ? axis_across(body, normal) : 0;
  return {axis == 0 ? 1.0 : 0, axis == 1 ? 1.0 : 0, axis == 2 ? 1.0 : 0};
}

std::vector<CentroidGradient> of_polyhedra(const Overlap& overlap) {
  const std::span<const Placed> bodies = overlap.bodies();
  const Region& region = overlap.drawn();
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

}  // namespace

std::vector<CentroidGradient> centroid_gradient(const Overlap& overlap) {
  const size_t bodies = overlap.bodies().size();
  if (overlap.status() != Status::kOverlapping) return std::vector<CentroidGradient>(bodies);
  if (polyhedral(overlap.bodies())) return of_polyhedra(overlap);
  return std::vector<CentroidGradient>(bodies, unknown());
}

}  // namespace overlapper
