#pragma once

#include "shapes/wide_body.h"

namespace overlapper {

/// The least translation that parts two bodies, in double-double, and bounds of it that hold whatever rounding did;
/// negative for bodies apart, whose distance is then its size.
struct WideParting {
  double depth = 0, lower = 0, upper = 0;  ///< m
  Vec3 normal;                             ///< unit, from b to a
};

/// `hint` is a way out, as good as it is known, from b to a; coordinates count from `reference`. At most one of the two
/// may be a half-space.
///
/// The facets of the difference of two polytopes are parallel to a facet of either or to an edge of each, so the
/// normals of these hold the least way out. About a point near the contact, every number is as exact as it is near:
/// there doubles tell of nearly all normals, with bounds, that the way along them is longer, and double-doubles measure
/// the rest. Cylinders and ellipsoids have their own normals; what two of these leave
/// open is enclosed by EPA.
WideParting wide_parting(const Placed& a, const Placed& b, Vec3 reference, Vec3 hint);

}  // namespace overlapper
