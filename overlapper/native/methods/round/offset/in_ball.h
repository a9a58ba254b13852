#pragma once

#include <optional>

#include "geometry/measures.h"
#include "shapes/shape.h"

namespace overlapper::offset {

/// The volume of a rounded hull in a ball, by the surface of the rounded hull. Let x be a point seen from the ball's
/// centre, ρ its distance and R the radius. The field (1 − R³/ρ³) x / 3 has divergence 1 and is zero on the sphere. So
/// the volume is the flux of the field through the surface in the ball, and the ball's volume more if the centre is in
/// the rounded hull. Each feature of the surface is reduced to integrals along its border, of functions of R − ρ whose
/// nearest singularities are known. In a shallow contact, no term is much larger than the volume.
///
/// No value if facets are not exact, if the centre nearly lies on the surface, or if the error is more than kEnough of
/// the volume.
std::optional<VolumeAlone> volume_in_ball(const Placed& rounded_hull, const Placed& ball);

}  // namespace overlapper::offset
