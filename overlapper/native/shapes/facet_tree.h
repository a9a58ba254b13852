#pragma once

#include <vector>

#include "geometry/vec.h"

namespace overlapper {

struct HullData;

/// A point of a polytope, and a direction out of it there along which no other point of the polytope lies farther;
/// {0, 0, 0} if there is none.
struct Foot {
  Vec3 point, outward;
  double height2;  ///< squared distance from where it was asked
};

/// The first corner of a facet and those from `first` to `last` of its ring, which bound a part of it.
struct FacetPart {
  int facet, first, last;
};

/// A facet as one part.
FacetPart whole_facet(const HullData& hull, int facet);

/// The foot, on part of a facet, of a point above its plane. What lies beyond a cut through the facet has its foot on
/// another part, and `height2` is infinite here.
Foot foot_on_part(const HullData& hull, const FacetPart& part, Vec3 x);

/// Parts of facets, of few corners each, in boxes within boxes that lie as these do: the nearest point of a polytope in
/// a time like the logarithm of its size.
class FacetTree {
 public:
  explicit FacetTree(const HullData& hull);

  /// The nearest point of the polytope to a point outside of it, on a facet that the point sees. Without direction if
  /// it is not nearer than that.
  Foot foot(const HullData& hull, Vec3 x, double nearer_than2) const;

 private:
  static constexpr int kLeaf = 4;
  static constexpr int kMostDepth = 64;  ///< nodes that wait: one for each halving

  struct Entry {
    FacetPart part;
    Vec3 middle;
  };
  struct Node {
    Vec3 centre, axis[3], half;
    int begin, end;   ///< of the entries
    int second = -1;  ///< the other child, after the one that follows; -1 of a leaf
  };

  static double distance2(const Node& node, Vec3 x);
  int grow(const HullData& hull, int begin, int end);

  std::vector<Node> nodes_;
  std::vector<Entry> entries_;  ///< those of a box side by side
};

}  // namespace overlapper
