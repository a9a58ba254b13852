#pragma once

#include <array>
#include <limits>
#include <vector>

#include "shapes/wide_body.h"

namespace overlapper {

/// Of directions in doubles that are right to the last bits, and of dot products with them: the share of a point's
/// distance from the origin that may be lost.
inline constexpr double kLost = 0x1p-46;

/// Directions in double-double, per sine of the angle that they were made from.
inline constexpr double kLostWide = 0x1p-96;

/// A corner about a point near the contact.
struct NearCorner {
  Vec3 at;
  double lost;      ///< m: of dot products with it
  int number = -1;  ///< among all corners
};

struct NearFacet {
  Vec3 normal;
  std::array<int, 3> corners;  ///< as in CoreSurface
};

struct NearRidge {
  int from, to, left, right;  ///< no facets beside a segment: -1
  Vec3 along;                 ///< unit
  NearCorner near;            ///< its point nearest to the origin
};

/// What a polytope is made of, in doubles about a point near the contact: every number is as exact as it is near. A
/// point and a segment, the cores of balls and capsules, are polytopes too.
class NearPolytope {
 public:
  NearPolytope(const WideBody& body, const WideVector& about);

  /// Keeps the corners beyond a plane, then finds the facets and ridges that any of them belongs to.
  void cut(Vec3 direction, double height);

  std::vector<NearCorner> corners;
  std::vector<NearFacet> facets;
  std::vector<NearRidge> ridges;
  double radius = 0;  ///< about the origin, of all corners

  WideVector corner(int i) const { return body_.placed(wide(local_[i])); }
  WideVector corner(const NearCorner& c) const { return corner(c.number); }
  WideVector normal(const NearFacet& facet) const;
  WideVector along(const NearRidge& ridge) const;

  /// How far off that normal may be: more for a needle.
  double lost(const NearFacet& facet) const;

  /// At least and at most so far it reaches along any direction that `direction` may be the rounding of.
  double least_reach(Vec3 direction) const;
  double most_reach(Vec3 direction) const;

 private:
  void complete(NearRidge& ridge) const;
  NearCorner nearest(const NearRidge& ridge) const;

  const WideBody& body_;
  WideVector about_;
  std::vector<Vec3> local_;
};

}  // namespace overlapper
