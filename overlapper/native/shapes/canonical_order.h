#pragma once

#include <span>
#include <vector>

#include "shapes/shape.h"

namespace overlapper {

/// A strict weak order of bodies by their shapes and poses alone.
bool comes_before(const Placed& a, const Placed& b);

/// The numbers of the bodies in an order that depends on their shapes and poses alone: whoever computes in it gives the
/// same bits however the caller orders them. Scaling everything by a power of two keeps it.
std::vector<int> canonical_order(std::span<const Placed> bodies);

}  // namespace overlapper
