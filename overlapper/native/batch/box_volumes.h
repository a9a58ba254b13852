#pragma once

#include <array>

#include "shapes/shape.h"

namespace overlapper {

/// Number of pairs that volumes_of_boxes() measures at once.
inline constexpr int kPairsAtOnce = 4;

/// Pairs of boxes, as two lists of the same length.
using BoxList = std::array<const Placed*, kPairsAtOnce>;

/// For each pair, m³: the common volume, and a bound of its error. Both are 0 for boxes that are certainly apart. Where
/// doubles decide too little, the bound is large, infinite or NaN.
struct BoxVolumes {
  std::array<double, kPairsAtOnce> volume{}, error{};
};

/// The common volumes of pairs of boxes. The bits depend neither on the other pairs, nor on the order of the two boxes
/// of a pair, nor on the machine.
///
/// The edges of the common set are parts of 60 lines: the edges of both boxes, and the lines where a face of one box
/// meets a face of the other. Each line is cut by slabs, the pairs of parallel planes of a box. The volume is a sum
/// over these lines. Two faces at the distances f and g from a point, with the cosine c and the sine s of the angle
/// between their normals, meet in an edge of length L. The edge adds L (2 f g - c (f² + g²)) / 6 s: its triangles in
/// both facets, as bases of tetrahedra from that point.
///
/// All pairs take the same steps, so they are computed together. Nothing depends on the shape of the common set.
BoxVolumes volumes_of_boxes(const BoxList& a, const BoxList& b);

}  // namespace overlapper
