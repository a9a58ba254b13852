#pragma once

#include <optional>

#include "distance/least_translation.h"
#include "shapes/shape.h"

namespace overlapper {

/// The axis along which two boxes separate, or would separate soonest. A facet of the difference of two boxes is
/// orthogonal to a face of one box or to an edge of each. Fifteen axes therefore include the least translation
/// (Gottschalk, Lin and Manocha 1996). For boxes that overlap, depth and normal equal those of penetration(). For
/// separated boxes the depth is negative, and its size is a lower bound of the distance. The search ends at the first
/// axis with a gap larger than `far`. No value unless both bodies are boxes.
std::optional<Penetration> box_penetration(const Placed& a, const Placed& b, double far);

}  // namespace overlapper
