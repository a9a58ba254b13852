#pragma once

#include <span>
#include <vector>

#include "shape.h"
#include "wide_lanes.h"

namespace overlapper {

/// What makes a corner of the common polytope of two bodies: a vertex of one of them, or three facets that meet. Facets
/// of the second body are numbered after those of the first.
struct Corner {
  int body, vertex;           ///< vertex is -1 where facets meet
  std::array<int, 3> facets;  ///< only then
};

/// The corners of the common polytope of two bodies in double-double, from the numbers that define these: corners of
/// hulls, half extents, positions, and orientations taken as the exact rotations that their quaternions stand for.
class WideCorners {
 public:
  /// All coordinates are the first body's, counted from `origin`; `reach` is how large the numbers are that describe
  /// the bodies in them.
  void begin(const Placed& a, const Placed& b, int first_facets, int facets, Vec3 origin, double reach);

  /// The plane of a facet; false if it has one only because rounding has merged several.
  bool add_plane(int facet);

  /// Replaces vertices that doubles have placed by their coordinates along orthogonal axes, the rows of `axes`: each
  /// right to half an ulp of itself and noise(). The planes of all their facets must have been added.
  void place(std::span<const Corner> corners, const Mat3& axes, std::vector<Vec3>& vertices);

  double noise() const { return noise_; }  ///< m

 private:
  /// A normal, of length 1 but for rounding, and its offset.
  struct WidePlane {
    WideVector normal;
    DoubleDouble level;
  };

  Vec3 beside_planes(const std::array<int, 3>& facets, Vec3 vertex);
  Vec3 beside_vertex(const Corner& corner, Vec3 vertex) const;

  const Placed *a_ = nullptr, *b_ = nullptr;
  int first_facets_ = 0;
  WideColumns columns_, rows_;  ///< of the rotation from the second body's coordinates to the first's
  WideVector translation_;      ///< and what follows it
  Vec3 origin_;
  std::vector<WidePlane> planes_;
  double lost_ = 0;  ///< m: what a few dozen operations in double-double lose
  double noise_ = 0;
};

}  // namespace overlapper
