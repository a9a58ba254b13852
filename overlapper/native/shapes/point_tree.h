#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <vector>

#include "geometry/vec.h"

namespace overlapper {

/// A tree of boxes around points. It finds a good point, or the best point in logarithmic time if few points come near
/// the best.
class PointTree {
 public:
  PointTree() = default;
  explicit PointTree(std::span<const Vec3> points);

  /// The half-space dot(direction, point) > level.
  struct Beyond {
    Vec3 direction;
    double level;
  };

  bool empty() const { return nodes_.empty(); }

  /// The number of a point with a larger `value(number)` than `best`, whose value is `height`. It is the largest value
  /// unless too many points come near it. `best` if no point is larger. Points larger than `height` lie beyond the
  /// plane `aim(height)`.
  template <class Aim, class Value>
  int better(int best, double height, Aim aim, Value value) const {
    std::array<int, kMostDepth> waiting;
    int count = 0;
    waiting[count++] = 0;
    Beyond above = aim(height);
    for (int opened = 0; count > 0 && opened < kMostOpened; ++opened) {
      const int at = waiting[--count];
      const Node& node = nodes_[at];
      if (!(most(node, above.direction) > above.level)) continue;
      if (node.second >= 0) {
        const int first = at + 1, second = node.second;
        const bool swap = most(nodes_[first], above.direction) < most(nodes_[second], above.direction);
        waiting[count++] = swap ? first : second;
        waiting[count++] = swap ? second : first;
        continue;
      }
      for (int i = node.begin; i < node.end; ++i) {
        if (!(dot(entries_[i].point, above.direction) > above.level)) continue;
        const double v = value(entries_[i].number);
        if (!(v > height)) continue;
        height = v, best = entries_[i].number;
        above = aim(height);
      }
    }
    return best;
  }

 private:
  static constexpr int kLeaf = 8;
  /// Most boxes to open. For round bodies and around rims, fewer boxes hold a better point. For a slender body that
  /// lies across the axes, all boxes do.
  static constexpr int kMostOpened = 128;
  static constexpr int kMostDepth = 64;  ///< nodes that wait, one for each halving

  struct Entry {
    Vec3 point;
    int number;
  };
  struct Node {
    Vec3 lower, upper;
    int begin, end;   ///< of the entries
    int second = -1;  ///< the other child; the first child follows directly; -1 for a leaf
  };

  static double most(const Node& node, Vec3 d) {
    return std::max(node.lower.x * d.x, node.upper.x * d.x) + std::max(node.lower.y * d.y, node.upper.y * d.y) +
           std::max(node.lower.z * d.z, node.upper.z * d.z);
  }
  int grow(int begin, int end, Vec3 scale);

  std::vector<Node> nodes_;
  std::vector<Entry> entries_;  ///< the entries of a box are contiguous
};

}  // namespace overlapper
