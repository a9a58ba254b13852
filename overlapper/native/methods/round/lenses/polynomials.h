#pragma once

#include <array>

#include "methods/round/lenses/discs.h"
#include "methods/round/slicing/polynomials.h"

namespace overlapper::lenses {

using slicing::product;
using slicing::root_between;
using slicing::Roots;
using slicing::roots;
using slicing::value;

/// The polynomial 4 d² h² of the half chord h; see changes().
std::array<double, 5> chord(const Line& apart, const Line& centre, const Quadratic& slack, const Quadratic& difference);

}  // namespace overlapper::lenses
