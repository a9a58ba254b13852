#pragma once

#include <span>
#include <string>
#include <vector>

#include "batch/pair_mask.h"
#include "python/arrays.h"

/// Arguments of calls with many shapes.
namespace overlapper::python {

/// A Batch or a sequence of shapes.
std::vector<Shape> to_shapes(nb::handle given);

/// Positions and quaternions, one row per shape. The copies keep other threads from changing them.
struct PoseRows {
  std::vector<double> positions, orientations;
};

/// Positions with quaternions, or homogeneous matrices, for k shapes. The names of the arguments begin with `prefix`.
PoseRows to_poses(nb::handle positions, nb::handle orientations, size_t k, const std::string& prefix = "");

/// Pairs of indices below k.
std::vector<IndexPair> to_pairs(nb::handle given, size_t k);

/// (p, 2) indices.
inline IndexMatrix to_numpy(std::span<const IndexPair> pairs) {
  std::vector<int> flat;
  flat.reserve(2 * pairs.size());
  for (const IndexPair& pair : pairs) flat.insert(flat.end(), pair.begin(), pair.end());
  return to_numpy<IndexMatrix>(std::move(flat), {pairs.size(), 2});
}

/// The type of a sequence of shapes in signatures.
std::string any_shapes();

}  // namespace overlapper::python
