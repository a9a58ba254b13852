#pragma once

#include <span>
#include <vector>

#include "shape.h"

namespace overlapper {

/// Pairs i < j, sorted, of bodies whose boxes in the world meet; a half-space meets a box that reaches into it, and two
/// half-spaces are no pair.
std::vector<std::array<int, 2>> candidate_pairs(std::span<const Placed> bodies);

}  // namespace overlapper
