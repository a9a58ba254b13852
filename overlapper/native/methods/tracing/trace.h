#pragma once

#include <optional>

#include "geometry/measures.h"
#include "geometry/region.h"
#include "shapes/shape.h"

namespace overlapper {

/// The common set of two boxes or hulls with a graph, from the crossing of their surfaces. Tracing follows the seam
/// from facet to facet, and keeps everything inside it unchanged. Time grows with the seam and the kept part; the
/// outside is never visited. All coordinates are relative to a point in the common part, so rounding is relative to its
/// size. No value if a deciding sign is uncertain. Also no value unless the bodies certainly are separated or have a
/// common ball, by more than the doubt of their relation.
std::optional<Measures> trace(const Placed& a, const Placed& b);

/// The polytope that trace() has measured. Call it only after trace() of the same bodies gave a value; otherwise there
/// may be none. The owner of a facet is 0 for the first body in canonical order, else 1.
std::optional<Region> traced_region(const Placed& a, const Placed& b, Vec3 reference);

}  // namespace overlapper
