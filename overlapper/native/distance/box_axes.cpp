#include "distance/box_axes.h"

#include <limits>

#include "geometry/rounding.h"

namespace overlapper {
namespace {

/// Two boxes in the axes of the first box: the columns of `turn` are the axes of the second box.
class AxisSearch {
 public:
  AxisSearch(Vec3 half_a, Vec3 half_b, const Mat3& turn, Vec3 apart)
      : half_a_(half_a), half_b_(half_b), columns_(transposed(turn)), apart_(apart) {}

  Penetration run(double far) {
    for (Vec3 axis : {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}, columns_.row0, columns_.row1, columns_.row2})
      if (consider(axis, 0) < -far) return best_;
    // Where a face and two edges agree to rounding, the face is the better witness.
    const double worth = rounding(max_component(half_a_) + max_component(half_b_));
    for (Vec3 column : {columns_.row0, columns_.row1, columns_.row2})
      // The products with the first box's edges are exactly orthogonal to these edges. The rounding of two nearly
      // parallel edges therefore turns the axis only across both edges.
      for (Vec3 axis : {Vec3{0, -column.z, column.y}, Vec3{column.z, 0, -column.x}, Vec3{-column.y, column.x, 0}}) {
        const double length = std::sqrt(norm2(axis));
        if (length > 0 && consider(axis / length, worth) < -far) return best_;
      }
    return best_;
  }

 private:
  /// Keeps the axis if the boxes part sooner along it than along the best so far, by more than `worth`.
  double consider(Vec3 axis, double worth) {
    const double reach_a = dot(half_a_, abs(axis));
    const double reach_b = dot(half_b_, abs(columns_ * axis));
    const double along = dot(axis, apart_);
    const double depth = reach_a + reach_b - std::abs(along);
    if (depth + worth < best_.depth) best_ = {depth, along < 0 ? -axis : axis};
    return depth;
  }

  Vec3 half_a_, half_b_;
  Mat3 columns_;  ///< by rows: the axes of the second box
  Vec3 apart_;    ///< from the second box to the first
  Penetration best_{std::numeric_limits<double>::infinity(), {}};
};

}  // namespace

std::optional<Penetration> box_penetration(const Placed& a, const Placed& b, double far) {
  const Box *box_a = std::get_if<Box>(&a.shape), *box_b = std::get_if<Box>(&b.shape);
  if (!box_a || !box_b) return std::nullopt;
  const Mat3 into_a = transposed(a.pose.rotation);
  AxisSearch search(box_a->half_extents, box_b->half_extents, into_a * b.pose.rotation,
                    into_a * (a.pose.translation - b.pose.translation));
  Penetration result = search.run(far);
  result.normal = a.pose.rotation * result.normal;
  return result;
}

}  // namespace overlapper
