#include "motion/time_of_impact.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>

#include "distance/gjk.h"
#include "distance/penetration.h"
#include "overlap/overlap.h"

namespace overlapper {
namespace {

/// More steps than any pair needs that comes closer steadily.
constexpr int kMostSteps = 400;

/// Room for the rounding of factors that only have to be large enough.
constexpr double kEnough = 1 + 0x1p-40;

/// One body during the motion, in coordinates about the position of b.
struct Mover {
  Placed body;
  Quaternion start;
  Vec3 spin, axis;
  double speed;       ///< rad/s
  double radius;      ///< of the core
  double reach;       ///< m: bound of the distance of the core's points from the position
  double reach_axis;  ///< m: the same from the axis of the spin through the position

  Mover(const Placed& placed, Vec3 angular)
      : body(make_placed(placed.shape, {}, {})),
        start(in_range(placed.orientation)),
        spin(angular),
        axis(unit(angular)),
        speed(norm(angular)),
        radius(core_radius(placed.shape)) {
    if (const Plane* plane = only_plane(placed.shape)) {
      reach = reach_axis = std::abs(plane->offset);
      return;
    }
    const auto most = [&](Vec3 along) {
      return std::max(dot(along, body.core_support(along)), -dot(along, body.core_support(-along)));
    };
    const Vec3 corner = kEnough * Vec3{most({1, 0, 0}), most({0, 1, 0}), most({0, 0, 1})};
    reach = norm(corner) * kEnough;
    reach_axis = reach;
    if (!(speed > 0)) return;
    body.move_to({}, start);
    const Vec3 own = apply_transposed(body.pose.rotation, axis);
    reach_axis = 0;
    for (double y : {-1.0, 1.0})
      for (double z : {-1.0, 1.0}) reach_axis = std::max(reach_axis, norm(cross(own, scaled(corner, {1, y, z}))));
    reach_axis = std::min(reach, reach_axis * kEnough + 0x1p-48 * reach);
  }

  void move_to(Vec3 position, double time) {
    const double half = speed * time / 2, sine = std::sin(half), w = std::cos(half);
    const Vec3 v = sine * axis, u{start.x, start.y, start.z}, product = w * u + start.w * v + cross(v, u);
    body.move_to(position, {product.x, product.y, product.z, w * start.w - dot(v, u)});
  }

  /// The greatest dot product of a direction with a point of the core, relative to the position. A half-space has one
  /// in the direction of its normal only.
  double farthest(Vec3 direction) const {
    if (const Plane* plane = only_plane(body.shape)) return plane->offset;
    return dot(direction, body.core_support(direction) - body.position);
  }
};

/// The gap between two bodies along a direction that turns with `turning`, as a lower bound by the time from now.
///
/// Each pair of points of the cores has a distance along the direction. Its first derivative is linear in the points.
/// Its second derivative is at most `curvature`. The bound is the least of these parabolas, so it is concave. A concave
/// function that is positive at two times is positive between them.
struct Gap {
  const Mover &a, &b;
  Vec3 normal, turn_a, turn_b;
  double level, slope, curvature, radii, steepest;

  Gap(const Mover& body_a, const Mover& body_b, Vec3 from_b_to_a, Vec3 velocity, double farthest_apart)
      : a(body_a), b(body_b), normal(from_b_to_a), radii(body_a.radius + body_b.radius) {
    Vec3 turning;
    for (const Mover* each : {&a, &b})
      if (!bounded(each->body.shape)) turning = each->spin;
    const Vec3 between = a.body.position - b.body.position;
    level = dot(normal, between);
    slope = dot(cross(turning, normal), between) + dot(normal, velocity);
    turn_a = cross(normal, a.spin - turning);
    turn_b = cross(normal, b.spin - turning);
    const double turned = norm(turning), speed = norm(velocity);
    curvature = turned * turned * farthest_apart + 2 * turned * speed;
    for (const Mover* each : {&a, &b}) {
      if (!bounded(each->body.shape)) continue;
      const double both = each->speed + turned;
      curvature += both * both * (turned > 0 ? each->reach : each->reach_axis);
    }
    curvature *= kEnough;
    steepest = turned > 0 ? turned * farthest_apart + speed : -dot(normal, velocity);
    if (bounded(a.body.shape)) steepest += norm(turn_a) * a.reach;
    if (bounded(b.body.shape)) steepest += norm(turn_b) * b.reach;
  }

  double after(double h) const {
    return level + h * slope - a.farthest(-(normal + h * turn_a)) - b.farthest(normal + h * turn_b) - radii -
           curvature * h * h / 2;
  }

  /// A time, of at most `most`, up to which the gap is at least `lost`. `now` is the gap after no time.
  double open_until(double now, double lost, double most, double width) const {
    double high = most, at_high = after(high) - lost;
    if (at_high >= 0) return most;
    double low = 0, at_low = now - lost;
    const auto use = [&](double h) {
      const double at = after(h) - lost;
      if (at >= 0 && h >= low) low = h, at_low = at;
      else if (at < 0 && h < high) high = h, at_high = at;
    };
    for (int round = 0; round < 12 && high - low > std::max(width / 16, 1e-3 * low); ++round) {
      const double before = low, at_before = at_low;
      use(low + (high - low) * (at_low / (at_low - at_high)));
      // The line through two times before the zero meets the axis after the zero of a concave function.
      if (low > before && at_low < at_before) {
        const double beyond = low + at_low * (low - before) / (at_before - at_low);
        if (beyond < high) use(beyond);
      }
      use(low + (high - low) / 2);
    }
    const double steady = steepest > 0 ? (now - lost) / (steepest * kEnough) : most;
    return std::min(most, std::max(low, steady));
  }
};

class Motion {
 public:
  Motion(const Placed& a, const Placed& b, const Velocity& of_a, const Velocity& of_b, double duration, double width)
      : a_(a, of_a.angular),
        b_(b, of_b.angular),
        between_(a.position - b.position),
        velocity_(of_a.linear - of_b.linear),
        from_(b.position),
        drift_(of_b.linear),
        duration_(duration),
        width_(width) {
    const double start = norm(between_), way = duration * norm(velocity_);
    farthest_apart_ = std::max(start, norm(between_ + duration * velocity_)) * kEnough;
    // In units of half an ulp: 8 roundings of the relative position and 64 of dot products with it. A quaternion loses
    // 4 |angle| + 32, and the turned direction of a bound loses 64 (1 + |angle|).
    lost_ = 72 * (start + way);
    for (const Mover* each : {&a_, &b_}) lost_ += (each->reach + each->radius) * (96 + 68 * each->speed * duration);
    lost_ *= 0x1p-53;
  }

  Impact find() {
    impact_.distance = std::numeric_limits<double>::infinity();
    double t = 0;
    while (impact_.steps < kMostSteps) {
      const std::optional<Gap> gap = separated_at(t);
      impact_.time = t;
      if (!gap) return met_after(t);
      const double step = gap->open_until(now_, lost_, duration_ - t, width_);
      if (step >= duration_ - t) return done(Meeting::kSeparated, duration_, duration_);
      // Adding rounds.
      const double next = std::nextafter(t + step, 0.0);
      const double end = std::min(duration_, t + width_);
      if (next < end && step < width_ && overlap_at(end)) return done(Meeting::kImpact, std::max(t, next), end);
      if (!(next > t)) return met_after(t);
      t = next;
    }
    impact_.time = t;
    return done(Meeting::kOpen, t, duration_);
  }

 private:
  Impact done(Meeting status, double lower, double upper) {
    impact_.status = status, impact_.time = lower, impact_.time_upper = upper;
    return impact_;
  }

  Distance place(double t) {
    ++impact_.steps;
    b_.move_to({}, t);
    a_.move_to(between_ + t * velocity_, t);
    const Distance d = distance(a_.body, b_.body);
    const double length = norm2(d.normal) > 0 ? std::max(0.0, d.distance) : 0;
    if (length < impact_.distance) impact_.distance = length, impact_.distance_time = t;
    return d;
  }

  /// The gap at a time, if it is larger than the rounding.
  std::optional<Gap> separated_at(double t) {
    const Distance d = place(t);
    if (!(norm2(d.normal) > 0)) return std::nullopt;
    const Gap gap(a_, b_, d.normal, velocity_, farthest_apart_);
    now_ = gap.after(0);
    impact_.normal = d.normal;
    impact_.point = (d.witness_a + d.witness_b) / 2 + from_ + t * drift_;
    if (!(now_ > lost_)) return std::nullopt;
    return gap;
  }

  /// True if the bodies certainly overlap.
  bool overlap_at(double t) {
    const Distance d = place(t);
    if (norm2(d.normal) > 0) return d.distance < -lost_;
    if (d.overlap > lost_) return true;
    return enclosed_depth(a_.body, b_.body).lower > lost_;
  }

  /// The answer if the gap is within rounding at `t`: the first time that is certain again.
  Impact met_after(double t) {
    for (double step = width_; t < duration_; step *= 2) {
      const double end = std::min(duration_, t + step);
      if (overlap_at(end)) return done(Meeting::kImpact, t, end);
      const Vec3 normal = impact_.normal, point = impact_.point;
      const bool apart = separated_at(end).has_value() && now_ > 4 * lost_;
      impact_.normal = normal, impact_.point = point;
      if (apart || end == duration_) return done(Meeting::kTouching, t, end);
    }
    return done(Meeting::kTouching, t, duration_);
  }

  Mover a_, b_;
  Vec3 between_, velocity_, from_, drift_;
  double duration_, width_, farthest_apart_, lost_, now_ = 0;
  Impact impact_;
};

}  // namespace

Impact time_of_impact(const Placed& a, const Placed& b, const Velocity& of_a, const Velocity& of_b, double duration,
                      double width) {
  if (!bounded(a.shape) && !bounded(b.shape)) throw std::invalid_argument("a and b must not both be half-spaces");
  Motion motion(a, b, of_a, of_b, duration, width);
  Impact impact = motion.find();
  if (impact.time > 0 || impact.status == Meeting::kSeparated) return impact;
  // Doubles do not separate the pair at the start. Wider arithmetic tells the status then.
  const Overlap start(a, b, 1e-3, Method::kAuto);
  if (start.status() == Status::kSeparated) return impact;
  const Contact& contact = start.contact();
  impact.status = start.status() == Status::kOverlapping ? Meeting::kOverlapping : Meeting::kTouching;
  impact.time_upper = 0, impact.distance = 0, impact.distance_time = 0;
  impact.normal = contact.normal;
  if (impact.status == Meeting::kTouching) impact.point = (contact.witness_a + contact.witness_b) / 2;
  else impact.point = start.centroid();
  return impact;
}

}  // namespace overlapper
