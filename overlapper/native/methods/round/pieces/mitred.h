#pragma once

#include <vector>

#include "methods/round/pieces/distinct_walls.h"
#include "methods/round/pieces/enclosing_polytope.h"
#include "methods/round/pieces/parts.h"
#include "methods/round/pieces/pieces.h"
#include "methods/round/pieces/totals.h"

namespace overlapper::pieces {

/// Measures the common part of two mitred bodies. Both mitred offsets share a polytope. The parts of it outside the
/// rounds of either body are subtracted. The parts outside rounds of both bodies are added again. Edges and vertices
/// far from each other share no part, so there are few terms.
class Mitred {
 public:
  /// The pieces of both bodies by cut_mitred(). `around` contains the common part of the mitred offsets, and its faces
  /// are a little farther out.
  bool add_all(const Pieces& a, const Pieces& b, const EnclosingPolytope& around, const PieceSetting& setting,
               Sums& sums);

 private:
  /// The part of the common polytope over an edge or a vertex.
  struct Slot {
    EnclosingPolytope polytope;
    /// The same, but the faces of the round's own body are a little farther out. They touch the round, and rounding
    /// would make them cut it.
    EnclosingPolytope loose;
    Bounds box;
    std::span<const Wall> walls;
    int first_wall;  ///< the number of the first of these walls
    Round round;
  };

  bool add_slots(const Pieces& pieces, const EnclosingPolytope& loose, std::vector<Slot>& slots, size_t& count,
                 const PieceSetting& setting);
  bool add_both(const Slot& one, const Slot& other, const PieceSetting& setting);
  /// Adds the common part of a polytope and of rounds. False if neither doubles nor slices give it.
  bool add_rounds(std::span<const Round> rounds, EnclosingPolytope& polytope, const PieceSetting& setting, Sums& sums);

  EnclosingPolytope common_, loose_a_, loose_b_;
  EnclosingPolytope part_, loose_part_of_one_, loose_part_of_other_;
  DistinctWalls distinct_;
  std::vector<Wall> walls_;  ///< all of them; `distinct_` has them with repeated ones superseded
  std::vector<Slot> of_a_, of_b_;
  size_t slots_a_ = 0, slots_b_ = 0;
  double common_volume_ = 0;
  Sums more_, less_;  ///< all terms that are added, and all that are subtracted, each with the common polytope
  std::vector<SlicedPart> parts_;
};

}  // namespace overlapper::pieces
