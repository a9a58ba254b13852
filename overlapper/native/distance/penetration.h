#pragma once

#include "distance/least_translation.h"
#include "shapes/shape.h"

namespace overlapper {

/// Boxes and half-spaces in closed form, polytopes of few facets by their normals and the arcs between these; for the
/// rest EPA (van den Bergen 2001) on the difference of the cores. Its polytope may start beside the origin: the facet
/// of least offset is pushed out until it lies on the boundary of A - B, and only then does its offset count. The depth
/// returned is the support of A - B along `normal`, so the translation does separate, whatever rounding did to the
/// facet.
Penetration penetration(const Placed& a, const Placed& b);

/// The depth of the cores of two bodies by EPA, and how much of it the polytope has inside: no less than that is the
/// least way out, whatever the shapes.
struct EnclosedDepth {
  Penetration depth;
  double lower;
};
EnclosedDepth enclosed_depth(const Placed& a, const Placed& b);

}  // namespace overlapper
