#pragma once

#include <array>
#include <optional>
#include <vector>

#include "geometry/vec.h"

namespace overlapper {

enum class Status { kSeparated, kTouching, kOverlapping };

/// The way an answer came. methods/choose.h says which is tried when; kWayNames has them as users read them.
enum class Way {
  kSeparation,      ///< doubles prove a gap
  kClipping,        ///< corners of each body held against the planes of the other
  kTracing,         ///< the seam of two surfaces followed from facet to facet
  kClosedForm,      ///< a formula
  kSlicing,         ///< slices of round bodies, integrated
  kDual,            ///< the convex hull of dual points
  kWideSeparation,  ///< double-doubles prove a gap where doubles do not
  kWideClipping,    ///< as kClipping, with corners placed in double-doubles
  kWideDual,        ///< as kDual, with planes placed in double-doubles
  kDoubt,           ///< neither doubles nor double-doubles tell whether there is an inside: the bodies touch
  kPaper,           ///< the article's method, as asked for
};
inline constexpr auto kWayNames = std::to_array<const char*>({
    "separation",
    "clipping",
    "tracing",
    "closed form",
    "slicing",
    "dual hull",
    "wide separation",
    "wide clipping",
    "wide dual hull",
    "doubt",
    "paper",
});
static_assert(kWayNames.size() == static_cast<size_t>(Way::kPaper) + 1, "each way has a name");
inline const char* name(Way way) { return kWayNames[static_cast<size_t>(way)]; }

/// Doubles were not enough for the volume, and it was computed again in wider arithmetic.
inline bool widened(Way way) { return way == Way::kWideClipping || way == Way::kWideDual; }

/// The slopes of the common volume as a body moves.
template <class Vector>
struct PullOf {
  Vector force;   ///< d volume / d translation: the area vector of the facets that the body owns
  Vector moment;  ///< d volume / d rotation vector about some point, which whoever has a pull names

  PullOf& operator+=(const PullOf& other) {
    force += other.force;
    moment += other.moment;
    return *this;
  }
};
using Pull = PullOf<Vec3>;

/// A pull whose moment is about `from`, about `to`.
inline Pull about(const Pull& pull, Vec3 from, Vec3 to) {
  return {pull.force, pull.moment + cross(from - to, pull.force)};
}

/// A pull as six numbers; adding to zero makes no negative zeros.
inline std::array<double, 6> gradient_row(const Pull& pull) {
  const Vec3 force = Vec3{} + pull.force, moment = Vec3{} + pull.moment;
  return {force.x, force.y, force.z, moment.x, moment.y, moment.z};
}

/// The part of an edge in the pull, about the origin, of the patch on the left of the edge. The area vector of a patch
/// and the integral of x × n over the patch are integrals along its border (Stokes).
template <class Vector>
inline PullOf<Vector> pull_along_border(const Vector& from, const Vector& to) {
  return {cross(from, to) / 2.0, (norm2(from) + dot(from, to) + norm2(to)) / 6.0 * (from - to)};
}

/// The relative error of a volume beyond which it is worth computing in another way.
inline constexpr double kEnough = 1e-12;

/// The same for a formula of round bodies: slices take ten times as long, and state errors up to this themselves.
inline constexpr double kEnoughOfRound = 1e-11;
/// Relative error of a volume up to which a formula is believed where slices found no answer.
inline constexpr double kSureOfFormula = 1e-9;

/// The measures of the common set of some bodies, in world coordinates and SI units; zeros unless overlapping.
struct Measures {
  Status status = Status::kSeparated;
  Way way = Way::kSeparation;
  /// Overlapping, and the figures below are as good as any way gives them; otherwise only the status counts.
  bool measured = false;
  int facets_touched = 0;       ///< planes of the bodies that took part
  double volume = 0, area = 0;  ///< m³, m²
  double volume_error = 0;      ///< m³: the true volume is within volume ± volume_error
  bool area_known = true;       ///< false if the area and its error were not asked for
  double area_error = 0;        ///< m²: where it is more than what the error of the volume makes of the area
  double rounding = 0;          ///< m: of slices, how far it may have moved surfaces
  Vec3 centroid;
  std::array<Pull, 2> pulls{};       ///< on the bodies of a pair, each about its body's position
  std::vector<Pull> pulls_of_group;  ///< likewise, on more than two
};

/// Measures, and the inertia but where they are of a formula that has none.
struct MeasuresAndInertia {
  Measures measures;
  std::optional<Mat3> inertia;  ///< about the centroid, at unit density
  double inertia_error = 0;     ///< m⁵: of each entry, where it is more than what the error of the volume makes of it
};

/// Three times the mean of the area on the way, over the area at its beginning, while the planes of a polytope move out
/// by `moved`: what they reach then lies inside the polytope scaled by 1 + moved / least_slack about the point from
/// which the nearest plane is `least_slack` away.
inline double growth(double moved, double least_slack) {
  const double grown = 1 + moved / least_slack;
  return grown * grown + grown + 1;
}

}  // namespace overlapper
