#pragma once

#include <span>
#include <vector>

#include "methods/dual/region.h"

namespace overlapper {

/// The surface without the ridges and facets that rounding left of several planes through one point.
struct Surface {
  std::vector<Vec3> vertices;
  std::vector<int> ring, ring_start;
  std::vector<Plane> planes;
  std::vector<int> owner;
  std::vector<std::vector<Vec3>> patch;

  std::span<const int> facet(int f) const {
    return std::span(ring).subspan(ring_start[f], ring_start[f + 1] - ring_start[f]);
  }
};
/// The surface of the common set of that many bodies.
Surface surface_of(const Region& region, int bodies);

}  // namespace overlapper
