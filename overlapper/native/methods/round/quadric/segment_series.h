#pragma once

#include <array>

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

/// Of the half-angle of an arc: of narrower segments the closed forms leave only what rounding has not cancelled.
inline constexpr double kNarrow = 0.4;

}  // namespace overlapper::slicing
