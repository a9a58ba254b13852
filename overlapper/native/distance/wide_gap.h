#pragma once

#include "shapes/wide_body.h"

namespace overlapper {

/// The nearest points of two bodies, in double-double.
struct WideGap {
  double distance = 0;   ///< right to rounding unless a rim is curved; negative if the radii overlap
  double certified = 0;  ///< lower bound: the gap between the supporting planes along `normal`
  double most = 0;       ///< upper bound: the distance of the cores' witness points, less the radii
  Vec3 normal;           ///< unit, from b to a; {0, 0, 0} if the cores have a common point
  WideVector witness_a, witness_b;
};

/// GJK on the cores, as in gjk.h. `rounding` bounds how far operations in double-double move a point. At most one body
/// may be a half-space.
WideGap wide_gap(const WideBody& a, const WideBody& b, double rounding);

}  // namespace overlapper
