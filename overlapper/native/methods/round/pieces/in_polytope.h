#pragma once

#include "methods/round/pieces/distinct_walls.h"

namespace overlapper::pieces {

/// Adds, in closed form, what a polytope and at most one round share. Faces of the polytope tell which of the walls
/// they are. False, and nothing is added, if doubles are not sure of it to a fraction of the whole that matters.
bool add_in_polytope(const Round* round, const EnclosingPolytope& polytope, const DistinctWalls& distinct,
                     const PieceSetting& setting, Sums& sums);

}  // namespace overlapper::pieces
