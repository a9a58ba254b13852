#pragma once

#include <vector>

#include "methods/round/pieces/parts.h"

namespace overlapper::pieces {

/// The common part of one piece of each body, within a polytope.
class EnclosedPart {
 public:
  std::vector<Round> rounds;
  std::vector<Wall> walls;
  EnclosingPolytope polytope;  ///< each face has the number of its wall, or kNoWall

  /// True if the part was added, or is empty: walls leave nothing, or the polytope lies outside a round. `margin` in m
  /// is for rounding.
  bool add_in_closed_form(double margin, const PieceSetting& setting, Sums& sums);

  /// After add_in_closed_form(): adds the part by slices, in smaller parts whose walls suit slices. False if slices
  /// give up. The polytope is used up.
  bool add_sliced(const PieceSetting& setting, Sums& sums);

 private:
  DistinctWalls distinct_;
  std::vector<SlicedPart> small_;
};

}  // namespace overlapper::pieces
