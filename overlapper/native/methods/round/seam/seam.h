#pragma once

#include <array>
#include <optional>
#include <vector>

#include "shapes/shape.h"

namespace overlapper::seam {

/// A node on the seam: the closed lines where the surfaces of both bodies cross.
struct SeamPoint {
  Vec3 place;                   ///< about the inner point
  std::array<Vec3, 2> outward;  ///< normals of both surfaces, of any length
  double weight = 0;
  double blur = 0;  ///< relative error of the weight by rounding
};

/// Nodes of a quadrature along the seam of a pair that overlaps, at least one body of it round. Let f(n, m) be linear
/// in each of the unit normals n and m. Its integral over sin(n, m) along the seam is the sum of weight times
/// f(outward[0], outward[1]) over the nodes. `inside` is a point of the common set.
///
/// Bodies are cut into pieces: parts of at most one quadric inside planes. A line where a plane or a cylinder crosses a
/// quadric has two branches over a parameter, as the surface consists of parallel straight lines. Levin (1976) finds
/// the crossings of quadrics in the same way. Two ellipsoids have no such surface. Their lines are followed.
///
/// No value if surfaces of both bodies coincide, or touch along a line, or if a part of the seam was not found.
///
/// `rims`, if not null, gets the arcs in which the cylinders of a rounded hull end, for each body within the other one.
/// The first normal is the cylinder's, and the second one points along the axis out of the cylinder.
std::optional<std::vector<SeamPoint>> seam_of(const Placed& a, const Placed& b, Vec3 inside,
                                              std::array<std::vector<SeamPoint>, 2>* rims = nullptr);

}  // namespace overlapper::seam
