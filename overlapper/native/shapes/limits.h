#pragma once

#include <stdexcept>
#include <string>

namespace overlapper {

/// m: products of a few coordinates, and of their reciprocals, must neither overflow nor underflow.
inline constexpr double kSmallest = 1e-100, kLargest = 1e100;

/// Throws std::invalid_argument, with one sentence that names the argument, unless the condition holds.
inline void require(bool condition, const std::string& message) {
  if (!condition) throw std::invalid_argument(message);
}

}  // namespace overlapper
