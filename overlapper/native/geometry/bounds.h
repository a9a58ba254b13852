#pragma once

#include "geometry/vec.h"

namespace overlapper {

/// A box along the axes.
struct Bounds {
  Vec3 lower, upper;
};

/// Compares all sides: a branch at the first failure would be unpredictable.
inline bool meet(const Bounds& a, const Bounds& b) {
  return (a.lower.x <= b.upper.x) & (b.lower.x <= a.upper.x) & (a.lower.y <= b.upper.y) & (b.lower.y <= a.upper.y) &
         (a.lower.z <= b.upper.z) & (b.lower.z <= a.upper.z);
}

/// m²
inline double surface(const Bounds& box) {
  const Vec3 side = box.upper - box.lower;
  return 2 * (side.x * side.y + side.y * side.z + side.z * side.x);
}

}  // namespace overlapper
