#include "shapes/facet_tree.h"

#include <algorithm>
#include <array>
#include <span>

#include "geometry/cancellation.h"
#include "geometry/constants.h"
#include "geometry/fitted_axes.h"
#include "shapes/hull_data.h"

namespace overlapper {
namespace {

/// Corners of a part, without the first corner of its facet.
constexpr int kMostCorners = 8;

/// Calls `use(corner)` for the corners of a part.
template <class Use>
void for_corners(const HullData& hull, const FacetPart& part, Use use) {
  const auto ring = hull.facet(part.facet);
  use(hull.vertices[ring[0]]);
  for (int i = part.first; i <= part.last; ++i) use(hull.vertices[ring[i]]);
}

}  // namespace

FacetPart whole_facet(const HullData& hull, int facet) {
  return {facet, 1, static_cast<int>(hull.facet(facet).size()) - 1};
}

Foot foot_on_part(const HullData& hull, const FacetPart& part, Vec3 x) {
  const Plane& plane = hull.planes[part.facet];
  const Vec3 flat = x - signed_distance(plane, x) * plane.normal;
  const auto ring = hull.facet(part.facet);
  const int corners = static_cast<int>(ring.size());
  // How far x is to the right of the line from one corner to another, in multiples of the line's length.
  const auto right_of = [&](int from, int to) {
    const Vec3 a = hull.vertices[ring[from]];
    return dot(cross(hull.vertices[ring[to]] - a, plane.normal), flat - a);
  };
  Foot best{flat, plane.normal, kInfinity};
  bool inside = true;
  const bool begins_ring = part.first == 1, ends_ring = part.last == corners - 1;
  for (int i = begins_ring ? 0 : part.first; i < (ends_ring ? corners : part.last); ++i) {
    const int next = i + 1 < corners ? i + 1 : 0;
    if (right_of(i, next) <= 0) continue;
    inside = false;
    const Vec3 a = hull.vertices[ring[i]], edge = hull.vertices[ring[next]] - a;
    const double length2 = norm2(edge), share = std::clamp(dot(x - a, edge) / length2, 0.0, 1.0);
    const Vec3 point = a + share * edge;
    Vec3 outward = x - point;
    // Rounding must not tilt the direction along the edge: the polytope would reach farther that way.
    if (share > 0 && share < 1) outward -= dot(outward, edge) / length2 * edge;
    if (norm2(x - point) < best.height2) best = {point, outward, norm2(x - point)};
  }
  // Both parts beside a cut use the same number, so rounding leaves no gap between them.
  if (!begins_ring && right_of(0, part.first) > 0) inside = false;
  if (!ends_ring && right_of(0, part.last) < 0) inside = false;
  if (inside) best.height2 = norm2(x - flat);
  return best;
}

FacetTree::FacetTree(const HullData& hull) {
  for (int f = 0; f < static_cast<int>(hull.planes.size()); ++f) {
    cancellation_point();
    const int last = whole_facet(hull, f).last;
    for (int first = 1; first < last; first += kMostCorners) {
      const FacetPart part{f, first, std::min(first + kMostCorners, last)};
      Vec3 middle;
      for_corners(hull, part, [&](Vec3 corner) { middle += corner; });
      entries_.push_back({part, middle / static_cast<double>(part.last - part.first + 2)});
    }
  }
  grow(hull, 0, static_cast<int>(entries_.size()));
}

int FacetTree::grow(const HullData& hull, int begin, int end) {
  cancellation_point(end - begin);
  const int at = static_cast<int>(nodes_.size());
  const std::span<Entry> own = std::span(entries_).subspan(begin, end - begin);
  const std::array<Vec3, 3> axes = fitted_axes(own, [](const Entry& each) { return each.middle; });
  // Relative to one of the points, so that the rounding error is relative to the box.
  const Vec3 from = own[0].middle;
  Vec3 lower, upper;
  for (const Entry& each : own)
    for_corners(hull, each.part, [&](Vec3 corner) {
      const Vec3 d = corner - from, place{dot(d, axes[0]), dot(d, axes[1]), dot(d, axes[2])};
      lower = min(lower, place), upper = max(upper, place);
    });
  const Vec3 middle = (lower + upper) / 2;
  nodes_.push_back({from + middle.x * axes[0] + middle.y * axes[1] + middle.z * axes[2],
                    {axes[0], axes[1], axes[2]},
                    (upper - lower) / 2,
                    begin,
                    end});
  if (end - begin <= kLeaf) return at;
  const int half = (end - begin) / 2;
  std::nth_element(own.begin(), own.begin() + half, own.end(), [&](const Entry& a, const Entry& b) {
    return dot(a.middle - from, axes[0]) < dot(b.middle - from, axes[0]);
  });
  grow(hull, begin, begin + half);
  const int second = grow(hull, begin + half, end);
  nodes_[at].second = second;
  return at;
}

double FacetTree::distance2(const Node& node, Vec3 x) {
  const Vec3 d = x - node.centre, along{dot(d, node.axis[0]), dot(d, node.axis[1]), dot(d, node.axis[2])};
  return norm2(max(abs(along) - node.half, {}));
}

Foot FacetTree::foot(const HullData& hull, Vec3 x, double nearer_than2) const {
  struct Waiting {
    int node;
    double distance2;
  };
  std::array<Waiting, kMostDepth> waiting;
  int count = 0;
  waiting[count++] = {0, distance2(nodes_[0], x)};
  Foot nearest{x, {}, nearer_than2};
  while (count > 0) {
    const Waiting next = waiting[--count];
    if (!(next.distance2 < nearest.height2)) continue;
    const Node& node = nodes_[next.node];
    if (node.second >= 0) {
      Waiting near{next.node + 1, distance2(nodes_[next.node + 1], x)},
          far{node.second, distance2(nodes_[node.second], x)};
      if (far.distance2 < near.distance2) std::swap(near, far);
      waiting[count++] = far, waiting[count++] = near;
      continue;
    }
    for (int i = node.begin; i < node.end; ++i) {
      const FacetPart& part = entries_[i].part;
      const double height = signed_distance(hull.planes[part.facet], x);
      if (height <= 0 || height * height >= nearest.height2) continue;
      const Foot found = foot_on_part(hull, part, x);
      if (found.height2 < nearest.height2) nearest = found;
    }
  }
  return nearest;
}

}  // namespace overlapper
