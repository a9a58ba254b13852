#pragma once

#include <array>
#include <optional>
#include <vector>

#include "geometry/measures.h"
#include "geometry/patch.h"
#include "geometry/wide.h"
#include "shapes/shape.h"

namespace overlapper::pieces {

/// The measures of the common set of two bodies, at least one of them round, by the round shapes themselves.
struct RoundMeasures {
  double volume = 0, volume_error = 0, area = 0;
  double first_area = 0;     ///< m²: area of the first body's part of the surface
  double area_error = 0;     ///< error of the area by quadrature
  bool area_known = true;    ///< false if areas were left out
  double rounding = 0;       ///< m: bound of the movement of surfaces by rounding
  Vec3 centroid;             ///< about the reference
  Mat3 inertia;              ///< about the centroid, unit density
  double inertia_error = 0;  ///< m⁵: error of each entry by rounding, for an ellipsoid
  Pull pull;                 ///< on the first body, about the reference; the second body's is the opposite
  int facets_touched = 0;    ///< number of planes of the bodies in the measures
};

/// A part of the surface of one body that counts as all of the first body's surface. All other surface counts as the
/// second body's. It is the flat faces across an axis, and the ends of a capsule on the side that the axis points to.
struct CountedSurface {
  int body;   ///< 0 or 1
  Vec3 axis;  ///< unit, in the world
};

/// The surface of a ball or a cylinder of a rounded hull in the common surface.
struct RoundSurface {
  bool ball;
  Vec3 centre;  ///< about the inner point; of a cylinder: the middle of its edge
  Vec3 force;   ///< m²: ∫ n dA
  Vec3 along;   ///< m³, of a cylinder: ∫ s n dA, for the distance s along its axis from the centre
  Vec3 axis;    ///< of a cylinder
};

/// A pair that overlaps.
struct SlicedPair {
  const Placed &a, &b;  ///< about the reference
  Vec3 reference;
  WideVector inside;           ///< a point of the common set about the reference, as deep inside as known
  double outwards = 0;         ///< m: how far the surface of one body is moved out
  bool with_area = true;       ///< areas are wanted; they may be left out otherwise
  int owner = 0;               ///< the body whose surface the patch sums
  PatchSums* patch = nullptr;  ///< added to, if not null; relative to `inside`
  std::optional<CountedSurface> counted = {};  ///< only for balls, capsules, cylinders, rounded hulls and polyhedra
  Mat3* moved = nullptr;  ///< set to ∫ x nᵀ dA over the first body's part of the surface about `inside`, if not null;
                          ///< only for an ellipsoid with a smooth body
  std::vector<RoundSurface>* rounds = nullptr;  ///< set to the surfaces of the first body's balls and cylinders, if not
                                                ///< null; only for a rounded hull

  /// Sets `moved` from the sum over one body's part along the axes of `turn`. Over all of the surface, the sum is the
  /// volume times the identity.
  void set_moved(const Mat3& own, const Mat3& turn, double volume, bool of_second) const {
    const Mat3 of_body = turn * own * transposed(turn);
    const Mat3 whole{{volume, 0, 0}, {0, volume, 0}, {0, 0, volume}};
    *moved = of_second ? whole - of_body : of_body;
  }
};

/// Both bodies are cut into pieces: the parts of a ball or a cylinder, or of no round shape, within planes. Slices are
/// parallel to the axes of cylinders. They are convex polygons cut by at most one disc. Quadrature integrates over
/// intervals between the values at which the outline of slices changes. No term is negative, so nothing cancels. All
/// numbers are distances from the inner point, computed in double-double. A contact of any depth is therefore measured
/// to the same relative accuracy. Compare Strobl, Formella and Pöschel (2016), who integrate a ball over a tetrahedron
/// in closed form.
///
/// No value if the error would exceed 1e-8 of the volume, without the error of facets that are not flat. No value if
/// moving a surface leaves nothing of a round shape.
using Slicing = std::optional<RoundMeasures> (*)(const SlicedPair&);

/// Spheres, capsules and cylinders, with each other and with boxes, hulls and half-spaces.
std::optional<RoundMeasures> measure_pieces(const SlicedPair& pair);

/// Rounded hulls, with each other and with all of these shapes. They have many pieces, few of them near the common set.
std::optional<RoundMeasures> measure_culled_pieces(const SlicedPair& pair);

/// An ellipsoid and a box, a hull or a half-space: measures the ball that a stretch maps to the ellipsoid.
std::optional<RoundMeasures> measure_stretched(const SlicedPair& pair);

}  // namespace overlapper::pieces
