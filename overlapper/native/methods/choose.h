#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <optional>
#include <span>

#include "geometry/measures.h"
#include "geometry/patch.h"
#include "geometry/thresholds.h"
#include "methods/clipping/clip.h"
#include "methods/dual/deepest_ball.h"
#include "methods/dual/region.h"
#include "methods/dual/wide_ball.h"
#include "shapes/shape.h"

namespace overlapper {

/// The properties of a pair or group that the choice of a way depends on.
struct Traits {
  int bodies;
  bool bounded;           ///< at least one body is
  bool clippable;         ///< only half-spaces, boxes and closed hulls of at most kMostFacetsClipped facets
  bool many_facet_pairs;  ///< two boxes or hulls with graphs, with more than kLeastPairsTraced pairs of facets
  bool round;             ///< at least one ball, capsule or cylinder
  bool rounded;           ///< at least one rounded hull
  bool stretched;         ///< at least one ellipsoid with different axes
  bool flat;              ///< at least one box, hull or half-space
  bool other;             ///< at least one smooth body of another kind
  int ellipsoids;         ///< number of balls and ellipsoids
};
Traits traits(const Placed& a, const Placed& b);
Traits traits(std::span<const Placed> bodies);

/// A line of the table: a condition on the bodies, and the ways to try in turn until one answers. Before kDual, a
/// search finds the status: a plane between the bodies, or a ball inside all of them. If kDual leaves more than kEnough
/// of the volume in doubt, kWideDual follows.
struct Choice {
  const char* bodies;
  bool (*fits)(const Traits&);
  std::array<Way, 4> ways;  ///< up to kDual, which always answers

  bool tries(Way way) const { return std::ranges::find(ways, way) != ways.end(); }
};

/// The choice of ways. The first line that fits counts, for single calls, batches and groups alike. Limits for facets
/// and errors are in geometry/thresholds.h.
inline constexpr std::array<Choice, 10> kChoices{{
    {"two boxes or hulls of many facets",
     [](const Traits& t) { return t.many_facet_pairs && t.clippable; },
     {Way::kTracing, Way::kClipping, Way::kWideClipping, Way::kDual}},
    {"two boxes or hulls, one of very many facets",
     [](const Traits& t) { return t.many_facet_pairs; },
     {Way::kTracing, Way::kDual}},
    {"two or more boxes, hulls and half-spaces",
     [](const Traits& t) { return t.clippable && t.bounded; },
     {Way::kClipping, Way::kWideClipping, Way::kDual}},
    {"two, one of them a ball, a capsule or a cylinder, and no rounded hull or ellipsoid",
     [](const Traits& t) { return t.bodies == 2 && t.round && !t.rounded && !t.stretched && !t.other; },
     {Way::kClosedForm, Way::kSlicing, Way::kDual}},
    {"an ellipsoid, and a box, a hull or a half-space",
     [](const Traits& t) { return t.bodies == 2 && t.stretched && t.flat; },
     {Way::kClosedForm, Way::kSlicing, Way::kDual}},
    {"an ellipsoid and a rounded hull",
     [](const Traits& t) { return t.bodies == 2 && t.stretched && t.rounded && !t.other; },
     {Way::kClosedForm, Way::kSlicing, Way::kDual}},
    {"an ellipsoid, and another round body",
     [](const Traits& t) { return t.bodies == 2 && t.stretched && !t.other; },
     {Way::kSlicing, Way::kDual}},
    {"two, one of them a rounded hull, and no ellipsoid",
     [](const Traits& t) { return t.bodies == 2 && t.rounded && !t.stretched && !t.other; },
     {Way::kClosedForm, Way::kSlicing, Way::kDual}},
    {"three or more, at least one of them round, and no ellipsoid",
     [](const Traits& t) { return t.bodies > 2 && (t.round || t.rounded) && !t.stretched && !t.other; },
     {Way::kSlicing, Way::kDual}},
    {"all others", [](const Traits&) { return true; }, {Way::kDual}},
}};
const Choice& choose(const Traits& traits);

/// The answer of the ways before the search: a certain status, and measures if the error of the volume is within
/// kEnough of the volume. Corners may be placed in double-double. No value if signs are uncertain, or for round bodies.
/// `sides` gets areas and `patch` the patch if clipping has measured the pair; see clip().
std::optional<Measures> measure_at_once(const Placed& a, const Placed& b, std::optional<SideAreas>* sides = nullptr,
                                        std::optional<Patch>* patch = nullptr);
std::optional<Measures> measure_at_once(std::span<const Placed> bodies);

/// The bodies in canonical order, relative to a reference near them. The bits of an answer then do not depend on the
/// caller's order. Coordinates keep the digits that world coordinates would lose.
struct Arrangement {
  std::vector<int> order;
  std::vector<Placed> relative;
  Vec3 reference;

  std::vector<WideBody> wide_bodies() const;
};
Arrangement arranged(std::span<const Placed> bodies);

/// The result of a search for the largest ball inside all bodies.
struct Inside {
  std::vector<OwnedPlane> planes;  ///< of all bodies
  DeepestBall ball{};
  std::optional<WideBall> wide_ball;  ///< set if the search needed double-double
};

/// The result of a search for a plane between the bodies and, if there may be none, for a ball inside all of them.
struct Search {
  Status status = Status::kSeparated;
  Way way = Way::kSeparation;     ///< the way that gave the status; kDual or kWideDual if overlapping
  std::vector<double> reaches;    ///< size of the numbers that describe each body
  double reach = 0;               ///< the largest of `reaches`
  std::vector<OwnedPlane> hints;  ///< planes for a search for a ball to start with
  std::optional<Vec3> between;    ///< a point certainly inside both bodies of a pair, if one was found
  std::optional<Vec3> nearest;    ///< the point of a flat body that is deepest in a round one, or nearly so
  double depth = 0;               ///< m: of that point
  std::optional<Inside> inside;   ///< no value if the status was known without it
};
/// Throws std::invalid_argument if the common set is unbounded.
Search search(const Arrangement& at);

/// The ball of bodies that overlap, if the search has not found it yet.
Inside look_inside(const Arrangement& at, const Search& found);

/// m³: upper bound of the common volume of bodies that only touch. The inradius is rounding error. The volume of a
/// convex set is at most its inradius times its surface. Its surface is at most that of a box around any of the bodies.
double touching_volume(std::span<const Placed> bodies, const DeepestBall& ball);

/// Size of the numbers that describe a body in the coordinates of `relative`, including corners that its facets miss.
double magnitude(const Placed& relative);

/// m: bound of a plane's movement by rounding in double-double, for bodies of that reach.
double wide_rounding(double reach);

/// The polytope of bodies that overlap, by dual points; owners are the numbers of the bodies as given.
Region grown(const Arrangement& at, const Inside& inside, double reach, double tolerance);

/// Bodies that overlap, with known results and results on demand.
struct OverlappingBodies {
  const Arrangement& at;
  std::span<const Placed> bodies;
  double tolerance;
  bool traced;  ///< true if measure_at_once() used tracing
  std::function<const Search&()> search;
  std::function<const Inside&()> inside;
  std::function<const Region&()> region;                             ///< owners are numbers of `bodies`
  std::function<const std::optional<MeasuresAndInertia>&()> sliced;  ///< areas may be left out
  std::function<const std::optional<VolumeAlone>&()> volume_alone;
};

/// The volume of bodies that overlap, by a formula that gives nothing else. No value for bodies without such a formula,
/// or if its error is more than kEnough of the volume. Otherwise this is the volume of all measures.
std::optional<VolumeAlone> volume_alone(const OverlappingBodies& overlapping);

/// The most accurate region of bodies that overlap: for polyhedra, with planes placed in double-double. Owners are the
/// numbers of the bodies as given.
Region finest_region(const OverlappingBodies& overlapping);

/// Measures by slices of the round shapes themselves, for any tolerance. No value for bodies with another way, or if
/// slicing gives up. Areas may be left out unless they are wanted.
std::optional<MeasuresAndInertia> sliced(const OverlappingBodies& overlapping, bool with_area);

/// The change of the measures by slices while the surface of one body moves between its error bounds, from inside to
/// outside. The bounds include rounding and the movement that alone would explain the error of the volume.
///
/// Volume and area of convex sets are monotone under inclusion. A growing body exposes less of the other body's surface
/// and more of its own. The true values and the stated values therefore lie between the two ends. Where surfaces are
/// nearly tangent, the strip of uncertain owner is as wide as the square root of the movement. Where surfaces coincide,
/// it is a whole facet. No derivative shows that.
struct Spread {
  double volume, area;  ///< m³, m²
  double owned;         ///< m²: area of uncertain owner
};
/// No value if slicing gives up.
std::optional<Spread> spread(const OverlappingBodies& overlapping, const Measures& sliced, const Measures& stated);

/// The patch of a pair with this centroid and area vector, by slices. No value where sliced() has none.
std::optional<Patch> sliced_patch(const OverlappingBodies& overlapping, Vec3 centroid, Vec3 area);

/// Measures of bodies for which measure_at_once() is not accurate enough.
MeasuresAndInertia measure_in_full(const OverlappingBodies& overlapping);

}  // namespace overlapper
