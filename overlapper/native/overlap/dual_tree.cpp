#include "overlap/dual_tree.h"

#include <optional>
#include <utility>

namespace overlapper {
namespace {

/// Orthogonal unit vectors: along the longest way between two of the points, but for a factor, then along the longest
/// way from there.
std::array<Vec3, 3> axes_of(std::span<const DualTree::Entry> entries) {
  const auto farthest = [&](auto distance) {
    return std::ranges::max_element(entries, {}, [&](const DualTree::Entry& each) { return distance(each.point); })
        ->point;
  };
  const Vec3 end = farthest([&](Vec3 p) { return norm2(p - entries[0].point); });
  const Vec3 along = farthest([&](Vec3 p) { return norm2(p - end); }) - end;
  if (!(norm2(along) > 0)) return {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}};
  const Vec3 first = unit(along);
  const auto across = [&](Vec3 v) { return v - dot(v, first) * first; };
  const Vec3 aside = across(farthest([&](Vec3 p) { return norm2(across(p - end)); }) - end);
  // Once more, as rounding leaves a short rest far from orthogonal.
  const Vec3 second = norm2(aside) > 0 ? unit(across(unit(aside))) : any_orthogonal(first);
  return {first, second, cross(first, second)};
}

/// The middle between the ends of points along an axis, if none but the ends' surroundings hold any, and each its
/// share: the facets of a double cone have duals on two circles that may be far closer together than they are wide.
std::optional<double> between_halves(std::span<const DualTree::Entry> entries, Vec3 from, Vec3 axis, double lower,
                                     double upper) {
  constexpr size_t kLeastShare = 16;
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
  const std::array<Vec3, 3> axes = axes_of(own);
  // About one of the points, so that rounding is as small as the box.
  const Vec3 from = own[0].point;
  Node node{from, {}, begin, end};
  std::optional<std::pair<Vec3, double>> parted;  // along that axis, there
  for (int k = 0; k < 3; ++k) {
    double lower = 0, upper = 0;
    for (const Entry& each : own) {
      const double place = dot(each.point - from, axes[k]);
      lower = std::min(lower, place), upper = std::max(upper, place);
    }
    node.centre += (lower + upper) / 2 * axes[k];
    node.half[k] = (upper - lower) / 2 * axes[k];
    if (const auto place = between_halves(own, from, axes[k], lower, upper)) parted = {axes[k], *place};
  }
  nodes_.push_back(node);
  if (end - begin <= kLeaf) return at;
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
