#pragma once

#include "shapes/wide_body.h"

namespace overlapper {

/// The nearest points of two bodies, in double-double.
struct WideGap {
  double distance = 0;   ///< upper bound, right to rounding unless a rim is curved; negative where radii reach across
  double certified = 0;  ///< lower bound: so far apart are the support planes along `normal`
  Vec3 normal;           ///< unit, from b to a; {0, 0, 0} if the cores have a common point
  WideVector witness_a, witness_b;
};

/// GJK on the cores, as in gjk.h. `rounding` is how far operations in double-double may move a point. At most one of
/// the two may be a half-space.
WideGap wide_gap(const WideBody& a, const WideBody& b, double rounding);

/// How far a has to move along `normal`, which points from b to a, until its support planes are those of b; negative if
/// they are apart along it.
double wide_depth(const WideBody& a, const WideBody& b, const WideVector& normal);

}  // namespace overlapper
