#pragma once

#include "methods/round/pieces/distinct_walls.h"

namespace overlapper::pieces {

/// Adds a ball, or what one wall leaves of it, in closed form about the point of the cap that is farthest from the
/// wall.
void add_cap(const Round& ball, const Wall* wall, const PieceSetting& setting, Sums& sums);

}  // namespace overlapper::pieces
