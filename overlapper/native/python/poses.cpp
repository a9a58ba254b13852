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

nb::tuple world_poses(nb::handle frames_given, nb::handle which_given, nb::handle positions_given,
                      nb::handle orientations_given) {
  std::vector<Frame> frames = to_frames(frames_given);
  for (Frame& frame : frames) {
    if (zero(frame.orientation)) fail("frames", "must not have the zero quaternion");
    frame.orientation = normalized(frame.orientation);
  }
  const std::vector<std::int64_t> which = to_indices(which_given, "which");
  const Doubles local_positions = to_doubles(positions_given, "positions", "an array of shape (k, 3)");
  const Doubles local_orientations = to_doubles(orientations_given, "orientations", "an array of shape (k, 4)");
  const size_t k = which.size();
  if (local_positions.ndim() != 2 || local_positions.shape(0) != k || local_positions.shape(1) != 3)
    fail("positions", "must have the shape (k, 3), a row for each of `which`");
  if (local_orientations.ndim() != 2 || local_orientations.shape(0) != k || local_orientations.shape(1) != 4)
    fail("orientations", "must have the shape (k, 4), a row for each of `which`");
  std::vector<double> positions(3 * k), orientations(4 * k);
  for (size_t i = 0; i < k; ++i) {
    if (which[i] < 0 || which[i] >= std::int64_t(frames.size())) fail("which", "must index the frames");
    const Frame& frame = frames[which[i]];
    const double *p = local_positions.data() + 3 * i, *q = local_orientations.data() + 4 * i;
    const Vec3 x = frame.position + rotated(frame.orientation, {p[0], p[1], p[2]});
    const Quaternion local{q[0], q[1], q[2], q[3]};
    if (zero(local)) fail("orientations", "must not have the zero quaternion");
    const Quaternion r = frame.orientation * local;
    double *position = &positions[3 * i], *orientation = &orientations[4 * i];
    position[0] = x.x, position[1] = x.y, position[2] = x.z;
    orientation[0] = r.x, orientation[1] = r.y, orientation[2] = r.z, orientation[3] = r.w;
  }
  return nb::make_tuple(to_numpy<Matrix>(std::move(positions), {k, 3}),
                        to_numpy<Matrix>(std::move(orientations), {k, 4}));
}

const double* rows_of(const Doubles& array, const char* name, size_t columns) {
  if (array.ndim() != 2 || array.shape(1) != columns)
    fail(name, "must have the shape (n, " + std::to_string(columns) + "), not " + shape_text(array));
  return array.data();
}

Matrix chosen_frames(nb::handle positions_given, nb::handle quaternions_given, nb::handle which_given) {
  const Doubles positions = to_doubles(positions_given, "positions", "an array of shape (n, 3)");
  const Doubles quaternions = to_doubles(quaternions_given, "quaternions", "an array of shape (n, 4)");
  const std::vector<std::int64_t> which = to_indices(which_given, "which");
  const double *p = rows_of(positions, "positions", 3), *q = rows_of(quaternions, "quaternions", 4);
  const size_t n = positions.shape(0);
  if (quaternions.shape(0) != n) fail("quaternions", "must have a row for each of `positions`");
  std::vector<double> frames;
  frames.reserve(7 * which.size());
  for (std::int64_t i : which) {
    if (i < 0 || i >= std::int64_t(n)) fail("which", "must index the positions");
    const double *x = p + 3 * i, *wxyz = q + 4 * i;
    frames.insert(frames.end(), {x[0], x[1], x[2], wxyz[1], wxyz[2], wxyz[3], wxyz[0]});
  }
  return to_numpy<Matrix>(std::move(frames), {which.size(), 7});
}

bool finite_within(nb::handle positions_given, nb::handle orientations_given, double farthest) {
  const Doubles positions = to_doubles(positions_given, "positions", "an array of numbers");
  const Doubles orientations = to_doubles(orientations_given, "orientations", "an array of numbers");
  return std::all_of(positions.data(), positions.data() + positions.size(),
                     [&](double x) { return std::abs(x) < farthest; }) &&
         std::all_of(orientations.data(), orientations.data() + orientations.size(),
                     [](double x) { return std::isfinite(x); });
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
  m.def("chosen_frames", &chosen_frames, "positions"_a, "quaternions"_a, "which"_a,
        nb::sig("def chosen_frames(positions: numpy.typing.ArrayLike, quaternions: numpy.typing.ArrayLike, which: "
                "numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]"),
        R"((k, 7) positions and quaternions xyzw in the rows `which`, for `world_poses`; `quaternions` are wxyz.)");
  m.def("finite_within", &finite_within, "positions"_a, "orientations"_a, "farthest"_a,
        nb::sig("def finite_within(positions: numpy.typing.ArrayLike, orientations: numpy.typing.ArrayLike, farthest: "
                "float) -> bool"),
        "Whether all numbers are finite, and those of the positions less than `farthest` in size.");
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
