#include "python/batch.h"

#include <thread>

#include "batch/batch.h"

namespace overlapper::python {
namespace {

std::vector<double> to_pose_rows(const Doubles& array, const std::string& name, size_t k, size_t columns) {
  if (array.ndim() != 2 || array.shape(0) != k || array.shape(1) != columns)
    fail(name, "must be an array of shape (k, " + std::to_string(columns) + "), one row per shape, not of shape " +
                   shape_text(array));
  return {array.data(), array.data() + k * columns};
}

}  // namespace

std::vector<Shape> to_shapes(nb::handle given) {
  if (nb::isinstance<Batch>(given)) return nb::cast<const Batch&>(given).shapes();
  if (!PySequence_Check(given.ptr())) throw nb::type_error("shapes must be a sequence of shapes");
  std::vector<Shape> shapes;
  for (nb::handle shape : nb::list(given))
    shapes.push_back(to_shape(shape, "shapes[" + std::to_string(shapes.size()) + "]"));
  return shapes;
}

PoseRows to_poses(nb::handle positions, nb::handle orientations, size_t k, const std::string& prefix) {
  const std::string of_positions = prefix + "positions", of_orientations = prefix + "orientations";
  const Doubles given = to_doubles(positions, of_positions, "an array of shape (k, 3) or (k, 4, 4), one row per shape");
  const bool matrices = given.ndim() == 3;
  if (matrices && (given.shape(0) != k || given.shape(1) != 4 || given.shape(2) != 4))
    fail(of_positions,
         "must be an array of shape (k, 3) or (k, 4, 4), one row per shape, not of shape " + shape_text(given));
  if (matrices != orientations.is_none())
    fail(of_orientations, matrices ? "must be left out if the positions are matrices"
                                   : "must be given, unless the positions are matrices of shape (k, 4, 4)");
  if (!matrices)
    return {to_pose_rows(given, of_positions, k, 3),
            to_pose_rows(to_doubles(orientations, of_orientations, "an array of shape (k, 4), one row per shape"),
                         of_orientations, k, 4)};
  PoseRows rows;
  for (size_t i = 0; i < k; ++i) {
    const std::span<const double, 16> matrix(given.data() + 16 * i, 16);
    const auto [p, q] = matrix_pose(matrix, of_positions + "[" + std::to_string(i) + "]");
    rows.positions.insert(rows.positions.end(), {p.x, p.y, p.z});
    rows.orientations.insert(rows.orientations.end(), {q.x, q.y, q.z, q.w});
  }
  return rows;
}

std::vector<IndexPair> to_pairs(nb::handle given, size_t k) {
  const std::vector<std::int64_t> flat = to_indices(given, "pairs", 2);
  std::vector<IndexPair> pairs;
  pairs.reserve(flat.size() / 2);
  for (std::int64_t i : flat)
    if (i < 0 || i >= static_cast<std::int64_t>(k))
      fail("pairs", "must index the " + std::to_string(k) + " shapes, not " + std::to_string(i));
  for (size_t i = 0; i < flat.size(); i += 2)
    pairs.push_back({static_cast<int>(flat[i]), static_cast<int>(flat[i + 1])});
  return pairs;
}

std::string any_shapes() { return "collections.abc.Sequence[" + any_solid() + "]"; }

namespace {

nb::object overlaps_among(Batch& batch, nb::handle positions, nb::handle orientations, nb::handle pairs,
                          nb::handle tolerance_given, nb::handle threads_given, nb::handle method_name, bool separated,
                          const PairMask* mask) {
  const size_t k = batch.shapes().size();
  const auto [p, q] = to_poses(positions, orientations, k);
  const double tolerance = to_double(tolerance_given, "tolerance");
  const int threads = to_threads(threads_given);
  const Method method = to_method(method_name);
  std::optional<std::vector<IndexPair>> given;
  if (!pairs.is_none()) given = to_pairs(pairs, k);
  const std::optional<std::span<const IndexPair>> span = given;
  bool finished = false;
  Overlaps found;
  {
    const nb::gil_scoped_release release;
    found = batch.overlaps(p, q, span, given && separated, tolerance, method, threads, finished, mask);
  }
  nb::object answer = nb::cast(std::move(found));
  if (finished) return answer;
  nb::python_error interruption;
  interruption.value().attr("overlaps") = answer;
  throw interruption;
}

nb::object batch_overlaps(Batch& batch, nb::handle positions, nb::handle orientations, nb::handle pairs,
                          nb::handle tolerance, nb::handle threads, nb::handle method, bool separated) {
  return overlaps_among(batch, positions, orientations, pairs, tolerance, threads, method, separated, nullptr);
}

PairMask to_mask(nb::handle groups_given, nb::handle table_given) {
  PairMask mask;
  for (std::int64_t group : to_indices(groups_given, "groups")) mask.group.push_back(static_cast<int>(group));
  const auto table = nb::cast<nb::ndarray<const bool, nb::ndim<2>, nb::c_contig, nb::device::cpu>>(table_given, false);
  mask.groups = table.shape(0);
  if (table.shape(1) != mask.groups) fail("table", "must have as many columns as rows");
  for (int group : mask.group)
    if (group < 0 || group >= static_cast<int>(mask.groups)) fail("groups", "must be rows of the table");
  mask.table.assign(table.data(), table.data() + table.size());
  return mask;
}

/// A row of `geoms` has the numbers of a WeldRule::Geom, in their order.
WeldRule to_rule(nb::handle geoms_given, nb::handle excluded_given, nb::handle listed_given, bool by_parent,
                 bool none) {
  WeldRule rule;
  const std::vector<std::int64_t> geoms = to_indices(geoms_given, "geoms", 7);
  for (size_t i = 0; i < geoms.size(); i += 7) {
    const auto at = [&](size_t k) { return static_cast<int>(geoms[i + k]); };
    rule.geoms.push_back({at(0), at(1), at(2), at(3), at(4), at(5) != 0, at(6) != 0});
  }
  const auto count = static_cast<std::int64_t>(rule.geoms.size());
  rule.excluded = to_indices(excluded_given, "excluded");
  const std::vector<std::int64_t> listed = to_indices(listed_given, "listed", 2);
  for (size_t i = 0; i < listed.size(); i += 2) {
    const auto [a, b] = std::minmax(listed[i], listed[i + 1]);
    if (a < 0 || b >= count) fail("listed", "must have rows of geoms");
    rule.listed.push_back(a * count + b);
  }
  std::ranges::sort(rule.excluded), std::ranges::sort(rule.listed);
  rule.by_parent = by_parent, rule.none = none;
  return rule;
}

nb::object allowed(const WeldRule& rule, nb::handle first_given, nb::handle second_given, bool listed) {
  const std::vector<std::int64_t> first = to_indices(first_given, "first"), second = to_indices(second_given, "second");
  if (first.size() != second.size()) fail("second", "must be as long as first");
  const auto count = static_cast<std::int64_t>(rule.geoms.size());
  auto* flags = new std::vector<char>();
  const nb::capsule owner(flags, [](void* p) noexcept { delete static_cast<std::vector<char>*>(p); });
  for (size_t i = 0; i < first.size(); ++i) {
    if (std::min(first[i], second[i]) < 0 || std::max(first[i], second[i]) >= count) fail("first", "must index geoms");
    const int a = static_cast<int>(first[i]), b = static_cast<int>(second[i]);
    flags->push_back(listed ? rule.admits(a, b) : rule.admits_unlisted(a, b));
  }
  using Flags = nb::ndarray<nb::numpy, bool, nb::ndim<1>>;
  return nb::cast(Flags(flags->data(), {flags->size()}, owner));
}

std::int64_t count_of(const WeldRule& rule, nb::handle weights_given) {
  const std::vector<std::int64_t> weights = to_indices(weights_given, "weights");
  if (weights.size() != rule.geoms.size()) fail("weights", "must be one for each geom");
  std::int64_t total = 0;
  for (int a = 0; a < static_cast<int>(weights.size()); ++a) {
    if (weights[a] == 0) continue;
    for (int b = a + 1; b < static_cast<int>(weights.size()); ++b)
      if (weights[b] != 0 && rule.admits(a, b)) total += weights[a] * weights[b];
  }
  return total;
}

PairMask mask_of_rule(nb::handle groups_given, const WeldRule& rule) {
  PairMask mask;
  for (std::int64_t group : to_indices(groups_given, "groups")) {
    if (group < 0 || group >= static_cast<std::int64_t>(rule.geoms.size())) fail("groups", "must be geoms of the rule");
    mask.group.push_back(static_cast<int>(group));
  }
  mask.rule = std::make_shared<const WeldRule>(rule);
  return mask;
}

nb::object masked_overlaps(Batch& batch, nb::handle positions, nb::handle orientations, const PairMask& mask,
                           nb::handle tolerance, nb::handle threads, nb::handle method) {
  if (mask.group.size() != batch.shapes().size()) fail("mask", "must have a group for each shape of the batch");
  return overlaps_among(batch, positions, orientations, nb::none(), tolerance, threads, method, false, &mask);
}

nb::object candidates(Batch& batch, nb::handle positions, nb::handle orientations) {
  const size_t k = batch.shapes().size();
  const auto [p, q] = to_poses(positions, orientations, k);
  std::vector<IndexPair> pairs;
  {
    const nb::gil_scoped_release release;
    pairs = batch.candidate_pairs(p, q);
  }
  return nb::cast(to_numpy(std::span<const IndexPair>(pairs)), nb::rv_policy::move);
}

/// The numpy form of a column's element: numbers of one type, in a shape.
template <class T>
struct Numbers {
  using Type = T;
  static std::vector<size_t> shape() { return {}; }
};
template <>
struct Numbers<char> : Numbers<bool> {};
template <>
struct Numbers<Vec3> : Numbers<double> {
  static std::vector<size_t> shape() { return {3}; }
};
template <>
struct Numbers<Mat3> : Numbers<double> {
  static std::vector<size_t> shape() { return {3, 3}; }
};
template <class T, size_t n>
struct Numbers<std::array<T, n>> : Numbers<T> {
  static std::vector<size_t> shape() {
    std::vector<size_t> all = Numbers<T>::shape();
    all.insert(all.begin(), n);
    return all;
  }
};

template <class T>
constexpr const char* kNumpyName = nullptr;
template <>
constexpr const char* kNumpyName<double> = "float64";
template <>
constexpr const char* kNumpyName<int> = "int32";
template <>
constexpr const char* kNumpyName<std::int8_t> = "int8";
template <>
constexpr const char* kNumpyName<bool> = "bool_";

/// A read-only array over the vector `values(overlaps)`; the result keeps the vector alive.
template <class T, class Values>
void define_column(nb::class_<Overlaps>& cls, const char* name, Values values, const char* doc) {
  using Number = typename Numbers<T>::Type;
  const std::string type = kNumpyName<Number>;
  const std::string sig = "def " + std::string(name) + "(self) -> numpy.typing.NDArray[numpy." + type + "]";
  cls.def_prop_ro(
      name,
      [values](nb::handle self) {
        const std::vector<T>& elements = values(nb::cast<const Overlaps&>(self));
        std::vector<size_t> shape = Numbers<T>::shape();
        shape.insert(shape.begin(), elements.size());
        return nb::ndarray<nb::numpy, const Number>(reinterpret_cast<const Number*>(elements.data()), shape.size(),
                                                    shape.data(), self);
      },
      nb::rv_policy::reference, nb::sig(sig.c_str()), doc);
}

template <class T>
void define_column(nb::class_<Overlaps>& cls, const Column<T>& column) {
  const auto define = [&](auto values) { define_column<T>(cls, column.name, values, column.doc); };
  const auto lazily = [&](const std::vector<T>& (Overlaps::*find)() const) {
    define([find](const Overlaps& overlaps) -> const auto& {
      return unlocked([&]() -> const std::vector<T>& { return (overlaps.*find)(); });
    });
  };
  if constexpr (std::is_same_v<T, double>)
    if (column.values == &Overlaps::depth) return lazily(&Overlaps::depths);
  if constexpr (std::is_same_v<T, Vec3>)
    if (column.values == &Overlaps::normal) return lazily(&Overlaps::normals);
  define([member = column.values](const Overlaps& overlaps) -> const auto& { return overlaps.*member; });
}

/// The values of a column that is a member of what an Overlaps computes on first use.
template <class Table, class T>
auto lazy_column(const Table& (Overlaps::*compute)() const, std::vector<T> Table::* member) {
  return [compute, member](const Overlaps& overlaps) -> const auto& {
    return unlocked([&]() -> const Table& { return (overlaps.*compute)(); }).*member;
  };
}

template <class T>
void define_patch_column(nb::class_<Overlaps>& cls, const char* name, std::vector<T> Overlaps::Patches::* member,
                         const char* doc) {
  define_column<T>(cls, name, lazy_column(&Overlaps::patches, member), doc);
}

void define_errors_of_gradients(nb::class_<Overlaps>& cls) {
  define_column<BodyGradients>(
      cls, "gradient_error", lazy_column(&Overlaps::gradient_errors, &Gradients::pose),
      R"((p, 2, 6) error bounds of `gradient`, m² and m³, as Overlap.errors.gradient. The first use takes some hundreds of
microseconds for each pair of polyhedra, and longer for round bodies.)");
  define_column<ShapeGradients>(cls, "shape_gradient_error", lazy_column(&Overlaps::gradient_errors, &Gradients::shape),
                                "(p, 2, 3) error bounds of `shape_gradient`, m², as Overlap.errors.shape_gradient.");
  define_column<std::array<std::array<std::array<double, 6>, 3>, 2>>(
      cls, "centroid_gradient_error", lazy_column(&Overlaps::centroid_gradient_errors, &CentroidGradients::pose),
      R"((p, 2, 3, 6) error bounds of `centroid_gradient`, 1 and m, as Overlap.errors.centroid_gradient. The first use takes
some hundreds of microseconds for each pair of polyhedra, and longer for round bodies.)");
  define_column<std::array<Mat3, 2>>(
      cls, "centroid_shape_gradient_error", lazy_column(&Overlaps::centroid_gradient_errors, &CentroidGradients::shape),
      "(p, 2, 3, 3) error bounds of `centroid_shape_gradient`, as Overlap.errors.centroid_shape_gradient.");
}

void define_columns(nb::class_<Overlaps>& cls) {
  std::apply([&](const auto&... column) { (define_column(cls, column), ...); }, kColumns);
  define_column<double>(
      cls, "area",
      [](const Overlaps& overlaps) -> const auto& {
        return unlocked([&]() -> const std::vector<double>& { return overlaps.areas(); });
      },
      R"((p,) m², of the surface of the common set. Computed on the first use for pairs with an ellipsoid, which takes tens or
hundreds of microseconds for each.)");
  cls.def_prop_ro(
      "patch_area",
      [](nb::handle self) {
        const auto& gradient = nb::cast<const Overlaps&>(self).gradient;
        const double* first = gradient.empty() ? nullptr : &gradient[0][1][0];
        const size_t shape[2] = {gradient.size(), 3};
        const std::int64_t strides[2] = {12, 1};
        return nb::ndarray<nb::numpy, const double>(first, 2, shape, self, strides);
      },
      nb::rv_policy::reference, nb::sig("def patch_area(self) -> numpy.typing.NDArray[numpy.float64]"),
      "(p, 3) m², the area vector of the patch, from b to a; zeros unless overlapping.");
  define_column<ShapeGradients>(
      cls, "shape_gradient",
      [](const Overlaps& overlaps) -> const auto& {
        return unlocked([&]() -> const std::vector<ShapeGradients>& { return overlaps.shape_gradients(); });
      },
      R"((p, 2, 3) derivatives of the volume by the sizes of a and of b, m², as Overlap.shape_gradient; zeros unless
overlapping. The first use takes some microseconds for each pair of polyhedra.)");
  define_column<BodyGradients>(
      cls, "depth_gradient", lazy_column(&Overlaps::depth_gradients, &Gradients::pose),
      R"((p, 2, 6) derivatives of the depth by the poses of a and of b, as Overlap.depth_gradient; zeros unless
overlapping. The first use takes some microseconds for each pair.)");
  define_column<ShapeGradients>(
      cls, "depth_shape_gradient", lazy_column(&Overlaps::depth_gradients, &Gradients::shape),
      R"((p, 2, 3) derivatives of the depth by the sizes of a and of b, as Overlap.depth_shape_gradient; zeros unless
overlapping.)");
  define_errors_of_gradients(cls);
  define_column<std::array<std::array<std::array<double, 6>, 3>, 2>>(
      cls, "centroid_gradient", lazy_column(&Overlaps::centroid_gradients, &CentroidGradients::pose),
      R"((p, 2, 3, 6) derivatives of the centroid by the poses of a and of b, as Overlap.centroid_gradient; zeros unless
overlapping. The first use takes some tens of microseconds for each pair of polyhedra, and longer for round bodies.)");
  define_column<std::array<Mat3, 2>>(
      cls, "centroid_shape_gradient", lazy_column(&Overlaps::centroid_gradients, &CentroidGradients::shape),
      R"((p, 2, 3, 3) derivatives of the centroid by the sizes of a and of b, as Overlap.centroid_shape_gradient; zeros
unless overlapping.)");
  define_column<PoseHessian>(
      cls, "hessian",
      [](const Overlaps& overlaps) -> const auto& {
        return unlocked([&]() -> const std::vector<PoseHessian>& { return overlaps.hessians(); });
      },
      R"((p, 12, 12) second derivatives of the volume by the twelve numbers of `gradient`, as Overlap.hessian; zeros
unless overlapping. The first use takes some tens of microseconds for each pair of polyhedra, and longer for round bodies.)");
  define_patch_column(cls, "patch_centre", &Overlaps::Patches::centre,
                      R"((p, 3) m, the centre of that area in the plane through the centroid; NaN without an area. The
first use of the centre, the moments or the distance takes some microseconds for each pair.)");
  define_patch_column(cls, "patch_moments", &Overlaps::Patches::moments,
                      "(p, 3, 3) m⁴, ∫ x xᵀ dA of that area about its centre; zeros without an area.");
  define_patch_column(
      cls, "patch_distance", &Overlaps::Patches::distance,
      R"((p,) m, mean distance of the points of that area from the centroid, seen along the area vector; NaN
without an area.)");
}

/// A shared Overlap is copied into memory of Python: nanobind ends the process if it has no memory to share one.
nb::object overlap_of_row(const Overlaps& overlaps, size_t row) {
  std::shared_ptr<Overlap> found;
  {
    const nb::gil_scoped_release release;
    found = overlaps.overlap(row);
  }
  nb::object answer = nb::inst_alloc(nb::type<Overlap>());
  new (nb::inst_ptr<Overlap>(answer)) Overlap(found.use_count() == 1 ? Overlap(std::move(*found)) : Overlap(*found));
  nb::inst_mark_ready(answer);
  return answer;
}

const char* method_name(const Overlaps& o) { return o.method == Method::kAuto ? "auto" : "paper"; }

nb::list shape_list(const std::vector<Shape>& shapes) {
  nb::list list;
  for (const Shape& shape : shapes) list.append(to_python(shape));
  return list;
}

/// The inputs of the rows. Unpickling computes the arrays again, to the same bits.
nb::tuple state_of(const Overlaps& self) {
  std::vector<double> positions, orientations;
  for (const PoseNumbers& pose : *self.poses) {
    positions.insert(positions.end(), pose.begin(), pose.begin() + 3);
    orientations.insert(orientations.end(), pose.begin() + 3, pose.end());
  }
  const size_t k = self.poses->size();
  return nb::make_tuple(shape_list(*self.shapes), to_numpy<Matrix>(std::move(positions), {k, 3}),
                        to_numpy<Matrix>(std::move(orientations), {k, 4}),
                        to_numpy(std::span<const IndexPair>(self.pairs)), self.tolerance, method_name(self),
                        self.examined, self.planes_asked);
}

size_t to_count(nb::handle given) {
  std::int64_t count = 0;
  if (!nb::try_cast<std::int64_t>(given, count) || count < 0) throw nb::value_error("state must be that of overlaps");
  return static_cast<size_t>(count);
}

void set_state(Overlaps& self, nb::handle state) {
  if (!nb::isinstance<nb::tuple>(state) || nb::len(state) != 8) throw nb::value_error("state must be that of overlaps");
  const size_t examined = to_count(state[6]), planes_asked = to_count(state[7]);
  Batch batch(to_shapes(state[0]));
  const nb::object found = batch_overlaps(batch, state[1], state[2], state[3], state[4], nb::int_(1), state[5], true);
  new (&self) Overlaps(std::move(nb::cast<Overlaps&>(found)));
  self.examined = examined, self.planes_asked = planes_asked;
}

void define_overlaps_class(nb::module_& m) {
  nb::class_<Overlaps> cls(m, "Overlaps",
                           R"(Overlaps of many pairs of shapes: an array for each quantity, with a row for each pair.

Units are SI. Coordinates are world coordinates. The arrays are read-only views. `overlaps[i]` is the Overlap of row i,
with all its quantities. It is computed again, unless that took long and its Batch was not called since.
`overlaps[mask]`, a slice or an array of indices selects rows. A pickle has the shapes and poses. The rows are computed
again from them, bit-identically.)");
  define_columns(cls);
  for (const auto& [name, status] : {std::pair{"SEPARATED", Status::kSeparated},
                                     {"TOUCHING", Status::kTouching},
                                     {"OVERLAPPING", Status::kOverlapping}})
    cls.attr(name) = static_cast<int>(status);
  nb::list ways;
  for (const char* way : kWayNames) ways.append(way);
  cls.attr("WAYS") = nb::tuple(ways);
  cls.def_ro("examined", &Overlaps::examined,
             "Number of pairs that were examined: the given pairs, or those whose bounding boxes meet.");
  cls.def_ro(
      "planes_asked", &Overlaps::planes_asked,
      R"(Number of planes of the shapes that the call computed: to compare with vertices, to find where a ray leaves a
shape, or to find the plane nearest to a point.)");
  cls.def_ro("tolerance", &Overlaps::tolerance);
  cls.def_prop_ro("method", &method_name, nb::sig("def method(self) -> typing.Literal['auto', 'paper']"));
  cls.def("__len__", &Overlaps::size);
  cls.def(
      "__getitem__",
      [](const Overlaps& self, nb::handle key) -> nb::object {
        const nb::object rows = nb::module_::import_("numpy").attr("arange")(self.size())[key];
        if (nb::cast<int>(rows.attr("ndim")) == 0) return overlap_of_row(self, nb::cast<size_t>(nb::int_(rows)));
        const auto chosen = nb::cast<nb::ndarray<const std::int64_t, nb::ndim<1>, nb::device::cpu>>(rows);
        std::vector<std::int64_t> indices;
        for (size_t i = 0; i < chosen.shape(0); ++i) indices.push_back(chosen(i));
        return nb::cast(self.select(indices));
      },
      "row"_a, nb::sig("def __getitem__(self, row: typing.Any) -> typing.Any"));
  cls.def("__repr__", [](const Overlaps& self) {
    const auto overlapping = std::count(self.status.begin(), self.status.end(), int(Status::kOverlapping));
    return "Overlaps(" + std::to_string(self.size()) + " pairs, " + std::to_string(overlapping) + " overlapping)";
  });
  cls.def("__getstate__", &state_of, nb::sig("def __getstate__(self) -> tuple[object, ...]"));
  cls.def("__setstate__", &set_state, nb::sig("def __setstate__(self, state: tuple[object, ...]) -> None"));
}

#define OVERLAPPER_POSES "positions: numpy.typing.ArrayLike, orientations: numpy.typing.ArrayLike | None = None"

constexpr const char* kPosesDoc =
    R"(positions : (k, 3) or (k, 4, 4) array_like
    Positions of the shapes, m. Or homogeneous matrices, as in `Placed`.
orientations : (k, 4) array_like, optional
    Quaternions x, y, z, w of the shapes, of any length but 0. Matrices take no orientations.
)";

constexpr const char* kRestOfOverlapsDoc =
    R"(pairs : (p, 2) array_like of int, optional
    Indices of the shapes of each pair. Default: all pairs that overlap or touch, sorted.
tolerance : float, default 0.001
    Allowed relative error of the volume for curved shapes, between 0 and 1. Polyhedra are exact and ignore it.
threads : int or None, default 1
    Number of threads. None: one on each core. The number does not change a bit of the results.
method : {'auto', 'paper'}, default 'auto'
    Method of computation, as in `overlap`.
separated : bool, default True
    Whether `pairs` that are separated have rows, too.

Returns
-------
Overlaps
    A row for each pair, bit-identical to what `overlap` returns for the pair.

Raises
------
ValueError
    If an argument has the wrong shape, a pose is not finite, a matrix scales, shears or reflects by more than 1e-6,
    or half-spaces have an unbounded common set.
KeyboardInterrupt
    After Ctrl-C. Its attribute `overlaps` has the rows that were finished.)";

/// The docstring of `overlaps`; `shapes` are the lines of that argument, if it has it.
std::string overlaps_doc(const char* shapes) {
  return std::string(
             "Overlaps of many pairs of placed shapes in one call, as arrays. Other Python threads run "
             "meanwhile.\n\nParameters\n----------\n") +
         shapes + kPosesDoc + kRestOfOverlapsDoc;
}

/// The docstring of `candidate_pairs`, likewise.
std::string candidates_doc(const char* shapes) {
  return std::string(
             "Pairs of shapes whose bounding boxes in the world meet.\n\nA half-space meets a box that reaches into "
             "it. "
             "Two half-spaces are not a pair.\n\nParameters\n----------\n") +
         shapes + kPosesDoc +
         "\nReturns\n-------\n(p, 2) ndarray of int32\n    Indices i < j of the two shapes, sorted.";
}

constexpr const char* kShapesDoc = "shapes : sequence of shapes\n    The k shapes, without poses.\n";

void define_batch_class(nb::module_& m) {
  nb::class_<Batch> cls(m, "Batch",
                        R"(Shapes whose overlaps are measured again and again while they move.

Results are reused in the next call. A pair whose poses are bit-identical costs no time. A pair that is still separated
along the same axis costs little time. All results are bit-identical to those of a first call. Several threads may call
at the same time. A pickle has only the shapes.

Parameters
----------
shapes : sequence of shapes
    The k shapes, without poses.

Examples
--------
>>> from overlapper import Batch, Sphere
>>> batch = Batch([Sphere(0.5), Sphere(0.5)])
>>> found = batch.overlaps([[0, 0, 0], [0.5, 0, 0]], [[0, 0, 0, 1], [0, 0, 0, 1]])
>>> found.pairs.tolist(), found.volume.round(6).tolist()
([[0, 1]], [0.163625]))");
  cls.def(
      "__init__", [](Batch* self, nb::handle shapes) { new (self) Batch(to_shapes(shapes)); }, "shapes"_a.none(),
      nb::sig(("def __init__(self, shapes: " + any_shapes() + ") -> None").c_str()));
  cls.def("__repr__", [](const Batch& self) { return "Batch(" + std::to_string(self.shapes().size()) + " shapes)"; });
  cls.def(
      "__getstate__", [](const Batch& self) { return nb::make_tuple(shape_list(self.shapes())); },
      nb::sig("def __getstate__(self) -> tuple[object, ...]"));
  cls.def(
      "__setstate__",
      [](Batch& self, nb::handle state) {
        if (!nb::isinstance<nb::tuple>(state) || nb::len(state) != 1)
          throw nb::value_error("state must be that of a batch");
        new (&self) Batch(to_shapes(state[0]));
      },
      nb::sig("def __setstate__(self, state: tuple[object, ...]) -> None"));
  cls.def("overlaps", &batch_overlaps, "positions"_a.none(), "orientations"_a.none() = nb::none(),
          "pairs"_a.none() = nb::none(), "tolerance"_a.none() = 1e-3, "threads"_a.none() = 1,
          "method"_a.none() = "auto", "separated"_a = true,
          nb::sig("def overlaps(self, " OVERLAPPER_POSES ", pairs: numpy.typing.ArrayLike | None = None, "
                  "tolerance: float = 0.001, threads: int | None = 1, "
                  "method: typing.Literal['auto', 'paper'] = 'auto', separated: bool = True) -> Overlaps"),
          overlaps_doc("").c_str());
  cls.def("candidate_pairs", &candidates, "positions"_a.none(), "orientations"_a.none() = nb::none(),
          nb::sig("def candidate_pairs(self, " OVERLAPPER_POSES ") -> numpy.typing.NDArray[numpy.int32]"),
          candidates_doc("").c_str());
}

}  // namespace

double to_tolerance(nb::handle given) {
  const double tolerance = to_double(given, "tolerance");
  if (!(tolerance > 0 && tolerance < 1)) fail("tolerance", "must be greater than 0 and less than 1");
  return tolerance;
}

int to_threads(nb::handle given) {
  if (given.is_none()) return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  int threads = 0;
  if (!nb::try_cast<int>(given, threads)) throw nb::type_error("threads must be a whole number, or None");
  if (threads < 1) fail("threads", "must be 1 or more, not " + std::to_string(threads));
  return threads;
}

void define_batch(nb::module_& m) {
  define_overlaps_class(m);
  define_batch_class(m);
  nb::class_<WeldRule>(m, "WeldRule", R"(MuJoCo's rule of which geoms may collide.

Parameters
----------
geoms : (n, 7) array_like of int
    Of each geom: contype, conaffinity, its body, the first body of the welded group, the parent of that body, whether no
    joint moves the group, and whether the geom is a plane or a height field.
excluded : (e,) array_like of int
    Pairs of bodies: 65536 times the lesser number plus the greater.
listed : (p, 2) array_like of int
    Pairs of rows of `geoms` that may collide in any case.
by_parent : bool
    Whether parent and child may not collide.
none : bool
    Whether no geoms may collide.)")
      .def(
          "__init__",
          [](WeldRule* self, nb::handle geoms, nb::handle excluded, nb::handle listed, bool by_parent, bool none) {
            new (self) WeldRule(to_rule(geoms, excluded, listed, by_parent, none));
          },
          "geoms"_a, "excluded"_a, "listed"_a, "by_parent"_a, "none"_a,
          nb::sig("def __init__(self, geoms: numpy.typing.ArrayLike, excluded: numpy.typing.ArrayLike, listed: "
                  "numpy.typing.ArrayLike, by_parent: bool, none: bool) -> None"))
      .def(
          "allow", &allowed, "first"_a, "second"_a, "listed"_a = true,
          nb::sig("def allow(self, first: numpy.typing.ArrayLike, second: numpy.typing.ArrayLike, listed: bool = True) "
                  "-> numpy.typing.NDArray[numpy.bool_]"),
          "(p,) whether the geoms in these rows may collide, pair by pair; without `listed`, by the other rules alone.")
      .def(
          "lists",
          [](const WeldRule& rule, int first, int second) {
            const int count = static_cast<int>(rule.geoms.size());
            if (std::min(first, second) < 0 || std::max(first, second) >= count) fail("first", "must index geoms");
            return rule.lists(first, second);
          },
          "first"_a, "second"_a, "Whether the pair of geoms in these rows is listed, and may collide.")
      .def("count", &count_of, "weights"_a, nb::sig("def count(self, weights: numpy.typing.ArrayLike) -> int"),
           "The number of pairs of shapes that may collide; `weights` (n,) is the number of shapes of each geom.");
  nb::class_<PairMask>(m, "PairMask", R"(Which pairs of shapes may be measured.

Parameters
----------
groups : (k,) array_like of int
    The group of each shape: a row of the table.
table : (g, g) ndarray of bool
    Whether shapes of a group may be measured with shapes of another group. It is symmetric.)")
      .def(
          "__init__",
          [](PairMask* self, nb::handle groups, nb::handle table) { new (self) PairMask(to_mask(groups, table)); },
          "groups"_a, "table"_a,
          nb::sig("def __init__(self, groups: numpy.typing.ArrayLike, table: numpy.typing.NDArray[numpy.bool_]) -> "
                  "None"))
      .def_static("of_rule", &mask_of_rule, "groups"_a, "rule"_a,
                  nb::sig("def of_rule(groups: numpy.typing.ArrayLike, rule: WeldRule) -> PairMask"),
                  "The pairs that a rule lets collide; `groups` (k,) are the geoms of the shapes, by row of the rule.");
  m.def("masked_overlaps", &masked_overlaps, "batch"_a, "positions"_a, "orientations"_a, "mask"_a, "tolerance"_a = 1e-3,
        "threads"_a.none() = 1, "method"_a = "auto",
        nb::sig("def masked_overlaps(batch: Batch, positions: numpy.typing.ArrayLike, orientations: "
                "numpy.typing.ArrayLike, mask: PairMask, tolerance: float = 0.001, threads: int | None = 1, method: "
                "typing.Literal['auto', 'paper'] = 'auto') -> Overlaps"),
        "The overlaps of the pairs of a Batch whose boxes meet and that `mask` admits. Separated pairs have no row.");
  m.def(
      "overlaps",
      [](nb::handle shapes, nb::handle positions, nb::handle orientations, nb::handle pairs, nb::handle tolerance,
         nb::handle threads, nb::handle method, bool separated) {
        Batch batch(to_shapes(shapes));
        return batch_overlaps(batch, positions, orientations, pairs, tolerance, threads, method, separated);
      },
      "shapes"_a.none(), "positions"_a.none(), "orientations"_a.none() = nb::none(), "pairs"_a.none() = nb::none(),
      "tolerance"_a.none() = 1e-3, "threads"_a.none() = 1, "method"_a.none() = "auto", "separated"_a = true,
      nb::sig(("def overlaps(shapes: " + any_shapes() +
               ", " OVERLAPPER_POSES
               ", pairs: numpy.typing.ArrayLike | None = None, tolerance: float = 0.001, threads: int | None = 1, "
               "method: typing.Literal['auto', 'paper'] = 'auto', separated: bool = True) -> Overlaps")
                  .c_str()),
      overlaps_doc(kShapesDoc).c_str());
  m.def(
      "candidate_pairs",
      [](nb::handle shapes, nb::handle positions, nb::handle orientations) {
        Batch batch(to_shapes(shapes));
        return candidates(batch, positions, orientations);
      },
      "shapes"_a.none(), "positions"_a.none(), "orientations"_a.none() = nb::none(),
      nb::sig(("def candidate_pairs(shapes: " + any_shapes() +
               ", " OVERLAPPER_POSES ") -> numpy.typing.NDArray[numpy.int32]")
                  .c_str()),
      candidates_doc(kShapesDoc).c_str());
}

}  // namespace overlapper::python
