#pragma once

#include <optional>
#include <span>

#include "geometry/measures.h"
#include "geometry/patch.h"
#include "shapes/shape.h"

namespace overlapper {

/// What polytopes and half-spaces have in common, by static filters: nothing where one of the signs that it takes is
/// not certain. At least one body is bounded, none is round, and hulls are closed. Allocates nothing once its thread
/// has seen bodies of that size.
///
/// A vertex of the common polytope is a vertex of one body inside the other or the point where an edge of one crosses a
/// facet of the other. Both are found from the signed distances of all vertices of each body from all planes of the
/// other. The common polytope is then known by its edges: whole and cut ones of either body, and for each pair of
/// facets that cross, the segment between the two points that lie on both. Volume, moments and area vectors are sums
/// over edges, in any order.
std::optional<Measures> clip(const Placed& a, const Placed& b);

/// The patch of two that clip() has measured, in coordinates of the world; otherwise there may be none.
std::optional<Patch> clipped_patch(const Placed& a, const Placed& b);

/// The same for any number of bodies: the common polytope of the first two meets the third, and so on. Nothing, too,
/// where doubles are not enough to measure it.
std::optional<Measures> clip(std::span<const Placed> bodies);

}  // namespace overlapper
