#pragma once

#include <array>
#include <cstddef>
#include <span>

namespace overlapper::slicing {

/// The product of two polynomials, by coefficients from the constant term upwards.
template <size_t kFirst, size_t kSecond>
std::array<double, kFirst + kSecond - 1> product(const std::array<double, kFirst>& a,
                                                 const std::array<double, kSecond>& b) {
  std::array<double, kFirst + kSecond - 1> result{};
  for (size_t i = 0; i < kFirst; ++i)
    for (size_t j = 0; j < kSecond; ++j) result[i + j] += a[i] * b[j];
  return result;
}

double value(std::span<const double> polynomial, double t);

/// The root between two values of t where a polynomial has different signs, by Newton's method and halving.
double root_between(std::span<const double> p, std::span<const double> slope, double low, double high, double at_low);

/// The roots of a polynomial between two values of t at which its sign changes, between those of its slope.
struct Roots {
  std::array<double, 6> t;
  int count = 0;
};
template <size_t kDegree>
Roots roots(const std::array<double, kDegree + 1>& p, double low, double high, Roots* bends = nullptr) {
  Roots found;
  if constexpr (kDegree > 0) {
    std::array<double, kDegree> slope;
    for (size_t i = 0; i < kDegree; ++i) slope[i] = static_cast<double>(i + 1) * p[i + 1];
    const Roots turns = roots<kDegree - 1>(slope, low, high);
    double from = low, at_from = value(p, low);
    for (int i = 0; i <= turns.count; ++i) {
      const double to = i < turns.count ? turns.t[i] : high, at_to = value(p, to);
      if ((at_from < 0) != (at_to < 0)) found.t[found.count++] = root_between(p, slope, from, to, at_from);
      from = to, at_from = at_to;
    }
    if (bends) *bends = turns;
  }
  return found;
}

}  // namespace overlapper::slicing
