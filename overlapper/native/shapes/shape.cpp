#include "shapes/shape.h"

#include <cassert>
#include <cfloat>
#include <limits>
#include <numbers>
#include <string>

#include "geometry/wide_pose.h"
#include "shapes/limits.h"
#include "shapes/planes_asked.h"

namespace overlapper {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

void require_size(double value, const char* name) {
  require(std::isfinite(value), std::string(name) + " must be finite");
  require(value > 0, std::string(name) + " must be greater than 0, not " + std::to_string(value));
  require(value > kSmallest && value < kLargest, std::string(name) + " must be between 1e-25 and 1e25 m");
}

double radial(Vec3 v) { return std::hypot(v.x, v.y); }

/// The smallest t >= 0 at which |q + t d|² = r², for q inside. The form without cancellation of the two usual ones.
double leave_disc(double qq, double qd, double dd, double r) {
  const double inside = std::max(0.0, r * r - qq);
  const double root = std::sqrt(qd * qd + dd * inside);
  return qd > 0 ? inside / (qd + root) : (root - qd) / dd;
}

Plane tangent(Vec3 outward, Vec3 centre, double radius) {
  const Vec3 normal = unit(outward);
  return {normal, dot(normal, centre) + radius};
}

double sign(double x) { return x < 0 ? -1 : 1; }

Vec3 axis(int i) { return {i == 0 ? 1.0 : 0.0, i == 1 ? 1.0 : 0.0, i == 2 ? 1.0 : 0.0}; }

}  // namespace

Plane Sphere::ray_exit(Vec3 origin, Vec3 direction) const {
  const double t = leave_disc(norm2(origin), dot(origin, direction), norm2(direction), radius);
  return tangent(origin + t * direction, {}, radius);
}

Plane Sphere::tightest(Vec3 point) const { return tangent(norm2(point) > 0 ? point : Vec3{0, 0, 1}, {}, radius); }

Vec3 Box::support(Vec3 d) const {
  return {std::copysign(half_extents.x, d.x), std::copysign(half_extents.y, d.y), std::copysign(half_extents.z, d.z)};
}

Plane Box::ray_exit(Vec3 origin, Vec3 direction) const {
  int first = 0;
  double soonest = kInfinity;
  for (int i = 0; i < 3; ++i) {
    if (direction[i] == 0) continue;
    const double t = (half_extents[i] - sign(direction[i]) * origin[i]) / std::abs(direction[i]);
    if (t < soonest) soonest = t, first = i;
  }
  return {sign(direction[first]) * axis(first), half_extents[first]};
}

Plane Box::tightest(Vec3 point) const {
  const Vec3 outside = abs(point) - half_extents;
  const int i = outside.x >= outside.y && outside.x >= outside.z ? 0 : outside.y >= outside.z ? 1 : 2;
  return {sign(point[i]) * axis(i), half_extents[i]};
}

Vec3 Capsule::support(Vec3 d) const { return Vec3{0, 0, sign(d.z) * length / 2} + radius * unit(d); }

Plane Capsule::ray_exit(Vec3 origin, Vec3 d) const {
  const double half = length / 2, dd = d.x * d.x + d.y * d.y;
  double past = d.z;
  if (dd > 0) {
    const double t = leave_disc(origin.x * origin.x + origin.y * origin.y, origin.x * d.x + origin.y * d.y, dd, radius);
    const Vec3 side = origin + t * d;
    if (std::abs(side.z) <= half) return tangent({side.x, side.y, 0}, {}, radius);
    past = side.z;
  }
  // The ray meets the infinite cylinder past one end, so it has left through the ball around that end.
  const Vec3 end{0, 0, sign(past) * half};
  const Vec3 q = origin - end;
  // Lagrange's identity: seen from afar, the difference of dot(q, d)² and |q|² |d|² would cancel.
  const double discriminant = std::max(0.0, norm2(d) * radius * radius - norm2(cross(q, d)));
  const double t = (std::sqrt(discriminant) - dot(q, d)) / norm2(d);
  Vec3 outward = q + t * d;
  // Where the end begins, rounding may have the ray leave just before it, and there that ball has tangents that cut off
  // the other end.
  if (outward.z * end.z < 0) outward.z = 0;
  return tangent(outward, end, radius);
}

Plane Capsule::tightest(Vec3 point) const {
  const Vec3 core{0, 0, std::clamp(point.z, -length / 2, length / 2)};
  const Vec3 outward = point - core;
  return tangent(norm2(outward) > 0 ? outward : Vec3{1, 0, 0}, core, radius);
}

Vec3 Cylinder::support(Vec3 d) const {
  const double r = radial(d);
  const double z = sign(d.z) * length / 2;
  return r > 0 ? Vec3{radius * d.x / r, radius * d.y / r, z} : Vec3{radius, 0, z};
}

Plane Cylinder::ray_exit(Vec3 origin, Vec3 d) const {
  const double half = length / 2, dd = d.x * d.x + d.y * d.y;
  const Plane cap{{0, 0, sign(d.z)}, half};
  if (dd == 0) return cap;
  const double t = leave_disc(origin.x * origin.x + origin.y * origin.y, origin.x * d.x + origin.y * d.y, dd, radius);
  const Vec3 side = origin + t * d;
  return std::abs(side.z) > half ? cap : tangent({side.x, side.y, 0}, {}, radius);
}

Plane Cylinder::tightest(Vec3 point) const {
  const double r = radial(point);
  if (std::abs(point.z) - length / 2 >= r - radius) return {{0, 0, sign(point.z)}, length / 2};
  return {r > 0 ? Vec3{point.x / r, point.y / r, 0} : Vec3{1, 0, 0}, radius};
}

Vec3 HalfSpace::support(Vec3 direction) const {
  const double along = dot(unit(direction), plane.normal);
  if (along > 0 && norm2(cross(unit(direction), plane.normal)) == 0) return plane.offset * plane.normal;
  return kInfinity * Vec3{sign(direction.x), sign(direction.y), sign(direction.z)};
}

Sphere make_sphere(double radius) {
  require_size(radius, "radius");
  return {radius};
}

Box make_box(Vec3 half_extents) {
  for (int i = 0; i < 3; ++i) require_size(half_extents[i], "half_extents");
  return {half_extents};
}

Capsule make_capsule(double radius, double length) {
  require_size(radius, "radius");
  require(std::isfinite(length), "length must be finite");
  require(length >= 0, "length must not be negative, it is " + std::to_string(length));
  require(length < kLargest, "length must be less than 1e25 m");
  return {radius, length};
}

Cylinder make_cylinder(double radius, double length) {
  require_size(radius, "radius");
  require_size(length, "length");
  return {radius, length};
}

Ellipsoid make_ellipsoid(Vec3 half_axes) {
  for (int i = 0; i < 3; ++i) require_size(half_axes[i], "half_axes");
  return {half_axes};
}

HalfSpace make_half_space(Vec3 normal, double offset) {
  require(finite(normal), "normal must be finite");
  require(std::isfinite(offset), "offset must be finite");
  const double length = norm(normal);
  require(length > 0, "normal must not be zero");
  require(length > kSmallest && length < kLargest, "normal must be of a length between 1e-25 and 1e25");
  require(std::abs(offset) / length < kLargest, "offset must be closer to the origin than 1e25 m");
  // A normal that is unit but for its last bits stays as given, so that planes read back and built anew are the same.
  if (std::abs(length - 1) <= 2 * DBL_EPSILON) return {{normal, offset}, normal, offset};
  return {{normal / length, offset / length}, normal, offset};
}

double volume(const Shape& shape) {
  struct Visitor {
    double operator()(const Sphere& s) const { return 4.0 / 3.0 * std::numbers::pi * s.radius * s.radius * s.radius; }
    double operator()(const Box& b) const { return 8 * b.half_extents.x * b.half_extents.y * b.half_extents.z; }
    double operator()(const Capsule& c) const {
      return std::numbers::pi * c.radius * c.radius * (c.length + 4.0 / 3.0 * c.radius);
    }
    double operator()(const Cylinder& c) const { return std::numbers::pi * c.radius * c.radius * c.length; }
    double operator()(const Hull& h) const { return h.data->volume; }
    double operator()(const HalfSpace&) const { return kInfinity; }
    double operator()(const RoundedHull& h) const { return h.volume(); }
    double operator()(const Ellipsoid& e) const {
      return 4.0 / 3.0 * std::numbers::pi * e.half_axes.x * e.half_axes.y * e.half_axes.z;
    }
  };
  return std::visit(Visitor{}, shape);
}

Vec3 centroid(const Shape& shape) {
  if (const Hull* hull = std::get_if<Hull>(&shape)) return hull->data->centroid;
  if (const HalfSpace* half = std::get_if<HalfSpace>(&shape)) return half->plane.offset * half->plane.normal;
  if (const RoundedHull* hull = std::get_if<RoundedHull>(&shape)) return hull->centroid();
  return {};
}

bool bounded(const Shape& shape) { return !std::holds_alternative<HalfSpace>(shape); }

bool has_rims(const Shape& shape) { return std::holds_alternative<Cylinder>(shape); }

const Ellipsoid* stretched(const Shape& shape) {
  const Ellipsoid* ellipsoid = std::get_if<Ellipsoid>(&shape);
  return ellipsoid && !ellipsoid->ball() ? ellipsoid : nullptr;
}

bool has_curved_core(const Shape& shape) { return has_rims(shape) || stretched(shape); }

bool smooth(const Shape& shape) {
  return std::holds_alternative<Sphere>(shape) || std::holds_alternative<Capsule>(shape) ||
         std::holds_alternative<Cylinder>(shape) || std::holds_alternative<RoundedHull>(shape) ||
         std::holds_alternative<Ellipsoid>(shape);
}

void append_planes(const Shape& shape, std::vector<Plane>& planes) {
  const auto six = [&](Vec3 extent) {
    for (int i = 0; i < 3; ++i)
      for (double s : {-1.0, 1.0}) planes.push_back({s * axis(i), extent[i]});
  };
  struct Visitor {
    decltype(six)& box_of;
    std::vector<Plane>& out;
    void operator()(const Sphere& s) const { box_of({s.radius, s.radius, s.radius}); }
    void operator()(const Box& b) const { box_of(b.half_extents); }
    void operator()(const Capsule& c) const { box_of({c.radius, c.radius, c.radius + c.length / 2}); }
    void operator()(const Cylinder& c) const { box_of({c.radius, c.radius, c.length / 2}); }
    void operator()(const Hull& h) const { out.insert(out.end(), h.data->planes.begin(), h.data->planes.end()); }
    void operator()(const HalfSpace& h) const { out.push_back(h.plane); }
    void operator()(const RoundedHull& h) const {
      for (const Plane& plane : h.core.data->planes) out.push_back({plane.normal, plane.offset + h.radius});
    }
    void operator()(const Ellipsoid& e) const { box_of(e.half_axes); }
  };
  std::visit(Visitor{six, planes}, shape);
}

double core_radius(const Shape& shape) {
  if (const Sphere* sphere = std::get_if<Sphere>(&shape)) return sphere->radius;
  if (const Capsule* capsule = std::get_if<Capsule>(&shape)) return capsule->radius;
  if (const RoundedHull* hull = std::get_if<RoundedHull>(&shape)) return hull->radius;
  if (const Ellipsoid* ellipsoid = std::get_if<Ellipsoid>(&shape); ellipsoid && ellipsoid->ball())
    return ellipsoid->half_axes.x;
  return 0;
}

const HullData* polytope_of(const Shape& shape) {
  if (const Hull* hull = std::get_if<Hull>(&shape)) return hull->data.get();
  if (const RoundedHull* hull = std::get_if<RoundedHull>(&shape)) return hull->core.data.get();
  return nullptr;
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
  // A hull that is counted from far away may be brought back by its pose: the two nearly cancel.
  pose.translation = rounded(wide_rotation(q) * wide(hull->origin) + wide(new_position));
}

Vec3 Placed::support(Vec3 direction) const {
  const Vec3 local = apply_transposed(pose.rotation, direction);
  return pose * std::visit([&](const auto& s) { return s.support(local); }, shape);
}

Vec3 Placed::core_support(Vec3 direction) const {
  const Ellipsoid* ellipsoid = std::get_if<Ellipsoid>(&shape);
  if (std::holds_alternative<Sphere>(shape) || (ellipsoid && ellipsoid->ball())) return pose.translation;
  if (const Capsule* capsule = std::get_if<Capsule>(&shape)) {
    const Vec3 along = pose.rotation * Vec3{0, 0, capsule->length / 2};
    return pose.translation + (dot(along, direction) < 0 ? -along : along);
  }
  if (const RoundedHull* hull = std::get_if<RoundedHull>(&shape))
    return pose * hull->core.support(apply_transposed(pose.rotation, direction));
  return support(direction);
}

Plane Placed::ray_exit(Vec3 origin, Vec3 direction) const {
  ++planes_asked;
  const Vec3 from = apply_transposed(pose.rotation, origin - pose.translation);
  const Vec3 along = apply_transposed(pose.rotation, direction);
  return pose * std::visit([&](const auto& s) { return s.ray_exit(from, along); }, shape);
}

Plane Placed::tightest(Vec3 point) const {
  ++planes_asked;
  const Vec3 local = apply_transposed(pose.rotation, point - pose.translation);
  return pose * std::visit([&](const auto& s) { return s.tightest(local); }, shape);
}

Placed Placed::seen_from(Vec3 reference) const {
  Placed seen = *this;
  seen.pose.translation -= reference;
  return seen;
}

Bounds bounds(const Placed& placed) {
  if (const HalfSpace* half = std::get_if<HalfSpace>(&placed.shape)) {
    const Plane plane = placed.pose * half->plane;
    const Vec3 touch = plane.offset * plane.normal;
    const auto limit = [&](int i, double side) { return side * plane.normal[i] == 1 ? touch[i] : side * kInfinity; };
    return {{limit(0, -1), limit(1, -1), limit(2, -1)}, {limit(0, 1), limit(1, 1), limit(2, 1)}};
  }
  const auto reach = [&](int i, double side) { return placed.support(side * axis(i))[i]; };
  return {{reach(0, -1), reach(1, -1), reach(2, -1)}, {reach(0, 1), reach(1, 1), reach(2, 1)}};
}

double surface(const Bounds& box) {
  const Vec3 side = box.upper - box.lower;
  return 2 * (side.x * side.y + side.y * side.z + side.z * side.x);
}

bool polyhedral(std::span<const Placed> bodies) {
  return std::ranges::none_of(bodies, [](const Placed& body) { return smooth(body.shape); });
}

double radius(const Shape& shape) {
  if (const Box* box = std::get_if<Box>(&shape)) return norm(box->half_extents);
  if (const Hull* hull = std::get_if<Hull>(&shape)) return hull->data->radius;
  if (const HalfSpace* half = std::get_if<HalfSpace>(&shape)) return std::abs(half->plane.offset);
  const Bounds box = bounds(Placed{shape, {}, {}, {}});
  return norm(max(abs(box.lower), abs(box.upper)));
}

int facets(const Shape& shape) {
  if (const Hull* hull = std::get_if<Hull>(&shape)) return static_cast<int>(hull->data->planes.size());
  return std::holds_alternative<Box>(shape) ? 6 : 1;
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
