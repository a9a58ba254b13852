#pragma once

#include <cstddef>

namespace overlapper {

/// Number of planes of shapes that this thread has evaluated since it began. A plane counts if it is placed and
/// compared with corners. A plane also counts as a shape's answer to a ray exit or a tightest plane.
inline constinit thread_local std::size_t planes_asked = 0;

}  // namespace overlapper
