#pragma once

#include <vector>

#include "methods/round/slicing/slice.h"

namespace overlapper::slicing {

/// An interval of t in which the same lines and arcs bound the slices.
struct Interval {
  double low, high;
  Outline outline;
  double joined = 0;  ///< of the first and the last interval: the width of pointlike intervals that were joined to it
};

/// The contiguous intervals with non-empty slices of a stack; false if they cannot be determined.
///
/// t has a closed form where three planes meet, where two planes and a quadric meet, where a plane meets a quadric with
/// an extremal section, and where two discs cross. Where a plane meets a corner of two quadrics, samples of the corner
/// and of its turning points lead to t. An extra root costs time and changes nothing. The middle slice between two
/// values of t gives the outline. If the ends had another outline, the measured surface would not close. `closely`
/// samples many slices, up to the ends of intervals, and finds all other changes of an outline by bisection.
bool find_intervals(const Stack& stack, bool closely, std::vector<Interval>& intervals);

}  // namespace overlapper::slicing
