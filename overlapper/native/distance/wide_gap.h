#pragma once

#include "shapes/wide_body.h"

namespace overlapper {

/// The nearest points of two bodies, in double-double.
struct WideGap {
  double distance = 0;   ///< right to rounding unless a rim is curved; negative where radii reach across
  double certified = 0;  ///< lower bound: so far apart are the support planes along `normal`
  double most = 0;       ///< upper bound: so far apart are the witness points of the cores, less the radii
  Vec3 normal;           ///< unit, from b to a; {0, 0, 0} if the cores have a common point
  WideVector witness_a, witness_b;
};

/// GJK on the cores, as in gjk.h. `rounding` is how far operations in double-double may move a point. At most one of
/// the two may be a half-space.
WideGap wide_gap(const WideBody& a, const WideBody& b, double rounding);

}  // namespace overlapper
