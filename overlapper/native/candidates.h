#pragma once

#include <array>
#include <span>
#include <vector>

#include "shape.h"

namespace overlapper {

using IndexPair = std::array<int, 2>;

/// What surely holds a placed shape.
struct Enclosure {
  /// Grown by what rounding may have moved its sides, so that bodies that touch have boxes that meet; infinite for a
  /// half-space.
  Bounds box;
  bool open = false;  ///< it is a half-space, that of
  Plane plane;
};
Enclosure enclosure(const Placed& placed);

/// Finds the pairs of boxes that meet by sweeping along the axis on which they are spread out most (Baraff 1992): boxes
/// sorted by their lower side, each tested against those that begin before it ends. Keeps its memory between calls.
class BoxSweep {
 public:
  /// Pairs i < j, sorted. A half-space meets a box that reaches into it, and two half-spaces are no pair.
  void run(std::span<const Enclosure> bodies, std::vector<IndexPair>& pairs);

 private:
  struct Entry {
    double lower, upper;                    ///< along the axis of the sweep
    double lower1, upper1, lower2, upper2;  ///< along the other two
    int body;
  };
  void sort_boxes(std::span<const Enclosure> bodies);

  std::vector<Entry> entries_;
  std::vector<int> closed_, open_;
};

}  // namespace overlapper
