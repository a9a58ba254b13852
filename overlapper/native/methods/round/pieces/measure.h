#pragma once

#include <array>
#include <optional>

#include "geometry/measures.h"
#include "geometry/patch.h"
#include "geometry/wide.h"
#include "shapes/shape.h"

namespace overlapper::pieces {

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

/// A pair that overlaps.
struct SlicedPair {
  const Placed &a, &b;  ///< about the reference
  Vec3 reference;
  WideVector inside;           ///< a point of the common set, as deep inside as can be told, about the reference
  double outwards = 0;         ///< m: how far the surface of one of the bodies is moved
  int owner = 0;               ///< whose part of the surface the patch adds up
  PatchSums* patch = nullptr;  ///< if wanted, it is added to; it counts from `inside`
};

/// Every body is cut into pieces that planes leave of a ball or a cylinder, or of nothing round. Slices orthogonal to
/// the axes of cylinders are convex polygons cut by one disc at most. What they hold is integrated between the values
/// at which their outline changes. No term is negative, so that nothing cancels. All numbers are distances from the
/// point inside, found in double-double, so that a contact of any depth is measured to the same digits. Compare
/// Strobl, Formella and Pöschel (2016), who integrate a ball over a tetrahedron in closed form.
///
/// Nothing if the error would be larger than 1e-8 of the volume, not counting by how much facets are not flat, or if
/// moving a surface leaves nothing of something round.
using Slicing = std::optional<RoundMeasures> (*)(const SlicedPair&);

/// Spheres, capsules and cylinders, with each other and with boxes, hulls and half-spaces.
std::optional<RoundMeasures> measure_pieces(const SlicedPair& pair);

/// Rounded hulls, with each other and with all of these. They have many pieces, of which few lie near the common set.
std::optional<RoundMeasures> measure_culled_pieces(const SlicedPair& pair);

/// An ellipsoid and a box, a hull or a half-space: the ball that becomes the ellipsoid is measured.
std::optional<RoundMeasures> measure_stretched(const SlicedPair& pair);

}  // namespace overlapper::pieces
