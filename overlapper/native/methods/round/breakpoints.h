#pragma once

#include <vector>

#include "methods/round/slice.h"

namespace overlapper::slicing {

/// Values of t between which slices are bounded by the same lines and arcs.
struct Interval {
  double low, high;
  Outline outline;
};

/// The intervals in which the slices of a stack hold something, one beside the other; false if they cannot be told.
///
/// Where three planes, two planes and a quadric, or a plane and a quadric whose section is extremal meet, and where two
/// discs cross, t has a closed form. A root too many costs time and moves nothing. Whatever else changes an outline, a
/// corner of a plane and two quadrics above all, shows by slices of an interval that have other outlines, and is found
/// by bisection. `closely` looks at more slices, and nearer to the ends of intervals.
bool find_intervals(const Stack& stack, bool closely, std::vector<Interval>& intervals);

}  // namespace overlapper::slicing
