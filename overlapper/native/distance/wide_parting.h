#pragma once

#include "shapes/wide_body.h"

namespace overlapper {

/// The least translation that separates two bodies, in double-double, with bounds that hold despite rounding. Negative
/// for separated bodies; its size is then the distance.
struct WideParting {
  double depth = 0, lower = 0, upper = 0;  ///< m
  Vec3 normal;                             ///< unit, from b to a
};

/// The least translation of a and b. `hint` is the best known way out, from b to a. Coordinates count from `reference`.
/// At most one body may be a half-space.
///
/// A facet of the difference of two polytopes is parallel to a facet of either polytope or to an edge of each. The
/// normals of these facets include the least way out. Coordinates are relative to a point near the contact, where
/// rounding errors are small. Doubles with error bounds prove for nearly all normals that the way is longer.
/// Double-doubles measure the rest. Cylinders and ellipsoids have normals of their own; EPA bounds the ways that two of
/// these leave open. Without `bounds`, the bodies must overlap, and the bounds may not hold; this is faster.
WideParting wide_parting(const Placed& a, const Placed& b, Vec3 reference, Vec3 hint, bool bounds = true);

}  // namespace overlapper
