#pragma once

#include <optional>
#include <span>
#include <vector>

#include "methods/round/pieces/totals.h"

namespace overlapper::pieces {

using slicing::Round;
using slicing::Wall;

/// Walls of a piece, where those that lie in one plane are told from those that do not.
struct DistinctWalls {
  std::vector<Wall> walls;
  std::vector<int> instead;  ///< per wall, the one that supersedes it, or kItself
  bool folded = false;       ///< two walls of nearly one direction are not in one plane

  static constexpr int kSuperseded = -1;  ///< the owner of a wall that is superseded
  static constexpr int kItself = -1;
  static constexpr int kNobody = -1;  ///< the owner of a face that no wall makes

  /// The wall that tells who owns the surface in the plane of a wall. Walls beyond the last tell that themselves.
  int telling(int wall) const {
    while (wall < static_cast<int>(instead.size()) && instead[wall] != kItself) wall = instead[wall];
    return wall;
  }
  int owner_at(int wall) const { return wall == kNoWall ? kNobody : walls[telling(wall)].owner; }
};

/// Whether two walls face each other in one plane, so that there is nothing between them. Volumes of layers between
/// planes that are taken for one are added to `error`.
bool is_flat(std::span<const Wall> walls, const PieceSetting& setting, double& error);

/// Among walls in one plane, all but one are superseded. A face supersedes a cut, as the next piece is flat there. Of
/// two faces the inner one stays, or that of the first body. Adds to `error` as is_flat() does.
void find_repeated(DistinctWalls& distinct, const PieceSetting& setting, double& error);

/// Two walls of nearly one direction, and the cut on whose inner side the first of them is the nearer.
struct Fold {
  size_t first, second;
  Wall nearer;
};

/// Drops walls that another wall of nearly one direction supersedes all over. Returns two walls of which each is the
/// nearer in places; nothing where there are none or too many.
std::optional<Fold> find_fold(std::vector<Wall>& walls, std::span<const Round> rounds, double extent);

}  // namespace overlapper::pieces
