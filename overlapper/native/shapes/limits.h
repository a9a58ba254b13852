#pragma once

#include <stdexcept>
#include <string>

namespace overlapper {

/// m: the sizes and distances that are let in. Products of six lengths, and of their reciprocals, neither overflow nor
/// underflow, nor does what rounding leaves of them.
inline constexpr double kSmallest = 1e-25, kLargest = 1e25;

/// Throws std::invalid_argument, with one sentence that names the argument, unless the condition holds.
inline void require(bool condition, const std::string& message) {
  if (!condition) throw std::invalid_argument(message);
}

}  // namespace overlapper
