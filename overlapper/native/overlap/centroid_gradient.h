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

}  // namespace overlapper
