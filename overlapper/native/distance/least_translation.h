#pragma once

#include "geometry/vec.h"

namespace overlapper {

/// The least translation that separates: after moving a by depth * normal, the two bodies only touch.
struct Penetration {
  double depth = 0;  ///< negative if the shapes are apart
  Vec3 normal;       ///< unit, from b to a
  double open = 0;   ///< m: error beside rounding, for rounded bodies with separated cores
};

}  // namespace overlapper
