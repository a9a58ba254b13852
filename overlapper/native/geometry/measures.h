#pragma once

#include <array>
#include <optional>
#include <vector>

#include "geometry/vec.h"

namespace overlapper {

enum class Status { kSeparated, kTouching, kOverlapping };

/// The way that gave an answer. methods/choose.h defines the order of trial, and kWayNames has the names for users.
enum class Way {
  kSeparation,      ///< doubles prove a gap
  kClipping,        ///< corners of each body compared with the planes of the other
  kTracing,         ///< the seam of two surfaces followed from facet to facet
  kClosedForm,      ///< a formula
  kSlicing,         ///< slices of round bodies, integrated
  kDual,            ///< the convex hull of dual points
  kWideSeparation,  ///< double-doubles prove a gap, after doubles failed
  kWideClipping,    ///< as kClipping, with corners placed in double-doubles
  kWideDual,        ///< as kDual, with planes placed in double-doubles
  kDoubt,           ///< the bodies touch: neither doubles nor double-doubles find an interior
  kPaper,           ///< the article's method, on request
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

/// The derivatives of the common volume with respect to a body's motion.
template <class Vector>
struct PullOf {
  Vector force;   ///< d volume / d translation: the area vector of the facets that the body owns
  Vector moment;  ///< d volume / d rotation vector about some point that the owner of the pull defines

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

/// A pull as six numbers. Adding to zero removes negative zeros.
inline std::array<double, 6> gradient_row(const Pull& pull) {
  const Vec3 force = Vec3{} + pull.force, moment = Vec3{} + pull.moment;
  return {force.x, force.y, force.z, moment.x, moment.y, moment.z};
}

/// An edge's part of the pull of the patch on its left, about the origin. The area vector of a patch, and the integral
/// of x × n over it, are integrals along its border (Stokes).
template <class Vector>
inline PullOf<Vector> pull_along_border(const Vector& from, const Vector& to) {
  return {cross(from, to) / 2.0, (norm2(from) + dot(from, to) + norm2(to)) / 6.0 * (from - to)};
}

/// If the relative error of a volume is larger, another way is tried.
inline constexpr double kEnough = 1e-12;

/// The same for a formula of round bodies. Slices take ten times as long, and their own stated errors are as large.
inline constexpr double kEnoughOfRound = 1e-11;
/// If slices give no answer, a formula is accepted up to this relative error of the volume.
inline constexpr double kSureOfFormula = 1e-9;

/// The measures of the common set of some bodies, in world coordinates and SI units; zeros unless overlapping.
struct Measures {
  Status status = Status::kSeparated;
  Way way = Way::kSeparation;
  /// True if the bodies overlap and the numbers below are final; otherwise only the status counts.
  bool measured = false;
  int facets_touched = 0;       ///< number of planes of the bodies in the measures
  double volume = 0, area = 0;  ///< m³, m²
  double volume_error = 0;      ///< m³: the true volume is within volume ± volume_error
  bool area_known = true;       ///< false if the area and its error were not requested
  double area_error = 0;        ///< m²: if larger than the effect of the volume's error on the area
  double rounding = 0;          ///< m: for slices, possible movement of surfaces by rounding
  Vec3 centroid;
  std::array<Pull, 2> pulls{};       ///< on the bodies of a pair, each about its body's position
  std::vector<Pull> pulls_of_group;  ///< likewise, on more than two
};

/// A volume by a formula that gives no other measures.
struct VolumeAlone {
  double volume = 0, error = 0;  ///< m³
};

/// Measures, and the inertia. A formula may have no inertia.
struct MeasuresAndInertia {
  Measures measures;
  std::optional<Mat3> inertia;  ///< about the centroid, at unit density
  double inertia_error = 0;     ///< m⁵: of each entry, if larger than the effect of the volume's error
};

/// The planes of a polytope move out by `moved`. The result is three times the mean of the area on the way, over the
/// area at the beginning. The nearest plane is `least_slack` from some point. The moved polytope lies inside the
/// polytope scaled by 1 + moved / least_slack about this point.
inline double growth(double moved, double least_slack) {
  const double grown = 1 + moved / least_slack;
  return grown * grown + grown + 1;
}

}  // namespace overlapper
