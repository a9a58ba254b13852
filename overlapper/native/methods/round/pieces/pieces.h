#pragma once

#include <vector>

#include "geometry/wide_pose.h"
#include "methods/round/pieces/enclosing_polytope.h"
#include "methods/round/slicing/wall.h"
#include "shapes/shape.h"

namespace overlapper::pieces {

using slicing::Round;
using slicing::Wall;

/// The part of at most one round that planes leave.
struct Piece {
  int round = -1;
  int first_wall = 0, walls = 0;
};

/// A body as pieces with nothing in common but their borders.
struct Pieces {
  std::vector<Piece> pieces;
  std::vector<Round> rounds;
  std::vector<Wall> walls;
  double flatness = 0;  ///< m: by how much facets miss the corners that they are spanned by

  void clear() { pieces.clear(), rounds.clear(), walls.clear(), flatness = 0; }
};

/// How far from a point a body reaches at most.
double extent(const Placed& body, Vec3 point);

/// A polytope around the common set of two bodies of which one is bounded, about the point `inside`: what those planes
/// of both that are nearest to that point leave of a box, and a little more.
void enclose(const Placed& a, const Placed& b, Vec3 inside, EnclosingPolytope& result);

/// Cuts a body; pieces and walls that `other` does not reach are left out, and so are pieces outside of what encloses
/// the common set, if that is known. Bodies about a reference, which lies at `reference` in the world; what is cut is
/// about the point `inside`, of the same coordinates as the bodies.
///
/// A capsule is a cylinder and two half balls; a rounded hull is its core, a prism on every facet, a wedge of a
/// cylinder along every edge, and a wedge of a ball at every vertex.
void cut(const Placed& body, const Placed& other, const EnclosingPolytope* common, int owner, Vec3 reference,
         const WideVector& inside, Pieces& result);

/// Moves the surface of a body out, but not the cuts through it; false if that leaves nothing of something round.
bool grow(Pieces& pieces, double outwards);

}  // namespace overlapper::pieces
