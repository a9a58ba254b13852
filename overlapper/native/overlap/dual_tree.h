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

/// Points of dual space in boxes within boxes, so that the few planes that pass by a polygon are found without looking
/// at all. Boxes lie as their points do: the duals of planes through one point are in one plane, and a box along other
/// axes would seem to reach beyond it.
class DualTree {
 public:
  /// A dual point, and what it is called.
  struct Entry {
    Vec3 point;
    int number;
  };

  explicit DualTree(std::vector<Entry> entries);

  /// Calls `visit(number, corners)` for the dual points that reach some corners of the polygon, by their numbers in
  /// order: dot(point, corner) >= level. What reaches farther towards the polygon's middle comes first. Ends, and is
  /// false, once `visit` is.
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
    Vec3 half[3];  ///< from the centre to the middles of sides
    int begin, end;
    int second = -1;  ///< the other child, after the one that follows; -1 of a leaf
  };
  struct Query {
    std::span<const Vec3> polygon;
    double level;
    Vec3 middle;
    std::vector<int> reached;  ///< by the box that is looked at, after those that the boxes around it reach
  };

  static double most(const Node& node, Vec3 d) {
    return dot(node.centre, d) + std::abs(dot(node.half[0], d)) + std::abs(dot(node.half[1], d)) +
           std::abs(dot(node.half[2], d));
  }

  /// The corners from `before` on are those that the box around this one reaches.
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
  std::vector<Entry> entries_;  ///< those of a box side by side
};

}  // namespace overlapper
