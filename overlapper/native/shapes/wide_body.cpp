#include "shapes/wide_body.h"

#include <limits>

#include "shapes/planes_asked.h"

namespace overlapper {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

double sign(DoubleDouble x) { return x.head < 0 ? -1 : 1; }

WideVector axis(int i) { return {{i == 0 ? 1.0 : 0.0}, {i == 1 ? 1.0 : 0.0}, {i == 2 ? 1.0 : 0.0}}; }

DoubleDouble component(const WideVector& v, int i) { return i == 0 ? v.x : i == 1 ? v.y : v.z; }

WidePlane tangent(const WideVector& outward, const WideVector& centre, double radius, const WideVector& otherwise) {
  const WideVector direction = norm(outward).head > 0 ? unit(outward) : otherwise;
  return {direction, dot(direction, centre) + DoubleDouble{radius}};
}

WideVector across(const WideVector& v) { return {v.x, v.y, {}}; }

/// Where the ray from q, inside, leaves the ball (or disc, for vectors without a third component) about the origin.
WideVector leave_ball(const WideVector& q, const WideVector& d, double radius) {
  const DoubleDouble length = norm(q), r{radius}, dd = dot(d, d), qd = dot(q, d);
  DoubleDouble inside = (r - length) * (r + length);
  if (inside.head < 0) inside = {};
  const DoubleDouble root = sqrt(qd * qd + dd * inside);
  const DoubleDouble t = qd.head > 0 ? inside / (qd + root) : (root - qd) / dd;
  return q + t * d;
}

/// The same from a point that may be outside, for the far one of two crossings.
WideVector leave_cap(const WideVector& q, const WideVector& d, double radius) {
  const WideVector across = cross(q, d);
  const DoubleDouble dd = dot(d, d);
  DoubleDouble square = dd * two_product(radius, radius) - dot(across, across);
  if (square.head < 0) square = {};
  return q + ((sqrt(square) - dot(q, d)) / dd) * d;
}

WidePlane ray_exit(const Sphere& s, const WideVector& origin, const WideVector& d) {
  return tangent(leave_ball(origin, d, s.radius), {}, s.radius, axis(2));
}

WidePlane ray_exit(const Capsule& c, const WideVector& origin, const WideVector& d) {
  const double half = c.length / 2;
  DoubleDouble past = d.z;
  if (norm(across(d)).head > 0) {
    const DoubleDouble t_length = norm(across(d));
    const WideVector side = leave_ball(across(origin), across(d), c.radius);
    const DoubleDouble t = dot(side - across(origin), across(d)) / (t_length * t_length);
    const DoubleDouble z = origin.z + t * d.z;
    if (!(abs(z) > DoubleDouble{half})) return tangent(across(side), {}, c.radius, axis(0));
    past = z;
  }
  const WideVector end{{}, {}, {sign(past) * half}};
  WideVector outward = leave_cap(origin - end, d, c.radius);
  if (outward.z.head * end.z.head < 0) outward.z = {};
  return tangent(outward, end, c.radius, axis(2));
}

WidePlane ray_exit(const Cylinder& c, const WideVector& origin, const WideVector& d) {
  const double half = c.length / 2;
  const WidePlane cap{DoubleDouble{sign(d.z)} * axis(2), {half}};
  const DoubleDouble length = norm(across(d));
  if (!(length.head > 0)) return cap;
  const WideVector side = leave_ball(across(origin), across(d), c.radius);
  const DoubleDouble t = dot(side - across(origin), across(d)) / (length * length);
  if (abs(origin.z + t * d.z) > DoubleDouble{half}) return cap;
  return tangent(side, {}, c.radius, axis(0));
}

WideVector scaled(Vec3 by, const WideVector& v) {
  return {DoubleDouble{by.x} * v.x, DoubleDouble{by.y} * v.y, DoubleDouble{by.z} * v.z};
}
WideVector divided(const WideVector& v, Vec3 by) {
  return {v.x / DoubleDouble{by.x}, v.y / DoubleDouble{by.y}, v.z / DoubleDouble{by.z}};
}

WidePlane supporting(const Ellipsoid& e, const WideVector& outward) {
  const WideVector normal = unit(outward);
  return {normal, norm(scaled(e.half_axes, normal))};
}

WidePlane ray_exit(const Ellipsoid& e, const WideVector& origin, const WideVector& d) {
  const WideVector on_ball = leave_ball(divided(origin, e.half_axes), unit(divided(d, e.half_axes)), 1);
  return supporting(e, divided(on_ball, e.half_axes));
}

/// By the normal that doubles find: where the slack is least, a normal that is off changes it to second order.
WidePlane tightest(const Ellipsoid& e, const WideVector& p) { return supporting(e, wide(e.ways_out(rounded(p))[0])); }

WidePlane tightest(const Sphere& s, const WideVector& p) { return tangent(p, {}, s.radius, axis(2)); }

WidePlane tightest(const Box& b, const WideVector& p) {
  int nearest = 0;
  DoubleDouble least{-kInfinity};
  for (int i = 0; i < 3; ++i) {
    const DoubleDouble outside = abs(component(p, i)) - DoubleDouble{b.half_extents[i]};
    if (outside > least) least = outside, nearest = i;
  }
  return {DoubleDouble{sign(component(p, nearest))} * axis(nearest), {b.half_extents[nearest]}};
}

WidePlane tightest(const Capsule& c, const WideVector& p) {
  const DoubleDouble half{c.length / 2};
  const DoubleDouble z = p.z > half ? half : p.z < -half ? -half : p.z;
  const WideVector core{{}, {}, z};
  return tangent(p - core, core, c.radius, axis(0));
}

WidePlane tightest(const Cylinder& c, const WideVector& p) {
  const DoubleDouble past_cap = abs(p.z) - DoubleDouble{c.length / 2},
                     past_side = norm(across(p)) - DoubleDouble{c.radius};
  if (!(past_cap < past_side)) return {DoubleDouble{sign(p.z)} * axis(2), {c.length / 2}};
  return tangent(across(p), {}, c.radius, axis(0));
}

}  // namespace

WideBody::WideBody(const Placed& body, const WideVector& about)
    : shape(body.shape), rotation_(wide_rotation(body.orientation)), translation_(wide(body.position) - about) {
  const HullData* hull = polytope_of(shape);
  reach_ = norm(rounded(translation_)) + radius(shape) + (hull ? norm(hull->origin) : 0);
  if (!hull) return;
  translation_ = translation_ + rotation_ * wide(hull->origin);
  for (const auto& [i, j, k] : hull->triangles) {
    const Vec3 a = hull->corners[i], b = hull->corners[j], c = hull->corners[k];
    // An ulp of each corner's difference and product, as in orientation().
    const Vec3 normal = cross(b - a, c - a);
    const double length = norm(normal);
    const double doubt = length > 0 ? 16 * 0x1p-53 * (1 + norm(b - a) * norm(c - a) / length) : kInfinity;
    glances_.push_back({a, length > 0 ? normal / length : Vec3{}, doubt});
  }
}

WideVector WideBody::local(const WideVector& point) const { return apply_transposed(rotation_, point - translation_); }

WidePlane WideBody::in_world(const WidePlane& plane) const {
  const WideVector normal = rotation_ * plane.normal;
  return {normal, plane.offset + dot(normal, translation_)};
}

WidePlane WideBody::triangle_plane(int triangle) const {
  const HullData& hull = *polytope_of(shape);
  const auto& [a, b, c] = hull.triangles[triangle];
  const WideVector normal = unit(wide_normal(hull.corners[a], hull.corners[b], hull.corners[c]));
  return {normal, dot(normal, wide(hull.corners[a])) + DoubleDouble{core_radius(shape)}};
}

WidePlane WideBody::tightest_triangle(const WideVector& point) const {
  const Vec3 p = rounded(point);
  const auto seen = [&](const Glance& g, double& error) {
    const Vec3 away = p - g.corner;
    error = g.doubt * norm(away) + 4 * 0x1p-53 * (norm(p) + norm(g.corner));
    return dot(g.normal, away);
  };
  double surely = -kInfinity, error = 0;
  for (const Glance& g : glances_) surely = std::max(surely, seen(g, error) - error);
  WidePlane nearest{};
  DoubleDouble least{-kInfinity};
  for (int t = 0; t < static_cast<int>(glances_.size()); ++t) {
    const double outside = seen(glances_[t], error);
    if (outside + error < surely) continue;
    const WidePlane plane = triangle_plane(t);
    const DoubleDouble distance = signed_distance(plane, point);
    if (distance > least) least = distance, nearest = plane;
  }
  return nearest;
}

WidePlane WideBody::tightest(const WideVector& point) const {
  ++planes_asked;
  if (const HalfSpace* half = std::get_if<HalfSpace>(&shape)) {
    const WideVector given = wide(half->given_normal);
    const DoubleDouble length = norm(given);
    return in_world({unit(given), DoubleDouble{half->given_offset} / length});
  }
  const WideVector p = local(point);
  if (std::holds_alternative<Hull>(shape)) return in_world(tightest_triangle(p));
  if (const RoundedHull* hull = std::get_if<RoundedHull>(&shape))
    return in_world(supporting(hull->tightest(rounded(p)).normal));
  const auto of_simple = [&](const auto& simple) -> WidePlane {
    if constexpr (requires { overlapper::tightest(simple, p); }) return overlapper::tightest(simple, p);
    return {};
  };
  return in_world(std::visit(of_simple, shape));
}

WidePlane WideBody::supporting(Vec3 outward) const {
  const WideVector normal = unit(wide(outward));
  return {normal, dot(normal, farthest_corner(normal)) + DoubleDouble{core_radius(shape)}};
}

WidePlane WideBody::ray_exit(const WideVector& origin, const WideVector& direction) const {
  ++planes_asked;
  const WideVector o = local(origin), d = apply_transposed(rotation_, direction);
  if (const RoundedHull* hull = std::get_if<RoundedHull>(&shape))
    return in_world(supporting(hull->ray_exit(rounded(o), rounded(d)).normal));
  if (const Sphere* sphere = std::get_if<Sphere>(&shape)) return in_world(overlapper::ray_exit(*sphere, o, d));
  if (const Capsule* capsule = std::get_if<Capsule>(&shape)) return in_world(overlapper::ray_exit(*capsule, o, d));
  if (const Ellipsoid* ellipsoid = std::get_if<Ellipsoid>(&shape))
    return in_world(overlapper::ray_exit(*ellipsoid, o, d));
  return in_world(overlapper::ray_exit(std::get<Cylinder>(shape), o, d));
}

WideVector WideBody::farthest_corner(const WideVector& direction) const {
  const std::vector<Vec3>& corners = polytope_of(shape)->corners;
  const Vec3 d = rounded(direction);
  double surely = -kInfinity;
  const auto error = [&](Vec3 corner) { return 8 * 0x1p-53 * dot(abs(d), abs(corner)); };
  for (Vec3 corner : corners) surely = std::max(surely, dot(d, corner) - error(corner));
  Vec3 farthest;
  DoubleDouble largest{-kInfinity};
  for (Vec3 corner : corners) {
    if (dot(d, corner) + error(corner) < surely) continue;
    const DoubleDouble value = dot(direction, wide(corner));
    if (value > largest) largest = value, farthest = corner;
  }
  return wide(farthest);
}

WideVector WideBody::core_support(const WideVector& direction) const {
  const WideVector d = apply_transposed(rotation_, direction);
  struct Visitor {
    const WideBody& body;
    const WideVector& d;
    WideVector operator()(const Sphere&) const { return {}; }
    WideVector operator()(const Capsule& c) const { return {{}, {}, {sign(d.z) * c.length / 2}}; }
    WideVector operator()(const Box& b) const {
      return {{sign(d.x) * b.half_extents.x}, {sign(d.y) * b.half_extents.y}, {sign(d.z) * b.half_extents.z}};
    }
    WideVector operator()(const Cylinder& c) const {
      const WideVector radial = norm(across(d)).head > 0 ? unit(across(d)) : axis(0);
      return DoubleDouble{c.radius} * radial + WideVector{{}, {}, {sign(d.z) * c.length / 2}};
    }
    WideVector operator()(const Hull&) const { return body.farthest_corner(d); }
    WideVector operator()(const RoundedHull&) const { return body.farthest_corner(d); }
    WideVector operator()(const HalfSpace&) const { return {}; }
    WideVector operator()(const Ellipsoid& e) const {
      return e.ball() ? WideVector{} : scaled(e.half_axes, unit(scaled(e.half_axes, d)));
    }
  };
  return rotation_ * std::visit(Visitor{*this, d}, shape) + translation_;
}

WideVector WideBody::support(const WideVector& direction) const {
  return core_support(direction) + DoubleDouble{core_radius(shape)} * unit(direction);
}

void WideBody::append_planes(std::vector<WidePlane>& planes) const {
  if (polytope_of(shape)) {
    for (int t = 0; t < static_cast<int>(glances_.size()); ++t) planes.push_back(in_world(triangle_plane(t)));
  } else if (std::holds_alternative<HalfSpace>(shape)) {
    planes.push_back(tightest(WideVector{}));
  } else {
    for (int i = 0; i < 3; ++i) {
      for (double side : {-1.0, 1.0}) {
        const WideVector normal = rotation_ * (side * axis(i));
        planes.push_back({normal, dot(normal, support(normal))});
      }
    }
  }
}

}  // namespace overlapper
