#pragma once

#include <span>
#include <vector>

#include "batch/box_tree.h"
#include "shapes/shape.h"

namespace overlapper {

/// Placed shapes of one kind, a row each.
struct ShapeArray {
  const char* kind = "";
  std::vector<Placed> rows;
  /// True for rectangles in the plane. They are boxes of height 1, so that volumes are areas.
  bool planar = false;

  size_t size() const { return rows.size(); }
};

/// The pairs of two arrays: row i of both, or every row of the first with every row of the second. Values of pairs are
/// arranged by rows: one per pair for kRows, otherwise a row for each row of the first array.
enum class Pairing { kRows, kAll };

/// Writes the common volume of each pair, in m³. Rectangles must not meet other shapes. The bits do not depend on
/// `threads`. False if the caller cancels.
///
/// Volumes of two boxes are those of volumes_of_boxes() if their error is within kEnough. All others have the bits of
/// Overlap(a, b, tolerance).volume().
bool common_volumes(const ShapeArray& a, const ShapeArray& b, Pairing pairing, double tolerance, int threads,
                    std::span<double> volumes);

/// Writes the volume of the convex hull of each pair of boxes, in m³; otherwise as common_volumes().
bool volumes_around(const ShapeArray& a, const ShapeArray& b, Pairing pairing, int threads, std::span<double> volumes);

/// The derivatives of a weighted sum of common volumes by the numbers of one row. These are the numbers of its shape,
/// as in shape_gradient(), its position, and a rotation vector about its position.
struct RowGradient {
  Vec3 shape, position, rotation;
};

/// Adds the derivatives of the weighted sum of the common volumes of pairs to the rows of both arrays. The weights are
/// arranged as the values of pairs. The bits do not depend on `threads`. False if the caller cancels.
bool add_gradients(const ShapeArray& a, const ShapeArray& b, Pairing pairing, std::span<const double> weights,
                   double tolerance, int threads, std::span<RowGradient> of_a, std::span<RowGradient> of_b);

/// The second derivatives of the weighted sum of common volumes, times a direction with the numbers `along_a` and
/// `along_b` of the rows. Adds them to the rows of both arrays. Writes each pair's first derivative along the direction
/// to `slopes`, arranged as the weights. Otherwise as add_gradients().
bool add_second_derivatives(const ShapeArray& a, const ShapeArray& b, Pairing pairing, std::span<const double> weights,
                            std::span<const RowGradient> along_a, std::span<const RowGradient> along_b,
                            double tolerance, int threads, std::span<double> slopes, std::span<RowGradient> of_a,
                            std::span<RowGradient> of_b);

}  // namespace overlapper
