#pragma once

#include <optional>
#include <span>
#include <vector>

#include "methods/round/slicing/slice.h"

namespace overlapper::slicing {

/// The largest number of directions for slices.
inline constexpr int kAxes = 5;

/// The slices, parallel to every cylinder's axis, of the part of some rounds inside walls. The rounds are at most two
/// cylinders, and then at most one ball. `extent` is an upper bound of the distance of the part's points from the
/// origin. `way` 0 is the most suitable direction of slices. `long_axis` is where the part is longest, if known. No
/// value if there are too many walls, or fewer directions.
std::optional<Stack> stack_of(std::span<const Round> rounds, std::span<const Wall> walls, double extent, int way,
                              const std::optional<Vec3>& long_axis = {});

/// A plane that is nearly, but not quite, parallel to the slices of two cylinders. Such slices cannot be turned, so the
/// plane's line moves quickly across them.
struct Rushing {
  double level;  ///< across the slices
  Vec3 beside;   ///< a point of the plane beside another point; about it, doubles resolve these slices
};
/// These planes by level, each with its point beside `point`. With `all`, planes count that are less parallel.
std::vector<Rushing> rushing(std::span<const Round> rounds, std::span<const Wall> walls, Vec3 point, bool all);

}  // namespace overlapper::slicing
