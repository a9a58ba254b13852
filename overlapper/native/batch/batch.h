#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <tuple>
#include <vector>

#include "batch/box_tree.h"
#include "geometry/once.h"
#include "overlap/centroid_gradient.h"
#include "overlap/overlap.h"
#include "shapes/shape.h"

namespace overlapper {

/// Position, then quaternion x, y, z, w as given.
using PoseNumbers = std::array<double, 7>;

/// d volume / d (translation, rotation vector about the body's own position) of a and of b.
using BodyGradients = std::array<std::array<double, 6>, 2>;

/// The derivatives of the volume by the numbers of the shapes of a and of b, as in shape_gradient().
using ShapeGradients = std::array<Vec3, 2>;
/// The derivatives of a number, or bounds of their errors, a row per pair.
struct Gradients {
  std::vector<BodyGradients> pose;
  std::vector<ShapeGradients> shape;
};

/// The derivatives of centroids, or bounds of their errors, a row per pair. Each has a block for a and one for b, and
/// rows for coordinates.
struct CentroidGradients {
  std::vector<std::array<std::array<std::array<double, 6>, 3>, 2>> pose;
  std::vector<std::array<Mat3, 2>> shape;
};

/// The second derivatives of the volume by the twelve numbers of BodyGradients.
using PoseHessian = std::array<std::array<double, 12>, 12>;

/// The common sets of the pairs of one call, a column per quantity and a row per pair.
struct Overlaps {
  struct Row {
    Measures measures;
    double depth = 0;
    Vec3 normal;                      ///< {0, 0, 0} if separated
    std::shared_ptr<Overlap> source;  ///< set if the measures needed an Overlap
    IndexPair pair{};
    bool deferred = false;  ///< depth and normal are not known yet
  };

  // kColumns documents each column.
  std::vector<IndexPair> pairs;
  std::vector<std::int8_t> status, way;
  std::vector<char> widened;
  std::vector<int> facets_touched;
  std::vector<double> volume, volume_error, area_bound, depth;
  std::vector<Vec3> centroid, normal;
  std::vector<BodyGradients> gradient;
  std::vector<char> deferred;  ///< per row: depth and normal are found on first use, see ways()

  /// The Overlap of a row, while the batch keeps it; empty if it is cheap to make again.
  std::vector<std::weak_ptr<Overlap>> source;

  /// The patches of the rows that clipping has measured. Empty unless patches were asked of earlier results of the
  /// batch.
  std::vector<std::optional<Patch>> clipped;
  std::shared_ptr<std::atomic<bool>> patches_asked;  ///< of any results of the batch; null without a batch
  std::shared_ptr<std::atomic<bool>> ways_asked;     ///< of the last results of the batch; null without a batch

  size_t examined = 0;      ///< pairs examined, with or without a row
  size_t planes_asked = 0;  ///< number of planes of their shapes that were evaluated, without pairs that have not moved
  double tolerance = 0;
  Method method = Method::kAuto;
  std::shared_ptr<const std::vector<Shape>> shapes;
  std::shared_ptr<const std::vector<PoseNumbers>> poses;

  /// A Patch for each row.
  struct Patches {
    std::vector<Vec3> centre;
    std::vector<Mat3> moments;
    std::vector<double> distance;
  };

  size_t size() const { return pairs.size(); }
  void append(const Row& row);
  void reserve(size_t rows);
  /// The Overlap of that row, for all other quantities.
  std::shared_ptr<Overlap> overlap(size_t row) const;
  Overlaps select(std::span<const std::int64_t> rows) const;
  /// The depth and the normal of each row.
  struct Ways {
    std::vector<double> depth;
    std::vector<Vec3> normal;
  };
  /// Found on first use for rows that are `deferred`.
  const std::vector<double>& depths() const;
  const std::vector<Vec3>& normals() const;
  /// The normal of a row, without those of other rows.
  Vec3 normal_of(size_t row) const;
  /// Computed on first use, pair by pair.
  const Patches& patches() const;
  const std::vector<double>& areas() const;
  const std::vector<ShapeGradients>& shape_gradients() const;
  const Gradients& depth_gradients() const;
  const CentroidGradients& centroid_gradients() const;
  const Gradients& gradient_errors() const;
  const CentroidGradients& centroid_gradient_errors() const;
  const std::vector<PoseHessian>& hessians() const;
  /// The patch of a row. It is seen along a unit direction if one is given.
  Patch patch(size_t row, const std::optional<Vec3>& direction = {}) const;

 private:
  Placed placed(int body) const;
  Penetration way_of(size_t row) const;
  const Ways& ways() const;
  /// `of` the overlap of each row whose status is `least` or more; zeros elsewhere.
  CentroidGradients of_centroids(Status least, std::vector<CentroidGradient> (*of)(const Overlap&)) const;

  template <class T>
  using Shared = std::shared_ptr<Once<T>>;
  Shared<std::vector<double>> areas_ = std::make_shared<Once<std::vector<double>>>();
  Shared<Ways> ways_ = std::make_shared<Once<Ways>>();
  Shared<Patches> patches_ = std::make_shared<Once<Patches>>();
  Shared<std::vector<ShapeGradients>> shape_gradients_ = std::make_shared<Once<std::vector<ShapeGradients>>>();
  Shared<Gradients> depth_gradients_ = std::make_shared<Once<Gradients>>();
  Shared<CentroidGradients> centroid_gradients_ = std::make_shared<Once<CentroidGradients>>();
  Shared<Gradients> gradient_errors_ = std::make_shared<Once<Gradients>>();
  Shared<CentroidGradients> centroid_gradient_errors_ = std::make_shared<Once<CentroidGradients>>();
  Shared<std::vector<PoseHessian>> hessians_ = std::make_shared<Once<std::vector<PoseHessian>>>();
};

/// A column of Overlaps: its name in Python, its vector, the value of a row, and its docstring in Python.
template <class T>
struct Column {
  const char* name;
  std::vector<T> Overlaps::* values;
  T (*of)(const Overlaps::Row&);
  const char* doc;
};

Vec3 centroid_or_nan(const Measures& measures);
BodyGradients gradients(const Measures& measures);

/// The columns in Python, in order. A new column needs a line here and its vector.
inline constexpr std::tuple kColumns{
    Column<IndexPair>{"pairs", &Overlaps::pairs, [](const Overlaps::Row& row) { return row.pair; },
                      "(p, 2) indices of the shapes a and b of each row."},
    Column<std::int8_t>{"status", &Overlaps::status,
                        [](const Overlaps::Row& row) { return static_cast<std::int8_t>(row.measures.status); },
                        "(p,) Overlaps.SEPARATED (0), TOUCHING (1) or OVERLAPPING (2)."},
    Column<std::int8_t>{
        "way", &Overlaps::way, [](const Overlaps::Row& row) { return static_cast<std::int8_t>(row.measures.way); },
        "(p,) how the result was computed: an index into Overlaps.WAYS, which has the names of Overlap.way."},
    Column<double>{"volume", &Overlaps::volume, [](const Overlaps::Row& row) { return row.measures.volume; },
                   "(p,) m³; 0 unless overlapping."},
    Column<double>{"volume_error", &Overlaps::volume_error,
                   [](const Overlaps::Row& row) { return row.measures.volume_error; },
                   "(p,) m³, certified: the true volume is within volume ± volume_error."},
    Column<Vec3>{"centroid", &Overlaps::centroid,
                 [](const Overlaps::Row& row) { return centroid_or_nan(row.measures); },
                 "(p, 3) centre of the common volume, m; NaN unless overlapping."},
    Column<double>{"area_bound", &Overlaps::area_bound, [](const Overlaps::Row& row) { return row.measures.area; },
                   "(p,) m², upper bound of `area`. It is the area itself in pairs without an ellipsoid."},
    Column<Vec3>{"normal", &Overlaps::normal, [](const Overlaps::Row& row) { return row.normal; },
                 "(p, 3) unit, from b to a as pybullet's contactNormalOnB; 0 for pairs that are separated."},
    Column<double>{"depth", &Overlaps::depth, [](const Overlaps::Row& row) { return row.depth; },
                   "(p,) m, length of the shortest translation that separates the pair; 0 unless overlapping."},
    Column<BodyGradients>{
        "gradient", &Overlaps::gradient, [](const Overlaps::Row& row) { return gradients(row.measures); },
        R"((p, 2, 6) d volume / d (translation, rotation vector about the body's own position) of a and of b, m² and m³;
0 unless overlapping.)"},
    Column<int>{"facets_touched", &Overlaps::facets_touched,
                [](const Overlaps::Row& row) { return row.measures.facets_touched; },
                "(p,) number of planes of the shapes that took part in the measures."},
    Column<char>{"widened", &Overlaps::widened,
                 [](const Overlaps::Row& row) { return static_cast<char>(overlapper::widened(row.measures.way)); },
                 "(p,) True where the volume was computed again in double-double arithmetic."}};

/// The pairs of moving shapes. Results of the last call are reused if they prove the same answer. Several threads may
/// call it at once. One thread uses the memory, and the others work without it.
class Batch {
 public:
  explicit Batch(std::vector<Shape> shapes);
  ~Batch();

  const std::vector<Shape>& shapes() const { return *shapes_; }

  /// The pairs i < j whose boxes meet, sorted. Both functions throw std::invalid_argument that names an invalid pose.
  std::vector<IndexPair> candidate_pairs(std::span<const double> positions, std::span<const double> orientations);

  /// A row for each pair that overlaps or touches, and with `separated` also for the other pairs. The pairs are
  /// `pairs`, or else all pairs whose boxes meet, if `mask` admits them or is null. The bits depend neither on
  /// `threads` nor on earlier calls. If the caller cancels, `finished` becomes false, and only finished pairs have
  /// rows.
  Overlaps overlaps(std::span<const double> positions, std::span<const double> orientations,
                    std::optional<std::span<const IndexPair>> pairs, bool separated, double tolerance, Method method,
                    int threads, bool& finished, const PairMask* mask = nullptr);

 private:
  struct Memory;
  class Borrowed;

  std::shared_ptr<const std::vector<Shape>> shapes_;
  std::unique_ptr<Memory> memory_;
  std::shared_ptr<std::atomic<bool>> patches_asked_ = std::make_shared<std::atomic<bool>>(false);
  /// Depths and normals of the first results, and of results after those whose depths were asked for, are found at
  /// once.
  std::shared_ptr<std::atomic<bool>> ways_asked_ = std::make_shared<std::atomic<bool>>(true);
  std::atomic_flag in_use_;
};

}  // namespace overlapper
