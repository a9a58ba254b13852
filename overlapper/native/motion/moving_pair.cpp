#include "motion/moving_pair.h"

#include <algorithm>
#include <cmath>

namespace overlapper {
namespace {

/// More values of one gap than the search for its zero needs.
constexpr int kMostValues = 48;

/// Radians by which a direction turns before the next one is chosen.
constexpr double kMostTurned = 2;

/// The rotation of a quaternion. Every entry is right to some units of the last place of 1.
Mat3 quick_rotation(Quaternion q) {
  const double s = 2 / (q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
  const Vec3 v{q.x, q.y, q.z}, u = s * v;
  const Vec3 x = u.x * v, y = u.y * v, w = q.w * u;
  const double zz = u.z * v.z;
  return {{1 - y.y - zz, x.y - w.z, x.z + w.y},
          {x.y + w.z, 1 - x.x - zz, y.z - w.x},
          {x.z - w.y, y.z + w.x, 1 - x.x - y.y}};
}

/// A direction that turns about a unit axis.
Vec3 turned(Vec3 direction, Vec3 axis, double angle) {
  if (angle == 0) return direction;
  const double sine = std::sin(angle), half = std::sin(angle / 2);
  const Vec3 across = cross(axis, direction);
  return direction + sine * across + (2 * half * half) * cross(axis, across);
}

}  // namespace

Mover::Mover(const Placed& placed, Vec3 angular)
    : body(make_placed(placed.shape, {}, {})),
      start(in_range(placed.orientation)),
      spin(angular),
      axis(unit(angular)),
      speed(norm(angular)),
      radius(core_radius(placed.shape)) {
  const HullData* hull = polytope_of(placed.shape);
  far_origin = hull && !(hull->origin == Vec3{});
  const Plane* plane = only_plane(placed.shape);
  reach = reach_axis = plane ? std::abs(plane->offset) : 0;
  Vec3 corner;
  if (!plane) {
    const auto most = [&](Vec3 along) {
      return std::max(dot(along, body.core_support(along)), -dot(along, body.core_support(-along)));
    };
    corner = kRoundedUp * Vec3{most({1, 0, 0}), most({0, 1, 0}), most({0, 0, 1})};
    reach = reach_axis = norm(corner) * kRoundedUp;
  }
  body.move_to({}, start);
  if (plane || !(speed > 0)) return;
  const Vec3 own = apply_transposed(body.pose.rotation, axis);
  reach_axis = 0;
  for (double y : {-1.0, 1.0})
    for (double z : {-1.0, 1.0}) reach_axis = std::max(reach_axis, norm(cross(own, scaled(corner, {1, y, z}))));
  reach_axis = std::min(reach, reach_axis * kRoundedUp + 0x1p-48 * reach);
}

void Mover::move_to(Vec3 position, double time) {
  if (speed == 0 && !far_origin) {
    body.position = body.pose.translation = position;
    return;
  }
  const double half = speed * time / 2, sine = std::sin(half), w = std::cos(half);
  const Vec3 v = sine * axis, u{start.x, start.y, start.z}, product = w * u + start.w * v + cross(v, u);
  const Quaternion q{product.x, product.y, product.z, w * start.w - dot(v, u)};
  if (far_origin) return body.move_to(position, q);
  body.position = body.pose.translation = position;
  body.orientation = q;
  body.pose.rotation = quick_rotation(q);
}

MovingPair::MovingPair(const Placed& of_a, const Placed& of_b, const Velocity& motion_a, const Velocity& motion_b,
                       double duration)
    : a(of_a, motion_a.angular),
      b(of_b, motion_b.angular),
      between(of_a.position - of_b.position),
      velocity(motion_a.linear - motion_b.linear) {
  // In units of half an ulp: 8 roundings of the relative position and 64 of dot products with it, and 64 of the
  // turned direction. A quaternion loses 4 |angle| + 32, its rotation 32, and the direction 64.
  lost = 136 * (norm(between) + duration * norm(velocity));
  for (const Mover* each : {&a, &b}) lost += (each->reach + each->radius) * (192 + 4 * each->speed * duration);
  lost *= 0x1p-53;
}

Drift MovingPair::drift(const Mover& body, const Mover& fixed, double time, double half) const {
  const double side = &body == &a ? 1 : -1, farthest = std::max(norm(apart(time - half)), norm(apart(time + half)));
  // The common points lie in both bodies.
  const double arm = bounded(body.body.shape) ? body.reach : farthest + fixed.reach + fixed.radius;
  const double bend = fixed.speed * (fixed.speed * farthest + 2 * norm(velocity));
  return {side * (velocity - cross(fixed.spin, apart(time))),
          (norm(body.spin - fixed.spin) * arm * half + bend * half * half / 2) * kRoundedUp};
}

double MovingPair::most_depth(double start, Vec3 normal_start, double end, Vec3 normal_end) {
  const double length = end - start;
  double least = -kNever;
  const auto look = [&](Vec3 normal, Vec3 turning, bool from_end) {
    Gap gap(*this, from_end ? end : start, from_end ? length : 0, from_end ? 0 : length, normal, turning);
    const double first = gap.value(from_end ? -length : 0), last = gap.value(from_end ? 0 : length);
    least = std::max(least, gap.least_between(first, last, length));
  };
  for (const Mover* each : {&a, &b}) {
    const Plane* plane = only_plane(each->body.shape);
    if (!plane) continue;
    move_to(start);
    const Vec3 normal = each->body.pose.rotation * plane->normal;
    look(each == &a ? -normal : normal, each->spin, false);
    return -least;
  }
  // The normals of both ends may be of one facet of a or b, or the normal may have turned from the first to the last.
  const Vec3 axis = cross(normal_start, normal_end);
  const double sine = norm(axis);
  if (sine > 0) look(normal_start, (std::atan2(sine, dot(normal_start, normal_end)) / (sine * length)) * axis, false);
  for (bool from_end : {false, true})
    for (Vec3 turning : {Vec3{}, a.spin, b.spin}) look(from_end ? normal_end : normal_start, turning, from_end);
  return -least;
}

Gap::Gap(MovingPair& pair, double start, double earlier, double rest, Vec3 normal, Vec3 turning)
    : pair_(pair), start_(start), normal_(normal), axis_(unit(turning)), rate_(norm(turning)) {
  const Mover &a = pair.a, &b = pair.b;
  const double normal_rate = norm(cross(turning, normal)), speed = norm(pair.velocity);
  limit_ = normal_rate * rest > kMostTurned ? kMostTurned / normal_rate : rest;
  const double apart = std::max(norm(pair.apart(start)), norm(pair.apart(start + limit_))) + speed * earlier;
  curvature_ = normal_rate * (2 * speed + rate_ * apart);
  steepest_ = normal_rate * apart + (normal_rate > 0 ? speed : std::abs(dot(normal, pair.velocity)));
  for (const Mover* each : {&a, &b}) {
    const Vec3 relative = each->spin - turning;
    const double beside = norm(normal_rate > 0 ? relative : cross(relative, normal));
    curvature_ += norm(relative) * normal_rate * each->reach + beside * each->speed * each->reach_axis;
    steepest_ += beside * each->reach;
  }
  curvature_ *= kRoundedUp, steepest_ *= kRoundedUp;
}

Vec3 Gap::direction(double after) const { return turned(normal_, axis_, rate_ * after); }

double Gap::value_here(double after) const {
  const Vec3 n = direction(after);
  return dot(n, pair_.apart(start_ + after)) - pair_.a.farthest(-n) - pair_.b.farthest(n) - pair_.a.radius -
         pair_.b.radius - pair_.lost;
}

double Gap::value(double after) {
  pair_.move_to(start_ + after);
  const double level = value_here(after);
  if (level < least_) least_ = level, least_after_ = after;
  return level;
}

bool Gap::open(double first, double last, double length) const {
  if (!(first > 0 && last > 0)) return false;
  return std::abs(first - last) >= curvature_ * length * length / 2 ||
         std::sqrt(first) + std::sqrt(last) >= length * std::sqrt(curvature_ / 2) * kRoundedUp ||
         first + last >= steepest_ * length;
}

double Gap::least_between(double first, double last, double length) const {
  const double slope = (last - first) / length, flat = (first + last - steepest_ * length) / 2;
  if (!(curvature_ > 0)) return std::min(first, last);
  const double lowest = std::clamp(length / 2 - slope / curvature_, 0.0, length);
  return std::max(flat, first + slope * lowest - curvature_ / 2 * lowest * (length - lowest)) - pair_.lost;
}

double Gap::open_until(double now, double width) {
  double low = 0, at_low = now, high = limit_, longest = kNever;
  // The Illinois method: the value at one end is halved if the other end has moved twice.
  double left = now, right = kNever;
  int moved = 0;  // -1: low, 1: high
  for (int k = 0; k < kMostValues; ++k) {
    double h = high;
    if (right < kNever) {
      if (high - low <= width / 4) break;
      h = low + (high - low) * std::clamp(left / (left + right), 0.001, 0.999);
      // Beyond the zero by a little, on the side that has not moved.
      h += moved > 0 ? -width / 16 : width / 16;
      if (!(h > low && h < high)) h = low + (high - low) / 2;
    }
    // The gap can hardly be open for more than twice the time that a gap of this size stays open.
    h = std::min({h, low + longest, low + 2 * std::max(std::sqrt(2 * at_low / curvature_), at_low / steepest_)});
    const double at = value(h);
    if (!(at > 0)) {
      if (moved > 0) left /= 2;
      moved = 1, high = h, right = -at, longest = kNever;
    } else if (open(at_low, at, h - low)) {
      if (h == limit_) return limit_;
      if (moved < 0 && right < kNever) right /= 2;
      moved = -1, low = h, at_low = left = at, longest = kNever;
    } else {
      longest = (h - low) / 2;
    }
  }
  return std::min(limit_, low + at_low / steepest_);
}

}  // namespace overlapper
