#pragma once

#include <array>

#include "geometry/vec.h"

namespace overlapper {

/// The corners of a box in the order of pytorch3d: around the bottom, then around the top.
using BoxCorners = std::array<Vec3, 8>;

/// The box that fits eight corners.
struct FittedBox {
  Vec3 sizes, centre;
  Mat3 axes;                 ///< columns: unit, orthogonal, right-handed
  std::array<int, 8> order;  ///< given[order[i]] is corner i in the order of pytorch3d
  double off;                ///< m: the largest distance of a given corner from the box's own corner
};

/// The corners of the unit box: -0.5 or 0.5 along each axis, in the order of pytorch3d.
inline constexpr BoxCorners kUnitCorners{{{-0.5, -0.5, -0.5},
                                          {0.5, -0.5, -0.5},
                                          {0.5, 0.5, -0.5},
                                          {-0.5, 0.5, -0.5},
                                          {-0.5, -0.5, 0.5},
                                          {0.5, -0.5, 0.5},
                                          {0.5, 0.5, 0.5},
                                          {-0.5, 0.5, 0.5}}};

/// The box of eight corners. The centre is the mean of the corners. A size is the length of the mean of four edges. The
/// axes are the rotation nearest to the directions of these means. Corners in the order of pytorch3d are taken at once.
/// Other orders are tried if a corner is farther off than `within`. All sizes are positive only for corners of some
/// volume.
FittedBox box_of_corners(const BoxCorners& given, double within);

}  // namespace overlapper
