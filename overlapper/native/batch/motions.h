#pragma once

#include <span>
#include <vector>

#include "batch/pair_mask.h"
#include "motion/time_of_impact.h"

namespace overlapper {

/// A body at both ends of its motion. The velocity takes it from one pose to the other, less than half a turn.
struct MovingBody {
  Placed start, end;
  Velocity velocity;
};

/// The pairs i < j whose boxes around the whole motion meet, sorted. Two half-spaces make no pair.
std::vector<IndexPair> swept_pairs(std::span<const MovingBody> bodies, double duration);

/// time_of_impact() of each pair. The bits do not depend on `threads`. False if the caller cancels. No pair has two
/// half-spaces.
bool times_of_impact(std::span<const MovingBody> bodies, std::span<const IndexPair> pairs, double duration,
                     double width, int threads, std::span<Impact> found);

}  // namespace overlapper
