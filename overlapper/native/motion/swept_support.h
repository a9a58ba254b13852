#pragma once

#include "motion/moving_pair.h"

namespace overlapper {

/// How far a moving body reaches in a direction.
struct SweptSupport {
  double upper;  ///< m: no point of the body at any time is farther along the direction from the position at the start
  Vec3 point;    ///< of the body at some time, relative to the position at the start
};

/// The farthest point along a unit direction of a bounded body during its motion. The point is less far than `upper`
/// by `within` at most, unless rounding does not allow it.
SweptSupport swept_support(Mover& body, Vec3 velocity, double duration, Vec3 direction, double within);

}  // namespace overlapper
