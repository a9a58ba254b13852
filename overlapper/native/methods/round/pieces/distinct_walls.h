#pragma once

#include <optional>
#include <span>
#include <vector>

#include "methods/round/pieces/totals.h"

namespace overlapper::pieces {

using slicing::Round;
using slicing::Wall;

/// The walls of a piece, with coplanar walls identified.
struct DistinctWalls {
  std::vector<Wall> walls;
  std::vector<int> instead;  ///< per wall: the wall that supersedes it, or kItself
  bool folded = false;       ///< two walls of nearly one direction are not coplanar

  static constexpr int kSuperseded = -1;  ///< the owner of a superseded wall
  static constexpr int kItself = -1;
  static constexpr int kNobody = -1;  ///< the owner of a face without a wall

  /// The wall that gives the owner of the surface in the plane of a wall. Walls beyond the last one own their surface.
  int telling(int wall) const {
    while (wall < static_cast<int>(instead.size()) && instead[wall] != kItself) wall = instead[wall];
    return wall;
  }
  int owner_at(int wall) const { return wall == kNoWall ? kNobody : walls[telling(wall)].owner; }
};

/// Whether two coplanar walls face each other, so that nothing is between them. Adds the volume of layers between
/// planes that count as one to `error`.
bool is_flat(std::span<const Wall> walls, const PieceSetting& setting, double& error);

/// All but one of several coplanar walls are superseded. A face supersedes a cut, as the next piece is flat there. The
/// inner one of two faces stays, or that of the first body. Adds to `error` like is_flat().
void find_repeated(DistinctWalls& distinct, const PieceSetting& setting, double& error);

/// Two walls of nearly one direction, and a cut that separates where each is nearer: the first wall is nearer inside.
struct Fold {
  size_t first, second;
  Wall nearer;
};

/// Removes walls that another wall of nearly one direction supersedes everywhere. Returns two walls that are each
/// nearer in places. No value if there are none or too many.
std::optional<Fold> find_fold(std::vector<Wall>& walls, std::span<const Round> rounds, double extent);

}  // namespace overlapper::pieces
