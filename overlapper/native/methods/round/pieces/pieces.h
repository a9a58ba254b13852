#pragma once

#include <span>
#include <vector>

#include "geometry/wide_pose.h"
#include "methods/round/pieces/enclosing_polytope.h"
#include "methods/round/slicing/wall.h"
#include "shapes/shape.h"

namespace overlapper::pieces {

using slicing::Round;
using slicing::Wall;

/// The part of at most one round inside planes.
struct Piece {
  int round = -1;
  int first_wall = 0, walls = 0;
};

/// A body as pieces with disjoint interiors.
struct Pieces {
  std::vector<Piece> pieces;
  std::vector<Round> rounds;
  std::vector<Wall> walls;
  double flatness = 0;  ///< m: largest distance of a facet's plane from its corners
  double rounding = 0;  ///< m: movement of surfaces by the rounding of double-doubles
  double gaps = 0;      ///< m³: volume that the pieces may miss or share
  double gap_area = 0;  ///< m²: surface that the pieces may miss or share

  /// The walls of a piece.
  std::span<const Wall> of(int piece) const {
    return std::span(walls).subspan(pieces[piece].first_wall, pieces[piece].walls);
  }
  void clear() { pieces.clear(), rounds.clear(), walls.clear(), flatness = rounding = gaps = gap_area = 0; }
  double misplaced() const { return flatness + rounding; }
};

/// Upper bound of the distance of a body's points from a point.
double extent(const Placed& body, Vec3 point);

/// A polytope around the common set of some bodies, one of them bounded, relative to `inside`. It is a box cut by the
/// planes of the bodies nearest to `inside`, and a little larger.
void enclose(std::span<const Placed* const> bodies, Vec3 inside, EnclosingPolytope& result);

/// The same, also cut by each smooth body's plane nearest to `inside`. It is thin if the contact is shallow.
void enclose_closely(std::span<const Placed* const> bodies, Vec3 inside, EnclosingPolytope& result);

/// Cuts a body into pieces. Pieces and walls that `other` does not reach are left out, and so are pieces outside
/// `common`, the polytope around the common set, if known. Bodies are about a reference, at `reference` in the world.
/// Pieces are relative to the point `inside`, in the same coordinates as the bodies.
void cut(const Placed& body, const Placed& other, const EnclosingPolytope* common, int owner, Vec3 reference,
         const WideVector& inside, Pieces& result);

/// Gives the mitred offset of a rounded hull, or a polytope, as the first piece. Each further piece is the part of it
/// over an edge or a vertex, with the round that belongs there: outside the round, it is not in the body. False for
/// other bodies.
bool cut_mitred(const Placed& body, const Placed& other, const EnclosingPolytope& common, int owner, Vec3 reference,
                const WideVector& inside, Pieces& result);

/// Moves the surface of a body out, but not the cuts through the body; false if nothing of a round shape is left.
bool grow(Pieces& pieces, double outwards);

}  // namespace overlapper::pieces
