#pragma once

#include "distance/least_translation.h"
#include "shapes/shape.h"

namespace overlapper {

/// The least translation that separates two bodies. Boxes and half-spaces have closed forms. Polytopes of few facets
/// use facet normals and the arcs between these. All others use EPA (van den Bergen 2001) on the difference of the
/// cores. EPA's polytope may start beside the origin: it pushes out the facet of least offset until this facet lies on
/// the boundary of A - B, and only then counts its offset. The returned depth is the support of A - B along `normal`.
/// The translation therefore separates the bodies, even if rounding tilted the facet.
Penetration penetration(const Placed& a, const Placed& b);

/// The depth of the cores of two bodies by EPA, and the depth of EPA's inner polytope. The inner depth is a lower bound
/// of the least translation, for all shapes.
struct EnclosedDepth {
  Penetration depth;
  double lower;
};
EnclosedDepth enclosed_depth(const Placed& a, const Placed& b);

}  // namespace overlapper
