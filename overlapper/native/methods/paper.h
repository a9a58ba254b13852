#pragma once

#include <optional>
#include <span>

#include "geometry/measures.h"
#include "methods/dual/region.h"

namespace overlapper {

struct PaperResult {
  Status status = Status::kSeparated;
  std::optional<Region> region;  ///< set if overlapping; relative to the bodies' own reference
};

/// The common set of two or more bodies by the method of Tereshchenko, Chevokin and Fisunenko, "Algorithm for finding
/// the domain intersection of a set of polytopes" (ICCS 2013), step for step:
///
/// 1. GJK on the difference of two polytopes. The simplex keeps the points of both polytopes. The barycentric
///    coordinates of the origin give a common point.
/// 2. A common point on the boundary of either polytope is shifted by one minimal step. The shift goes along the first
///    of 26 directions (all combinations of -1, 0, 1 per axis) that leads inside both.
/// 3. The origin moves there, and every face plane of both becomes a dual point.
/// 4. The convex hull of the dual points, by the incremental algorithm with a conflict graph, in O(n log n).
/// 5. The dual of that hull's faces: the vertices of the intersection. Their convex hull is the intersection.
/// 6. m bodies pairwise by divide and conquer; the pairs of a level run in parallel.
///
/// The text is silent, or cannot be followed, in some places. The minimal step is kMinimalStep of the smaller polytope.
/// Smooth shapes are tessellated to `tolerance` from inside. A box large enough for the other bodies replaces a
/// half-space. The hulls decide by exact signs. Nothing recovers what the method loses. If none of the 26 shifts lands
/// inside, or if the vertices found lie in one plane, the answer is `touching` with no volume. The answer is also
/// `touching` if a body is thinner than the rounding of its corners, unless two of the bodies are apart.
PaperResult intersect_as_in_paper(std::span<const Placed> bodies, double tolerance);

}  // namespace overlapper
