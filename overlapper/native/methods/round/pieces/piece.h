#pragma once

#include "methods/round/pieces/distinct_walls.h"

namespace overlapper::pieces {

/// Adds what walls leave of at most two rounds. `around` holds all of that, if known. False if slices give up.
bool add_piece(std::span<const Round> rounds, std::span<const Wall> walls, const EnclosingPolytope* around,
               const PieceSetting& setting, Sums& sums);

/// Adds a ball, or what one wall leaves of it, in closed form about the point of the cap that is farthest from the
/// wall.
void add_cap(const Round& ball, const Wall* wall, const PieceSetting& setting, Sums& sums);

/// Adds, in closed form, what a polytope and at most one round share. Faces of the polytope tell which of the walls
/// they are. False, and nothing is added, if doubles are not sure of it to a fraction of the whole that matters.
bool add_in_polytope(const Round* round, const EnclosingPolytope& polytope, const DistinctWalls& distinct,
                     const PieceSetting& setting, Sums& sums);

/// The part of at most two rounds, not both of them balls, that walls leave. Coordinates count from a point of its own.
struct SlicedPiece {
  std::vector<Round> rounds;
  std::vector<Wall> walls;
  double extent = 0;                          ///< m: no point is farther from the point that coordinates count from
  const EnclosingPolytope* around = nullptr;  ///< a polytope that holds the piece, about the point inside, if known
  Vec3 offset{};                              ///< of the own point, from the point inside
  bool near = false;                          ///< the own point is near the piece

  /// The same, about a point that is `step` away.
  SlicedPiece moved(Vec3 step) const;
};

/// Adds a piece by slices. False if that gives up.
bool add_slices(const SlicedPiece& piece, const PieceSetting& setting, Sums& sums);

}  // namespace overlapper::pieces
