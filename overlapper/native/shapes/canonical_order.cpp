#include "shapes/canonical_order.h"

#include <algorithm>
#include <compare>
#include <numeric>
#include <tuple>

namespace overlapper {
namespace {

std::partial_ordering compare(const Placed& a, const Placed& b) {
  if (a.shape.index() != b.shape.index())
    return a.shape.index() < b.shape.index() ? std::partial_ordering::less : std::partial_ordering::greater;
  const auto by_shape = std::visit(
      [&](const auto& shape) { return shape.order(std::get<std::decay_t<decltype(shape)>>(b.shape)); }, a.shape);
  if (by_shape != 0) return by_shape;
  if (const auto by_position = order_of(a.position, b.position); by_position != 0) return by_position;
  const Quaternion &p = a.orientation, &q = b.orientation;
  return std::tie(p.x, p.y, p.z, p.w) <=> std::tie(q.x, q.y, q.z, q.w);
}

}  // namespace

bool comes_before(const Placed& a, const Placed& b) { return compare(a, b) < 0; }

std::vector<int> canonical_order(std::span<const Placed> bodies) {
  if (bodies.size() == 2) {  // a sort would allocate memory
    const int first = comes_before(bodies[1], bodies[0]) ? 1 : 0;
    return {first, 1 - first};
  }
  std::vector<int> order(bodies.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int i, int j) { return comes_before(bodies[i], bodies[j]); });
  return order;
}

}  // namespace overlapper
