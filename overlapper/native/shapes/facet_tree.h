#pragma once

#include <vector>

#include "geometry/vec.h"

namespace overlapper {

struct HullData;

/// A point of a polytope, with an outward direction along which no other point of the polytope lies farther; {0, 0, 0}
/// if no point was found.
struct Foot {
  Vec3 point, outward;
  double height2;  ///< squared distance from the query point
};

/// A part of a facet: the polygon of the facet's first corner and the corners from `first` to `last` of its ring.
struct FacetPart {
  int facet, first, last;
};

/// A facet as one part.
FacetPart whole_facet(const HullData& hull, int facet);

/// The foot of a point above the plane of a facet, on a part of the facet. `height2` is infinite if the foot is on
/// another part, beyond a cut.
Foot foot_on_part(const HullData& hull, const FacetPart& part, Vec3 x);

/// A tree of boxes around parts of facets with few corners each. It finds the nearest point of a polytope in
/// logarithmic time.
class FacetTree {
 public:
  explicit FacetTree(const HullData& hull);

  /// The nearest point of the polytope to a point outside, on a facet that the point sees. {0, 0, 0} as direction if
  /// its squared distance is not less than `nearer_than2`.
  Foot foot(const HullData& hull, Vec3 x, double nearer_than2) const;

 private:
  static constexpr int kLeaf = 4;
  static constexpr int kMostDepth = 64;  ///< nodes that wait, one for each halving

  struct Entry {
    FacetPart part;
    Vec3 middle;
  };
  struct Node {
    Vec3 centre, axis[3], half;
    int begin, end;   ///< of the entries
    int second = -1;  ///< the other child; the first child follows directly; -1 for a leaf
  };

  static double distance2(const Node& node, Vec3 x);
  int grow(const HullData& hull, int begin, int end);

  std::vector<Node> nodes_;
  std::vector<Entry> entries_;  ///< the entries of a box are contiguous
};

}  // namespace overlapper
