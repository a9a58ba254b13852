#include "shapes/canonical_order.h"

#include <algorithm>
#include <compare>
#include <numeric>
#include <tuple>

namespace overlapper {
namespace {

std::partial_ordering compare(Vec3 a, Vec3 b) { return std::tie(a.x, a.y, a.z) <=> std::tie(b.x, b.y, b.z); }

std::partial_ordering compare(const Sphere& a, const Sphere& b) { return a.radius <=> b.radius; }
std::partial_ordering compare(const Box& a, const Box& b) { return compare(a.half_extents, b.half_extents); }
std::partial_ordering compare(const Capsule& a, const Capsule& b) {
  return std::tie(a.radius, a.length) <=> std::tie(b.radius, b.length);
}
std::partial_ordering compare(const Cylinder& a, const Cylinder& b) {
  return std::tie(a.radius, a.length) <=> std::tie(b.radius, b.length);
}
std::partial_ordering compare(const Ellipsoid& a, const Ellipsoid& b) { return compare(a.half_axes, b.half_axes); }
std::partial_ordering compare(const HalfSpace& a, const HalfSpace& b) {
  const auto by_normal = compare(a.given_normal, b.given_normal);
  return by_normal != 0 ? by_normal : a.given_offset <=> b.given_offset;
}
std::partial_ordering compare(const Hull& a, const Hull& b) {
  if (a.data == b.data) return std::partial_ordering::equivalent;
  if (const auto by_volume = a.data->volume <=> b.data->volume; by_volume != 0) return by_volume;
  if (const auto by_origin = compare(a.data->origin, b.data->origin); by_origin != 0) return by_origin;
  const auto &p = a.data->corners, &q = b.data->corners;
  const auto by_corners = std::lexicographical_compare_three_way(p.begin(), p.end(), q.begin(), q.end(),
                                                                 [](Vec3 u, Vec3 v) { return compare(u, v); });
  // Points inside leave no other trace than the order in which facets were found.
  return by_corners != 0 ? by_corners : a.data->triangles <=> b.data->triangles;
}

std::partial_ordering compare(const RoundedHull& a, const RoundedHull& b) {
  const auto by_radius = a.radius <=> b.radius;
  return by_radius != 0 ? by_radius : compare(a.core, b.core);
}

std::partial_ordering compare(const Placed& a, const Placed& b) {
  if (a.shape.index() != b.shape.index())
    return a.shape.index() < b.shape.index() ? std::partial_ordering::less : std::partial_ordering::greater;
  const auto by_shape = std::visit(
      [&](const auto& shape) { return compare(shape, std::get<std::decay_t<decltype(shape)>>(b.shape)); }, a.shape);
  if (by_shape != 0) return by_shape;
  if (const auto by_position = compare(a.position, b.position); by_position != 0) return by_position;
  const Quaternion &p = a.orientation, &q = b.orientation;
  return std::tie(p.x, p.y, p.z, p.w) <=> std::tie(q.x, q.y, q.z, q.w);
}

}  // namespace

bool comes_before(const Placed& a, const Placed& b) { return compare(a, b) < 0; }

std::vector<int> canonical_order(std::span<const Placed> bodies) {
  if (bodies.size() == 2) {  // a sort would ask for memory first
    const int first = comes_before(bodies[1], bodies[0]) ? 1 : 0;
    return {first, 1 - first};
  }
  std::vector<int> order(bodies.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int i, int j) { return comes_before(bodies[i], bodies[j]); });
  return order;
}

}  // namespace overlapper
