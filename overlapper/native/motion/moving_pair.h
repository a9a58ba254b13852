#pragma once

#include <limits>

#include "shapes/shape.h"

namespace overlapper {

/// The time or the distance of what never meets.
inline constexpr double kNever = std::numeric_limits<double>::infinity();

/// The position moves along a line. The body turns about its position. Both velocities are constant in the world.
struct Velocity {
  Vec3 linear;   ///< m/s
  Vec3 angular;  ///< rad/s
};

/// Room for the rounding of factors that only have to be large enough.
inline constexpr double kRoundedUp = 1 + 0x1p-40;

/// One body during the motion, in coordinates about a point that `move_to` moves.
struct Mover {
  Placed body;
  Quaternion start;
  Vec3 spin, axis;
  double speed;       ///< rad/s
  double radius;      ///< of the core
  double reach;       ///< m: bound of the distance of the core's points from the position
  double reach_axis;  ///< m: the same from the axis of the spin through the position
  bool far_origin;    ///< its pose needs wider arithmetic

  Mover(const Placed& placed, Vec3 angular);

  void move_to(Vec3 position, double time);

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

/// A translation at a constant velocity, and how far the common points with another body are beside it.
struct Drift {
  Vec3 velocity;  ///< m/s, in the world at the middle of the interval
  double beside;  ///< m
};

/// The motion of two bodies, with poses at any time, in coordinates about the position of b.
struct MovingPair {
  Mover a, b;
  Vec3 between, velocity;  ///< of a relative to b
  double lost;             ///< m: rounding of a gap

  MovingPair(const Placed& of_a, const Placed& of_b, const Velocity& motion_a, const Velocity& motion_b,
             double duration);

  Vec3 apart(double time) const { return between + time * velocity; }
  void move_to(double time) {
    b.move_to({}, time);
    a.move_to(apart(time), time);
  }

  /// The motion of a in the frame of b, or of b in the frame of a, within `half` seconds of a time.
  Drift drift_of_a(double time, double half) const { return drift(a, b, time, half); }
  Drift drift_of_b(double time, double half) const { return drift(b, a, time, half); }

  /// An upper bound of the depth from `start` to `end`, at which the normals of the depth or of the distance are given.
  double most_depth(double start, Vec3 normal_start, double end, Vec3 normal_end);

 private:
  Drift drift(const Mover& body, const Mover& fixed, double time, double half) const;
};

/// The gap between two bodies along a direction that turns at a constant rate, by the time from `start` on, or from
/// `earlier` seconds before it. The bodies are separated while this gap is positive. Otherwise the translation that
/// separates them is not longer than the gap is negative.
///
/// Each pair of points of the cores has a distance along the direction, and the gap is the least of them. The second
/// derivative of each of these distances is at most `curvature`, the first derivative at most `steepest`. Between two
/// times, the gap is therefore at least the chord less curvature / 2 times both parts of the interval.
class Gap {
 public:
  Gap(MovingPair& pair, double start, double earlier, double rest, Vec3 normal, Vec3 turning);

  Vec3 direction(double after) const;

  /// The gap less the rounding, for bodies at that time.
  double value_here(double after) const;

  /// The same, and the bodies are moved to that time.
  double value(double after);

  /// True if the gap is positive during an interval of this length between two times with these gaps.
  bool open(double first, double last, double length) const;

  /// A lower bound of the gap during such an interval.
  double least_between(double first, double last, double length) const;

  double limit() const { return limit_; }

  /// A time up to which the gap is open, near to its zero if there is one before `limit`. `now` is the gap at once.
  double open_until(double now, double width);

  double least() const { return least_; }
  double least_time() const { return start_ + least_after_; }

 private:
  MovingPair& pair_;
  double start_;
  Vec3 normal_, axis_;
  double rate_, limit_ = 0, curvature_ = 0, steepest_ = 0;
  double least_ = std::numeric_limits<double>::infinity(), least_after_ = 0;
};

}  // namespace overlapper
