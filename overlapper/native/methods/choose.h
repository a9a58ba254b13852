#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <optional>
#include <span>

#include "geometry/measures.h"
#include "geometry/patch.h"
#include "geometry/thresholds.h"
#include "methods/dual/deepest_ball.h"
#include "methods/dual/region.h"
#include "methods/dual/wide_ball.h"
#include "shapes/shape.h"

namespace overlapper {

/// What the choice of a way depends on.
struct Traits {
  int bodies;
  bool bounded;           ///< one of them is
  bool clippable;         ///< half-spaces, boxes, closed hulls of at most kMostFacetsClipped facets
  bool many_facet_pairs;  ///< two boxes or hulls that can be climbed, with more than kLeastPairsTraced
  bool round;             ///< one of them is a ball, a capsule or a cylinder
  bool rounded;           ///< one of them is a rounded hull
  bool stretched;         ///< one of them is an ellipsoid whose axes differ
  bool flat;              ///< one of them is a box, a hull or a half-space
  bool other;             ///< one of them is smooth, and none of these kinds
};
Traits traits(const Placed& a, const Placed& b);
Traits traits(std::span<const Placed> bodies);

/// A line of the table: which bodies, and the ways that are tried in turn until one answers. Before kDual, the status
/// is found by a search for a plane between the bodies or a ball inside all of them; where kDual leaves more than
/// kEnough of the volume in doubt, kWideDual follows it.
struct Choice {
  const char* bodies;
  bool (*fits)(const Traits&);
  std::array<Way, 4> ways;  ///< up to kDual, which always answers

  bool tries(Way way) const { return std::ranges::find(ways, way) != ways.end(); }
};

/// How bodies are measured. The first line that fits counts, for single calls, batches and groups alike. Numbers of
/// facets and errors that count are in geometry/thresholds.h.
inline constexpr std::array<Choice, 7> kChoices{{
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
    {"two, one of them a rounded hull, and no ellipsoid",
     [](const Traits& t) { return t.bodies == 2 && t.rounded && !t.stretched && !t.other; },
     {Way::kSlicing, Way::kDual}},
    {"all others", [](const Traits&) { return true; }, {Way::kDual}},
}};
const Choice& choose(const Traits& traits);

/// What the ways before the search give: the status beyond doubt, and the measures where doubles, or corners in
/// double-doubles, place the volume within kEnough of itself. Nothing where signs are in doubt, and for round bodies.
std::optional<Measures> measure_at_once(const Placed& a, const Placed& b);
std::optional<Measures> measure_at_once(std::span<const Placed> bodies);

/// Bodies in the order in which they are computed with, about a reference near them: the bits of an answer then do not
/// depend on the caller's order, and keep the digits that coordinates of the world would lose.
struct Arrangement {
  std::vector<int> order;
  std::vector<Placed> relative;
  Vec3 reference;

  std::vector<WideBody> wide_bodies() const;
};
Arrangement arranged(std::span<const Placed> bodies);

/// What is found by looking for the largest ball inside all bodies.
struct Inside {
  std::vector<OwnedPlane> planes;  ///< of all bodies
  DeepestBall ball{};
  std::optional<WideBall> wide_ball;  ///< where it had to be looked for in double-doubles
};

/// What is found by looking for a plane between the bodies, then, if there may be none, for a ball inside all of them.
struct Search {
  Status status = Status::kSeparated;
  Way way = Way::kSeparation;     ///< by which the status is known; kDual or kWideDual if overlapping
  std::vector<double> reaches;    ///< how large the numbers are that describe each body
  double reach = 0;               ///< the largest
  std::vector<OwnedPlane> hints;  ///< for whoever looks for a ball
  std::optional<Vec3> between;    ///< a point inside both, beyond doubt, of a pair whose rounded cores are apart
  std::optional<Inside> inside;   ///< nothing where the status was known without
};
/// Throws std::invalid_argument if the common set is unbounded.
Search search(const Arrangement& at);

/// The ball of bodies that overlap, where the search has not looked for it.
Inside look_inside(const Arrangement& at, const Search& found);

/// m³: what the common set of bodies that only touch may hold. The inradius is rounding, and a convex set's volume is
/// at most its inradius times its surface, which is no larger than that of a box around any of the bodies.
double touching_volume(std::span<const Placed> bodies, const DeepestBall& ball);

/// How large the numbers are that describe a body about the point from which `relative` counts, the corners that its
/// facets miss included.
double magnitude(const Placed& relative);

/// m: how far rounding in double-double may move a plane of bodies that reach so far.
double wide_rounding(double reach);

/// The polytope of bodies that overlap, by dual points; owners are numbers of the bodies as given.
Region grown(const Arrangement& at, const Inside& inside, double reach, double tolerance);

/// Bodies that overlap, with what has been found of them, or is found when asked for.
struct OverlappingBodies {
  const Arrangement& at;
  std::span<const Placed> bodies;
  double tolerance;
  bool traced;  ///< by measure_at_once()
  std::function<const Search&()> search;
  std::function<const Inside&()> inside;
  std::function<const Region&()> region;  ///< owners are numbers of `bodies`
  std::function<const std::optional<MeasuresAndInertia>&()> sliced;
};
/// The region of bodies that overlap as right as any way makes it: of polyhedra, with planes placed in double-doubles.
/// Owners are numbers of the bodies as given.
Region finest_region(const OverlappingBodies& overlapping);

/// By slices of the round shapes themselves, whatever the tolerance. Nothing for bodies that have another way, or where
/// slicing gives up.
std::optional<MeasuresAndInertia> sliced(const OverlappingBodies& overlapping);

/// How much the measures of slices change while the surface of one body moves from as far in as surfaces may have been
/// moved to as far out: by rounding, and by what changes the volume by its error if it moves all of them. The common
/// set grows with it, and of convex sets so do volume and area; and that body lays bare more and more of the other
/// one's surface, and covers more of its own. The truth, and what is stated, lie between. Where surfaces are tangent
/// but for that, the strip that changes hands is as wide as the root of how far they move, and where they coincide it
/// is all of a facet: no slope tells that.
struct Spread {
  double volume, area;  ///< m³, m²
  double owned;         ///< m²: what changes hands
};
/// Nothing where slicing gives up.
std::optional<Spread> spread(const OverlappingBodies& overlapping, const Measures& sliced, const Measures& stated);

/// The patch of a pair with such measures, by slices. Nothing where sliced() has nothing.
std::optional<Patch> sliced_patch(const OverlappingBodies& overlapping, const Measures& measures);

/// What measure_at_once() cannot measure well enough.
MeasuresAndInertia measure_in_full(const OverlappingBodies& overlapping);

}  // namespace overlapper
