#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>

#include "python/arrays.h"
#include "python/frames.h"

namespace overlapper::python {
namespace {

bool zero(Quaternion q) { return unturned(q) && q.w == 0; }

Quaternion normalized(Quaternion given) {
  const bool known = finite(vector_part(given)) && std::isfinite(given.w);
  const Quaternion q = known ? in_range(given) : given;
  const double length = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
  return {q.x / length, q.y / length, q.z / length, q.w / length};
}

/// The frames as pybullet's answers, or as rows of an array: position, then quaternion x, y, z, w.
std::vector<Frame> to_frames(nb::handle given) {
  std::vector<Frame> frames;
  if (nb::ndarray_check(given)) {
    const Doubles rows = to_doubles(given, "frames", "an array of shape (n, 7)");
    if (rows.ndim() != 2 || rows.shape(1) != 7)
      fail("frames", "must be an array of shape (n, 7), not of shape " + shape_text(rows));
    frames.reserve(rows.shape(0));
    for (size_t i = 0; i < rows.shape(0); ++i) {
      const double* f = rows.data() + 7 * i;
      frames.push_back({{f[0], f[1], f[2]}, {f[3], f[4], f[5], f[6]}});
    }
  } else {
    for (nb::handle each : given) frames.push_back(to_frame(each));
  }
  return frames;
}

/// Shapes that are fixed to moving frames.
class FixedShapes {
 public:
  FixedShapes(nb::handle which_given, nb::handle positions_given, nb::handle orientations_given)
      : which_(to_indices(which_given, "which")) {
    const Doubles positions = to_doubles(positions_given, "positions", "an array of shape (k, 3)");
    const Doubles orientations = to_doubles(orientations_given, "orientations", "an array of shape (k, 4)");
    const size_t k = which_.size();
    if (positions.ndim() != 2 || positions.shape(0) != k || positions.shape(1) != 3)
      fail("positions", "must have the shape (k, 3), a row for each of `which`");
    if (orientations.ndim() != 2 || orientations.shape(0) != k || orientations.shape(1) != 4)
      fail("orientations", "must have the shape (k, 4), a row for each of `which`");
    for (size_t i = 0; i < k; ++i) {
      const double *p = positions.data() + 3 * i, *q = orientations.data() + 4 * i;
      local_.push_back({{p[0], p[1], p[2]}, {q[0], q[1], q[2], q[3]}});
      if (zero(local_.back().orientation)) fail("orientations", "must not have the zero quaternion");
    }
  }

  nb::tuple world(nb::handle frames_given, double farthest) const {
    std::vector<Frame> frames = to_frames(frames_given);
    for (Frame& frame : frames) {
      if (zero(frame.orientation)) fail("frames", "must not have the zero quaternion");
      frame.orientation = normalized(frame.orientation);
    }
    const size_t k = which_.size();
    std::vector<double> positions(3 * k), orientations(4 * k);
    bool within = true;
    for (size_t i = 0; i < k; ++i) {
      if (which_[i] < 0 || which_[i] >= std::int64_t(frames.size())) fail("which", "must index the frames");
      const Frame& frame = frames[which_[i]];
      const Vec3 x = frame.position + rotated(frame.orientation, local_[i].position);
      const Quaternion r = frame.orientation * local_[i].orientation;
      double *position = &positions[3 * i], *orientation = &orientations[4 * i];
      position[0] = x.x, position[1] = x.y, position[2] = x.z;
      orientation[0] = r.x, orientation[1] = r.y, orientation[2] = r.z, orientation[3] = r.w;
      within = within && max_component(abs(x)) < farthest && finite(x) && finite(vector_part(r)) && std::isfinite(r.w);
    }
    return nb::make_tuple(to_numpy<Matrix>(std::move(positions), {k, 3}),
                          to_numpy<Matrix>(std::move(orientations), {k, 4}), within);
  }

 private:
  std::vector<std::int64_t> which_;
  std::vector<Frame> local_;
};

nb::tuple world_poses(nb::handle frames, nb::handle which, nb::handle positions, nb::handle orientations) {
  const nb::tuple found = FixedShapes(which, positions, orientations).world(frames, 0);
  return nb::make_tuple(found[0], found[1]);
}

/// Rows of arrays of poses that a simulator owns and changes.
class ChosenFrames {
 public:
  ChosenFrames(nb::handle positions, nb::handle quaternions, nb::handle which_given)
      : positions_(rows_of(positions, "positions", 3)),
        quaternions_(rows_of(quaternions, "quaternions", 4)),
        which_(to_indices(which_given, "which")) {
    const size_t n = positions_.shape(0);
    if (quaternions_.shape(0) != n) fail("quaternions", "must have a row for each of `positions`");
    for (std::int64_t i : which_)
      if (i < 0 || i >= std::int64_t(n)) fail("which", "must index the positions");
  }

  Matrix read() const {
    std::vector<double> frames;
    frames.reserve(7 * which_.size());
    for (std::int64_t i : which_) {
      const double *x = positions_.data() + 3 * i, *wxyz = quaternions_.data() + 4 * i;
      frames.insert(frames.end(), {x[0], x[1], x[2], wxyz[1], wxyz[2], wxyz[3], wxyz[0]});
    }
    return to_numpy<Matrix>(std::move(frames), {which_.size(), 7});
  }

 private:
  static Doubles rows_of(nb::handle given, const char* name, size_t columns) {
    Doubles array;
    if (!nb::ndarray_check(given) || !nb::try_cast(given, array, false) || array.ndim() != 2 ||
        array.shape(1) != columns)
      fail(name, "must be a contiguous array of doubles of shape (n, " + std::to_string(columns) + ")");
    return array;
  }

  Doubles positions_, quaternions_;
  std::vector<std::int64_t> which_;
};

/// Whether a point of `meets` has moved: the greatest coordinate of turn * (position - origin) - before exceeds its
/// slack or is not a number.
bool any_moved(nb::handle positions_given, nb::handle origin_given, nb::handle turn_given, nb::handle before_given,
               nb::handle slack_given, nb::handle meets_given) {
  const std::vector<Vec3> positions = to_rows(positions_given, "positions"), turn = to_rows(turn_given, "turn"),
                          before = to_rows(before_given, "before");
  const Vec3 origin = to_vec3(origin_given, "origin");
  const Doubles slack = to_doubles(slack_given, "slack", "an array of numbers");
  const auto meets = nb::cast<nb::ndarray<const bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>>(meets_given, false);
  const size_t n = positions.size();
  if (turn.size() != 3) fail("turn", "must have three rows");
  if (before.size() != n || slack.size() != n || meets.size() != n) fail("positions", "must have a row in each array");
  for (size_t i = 0; i < n; ++i) {
    if (!meets.data()[i]) continue;
    const Vec3 x = positions[i] - origin, was = before[i];
    const Vec3 moved = abs(Vec3{dot(turn[0], x) - was.x, dot(turn[1], x) - was.y, dot(turn[2], x) - was.z});
    const double most = slack.data()[i];
    if (!(moved.x <= most && moved.y <= most && moved.z <= most)) return true;
  }
  return false;
}

/// Copies of arrays, to notice when somebody edits the arrays.
class Snapshot {
 public:
  explicit Snapshot(nb::handle arrays) {
    for (nb::handle each : arrays) {
      if (!nb::ndarray_check(each)) throw nb::type_error("arrays must be arrays of numpy");
      arrays_.push_back(nb::cast<Array>(each, false));
      const std::byte* first = bytes(arrays_.back());
      copies_.emplace_back(first, first + arrays_.back().nbytes());
    }
  }

  bool renew() {
    bool changed = false;
    for (size_t i = 0; i < arrays_.size(); ++i) {
      std::vector<std::byte>& copy = copies_[i];
      const std::byte* now = bytes(arrays_[i]);
      if (copy.empty() || std::memcmp(copy.data(), now, copy.size()) == 0) continue;
      std::copy_n(now, copy.size(), copy.begin());
      changed = true;
    }
    return changed;
  }

 private:
  using Array = nb::ndarray<nb::ro, nb::c_contig, nb::device::cpu>;
  static const std::byte* bytes(const Array& array) { return static_cast<const std::byte*>(array.data()); }

  std::vector<Array> arrays_;
  std::vector<std::vector<std::byte>> copies_;
};

}  // namespace

Quaternion rotation_quaternion(const Mat3& rotation) {
  const auto [x, y, z] = transposed(rotation);
  // Four multiples of the quaternion are known. The multiple with the largest component loses no digits.
  const double trace = x.x + y.y + z.z;
  const double largest = std::max({trace, x.x, y.y, z.z});
  Quaternion q;
  if (largest == trace) q = {y.z - z.y, z.x - x.z, x.y - y.x, 1 + trace};
  else if (largest == x.x) q = {1 + x.x - y.y - z.z, x.y + y.x, z.x + x.z, y.z - z.y};
  else if (largest == y.y) q = {x.y + y.x, 1 - x.x + y.y - z.z, y.z + z.y, z.x - x.z};
  else q = {z.x + x.z, y.z + z.y, 1 - x.x - y.y + z.z, x.y - y.x};
  return normalized(q);
}

std::pair<Vec3, Quaternion> matrix_pose(std::span<const double, 16> matrix, const std::string& name) {
  constexpr double kMostOff = 1e-6;
  if (!std::all_of(matrix.begin(), matrix.end(), [](double each) { return std::isfinite(each); }))
    fail(name, "must be finite");
  const auto column = [&](int k) { return Vec3{matrix[k], matrix[4 + k], matrix[8 + k]}; };
  const Vec3 x = column(0), y = column(1), z = column(2);
  if (!(matrix[12] == 0 && matrix[13] == 0 && matrix[14] == 0 && matrix[15] == 1))
    fail(name, "must have the last row (0, 0, 0, 1)");
  const double determinant = dot(cross(x, y), z);
  if (determinant < 0) fail(name, "must not reflect: the determinant of its rotation is " + number(determinant));
  const double stretch = std::max({std::abs(norm(x) - 1), std::abs(norm(y) - 1), std::abs(norm(z) - 1)});
  if (stretch > kMostOff) fail(name, "must not scale: the length of an axis differs from 1 by " + number(stretch));
  const double cosine = std::max({std::abs(dot(x, y)), std::abs(dot(y, z)), std::abs(dot(z, x))});
  if (cosine > kMostOff)
    fail(name, "must have right angles between its axes: the cosine of an angle is " + number(cosine));
  return {column(3), rotation_quaternion(transposed(Mat3{x, y, z}))};
}

void define_poses(nb::module_& m) {
  m.def("world_poses", &world_poses, "frames"_a, "which"_a, "positions"_a, "orientations"_a,
        nb::sig("def world_poses(frames: collections.abc.Sequence[typing.Any] | numpy.typing.NDArray[numpy.float64], "
                "which: numpy.typing.NDArray[numpy.int64], positions: numpy.typing.ArrayLike, orientations: "
                "numpy.typing.ArrayLike) -> tuple[numpy.typing.NDArray[numpy.float64], "
                "numpy.typing.NDArray[numpy.float64]]"),
        R"((k, 3) positions in m and (k, 4) quaternions xyzw in the world of what is fixed to moving frames.

`frames` begin with position and quaternion, as pybullet's answers do, or they are rows (n, 7) of an array. Thing i is
fixed to frame `which[i]` at `positions[i]` and `orientations[i]` of it. Quaternions are of any length but 0. Those in
the world are as long as `orientations`. They are not finite where a frame is not.)");
  nb::class_<FixedShapes>(m, "FixedShapes", R"(Shapes that are fixed to moving frames.

Parameters
----------
which : (k,) array_like of int
    The row of each shape's frame.
positions : (k, 3) array_like
    In the frames, m.
orientations : (k, 4) array_like
    Quaternions xyzw in the frames.)")
      .def(nb::init<nb::handle, nb::handle, nb::handle>(), "which"_a, "positions"_a, "orientations"_a,
           nb::sig("def __init__(self, which: numpy.typing.ArrayLike, positions: numpy.typing.ArrayLike, orientations: "
                   "numpy.typing.ArrayLike) -> None"))
      .def(
          "world", &FixedShapes::world, "frames"_a, "farthest"_a,
          nb::sig("def world(self, frames: collections.abc.Sequence[typing.Any] | "
                  "numpy.typing.NDArray[numpy.float64], farthest: float) -> tuple[numpy.typing.NDArray[numpy.float64], "
                  "numpy.typing.NDArray[numpy.float64], bool]"),
          R"(Positions and quaternions as of `world_poses`, and whether all of them are usable.

Usable poses are finite, and their coordinates are less than `farthest` in size.)");
  nb::class_<ChosenFrames>(m, "ChosenFrames", R"(Rows of arrays of poses that a simulator owns and changes.

Parameters
----------
positions : (n, 3) ndarray
    In m.
quaternions : (n, 4) ndarray
    In the order wxyz.
which : (k,) array_like of int
    The rows.)")
      .def(nb::init<nb::handle, nb::handle, nb::handle>(), "positions"_a, "quaternions"_a, "which"_a,
           nb::sig("def __init__(self, positions: numpy.typing.NDArray[numpy.float64], quaternions: "
                   "numpy.typing.NDArray[numpy.float64], which: numpy.typing.ArrayLike) -> None"))
      .def("read", &ChosenFrames::read, nb::sig("def read(self) -> numpy.typing.NDArray[numpy.float64]"),
           "(k, 7) positions and quaternions xyzw of these rows now, for `FixedShapes.world`.");
  m.def("any_moved", &any_moved, "positions"_a, "origin"_a, "turn"_a, "before"_a, "slack"_a, "meets"_a,
        nb::sig("def any_moved(positions: numpy.typing.ArrayLike, origin: numpy.typing.ArrayLike, turn: "
                "numpy.typing.ArrayLike, before: numpy.typing.ArrayLike, slack: numpy.typing.ArrayLike, meets: "
                "numpy.typing.NDArray[numpy.bool_]) -> bool"),
        R"(Whether one of the points in `meets` (n,) has moved by more than its `slack` (n,) along an axis.

Coordinates are turn @ (position - origin). `before` (n, 3) are the earlier coordinates.)");
  nb::class_<Snapshot>(m, "Snapshot", R"(Copies of arrays of numpy, to notice edits.

Parameters
----------
arrays : iterable of ndarray
    Contiguous arrays of any type.)")
      .def(nb::init<nb::handle>(), "arrays"_a,
           nb::sig("def __init__(self, arrays: collections.abc.Iterable[numpy.typing.NDArray[typing.Any]]) -> None"))
      .def("renew", &Snapshot::renew, "Copy the arrays again. True if any bit has changed since the last copy.");
}

}  // namespace overlapper::python
