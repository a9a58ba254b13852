#pragma once

#include <vector>

#include "methods/round/enclosure.h"
#include "methods/round/pieces.h"

namespace overlapper::slicing {

/// Tells which pieces of two bodies may share something, and which of their walls matter there: by what encloses them
/// within a polytope around the common set.
class Culling {
 public:
  void look_at(const Pieces& a, const Pieces& b, const Enclosure& common);

  /// Fills in the walls and a box around what pieces p of a and q of b share; false if that is nothing. Where it is but
  /// nothing shows it, what these walls leave lies outside of the polytope around the common set.
  bool meet(int p, int q, std::vector<Wall>& walls, Bounds& box) const;

 private:
  struct Part {
    Enclosure around;
    Vec3 middle;
    Bounds box;
    std::vector<int> walls;  ///< those of which something is left
    bool empty = false;
  };
  struct Side {
    const Pieces* pieces = nullptr;
    std::vector<Part> parts;
  };
  void enclose(const Pieces& pieces, const Enclosure& common, Side& side) const;
  bool keep_walls(const Side& side, int piece, const Part& other, std::vector<Wall>& walls) const;
  bool beyond(const Round& round, const Part& other) const;

  Side a_, b_;
  double margin_ = 0;  ///< m: of rounding
};

}  // namespace overlapper::slicing
