#pragma once

#include <optional>
#include <span>

#include "methods/round/pieces.h"
#include "methods/round/slice.h"

namespace overlapper::slicing {

/// How many ways there are to lay slices at most.
inline constexpr int kAxes = 5;

/// The slices of what walls leave of at most two rounds, not both of them balls, orthogonal to every cylinder's axis.
/// No point of them is farther from the origin than `extent`. Of the ways to lay them, `way` 0 is the one that suits
/// best. Nothing where there are too many walls, or not so many ways.
std::optional<Stack> stack_of(std::span<const Round> rounds, std::span<const Wall> walls, double extent, int way);

/// Of two cylinders, whose slices may not be turned, and a plane that is nearly parallel to these but not quite, so
/// that its line rushes across them: the point of the plane beside another. From there, doubles tell those slices.
std::optional<Vec3> beside_rushing(std::span<const Round> rounds, std::span<const Wall> walls, Vec3 point);

}  // namespace overlapper::slicing
