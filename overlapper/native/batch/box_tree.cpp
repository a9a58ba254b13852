#include "batch/box_tree.h"

#include <algorithm>

#include "geometry/cancellation.h"
#include "geometry/rounding.h"
#include "geometry/thresholds.h"

namespace overlapper {
namespace {

/// A half-space meets a box if it contains the box's lowest corner. A half-space's own box is infinite.
bool meet(const Plane& plane, const Bounds& box) {
  const Vec3 n = plane.normal;
  const Vec3 lowest{n.x > 0 ? box.lower.x : box.upper.x, n.y > 0 ? box.lower.y : box.upper.y,
                    n.z > 0 ? box.lower.z : box.upper.z};
  return signed_distance(plane, lowest) <=
         rounding(std::abs(lowest.x) + std::abs(lowest.y) + std::abs(lowest.z) + std::abs(plane.offset));
}

/// The middle as a sum of halves, which cannot overflow.
Vec3 middle(const Bounds& box) { return box.lower / 2 + box.upper / 2; }

double extent(const Bounds& box) { return max_component(box.upper - box.lower); }

/// The size of a box, in steps of a factor of eight.
int size_class(const Bounds& box) { return std::ilogb(extent(box)) / 3; }

}  // namespace

Enclosure enclosure(const Placed& placed) {
  const Bounds box = ask(placed.shape, [&](const auto& s) { return s.enclosing_box(placed.pose); });
  if (const Plane* plane = only_plane(placed.shape)) return {box, true, placed.pose * *plane};
  const Vec3 farthest = max(abs(box.lower), abs(box.upper));
  const double grown = rounding(farthest.x + farthest.y + farthest.z);
  const Vec3 margin{grown, grown, grown};
  return {{box.lower - margin, box.upper + margin}, false, {}};
}

void BoxTree::build(std::span<const Enclosure> bodies) {
  const auto size = [&](int i) { return size_class(bodies[i].box); };
  std::sort(order_.begin(), order_.end(), [&](int i, int j) { return std::pair(size(i), i) < std::pair(size(j), j); });
  nodes_.clear();
  roots_.clear();
  for (int begin = 0, end = 0; begin < static_cast<int>(order_.size()); begin = end) {
    while (end < static_cast<int>(order_.size()) && size(order_[end]) == size(order_[begin])) ++end;
    roots_.push_back(static_cast<int>(nodes_.size()));
    split(bodies, begin, end);
  }
}

/// Halves the bodies recursively. The depth of the tree is the logarithm of their number, wherever they are.
void BoxTree::split(std::span<const Enclosure> bodies, int begin, int end) {
  const int node = static_cast<int>(nodes_.size());
  nodes_.push_back({{}, begin, end, -1});
  if (end - begin <= kMostBoxesCompared) return;
  Bounds middles{middle(bodies[order_[begin]].box), middle(bodies[order_[begin]].box)};
  for (int k = begin + 1; k < end; ++k) {
    const Vec3 m = middle(bodies[order_[k]].box);
    middles = {min(middles.lower, m), max(middles.upper, m)};
  }
  const Vec3 spread = middles.upper - middles.lower;
  const int axis = spread.x >= spread.y && spread.x >= spread.z ? 0 : spread.y >= spread.z ? 1 : 2;
  const int half = begin + (end - begin) / 2;
  std::nth_element(order_.begin() + begin, order_.begin() + half, order_.begin() + end,
                   [&](int i, int j) { return middle(bodies[i].box)[axis] < middle(bodies[j].box)[axis]; });
  split(bodies, begin, half);
  nodes_[node].second_half = static_cast<int>(nodes_.size());
  split(bodies, half, end);
}

/// Fits the box of each node to its bodies, last node first: a node's halves follow the node.
void BoxTree::fit(std::span<const Enclosure> bodies) {
  boxes_.resize(order_.size());
  for (size_t k = 0; k < order_.size(); ++k) boxes_[k] = bodies[order_[k]].box;
  for (int node = static_cast<int>(nodes_.size()) - 1; node >= 0; --node) {
    Node& n = nodes_[node];
    if (n.second_half < 0) {
      n.box = boxes_[n.begin];
      for (int k = n.begin + 1; k < n.end; ++k)
        n.box = {min(n.box.lower, boxes_[k].lower), max(n.box.upper, boxes_[k].upper)};
    } else {
      const Bounds &a = nodes_[node + 1].box, &b = nodes_[n.second_half].box;
      n.box = {min(a.lower, b.lower), max(a.upper, b.upper)};
    }
  }
}

void BoxTree::within(int node) {
  cancellation_point();
  const Node& n = nodes_[node];
  if (n.second_half >= 0) {
    within(node + 1);
    within(n.second_half);
    between(node + 1, n.second_half);
    return;
  }
  for (int i = n.begin; i < n.end; ++i)
    for (int j = i + 1; j < n.end; ++j)
      if (meet(boxes_[i], boxes_[j])) found_.push_back({order_[i], order_[j]});
}

void BoxTree::between(int a, int b) {
  cancellation_point();
  ++looked_at_;
  const Node &m = nodes_[a], &n = nodes_[b];
  if (!meet(m.box, n.box)) return;
  if (m.second_half < 0 && n.second_half < 0) {
    for (int i = m.begin; i < m.end; ++i) {
      if (!meet(boxes_[i], n.box)) continue;
      for (int j = n.begin; j < n.end; ++j)
        if (meet(boxes_[i], boxes_[j])) found_.push_back({order_[i], order_[j]});
    }
  } else if (n.second_half < 0 || (m.second_half >= 0 && extent(m.box) >= extent(n.box))) {
    between(a + 1, b);
    between(m.second_half, b);
  } else {
    between(a, b + 1);
    between(a, n.second_half);
  }
}

/// Sorts pairs by the first body with a counting sort, then by the second, with few pairs for each first body.
void BoxTree::sort(std::vector<IndexPair>& pairs) {
  std::fill(starts_.begin(), starts_.end(), 0);
  for (IndexPair& pair : found_) {
    if (pair[0] > pair[1]) std::swap(pair[0], pair[1]);
    ++starts_[pair[0] + 1];
  }
  for (size_t i = 1; i < starts_.size(); ++i) starts_[i] += starts_[i - 1];
  pairs.resize(found_.size());
  for (const IndexPair& pair : found_) pairs[starts_[pair[0]]++] = pair;
  // Each start has moved on to the next start.
  for (size_t i = 0, begin = 0; i + 1 < starts_.size(); begin = starts_[i++])
    std::sort(pairs.begin() + begin, pairs.begin() + starts_[i]);
}

void BoxTree::pairs(std::span<const Enclosure> bodies, const PairMask* mask, std::vector<IndexPair>& pairs) {
  found_.clear();
  looked_at_ = 0;
  starts_.resize(bodies.size() + 1);
  const bool first = order_.size() + open_.size() != bodies.size();
  if (first) {
    order_.clear();
    open_.clear();
    for (int i = 0; i < static_cast<int>(bodies.size()); ++i) (bodies[i].open ? open_ : order_).push_back(i);
  }
  if (first || when_built_ == 0) build(bodies);
  fit(bodies);
  for (size_t i = 0; i < roots_.size(); ++i) {
    within(roots_[i]);
    for (size_t j = 0; j < i; ++j) between(roots_[i], roots_[j]);
  }
  if (when_built_ == 0) when_built_ = looked_at_;
  else if (looked_at_ > when_built_ + when_built_ / 2) when_built_ = 0;  // the next call builds a new tree
  for (int h : open_)
    for (int i : order_)
      if (meet(bodies[h].plane, bodies[i].box)) found_.push_back({h, i});
  if (mask) std::erase_if(found_, [&](const IndexPair& pair) { return !mask->admits(pair); });
  sort(pairs);
}

}  // namespace overlapper
