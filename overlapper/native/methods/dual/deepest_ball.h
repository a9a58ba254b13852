#pragma once

#include <span>
#include <vector>

#include "geometry/region.h"
#include "geometry/vec.h"
#include "shapes/shape.h"
#include "shapes/wide_body.h"

namespace overlapper {

/// The numbers that a body answers in, doubles or double-doubles.
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

/// The largest ball in the common set of the bodies, as far as it had to be known. Its radius r solves the linear
/// programme max r with dot(n, x) + r <= offset for every supporting plane (n, offset) of every body, four unknowns, of
/// which planes are added one by one: always the one that the present centre violates most (Kelley's cutting planes, by
/// dual simplex). A negative upper bound proves that nothing is common, with at most four planes (Helly; Farkas). A
/// positive lower bound proves the contrary: the centre lies that far inside all planes.
struct DeepestBall {
  Vec3 centre;
  double lower;                  ///< least slack at the centre, negative outside
  double upper;                  ///< no point has more slack than this
  double rounding;               ///< of `lower`
  bool sure;                     ///< `lower` is above zero beyond doubt()
  bool apart;                    ///< `upper` is below zero beyond doubt()
  std::vector<OwnedPlane> cuts;  ///< the planes asked for; they bound the common set
};

/// `planes` holds all facets of the polytopes among the bodies and some tangent planes of the rest. `hints` are further
/// planes to begin with. `reach` says how large the numbers are that each body's planes are made from. Owner -1 marks
/// planes of the simplex around a set that no body bounds.
DeepestBall deepest_ball(std::span<const Placed> bodies, std::span<const double> reach,
                         std::span<const OwnedPlane> planes, std::span<const OwnedPlane> hints);

/// How round a common set is in its frame: it holds the ball of radius 1 / kEccentricity and no dual point is longer
/// than kEccentricity, be it a sliver of any thickness. The origin is the analytic centre of the planes that matter,
/// and the axes are its Dikin ellipsoid (Nesterov and Nemirovskii 1994, section 2), so that the dual points of those
/// planes sum to zero and their second moments to the identity.
inline constexpr double kEccentricity = 16;

/// The frame is found from a point strictly inside all bodies and the cuts, planes that bound the common set; `planes`
/// as above. Bodies are Placed or WideBody, whose planes say what rounding to doubles would hide: a sliver as thin as
/// that.
template <class Body>
FrameAbout<PointOf<Body>> round_frame(std::span<const Body> bodies, std::span<const Owned<PlaneOf<Body>>> planes,
                                      std::vector<Owned<PlaneOf<Body>>> cuts, const PointOf<Body>& inside);

/// The dual point, in the coordinates y, of a plane that has the frame's origin inside.
template <class AnyPlane, class Point>
Vec3 dual_in_frame(const FrameAbout<Point>& frame, const AnyPlane& plane) {
  return rounded(apply_transposed(frame.axes, plane.normal)) / -rounded(signed_distance(plane, frame.origin));
}

}  // namespace overlapper
