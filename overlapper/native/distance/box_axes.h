#pragma once

#include <optional>

#include "distance/least_translation.h"
#include "shapes/shape.h"

namespace overlapper {

/// Where two boxes part, or would part soonest: the facets of the difference of two boxes are orthogonal to a face
/// of one of them or to an edge of each, so fifteen axes hold the least translation (Gottschalk, Lin and Manocha 1996).
/// The depth and normal of boxes that overlap are those of penetration(). The depth of boxes apart is negative and its
/// size a lower bound of the distance; the first axis along which they are farther apart than `far` ends the search.
/// Nothing unless both bodies are boxes.
std::optional<Penetration> box_penetration(const Placed& a, const Placed& b, double far);

}  // namespace overlapper
