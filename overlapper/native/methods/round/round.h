#pragma once

#include <array>
#include <optional>

#include "geometry/measures.h"
#include "geometry/patch.h"
#include "geometry/wide.h"
#include "shapes/shape.h"

namespace overlapper {

/// The measures of the common set of two bodies of which at least one is round, of the round shapes themselves.
struct RoundMeasures {
  double volume = 0, volume_error = 0, area = 0;
  double first_area = 0;     ///< m²: of the surface, what is the first body's
  double area_error = 0;     ///< what rules leave open of the area
  double rounding = 0;       ///< m: how far it may have moved surfaces
  Vec3 centroid;             ///< about the reference
  Mat3 inertia;              ///< about the centroid, unit density
  double inertia_error = 0;  ///< m⁵: what rounding leaves of an ellipsoid's, of each entry
  Pull pull;                 ///< on the first body, about the reference; that on the second is the opposite
  int facets_touched = 0;    ///< planes of the bodies that took part
};

/// Measures a pair that overlaps: pairs of spheres, capsules, cylinders and rounded hulls with each other and with
/// boxes, hulls and half-spaces, and of ellipsoids with the last three. `inside` is a point of the common set, as deep
/// inside as can be told; bodies and it are about the reference. Nothing if the error would be larger than 1e-8 of the
/// volume, not counting by how much facets are not flat, or if the pair is none of these.
///
/// Every body is cut into pieces that planes leave of a ball or a cylinder, or of nothing round. Slices orthogonal to
/// the axes of cylinders are convex polygons cut by one disc at most, and what they hold is integrated between the
/// values at which their outline changes. No term is negative, so that nothing cancels, and all numbers are distances
/// from the point inside, found in double-double, so that a contact of any depth is measured to the same digits.
/// Compare Strobl, Formella and Pöschel (2016), who integrate a ball over a tetrahedron in closed form.
///
/// `outwards` moves the surface of one of the bodies; nothing where that leaves nothing of something round.
std::optional<RoundMeasures> measure_round(const Placed& a, const Placed& b, Vec3 reference, const WideVector& inside,
                                           double outwards = 0);

/// Adds to `patch`, which counts from `inside`, what of the surface is `owner`'s of a pair that measure_round()
/// measures, to the same digits. False if that does not.
bool measure_round_patch(const Placed& a, const Placed& b, Vec3 reference, const WideVector& inside, int owner,
                         PatchSums& patch);

}  // namespace overlapper
