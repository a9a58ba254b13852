#pragma once

#include <array>
#include <limits>
#include <optional>
#include <vector>

#include "shapes/wide_body.h"

namespace overlapper {

/// Bound of the rounding error of dot(direction, point), as a fraction of the point's distance from the origin. The
/// direction is in doubles and right to the last bits.
inline constexpr double kLost = 0x1p-46;

/// Error of a direction in double-double, times the sine of the angle between the two vectors it was made from.
inline constexpr double kLostWide = 0x1p-96;

/// A corner, relative to a point near the contact.
struct NearCorner {
  Vec3 at;
  double lost;      ///< m: rounding error of dot products with it
  int number = -1;  ///< among all corners
};

struct NearFacet {
  Vec3 normal;
  std::array<int, 3> corners;  ///< as in CoreSurface
};

struct NearRidge {
  int from, to, left, right;  ///< -1: no facet beside the edge of a segment
  Vec3 along;                 ///< unit
  NearCorner near;            ///< its point nearest to the origin
};

/// The corners, facets and ridges of a polytope, in doubles relative to a point near the contact. The error of a
/// coordinate is proportional to its size. A point and a segment, the cores of spheres and capsules, count as
/// polytopes.
class NearPolytope {
 public:
  NearPolytope(const WideBody& body, const WideVector& about);

  /// Keeps the corners beyond a plane. Then finds the facets and ridges with any of these corners.
  void cut(Vec3 direction, double height);

  std::vector<NearCorner> corners;
  std::vector<NearFacet> facets;
  std::vector<NearRidge> ridges;
  double radius = 0;  ///< of all corners, about the origin

  WideVector corner(int i) const { return body_.placed(wide(local_[i])); }
  WideVector corner(const NearCorner& c) const { return corner(c.number); }
  WideVector normal(const NearFacet& facet) const;
  WideVector along(const NearRidge& ridge) const;

  /// Error of that normal; larger for a needle.
  double lost(const NearFacet& facet) const;

  /// Lower and upper bound of the support along any direction that rounds to `direction`.
  double least_reach(Vec3 direction) const;
  double most_reach(Vec3 direction) const;

 private:
  /// True if the facets beside the ridge are exactly in one plane. The ridge then gives no direction that the facets do
  /// not give.
  bool in_a_plane(const Edge& ridge, const CoreSurface& surface) const;
  void complete(NearRidge& ridge) const;
  NearCorner nearest(const NearRidge& ridge) const;

  const WideBody& body_;
  WideVector about_;
  std::vector<Vec3> local_;
  /// The corner farthest from the contact. Without it, the reach in a direction into the body would be only that of the
  /// kept corners at the contact.
  std::optional<NearCorner> opposite_;
};

}  // namespace overlapper
