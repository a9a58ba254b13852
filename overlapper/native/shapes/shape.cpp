#include "shapes/shape.h"

#include "geometry/wide_pose.h"
#include "shapes/limits.h"
#include "shapes/planes_asked.h"

namespace overlapper {

void append_box(Vec3 half_extents, std::vector<Plane>& planes) {
  for (int i = 0; i < 3; ++i)
    for (double s : {-1.0, 1.0}) planes.push_back({s * tangents::axis(i), half_extents[i]});
}

Placed make_placed(Shape shape, Vec3 position, Quaternion orientation) {
  Placed placed{std::move(shape), {}, {}, {}};
  placed.move_to(position, orientation);
  return placed;
}

void Placed::move_to(Vec3 new_position, Quaternion q) {
  require(finite(new_position), "position must be finite");
  require(max_component(abs(new_position)) < kLargest, "position must be closer to the origin than 1e25 m");
  require(std::isfinite(q.x) && std::isfinite(q.y) && std::isfinite(q.z) && std::isfinite(q.w),
          "orientation must be finite");
  require(!unturned(q) || q.w != 0, "orientation must not be the zero quaternion");
  position = new_position;
  orientation = q;
  pose = {rotation_matrix(q), new_position};
  const HullData* hull = polytope_of(shape);
  if (!hull || hull->origin == Vec3{}) return;
  // The pose of a hull with a far origin may bring it back: the two translations nearly cancel.
  pose.translation = rounded(wide_rotation(q) * wide(hull->origin) + wide(new_position));
}

Vec3 Placed::support(Vec3 direction) const {
  const Vec3 local = apply_transposed(pose.rotation, direction);
  return pose * ask(shape, [&](const auto& s) { return s.support(local); });
}

Vec3 Placed::core_support(Vec3 direction) const {
  return ask(shape, [&](const auto& s) { return s.core_support(pose, direction); });
}

Plane Placed::ray_exit(Vec3 origin, Vec3 direction) const {
  ++planes_asked;
  const Vec3 from = apply_transposed(pose.rotation, origin - pose.translation);
  const Vec3 along = apply_transposed(pose.rotation, direction);
  return pose * ask(shape, [&](const auto& s) { return s.ray_exit(from, along); });
}

Plane Placed::tightest(Vec3 point) const {
  ++planes_asked;
  const Vec3 local = apply_transposed(pose.rotation, point - pose.translation);
  return pose * ask(shape, [&](const auto& s) { return s.tightest(local); });
}

Placed Placed::seen_from(Vec3 reference) const {
  Placed seen = *this;
  seen.pose.translation -= reference;
  return seen;
}

Bounds bounds(const Placed& placed) {
  return ask(placed.shape, [&](const auto& s) { return s.bounds(placed.pose); });
}

bool polyhedral(std::span<const Placed> bodies) {
  return std::ranges::none_of(bodies, [](const Placed& body) { return smooth(body.shape); });
}

Hull inscribed(const Shape& shape, double tolerance) {
  return ask(shape, [&](const auto& s) -> Hull {
    if constexpr (std::decay_t<decltype(s)>::kBounded) return s.inscribed(tolerance);
    else throw std::invalid_argument("a half-space is unbounded and has no vertices");
  });
}

double flatness(const Shape& shape) {
  const HullData* hull = polytope_of(shape);
  return hull ? hull->flatness : 0;
}

double reach(const Placed& body, double extent) {
  const HullData* hull = polytope_of(body.shape);
  if (!hull || norm2(hull->origin) == 0) return extent;
  const bool moved = !unturned(body.orientation) || norm2(body.position) > 0;
  return moved ? extent + (norm(hull->origin) + norm(body.position)) : extent;
}

}  // namespace overlapper
