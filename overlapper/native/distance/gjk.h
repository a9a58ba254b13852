#pragma once

#include <array>

#include "distance/simplex.h"
#include "shapes/shape.h"

namespace overlapper {

/// GJK with witness points (Gilbert, Johnson, Keerthi 1988) on the cores of a and b. The core of a sphere is its
/// centre; the core of a capsule is its segment. Neither body may be a half-space. Coordinates should be relative to a
/// nearby point.
Separation separate_cores(const Placed& a, const Placed& b);

/// Nearest points of two shapes.
struct Distance {
  double distance = 0;  ///< negative by an unspecified amount if the cores overlap
  double gap = 0;       ///< certified lower bound of the distance along `normal`
  Vec3 normal;          ///< unit, from b to a; {0, 0, 0} if the shapes' cores overlap
  Vec3 witness_a, witness_b;
  /// m: lower bound of the overlap of the cores, but for the rounding of points.
  double overlap = 0;
};
Distance distance(const Placed& a, const Placed& b);

/// The simplex in which a search ended. Its corners are in the coordinates of the bodies, so that they move with them.
struct LastSimplex {
  std::array<DifferencePoint, 4> corner;
  int size = 0;
};

/// The same for the next poses of the same two bodies. The search starts from `last`, and writes its end there. A few
/// more bits of rounding may differ. `last` is left alone if one body is a half-space.
Distance distance(const Placed& a, const Placed& b, LastSimplex& last);

}  // namespace overlapper
