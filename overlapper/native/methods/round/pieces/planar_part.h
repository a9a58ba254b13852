#pragma once

#include <span>
#include <vector>

#include "methods/round/pieces/pieces.h"

namespace overlapper::pieces {

/// The corners of a convex plane polygon, counter-clockwise from the side that its normal points to.
using WidePolygon = std::vector<WideVector>;

/// The part of a plane polygon inside a body.
struct PlanarPart {
  double area = 0;
  Vec3 first;               ///< ∫ x dA
  Mat3 second{{}, {}, {}};  ///< ∫ x xᵀ dA
  double error = 0;         ///< of the area, by rounding
  double rim = 0;           ///< growth of the area per distance that surfaces move, at most

  void add(const PlanarPart& other) {
    area += other.area, first += other.first, second = second + other.second, error += other.error, rim += other.rim;
  }
};

/// Adds the part of the polygon inside all pieces of a body. Pieces are disjoint, but for their cuts.
void add_planar_part(const WidePolygon& polygon, const WideVector& normal, const Pieces& body, PlanarPart& sum);

/// The face of wall number i: the part of its plane inside the other walls, and inside a square around a ball. False if
/// there is none. If two walls are in one plane, the first one has the face.
bool face_within(std::span<const Wall> walls, size_t i, const WideVector& middle, double radius, WidePolygon& face);

/// ∫ x nᵀ dA over the faces of the first `count` walls, of the part of a ball inside all walls.
Mat3 moved_by_walls(const Round& ball, std::span<const Wall> walls, size_t count);

}  // namespace overlapper::pieces
