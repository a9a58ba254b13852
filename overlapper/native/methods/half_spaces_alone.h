#pragma once

#include <span>

#include "shapes/shape.h"

namespace overlapper {

/// Whether half-spaces have no common point. Exact, from normals, offsets, positions and orientations as given: planes
/// that are not exactly opposite meet somewhere. Bodies are about any reference.
bool have_no_common_point(std::span<const Placed> half_spaces);

/// Whether half-spaces bound a set: the origin is strictly inside the hull of their normals as given. If a tilt by the
/// rounding of a unit normal would open the set, it may count as open.
bool bound_a_set(std::span<const Placed> half_spaces);

}  // namespace overlapper
