#pragma once

#include <array>
#include <vector>

#include "geometry/wide.h"

namespace overlapper {

/// A number without rounding: the sum of doubles that do not overlap, smallest first (Shewchuk 1997, section 2). Sums
/// and products are exact unless a product underflows.
class Exact {
 public:
  Exact(double value = 0) { add(value); }

  int sign() const { return term_.empty() ? 0 : (term_.back() > 0) - (term_.back() < 0); }

  friend Exact operator+(Exact a, const Exact& b) {
    for (const double term : b.term_) a.add(term);
    return a;
  }
  friend Exact operator-(Exact a) {
    for (double& term : a.term_) term = -term;
    return a;
  }
  friend Exact operator-(const Exact& a, const Exact& b) { return a + -b; }
  friend Exact operator*(const Exact& a, const Exact& b) {
    Exact sum;
    for (const double p : a.term_)
      for (const double q : b.term_) {
        const DoubleDouble product = two_product(p, q);
        sum.add(product.tail), sum.add(product.head);
      }
    return sum;
  }

 private:
  void add(double value) {
    size_t kept = 0;
    for (const double term : term_) {
      const DoubleDouble sum = two_sum(value, term);
      value = sum.head;
      if (sum.tail != 0) term_[kept++] = sum.tail;
    }
    term_.resize(kept);
    if (value != 0) term_.push_back(value);
  }

  std::vector<double> term_;
};

using ExactVector = std::array<Exact, 3>;

inline Exact dot(const ExactVector& a, const ExactVector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline ExactVector cross(const ExactVector& a, const ExactVector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

}  // namespace overlapper
