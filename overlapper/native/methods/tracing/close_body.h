#pragma once

#include <array>
#include <span>
#include <vector>

#include "geometry/wide_pose.h"
#include "shapes/mesh.h"

namespace overlapper {

/// The rotation from the second body's axes to the first's; the error of each entry is half an ulp.
struct CloseFrame {
  Mat3 turn;
  Vec3 origin;                            ///< the common point in the first body's own coordinates, plain doubles
  Vec3 origin_in_second, rest_in_second;  ///< the same point in the second body's coordinates, as head and tail
};
CloseFrame close_frame(const Placed& first, const Placed& second, Vec3 origin);

/// A polytope in the axes of the first body of a pair, about a common point of both. The error of a corner is a few
/// half-ulps of its distance from that point, for bodies of any size and at any distance from the world's origin. The
/// point is known beyond doubles in either body's coordinates, and is subtracted first. Corners and normals are placed
/// on demand.
class CloseBody {
 public:
  /// Rounding of a corner, relative to its distance from the common point. For the first body it is one subtraction.
  /// For the second it is two subtractions, the entry of the turn, a product and two sums. The coordinates add up to at
  /// most √3 times the distance: 2 + 4 √3 half-ulps.
  double corner_rounding() const { return (turned_ ? 9 : 1) * 0x1p-53; }

  /// Error of a normal's direction: three half-ulps from its construction, and the turn.
  double normal_rounding() const { return (turned_ ? 10 : 3) * 0x1p-53; }

  /// Rounding of a signed distance, relative to both corners' distances from the common point. It includes the error of
  /// the corners, the error of the normal times their distance, and four half-ulps for difference, product and sums. In
  /// half-ulps: at most 9 (|v| + |c|) + (10 + 4) |v - c|.
  static constexpr double kSign = 32 * 0x1p-53;

  void set(const Mesh& mesh, const CloseFrame& frame, bool is_second);

  const Mesh& mesh() const { return *mesh_; }
  const HullData& data() const { return mesh_->data(); }
  const HullGraph& graph() const { return mesh_->graph(); }
  int begin(int half_edge) const { return data().ring[half_edge]; }
  int end(int half_edge) const { return data().ring[graph().next[half_edge]]; }
  int twin(int half_edge) const { return graph().twin[half_edge]; }
  int facet(int half_edge) const { return graph().facet[half_edge]; }
  int previous(int half_edge) const {
    const int f = facet(half_edge);
    return half_edge == data().ring_start[f] ? data().ring_start[f + 1] - 1 : half_edge - 1;
  }

  Vec3 placed(int vertex) const {
    const Vec3 own = (data().vertices[vertex] - origin_) - rest_;
    return turned_ ? turn_ * own : own;
  }

  /// A placed corner, kept for further calls.
  struct PlacedCorner {
    Vec3 at;
    double size;  ///< its distance from the common point
  };
  const PlacedCorner& corner(int vertex) {
    if (corner_placed_[vertex] != now_) place_corner(vertex);
    return corners_[vertex];
  }
  struct Side {
    Vec3 normal;
    Vec3 through;     ///< the facet's nearest corner to the common point
    double size;      ///< the distance of that corner from the common point
    double farthest;  ///< the distance of the facet's farthest corner
  };
  const Side& side(int facet) {
    if (side_placed_[facet] != now_) place_side(facet);
    return sides_[facet];
  }

  /// Maps a point of these coordinates, or a direction, to the body's own.
  Vec3 own_point(Vec3 at) const { return own_direction(at) + origin_; }
  Vec3 own_direction(Vec3 direction) const { return turned_ ? apply_transposed(turn_, direction) : direction; }

  /// 1 if the point is certainly inside, -1 if certainly outside, 0 if rounding hides it. Climbs from the last answer.
  int holds(Vec3 at);

 private:
  void place_corner(int vertex);
  void place_side(int facet);

  const Mesh* mesh_ = nullptr;
  bool turned_ = false;
  Mat3 turn_;
  Vec3 origin_, rest_;
  double surely_inside2_ = 0;  ///< the square of a safe radius about the centroid
  double doubt_ = 0;           ///< of a gauge
  int last_ = -1;              ///< the facet towards the last point
  int now_ = 0;
  std::vector<int> corner_placed_, side_placed_;
  std::vector<PlacedCorner> corners_;
  std::vector<Side> sides_;
};

}  // namespace overlapper
