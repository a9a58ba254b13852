#include "batch/box_of_corners.h"
#include "batch/shape_array.h"
#include "geometry/cancellation.h"
#include "python/arrays.h"
#include "shapes/limits.h"

namespace overlapper::python {
namespace {

using Cube = nb::ndarray<nb::numpy, const double, nb::ndim<3>>;

/// An empty list, which has no columns. It stands for no rows of any length.
bool no_rows(const Doubles& array) { return array.ndim() == 1 && array.shape(0) == 0; }

/// Numbers in rows of one length; a row of one number is an entry of a flat array.
struct Rows {
  Doubles array;
  std::string name;
  size_t columns;

  Rows(nb::handle given, std::string called, size_t in_a_row, const std::string& expected)
      : array(to_doubles(given, called, "an array of numbers of shape " + expected)),
        name(std::move(called)),
        columns(in_a_row) {
    const bool flat = columns == 1;
    if (!no_rows(array) && (array.ndim() != (flat ? 1 : 2) || (!flat && array.shape(1) != columns)))
      fail(name, "must be an array of numbers of shape " + expected + ", not of shape " + shape_text(array));
  }

  size_t size() const { return array.shape(0); }
  const double* operator[](size_t i) const { return array.data() + columns * i; }
  Vec3 vector(size_t i) const { return {(*this)[i][0], (*this)[i][1], (*this)[i][2]}; }
  std::string row(size_t i) const { return row_name(name, i); }
  static std::string row_name(const std::string& name, size_t i) { return name + "[" + std::to_string(i) + "]"; }

  void must_have(size_t n, const char* of) const {
    if (size() != n)
      fail(name, "must have a row for each of the " + std::to_string(n) + " " + of + ", not " + std::to_string(size()));
  }
};

/// The sentence of the core about one shape or pose, with the name of the array and the row.
[[noreturn]] void fail_in_row(const std::string& sentence, size_t i) {
  static constexpr std::array<std::pair<const char*, const char*>, 6> kPlurals{{{"half_extents", "sizes"},
                                                                                {"radius", "radii"},
                                                                                {"length", "lengths"},
                                                                                {"half_axes", "half_axes"},
                                                                                {"position", "positions"},
                                                                                {"orientation", "orientations"}}};
  const size_t space = sentence.find(' ');
  for (const auto& [one, many] : kPlurals)
    if (sentence.compare(0, space, one) == 0)
      throw nb::value_error((Rows::row_name(many, i) + sentence.substr(space)).c_str());
  throw nb::value_error((sentence + ", in row " + std::to_string(i)).c_str());
}

/// Unit quaternions of matrices (n, 3, 3), or quaternions (n, 4) as given.
std::vector<Quaternion> to_quaternions(nb::handle given, size_t n, const char* of) {
  if (given.is_none()) return std::vector<Quaternion>(n);
  const std::string name = "orientations", expected = "an array of shape (n, 4) or (n, 3, 3)";
  const nb::object numbers = nb::hasattr(given, "as_quat") ? given.attr("as_quat")() : nb::borrow(given);
  const Doubles array = to_doubles(numbers, name, expected);
  const bool matrices = array.ndim() == 3 && array.shape(1) == 3 && array.shape(2) == 3;
  if (!matrices && !no_rows(array) && (array.ndim() != 2 || array.shape(1) != 4))
    fail(name, "must be " + expected + ", not of shape " + shape_text(array));
  if (array.shape(0) != n)
    fail(name,
         "must have a row for each of the " + std::to_string(n) + " " + of + ", not " + std::to_string(array.shape(0)));
  std::vector<Quaternion> rows;
  rows.reserve(n);
  for (size_t i = 0; i < n; ++i) {
    const double* p = array.data() + (matrices ? 9 : 4) * i;
    if (!matrices) {
      rows.push_back({p[0], p[1], p[2], p[3]});
      continue;
    }
    const std::array<double, 16> matrix{p[0], p[1], p[2], 0, p[3], p[4], p[5], 0, p[6], p[7], p[8], 0, 0, 0, 0, 1};
    rows.push_back(matrix_pose(matrix, Rows::row_name(name, i)).second);
  }
  return rows;
}

/// Shapes of one kind. `make` gives the shape of a row.
template <class Make>
ShapeArray placed_rows(const char* kind, size_t n, nb::handle positions, nb::handle orientations, const Make& make) {
  std::optional<Rows> at;
  if (!positions.is_none()) at.emplace(positions, "positions", 3, "(n, 3)"), at->must_have(n, kind);
  const std::vector<Quaternion> turned = to_quaternions(orientations, n, kind);
  ShapeArray made{kind, {}};
  made.rows.reserve(n);
  for (size_t i = 0; i < n; ++i) try {
      made.rows.push_back(make_placed(make(i), at ? at->vector(i) : Vec3{}, turned[i]));
    } catch (const std::invalid_argument& error) {
      fail_in_row(error.what(), i);
    }
  return made;
}

ShapeArray boxes(nb::handle sizes, nb::handle positions, nb::handle orientations) {
  const Rows rows(sizes, "sizes", 3, "(n, 3)");
  return placed_rows("boxes", rows.size(), positions, orientations, [&](size_t i) {
    const Vec3 size = rows.vector(i);
    for (int k = 0; k < 3; ++k) require_size(size[k], "half_extents");
    return Box::make(size / 2);
  });
}

ShapeArray spheres(nb::handle radii, nb::handle positions) {
  const Rows rows(radii, "radii", 1, "(n,)");
  return placed_rows("spheres", rows.size(), positions, nb::none(), [&](size_t i) { return Sphere::make(*rows[i]); });
}

template <class S>
ShapeArray long_bodies(const char* kind, nb::handle radii, nb::handle lengths, nb::handle positions,
                       nb::handle orientations) {
  const Rows radius(radii, "radii", 1, "(n,)"), length(lengths, "lengths", 1, "(n,)");
  length.must_have(radius.size(), kind);
  return placed_rows(kind, radius.size(), positions, orientations,
                     [&](size_t i) { return S::make(*radius[i], *length[i]); });
}

ShapeArray ellipsoids(nb::handle half_axes, nb::handle positions, nb::handle orientations) {
  const Rows rows(half_axes, "half_axes", 3, "(n, 3)");
  return placed_rows("ellipsoids", rows.size(), positions, orientations,
                     [&](size_t i) { return Ellipsoid::make(rows.vector(i)); });
}

ShapeArray rectangles(nb::handle given, const std::string& name) {
  const Rows rows(given, name, 5, "(n, 5): x, y, width, height, angle");
  ShapeArray made{"rectangles", {}, true};
  made.rows.reserve(rows.size());
  for (size_t i = 0; i < rows.size(); ++i) {
    const double* r = rows[i];
    const std::string row = rows.row(i);
    try {
      for (int k : {2, 3}) require_size(r[k], row.c_str());
      if (!std::isfinite(r[4])) fail(row, "must be finite");
      made.rows.push_back(
          make_placed(Box({r[2] / 2, r[3] / 2, 0.5}), {r[0], r[1], 0}, {0, 0, std::sin(r[4] / 2), std::cos(r[4] / 2)}));
    } catch (const std::invalid_argument& error) {
      const std::string sentence = error.what();
      fail(row, sentence.substr(sentence.find(' ') + 1));
    }
  }
  return made;
}

/// Corners farther off their box are refused: a thousandth of the longest side, and what float32 rounds.
double most_off(const FittedBox& box, const BoxCorners& corners) {
  double farthest = 0;
  for (Vec3 corner : corners) farthest = std::max(farthest, max_component(abs(corner)));
  return std::max(1e-3 * max_component(box.sizes), 0x1p-22 * farthest);
}

nb::tuple fit_boxes(nb::handle given, const std::string& name) {
  const std::string expected = "an array of numbers of shape (n, 8, 3)";
  const Doubles array = to_doubles(given, name, expected);
  if (!no_rows(array) && (array.ndim() != 3 || array.shape(1) != 8 || array.shape(2) != 3))
    fail(name, "must be " + expected + ", not of shape " + shape_text(array));
  const size_t n = array.shape(0);
  std::vector<double> sizes, centres, orientations;
  std::vector<int> order;
  for (size_t i = 0; i < n; ++i) {
    BoxCorners corners;
    for (size_t c = 0; c < 8; ++c) {
      const double* p = array.data() + 24 * i + 3 * c;
      corners[c] = {p[0], p[1], p[2]};
      if (!finite(corners[c])) fail(Rows::row_name(name, i), "must be finite");
    }
    const FittedBox first = box_of_corners(corners, std::numeric_limits<double>::infinity());
    const double within = most_off(first, corners);
    const FittedBox box = first.off <= within ? first : box_of_corners(corners, within);
    if (!(std::min({box.sizes.x, box.sizes.y, box.sizes.z}) > 0))
      fail(Rows::row_name(name, i), "must be the corners of a box with a volume");
    if (!(box.off <= most_off(box, corners)))
      fail(Rows::row_name(name, i),
           "must be the 8 corners of a box; one is " + number(box.off) + " m off the box that fits best");
    const Quaternion q = rotation_quaternion(box.axes);
    sizes.insert(sizes.end(), {box.sizes.x, box.sizes.y, box.sizes.z});
    centres.insert(centres.end(), {box.centre.x, box.centre.y, box.centre.z});
    orientations.insert(orientations.end(), {q.x, q.y, q.z, q.w});
    order.insert(order.end(), box.order.begin(), box.order.end());
  }
  return nb::make_tuple(to_numpy<Matrix>(std::move(sizes), {n, 3}), to_numpy<Matrix>(std::move(centres), {n, 3}),
                        to_numpy<Matrix>(std::move(orientations), {n, 4}),
                        to_numpy<IndexMatrix>(std::move(order), {n, 8}));
}

/// Rows with rows, or all rows of one array with all rows of the other.
Pairing to_pairing(const ShapeArray& a, const ShapeArray& b, bool aligned) {
  const bool both = a.size() && b.size();
  if (both && a.planar != b.planar) fail("b", std::string("must be rectangles if a is, and only then"));
  if (aligned && a.size() != b.size())
    fail("b", "must have as many rows as a, " + std::to_string(a.size()) + ", not " + std::to_string(b.size()));
  return aligned ? Pairing::kRows : Pairing::kAll;
}

/// Runs `work`, which returns false if it is cancelled, while other Python threads run.
template <class Work>
void uninterrupted(const Work& work) {
  bool finished = false;
  {
    const nb::gil_scoped_release release;
    try {
      finished = work();
    } catch (const Cancelled&) {
      // The handler's exception follows.
    }
  }
  if (!finished) throw nb::python_error();
}

/// A number for each pair: (n,) for aligned rows, otherwise (n, m). `find(pairing, values)` writes them.
template <class Find>
nb::object values_of_pairs(const ShapeArray& a, const ShapeArray& b, bool aligned, const Find& find) {
  const Pairing pairing = to_pairing(a, b, aligned);
  std::vector<double> values(aligned ? a.size() : a.size() * b.size());
  uninterrupted([&] { return find(pairing, std::span(values)); });
  if (aligned) return nb::cast(to_numpy<Vector>(std::move(values), {a.size()}), nb::rv_policy::move);
  return nb::cast(to_numpy<Matrix>(std::move(values), {a.size(), b.size()}), nb::rv_policy::move);
}

void define_class(nb::module_& m) {
  nb::class_<ShapeArray> cls(
      m, "ShapeArray", R"(Placed shapes of one kind, a row each. The functions of `overlapper.arrays` make them.)");
  cls.def("__len__", &ShapeArray::size);
  cls.def(
      "__getitem__",
      [](const ShapeArray& rows, std::int64_t i) {
        const auto n = static_cast<std::int64_t>(rows.size());
        if (i < -n || i >= n) throw nb::index_error("row index out of range");
        return rows.rows[i < 0 ? i + n : i];
      },
      "row"_a);
  cls.def("__repr__",
          [](const ShapeArray& rows) { return "ShapeArray(" + std::to_string(rows.size()) + " " + rows.kind + ")"; });
  cls.def_prop_ro(
      "kind", [](const ShapeArray& rows) { return rows.kind; },
      "'boxes', 'rectangles', 'spheres', 'capsules', 'cylinders' or 'ellipsoids'.");
  array_property(
      cls, "volume",
      [](const ShapeArray& rows) {
        std::vector<double> volumes;
        for (const Placed& row : rows.rows) volumes.push_back(volume(row.shape));
        const size_t n = volumes.size();
        return to_numpy<Vector>(std::move(volumes), {n});
      },
      "(n,) m³ of each row; m² of rectangles.");
  array_property(
      cls, "positions",
      [](const ShapeArray& rows) {
        std::vector<Vec3> positions;
        for (const Placed& row : rows.rows) positions.push_back(row.position);
        return to_numpy(positions);
      },
      "(n, 3) positions of the centres, m.");
  cls.def_prop_ro(
      "rotations",
      [](const ShapeArray& rows) {
        std::vector<double> values;
        for (const Placed& row : rows.rows)
          for (Vec3 v : {row.pose.rotation.row0, row.pose.rotation.row1, row.pose.rotation.row2})
            values.insert(values.end(), {v.x, v.y, v.z});
        return nb::cast(to_numpy<Cube>(std::move(values), {rows.size(), 3, 3}), nb::rv_policy::move);
      },
      nb::sig("def rotations(self) -> numpy.typing.NDArray[numpy.float64]"),
      "(n, 3, 3) rotation matrices, from the coordinates of each shape to the world.");
  cls.def_prop_ro(
      "bounds",
      [](const ShapeArray& rows) {
        std::vector<double> values;
        for (const Placed& row : rows.rows) {
          const Bounds box = bounds(row);
          for (Vec3 v : {box.lower, box.upper}) values.insert(values.end(), {v.x, v.y, v.z});
        }
        return nb::cast(to_numpy<Cube>(std::move(values), {rows.size(), 2, 3}), nb::rv_policy::move);
      },
      nb::sig("def bounds(self) -> numpy.typing.NDArray[numpy.float64]"),
      "(n, 2, 3) lower and upper corner of the bounding box of each row, m.");
}

#define OVERLAPPER_POSE_ROWS \
  "positions: numpy.typing.ArrayLike | None = None, orientations: numpy.typing.ArrayLike | None = None"

void define_makers(nb::module_& m) {
  const char* about = "Documented in overlapper.arrays.";
  m.def("boxes", &boxes, "sizes"_a.none(), "positions"_a.none() = nb::none(), "orientations"_a.none() = nb::none(),
        nb::sig("def boxes(sizes: numpy.typing.ArrayLike, " OVERLAPPER_POSE_ROWS ") -> ShapeArray"), about);
  m.def("spheres", &spheres, "radii"_a.none(), "positions"_a.none() = nb::none(),
        nb::sig("def spheres(radii: numpy.typing.ArrayLike, positions: numpy.typing.ArrayLike | None = None) -> "
                "ShapeArray"),
        about);
  m.def(
      "capsules",
      [](nb::handle radii, nb::handle lengths, nb::handle positions, nb::handle orientations) {
        return long_bodies<Capsule>("capsules", radii, lengths, positions, orientations);
      },
      "radii"_a.none(), "lengths"_a.none(), "positions"_a.none() = nb::none(), "orientations"_a.none() = nb::none(),
      nb::sig("def capsules(radii: numpy.typing.ArrayLike, lengths: numpy.typing.ArrayLike, " OVERLAPPER_POSE_ROWS
              ") -> ShapeArray"),
      about);
  m.def(
      "cylinders",
      [](nb::handle radii, nb::handle lengths, nb::handle positions, nb::handle orientations) {
        return long_bodies<Cylinder>("cylinders", radii, lengths, positions, orientations);
      },
      "radii"_a.none(), "lengths"_a.none(), "positions"_a.none() = nb::none(), "orientations"_a.none() = nb::none(),
      nb::sig("def cylinders(radii: numpy.typing.ArrayLike, lengths: numpy.typing.ArrayLike, " OVERLAPPER_POSE_ROWS
              ") -> ShapeArray"),
      about);
  m.def("ellipsoids", &ellipsoids, "half_axes"_a.none(), "positions"_a.none() = nb::none(),
        "orientations"_a.none() = nb::none(),
        nb::sig("def ellipsoids(half_axes: numpy.typing.ArrayLike, " OVERLAPPER_POSE_ROWS ") -> ShapeArray"), about);
  m.def("rectangles", &rectangles, "rectangles"_a.none(), "name"_a,
        nb::sig("def rectangles(rectangles: numpy.typing.ArrayLike, name: str) -> ShapeArray"), about);
  m.def(
      "fit_boxes", &fit_boxes, "corners"_a.none(), "name"_a,
      nb::sig("def fit_boxes(corners: numpy.typing.ArrayLike, name: str) -> "
              "tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], "
              "numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.int32]]"),
      R"(The boxes of (n, 8, 3) corners: (n, 3) sizes and (n, 3) positions in m, (n, 4) quaternions xyzw, and (n, 8) the index
of the given corner at each place of pytorch3d's order. `name` is the argument in messages.)");
}

void define_values(nb::module_& m) {
  m.def(
      "common_volumes",
      [](const ShapeArray& a, const ShapeArray& b, bool aligned, nb::handle tolerance_given, nb::handle threads_given) {
        const double tolerance = to_tolerance(tolerance_given);
        const int threads = to_threads(threads_given);
        return values_of_pairs(a, b, aligned, [&](Pairing pairing, std::span<double> volumes) {
          return common_volumes(a, b, pairing, tolerance, threads, volumes);
        });
      },
      "a"_a, "b"_a, "aligned"_a, "tolerance"_a.none(), "threads"_a.none(),
      nb::sig("def common_volumes(a: ShapeArray, b: ShapeArray, aligned: bool, tolerance: float, threads: int | None) "
              "-> numpy.typing.NDArray[numpy.float64]"),
      "Common volumes in m³: (n,) of row i of both, or (n, m) of every row of `a` with every row of `b`.");
  m.def(
      "volumes_around",
      [](const ShapeArray& a, const ShapeArray& b, bool aligned, nb::handle threads_given) {
        for (const auto& [rows, name] : {std::pair{&a, "a"}, {&b, "b"}})
          for (const Placed& row : rows->rows)
            if (!std::holds_alternative<Box>(row.shape)) fail(name, "must be boxes or rectangles");
        const int threads = to_threads(threads_given);
        return values_of_pairs(a, b, aligned, [&](Pairing pairing, std::span<double> volumes) {
          return volumes_around(a, b, pairing, threads, volumes);
        });
      },
      "a"_a, "b"_a, "aligned"_a, "threads"_a.none(),
      nb::sig("def volumes_around(a: ShapeArray, b: ShapeArray, aligned: bool, threads: int | None) -> "
              "numpy.typing.NDArray[numpy.float64]"),
      "Volumes in m³ of the convex hull of each pair of boxes, as `common_volumes` arranges them.");
}

/// The weights of pairs, arranged as their values.
Doubles to_weights(nb::handle given, const ShapeArray& a, const ShapeArray& b, bool aligned) {
  const Doubles weights = to_doubles(given, "weights", "an array of numbers, one for each pair");
  const bool fits = aligned ? weights.ndim() == 1 && weights.shape(0) == a.size()
                            : weights.ndim() == 2 && weights.shape(0) == a.size() && weights.shape(1) == b.size();
  if (!fits) fail("weights", "must be an array of numbers, one for each pair, not of shape " + shape_text(weights));
  return weights;
}

nb::tuple gradients_of_rows(std::span<const RowGradient> rows) {
  nb::list columns;
  for (Vec3 RowGradient::* column : {&RowGradient::shape, &RowGradient::position, &RowGradient::rotation}) {
    std::vector<Vec3> values;
    for (const RowGradient& row : rows) values.push_back(row.*column);
    columns.append(nb::cast(to_numpy(std::span<const Vec3>(values)), nb::rv_policy::move));
  }
  return nb::tuple(columns);
}

void define_gradients(nb::module_& m) {
  m.def(
      "volume_gradients",
      [](const ShapeArray& a, const ShapeArray& b, nb::handle weights_given, bool aligned, nb::handle tolerance_given,
         nb::handle threads_given) {
        const Pairing pairing = to_pairing(a, b, aligned);
        const Doubles weights = to_weights(weights_given, a, b, aligned);
        const double tolerance = to_tolerance(tolerance_given);
        const int threads = to_threads(threads_given);
        std::vector<RowGradient> of_a(a.size()), of_b(b.size());
        uninterrupted([&] {
          return add_gradients(a, b, pairing, std::span(weights.data(), weights.size()), tolerance, threads, of_a,
                               of_b);
        });
        return nb::make_tuple(gradients_of_rows(of_a), gradients_of_rows(of_b));
      },
      "a"_a, "b"_a, "weights"_a.none(), "aligned"_a, "tolerance"_a.none(), "threads"_a.none(),
      nb::sig(
          "def volume_gradients(a: ShapeArray, b: ShapeArray, weights: numpy.typing.ArrayLike, aligned: bool, "
          "tolerance: float, threads: int | None) -> "
          "tuple[tuple[numpy.typing.NDArray[numpy.float64], ...], tuple[numpy.typing.NDArray[numpy.float64], ...]]"),
      R"(The derivatives of the weighted sum of common volumes, for the rows of `a` and of `b`: (n, 3) by the numbers of the
shape as in Overlap.shape_gradient, (n, 3) by the position, and (n, 3) by a rotation vector about the position.)");
}

/// Directions: a row of nine numbers for each row of an array, in the order of RowGradient.
std::vector<RowGradient> to_directions(nb::handle given, const char* name, const ShapeArray& rows) {
  const Rows numbers(given, name, 9, "(n, 9)");
  numbers.must_have(rows.size(), rows.kind);
  std::vector<RowGradient> directions;
  for (size_t i = 0; i < rows.size(); ++i) {
    const double* d = numbers[i];
    directions.push_back({{d[0], d[1], d[2]}, {d[3], d[4], d[5]}, {d[6], d[7], d[8]}});
  }
  return directions;
}

void define_second_derivatives(nb::module_& m) {
  m.def(
      "volume_second_derivatives",
      [](const ShapeArray& a, const ShapeArray& b, nb::handle weights_given, nb::handle along_a, nb::handle along_b,
         bool aligned, nb::handle tolerance_given, nb::handle threads_given) {
        const Pairing pairing = to_pairing(a, b, aligned);
        const Doubles weights = to_weights(weights_given, a, b, aligned);
        const std::vector<RowGradient> by_a = to_directions(along_a, "along_a", a);
        const std::vector<RowGradient> by_b = to_directions(along_b, "along_b", b);
        const double tolerance = to_tolerance(tolerance_given);
        const int threads = to_threads(threads_given);
        std::vector<double> slopes(weights.size());
        std::vector<RowGradient> of_a(a.size()), of_b(b.size());
        uninterrupted([&] {
          return add_second_derivatives(a, b, pairing, std::span(weights.data(), weights.size()), by_a, by_b, tolerance,
                                        threads, slopes, of_a, of_b);
        });
        const size_t count = slopes.size();
        return nb::make_tuple(to_numpy<Vector>(std::move(slopes), {count}), gradients_of_rows(of_a),
                              gradients_of_rows(of_b));
      },
      "a"_a, "b"_a, "weights"_a.none(), "along_a"_a.none(), "along_b"_a.none(), "aligned"_a, "tolerance"_a.none(),
      "threads"_a.none(),
      nb::sig("def volume_second_derivatives(a: ShapeArray, b: ShapeArray, weights: numpy.typing.ArrayLike, along_a: "
              "numpy.typing.ArrayLike, along_b: numpy.typing.ArrayLike, aligned: bool, tolerance: float, threads: int "
              "| None) -> tuple[numpy.typing.NDArray[numpy.float64], tuple[numpy.typing.NDArray[numpy.float64], ...], "
              "tuple[numpy.typing.NDArray[numpy.float64], ...]]"),
      R"(The second derivatives of the weighted sum of common volumes of polyhedra, times a direction, as `volume_gradients`
arranges them. Before them, flat, the derivative of each pair's volume along the direction. A row of `along_a` (n, 9) and
`along_b` (m, 9) has the numbers of the shape, the position and the rotation vector.)");
}

}  // namespace

void define_shape_arrays(nb::module_& m) {
  define_class(m);
  define_makers(m);
  define_values(m);
  define_gradients(m);
  define_second_derivatives(m);
}

}  // namespace overlapper::python
