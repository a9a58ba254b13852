#pragma once

#include "geometry/vec.h"

namespace overlapper {

/// The least translation that separates: moving a by depth * normal leaves the two touching.
struct Penetration {
  double depth = 0;  ///< negative if the shapes are apart
  Vec3 normal;       ///< unit, from b to a
  double open = 0;   ///< m: how far it may be off beside rounding, of rounded bodies whose cores are apart
};

}  // namespace overlapper
