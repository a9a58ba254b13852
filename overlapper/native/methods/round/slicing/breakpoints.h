#pragma once

#include <vector>

#include "methods/round/slicing/slice.h"

namespace overlapper::slicing {

/// Values of t between which slices are bounded by the same lines and arcs.
struct Interval {
  double low, high;
  Outline outline;
};

/// The intervals in which the slices of a stack hold something, one beside the other; false if they cannot be told.
///
/// Where three planes, two planes and a quadric, or a plane and a quadric whose section is extremal meet, and where two
/// discs cross, t has a closed form; where a plane meets a corner of two quadrics, samples of the corner and of where
/// it turns lead to it. A root too many costs time and moves nothing. Of what lies between two values of t, the slice
/// in the middle tells the outline: with another one at the ends, the surface that is measured does not close.
/// `closely` looks at many slices, up to the ends of intervals, and finds whatever else changes an outline by
/// bisection.
bool find_intervals(const Stack& stack, bool closely, std::vector<Interval>& intervals);

}  // namespace overlapper::slicing
