#include "batch/shape_array.h"

#include <algorithm>

#include "batch/box_volumes.h"
#include "batch/parallel.h"
#include "overlap/overlap.h"
#include "overlap/second_derivatives.h"
#include "overlap/shape_gradient.h"

namespace overlapper {
namespace {

/// The pairs of rows of two arrays whose boxes meet: indices of `a`, then of `b`.
std::vector<IndexPair> pairs_that_meet(std::span<const Placed> a, std::span<const Placed> b) {
  std::vector<Enclosure> enclosures;
  enclosures.reserve(a.size() + b.size());
  for (const auto& rows : {a, b})
    for (const Placed& row : rows) enclosures.push_back(enclosure(row));
  std::vector<IndexPair> pairs;
  BoxTree().pairs(enclosures, nullptr, pairs);
  const int first = static_cast<int>(a.size());
  std::erase_if(pairs, [&](const IndexPair& pair) { return pair[0] >= first || pair[1] < first; });
  for (IndexPair& pair : pairs) pair[1] -= first;
  return pairs;
}

/// Rectangles of the second array become boxes of twice the height. The tops of two boxes never lie in one plane then,
/// and the common height is 1.
std::vector<Placed> raised(std::span<const Placed> rows) {
  std::vector<Placed> boxes(rows.begin(), rows.end());
  for (Placed& box : boxes) std::get<Box>(box.shape).half_extents.z *= 2;
  return boxes;
}

/// The rows of two arrays, ready to overlap.
struct RowsOfPairs {
  std::vector<Placed> higher;
  std::span<const Placed> a, b;

  RowsOfPairs(const ShapeArray& first, const ShapeArray& second) : a(first.rows), b(second.rows) {
    if (second.planar) higher = raised(second.rows), b = higher;
  }
  RowsOfPairs(const RowsOfPairs&) = delete;
};

/// The pairs of two arrays, and the place of each among the weights.
std::vector<IndexPair> pairs_of(const RowsOfPairs& rows, Pairing pairing) {
  if (pairing == Pairing::kAll) return pairs_that_meet(rows.a, rows.b);
  std::vector<IndexPair> pairs;
  for (int i = 0; i < static_cast<int>(rows.a.size()); ++i) pairs.push_back({i, i});
  return pairs;
}
size_t place_of(const IndexPair& pair, const RowsOfPairs& rows, Pairing pairing) {
  return pairing == Pairing::kRows ? pair[0] : pair[0] * rows.b.size() + pair[1];
}

double common_volume(const Placed& a, const Placed& b, double tolerance) {
  if (const std::optional<Measures> at_once = measure_at_once(a, b)) {
    if (at_once->status == Status::kSeparated) return 0;
    if (at_once->measured) return at_once->volume;
  }
  return Overlap(a, b, tolerance, Method::kAuto).volume();
}

/// True if the array has boxes or rectangles. All its rows are of one kind.
bool of_boxes(std::span<const Placed> rows) { return !rows.empty() && std::holds_alternative<Box>(rows[0].shape); }

double volume_around(const Placed& a, const Placed& b) {
  std::vector<Vec3> corners;
  for (const Placed* box : {&a, &b})
    for (int i = 0; i < 8; ++i) corners.push_back(box->pose * vertex(box->shape, i));
  return make_hull(corners).volume();
}

}  // namespace

bool common_volumes(const ShapeArray& a, const ShapeArray& b, Pairing pairing, double tolerance, int threads,
                    std::span<double> volumes) {
  const RowsOfPairs rows(a, b);
  const std::vector<IndexPair> pairs = pairs_of(rows, pairing);
  const bool boxes = of_boxes(rows.a) && of_boxes(rows.b);
  const size_t at_once = boxes ? kPairsAtOnce : 1;
  std::ranges::fill(volumes, 0);
  return for_each_in_parallel((pairs.size() + at_once - 1) / at_once, threads, [&](size_t k, int) {
    const auto some = std::span(pairs).subspan(k * at_once, std::min(at_once, pairs.size() - k * at_once));
    BoxVolumes found;
    if (boxes) {
      BoxList of_a, of_b;
      for (size_t n = 0; n < at_once; ++n) {
        const auto [i, j] = some[std::min(n, some.size() - 1)];
        of_a[n] = &rows.a[i], of_b[n] = &rows.b[j];
      }
      found = volumes_of_boxes(of_a, of_b);
    }
    for (size_t n = 0; n < some.size(); ++n) {
      const auto [i, j] = some[n];
      const bool enough = boxes && found.error[n] <= kEnough * found.volume[n];
      volumes[place_of(some[n], rows, pairing)] =
          enough ? found.volume[n] : common_volume(rows.a[i], rows.b[j], tolerance);
    }
    return true;
  });
}

bool volumes_around(const ShapeArray& a, const ShapeArray& b, Pairing pairing, int threads, std::span<double> volumes) {
  const size_t columns = pairing == Pairing::kRows ? 1 : b.size();
  return for_each_in_parallel(volumes.size(), threads, [&](size_t k, int) {
    volumes[k] = volume_around(a.rows[k / columns], b.rows[pairing == Pairing::kRows ? k : k % columns]);
    return true;
  });
}

namespace {

constexpr size_t kStretch = 1 << 14;  // pairs whose derivatives are kept until they are summed in order

/// Calls `find(pair, place)` in parallel, and then `add(pair, place, found)` in order. False if the caller cancels.
template <class Found, class Find, class Add>
bool find_and_add(const std::vector<IndexPair>& pairs, int threads, const Find& find, const Add& add) {
  std::vector<Found> found(std::min(kStretch, pairs.size()));
  for (size_t first = 0; first < pairs.size(); first += kStretch) {
    const size_t count = std::min(kStretch, pairs.size() - first);
    const bool finished = for_each_in_parallel(count, threads, [&](size_t k, int) {
      found[k] = find(pairs[first + k]);
      return true;
    });
    if (!finished) return false;
    for (size_t k = 0; k < count; ++k) add(pairs[first + k], found[k]);
  }
  return true;
}

RowGradient row_of(const std::array<double, 6>& pose, Vec3 shape) {
  return {shape, {pose[0], pose[1], pose[2]}, {pose[3], pose[4], pose[5]}};
}
RowGradient& add(RowGradient& row, double by, const RowGradient& other) {
  row.shape += by * other.shape, row.position += by * other.position, row.rotation += by * other.rotation;
  return row;
}
double dot(const RowGradient& a, const RowGradient& b) {
  return overlapper::dot(a.shape, b.shape) + overlapper::dot(a.position, b.position) +
         overlapper::dot(a.rotation, b.rotation);
}

/// The derivative of one pair's volume along a direction, and its second derivatives times that direction.
struct AlongDirection {
  double slope = 0;
  std::array<RowGradient, 2> second{};
};
AlongDirection along_direction(const Placed& a, const Placed& b, const std::array<RowGradient, 2>& direction,
                               double tolerance) {
  AlongDirection found;
  const PairGradient first = pair_gradient(a, b, tolerance);
  if (first.volume == 0) return found;
  std::array<double, 2 * kNumbersOfBody> along{};
  for (int body : {0, 1}) {
    const RowGradient& d = direction[body];
    found.slope += dot(d, row_of(first.pose[body], first.shape[body]));
    for (int k = 0; k < 3; ++k) {
      double* numbers = &along[kNumbersOfBody * body];
      numbers[k] = d.position[k], numbers[3 + k] = d.rotation[k], numbers[6 + k] = d.shape[k];
    }
  }
  const std::vector<double> second = second_derivatives(Overlap(a, b, tolerance, Method::kAuto));
  const auto product = [&](int k) {
    double sum = 0;
    for (size_t l = 0; l < along.size(); ++l) sum += second[k * along.size() + l] * along[l];
    return sum;
  };
  for (int body : {0, 1}) {
    const auto three = [&](int k) {
      const int from = kNumbersOfBody * body + k;
      return Vec3{product(from), product(from + 1), product(from + 2)};
    };
    found.second[body] = {three(6), three(0), three(3)};
  }
  return found;
}

}  // namespace

bool add_gradients(const ShapeArray& a, const ShapeArray& b, Pairing pairing, std::span<const double> weights,
                   double tolerance, int threads, std::span<RowGradient> of_a, std::span<RowGradient> of_b) {
  const RowsOfPairs rows(a, b);
  std::vector<IndexPair> pairs = pairs_of(rows, pairing);
  const auto weight = [&](const IndexPair& pair) { return weights[place_of(pair, rows, pairing)]; };
  std::erase_if(pairs, [&](const IndexPair& pair) { return weight(pair) == 0; });
  return find_and_add<PairGradient>(
      pairs, threads, [&](const IndexPair& pair) { return pair_gradient(rows.a[pair[0]], rows.b[pair[1]], tolerance); },
      [&](const IndexPair& pair, const PairGradient& found) {
        for (int body : {0, 1})
          add((body == 0 ? of_a : of_b)[pair[body]], weight(pair), row_of(found.pose[body], found.shape[body]));
      });
}

bool add_second_derivatives(const ShapeArray& a, const ShapeArray& b, Pairing pairing, std::span<const double> weights,
                            std::span<const RowGradient> along_a, std::span<const RowGradient> along_b,
                            double tolerance, int threads, std::span<double> slopes, std::span<RowGradient> of_a,
                            std::span<RowGradient> of_b) {
  const RowsOfPairs rows(a, b);
  std::ranges::fill(slopes, 0);
  return find_and_add<AlongDirection>(
      pairs_of(rows, pairing), threads,
      [&](const IndexPair& pair) {
        return along_direction(rows.a[pair[0]], rows.b[pair[1]], {along_a[pair[0]], along_b[pair[1]]}, tolerance);
      },
      [&](const IndexPair& pair, const AlongDirection& found) {
        const size_t place = place_of(pair, rows, pairing);
        slopes[place] = found.slope;
        if (weights[place] == 0) return;
        for (int body : {0, 1}) add((body == 0 ? of_a : of_b)[pair[body]], weights[place], found.second[body]);
      });
}

}  // namespace overlapper
