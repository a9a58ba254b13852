#pragma once

#include <optional>

#include "methods/clipping/clip.h"
#include "methods/dual/region.h"

namespace overlapper {

/// True if trace() may be asked about the pair: boxes, and hulls that can be climbed.
bool traceable(const Placed& a, const Placed& b);

/// What two polytopes of many facets have in common, from where their surfaces cross: the seam is followed from facet
/// to facet, and what lies within it is kept as it is. Time grows with the seam and with what is kept; what is outside
/// is never looked at. Everything is computed about a point in the common part, so that rounding is that of its size.
/// Nothing is said where one of the signs that decide is not certain, or where it is not that the bodies are apart, or
/// have a ball in common, by more than `rounding`. In the first body's terms, and in its coordinates, as in
/// clip().
std::optional<ClippedPair> trace(const Placed& a, const Placed& b, const Pose& pose, double rounding);

/// The polytope that trace() has measured. Whoever asks has asked trace() the same and been answered; otherwise there
/// may be nothing. Owners are 0 and 1.
std::optional<Region> traced_region(const Placed& a, const Placed& b, const Pose& pose, double rounding,
                                    Vec3 reference);

}  // namespace overlapper
