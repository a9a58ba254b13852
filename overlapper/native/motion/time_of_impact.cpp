#include "motion/time_of_impact.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "distance/gjk.h"
#include "distance/penetration.h"
#include "overlap/overlap.h"

namespace overlapper {
namespace {

/// More steps than any pair needs that comes closer steadily.
constexpr int kMostAdvances = 400;

/// More values of one gap than the search for its zero needs.
constexpr int kMostValues = 48;

/// Radians by which a direction turns before the next one is chosen.
constexpr double kMostTurned = 2;

/// Room for the rounding of factors that only have to be large enough.
constexpr double kEnough = 1 + 0x1p-40;

constexpr double kNever = std::numeric_limits<double>::infinity();

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

/// One body during the motion, in coordinates about the position of b.
struct Mover {
  Placed body;
  Quaternion start;
  Vec3 spin, axis;
  double speed;       ///< rad/s
  double radius;      ///< of the core
  double reach;       ///< m: bound of the distance of the core's points from the position
  double reach_axis;  ///< m: the same from the axis of the spin through the position
  bool far_origin;    ///< its pose needs wider arithmetic

  Mover(const Placed& placed, Vec3 angular)
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
      corner = kEnough * Vec3{most({1, 0, 0}), most({0, 1, 0}), most({0, 0, 1})};
      reach = reach_axis = norm(corner) * kEnough;
    }
    body.move_to({}, start);
    if (plane || !(speed > 0)) return;
    const Vec3 own = apply_transposed(body.pose.rotation, axis);
    reach_axis = 0;
    for (double y : {-1.0, 1.0})
      for (double z : {-1.0, 1.0}) reach_axis = std::max(reach_axis, norm(cross(own, scaled(corner, {1, y, z}))));
    reach_axis = std::min(reach, reach_axis * kEnough + 0x1p-48 * reach);
  }

  void move_to(Vec3 position, double time) {
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

  Vec3 local_support(Vec3 direction) const {
    return apply_transposed(body.pose.rotation, body.core_support(direction) - body.pose.translation);
  }

  /// The greatest dot product of a direction with a point of the core, relative to the position. A half-space has one
  /// in the direction of its normal only.
  double farthest(Vec3 direction) const {
    if (const Plane* plane = only_plane(body.shape)) return plane->offset;
    return dot(direction, body.core_support(direction) - body.position);
  }
};

/// The directions of the flat in which a body touches its supporting plane across the normal.
struct Flat {
  std::array<Vec3, 2> along;
  int size = 0;

  Flat(const Mover& mover, const LastSimplex& simplex, Vec3 DifferencePoint::* on, Vec3 normal) {
    if (core_kind(mover.body.shape) == CoreKind::kCurved) return;
    for (int i = 1; i < simplex.size && size < 2; ++i) {
      Vec3 edge = mover.body.pose.rotation * (simplex.corner[i].*on - simplex.corner[0].*on);
      const double length = norm(edge);
      if (size == 1) edge -= dot(edge, along[0]) * along[0];
      // Corners on the rim of a cylinder may be close to each other, and their directions are rounding.
      if (length > 1e-3 * mover.reach && norm(cross(edge, normal)) > 0.05 * length) along[size++] = unit(edge);
    }
  }
};

/// The motion of two bodies, with poses at any time.
struct Pair {
  Mover a, b;
  Vec3 between, velocity;  ///< of a relative to b
  double lost = 0;         ///< m: rounding of a gap

  Vec3 apart(double time) const { return between + time * velocity; }
  void move_to(double time) {
    b.move_to({}, time);
    a.move_to(apart(time), time);
  }
};

/// The gap between two bodies along a direction that turns at a constant rate, by the time from `start` on, or from
/// `earlier` seconds before it. The bodies are separated while this gap is positive.
///
/// Each pair of points of the cores has a distance along the direction, and the gap is the least of them. The second
/// derivative of each of these distances is at most `curvature`, the first derivative at most `steepest`. Between two
/// times, the gap is therefore at least the chord less curvature / 2 times both parts of the interval.
class Gap {
 public:
  Gap(Pair& pair, double start, double earlier, double rest, Vec3 normal, Vec3 turning)
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
    curvature_ *= kEnough, steepest_ *= kEnough;
  }

  Vec3 direction(double after) const { return turned(normal_, axis_, rate_ * after); }

  /// The gap less the rounding, for bodies at that time.
  double value_here(double after) const {
    const Vec3 n = direction(after);
    return dot(n, pair_.apart(start_ + after)) - pair_.a.farthest(-n) - pair_.b.farthest(n) - pair_.a.radius -
           pair_.b.radius - pair_.lost;
  }

  /// The same, and the bodies are moved to that time.
  double value(double after) {
    pair_.move_to(start_ + after);
    const double level = value_here(after);
    if (level < least_) least_ = level, least_after_ = after;
    return level;
  }

  /// True if the gap is positive during an interval of this length between two times with these gaps.
  bool open(double first, double last, double length) const {
    if (!(first > 0 && last > 0)) return false;
    return std::abs(first - last) >= curvature_ * length * length / 2 ||
           std::sqrt(first) + std::sqrt(last) >= length * std::sqrt(curvature_ / 2) * kEnough ||
           first + last >= steepest_ * length;
  }

  double limit() const { return limit_; }

  /// A time up to which the gap is open, near to its zero if there is one before `limit`. `now` is the gap at once.
  double open_until(double now, double width) {
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

  double least() const { return least_; }
  double least_time() const { return start_ + least_after_; }

 private:
  Pair& pair_;
  double start_;
  Vec3 normal_, axis_;
  double rate_, limit_ = 0, curvature_ = 0, steepest_ = 0;
  double least_ = kNever, least_after_ = 0;
};

class Motion {
 public:
  Motion(const Placed& a, const Placed& b, const Velocity& of_a, const Velocity& of_b, double duration, double width)
      : pair_{{a, of_a.angular}, {b, of_b.angular}, a.position - b.position, of_a.linear - of_b.linear},
        from_(b.position),
        drift_(of_b.linear),
        duration_(duration),
        width_(width) {
    const double start = norm(pair_.between), way = duration * norm(pair_.velocity);
    // In units of half an ulp: 8 roundings of the relative position and 64 of dot products with it, and 64 of the
    // turned direction. A quaternion loses 4 |angle| + 32, its rotation 32, and the direction 64.
    pair_.lost = 136 * (start + way);
    for (const Mover* each : {&pair_.a, &pair_.b})
      pair_.lost += (each->reach + each->radius) * (192 + 4 * each->speed * duration);
    pair_.lost *= 0x1p-53;
  }

  Impact find() {
    impact_.distance = kNever;
    double t = before_spheres();
    if (!(t < duration_)) {
      const double speed2 = norm2(pair_.velocity);
      place(speed2 > 0 ? std::clamp(-dot(pair_.between, pair_.velocity) / speed2, 0.0, duration_) : 0);
      return done(Meeting::kSeparated, duration_, duration_);
    }
    Distance nearest = place(t);
    while (impact_.steps < kMostAdvances) {
      if (!separated(nearest, t)) {
        if (met_after(t, nearest)) return impact_;
        continue;
      }
      Gap gap = gap_of(nearest, t);
      const double now = gap.value_here(0);
      if (!(now > 0)) {
        if (met_after(t, nearest)) return impact_;
        continue;
      }
      const double open = gap.open_until(now, width_);
      if (gap.least() < least_) least_ = gap.least(), least_time_ = gap.least_time();
      if (open >= duration_ - t) {
        if (least_ < impact_.distance) place(least_time_);
        return done(Meeting::kSeparated, duration_, duration_);
      }
      // Adding rounds.
      const double next = std::max(t, std::nextafter(t + open, 0.0)), end = std::min(duration_, next + width_);
      nearest = place(end);
      if (overlapping(nearest)) {
        impact_.normal = norm2(nearest.normal) > 0 ? nearest.normal : gap.direction(next - t);
        impact_.point = middle(nearest, end);
        return done(Meeting::kImpact, next, end);
      }
      if (open_between(nearest, next, end)) {
        t = end;
        continue;
      }
      nearest = place(next);
      // Near the rounding, steps become ever shorter.
      const bool stuck = next == t || (next - t < width_ / 16 && now < 64 * pair_.lost);
      t = next;
      if (stuck && separated(nearest, t) && met_after(t, nearest)) return impact_;
    }
    impact_.time = t;
    return done(Meeting::kOpen, t, duration_);
  }

 private:
  Impact done(Meeting status, double lower, double upper) {
    impact_.status = status, impact_.time = lower, impact_.time_upper = upper;
    return impact_;
  }

  /// The time at which the spheres around the bodies meet.
  double before_spheres() const {
    const Mover &a = pair_.a, &b = pair_.b;
    if (!bounded(a.body.shape) || !bounded(b.body.shape)) return 0;
    const double far = (a.reach + a.radius + b.reach + b.radius) * kEnough + pair_.lost;
    const double speed2 = norm2(pair_.velocity), closing = -dot(pair_.between, pair_.velocity);
    const auto outside = [&](double t) { return norm(pair_.apart(t)) > far * kEnough; };
    if (!outside(0)) return 0;
    if (!(closing > 0)) return duration_;
    const double nearest = closing / speed2;
    const double beside = norm(cross(pair_.between, pair_.velocity)) / std::sqrt(speed2);
    const double chord = beside < far ? std::sqrt((far - beside) * (far + beside) / speed2) : 0;
    // Before the nearest pass, the distance of the positions only decreases.
    const double met = std::min(duration_, (nearest - chord) * (1 - 1e-9) - 1e-9 * chord);
    return met > 0 && met < nearest && outside(met) ? met : beside > far * (1 + 1e-9) ? duration_ : 0;
  }

  Distance place(double t) {
    ++impact_.steps;
    pair_.move_to(t);
    Distance d = distance(pair_.a.body, pair_.b.body, last_);
    // Among nearly coplanar corners of earlier poses, a search may end too early.
    const bool proved =
        norm2(d.normal) > 0 ? d.distance - d.gap <= 1e-3 * std::abs(d.distance) + pair_.lost : d.overlap > pair_.lost;
    if (!proved && last_.size > 1) {
      last_.size = 0;
      d = distance(pair_.a.body, pair_.b.body, last_);
    }
    const double length = norm2(d.normal) > 0 ? std::max(0.0, d.distance) : 0;
    if (length < impact_.distance) impact_.distance = length, impact_.distance_time = t;
    return d;
  }

  Vec3 middle(const Distance& d, double t) const { return (d.witness_a + d.witness_b) / 2 + from_ + t * drift_; }

  /// True if there is a separating plane. Keeps it for the answer.
  bool separated(const Distance& d, double t) {
    if (!(norm2(d.normal) > 0)) return false;
    impact_.normal = d.normal, impact_.point = middle(d, t);
    return true;
  }

  /// True if the bodies certainly overlap at their present poses.
  bool overlapping(const Distance& d) const {
    if (norm2(d.normal) > 0) return d.distance < -pair_.lost;
    if (d.overlap > pair_.lost) return true;
    return enclosed_depth(pair_.a.body, pair_.b.body).lower > pair_.lost;
  }

  /// True if the plane of the end has been open all the time.
  bool open_between(const Distance& at_end, double start, double end) {
    if (!separated(at_end, end) || !(start < end)) return false;
    Gap gap = gap_of(at_end, end, end - start);
    const double last = gap.value_here(0);
    const bool open = last > 0 && gap.open(gap.value(start - end), last, end - start);
    pair_.move_to(end);
    return open;
  }

  /// The gap along the normal of the nearest points. The nearest points may be very close to each other. The search may
  /// also have ended before the last corner, which is farther along the normal. Then this normal is not accurate, and
  /// two edges or three corners of a facet give a better one.
  Gap gap_of(const Distance& d, double t, double earlier = 0) {
    const Gap gap = gap_along(d.normal, last_, d, t, earlier);
    const double now = gap.value_here(0);
    if (now >= 0.9 * d.distance - 2 * pair_.lost || last_.size == 0) return gap;
    LastSimplex more = last_;
    if (more.size < 4) more.corner[more.size++] = {pair_.a.local_support(-d.normal), pair_.b.local_support(d.normal)};
    const Flat on_a(pair_.a, more, &DifferencePoint::on_a, d.normal),
        on_b(pair_.b, more, &DifferencePoint::on_b, d.normal);
    Vec3 across;
    if (on_a.size == 2) across = cross(on_a.along[0], on_a.along[1]);
    else if (on_b.size == 2) across = cross(on_b.along[0], on_b.along[1]);
    else if (on_a.size == 1 && on_b.size == 1) across = cross(on_a.along[0], on_b.along[0]);
    if (!(norm2(across) > 1e-4)) return gap;
    const Gap better = gap_along(unit(dot(across, d.normal) < 0 ? -across : across), more, d, t, earlier);
    return better.value_here(0) > now ? better : gap;
  }

  Gap gap_along(Vec3 normal, const LastSimplex& simplex, const Distance& d, double t, double earlier) {
    return Gap(pair_, t, earlier, duration_ - t, normal, turning(d, t, normal, simplex));
  }

  /// A rate at which the normal of the nearest points turns. Any rate gives a gap that bounds the distance.
  Vec3 turning(const Distance& d, double t, Vec3 n, const LastSimplex& simplex) const {
    const Mover &a = pair_.a, &b = pair_.b;
    for (const Mover* each : {&a, &b})
      if (!bounded(each->body.shape)) return each->spin;
    const Flat on_a(a, simplex, &DifferencePoint::on_a, n), on_b(b, simplex, &DifferencePoint::on_b, n);
    if (on_a.size == 2) return a.spin;
    if (on_b.size == 2) return b.spin;
    // The normal stays orthogonal to edges. Across them, it follows the nearest points.
    const Vec3 closing = pair_.velocity + cross(a.spin, d.witness_a - pair_.apart(t)) - cross(b.spin, d.witness_b);
    const double apart = std::max(d.distance + a.radius + b.radius, 0.1 * (a.reach + b.reach));
    const Vec3 follows = (closing - dot(closing, n) * n) / apart;
    if (on_a.size + on_b.size == 0) return cross(n, follows);
    const Mover& first = on_a.size ? a : b;
    const Vec3 u = on_a.size ? on_a.along[0] : on_b.along[0], across = cross(n, u);
    const double along_u = dot(cross(first.spin, n), u);
    double along_across = dot(follows, across);
    if (on_a.size && on_b.size) {
      const Vec3 v = on_b.along[0];
      const double sine = dot(v, across), cosine = dot(v, u);
      if (std::abs(sine) > 0.05) along_across = (dot(cross(b.spin, n), v) - cosine * along_u) / sine;
    }
    return cross(n, along_u * u + along_across * across);
  }

  /// Looks on from a time at which the gap is within rounding. True if the answer is known. Otherwise the bodies are
  /// still separated at a later `t`.
  bool met_after(double& t, Distance& nearest) {
    impact_.time = t;
    for (double step = width_; t < duration_; step *= 2) {
      const double end = std::min(duration_, t + step);
      const Vec3 normal = impact_.normal, point = impact_.point;
      nearest = place(end);
      const bool inside = overlapping(nearest);
      if (!inside && open_between(nearest, t, end)) {
        t = end;
        return false;
      }
      impact_.normal = normal, impact_.point = point;
      if (inside) return finish(Meeting::kImpact, t, end);
      const bool apart = norm2(nearest.normal) > 0 && gap_of(nearest, end).value_here(0) > 3 * pair_.lost;
      if (apart || end == duration_) return finish(Meeting::kTouching, t, end);
    }
    return finish(Meeting::kTouching, t, duration_);
  }

  bool finish(Meeting status, double lower, double upper) {
    done(status, lower, upper);
    return true;
  }

  Pair pair_;
  Vec3 from_, drift_;
  double duration_, width_;
  double least_ = kNever, least_time_ = 0;
  LastSimplex last_;
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
