#include "overlap/dual_tree.h"

#include <optional>
#include <utility>

#include "geometry/fitted_axes.h"

namespace overlapper {
namespace {

Vec3 point_of(const DualTree::Entry& each) { return each.point; }

/// The middle of the points along an axis, if all points lie near the two ends, and each end has a share of the points.
/// Example: the duals of a double cone's facets lie on two circles. The circles may be much closer together than they
/// are wide, and the two farthest points then each lie on both.
std::optional<double> between_halves(std::span<const DualTree::Entry> entries, Vec3 from, Vec3 axis) {
  constexpr size_t kLeastShare = 16;
  double lower = 0, upper = 0;
  for (const DualTree::Entry& each : entries) {
    const double place = dot(each.point - from, axis);
    lower = std::min(lower, place), upper = std::max(upper, place);
  }
  const double middle = (lower + upper) / 2, clear = (upper - lower) / 4;
  size_t below = 0;
  for (const DualTree::Entry& each : entries) {
    const double place = dot(each.point - from, axis);
    if (std::abs(place - middle) <= clear) return std::nullopt;
    below += place < middle;
  }
  if (std::min(below, entries.size() - below) * kLeastShare < entries.size()) return std::nullopt;
  return middle;
}

}  // namespace

DualTree::DualTree(std::vector<Entry> entries) : entries_(std::move(entries)) {
  if (!entries_.empty()) grow(0, static_cast<int>(entries_.size()));
}

int DualTree::grow(int begin, int end) {
  cancellation_point(end - begin);
  const int at = static_cast<int>(nodes_.size());
  const std::span<Entry> own = std::span(entries_).subspan(begin, end - begin);
  const std::array<Vec3, 3> axes = fitted_axes(own, point_of);
  // Relative to one of the points, so that the rounding error is relative to the box.
  const Vec3 from = own[0].point;
  Node node{from, {}, begin, end};
  for (int k = 0; k < 3; ++k) {
    double lower = 0, upper = 0;
    for (const Entry& each : own) {
      const double place = dot(each.point - from, axes[k]);
      lower = std::min(lower, place), upper = std::max(upper, place);
    }
    node.centre += (lower + upper) / 2 * axes[k];
    node.half[k] = (upper - lower) / 2 * axes[k];
  }
  nodes_.push_back(node);
  if (end - begin <= kLeaf) return at;
  std::optional<std::pair<Vec3, double>> parted;  // axis, and the middle along that axis
  for (const Vec3 axis : principal_axes(own, point_of))
    if (const auto place = between_halves(own, from, axis)) parted = {axis, *place};
  int middle = (end - begin) / 2;
  if (parted) {
    const auto lower = [&](const Entry& each) { return dot(each.point - from, parted->first) < parted->second; };
    middle = static_cast<int>(std::partition(own.begin(), own.end(), lower) - own.begin());
  } else {
    std::nth_element(own.begin(), own.begin() + middle, own.end(), [&](const Entry& a, const Entry& b) {
      return dot(a.point - from, axes[0]) < dot(b.point - from, axes[0]);
    });
  }
  grow(begin, begin + middle);
  const int second = grow(begin + middle, end);
  nodes_[at].second = second;
  return at;
}

}  // namespace overlapper
