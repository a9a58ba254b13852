#pragma once

#include <array>
#include <vector>

#include "overlap/overlap.h"

namespace overlapper {

/// The derivatives of the centroid of the common set by the numbers of one body. Row j has those of coordinate j.
struct CentroidGradient {
  std::array<std::array<double, 6>, 3> pose{};  ///< by translation, then rotation vector about the body's position
  Mat3 shape{{}, {}, {}};                       ///< by the numbers of shape_gradient(); NaN for hulls
};

/// One for each body. Zeros unless overlapping. NaN for groups with a round body, and for a pair with a round body
/// whose surfaces coincide or touch along a line. NaN also if rounding has lost a part of the seam.
///
/// If the surface that a body owns moves out at the speed s, the volume V and the centroid C change by
/// V dC = ∫ (x - C) s dA. The speed of a twist v is v(x) · n. It is linear in x, so moments of the surface up to the
/// second degree give all derivatives by poses.
std::vector<CentroidGradient> centroid_gradient(const Overlap& overlap);

/// Bounds of the errors of each number of centroid_gradient(). NaN where it has no value. Infinite for bodies that
/// only touch, and where the error of the volume is as large as the volume.
///
/// Let R be the distance of the farthest point from the centroid. An area of uncertain owner, as bounded by
/// Errors::gradient, changes ∫ x s dA by at most R times the area. An error of the centroid changes it by that error
/// times the area. Polyhedra are computed a second time from planes in double-double. The difference is added.
///
/// Sums of pairs with a round body have errors of their own, by rounding of the seam's nodes and by quadrature. Other
/// results show them. The steps along the seam have the sum 0. Force and moment by the seam are compared with those by
/// slices, and the sums over both parts of the surface with 3 V and 0. First moments of faces have closed forms.
std::vector<CentroidGradient> centroid_gradient_errors(const Overlap& overlap);

}  // namespace overlapper
