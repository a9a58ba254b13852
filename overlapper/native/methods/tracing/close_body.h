#pragma once

#include <array>
#include <span>
#include <vector>

#include "geometry/wide_pose.h"
#include "shapes/mesh.h"

namespace overlapper {

/// The rotation from the second body's axes to those of the first, each entry right to half an ulp.
struct CloseFrame {
  Mat3 turn;
  Vec3 origin;                            ///< the common point in the first body's own coordinates, plain doubles
  Vec3 origin_in_second, rest_in_second;  ///< the same point in the second body's, as head and tail
};
CloseFrame close_frame(const Placed& first, const Placed& second, Vec3 origin);

/// A polytope in the axes of the first body of a pair, about a point that both have in common. A corner is off by a few
/// half-ulps of its distance from that point, however large the bodies are and however far from the world's origin:
/// the point is known in either body's coordinates beyond doubles, and subtracting it comes first. Corners and normals
/// are placed when asked for, so that what nobody asks for costs nothing.
class CloseBody {
 public:
  /// Rounding of a corner, as a share of its distance from the common point: of the first body that of one subtraction;
  /// of the second two, then the entry of the turn, a product and two sums over coordinates that add up to no more than
  /// √3 times the distance: 2 + 4 √3 half-ulps.
  double corner_rounding() const { return (turned_ ? 9 : 1) * 0x1p-53; }

  /// The rounding of a normal's direction: three half-ulps as it was made, and the turn.
  double normal_rounding() const { return (turned_ ? 10 : 3) * 0x1p-53; }

  /// Rounding of a signed distance, as a share of both corners' distances from the common point: that of the corners,
  /// of the normal over their distance, and four half-ulps of that for difference, product and sums: 9 (|v| + |c|) +
  /// (10 + 4) |v - c| or less.
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

  /// A corner once placed is kept for whoever asks again.
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
    Vec3 through;     ///< the facet's corner that is nearest to the common point
    double size;      ///< the distance of that corner from the common point
    double farthest;  ///< the distance of the farthest
  };
  const Side& side(int facet) {
    if (side_placed_[facet] != now_) place_side(facet);
    return sides_[facet];
  }

  /// A point of these coordinates in the body's own, and a direction.
  Vec3 own_point(Vec3 at) const { return own_direction(at) + origin_; }
  Vec3 own_direction(Vec3 direction) const { return turned_ ? apply_transposed(turn_, direction) : direction; }

  /// 1 if the point is certainly inside, -1 if certainly outside, 0 if rounding hides it. Climbs from where the last
  /// answer was.
  int holds(Vec3 at);

 private:
  void place_corner(int vertex);
  void place_side(int facet);

  const Mesh* mesh_ = nullptr;
  bool turned_ = false;
  Mat3 turn_;
  Vec3 origin_, rest_;
  double surely_inside2_ = 0;  ///< the square of a radius about the centroid
  double doubt_ = 0;           ///< of a gauge
  int last_ = -1;              ///< the facet towards the last point asked for
  int now_ = 0;
  std::vector<int> corner_placed_, side_placed_;
  std::vector<PlacedCorner> corners_;
  std::vector<Side> sides_;
};

}  // namespace overlapper
