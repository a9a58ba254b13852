#pragma once

#include <span>

#include "shapes/hull.h"

namespace overlapper::quadric {

/// A convex polyhedron that planes leave of a quadric, in coordinates of its own: those of a box or a hull, which need
/// not be turned.
struct Polyhedron {
  std::span<const Vec3> corners;
  std::span<const Plane> planes;
  std::span<const Edge> edges;
};

}  // namespace overlapper::quadric
