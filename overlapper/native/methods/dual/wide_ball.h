#pragma once

#include <span>
#include <vector>

#include "methods/dual/deepest_ball.h"

namespace overlapper {

/// The largest ball in the common set, as in deepest_ball.h but in double-double. The search ends when it knows whether
/// the radius is above `margin` or below -margin.
struct WideBall {
  WideVector centre;
  double lower;                        ///< least slack at the centre
  double upper;                        ///< largest slack of any point
  std::vector<Owned<WidePlane>> cuts;  ///< the evaluated planes; they bound the common set
};

/// `hints` are planes to start with; only their normals are used. `reach` is the size of the coordinates, and
/// `rounding` bounds how far operations in double-double move a plane.
WideBall wide_deepest_ball(std::span<const WideBody> bodies, std::span<const OwnedPlane> hints, double margin,
                           double reach, double rounding);

}  // namespace overlapper
