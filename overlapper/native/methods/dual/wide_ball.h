#pragma once

#include <span>
#include <vector>

#include "methods/dual/deepest_ball.h"

namespace overlapper {

/// The largest ball in the common set, as in deepest_ball.h but in double-double, as far as the question needs it: is
/// its radius above `margin`, or below -margin?
struct WideBall {
  WideVector centre;
  double lower;                        ///< least slack at the centre
  double upper;                        ///< no point has more
  std::vector<Owned<WidePlane>> cuts;  ///< the planes asked for; they bound the common set
};

/// `hints` are planes to begin with, of which only the normals count. `reach` is how large the coordinates are, and
/// `rounding` how far operations in double-double may move a plane.
WideBall wide_deepest_ball(std::span<const WideBody> bodies, std::span<const OwnedPlane> hints, double margin,
                           double reach, double rounding);

}  // namespace overlapper
