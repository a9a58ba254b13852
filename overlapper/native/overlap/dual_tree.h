#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>
#include <vector>

#include "geometry/cancellation.h"
#include "geometry/vec.h"

namespace overlapper {

/// A tree of boxes around points of dual space: finds the few planes near a polygon without a look at all planes. Each
/// box has the axes of its points. The duals of planes through one point are coplanar, and a box along other axes would
/// be too large.
class DualTree {
 public:
  /// A dual point and its number.
  struct Entry {
    Vec3 point;
    int number;
  };

  explicit DualTree(std::vector<Entry> entries);

  /// Calls `visit(number, corners)` for each dual point with dot(point, corner) >= level for some corners of the
  /// polygon. `corners` are the numbers of these corners in order. The point that reaches farthest towards the
  /// polygon's middle comes first. Ends, and returns false, once `visit` returns false.
  template <class Visit>
  bool reaching(std::span<const Vec3> polygon, double level, Visit visit) const {
    if (nodes_.empty()) return true;
    Query query{polygon, level, {}, std::vector<int>(polygon.size())};
    for (Vec3 corner : polygon) query.middle += corner;
    std::iota(query.reached.begin(), query.reached.end(), 0);
    return look(0, query, 0, visit);
  }

 private:
  static constexpr int kLeaf = 8;

  struct Node {
    Vec3 centre;
    Vec3 half[3];  ///< from the centre to the middles of the sides
    int begin, end;
    int second = -1;  ///< the other child; the first child follows directly; -1 for a leaf
  };
  struct Query {
    std::span<const Vec3> polygon;
    double level;
    Vec3 middle;
    std::vector<int> reached;  ///< corners reached by the present box, after those of the boxes around it
  };

  static double most(const Node& node, Vec3 d) {
    return dot(node.centre, d) + std::abs(dot(node.half[0], d)) + std::abs(dot(node.half[1], d)) +
           std::abs(dot(node.half[2], d));
  }

  /// The box around this one reaches the corners from `before` on.
  template <class Visit>
  bool look(int at, Query& query, size_t before, Visit& visit) const {
    cancellation_point();
    const Node& node = nodes_[at];
    std::vector<int>& reached = query.reached;
    const size_t own = reached.size();
    const auto keep = [&](auto reach) {
      for (size_t i = before; i < own; ++i)
        if (reach(query.polygon[reached[i]]) >= query.level) reached.push_back(reached[i]);
    };
    bool more = true;
    keep([&](Vec3 corner) { return most(node, corner); });
    if (reached.size() > own && node.second >= 0) {
      const bool swap = most(nodes_[at + 1], query.middle) < most(nodes_[node.second], query.middle);
      more =
          look(swap ? node.second : at + 1, query, own, visit) && look(swap ? at + 1 : node.second, query, own, visit);
    } else if (reached.size() > own) {
      for (int i = node.begin; i < node.end && more; ++i) {
        reached.resize(own);
        keep([&](Vec3 corner) { return dot(entries_[i].point, corner); });
        if (reached.size() > own) more = visit(entries_[i].number, std::span<const int>(reached).subspan(own));
      }
    }
    reached.resize(own);
    return more;
  }

  int grow(int begin, int end);

  std::vector<Node> nodes_;
  std::vector<Entry> entries_;  ///< the entries of a box are contiguous
};

}  // namespace overlapper
