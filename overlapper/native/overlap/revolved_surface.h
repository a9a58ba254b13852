#pragma once

#include <span>
#include <vector>

#include "shapes/shape.h"

namespace overlapper {

/// A node of a quadrature along the border of a surface. Seen from outside, the surface is on the left of `step`.
struct BorderNode {
  Vec3 place;   ///< about the inner point
  Vec3 step;    ///< m: the tangent times the weight
  Vec3 normal;  ///< unit, of the surface
};

/// Integrals over the part of a body's surface within another body. Places x are about the inner point, and n is the
/// normal.
struct SurfaceSums {
  double distance = 0;  ///< ∫ x · n dA
  Vec3 moment;          ///< ∫ x (x · n) dA
  Vec3 by_radius;       ///< ∫ x dA; not for an ellipsoid
  Vec3 by_length;       ///< ∫ x |n_z| / 2 dA; not for an ellipsoid
  double area = 0;      ///< m²; not for an ellipsoid
  /// For each vertex of a rounded hull: ∫ x λ nᵀ dA over the balls and cylinders, with the share λ by which points move
  /// along with the vertex.
  std::vector<Mat3> by_vertex;
};

/// The sums for a ball, an ellipsoid, a capsule or a cylinder. `inside` is a point inside both bodies.
///
/// The surface is that of a body of revolution, after a stretch. Meridians lead from one pole to the other. The
/// integral along a meridian from its beginning to a node, times the angle about the axis, is a form on the surface.
/// Its derivative is the integrand. By Stokes' theorem, its sum over the border is the integral. The form has no value
/// at the pole where meridians end. If this pole is in the surface, the integral over all of the surface is added.
///
/// The last pole is chosen far from the border: by the axis of a ball or an ellipsoid, and within the flat end of a
/// cylinder. If neither pole is in a small surface, meridians begin near its border, and little cancels.
SurfaceSums revolved_surface(const Placed& body, const Placed& other, Vec3 inside, std::span<const BorderNode> border);

}  // namespace overlapper
