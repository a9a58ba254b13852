#pragma once

#include <optional>

#include "methods/round/pieces/measure.h"

namespace overlapper::lenses {

/// An ellipsoid, and a ball or an ellipsoid, by slices in which both are discs: the areas of lenses of two discs are
/// integrated. Where the first body is a unit ball, volume, moments and area vectors are those of its arcs alone. No
/// term is a difference of large ones, at any depth. Areas take the element of the surface along every arc; they are
/// left out unless the pair asks for them.
///
/// `outwards` scales the second body about its centre, by at least as much. No value if the error would exceed 1e-8 of
/// the volume.
std::optional<pieces::RoundMeasures> measure_lenses(const pieces::SlicedPair& pair);

}  // namespace overlapper::lenses
