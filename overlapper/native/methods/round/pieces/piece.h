#pragma once

#include "methods/round/pieces/distinct_walls.h"

namespace overlapper::pieces {

/// Adds the part of some rounds inside the walls: at most two of them, or two cylinders that are not parallel and a
/// ball. `around` contains that part, if known. False if slices give up.
bool add_piece(std::span<const Round> rounds, std::span<const Wall> walls, const EnclosingPolytope* around,
               const PieceSetting& setting, Sums& sums);

/// The plane where two balls, or two parallel cylinders, have the same power: on its inner side the first round is the
/// nearer border of what both share. No value if one round contains the other, seen along the axes.
std::optional<Wall> radical_plane(const Round& a, const Round& b);

/// Adds a ball, or the part of it inside one wall, in closed form about the cap's point that is farthest from the wall.
void add_cap(const Round& ball, const Wall* wall, const PieceSetting& setting, Sums& sums);

/// Adds, in closed form, the common part of a polytope and at most one round. Faces of the polytope have the numbers of
/// their walls, and its corners are settled. False if doubles are not accurate to the relevant fraction of the whole;
/// nothing is then added.
bool add_in_polytope(const Round* round, EnclosingPolytope& polytope, const DistinctWalls& distinct,
                     const PieceSetting& setting, Sums& sums);

/// The part of some rounds inside the walls: at most two cylinders, and then at most one ball. Coordinates are relative
/// to an own point.
struct SlicedPiece {
  std::vector<Round> rounds;
  std::vector<Wall> walls;
  double extent = 0;                          ///< m: upper bound of the distance of its points from the own point
  const EnclosingPolytope* around = nullptr;  ///< polytope around the piece, relative to the inner point, if known
  Vec3 offset{};                              ///< of the own point from the inner point
  bool near = false;                          ///< the own point is near the piece
  std::optional<Vec3> long_axis{};            ///< where the piece is longest, of any length, if known

  /// The same piece, relative to a point that is `step` away.
  SlicedPiece moved(Vec3 step) const;
};

/// Adds a piece by slices. False if that gives up.
bool add_slices(const SlicedPiece& piece, const PieceSetting& setting, Sums& sums);

}  // namespace overlapper::pieces
