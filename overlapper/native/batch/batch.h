#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "batch/box_tree.h"
#include "geometry/once.h"
#include "overlap/overlap.h"
#include "shapes/shape.h"

namespace overlapper {

/// Position, then quaternion x, y, z, w as given.
using PoseNumbers = std::array<double, 7>;

/// The common sets of the pairs of one call, a column per quantity and a row per pair.
struct Overlaps {
  struct Row {
    Measures measures;
    double depth = 0;
    Vec3 normal;                      ///< {0, 0, 0} if separated
    std::shared_ptr<Overlap> source;  ///< if it took more than measuring at once
  };

  std::vector<IndexPair> pairs;
  std::vector<std::int8_t> status;  ///< a Status
  std::vector<std::int8_t> way;     ///< a Way
  std::vector<char> widened;
  std::vector<int> facets_touched;
  std::vector<double> volume, volume_error, area, depth;
  std::vector<Vec3> centroid;  ///< not a number unless overlapping
  std::vector<Vec3> normal;
  std::vector<std::array<std::array<double, 6>, 2>> gradient;

  /// The pair that a row was taken from, while the batch that has it remembers; none where that is quickly made again.
  std::vector<std::weak_ptr<Overlap>> source;

  size_t examined = 0;      ///< pairs that were looked at, with or without a row
  size_t planes_asked = 0;  ///< of their shapes, those of pairs that have not moved left out
  double tolerance = 0;
  Method method = Method::kAuto;
  std::shared_ptr<const std::vector<Shape>> shapes;
  std::shared_ptr<const std::vector<PoseNumbers>> poses;

  /// Of each row, a Patch.
  struct Patches {
    std::vector<Vec3> centre;
    std::vector<Mat3> moments;
    std::vector<double> distance;
  };

  size_t size() const { return pairs.size(); }
  void append(IndexPair pair, const Row& row);
  void reserve(size_t rows);
  /// The pair of that row with all that can be asked of it.
  std::shared_ptr<Overlap> overlap(size_t row) const;
  Overlaps select(std::span<const std::int64_t> rows) const;
  /// Found when first asked for, pair by pair.
  const Patches& patches() const;

 private:
  Placed placed(int body) const;

  std::shared_ptr<Once<Patches>> patches_ = std::make_shared<Once<Patches>>();
};

/// The pairs of shapes that move: what was found in the last call is kept, and serves where it proves the same answer.
/// May be called from several threads at once; one of them has the memory, the others go without.
class Batch {
 public:
  explicit Batch(std::vector<Shape> shapes);
  ~Batch();

  const std::vector<Shape>& shapes() const { return *shapes_; }

  /// The pairs i < j whose boxes meet, sorted. Both throw std::invalid_argument that names a pose that is none.
  std::vector<IndexPair> candidate_pairs(std::span<const double> positions, std::span<const double> orientations);

  /// A row for each of `pairs`, or without them for each whose boxes meet, that overlaps or touches; for the others,
  /// too, if the `separated` are wanted. The bits depend neither on `threads` nor on earlier calls. Once the answer is
  /// not wanted any more, `finished` becomes false and only pairs that were done have rows.
  Overlaps overlaps(std::span<const double> positions, std::span<const double> orientations,
                    std::optional<std::span<const IndexPair>> pairs, bool separated, double tolerance, Method method,
                    int threads, bool& finished);

 private:
  struct Memory;
  class Borrowed;

  std::shared_ptr<const std::vector<Shape>> shapes_;
  std::unique_ptr<Memory> memory_;
  std::atomic_flag in_use_;
};

}  // namespace overlapper
