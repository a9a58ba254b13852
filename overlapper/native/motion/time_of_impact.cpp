#include "motion/time_of_impact.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "distance/gjk.h"
#include "distance/penetration.h"
#include "overlap/overlap.h"

namespace overlapper {
namespace {

/// More steps than any pair needs that comes closer steadily.
constexpr int kMostPoses = 400;

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

class Motion {
 public:
  Motion(const Placed& a, const Placed& b, const Velocity& of_a, const Velocity& of_b, double duration, double width)
      : pair_(a, b, of_a, of_b, duration), from_(b.position), drift_(of_b.linear), duration_(duration), width_(width) {}

  Impact find() {
    impact_.distance = kNever;
    double t = before_spheres();
    if (!(t < duration_)) {
      const double speed2 = norm2(pair_.velocity);
      place(speed2 > 0 ? std::clamp(-dot(pair_.between, pair_.velocity) / speed2, 0.0, duration_) : 0);
      return done(Meeting::kSeparated, duration_, duration_);
    }
    Distance nearest = place(t);
    while (impact_.steps < kMostPoses) {
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
    const double far = (a.reach + a.radius + b.reach + b.radius) * kRoundedUp + pair_.lost;
    const double speed2 = norm2(pair_.velocity), closing = -dot(pair_.between, pair_.velocity);
    const auto outside = [&](double t) { return norm(pair_.apart(t)) > far * kRoundedUp; };
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

  MovingPair pair_;
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
