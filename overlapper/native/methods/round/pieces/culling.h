#pragma once

#include <array>
#include <vector>

#include "methods/round/pieces/enclosing_polytope.h"
#include "methods/round/pieces/pieces.h"

namespace overlapper::pieces {

/// A ball, or a cylinder with the point of its axis nearest to the origin. Not used if the radius is 0.
struct PlainRound {
  Vec3 centre, axis;
  double radius = 0;

  PlainRound() = default;
  explicit PlainRound(const Round& round);
  /// From the centre or the axis to a point; unit, or zero.
  Vec3 outward(Vec3 point) const;
  double reach(Vec3 outward_normal) const { return dot(outward_normal, centre) + radius; }
  /// Whether a polytope lies beyond the plane that touches the round beside the polytope's middle.
  bool misses(const EnclosingPolytope& polytope, Vec3 middle, double margin) const;
  /// Whether the round contains a polytope.
  bool contains(const EnclosingPolytope& polytope, double margin) const;
};

/// Finds the pairs of pieces of two bodies that may share something, and the walls that matter for each pair. It
/// compares polytopes that enclose the pieces within a polytope around the common set.
class Culling {
 public:
  void look_at(const Pieces& a, const Pieces& b, const EnclosingPolytope& common);

  /// Adds the pairs of pieces whose boxes meet, in the order of their numbers.
  void near(std::vector<std::array<int, 2>>& pairs);

  /// A piece of a and one of b that are near each other.
  struct Meeting {
    int p = 0, q = 0;
    std::vector<Wall> walls;      ///< the relevant walls; no other wall bounds the common set
    std::vector<int> of_p, of_q;  ///< the numbers of these walls
  };
  /// Fills in the walls of the common part of piece p of a and piece q of b; false if that part is empty. If it is
  /// empty but not proved so, the walls leave a set outside the polytope around the common set.
  bool meet(int p, int q, Meeting& meeting) const;

  /// The polytope that the walls cut from the polytope around the common set; false if it is empty. Each face has the
  /// number of its wall among `meeting.walls`, or kNoWall.
  bool share(const Meeting& meeting, EnclosingPolytope& polytope) const;

  double margin() const { return margin_; }

 private:
  struct EnclosedPiece {
    EnclosingPolytope around;
    PlainRound round;
    Vec3 middle;
    double reach = 0;  ///< upper bound of the distance of a corner from the middle
    Bounds box;
    std::vector<int> walls;     ///< walls with a remaining face, sorted
    std::vector<int> uncut;     ///< walls that were not used for a cut, though they may matter; sorted
    std::vector<Plane> planes;  ///< the planes of `walls`
    bool empty = false;
  };
  struct EnclosedBody {
    const Pieces* pieces = nullptr;
    std::vector<EnclosedPiece> parts;
  };
  /// A wall for a cut of a piece, and how deep it would cut.
  struct WallCut {
    EnclosingPolytope::Face face;
    double depth;
  };
  void enclose(const Pieces& pieces, const EnclosingPolytope& common, EnclosedBody& side);
  /// Cuts around_ with the walls of a piece; false if nothing is left. uncut_ gets the relevant walls that were not
  /// used.
  bool cut_around(const Pieces& pieces, const Piece& piece);
  bool keep_walls(const EnclosedBody& side, int piece, const EnclosedPiece& other, std::vector<int>& kept,
                  std::vector<Wall>& walls) const;

  /// The interval of a piece along the axis of the sweep.
  struct Swept {
    double low, high;
    int piece;
  };
  static void sweep(const EnclosedBody& side, std::vector<Swept>& swept);

  EnclosedBody a_, b_;
  std::vector<Swept> swept_a_, swept_b_;
  EnclosingPolytope around_;  ///< the part of the polytope around the common set that a piece leaves
  std::vector<WallCut> uncut_;
  double margin_ = 0;  ///< m: for rounding
};

}  // namespace overlapper::pieces
