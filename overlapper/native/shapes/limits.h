#pragma once

#include <cmath>
#include <stdexcept>
#include <string>
#include <type_traits>

namespace overlapper {

/// m: limits of sizes and distances. Within them, products of six lengths and of their reciprocals neither overflow nor
/// underflow, and neither do their rounding errors.
inline constexpr double kSmallest = 1e-25, kLargest = 1e25;

/// Throws std::invalid_argument, with one sentence that names the argument, unless the condition holds. A sentence with
/// a number takes as long as a box, so it is made only when it is needed.
inline void require(bool condition, const char* message) {
  if (!condition) throw std::invalid_argument(message);
}
template <class Message>
  requires std::is_invocable_r_v<std::string, Message>
void require(bool condition, const Message& message) {
  if (!condition) throw std::invalid_argument(message());
}

/// Throws std::invalid_argument unless a length of a shape, in m, is finite, positive and within the limits.
inline void require_size(double value, const char* name) {
  require(std::isfinite(value), [&] { return std::string(name) + " must be finite"; });
  require(value > 0, [&] { return std::string(name) + " must be greater than 0, not " + std::to_string(value); });
  require(value > kSmallest && value < kLargest,
          [&] { return std::string(name) + " must be between 1e-25 and 1e25 m"; });
}

/// The largest ratio of two lengths of a shape. A thinner body is lost in the rounding of its own size.
inline constexpr double kLargestRatio = 1e15;

/// Throws std::invalid_argument if the lengths of a shape differ too much. `names` is the subject of the sentence.
inline void require_ratio(double shortest, double longest, const char* names) {
  require(longest <= kLargestRatio * shortest,
          [&] { return std::string(names) + " must differ by a factor of at most 1e15"; });
}

}  // namespace overlapper
