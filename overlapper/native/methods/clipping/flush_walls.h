#pragma once

#include <vector>

#include "shapes/solid.h"

namespace overlapper {

/// A wall of a solid that was moved out of the way of another solid.
struct MovedWall {
  Vec3 normal;    ///< unit, outward
  double beyond;  ///< m: no point of the other solid is farther beyond the wall's first place
};

/// Moves walls of two solids outward that cut off less than rounding from the other solid: some of its vertices may be
/// on either side, and none is clearly beyond. The walls of two boxes that are flush at their sides are such walls.
/// Once those of the second box are moved, those of the first box alone bound the common set.
///
/// `doubt` in m is that of signed distances. Replaces `moved`. False if there is no such wall, or if one cannot be
/// moved: three facets meet in each of its corners, and these must stay corners.
bool move_flush_walls(Solid& first, Solid& second, double doubt, std::vector<MovedWall>& moved);

}  // namespace overlapper
