#pragma once

#include <span>
#include <vector>

#include "geometry/region.h"
#include "geometry/vec.h"
#include "shapes/shape.h"
#include "shapes/wide_body.h"

namespace overlapper {

/// The scalars of a body's answers, doubles or double-doubles.
template <class Body>
using PlaneOf = decltype(std::declval<const Body&>().tightest({}));
template <class Body>
using PointOf = decltype(PlaneOf<Body>::normal);

/// A plane of body number `owner`.
template <class AnyPlane>
struct Owned {
  AnyPlane plane;
  int owner;
};
using OwnedPlane = Owned<Plane>;

/// The largest ball in the common set of the bodies, computed as far as needed. Its radius r solves the linear
/// programme max r with dot(n, x) + r <= offset for every supporting plane (n, offset) of every body, in four unknowns.
/// Planes are added one by one: always the plane that the present centre violates most (Kelley's cutting planes, by
/// dual simplex). A negative upper bound proves that the common set is empty, with at most four planes (Helly; Farkas).
/// A positive lower bound proves overlap: the centre lies that far inside all planes.
struct DeepestBall {
  Vec3 centre;
  double lower;                  ///< least slack at the centre, negative outside
  double upper;                  ///< largest slack of any point
  double rounding;               ///< error of `lower`
  bool sure;                     ///< `lower` is certainly above zero, by more than doubt()
  bool apart;                    ///< `upper` is certainly below zero, by more than doubt()
  std::vector<OwnedPlane> cuts;  ///< the evaluated planes; they bound the common set
};

/// `planes` holds all facets of the polytopes among the bodies and some tangent planes of the others. `hints` are
/// further planes to start with. `reach` is the size of the numbers behind each body's planes. Owner -1 marks planes of
/// the simplex around a set that no body bounds.
DeepestBall deepest_ball(std::span<const Placed> bodies, std::span<const double> reach,
                         std::span<const OwnedPlane> planes, std::span<const OwnedPlane> hints);

/// How round a common set is in its frame: it contains the ball of radius 1 / kEccentricity, and no dual point is
/// longer than kEccentricity. This holds for slivers of any thickness. The origin is the analytic centre of the
/// relevant planes. The axes are those of its Dikin ellipsoid (Nesterov and Nemirovskii 1994, section 2). The dual
/// points of these planes therefore sum to zero, and their second moments to the identity.
inline constexpr double kEccentricity = 16;

/// The frame, from a point strictly inside all bodies and the cuts, which bound the common set; `planes` as above.
/// Bodies are Placed or WideBody. The planes of a WideBody resolve slivers as thin as the rounding of doubles.
template <class Body>
FrameAbout<PointOf<Body>> round_frame(std::span<const Body> bodies, std::span<const Owned<PlaneOf<Body>>> planes,
                                      std::vector<Owned<PlaneOf<Body>>> cuts, const PointOf<Body>& inside);

/// The dual point, in the coordinates y, of a plane with the frame's origin inside.
template <class AnyPlane, class Point>
Vec3 dual_in_frame(const FrameAbout<Point>& frame, const AnyPlane& plane) {
  return rounded(apply_transposed(frame.axes, plane.normal)) / -rounded(signed_distance(plane, frame.origin));
}

}  // namespace overlapper
