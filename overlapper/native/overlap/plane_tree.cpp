#include "overlap/plane_tree.h"

#include <algorithm>
#include <cfloat>
#include <cmath>

#include "geometry/cancellation.h"

namespace overlapper {

PlaneTree::PlaneTree(const Polytope& polytope, const std::vector<int>& facets, Vec3 centre, double radius)
    : polytope_(polytope), centre_(centre), radius_(radius) {
  double farthest = 0;
  for (int f : facets) {
    const Vec3 dual = polytope.dual[f];
    const double length = norm(dual);
    planes_.push_back({dual / length, (1 - dot(dual, centre)) / length, f});
    farthest = std::max(farthest, 1 / length);
  }
  rounding_ = 32 * DBL_EPSILON * (norm(centre) + radius + farthest);
  grow(0, static_cast<int>(planes_.size()));
}

int PlaneTree::grow(int begin, int end) {
  cancellation_point(end - begin);
  const int at = static_cast<int>(nodes_.size());
  CentredPlane lower = planes_[begin], upper = lower;
  for (int i = begin; i < end; ++i) {
    const CentredPlane& plane = planes_[i];
    lower.normal = min(lower.normal, plane.normal), upper.normal = max(upper.normal, plane.normal);
    lower.offset = std::min(lower.offset, plane.offset), upper.offset = std::max(upper.offset, plane.offset);
  }
  nodes_.push_back({lower, upper, begin, end});
  if (end - begin <= kLeaf) return at;
  const Vec3 size = radius_ * (upper.normal - lower.normal);
  const double widest = max_component(size);
  const auto value = [&](const CentredPlane& plane) {
    if (upper.offset - lower.offset > widest) return plane.offset;
    return size.x == widest ? plane.normal.x : size.y == widest ? plane.normal.y : plane.normal.z;
  };
  const int middle = begin + (end - begin) / 2;
  std::nth_element(planes_.begin() + begin, planes_.begin() + middle, planes_.begin() + end,
                   [&](const CentredPlane& a, const CentredPlane& b) { return value(a) < value(b); });
  grow(begin, middle);
  const int second = grow(middle, end);
  nodes_[at].second = second;
  return at;
}

double PlaneTree::most(const Node& node, Vec3 d) {
  const Vec3 a = node.lower.normal, b = node.upper.normal;
  const Vec3 one = scaled(a, d), other = scaled(b, d);
  const Vec3 low = min(one, other), high = max(one, other);
  return std::max(high.x + high.y + high.z - node.lower.offset, node.upper.offset - low.x - low.y - low.z);
}

double PlaneTree::misfit(Vec3 vertex, double enough) {
  double misfit = last_enough_ < 0 ? 0 : off_plane(polytope_, last_enough_, vertex);
  if (misfit < enough) look(0, vertex, enough, misfit);
  return misfit;
}

void PlaneTree::look(int at, Vec3 vertex, double enough, double& misfit) {
  const Node& node = nodes_[at];
  const Vec3 d = vertex - centre_;
  if (misfit >= enough || most(node, d) + rounding_ < misfit) return;
  if (node.second >= 0) {
    const bool swap = most(nodes_[at + 1], d) < most(nodes_[node.second], d);
    look(swap ? node.second : at + 1, vertex, enough, misfit);
    look(swap ? at + 1 : node.second, vertex, enough, misfit);
    return;
  }
  for (int i = node.begin; i < node.end; ++i) {
    const double off = off_plane(polytope_, planes_[i].facet, vertex);
    if (off >= enough) last_enough_ = planes_[i].facet;
    misfit = std::max(misfit, off);
  }
}

}  // namespace overlapper
