#pragma once

#include <optional>
#include <span>

#include "methods/round/pieces.h"
#include "methods/round/slice.h"

namespace overlapper::slicing {

/// The slices of what walls leave of at most two rounds, not both of them balls, orthogonal to every cylinder's axis.
/// No point of them is farther from the origin than `extent`. Nothing where there are too many walls.
std::optional<Stack> stack_of(std::span<const Round> rounds, std::span<const Wall> walls, double extent);

}  // namespace overlapper::slicing
