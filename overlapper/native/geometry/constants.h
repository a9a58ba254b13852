#pragma once

#include <limits>
#include <numbers>

namespace overlapper {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();
inline constexpr double kPi = std::numbers::pi;
inline constexpr double kUnit = 0x1p-53;  ///< largest relative error of one rounding

}  // namespace overlapper
