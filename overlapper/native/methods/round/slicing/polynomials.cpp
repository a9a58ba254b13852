#include "methods/round/slicing/polynomials.h"

#include <cmath>

namespace overlapper::slicing {

double value(std::span<const double> polynomial, double t) {
  double sum = 0;
  for (size_t i = polynomial.size(); i-- > 0;) sum = sum * t + polynomial[i];
  return sum;
}

double root_between(std::span<const double> p, std::span<const double> slope, double low, double high, double at_low) {
  double t = low < 0 && high > 0 ? 0 : low / 2 + high / 2;
  constexpr int kMostSteps = 200;
  for (int step = 0; step < kMostSteps; ++step) {
    const double here = value(p, t);
    if (here == 0) return t;
    ((here < 0) == (at_low < 0) ? low : high) = t;
    double next = t - here / value(slope, t);
    if (!(next > low && next < high)) next = low / 2 + high / 2;
    if (next == t || !(next > low && next < high)) return next;
    if (std::abs(next - t) <= 0x1p-52 * std::abs(t)) return next;
    t = next;
  }
  return t;
}

}  // namespace overlapper::slicing
