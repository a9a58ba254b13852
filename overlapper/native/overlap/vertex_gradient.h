#pragma once

#include <vector>

#include "overlap/overlap.h"

namespace overlapper {

/// The derivatives of the common volume and of its centroid by the vertices of one hull.
struct VertexGradient {
  std::vector<Vec3> by_vertex;         ///< m², for each vertex of HullData
  std::vector<double> error;           ///< m²: bound of the length of the error of each; empty unless wanted
  std::vector<Mat3> centroid;          ///< row j: of coordinate j; empty unless wanted
  std::vector<double> centroid_error;  ///< bound of the error of each entry; empty unless wanted
};

/// The results of vertex_gradients() besides the derivatives of the volume.
struct Wanted {
  bool errors = false, centroid = false;
};

/// For each body, the derivatives by the vertices of its hull, or of the core of a rounded hull. No vertices for
/// another body. In groups with a round body, those of the polytope that encloses the common set; NaN there for rounded
/// hulls. NaN also for the few rounded hulls that cannot be sliced.
///
/// The surface of a rounded hull has three kinds of parts. A ball moves with its vertex. The points of a cylinder along
/// an edge move as the points of the edge do. The derivatives by its two ends have the sum ∫ n dA. Their shares follow
/// from ∫ s n dA, for the distance s along the edge. Facets move out by the radius keep their coordinates in the core.
///
/// If a vertex moves, points of its facets move along with their barycentric coordinates. The derivative is the
/// integral of a vertex's coordinate times the normal over the part of the surface that the body owns. A facet of more
/// than three corners counts as a fan of triangles from its first corner. The volume has other one-sided derivatives
/// there, for vertices that leave the facet in other ways. All of them agree for vertices that stay in one plane.
///
/// Three numbers add up to an error. Area may belong to another body, or be missing, as bounded by Errors::gradient.
/// Corners may be misplaced, as bounded by Errors::vertices. They change a coordinate by that distance over the height
/// of the triangle. All vertices together have the area vector of the body's part; the difference counts. Other ways to
/// fold a facet are not in the errors.
///
/// Let λ be the coordinate of a vertex, and x the place about the centroid C. The volume V and C then change by V dC =
/// ∫ x λ n · dv dA. On a facet, the integrand has the second degree. Balls and cylinders have the sums of
/// rounded_surface(). Groups with a round body have none: NaN. The errors are those of the volume's derivative times
/// the distance of the farthest point, plus what an error of the centroid moves. The sum of all vertices is compared
/// with centroid_gradient().
std::vector<VertexGradient> vertex_gradients(const Overlap& overlap, Wanted wanted);

}  // namespace overlapper
