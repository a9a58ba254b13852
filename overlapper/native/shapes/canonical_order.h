#pragma once

#include <span>
#include <vector>

#include "shapes/shape.h"

namespace overlapper {

/// A strict weak order of bodies by their shapes and poses alone.
bool comes_before(const Placed& a, const Placed& b);

/// The numbers of the bodies in an order that depends only on their shapes and poses. Computing in this order gives the
/// same bits for every order of the caller's. Scaling everything by a power of two keeps the order.
std::vector<int> canonical_order(std::span<const Placed> bodies);

}  // namespace overlapper
