#pragma once

#include <cmath>
#include <stdexcept>
#include <string>

namespace overlapper {

/// m: limits of sizes and distances. Within them, products of six lengths and of their reciprocals neither overflow nor
/// underflow, and neither do their rounding errors.
inline constexpr double kSmallest = 1e-25, kLargest = 1e25;

/// Throws std::invalid_argument, with one sentence that names the argument, unless the condition holds.
inline void require(bool condition, const std::string& message) {
  if (!condition) throw std::invalid_argument(message);
}

/// Throws std::invalid_argument unless a length of a shape, in m, is finite, positive and within the limits.
inline void require_size(double value, const char* name) {
  require(std::isfinite(value), std::string(name) + " must be finite");
  require(value > 0, std::string(name) + " must be greater than 0, not " + std::to_string(value));
  require(value > kSmallest && value < kLargest, std::string(name) + " must be between 1e-25 and 1e25 m");
}

}  // namespace overlapper
