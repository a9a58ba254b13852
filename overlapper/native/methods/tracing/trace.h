#pragma once

#include <optional>

#include "geometry/measures.h"
#include "geometry/region.h"
#include "shapes/shape.h"

namespace overlapper {

/// What two boxes or hulls with a graph have in common, from where their surfaces cross: the seam is followed from
/// facet to facet, and what lies within it is kept as it is. Time grows with the seam and with what is kept; what is
/// outside is never looked at. Everything is computed about a point in the common part, so that rounding is that of its
/// size. Nothing is said where one of the signs that decide is not certain, or where it is not that the bodies are
/// apart, or have a ball in common, by more than the doubt of their relation.
std::optional<Measures> trace(const Placed& a, const Placed& b);

/// The polytope that trace() has measured. Whoever asks has asked trace() the same and been answered; otherwise there
/// may be nothing. The owner of a facet is 0 for the body that comes first in canonical order, else 1.
std::optional<Region> traced_region(const Placed& a, const Placed& b, Vec3 reference);

}  // namespace overlapper
