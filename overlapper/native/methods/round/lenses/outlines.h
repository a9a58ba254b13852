#pragma once

#include <array>

#include "methods/round/lenses/discs.h"

namespace overlapper::lenses {

/// Values of t, in ascending order: the ends of the common set, and where the outline of slices changes between them. A
/// few more are among them: where the two circles nearly touch, and in geometric steps away from a place near which
/// something changes beside the interval.
struct Changes {
  std::array<double, 64> t;
  int count = 0;

  void add(double at) {
    if (count < static_cast<int>(t.size())) t[count++] = at;
  }
};
Changes changes(const Discs& discs);

/// What two discs share.
enum class Outline { kNothing, kFirst, kSecond, kLens };

/// The discs in a slice, in the slice's own axes: `ahead` from the first centre to the second, and `aside`. Places
/// count from the foot.
struct Section {
  Outline outline;
  Flat ahead;                  ///< unit
  double chord, aside;         ///< the place of the chord: the line where slacks are equal, and the line of centres
  double half_chord;           ///< of a lens
  double to_first, to_second;  ///< from either centre to the chord, along the line of centres; negative if past it
};
Section section(const Discs& discs, double t);

}  // namespace overlapper::lenses
