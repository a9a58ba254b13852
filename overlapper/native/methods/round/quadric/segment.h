#pragma once

#include <array>
#include <cstddef>
#include <utility>

namespace overlapper::quadric {

/// For narrower half angles of an arc, the terms of the closed forms cancel and leave mostly rounding.
inline constexpr double kNarrow = 0.4;

/// Taylor series in the half angle x of an arc of the unit circle. Each member holds the coefficients of x³ (x²)ᵏ of
/// one function. They are rational numbers with numerators that doubles hold exactly. The first six are integrals over
/// the segment between the arc and its chord, about the middle of the chord. Coordinate a is across the chord, towards
/// the arc; b is along the chord.
struct SegmentSeries {
  static constexpr size_t kTerms = 12;
  using Coefficients = std::array<double, kTerms>;

  Coefficients area{};           ///< x − sin x cos x
  Coefficients first_across{};   ///< ∫ a dA = ⅔ sin³ x − cos x times the area
  Coefficients second_across{};  ///< ∫ a² dA
  Coefficients second_along{};   ///< ∫ b² dA
  Coefficients third_across{};   ///< ∫ a³ dA
  Coefficients across_along{};   ///< ∫ a b² dA
  Coefficients bulge{};          ///< sin x − x cos x = ½ ∫ (cos t − cos x) dt from −x to x
  Coefficients bulge_square{};   ///< ∫ (cos t − cos x)² dt from −x to x

  constexpr SegmentSeries() {
    double factorial = 1, two = 2, three = 3, four = 4, five = 5, sign = 1;  // n!, and powers of n = 2k + 1
    for (size_t i = 0; i < kTerms; ++i) {
      const double k = static_cast<double>(i + 1), n = 2 * k + 1;
      factorial *= (n - 1) * n;
      two *= 4, three *= 9, four *= 16, five *= 25, sign = -sign;
      area[i] = -sign * two / 2 / factorial;
      first_across[i] = sign * (9 + three - 12 * n) / (12 * factorial);
      second_across[i] = sign * (12 * n * two - 28 * two - four) / (48 * factorial);
      second_along[i] = sign * (four - 8 * two) / (48 * factorial);
      third_across[i] = sign * (300 + 175 * three + 3 * five - n * (720 + 40 * three)) / (480 * factorial);
      across_along[i] = sign * (80 + 15 * three - five - 120 * n) / (480 * factorial);
      bulge[i] = -sign * 2 * k / factorial;
      bulge_square[i] = sign * two * (k - 1) / factorial;
    }
  }
};
inline constexpr SegmentSeries kSegmentSeries;

/// The polynomial of the first terms of a series, without the factor x³. It is unrolled, so that compilers process
/// several angles at once.
template <size_t kTerms = SegmentSeries::kTerms>
inline double series(const SegmentSeries::Coefficients& coefficients, double square) {
  return [&]<size_t... kIndex>(std::index_sequence<kIndex...>) {
    double sum = 0;
    ((sum = sum * square + coefficients[kTerms - 1 - kIndex]), ...);
    return sum;
  }(std::make_index_sequence<kTerms>{});
}

/// Integrals over a segment of the unit disc, as in SegmentSeries.
struct Segment {
  double area, first_across, second_across, second_along;
};

/// The segment of half angle x >= 0, from x, its sine and its cosine.
inline Segment segment(double x, double sine, double cosine) {
  if (x >= kNarrow) {
    const double area = x - sine * cosine, cube = sine * sine * sine, from_disc = 2.0 / 3 * cube;
    const double across = area / 4 + cube * cosine / 2 - 2 * cosine * from_disc + cosine * cosine * area;
    return {area, from_disc - cosine * area, across, area / 4 - cube * cosine / 6};
  }
  const double square = x * x, cube = square * x;
  const SegmentSeries& of = kSegmentSeries;
  return {cube * series(of.area, square), cube * series(of.first_across, square),
          cube * series(of.second_across, square), cube * series(of.second_along, square)};
}

}  // namespace overlapper::quadric
