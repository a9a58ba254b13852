#include "candidates.h"

#include <algorithm>

#include "minkowski.h"

namespace overlapper {
namespace {

/// A half-space meets a box where the box's lowest corner is in it; its own box says nothing.
bool meet(const Plane& plane, const Bounds& box) {
  const Vec3 n = plane.normal;
  const Vec3 lowest{n.x > 0 ? box.lower.x : box.upper.x, n.y > 0 ? box.lower.y : box.upper.y,
                    n.z > 0 ? box.lower.z : box.upper.z};
  return signed_distance(plane, lowest) <= rounding(norm(lowest) + std::abs(plane.offset));
}

/// The axis along which the middles of the boxes have the largest variance.
int widest_axis(std::span<const Enclosure> bodies, std::span<const int> closed) {
  Vec3 sum, squares;
  // Counted from one of them: the squares of a scene far from the origin would cancel.
  const Vec3 reference = closed.empty() ? Vec3{} : bodies[closed[0]].box.lower;
  for (int i : closed) {
    const Bounds& box = bodies[i].box;
    const Vec3 middle = (box.lower - reference) / 2 + (box.upper - reference) / 2;
    sum += middle;
    squares += Vec3{middle.x * middle.x, middle.y * middle.y, middle.z * middle.z};
  }
  const double n = static_cast<double>(closed.size());
  const Vec3 spread{squares.x - sum.x * sum.x / n, squares.y - sum.y * sum.y / n, squares.z - sum.z * sum.z / n};
  return spread.x >= spread.y && spread.x >= spread.z ? 0 : spread.y >= spread.z ? 1 : 2;
}

}  // namespace

Enclosure enclosure(const Placed& placed) {
  if (const HalfSpace* half = std::get_if<HalfSpace>(&placed.shape))
    return {bounds(placed), true, placed.pose * half->plane};
  Bounds box;
  if (const Box* b = std::get_if<Box>(&placed.shape)) {
    const Mat3& r = placed.pose.rotation;
    const Vec3 h = b->half_extents, reach{dot(abs(r.row0), h), dot(abs(r.row1), h), dot(abs(r.row2), h)};
    box = {placed.pose.translation - reach, placed.pose.translation + reach};
  } else {
    box = bounds(placed);
  }
  const Vec3 farthest = max(abs(box.lower), abs(box.upper));
  const double grown = rounding(farthest.x + farthest.y + farthest.z);
  const Vec3 margin{grown, grown, grown};
  return {{box.lower - margin, box.upper + margin}, false, {}};
}

void BoxSweep::sort_boxes(std::span<const Enclosure> bodies) {
  const int axis = widest_axis(bodies, closed_), first = (axis + 1) % 3, second = (axis + 2) % 3;
  entries_.clear();
  for (int i : closed_) {
    const auto& [lower, upper] = bodies[i].box;
    entries_.push_back({lower[axis], upper[axis], lower[first], upper[first], lower[second], upper[second], i});
  }
  std::sort(entries_.begin(), entries_.end(), [](const Entry& a, const Entry& b) { return a.lower < b.lower; });
}

void BoxSweep::run(std::span<const Enclosure> bodies, std::vector<IndexPair>& pairs) {
  pairs.clear();
  closed_.clear();
  open_.clear();
  for (int i = 0; i < static_cast<int>(bodies.size()); ++i) (bodies[i].open ? open_ : closed_).push_back(i);
  sort_boxes(bodies);
  for (size_t i = 0; i < entries_.size(); ++i) {
    const Entry& a = entries_[i];
    for (size_t j = i + 1; j < entries_.size() && entries_[j].lower <= a.upper; ++j) {
      const Entry& b = entries_[j];
      // Without short cuts: which side fails first cannot be predicted.
      if ((a.lower1 <= b.upper1) & (b.lower1 <= a.upper1) & (a.lower2 <= b.upper2) & (b.lower2 <= a.upper2))
        pairs.push_back({std::min(a.body, b.body), std::max(a.body, b.body)});
    }
  }
  for (int h : open_)
    for (int i : closed_)
      if (meet(bodies[h].plane, bodies[i].box)) pairs.push_back({std::min(h, i), std::max(h, i)});
  std::sort(pairs.begin(), pairs.end());
}

}  // namespace overlapper
