#pragma once

#include <optional>
#include <span>
#include <vector>

#include "methods/round/slicing/slice.h"

namespace overlapper::slicing {

/// How many ways there are to lay slices at most.
inline constexpr int kAxes = 5;

/// The slices of what walls leave of at most two rounds, not both of them balls, orthogonal to every cylinder's axis.
/// No point of them is farther from the origin than `extent`. Of the ways to lay them, `way` 0 is the one that suits
/// best. Nothing where there are too many walls, or not so many ways.
std::optional<Stack> stack_of(std::span<const Round> rounds, std::span<const Wall> walls, double extent, int way);

/// A plane that is nearly parallel to the slices of two cylinders, which may not be turned, but not quite, so that its
/// line rushes across them.
struct Rushing {
  double level;  ///< across the slices
  Vec3 beside;   ///< a point of it beside another: from there, doubles tell those slices
};
/// All of these by level, each with its point beside `point`.
std::vector<Rushing> rushing(std::span<const Round> rounds, std::span<const Wall> walls, Vec3 point);

}  // namespace overlapper::slicing
