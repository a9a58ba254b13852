#pragma once

#include <optional>

#include "geometry/measures.h"
#include "shapes/shape.h"

namespace overlapper::offset {

/// The volume of a rounded hull in a half-space, a box or a hull.
///
/// If only one plane cuts the hull, this is the volume below that plane. Otherwise it is a sum of cones from a point,
/// over all parts of both surfaces that lie in the other body (Gauss). Each part is bounded by arcs and segments. Every
/// arc is cut by all planes that reach it, and what is left is added in closed form. The area of a face of the box or
/// hull comes from the same arcs, as integrals along its border. Area vectors of the whole surface have to add up to
/// zero.
///
/// No value if facets are not exact, if planes nearly contain an edge, or if the error is more than kEnough of the
/// volume.
std::optional<VolumeAlone> volume_in_polytope(const Placed& rounded_hull, const Placed& polytope);

}  // namespace overlapper::offset
