#include <algorithm>
#include <cmath>

#include "motion/time_of_impact.h"
#include "python/arrays.h"
#include "python/frames.h"

namespace overlapper::python {
namespace {

constexpr std::array kMeetings{Meeting::kSeparated, Meeting::kImpact, Meeting::kTouching, Meeting::kOverlapping,
                               Meeting::kOpen};

const char* status_name(Meeting status) {
  switch (status) {
    case Meeting::kSeparated: return "separated";
    case Meeting::kImpact: return "impact";
    case Meeting::kTouching: return "touching";
    case Meeting::kOverlapping: return "overlapping";
    case Meeting::kOpen: break;
  }
  return "open";
}

/// An answer with the wanted width of its interval.
struct TimeOfImpact {
  Impact impact;
  double width;
};

bool met(const TimeOfImpact& t) { return t.impact.status != Meeting::kSeparated; }

bool converged(const TimeOfImpact& t) {
  // The difference of two doubles is rounded.
  return !met(t) || (t.impact.status != Meeting::kOpen &&
                     t.impact.time_upper - t.impact.time <= t.width * (1 + 0x1p-50) + 0x1p-52 * t.impact.time_upper);
}

std::string repr(const TimeOfImpact& t) {
  std::string text = "TimeOfImpact(" + std::string(status_name(t.impact.status));
  if (met(t)) text += ", time=" + number(t.impact.time) + " s";
  if (t.impact.status == Meeting::kSeparated) text += ", distance=" + number(t.impact.distance) + " m";
  return text + ")";
}

/// The velocity that turns one orientation into another the shorter way.
Vec3 angular_velocity(Quaternion from, Quaternion to, double duration) {
  const Quaternion p = in_range(from), q = in_range(to);
  const Quaternion turn = q * Quaternion{-p.x, -p.y, -p.z, p.w};
  const Vec3 v = turn.w < 0 ? -vector_part(turn) : vector_part(turn);
  const double sine = norm(v);
  return sine > 0 ? (2 * std::atan2(sine, std::abs(turn.w)) / duration) * (v / sine) : Vec3{};
}

Velocity to_velocity(nb::handle value, const Placed& body, double duration, const std::string& name) {
  if (value.is_none()) return {};
  Velocity velocity;
  if (nb::isinstance<Placed>(value)) {
    const Placed& end = nb::cast<const Placed&>(value);
    velocity.linear = (end.position - body.position) / duration;
    velocity.angular = angular_velocity(body.orientation, end.orientation, duration);
  } else {
    if (!nb::isinstance<nb::sequence>(value) || nb::len(value) != 2)
      fail(name, "must be a pair (linear velocity, angular velocity), a Placed at the end of the motion, or None");
    velocity.linear = to_vec3(value[0], name + "[0]");
    velocity.angular = to_vec3(value[1], name + "[1]");
  }
  const bool known = finite(velocity.linear) && finite(velocity.angular);
  if (!known) fail(name, "must be finite");
  if (!(std::max(max_component(abs(velocity.linear)), max_component(abs(velocity.angular))) * duration < 1e25))
    fail(name, "must be less than 1e25 m and 1e25 rad in the duration");
  return velocity;
}

TimeOfImpact find(nb::handle a_given, nb::handle b_given, nb::handle motion_a, nb::handle motion_b,
                  nb::handle duration_given, nb::handle tolerance_given) {
  const Placed a = to_placed(a_given, "a"), b = to_placed(b_given, "b");
  const double duration = to_double(duration_given, "duration"), tolerance = to_tolerance(tolerance_given);
  if (!(duration > 0 && duration < 1e25)) fail("duration", "must be greater than 0 and less than 1e25 s");
  const Velocity of_a = to_velocity(motion_a, a, duration, "motion_a"),
                 of_b = to_velocity(motion_b, b, duration, "motion_b");
  const double width = tolerance * duration;
  return unlocked([&] { return TimeOfImpact{time_of_impact(a, b, of_a, of_b, duration, width), width}; });
}

/// All numbers of the answer: its inputs are not kept.
nb::tuple impact_state(const TimeOfImpact& t) {
  const Impact& i = t.impact;
  return nb::make_tuple(status_name(i.status), i.time, i.time_upper, i.distance, i.distance_time, to_numpy(i.normal),
                        to_numpy(i.point), i.steps, t.width);
}

void set_impact_state(TimeOfImpact& self, nb::handle state) {
  const char* const refusal = "state must be that of a time of impact";
  if (!nb::isinstance<nb::tuple>(state) || nb::len(state) != 9) throw nb::value_error(refusal);
  TimeOfImpact read{{}, to_double(state[8], "state")};
  Impact& i = read.impact;
  const nb::object name = state[0];
  for (Meeting each : kMeetings)
    if (name.equal(nb::str(status_name(each)))) i.status = each;
  i.time = to_double(state[1], "state"), i.time_upper = to_double(state[2], "state");
  i.distance = to_double(state[3], "state"), i.distance_time = to_double(state[4], "state");
  i.normal = to_vec3(state[5], "state"), i.point = to_vec3(state[6], "state");
  const bool known = name.equal(nb::str(status_name(i.status))) && nb::try_cast(state[7], i.steps);
  if (!known) throw nb::value_error(refusal);
  new (&self) TimeOfImpact(read);
}

template <class Getter>
void property_if_met(nb::class_<TimeOfImpact>& cls, const char* name, Getter getter, const nb::sig& sig,
                     const char* doc) {
  cls.def_prop_ro(
      name, [getter](const TimeOfImpact& t) -> nb::object { return met(t) ? nb::cast(getter(t.impact)) : nb::none(); },
      sig, doc);
}

}  // namespace

void define_motion(nb::module_& m) {
  nb::class_<TimeOfImpact> cls(m, "TimeOfImpact", "The answer of `time_of_impact`. It is true unless `separated`.");
  cls.def_prop_ro(
      "status", [](const TimeOfImpact& t) { return status_name(t.impact.status); },
      nb::sig("def status(self) -> typing.Literal['separated', 'impact', 'touching', 'overlapping', 'open']"),
      R"('separated': the bodies have no common point during the motion.
'impact': they are separated before `time` and overlap at `time_upper`.
'touching': they come so close that rounding decides whether they meet, or they overlap for a shorter time than the
tolerance, or they touch at the start.
'overlapping': they overlap at the start.
'open': the limit of steps was reached. They are separated before `time`; nothing is known after it.)");
  property_if_met(
      cls, "time", [](const Impact& i) { return i.time; }, nb::sig("def time(self) -> float | None"),
      "s, not later than the first common point. None if separated.");
  property_if_met(
      cls, "time_upper", [](const Impact& i) { return i.time_upper; }, nb::sig("def time_upper(self) -> float | None"),
      R"(s, not earlier than the first common point of an impact. If touching, the time after which the pair is
certainly separated again, or the end of the motion. None if separated.)");
  property_if_met(
      cls, "normal", [](const Impact& i) { return to_numpy(i.normal); },
      nb::sig("def normal(self) -> numpy.typing.NDArray[numpy.float64] | None"),
      "(3,) unit vector from b to a at `time`. None if separated.");
  property_if_met(
      cls, "point", [](const Impact& i) { return to_numpy(i.point); },
      nb::sig("def point(self) -> numpy.typing.NDArray[numpy.float64] | None"),
      R"((3,) m, half-way between the nearest points at a time from `time` to `time_upper`; the centroid of the common set if
overlapping. None if separated.)");
  cls.def_prop_ro(
      "distance", [](const TimeOfImpact& t) { return t.impact.distance; },
      "m, the least distance of the computed poses: an upper bound of the least distance of the motion.");
  cls.def_prop_ro(
      "distance_time", [](const TimeOfImpact& t) { return t.impact.distance_time; }, "s, when `distance` was seen.");
  cls.def_prop_ro("converged", &converged, "False if `time_upper - time` is longer than the tolerance.");
  cls.def_prop_ro("steps", [](const TimeOfImpact& t) { return t.impact.steps; }, "Number of distances computed.");
  cls.def("__bool__", &met);
  cls.def("__repr__", &repr);
  cls.def("__copy__", [](nb::handle self) { return nb::borrow(self); });
  cls.def("__deepcopy__", [](nb::handle self, nb::handle) { return nb::borrow(self); }, "memo"_a);
  cls.def("__getstate__", &impact_state, nb::sig("def __getstate__(self) -> tuple[object, ...]"));
  cls.def("__setstate__", &set_impact_state, nb::sig("def __setstate__(self, state: tuple[object, ...]) -> None"));
  m.def("time_of_impact", &find, "a"_a.none(), "b"_a.none(), "motion_a"_a.none() = nb::none(),
        "motion_b"_a.none() = nb::none(), "duration"_a.none() = 1.0, "tolerance"_a.none() = 1e-9,
        nb::sig(("def time_of_impact(a: " + any_solid() + " | Placed, b: " + any_solid() +
                 " | Placed, motion_a: tuple[numpy.typing.ArrayLike, numpy.typing.ArrayLike] | Placed | None = None, "
                 "motion_b: tuple[numpy.typing.ArrayLike, numpy.typing.ArrayLike] | Placed | None = None, duration: "
                 "float = 1.0, tolerance: float = 1e-09) -> TimeOfImpact")
                    .c_str()),
        R"(The time of the first common point of two moving shapes.

The position of each body moves along a line, and the body turns about its position. Both velocities are constant.

Parameters
----------
a, b : shape, Placed, (n, 3) array_like or trimesh.Trimesh
    The two bodies at time 0, as `distance` takes them.
motion_a, motion_b : tuple of two (3,) array_like, or Placed, optional
    Linear velocity in m/s and angular velocity in rad/s, both in the world; or the body at the end of the motion. From
    a Placed only the pose is read, and the body turns the shorter way. Its velocities are rounded, so the end is
    reached up to rounding. None: at rest.
duration : float, default 1.0
    Length of the motion in s.
tolerance : float, default 1e-9
    Wanted width of the interval of times, as a fraction of `duration`.

Returns
-------
TimeOfImpact
    `time` is never later than the first common point. Rounding is included in this bound. No common point is a result,
    not an error: `bool(result)` is False.

Raises
------
ValueError
    If both bodies are half-spaces, if `duration` is not positive, or if a motion is not finite.

Examples
--------
>>> from overlapper import Box, Placed, Sphere, time_of_impact
>>> bullet, sheet = Placed(Sphere(0.01), (0, 0, 1)), Box([1, 1, 0.0005])
>>> hit = time_of_impact(bullet, sheet, ((0, 0, -300), (0, 0, 0)), duration=0.01)
>>> hit.status, round(hit.time, 9)
('impact', 0.003298333))");
}

}  // namespace overlapper::python
