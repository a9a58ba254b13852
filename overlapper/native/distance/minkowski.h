#pragma once

#include <array>

#include "geometry/vec.h"
#include "shapes/shape.h"

namespace overlapper {

/// A point of the Minkowski difference A - B with the points of A and of B that make it.
struct DifferencePoint {
  Vec3 on_a, on_b;
  Vec3 difference() const { return on_a - on_b; }
};

/// One to four points of A - B and the weights (barycentric coordinates) of the point of their hull nearest to the
/// origin.
struct Simplex {
  std::array<DifferencePoint, 4> corner;
  std::array<double, 4> weight{};
  int size = 0;
  Vec3 nearest;  ///< that point: from the plane or line of the corners, so that it has a direction even when it is tiny

  /// The same combination of the points of A; a common point of both if `nearest` is the origin.
  Vec3 witness_a() const;
  Vec3 witness_b() const;
};

/// What GJK knows when it stops.
struct Separation {
  Simplex simplex;
  bool origin_inside = false;  ///< the simplex contains the origin, by exact signs
  double distance = 0;         ///< length of simplex.nearest(), 0 if the origin is inside; an upper bound
  double gap = 0;  ///< a lower bound: the support planes along `normal` are so far apart; negative if none separates
  Vec3 normal;     ///< unit, from b to a; {0, 0, 0} if the origin is inside
};

/// GJK with witness points (Gilbert, Johnson, Keerthi 1988) on the cores of a and b: spheres and capsules count as the
/// point or segment that their radius surrounds. Neither may be a half-space. Coordinates should be relative to
/// something near.
Separation separate_cores(const Placed& a, const Placed& b);

/// Nearest points of two shapes.
struct Distance {
  double distance = 0;  ///< negative by an unspecified amount if the cores overlap
  double gap = 0;       ///< certified lower bound of the distance along `normal`
  Vec3 normal;          ///< unit, from b to a; {0, 0, 0} if the shapes' cores overlap
  Vec3 witness_a, witness_b;
};
Distance distance(const Placed& a, const Placed& b);

/// The least translation that separates: moving a by depth * normal leaves the two touching.
struct Penetration {
  double depth = 0;  ///< negative if the shapes are apart
  Vec3 normal;       ///< unit, from b to a
};

/// Boxes and half-spaces in closed form, polytopes of few facets by their normals and the arcs between these; for the
/// rest EPA (van den Bergen 2001) on the difference of the cores. Its polytope may start beside the origin: the facet
/// of least offset is pushed out until it lies on the boundary of A - B, and only then does its offset count. The depth
/// returned is the support of A - B along `normal`, so the translation does separate, whatever rounding did to the
/// facet.
Penetration penetration(const Placed& a, const Placed& b);

/// Rounding to be expected in sums of coordinates of that size: a rotation, a translation and a dot product make about
/// 16 roundings of at most half an ulp.
inline double rounding(double magnitude) { return 16 * 0x1p-53 * magnitude; }

/// A sum beyond this has the sign that doubles give it: two rotations, a translation and a dot product, each of the
/// last bits of a quaternion's length included, may lose half as much. Within, wider arithmetic decides.
inline double doubt(double magnitude) { return 4 * rounding(magnitude); }

}  // namespace overlapper
