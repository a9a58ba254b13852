#include "candidates.h"

#include <algorithm>

namespace overlapper {
namespace {

bool meet(const Bounds& a, const Bounds& b) {
  for (int i = 0; i < 3; ++i)
    if (a.lower[i] > b.upper[i] || b.lower[i] > a.upper[i]) return false;
  return true;
}

/// A half-space meets a box where the box's lowest corner is in it; its own box says nothing.
bool meet(const Placed& half_space, const Bounds& box) {
  const Plane plane = half_space.pose * std::get<HalfSpace>(half_space.shape).plane;
  const Vec3 n = plane.normal;
  const Vec3 lowest{n.x > 0 ? box.lower.x : box.upper.x, n.y > 0 ? box.lower.y : box.upper.y,
                    n.z > 0 ? box.lower.z : box.upper.z};
  return signed_distance(plane, lowest) <= 0;
}

}  // namespace

std::vector<std::array<int, 2>> candidate_pairs(std::span<const Placed> bodies) {
  std::vector<Bounds> box;
  for (const Placed& p : bodies) box.push_back(bounds(p));
  // Sweep along x: boxes sorted by their lower side, each tested against those that begin before it ends.
  std::vector<int> order, open;
  for (int i = 0; i < static_cast<int>(bodies.size()); ++i) (bounded(bodies[i].shape) ? order : open).push_back(i);
  std::sort(order.begin(), order.end(), [&](int a, int b) { return box[a].lower.x < box[b].lower.x; });
  std::vector<std::array<int, 2>> pairs;
  for (size_t i = 0; i < order.size(); ++i)
    for (size_t j = i + 1; j < order.size() && box[order[j]].lower.x <= box[order[i]].upper.x; ++j)
      if (meet(box[order[i]], box[order[j]]))
        pairs.push_back({std::min(order[i], order[j]), std::max(order[i], order[j])});
  for (int h : open)
    for (int i : order)
      if (meet(bodies[h], box[i])) pairs.push_back({std::min(h, i), std::max(h, i)});
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

}  // namespace overlapper
