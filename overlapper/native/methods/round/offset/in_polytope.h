#pragma once

#include <optional>

#include "geometry/measures.h"
#include "shapes/shape.h"

namespace overlapper::offset {

/// The volume of a rounded hull in a half-space, a box or a hull, or of a capsule in a shallow contact with a box or a
/// hull. `near` is a point of the contact, in m, about the same reference as the bodies. `depth` is an upper bound of
/// the depth of the contact, in m.
///
/// If only one plane cuts a rounded hull, this is the volume below that plane. Otherwise it is a sum of cones from an
/// apex, over all parts of both surfaces that lie in the other body (Gauss). Each part is bounded by arcs and segments.
/// Every arc is cut by all planes that reach it. The rest is a smooth integral along the arc, by the rule of Gauss and
/// Legendre. Area vectors of the whole surface have to add up to zero.
///
/// In a shallow contact, `near` is the apex. The distances of all tangent planes and faces from it come from
/// double-doubles, and directions are differences from the direction of the apex. So no term is much larger than the
/// volume, and the terms do not cancel.
///
/// No value if facets are not exact, if planes nearly contain an edge, or if the error is more than kEnough of the
/// volume; kEnoughOfRound for a capsule. No value for a capsule that only one plane cuts, or whose contact is deep.
std::optional<VolumeAlone> volume_in_polytope(const Placed& rounded_body, const Placed& polytope,
                                              const std::optional<Vec3>& near, double depth);

}  // namespace overlapper::offset
