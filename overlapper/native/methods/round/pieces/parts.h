#pragma once

#include "methods/round/pieces/distinct_walls.h"

namespace overlapper::pieces {

/// A polytope around part of a piece, and the walls that matter there.
struct SlicedPart {
  EnclosingPolytope polytope;
  std::vector<Wall> walls;
};

/// The walls that have a face of the polytope, and those that tell of them. Faces tell which of `walls` they are: of
/// those that are distinct, or of cuts after these.
void find_walls(const DistinctWalls& distinct, std::span<const Wall> walls, SlicedPart& part);

/// Cuts parts in two, through the middle and across the axis that leaves the fewest walls to either half, until slices
/// are to have those of each, or no cut leaves fewer. Cuts are added to the walls.
void cut_in_parts(const DistinctWalls& distinct, std::vector<Wall>& walls, std::vector<SlicedPart>& parts);

}  // namespace overlapper::pieces
