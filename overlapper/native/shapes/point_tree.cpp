#include "shapes/point_tree.h"

#include "geometry/cancellation.h"

namespace overlapper {

PointTree::PointTree(std::span<const Vec3> points) {
  entries_.reserve(points.size());
  for (Vec3 p : points) entries_.push_back({p, static_cast<int>(entries_.size())});
  if (!points.empty()) grow(0, static_cast<int>(points.size()));
}

int PointTree::grow(int begin, int end) {
  cancellation_point(end - begin);
  const int at = static_cast<int>(nodes_.size());
  Vec3 lower = entries_[begin].point, upper = lower;
  for (int i = begin; i < end; ++i) lower = min(lower, entries_[i].point), upper = max(upper, entries_[i].point);
  nodes_.push_back({lower, upper, begin, end});
  if (end - begin <= kLeaf) return at;
  const Vec3 size = upper - lower;
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  const int middle = begin + (end - begin) / 2;
  std::nth_element(entries_.begin() + begin, entries_.begin() + middle, entries_.begin() + end,
                   [axis](const Entry& a, const Entry& b) { return a.point[axis] < b.point[axis]; });
  grow(begin, middle);
  const int second = grow(middle, end);
  nodes_[at].second = second;
  return at;
}

}  // namespace overlapper
