#pragma once

#include <array>

#include "overlap/overlap.h"

namespace overlapper {

/// The derivatives of the depth of a pair.
struct DepthGradient {
  std::array<std::array<double, 6>, 2> pose{};  ///< by translation, then rotation vector about the body's position
  std::array<Vec3, 2> shape{};                  ///< by the numbers of shape_gradient(); NaN for hulls
};

/// Zeros unless the pair overlaps.
///
/// The depth is the least of the translations along all directions that separate the bodies. Along the normal n, from b
/// to a, it is the farthest place of b along n less the farthest place of a along -n. Sizes change these two places.
/// The least depth does not change at first order if n turns, and a face's normal does not depend on sizes.
///
/// Moved apart, the bodies touch in a point. Each rotation moves this point along n. Where a face touches, or an edge
/// in a face, the depth has one-sided derivatives. One of the points that touch then counts.
DepthGradient depth_gradient(const Overlap& overlap);

}  // namespace overlapper
