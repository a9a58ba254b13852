#pragma once

#include <array>
#include <cmath>

namespace overlapper::slicing {

/// Integrals over the segment that a chord cuts from a unit disc, about the middle of the chord: `across` it, towards
/// the arc, and `along` it.
struct Segment {
  double area, first_across, second_across, second_along;
};

/// Coefficients of ψ³ (ψ²)ᵏ in the integrals' Taylor series: rational numbers whose numerators doubles hold.
struct SegmentSeries {
  static constexpr int kTerms = 12;
  std::array<Segment, kTerms> term{};

  constexpr SegmentSeries() {
    double factorial = 1, two = 2, three = 3, four = 4, sign = 1;  // (2k + 1)!, and powers 2k + 1
    for (int k = 1; k <= kTerms; ++k) {
      factorial *= 2.0 * k * (2.0 * k + 1);
      two *= 4, three *= 9, four *= 16, sign = -sign;
      const double n = 2.0 * k + 1;
      term[k - 1] = {-sign * two / 2 / factorial, sign * (9 + three - 12 * n) / (12 * factorial),
                     sign * (12 * n * two - 28 * two - four) / (48 * factorial),
                     sign * (four - 8 * two) / (48 * factorial)};
    }
  }
};

/// By the half-angle of the arc, from 0 to π. Of a narrow segment the closed forms leave only what rounding has not
/// cancelled, and the series are used.
inline Segment segment(double half_angle) {
  static constexpr SegmentSeries kSeries;
  if (half_angle < 0.4) {
    const double square = half_angle * half_angle;
    Segment sum{};
    for (int k = SegmentSeries::kTerms - 1; k >= 0; --k) {
      const Segment& term = kSeries.term[k];
      sum.area = sum.area * square + term.area;
      sum.first_across = sum.first_across * square + term.first_across;
      sum.second_across = sum.second_across * square + term.second_across;
      sum.second_along = sum.second_along * square + term.second_along;
    }
    const double cube = square * half_angle;
    return {cube * sum.area, cube * sum.first_across, cube * sum.second_across, cube * sum.second_along};
  }
  const double s = std::sin(half_angle), c = std::cos(half_angle);
  const double area = half_angle - s * c, cube = s * s * s;
  return {area, 2.0 / 3 * cube - c * area, (area + 2 * cube * c) / 4 - 4.0 / 3 * c * cube + c * c * area,
          (3 * area - 2 * cube * c) / 12};
}

}  // namespace overlapper::slicing
