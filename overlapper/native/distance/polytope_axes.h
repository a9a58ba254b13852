#pragma once

#include <optional>

#include "distance/least_translation.h"
#include "shapes/shape.h"

namespace overlapper {

/// The penetration() of two boxes or hulls of few facets that overlap beyond doubt; none for other pairs, and where
/// rounding has merged facets that are not flat. The least way out is orthogonal to a facet of the difference: to a
/// facet of either body, or to an edge of each. Edges are not tried pair by pair. Along the arc between the normals of
/// the two facets at an edge of `a`, the support of a is that edge, and the support of b is bounded by the vertices of
/// b known so far; where two such bounds cross, and only if they cross below the best way out known, b is asked again.
std::optional<Penetration> polytope_penetration(const Placed& a, const Placed& b);

}  // namespace overlapper
