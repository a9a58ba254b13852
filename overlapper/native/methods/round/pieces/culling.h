#pragma once

#include <array>
#include <vector>

#include "methods/round/pieces/enclosing_polytope.h"
#include "methods/round/pieces/pieces.h"

namespace overlapper::pieces {

/// Tells which pieces of two bodies may share something, and which of their walls matter there: by what encloses them
/// within a polytope around the common set.
class Culling {
 public:
  void look_at(const Pieces& a, const Pieces& b, const EnclosingPolytope& common);

  /// Adds the pairs of pieces whose boxes meet, in the order of their numbers.
  void near(std::vector<std::array<int, 2>>& pairs);

  /// A piece of a and one of b that are near each other.
  struct Meeting {
    int p = 0, q = 0;
    std::vector<Wall> walls;      ///< those that matter: where no other does, the common set ends sooner
    std::vector<int> of_p, of_q;  ///< their numbers
  };
  /// Fills in the walls of what pieces p of a and q of b may share; false if that is nothing. Where it is but nothing
  /// shows it, what these walls leave lies outside of the polytope around the common set.
  bool meet(int p, int q, Meeting& meeting) const;

  /// The polytope that the walls leave of what encloses the common set, every face with the number of its wall among
  /// `meeting.walls`, or kNoWall; false if that is nothing.
  bool share(const Meeting& meeting, EnclosingPolytope& polytope) const;

  /// Whether such a polytope lies outside of a round.
  bool outside(const EnclosingPolytope& polytope, const Meeting& meeting) const;

 private:
  /// A ball, or a cylinder by the point of its axis that is nearest to the origin; nothing without a radius.
  struct PlainRound {
    Vec3 centre, axis;
    double radius = 0;

    PlainRound() = default;
    explicit PlainRound(const Round& round);
    /// From the centre or the axis to a point; unit, or zero.
    Vec3 outward(Vec3 point) const;
    double reach(Vec3 outward_normal) const { return dot(outward_normal, centre) + radius; }
  };
  struct EnclosedPiece {
    EnclosingPolytope around;
    PlainRound round;
    Vec3 middle;
    double reach = 0;  ///< no corner is farther from the middle
    Bounds box;
    std::vector<int> walls;     ///< those of which something is left, and
    std::vector<int> uncut;     ///< those that it has not been cut with, though they may matter; both sorted
    std::vector<Plane> planes;  ///< of the former
    bool empty = false;
  };
  struct EnclosedBody {
    const Pieces* pieces = nullptr;
    std::vector<EnclosedPiece> parts;
  };
  /// A wall that a piece may be cut with, and by how much it would be.
  struct WallCut {
    EnclosingPolytope::Face face;
    double depth;
  };
  void enclose(const Pieces& pieces, const EnclosingPolytope& common, EnclosedBody& side);
  /// Cuts around_ with the walls of a piece; false if that leaves nothing. Those that it was not cut with, and that may
  /// matter, are left in uncut_.
  bool cut_around(const Pieces& pieces, const Piece& piece);
  bool keep_walls(const EnclosedBody& side, int piece, const EnclosedPiece& other, std::vector<int>& kept,
                  std::vector<Wall>& walls) const;
  bool beyond(const PlainRound& round, const EnclosingPolytope& other, Vec3 middle) const;

  /// A piece along the axis along which all are swept.
  struct Swept {
    double low, high;
    int piece;
  };
  static void sweep(const EnclosedBody& side, std::vector<Swept>& swept);

  EnclosedBody a_, b_;
  std::vector<Swept> swept_a_, swept_b_;
  EnclosingPolytope around_;  ///< what a piece leaves of the polytope around the common set
  std::vector<WallCut> uncut_;
  double margin_ = 0;  ///< m: of rounding
};

}  // namespace overlapper::pieces
