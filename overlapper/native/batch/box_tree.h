#pragma once

#include <array>
#include <span>
#include <vector>

#include "shapes/shape.h"

namespace overlapper {

using IndexPair = std::array<int, 2>;

/// What surely holds a placed shape.
struct Enclosure {
  /// The box, grown by what rounding may have moved its sides, so that bodies that touch have boxes that meet; infinite
  /// for a half-space.
  Bounds box;
  bool open = false;  ///< it is a half-space, that of `plane`
  Plane plane;
};
Enclosure enclosure(const Placed& placed);

/// Finds the pairs of boxes that meet by a tree of boxes around boxes, halved along the axis on which their middles are
/// spread out most. Two parts of the tree whose boxes are apart have no pair in common, so that the work per body
/// depends on how many it is near and hardly on how many there are. Bodies of very different size have trees of their
/// own: a ground would make every box around it as large as itself. Keeps its memory between calls, and the tree for as
/// long as that finds the pairs with as little work.
class BoxTree {
 public:
  /// Pairs i < j, sorted. A half-space meets a box that reaches into it, and two half-spaces are no pair.
  void pairs(std::span<const Enclosure> bodies, std::vector<IndexPair>& pairs);

 private:
  /// A box around the bodies order_[begin] ... order_[end - 1]. Nodes stand in the order of a walk, so that the first
  /// half of node k is node k + 1.
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

  std::vector<int> order_, open_;  ///< the bodies with a box of their own, by leaf; the half-spaces
  std::vector<Bounds> boxes_;      ///< parallel to order_
  std::vector<Node> nodes_;
  std::vector<int> roots_;  ///< of the trees, by size
  std::vector<IndexPair> found_;
  std::vector<int> starts_;
  size_t looked_at_ = 0;   ///< pairs of nodes, in the last search
  size_t when_built_ = 0;  ///< the same, in the first search of this tree
};

}  // namespace overlapper
