#pragma once

#include "forces/three.h"

namespace overlapper {

/// Three components of a wrench near a slip: their value there, and how they change by the slip and by another number.
struct Linear {
  Three value{};
  ThreeByThree by_slip{};
  Three by_other{};
};

}  // namespace overlapper
