#pragma once

#include "methods/round/quadric/segment_series.h"

namespace overlapper::quadric {

/// Of a unit disc's segment, from half its arc's angle x, the sine and the cosine of that.
inline slicing::Segment segment(double x, double s, double c) {
  static constexpr slicing::SegmentSeries kSeries;
  if (x >= slicing::kNarrow) {
    const double area = x - s * c, cube = s * s * s, from_disc = 2.0 / 3 * cube;
    const double across = area / 4 + cube * c / 2 - 2 * c * from_disc + c * c * area;
    return {area, from_disc - c * area, across, area / 4 - cube * c / 6};
  }
  const double square = x * x, cube = square * x;
  slicing::Segment sum{};
  for (int k = slicing::SegmentSeries::kTerms - 1; k >= 0; --k) {
    const slicing::Segment& term = kSeries.term[k];
    sum = {sum.area * square + term.area, sum.first_across * square + term.first_across,
           sum.second_across * square + term.second_across, sum.second_along * square + term.second_along};
  }
  return {cube * sum.area, cube * sum.first_across, cube * sum.second_across, cube * sum.second_along};
}

}  // namespace overlapper::quadric
