#pragma once

#include "geometry/vec.h"

namespace overlapper {

/// A box along the axes.
struct Bounds {
  Vec3 lower, upper;
};

/// m²
inline double surface(const Bounds& box) {
  const Vec3 side = box.upper - box.lower;
  return 2 * (side.x * side.y + side.y * side.z + side.z * side.x);
}

}  // namespace overlapper
