#pragma once

#include <span>
#include <vector>

#include "geometry/patch.h"
#include "methods/dual/region.h"

namespace overlapper {

/// The boundary of a common set for drawing: its polytope, without the ridges and facets that rounding made of several
/// planes through one point.
struct Boundary {
  std::vector<Vec3> vertices;
  std::vector<int> ring, ring_start;
  std::vector<Plane> planes;
  std::vector<int> owner;
  std::vector<std::vector<Vec3>> patch;
  double merged = 0;  ///< m: largest distance of a vertex of the polytope from the vertex in its place

  std::span<const int> facet(int f) const {
    return std::span(ring).subspan(ring_start[f], ring_start[f + 1] - ring_start[f]);
  }
};
/// The patch of a pair, from the ridges where the owner changes. It is seen along `direction` if it is given.
Patch patch_of(const Region& region, Vec3 centroid, const std::optional<Vec3>& direction);

/// The boundary of the common set of `bodies` bodies.
Boundary boundary_of(const Region& region, int bodies);

}  // namespace overlapper
