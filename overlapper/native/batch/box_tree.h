#pragma once

#include <array>
#include <span>
#include <vector>

#include "batch/pair_mask.h"
#include "shapes/shape.h"

namespace overlapper {

/// Bounds of a placed shape.
struct Enclosure {
  /// The box, grown by its rounding error, so that the boxes of touching bodies meet. Infinite for a half-space.
  Bounds box;
  bool open = false;  ///< true for a half-space, which is `plane`
  Plane plane;
};
Enclosure enclosure(const Placed& placed);

/// Finds the pairs of boxes that meet, by a tree of boxes. Each node is halved along the axis with the largest spread
/// of middles. Two nodes with disjoint boxes have no common pair. The work per body therefore depends on its neighbours
/// and hardly on the number of bodies. Bodies of very different sizes have separate trees: a ground would make every
/// box around it as large as itself. The memory is kept between calls. The tree is kept as long as a search needs as
/// little work as the first one.
class BoxTree {
 public:
  /// Pairs i < j that `mask` admits or all pairs, sorted. A half-space meets a box that reaches into it. Two
  /// half-spaces make no pair.
  void pairs(std::span<const Enclosure> bodies, const PairMask* mask, std::vector<IndexPair>& pairs);

 private:
  /// A box around the bodies order_[begin] ... order_[end - 1]. Nodes are in depth-first order: the first half of node
  /// k is node k + 1.
  struct Node {
    Bounds box;
    int begin, end;
    int second_half;  ///< -1 for a leaf
  };
  void build(std::span<const Enclosure> bodies);
  void split(std::span<const Enclosure> bodies, int begin, int end);
  void fit(std::span<const Enclosure> bodies);
  void within(int node);
  void between(int a, int b);
  void sort(std::vector<IndexPair>& pairs);

  std::vector<int> order_, open_;  ///< bodies with a box, by leaf; half-spaces
  std::vector<Bounds> boxes_;      ///< parallel to order_
  std::vector<Node> nodes_;
  std::vector<int> roots_;  ///< roots of the trees, by size
  std::vector<IndexPair> found_;
  std::vector<int> starts_;
  size_t looked_at_ = 0;   ///< pairs of nodes in the last search
  size_t when_built_ = 0;  ///< pairs of nodes in the first search of this tree
};

}  // namespace overlapper
