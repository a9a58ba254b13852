#include "batch/batch.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "batch/box_tree.h"
#include "batch/parallel.h"
#include "distance/box_axes.h"
#include "distance/gjk.h"
#include "geometry/rounding.h"
#include "methods/clipping/clip.h"
#include "methods/round/closed_forms/closed_forms.h"
#include "overlap/centroid_gradient.h"
#include "overlap/depth_gradient.h"
#include "overlap/second_derivatives.h"
#include "overlap/shape_gradient.h"
#include "shapes/planes_asked.h"

namespace overlapper {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Rows are made in blocks, with a check for Ctrl-C after each block: memory for some millions of rows takes seconds.
constexpr size_t kStretch = 1 << 17;

/// Results of a pair, kept for its next call.
struct Known {
  IndexPair pair;
  std::array<std::uint64_t, 2> version;  ///< of the two bodies' poses
  Vec3 axis;                             ///< unit, from b to a: separating axis; {0, 0, 0} if not separated
};

Overlaps::Row row_of(Overlap overlap) {
  Overlaps::Row row;
  row.measures.status = overlap.status();
  row.measures.way = overlap.way();
  if (overlap.status() == Status::kSeparated) return row;
  if (overlap.status() == Status::kOverlapping) row.measures = overlap.measures();
  row.measures.volume_error = overlap.volume_error();
  row.measures.facets_touched = overlap.facets_touched();
  row.depth = overlap.contact().depth;
  row.normal = overlap.contact().normal;
  row.source = std::make_shared<Overlap>(std::move(overlap));
  return row;
}

/// `patch` gets the patch of a pair that clipping has measured, unless it is null. The way out may be deferred.
Overlaps::Row row_of(const Placed& a, const Placed& b, double tolerance, Method method, std::optional<Patch>* patch,
                     bool with_way) {
  if (method == Method::kAuto) {
    std::optional<Measures> at_once = measure_at_once(a, b, nullptr, patch);
    if (at_once && at_once->status == Status::kSeparated) return {};
    if (at_once && at_once->measured) {
      const Penetration way = with_way ? penetration_in_order(a, b) : Penetration{};
      return {std::move(*at_once), way.depth, way.normal, nullptr, {}, !with_way};
    }
  }
  return row_of(Overlap(a, b, tolerance, method));
}

/// A shape at its present pose, with its constants.
struct PosedShape {
  Placed placed;
  double radius;              ///< m
  std::uint64_t version = 0;  ///< number of poses so far

  /// The support along a unit direction of the world, relative to the body's origin.
  double reach_along(Vec3 direction) const {
    const Vec3 local = apply_transposed(placed.pose.rotation, direction);
    return dot(local, ask(placed.shape, [&](const auto& s) { return s.support(local); }));
  }
};

/// True if the bodies are separated by more than rounding, along the known axis or a new one. The margin is four times
/// that of Overlap. A later call without an axis therefore finds one, too.
bool apart(const PosedShape& a, const PosedShape& b, Vec3& axis) {
  const bool open_a = !bounded(a.placed.shape), open_b = !bounded(b.placed.shape);
  if (open_a && open_b) return false;
  const Vec3 between = a.placed.pose.translation - b.placed.pose.translation;
  const double margin = 4 * rounding(norm(between) + reach(a.placed, a.radius) + reach(b.placed, b.radius));
  if (open_a || open_b) {
    const PosedShape &open = open_a ? a : b, &closed = open_a ? b : a;
    const Plane& plane = *only_plane(open.placed.shape);
    const Vec3 normal = open.placed.pose.rotation * plane.normal;
    const double height = dot(normal, open_a ? -between : between);
    return height - plane.offset - closed.reach_along(-normal) > margin;
  }
  const auto gap = [&] { return dot(axis, between) - a.reach_along(-axis) - b.reach_along(axis); };
  if (norm2(axis) > 0 && gap() > margin) return true;
  if (const auto of_boxes = box_penetration(a.placed, b.placed, margin)) {
    axis = of_boxes->normal;
  } else {
    const Vec3 reference = a.placed.pose.translation;
    axis = distance(a.placed.seen_from(reference), b.placed.seen_from(reference)).normal;
  }
  return norm2(axis) > 0 && gap() > margin;
}

/// False if clipping is faster than the search for an axis, which may not exist.
bool axis_soon_found(const PosedShape& a, const PosedShape& b) {
  const auto polytope = [](const Shape& shape) { return !smooth(shape) && bounded(shape); };
  return !polytope(a.placed.shape) || !polytope(b.placed.shape);
}

}  // namespace

// ------------------------------------------------------------------------------------------------------------ Overlaps

Vec3 centroid_or_nan(const Measures& measures) {
  return measures.status == Status::kOverlapping ? measures.centroid : Vec3{kNaN, kNaN, kNaN};
}

BodyGradients gradients(const Measures& measures) {
  return {gradient_row(measures.pulls[0]), gradient_row(measures.pulls[1])};
}

void Overlaps::append(const Row& row) {
  std::apply([&](const auto&... column) { ((this->*column.values).push_back(column.of(row)), ...); }, kColumns);
  source.push_back(row.source);
  deferred.push_back(row.deferred);
}

void Overlaps::reserve(size_t rows) {
  std::apply([&](const auto&... column) { ((this->*column.values).reserve(rows), ...); }, kColumns);
  source.reserve(rows);
  deferred.reserve(rows);
}

Placed Overlaps::placed(int body) const {
  const PoseNumbers& p = (*poses)[body];
  return make_placed((*shapes)[body], {p[0], p[1], p[2]}, {p[3], p[4], p[5], p[6]});
}

std::shared_ptr<Overlap> Overlaps::overlap(size_t row) const {
  if (auto known = source[row].lock()) return known;
  return std::make_shared<Overlap>(placed(pairs[row][0]), placed(pairs[row][1]), tolerance, method);
}

Penetration Overlaps::way_of(size_t row) const {
  return penetration_in_order(placed(pairs[row][0]), placed(pairs[row][1]));
}

const Overlaps::Ways& Overlaps::ways() const {
  return ways_->get([this] {
    Ways found{depth, normal};
    for (size_t row = 0; row < size(); ++row) {
      if (!deferred[row]) continue;
      const Penetration out = way_of(row);
      found.depth[row] = out.depth, found.normal[row] = out.normal;
    }
    return found;
  });
}

const std::vector<double>& Overlaps::depths() const {
  if (ways_asked) ways_asked->store(true, std::memory_order_relaxed);
  return std::ranges::find(deferred, 1) == deferred.end() ? depth : ways().depth;
}

const std::vector<Vec3>& Overlaps::normals() const {
  if (ways_asked) ways_asked->store(true, std::memory_order_relaxed);
  return std::ranges::find(deferred, 1) == deferred.end() ? normal : ways().normal;
}

Vec3 Overlaps::normal_of(size_t row) const { return deferred[row] ? way_of(row).normal : normal[row]; }

const std::vector<double>& Overlaps::areas() const {
  return areas_->get([this] {
    std::vector<double> found = area_bound;
    for (size_t row = 0; row < size(); ++row) {
      const auto [a, b] = pairs[row];
      if (status[row] == static_cast<std::int8_t>(Status::kOverlapping) &&
          (stretched((*shapes)[a]) || stretched((*shapes)[b])))
        found[row] = overlap(row)->area();
    }
    return found;
  });
}

const Overlaps::Patches& Overlaps::patches() const {
  return patches_->get([this] {
    Patches found;
    found.centre.reserve(size());
    found.moments.reserve(size());
    found.distance.reserve(size());
    for (size_t row = 0; row < size(); ++row) {
      const Patch of_row = patch(row);
      found.centre.push_back(of_row.centre);
      found.moments.push_back(of_row.moments);
      found.distance.push_back(of_row.distance);
    }
    return found;
  });
}

const std::vector<ShapeGradients>& Overlaps::shape_gradients() const {
  return shape_gradients_->get([this] {
    std::vector<ShapeGradients> found(size());
    for (size_t row = 0; row < size(); ++row)
      if (status[row] == static_cast<std::int8_t>(Status::kOverlapping))
        std::ranges::copy(shape_gradient(*overlap(row)), found[row].begin());
    return found;
  });
}

const Gradients& Overlaps::depth_gradients() const {
  return depth_gradients_->get([this] {
    Gradients found{std::vector<BodyGradients>(size()), std::vector<ShapeGradients>(size())};
    for (size_t row = 0; row < size(); ++row) {
      if (status[row] != static_cast<std::int8_t>(Status::kOverlapping)) continue;
      const DepthGradient one = depth_gradient(*overlap(row));
      found.pose[row] = one.pose, found.shape[row] = one.shape;
    }
    return found;
  });
}

CentroidGradients Overlaps::of_centroids(Status least, std::vector<CentroidGradient> (*of)(const Overlap&)) const {
  CentroidGradients found;
  found.pose.resize(size()), found.shape.resize(size(), {Mat3{{}, {}, {}}, Mat3{{}, {}, {}}});
  for (size_t row = 0; row < size(); ++row) {
    if (status[row] < static_cast<std::int8_t>(least)) continue;
    const std::vector<CentroidGradient> one = of(*overlap(row));
    for (int i = 0; i < 2; ++i) found.pose[row][i] = one[i].pose, found.shape[row][i] = one[i].shape;
  }
  return found;
}

const CentroidGradients& Overlaps::centroid_gradients() const {
  return centroid_gradients_->get([this] { return of_centroids(Status::kOverlapping, centroid_gradient); });
}

const CentroidGradients& Overlaps::centroid_gradient_errors() const {
  const auto of = overlapper::centroid_gradient_errors;
  return centroid_gradient_errors_->get([&] { return of_centroids(Status::kTouching, of); });
}

const Gradients& Overlaps::gradient_errors() const {
  return gradient_errors_->get([this] {
    Gradients found{std::vector<BodyGradients>(size()), std::vector<ShapeGradients>(size())};
    for (size_t row = 0; row < size(); ++row) {
      if (status[row] == static_cast<std::int8_t>(Status::kSeparated)) continue;
      const std::shared_ptr<Overlap> of_row = overlap(row);
      for (int i = 0; i < 2; ++i) {
        const auto [force, moment] = of_row->errors().gradient[i];
        found.pose[row][i] = {force, force, force, moment, moment, moment};
      }
      std::ranges::copy(shape_gradient_errors(*of_row), found.shape[row].begin());
    }
    return found;
  });
}

const std::vector<PoseHessian>& Overlaps::hessians() const {
  return hessians_->get([this] {
    std::vector<PoseHessian> found(size());
    for (size_t row = 0; row < size(); ++row) {
      const std::vector<double> numbers = pose_hessian(*overlap(row));
      for (size_t k = 0; k < numbers.size(); ++k) found[row][k / 12][k % 12] = numbers[k];
    }
    return found;
  });
}

/// Equals Overlap::patch(), without an Overlap where the way is the same.
Patch Overlaps::patch(size_t row, const std::optional<Vec3>& direction) const {
  if (patches_asked) patches_asked->store(true, std::memory_order_relaxed);
  if (status[row] != static_cast<std::int8_t>(Status::kOverlapping)) return PatchSums({}, {}).patch();
  if (!direction && row < clipped.size() && clipped[row]) return *clipped[row];
  const auto [a, b] = pairs[row];
  const Way by = static_cast<Way>(way[row]);
  std::optional<Patch> exact;
  if (by == Way::kClipping || by == Way::kWideClipping) exact = clipped_patch(placed(a), placed(b), direction);
  if (by == Way::kClosedForm && !direction) {
    const std::array<double, 6>& pull = gradient[row][1];
    exact = closed_forms::section_patch(placed(a), placed(b), centroid[row], {pull[0], pull[1], pull[2]});
  }
  if (exact) return *exact;
  return direction ? overlap(row)->patch_along(*direction) : overlap(row)->patch();
}

Overlaps Overlaps::select(std::span<const std::int64_t> rows) const {
  Overlaps chosen;
  chosen.examined = examined;
  chosen.planes_asked = planes_asked;
  chosen.tolerance = tolerance;
  chosen.method = method;
  chosen.shapes = shapes;
  chosen.poses = poses;
  const auto pick = [&](const auto& from, auto& to) {
    to.reserve(rows.size());
    for (std::int64_t i : rows) to.push_back(from[i]);
  };
  std::apply([&](const auto&... column) { (pick(this->*column.values, chosen.*column.values), ...); }, kColumns);
  pick(source, chosen.source);
  pick(deferred, chosen.deferred);
  if (!clipped.empty()) pick(clipped, chosen.clipped);
  chosen.patches_asked = patches_asked;
  chosen.ways_asked = ways_asked;
  return chosen;
}

// --------------------------------------------------------------------------------------------------------------- Batch

/// The state that a call leaves for the next one.
struct Batch::Memory {
  std::vector<PosedShape> bodies;
  std::shared_ptr<const std::vector<PoseNumbers>> poses;  ///< of the bodies; shared with the results
  std::vector<Enclosure> enclosures;                      ///< parallel to `poses`, from the last search
  std::vector<std::uint64_t> enclosed;                    ///< parallel to `poses`: the versions of `enclosures`
  BoxTree tree;
  std::vector<IndexPair> candidates;
  std::vector<Known> known, next_known;                     ///< of the last call with pairs, and of the present one
  std::vector<Overlaps::Row> rows, next_rows;               ///< parallel to `known` and `next_known`
  std::vector<std::optional<Patch>> patches, next_patches;  ///< likewise if they were asked for, else empty
  bool with_patches = false, with_ways = true;
  std::vector<char> done;        ///< per pair of the present call
  std::atomic<size_t> asked{0};  ///< planes, in the present call
  bool sorted = false;           ///< true if `known` is sorted by pair
  double tolerance = 0;
  Method method = Method::kAuto;

  std::vector<int> before;   ///< per pair of the present call: its row in the last call, or -1
  bool both_sorted = false;  ///< true if the pairs of the last and of the present call are sorted
  size_t walked = 0;         ///< number of the last call's pairs passed, if `both_sorted`

  explicit Memory(const std::vector<Shape>& shapes) {
    for (const Shape& shape : shapes) bodies.push_back({make_placed(shape, {}, {}), radius(shape), 0});
    enclosures.resize(shapes.size());
    enclosed.resize(shapes.size());
  }

  void place(std::span<const double> positions, std::span<const double> orientations);
  void find_pairs(const PairMask* mask, std::vector<IndexPair>& pairs);
  void begin(std::span<const IndexPair> pairs);
  void recall(std::span<const IndexPair> pairs);
  bool answer(size_t i, double with_tolerance, Method by_method);
  void keep(double of_tolerance, Method of_method);
};

/// A body keeps its state if its pose is bit-identical.
void Batch::Memory::place(std::span<const double> positions, std::span<const double> orientations) {
  const auto before_this = std::exchange(poses, nullptr);
  auto now = std::make_shared<std::vector<PoseNumbers>>(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) {
    PoseNumbers& pose = (*now)[i];
    std::copy_n(&positions[3 * i], 3, pose.begin());
    std::copy_n(&orientations[4 * i], 4, pose.begin() + 3);
    if (before_this && std::memcmp(pose.data(), (*before_this)[i].data(), sizeof(PoseNumbers)) == 0) continue;
    try {
      bodies[i].placed.move_to({pose[0], pose[1], pose[2]}, {pose[3], pose[4], pose[5], pose[6]});
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument("pose " + std::to_string(i) + ": " + error.what());
    }
    ++bodies[i].version;
  }
  poses = std::move(now);
}

/// The pairs whose boxes meet, if `mask` admits them or is null. Calls with named pairs skip this search, because boxes
/// take longer than moving the bodies.
void Batch::Memory::find_pairs(const PairMask* mask, std::vector<IndexPair>& pairs) {
  for (size_t i = 0; i < bodies.size(); ++i)
    if (std::exchange(enclosed[i], bodies[i].version) != bodies[i].version) enclosures[i] = enclosure(bodies[i].placed);
  tree.pairs(enclosures, mask, pairs);
}

void Batch::Memory::begin(std::span<const IndexPair> pairs) {
  both_sorted = sorted && std::is_sorted(pairs.begin(), pairs.end());
  walked = 0;
  asked = 0;
  next_known.clear(), next_rows.clear(), next_patches.clear(), before.clear(), done.clear();
  next_known.reserve(pairs.size()), next_rows.reserve(pairs.size());
  before.reserve(pairs.size()), done.reserve(pairs.size());
}

/// Lays out rows for more pairs, and finds these pairs in the last call. If both lists are sorted, it walks along both
/// lists. Otherwise it looks at the same index.
void Batch::Memory::recall(std::span<const IndexPair> pairs) {
  for (const IndexPair& pair : pairs) {
    while (both_sorted && walked < known.size() && known[walked].pair < pair) ++walked;
    const size_t at = both_sorted ? walked : next_known.size();
    before.push_back(at < known.size() && known[at].pair == pair ? static_cast<int>(at) : -1);
    next_known.push_back({pair, {bodies[pair[0]].version, bodies[pair[1]].version}, {}});
  }
  next_rows.resize(next_known.size());
  if (with_patches) next_patches.resize(next_known.size());
  done.resize(next_known.size());
}

/// Fills row i; false if this took long.
bool Batch::Memory::answer(size_t i, double with_tolerance, Method by_method) {
  Known& pair = next_known[i];
  if (before[i] >= 0) {
    const Known& last = known[before[i]];
    pair.axis = last.axis;
    const bool patch_known = !with_patches || !patches.empty();
    if (last.version == pair.version && tolerance == with_tolerance && method == by_method && patch_known) {
      next_rows[i] = rows[before[i]];
      if (with_patches) next_patches[i] = patches[before[i]];
      done[i] = true;
      return true;
    }
  }
  const PosedShape &a = bodies[pair.pair[0]], &b = bodies[pair.pair[1]];
  // The article's method decides by itself and uses no axis.
  const bool in_vain = before[i] < 0 ? !axis_soon_found(a, b) : rows[before[i]].measures.status == Status::kOverlapping;
  const bool separated = by_method == Method::kAuto && !in_vain && apart(a, b, pair.axis);
  const size_t planes_before = planes_asked;
  next_rows[i] = separated ? Overlaps::Row{}
                           : row_of(a.placed, b.placed, with_tolerance, by_method,
                                    with_patches ? &next_patches[i] : nullptr, with_ways);
  next_rows[i].pair = pair.pair;
  asked.fetch_add(planes_asked - planes_before, std::memory_order_relaxed);
  done[i] = true;
  return !next_rows[i].source;
}

void Batch::Memory::keep(double of_tolerance, Method of_method) {
  known.swap(next_known);
  rows.swap(next_rows);
  patches.swap(next_patches);
  tolerance = of_tolerance;
  method = of_method;
  sorted = std::is_sorted(known.begin(), known.end(), [](const Known& a, const Known& b) { return a.pair < b.pair; });
}

/// The batch's memory, or a new one while another thread uses the batch's.
class Batch::Borrowed {
 public:
  explicit Borrowed(Batch& batch) : batch_(batch), first_(!batch.in_use_.test_and_set()) {
    if (!first_) own_ = std::make_unique<Memory>(batch.shapes());
  }
  ~Borrowed() {
    if (first_) batch_.in_use_.clear();
  }
  Borrowed(const Borrowed&) = delete;
  Borrowed& operator=(const Borrowed&) = delete;
  Memory* operator->() { return first_ ? batch_.memory_.get() : own_.get(); }

 private:
  Batch& batch_;
  bool first_;
  std::unique_ptr<Memory> own_;
};

Batch::Batch(std::vector<Shape> shapes)
    : shapes_(std::make_shared<const std::vector<Shape>>(std::move(shapes))),
      memory_(std::make_unique<Memory>(*shapes_)) {}

Batch::~Batch() = default;

std::vector<IndexPair> Batch::candidate_pairs(std::span<const double> positions, std::span<const double> orientations) {
  Borrowed memory(*this);
  memory->place(positions, orientations);
  std::vector<IndexPair> pairs;
  memory->find_pairs(nullptr, pairs);
  return pairs;
}

Overlaps Batch::overlaps(std::span<const double> positions, std::span<const double> orientations,
                         std::optional<std::span<const IndexPair>> given, bool separated, double tolerance,
                         Method method, int threads, bool& finished, const PairMask* mask) {
  if (!(tolerance > 0 && tolerance < 1))
    throw std::invalid_argument("tolerance must be greater than 0 and less than 1");
  Borrowed memory(*this);
  memory->place(positions, orientations);
  finished = true;
  if (!given) try {
      memory->find_pairs(mask, memory->candidates);
    } catch (const Cancelled&) {
      finished = false;
      memory->candidates.clear();
    }
  const std::span<const IndexPair> pairs = given ? *given : std::span<const IndexPair>(memory->candidates);
  Overlaps answer;
  answer.tolerance = tolerance;
  answer.method = method;
  answer.shapes = shapes_;
  answer.poses = memory->poses;
  answer.patches_asked = patches_asked_;
  answer.ways_asked = ways_asked_;
  memory->with_patches = patches_asked_->load(std::memory_order_relaxed);
  memory->with_ways = ways_asked_->exchange(false, std::memory_order_relaxed);
  const auto listed = [&](size_t i) {
    return memory->done[i] && (separated || memory->next_rows[i].measures.status != Status::kSeparated);
  };
  memory->begin(pairs);
  for (size_t first = 0; finished && first < pairs.size(); first += kStretch) {
    const size_t count = std::min(kStretch, pairs.size() - first);
    memory->recall(pairs.subspan(first, count));
    finished = for_each_in_parallel(count, threads,
                                    [&](size_t i, int) { return memory->answer(first + i, tolerance, method); });
    size_t rows = 0;
    for (size_t i = first; i < first + count; ++i) answer.examined += memory->done[i], rows += listed(i);
    if (first == 0) answer.reserve(separated ? pairs.size() : rows);
    for (size_t i = first; i < first + count; ++i)
      if (listed(i)) {
        answer.append(memory->next_rows[i]);
        if (memory->with_patches) answer.clipped.push_back(memory->next_patches[i]);
      }
  }
  answer.planes_asked = memory->asked;
  if (finished) memory->keep(tolerance, method);
  return answer;
}

}  // namespace overlapper
