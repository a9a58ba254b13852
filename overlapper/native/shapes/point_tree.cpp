#include "shapes/point_tree.h"

#include "geometry/cancellation.h"

namespace overlapper {

PointTree::PointTree(std::span<const Vec3> points) {
  entries_.reserve(points.size());
  for (Vec3 p : points) entries_.push_back({p, static_cast<int>(entries_.size())});
  if (points.empty()) return;
  Vec3 lower = points[0], upper = lower;
  for (Vec3 p : points) lower = min(lower, p), upper = max(upper, p);
  const Vec3 size = upper - lower;
  const auto inverse = [](double length) { return length > 0 ? 1 / length : 0; };
  grow(0, static_cast<int>(points.size()), {inverse(size.x), inverse(size.y), inverse(size.z)});
}

/// Lengths are relative to the extents of all points.
int PointTree::grow(int begin, int end, Vec3 scale) {
  cancellation_point(end - begin);
  const int at = static_cast<int>(nodes_.size());
  Vec3 lower = entries_[begin].point, upper = lower;
  for (int i = begin; i < end; ++i) lower = min(lower, entries_[i].point), upper = max(upper, entries_[i].point);
  nodes_.push_back({lower, upper, begin, end});
  if (end - begin <= kLeaf) return at;
  const Vec3 size{(upper.x - lower.x) * scale.x, (upper.y - lower.y) * scale.y, (upper.z - lower.z) * scale.z};
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  const int middle = begin + (end - begin) / 2;
  std::nth_element(entries_.begin() + begin, entries_.begin() + middle, entries_.begin() + end,
                   [axis](const Entry& a, const Entry& b) { return a.point[axis] < b.point[axis]; });
  grow(begin, middle, scale);
  const int second = grow(middle, end, scale);
  nodes_[at].second = second;
  return at;
}

}  // namespace overlapper
