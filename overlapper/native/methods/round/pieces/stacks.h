#pragma once

#include "methods/round/pieces/distinct_walls.h"

namespace overlapper::pieces {

/// What walls leave of at most two rounds, not both of them balls, about a point of its own.
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
