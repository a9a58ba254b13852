#pragma once

#include <array>
#include <cstddef>

namespace overlapper {

/// A sum of sums of two, of four, of eight and so on (Higham 1993). Each of n terms is rounded log2(n) times instead of
/// n times.
template <class Term>
class SumInPairs {
 public:
  void add(Term term) {
    size_t level = 0;
    for (size_t terms = terms_++; terms & 1; terms >>= 1) term += waiting_[level++];
    waiting_[level] = term;
  }
  Term total() const {
    Term sum{};
    for (size_t level = 0; terms_ >> level; ++level)
      if (terms_ >> level & 1) sum += waiting_[level];
    return sum;
  }

 private:
  size_t terms_ = 0;
  std::array<Term, 40> waiting_{};  ///< per level: the sum of 2^level terms, if one is left over
};

}  // namespace overlapper
