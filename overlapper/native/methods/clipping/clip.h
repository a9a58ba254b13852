#pragma once

#include <array>
#include <optional>
#include <span>

#include "geometry/measures.h"
#include "geometry/patch.h"
#include "shapes/shape.h"

namespace overlapper {

/// m²: for each body of a pair, the area of its sides in the boundary of the common set. The sides of a box are summed
/// across each axis. A half-space has one side, in x. The sides of a hull are not told apart: {0, 0, 0}.
using SideAreas = std::array<Vec3, 2>;

/// The common set of polytopes and half-spaces, by static filters: no value if a sign that it needs is uncertain. At
/// least one body is bounded, none is round, and hulls are closed. Allocates nothing once its thread has seen bodies of
/// that size.
///
/// A vertex of the common polytope is a vertex of one body inside the other, or the point where an edge of one body
/// crosses a facet of the other. Both come from the signed distances of all vertices of each body from all planes of
/// the other. The common polytope is known by its edges: whole and cut edges of either body, and a segment for each
/// pair of facets that cross. That segment joins the two points that lie on both facets. Volume, moments and area
/// vectors are sums over edges, in any order.
///
/// If the answer is measured, `sides` gets its areas and `patch` gets clipped_patch() unless they are null.
std::optional<Measures> clip(const Placed& a, const Placed& b, std::optional<SideAreas>* sides = nullptr,
                             std::optional<Patch>* patch = nullptr);

/// The patch of a pair that clip() has measured, in world coordinates. For other pairs there may be no value. The patch
/// is seen along `direction` if it is given.
std::optional<Patch> clipped_patch(const Placed& a, const Placed& b, std::optional<Vec3> direction = {});

/// The same for any number of bodies: the third body clips the common polytope of the first two, and so on. Also no
/// value if doubles are not accurate enough for the measures.
std::optional<Measures> clip(std::span<const Placed> bodies);

}  // namespace overlapper
