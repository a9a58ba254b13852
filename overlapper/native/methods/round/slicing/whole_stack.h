#pragma once

#include <vector>

#include "methods/round/slicing/quadrature.h"

namespace overlapper::slicing {

/// Intervals of a stack. Where they end within rounding of a plane or a quadric that ends the stack, they are drawn out
/// to it: the face there, or what is as wide as the root of how thin it is, belongs to them.
struct DrawnIntervals {
  std::vector<Interval> intervals;
  int drawn_low = -1, drawn_high = -1;  ///< the owners of quadrics to whose ends they are drawn out
};

/// False if the intervals cannot be told.
bool find_drawn_intervals(const Stack& stack, bool closely, DrawnIntervals& drawn);

/// Integrates over a whole stack, its end faces included, with arguments as for integrate(). Returns how much of the
/// volume may be missing. What is no convex set by the sums is worth its size as an error.
double integrate_whole(const Stack& stack, const DrawnIntervals& drawn, double volume, double area, bool few,
                       double strictness, Sum& sum);

}  // namespace overlapper::slicing
