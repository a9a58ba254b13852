#pragma once

#include "methods/round/pieces/distinct_walls.h"

namespace overlapper::pieces {

/// Adds what walls leave of at most two rounds. `around` holds all of that, if known. False if slices give up.
bool add_piece(std::span<const Round> rounds, std::span<const Wall> walls, const EnclosingPolytope* around,
               const PieceSetting& setting, Sums& sums);

}  // namespace overlapper::pieces
