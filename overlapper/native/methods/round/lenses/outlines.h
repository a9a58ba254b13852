#pragma once

#include <algorithm>
#include <array>

#include "methods/round/lenses/discs.h"

namespace overlapper::lenses {

/// Values of t, in ascending order: the ends of the common set, and the changes of the slices' outline between them.
/// There are some further values: where the two circles nearly touch, and in geometric steps away from a change just
/// outside an interval.
inline constexpr int kMostChanges = 256;
struct Changes {
  std::array<double, kMostChanges> t;
  int count = 0;

  /// A place t ± i `aside` where the common part of both discs is not analytic in t.
  struct Singular {
    double t, aside;
  };
  std::array<Singular, 12> singular;
  int singulars = 0;

  void add(double at) {
    if (count == kMostChanges) sort();
    if (count < kMostChanges) t[count++] = at;
  }
  /// Where many walls meet, equal values are found again and again. One of each is kept.
  void sort() {
    std::sort(t.begin(), t.begin() + count);
    count = static_cast<int>(std::unique(t.begin(), t.begin() + count) - t.begin());
  }
};
Changes changes(const Discs& discs);

/// The common part of two discs.
enum class Outline { kNothing, kFirst, kSecond, kLens };

/// The discs in a slice, in the slice's own axes: `ahead` from the first centre to the second, and `aside`. Places are
/// relative to the foot.
struct Section {
  Outline outline;
  Flat ahead;                  ///< unit
  double chord, aside;         ///< the place of the chord: the line where slacks are equal, and the line of centres
  double half_chord;           ///< of a lens
  double to_first, to_second;  ///< from either centre to the chord, along the line of centres; negative if past it
};
Section section(const Discs& discs, double t);

}  // namespace overlapper::lenses
