#pragma once

#include "motion/moving_pair.h"

namespace overlapper {

enum class Meeting {
  kSeparated,    ///< no common point at any time of the motion
  kImpact,       ///< separated before `time`, certainly overlapping at `time_upper`
  kTouching,     ///< the gap is within rounding; an overlap may be shorter than the wanted width
  kOverlapping,  ///< at the start
  kOpen,         ///< the limit of steps was reached: separated before `time`, unknown after it
};

struct Impact {
  Meeting status = Meeting::kOpen;
  double time = 0;           ///< s: no common point before it
  double time_upper = 0;     ///< s: the first common point is not later, if there is one
  double distance = 0;       ///< m: the least distance seen
  double distance_time = 0;  ///< s: when it was seen
  Vec3 normal;               ///< unit, from b to a, of a separating plane at `time`
  Vec3 point;                ///< half-way between the nearest points, not after `time_upper`
  int steps = 0;             ///< distances computed
};

/// The first common point of two moving bodies within `duration`. `width`, in s, is the wanted width of the interval.
/// This is conservative advancement along directions that turn with the bodies. The nearest points give a direction.
/// The bodies are separated until the gap along this direction may be closed. Throws std::invalid_argument if both
/// bodies are half-spaces.
Impact time_of_impact(const Placed& a, const Placed& b, const Velocity& of_a, const Velocity& of_b, double duration,
                      double width);

}  // namespace overlapper
