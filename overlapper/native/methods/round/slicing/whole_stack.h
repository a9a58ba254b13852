#pragma once

#include <vector>

#include "methods/round/slicing/quadrature.h"

namespace overlapper::slicing {

/// The intervals of a stack. Intervals that end within rounding of a plane or a quadric that ends the stack are
/// extended to it. They then include the end face, whose width is the square root of the missing thickness.
struct DrawnIntervals {
  std::vector<Interval> intervals;
  int drawn_low = -1, drawn_high = -1;  ///< owners of the quadrics to whose ends intervals were extended
};

/// False if the intervals cannot be determined.
bool find_drawn_intervals(const Stack& stack, bool closely, DrawnIntervals& drawn);

/// Integrates over a whole stack with its end faces; arguments as for integrate(). Returns a bound of the missing
/// volume. If the sums are not those of a convex set, the error is its size.
double integrate_whole(const Stack& stack, const DrawnIntervals& drawn, double volume, double area, bool few,
                       double strictness, Sum& sum);

}  // namespace overlapper::slicing
