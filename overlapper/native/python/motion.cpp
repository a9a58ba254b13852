#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "batch/motions.h"
#include "geometry/cancellation.h"
#include "motion/swept_support.h"
#include "python/arrays.h"
#include "python/batch.h"
#include "python/frames.h"

namespace overlapper::python {
namespace {

constexpr double kNotMet = std::numeric_limits<double>::quiet_NaN();

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

Velocity velocity_between(const Placed& start, const Placed& end, double duration) {
  return {(end.position - start.position) / duration, angular_velocity(start.orientation, end.orientation, duration)};
}

Velocity to_velocity(nb::handle value, const Placed& body, double duration, const std::string& name) {
  if (value.is_none()) return {};
  Velocity velocity;
  if (nb::isinstance<Placed>(value)) {
    velocity = velocity_between(body, nb::cast<const Placed&>(value), duration);
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

double to_duration(nb::handle given) {
  const double duration = to_double(given, "duration");
  if (!(duration > 0 && duration < 1e25)) fail("duration", "must be greater than 0 and less than 1e25 s");
  return duration;
}

void make_pair_of(MovingPair* self, nb::handle a_given, nb::handle b_given, nb::handle motion_a, nb::handle motion_b,
                  nb::handle duration_given) {
  const Placed a = to_placed(a_given, "a"), b = to_placed(b_given, "b");
  const double duration = to_duration(duration_given);
  const Velocity of_a = to_velocity(motion_a, a, duration, "motion_a"),
                 of_b = to_velocity(motion_b, b, duration, "motion_b");
  new (self) MovingPair(a, b, of_a, of_b, duration);
}

nb::tuple swept_supports(nb::handle body_given, nb::handle motion, nb::handle duration_given, nb::handle directions,
                         double within) {
  const Placed body = to_placed(body_given, "body");
  if (!bounded(body.shape)) fail("body", "must not be a half-space");
  const double duration = to_duration(duration_given);
  const Velocity velocity = to_velocity(motion, body, duration, "motion");
  const std::vector<Vec3> along = to_rows(directions, "directions");
  std::vector<double> upper;
  std::vector<Vec3> points;
  Mover mover(body, velocity.angular);
  for (Vec3 each : along) {
    const SweptSupport found = swept_support(mover, velocity.linear, duration, unit(each), within);
    upper.push_back(found.upper), points.push_back(found.point);
  }
  return nb::make_tuple(to_numpy<Vector>(std::move(upper), {along.size()}), to_numpy(std::span<const Vec3>(points)));
}

TimeOfImpact find(nb::handle a_given, nb::handle b_given, nb::handle motion_a, nb::handle motion_b,
                  nb::handle duration_given, nb::handle tolerance_given) {
  const Placed a = to_placed(a_given, "a"), b = to_placed(b_given, "b");
  const double duration = to_duration(duration_given), tolerance = to_tolerance(tolerance_given);
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

/// Answers for many pairs, a row each.
struct TimesOfImpact {
  std::vector<IndexPair> pairs;
  std::vector<Impact> rows;
  double width = 0;
};

std::vector<MovingBody> to_bodies(std::span<const Shape> shapes, const PoseRows& start, const PoseRows& end,
                                  double duration) {
  std::vector<MovingBody> bodies;
  bodies.reserve(shapes.size());
  const auto placed = [&](const PoseRows& rows, size_t i, const char* name) {
    const double *p = &rows.positions[3 * i], *q = &rows.orientations[4 * i];
    try {
      return make_placed(shapes[i], {p[0], p[1], p[2]}, {q[0], q[1], q[2], q[3]});
    } catch (const std::invalid_argument& error) {
      fail(std::string(name) + " " + std::to_string(i) + ":", error.what());
    }
  };
  for (size_t i = 0; i < shapes.size(); ++i) {
    bodies.push_back({placed(start, i, "pose"), placed(end, i, "end pose"), {}});
    MovingBody& body = bodies.back();
    body.velocity = velocity_between(body.start, body.end, duration);
    const bool known = finite(body.velocity.linear) && finite(body.velocity.angular);
    if (!known) fail("duration", "is too short for the motion between pose " + std::to_string(i) + " and its end");
  }
  return bodies;
}

TimesOfImpact find_many(nb::handle shapes_given, nb::handle positions, nb::handle orientations,
                        nb::handle end_positions, nb::handle end_orientations, nb::handle pairs_given,
                        nb::handle duration_given, nb::handle tolerance_given, nb::handle threads_given) {
  const std::vector<Shape> shapes = to_shapes(shapes_given);
  const size_t k = shapes.size();
  const PoseRows start = to_poses(positions, orientations, k),
                 end = to_poses(end_positions, end_orientations, k, "end_");
  const double duration = to_duration(duration_given), tolerance = to_tolerance(tolerance_given);
  const int threads = to_threads(threads_given);
  TimesOfImpact found;
  found.width = tolerance * duration;
  if (!pairs_given.is_none()) found.pairs = to_pairs(pairs_given, k);
  for (const auto& [a, b] : found.pairs)
    if (!bounded(shapes[a]) && !bounded(shapes[b]))
      fail("pairs", "must not pair two half-spaces, as [" + std::to_string(a) + ", " + std::to_string(b) + "] does");
  const bool finished = unlocked([&] {
    const std::vector<MovingBody> bodies = to_bodies(shapes, start, end, duration);
    if (pairs_given.is_none()) found.pairs = swept_pairs(bodies, duration);
    found.rows.resize(found.pairs.size());
    return times_of_impact(bodies, found.pairs, duration, found.width, threads, found.rows);
  });
  if (!finished) throw Cancelled{};
  if (!pairs_given.is_none()) return found;
  size_t kept = 0;
  for (size_t i = 0; i < found.rows.size(); ++i) {
    if (found.rows[i].status == Meeting::kSeparated) continue;
    found.rows[kept] = found.rows[i], found.pairs[kept] = found.pairs[i];
    ++kept;
  }
  found.rows.resize(kept), found.pairs.resize(kept);
  return found;
}

/// Columns with NaN in the rows of separated pairs, or with a number in each row.
void define_number(nb::class_<TimesOfImpact>& cls, const char* name, double Impact::* number, bool always,
                   const char* doc) {
  const std::string sig = "def " + std::string(name) + "(self) -> numpy.typing.NDArray[numpy.float64]";
  cls.def_prop_ro(
      name,
      [number, always](const TimesOfImpact& found) {
        std::vector<double> values;
        for (const Impact& row : found.rows)
          values.push_back(always || row.status != Meeting::kSeparated ? row.*number : kNotMet);
        return to_numpy<Vector>(std::move(values), {found.rows.size()});
      },
      nb::rv_policy::move, nb::sig(sig.c_str()), doc);
}

void define_vector(nb::class_<TimesOfImpact>& cls, const char* name, Vec3 Impact::* vector, const char* doc) {
  const std::string sig = "def " + std::string(name) + "(self) -> numpy.typing.NDArray[numpy.float64]";
  cls.def_prop_ro(
      name,
      [vector](const TimesOfImpact& found) {
        std::vector<Vec3> rows;
        for (const Impact& row : found.rows)
          rows.push_back(row.status == Meeting::kSeparated ? Vec3{kNotMet, kNotMet, kNotMet} : row.*vector);
        return to_numpy(std::span<const Vec3>(rows));
      },
      nb::rv_policy::move, nb::sig(sig.c_str()), doc);
}

template <class Getter>
void property_if_met(nb::class_<TimeOfImpact>& cls, const char* name, Getter getter, const nb::sig& sig,
                     const char* doc) {
  cls.def_prop_ro(
      name, [getter](const TimeOfImpact& t) -> nb::object { return met(t) ? nb::cast(getter(t.impact)) : nb::none(); },
      sig, doc);
}

void define_times_of_impact(nb::module_& m) {
  nb::class_<TimesOfImpact> cls(
      m, "TimesOfImpact",
      R"(The answers of `times_of_impact`: an array for each quantity, with a row for each pair.

`found[i]` is the TimeOfImpact of row i.)");
  nb::list names;
  for (Meeting each : kMeetings) names.append(status_name(each));
  cls.attr("STATUSES") = nb::tuple(names);
  cls.def_prop_ro(
      "pairs", [](const TimesOfImpact& found) { return to_numpy(std::span<const IndexPair>(found.pairs)); },
      nb::rv_policy::move, nb::sig("def pairs(self) -> numpy.typing.NDArray[numpy.int32]"),
      "(p, 2) indices of the shapes a and b of each row.");
  cls.def_prop_ro(
      "status",
      [](const TimesOfImpact& found) {
        std::vector<int> codes;
        for (const Impact& row : found.rows)
          codes.push_back(static_cast<int>(std::ranges::find(kMeetings, row.status) - kMeetings.begin()));
        return to_numpy(std::span<const int>(codes));
      },
      nb::rv_policy::move, nb::sig("def status(self) -> numpy.typing.NDArray[numpy.int32]"),
      "(p,) an index into TimesOfImpact.STATUSES, which has the names of TimeOfImpact.status.");
  define_number(cls, "time", &Impact::time, false, "(p,) s, not later than the first common point; NaN if separated.");
  define_number(cls, "time_upper", &Impact::time_upper, false, "(p,) s, as in TimeOfImpact; NaN if separated.");
  define_vector(cls, "normal", &Impact::normal, "(p, 3) unit, from b to a at `time`; NaN if separated.");
  define_vector(cls, "point", &Impact::point, "(p, 3) m, as in TimeOfImpact; NaN if separated.");
  define_number(cls, "distance", &Impact::distance, true, "(p,) m, the least distance of the computed poses.");
  define_number(cls, "distance_time", &Impact::distance_time, true, "(p,) s, when `distance` was seen.");
  cls.def("__len__", [](const TimesOfImpact& found) { return found.rows.size(); });
  cls.def(
      "__getitem__",
      [](const TimesOfImpact& found, nb::handle row) {
        const nb::object at = nb::module_::import_("builtins").attr("range")(found.rows.size())[row];
        return TimeOfImpact{found.rows[nb::cast<size_t>(at)], found.width};
      },
      "row"_a, nb::sig("def __getitem__(self, row: typing.SupportsIndex) -> TimeOfImpact"));
  cls.def("__repr__", [](const TimesOfImpact& found) {
    const auto separated = std::ranges::count(found.rows, Meeting::kSeparated, &Impact::status);
    return "TimesOfImpact(" + std::to_string(found.rows.size()) + " pairs, " + std::to_string(separated) +
           " separated)";
  });
  cls.def(
      "__getstate__",
      [](nb::handle self) {
        return nb::make_tuple(self.attr("pairs"), nb::list(self), nb::cast<TimesOfImpact&>(self).width);
      },
      nb::sig("def __getstate__(self) -> tuple[object, ...]"));
  cls.def(
      "__setstate__",
      [](TimesOfImpact& self, nb::handle state) {
        const char* const refusal = "state must be that of times of impact";
        if (!nb::isinstance<nb::tuple>(state) || nb::len(state) != 3) throw nb::value_error(refusal);
        TimesOfImpact read{to_pairs(state[0], std::numeric_limits<int>::max()), {}, to_double(state[2], "state")};
        const nb::object rows = state[1];
        if (!nb::isinstance<nb::list>(rows) || nb::len(rows) != read.pairs.size()) throw nb::value_error(refusal);
        for (nb::handle row : rows) {
          if (!nb::isinstance<TimeOfImpact>(row)) throw nb::value_error(refusal);
          read.rows.push_back(nb::cast<const TimeOfImpact&>(row).impact);
        }
        new (&self) TimesOfImpact(std::move(read));
      },
      nb::sig("def __setstate__(self, state: tuple[object, ...]) -> None"));
  m.def("times_of_impact", &find_many, "shapes"_a.none(), "positions"_a.none(), "orientations"_a.none(),
        "end_positions"_a.none(), "end_orientations"_a.none(), "pairs"_a.none() = nb::none(), "duration"_a.none() = 1.0,
        "tolerance"_a.none() = 1e-9, "threads"_a.none() = 1,
        nb::sig(("def times_of_impact(shapes: " + any_shapes() +
                 " | Batch, positions: numpy.typing.ArrayLike, orientations: numpy.typing.ArrayLike | None, "
                 "end_positions: numpy.typing.ArrayLike, end_orientations: numpy.typing.ArrayLike | None, pairs: "
                 "numpy.typing.ArrayLike | None = None, duration: float = 1.0, tolerance: float = 1e-09, threads: int "
                 "| None = 1) -> TimesOfImpact")
                    .c_str()),
        R"(The times of the first common points of many pairs of moving shapes.

The position of each shape moves along a line at a constant velocity. The shape turns at a constant rate the shorter
way.

Parameters
----------
shapes : sequence of shapes, or Batch
    The k shapes, without poses.
positions, orientations : (k, 3) and (k, 4) array_like, or (k, 4, 4) array_like and None
    Poses at time 0, as `overlaps` takes them.
end_positions, end_orientations : (k, 3) and (k, 4) array_like, or (k, 4, 4) array_like and None
    Poses at the end of the motion.
pairs : (p, 2) array_like of int, optional
    Indices of the shapes of each pair. Default: all pairs that are not separated during the whole motion, sorted. Boxes
    around the whole motion of each shape tell which pairs are examined.
duration : float, default 1.0
    Length of the motion in s.
tolerance : float, default 1e-9
    Wanted width of the intervals of times, as a fraction of `duration`.
threads : int or None, default 1
    Number of threads. None: one on each core. The number does not change a bit of the results.

Returns
-------
TimesOfImpact
    A row for each pair, as from `time_of_impact`.

Raises
------
ValueError
    If an argument has the wrong shape, a pose is not finite, or `pairs` has a pair of two half-spaces.

Examples
--------
>>> from overlapper import Box, Sphere, times_of_impact
>>> still = [[0, 0, 0, 1]] * 2
>>> found = times_of_impact([Sphere(0.01), Box([1, 1, 0.001])], [[0, 0, 1], [0, 0, 0]], still,
...                         [[0, 0, -2], [0, 0, 0]], still)
>>> found.pairs.tolist(), found.time.round(6).tolist()
([[0, 1]], [0.329667]))");
  m.def(
      "swept_pairs",
      [](nb::handle shapes_given, nb::handle positions, nb::handle orientations, nb::handle end_positions,
         nb::handle end_orientations) {
        const std::vector<Shape> shapes = to_shapes(shapes_given);
        const PoseRows start = to_poses(positions, orientations, shapes.size()),
                       end = to_poses(end_positions, end_orientations, shapes.size(), "end_");
        const auto pairs = unlocked([&] { return swept_pairs(to_bodies(shapes, start, end, 1), 1); });
        return to_numpy(std::span<const IndexPair>(pairs));
      },
      "shapes"_a.none(), "positions"_a.none(), "orientations"_a.none(), "end_positions"_a.none(),
      "end_orientations"_a.none(),
      nb::sig(("def swept_pairs(shapes: " + any_shapes() +
               " | Batch, positions: numpy.typing.ArrayLike, orientations: numpy.typing.ArrayLike | None, "
               "end_positions: numpy.typing.ArrayLike, end_orientations: numpy.typing.ArrayLike | None) -> "
               "numpy.typing.NDArray[numpy.int32]")
                  .c_str()),
      "The pairs of shapes whose boxes around the whole motion meet: (p, 2) indices i < j, sorted.");
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
  define_times_of_impact(m);
  nb::class_<MovingPair> pair(m, "MovingPair", R"(Two moving bodies, in coordinates about the position of b.)");
  pair.def("__init__", &make_pair_of, "a"_a.none(), "b"_a.none(), "motion_a"_a.none(), "motion_b"_a.none(),
           "duration"_a.none(),
           nb::sig(("def __init__(self, a: " + any_solid() + " | Placed, b: " + any_solid() +
                    " | Placed, motion_a: tuple[numpy.typing.ArrayLike, numpy.typing.ArrayLike] | Placed | None, "
                    "motion_b: tuple[numpy.typing.ArrayLike, numpy.typing.ArrayLike] | Placed | None, duration: float) "
                    "-> None")
                       .c_str()));
  pair.def(
      "at",
      [](MovingPair& self, double time) {
        self.move_to(time);
        return nb::make_tuple(self.a.body, self.b.body);
      },
      "time"_a, nb::sig("def at(self, time: float) -> tuple[Placed, Placed]"), "Both bodies at a time in s.");
  pair.def(
      "drift",
      [](const MovingPair& self, double time, double half, bool of_a) {
        const Drift found = of_a ? self.drift_of_a(time, half) : self.drift_of_b(time, half);
        return nb::make_tuple(to_numpy(found.velocity), found.beside);
      },
      "time"_a, "half"_a, "of_a"_a,
      nb::sig("def drift(self, time: float, half: float, of_a: bool) -> tuple[numpy.typing.NDArray[numpy.float64], "
              "float]"),
      R"((3,) m/s, a velocity of a in the frame of b within `half` seconds of a time, or of b in the frame of a.

Then a bound in m: how far the common points are beside a translation at this velocity.)");
  pair.def(
      "most_depth",
      [](MovingPair& self, double start, nb::handle normal_start, double end, nb::handle normal_end) {
        return self.most_depth(start, to_vec3(normal_start, "normal_start"), end, to_vec3(normal_end, "normal_end"));
      },
      "start"_a, "normal_start"_a, "end"_a, "normal_end"_a,
      nb::sig("def most_depth(self, start: float, normal_start: numpy.typing.ArrayLike, end: float, normal_end: "
              "numpy.typing.ArrayLike) -> float"),
      "An upper bound of the depth in m between two times, from the normals of `Overlap` there.");
  pair.def_prop_ro("lost", [](const MovingPair& self) { return self.lost; }, "m: rounding of a depth.");
  m.def("swept_supports", &swept_supports, "body"_a.none(), "motion"_a.none(), "duration"_a.none(),
        "directions"_a.none(), "within"_a,
        nb::sig(("def swept_supports(body: " + any_solid() +
                 " | Placed, motion: tuple[numpy.typing.ArrayLike, numpy.typing.ArrayLike] | Placed | None, duration: "
                 "float, directions: numpy.typing.ArrayLike, within: float) -> "
                 "tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]")
                    .c_str()),
        R"(How far a moving body reaches along each of n directions, from its position at the start.

(n,) upper bounds in m, and (n, 3) points of the body at some time that are less far by `within` m at most.)");
}

}  // namespace overlapper::python
