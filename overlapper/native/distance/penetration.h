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

}  // namespace overlapper
