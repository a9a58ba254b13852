#pragma once

#include <optional>

#include "distance/least_translation.h"
#include "shapes/shape.h"

namespace overlapper {

/// The penetration() of two boxes or hulls of few facets, if they certainly overlap. No value for other pairs, nor
/// where rounding has merged facets that are not coplanar. The least way out is orthogonal to a facet of either body or
/// to an edge of each body. Pairs of edges are not tried one by one. Along the arc between the normals of the two
/// facets at an edge of `a`, the support of a is this edge. The known vertices of b bound the support of b. The search
/// asks b again only where two such bounds cross below the best way out.
std::optional<Penetration> polytope_penetration(const Placed& a, const Placed& b);

}  // namespace overlapper
