#pragma once

#include <optional>
#include <span>
#include <vector>

#include "methods/dual/region.h"
#include "shapes/shape.h"

namespace overlapper {

enum class Status { kSeparated, kTouching, kOverlapping };

/// What polytopes and half-spaces have in common. World coordinates; zeros if separated.
struct Clipped {
  Status status = Status::kSeparated;  ///< never kTouching
  bool measured = false;        ///< overlapping, and the volume is right to 1e-12; otherwise only the status counts
  bool widened = false;         ///< doubles were not enough for that
  double volume = 0, area = 0;  ///< m³, m²
  double volume_error = 0;      ///< m³: the true volume is within volume ± volume_error
  Vec3 centroid;
  int facets_touched = 0;  ///< facets of the common polytope
};

/// What the common volume changes by as a body moves.
template <class Vector>
struct PullOf {
  Vector force;   ///< d volume / d translation: the area vector of the facets that the body owns
  Vector moment;  ///< d volume / d rotation vector about the centroid
};
using Pull = PullOf<Vec3>;

/// What an edge adds to the pull of the patch that it borders on its left, about the origin: the area vector of a
/// patch, and the integral of x × n over it, are integrals along its border (Stokes).
template <class Vector>
inline PullOf<Vector> pull_along_border(const Vector& from, const Vector& to) {
  return {cross(from, to) / 2.0, (norm2(from) + dot(from, to) + norm2(to)) / 6.0 * (from - to)};
}

struct ClippedPair : Clipped {
  Vec3 pull;            ///< the force on the first body; the second has the opposite
  Vec3 moment;          ///< likewise
  bool traced = false;  ///< region_of_clipped() has the polytope, and it is more than touching, measured or not
};

struct ClippedGroup : Clipped {
  std::vector<Pull> pulls;  ///< per body
};

/// Decides by static filters alone, and measures what is common; nothing where one of the signs that it needs is not
/// certain, and for smooth shapes. Allocates nothing once its thread has seen bodies of that size.
///
/// A vertex of the common polytope is a vertex of one body inside the other or the point where an edge of one crosses a
/// facet of the other. Both are found from the signed distances of all vertices of each body from all planes of the
/// other. The common polytope is then known by its edges: whole and cut ones of either body, and for each pair of
/// facets that cross, the segment between the two points that lie on both. Volume, moments and area vectors are sums
/// over edges, in any order.
///
/// Where that is more to ask than it takes to follow the seam, trace() does it.
std::optional<ClippedPair> clip(const Placed& a, const Placed& b);

/// The same for any number of bodies: the common polytope of the first two meets the third, and so on. Nothing, too,
/// where doubles are not enough to measure it.
std::optional<ClippedGroup> clip(std::span<const Placed> bodies);

/// The polytope of a pair that clip() has traced; `a` and `b` in canonical order, owners 0 and 1.
std::optional<Region> region_of_clipped(const Placed& a, const Placed& b, Vec3 reference);

}  // namespace overlapper
