#pragma once

#include <array>
#include <vector>

#include "overlap/overlap.h"

namespace overlapper {

/// The part of a facet of a box, a hull or a half-space, or of a rounded hull's core moved out by the radius, inside
/// another body.
struct FacetSection {
  std::array<int, 3> corners;  ///< of a hull: the triangle of its facet's fan
  Vec3 normal;
  double area = 0;
  Vec3 first;               ///< ∫ x dA, about the reference
  Mat3 second{{}, {}, {}};  ///< ∫ x xᵀ dA
  double error = 0;         ///< m², of the area
};

/// The parts of all facets of a body of a pair that overlaps. One of the bodies is round. Coordinates are about
/// `reference`, near the common set. A facet of a hull is a fan of triangles from its first corner.
///
/// Each piece of the other body has planes and at most one ball or cylinder. Within them, a facet is a polygon cut by
/// an ellipse. Arcs between corners become segments of a disc, which have closed forms. An ellipsoid is stretched to a
/// ball first.
std::vector<FacetSection> facet_sections(const Overlap& overlap, int body, Vec3 reference);

}  // namespace overlapper
