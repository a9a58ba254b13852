#pragma once

#include "methods/round/pieces/distinct_walls.h"

namespace overlapper::pieces {

/// A polytope around part of a piece, and the relevant walls there.
struct SlicedPart {
  EnclosingPolytope polytope;
  std::vector<Wall> walls;
};

/// The walls with a face of the polytope, and the walls that give their owners. Each face has the number of a distinct
/// wall in `walls`, or of a cut after the walls.
void find_walls(const DistinctWalls& distinct, std::span<const Wall> walls, SlicedPart& part);

/// Cuts parts in two through the middle, across the axis that leaves the fewest walls to either half. Ends when the
/// number of walls suits slices, or when no cut leaves fewer walls. Adds the cuts to the walls.
void cut_in_parts(const DistinctWalls& distinct, std::vector<Wall>& walls, std::vector<SlicedPart>& parts);

}  // namespace overlapper::pieces
