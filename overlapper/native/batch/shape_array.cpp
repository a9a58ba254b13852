#include "batch/shape_array.h"

#include <algorithm>

#include "batch/parallel.h"
#include "overlap/overlap.h"
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

/// The rows of two arrays, ready to be paired.
struct RowsOfPairs {
  std::vector<Placed> higher;
  std::span<const Placed> a, b;

  RowsOfPairs(const ShapeArray& first, const ShapeArray& second, bool to_overlap) : a(first.rows), b(second.rows) {
    if (to_overlap && second.planar) higher = raised(second.rows), b = higher;
  }
  RowsOfPairs(const RowsOfPairs&) = delete;
};

}  // namespace

double common_volume(const Placed& a, const Placed& b, double tolerance) {
  if (const std::optional<Measures> at_once = measure_at_once(a, b)) {
    if (at_once->status == Status::kSeparated) return 0;
    if (at_once->measured) return at_once->volume;
  }
  return Overlap(a, b, tolerance, Method::kAuto).volume();
}

double volume_around(const Placed& a, const Placed& b) {
  std::vector<Vec3> corners;
  for (const Placed* box : {&a, &b})
    for (int i = 0; i < 8; ++i) corners.push_back(box->pose * vertex(box->shape, i));
  return make_hull(corners).volume();
}

bool for_pairs(const ShapeArray& a, const ShapeArray& b, Pairing pairing, bool culled, int threads,
               const PairValue& value, std::span<double> values) {
  const RowsOfPairs rows(a, b, culled);
  if (pairing == Pairing::kRows || !culled) {
    const size_t columns = pairing == Pairing::kRows ? 1 : b.size();
    return for_each_in_parallel(values.size(), threads, [&](size_t k, int) {
      values[k] = value(rows.a[k / columns], rows.b[pairing == Pairing::kRows ? k : k % columns]);
      return true;
    });
  }
  std::ranges::fill(values, 0);
  const std::vector<IndexPair> pairs = pairs_that_meet(rows.a, rows.b);
  return for_each_in_parallel(pairs.size(), threads, [&](size_t k, int) {
    const auto [i, j] = pairs[k];
    values[i * b.size() + j] = value(rows.a[i], rows.b[j]);
    return true;
  });
}

bool add_gradients(const ShapeArray& a, const ShapeArray& b, Pairing pairing, std::span<const double> weights,
                   double tolerance, int threads, std::span<RowGradient> of_a, std::span<RowGradient> of_b) {
  constexpr size_t kStretch = 1 << 14;  // pairs whose derivatives are kept until they are summed in order
  const RowsOfPairs rows(a, b, true);
  std::vector<IndexPair> pairs;
  if (pairing == Pairing::kAll) pairs = pairs_that_meet(rows.a, rows.b);
  else
    for (int i = 0; i < static_cast<int>(a.size()); ++i) pairs.push_back({i, i});
  const auto weight = [&](const IndexPair& pair) {
    return weights[pairing == Pairing::kRows ? pair[0] : pair[0] * b.size() + pair[1]];
  };
  std::erase_if(pairs, [&](const IndexPair& pair) { return weight(pair) == 0; });
  std::vector<PairGradient> found(std::min(kStretch, pairs.size()));
  for (size_t first = 0; first < pairs.size(); first += kStretch) {
    const size_t count = std::min(kStretch, pairs.size() - first);
    const bool finished = for_each_in_parallel(count, threads, [&](size_t k, int) {
      const auto [i, j] = pairs[first + k];
      found[k] = pair_gradient(rows.a[i], rows.b[j], tolerance);
      return true;
    });
    if (!finished) return false;
    for (size_t k = 0; k < count; ++k)
      for (int body : {0, 1}) {
        const double by = weight(pairs[first + k]);
        const auto& pose = found[k].pose[body];
        RowGradient& row = (body == 0 ? of_a : of_b)[pairs[first + k][body]];
        row.shape += by * found[k].shape[body];
        row.position += by * Vec3{pose[0], pose[1], pose[2]};
        row.rotation += by * Vec3{pose[3], pose[4], pose[5]};
      }
  }
  return true;
}

}  // namespace overlapper
