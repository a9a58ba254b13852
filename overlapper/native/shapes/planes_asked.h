#pragma once

#include <cstddef>

namespace overlapper {

/// Planes of shapes that this thread has asked for since it began: placed to be held against corners, or given by a
/// shape as an answer to where a ray leaves it or which plane is tightest about a point.
inline constinit thread_local std::size_t planes_asked = 0;

}  // namespace overlapper
