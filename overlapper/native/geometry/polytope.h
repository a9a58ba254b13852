#pragma once

#include <span>
#include <vector>

#include "geometry/expanding_hull.h"
#include "geometry/vec.h"

namespace overlapper {

/// A bounded polytope about the origin, as the dual of a hull of dual points. Facet f is the polygon ring[ring_start[f]
/// .. ring_start[f + 1]) of vertices, counter-clockwise from outside, in the plane dot(dual[f], x) = 1. This is number
/// plane[f] of the planes that were dualised. Every vertex lies on exactly three facets. If more than three planes
/// meet, vertices coincide and some ridges have no length.
struct Polytope {
  std::vector<Vec3> vertices;
  std::vector<Vec3> dual;
  std::vector<int> plane;
  std::vector<int> ring, ring_start;

  int facets() const { return static_cast<int>(dual.size()); }
  std::span<const int> facet(int f) const {
    return std::span(ring).subspan(ring_start[f], ring_start[f + 1] - ring_start[f]);
  }
};

/// The distance of the farthest vertex from the origin.
double farthest_vertex(const Polytope& polytope);

/// The dual point normal / (offset - dot(normal, origin)) of a plane that has `origin` strictly inside.
inline Vec3 polar_dual(const Plane& plane, Vec3 origin) { return plane.normal / -signed_distance(plane, origin); }

/// The polytope whose dual the hull is. The hull's facets become vertices, and its vertices become facets. The origin
/// must be strictly inside.
Polytope polar_dual(const ExpandingHull& hull);

/// Integrals over a polytope that has the origin inside.
struct PolytopeMoments {
  double volume = 0;
  Vec3 first_moment;                                    ///< ∫ x dV
  Mat3 second_moment{{0, 0, 0}, {0, 0, 0}, {0, 0, 0}};  ///< ∫ x xᵀ dV
  std::vector<double> cone_volume;                      ///< of the cone from the origin to each facet
  std::vector<Vec3> facet_centroid;
};

/// Sums tetrahedra from the origin to the fans of the facets. All are positive, so nothing cancels.
PolytopeMoments moments(const Polytope& polytope);

}  // namespace overlapper
