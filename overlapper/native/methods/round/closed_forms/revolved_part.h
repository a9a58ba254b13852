#pragma once

#include <cfloat>

#include "methods/round/closed_forms/revolved.h"
#include "methods/round/quadric/gauss.h"
#include "shapes/wide_body.h"

namespace overlapper::closed_forms {

/// A sum is right to this fraction of the size of its terms.
inline constexpr double kSummation = 64 * DBL_EPSILON;

/// The part of a body of revolution that one plane leaves. Coordinates lie in the plane through the axis that is
/// orthogonal to the cut: x along the axis, y across it, and the third is zero by symmetry.
struct RevolvedPart {
  double volume = 0;
  Vec3 moment;  ///< ∫ x dV
  double flat_area = 0;
  Vec3 flat_moment;  ///< ∫ x dA over the cut
  double curved_area = 0;
  double scale = 0;  ///< m³: the size of terms that cancelled, for the rounding of the sum

  RevolvedPart& operator+=(const RevolvedPart& other) {
    volume += other.volume;
    moment += other.moment;
    flat_area += other.flat_area;
    flat_moment += other.flat_moment;
    curved_area += other.curved_area;
    scale += other.scale;
    return *this;
  }

  /// The same part about another point of the axis.
  RevolvedPart shifted(double along) const {
    RevolvedPart result = *this;
    result.moment.x += along * volume;
    result.flat_moment.x += along * flat_area;
    return result;
  }

  RevolvedPart mirrored() const {
    RevolvedPart result = *this;
    result.moment.x = -moment.x;
    result.flat_moment.x = -flat_moment.x;
    return result;
  }
};

/// The cap of height h, from 0 to 2 r, of a ball about the origin: where dot(direction, x) <= h - r.
RevolvedPart cap(double r, double h, Vec3 direction);

/// How a plane cuts a body, in the plane through the axis that is orthogonal to the cut. The numbers are rounded from
/// double-doubles, so that the shallowest of cuts have all their digits.
struct PlaneCut {
  double sine = 0, cosine = 0;  ///< of its normal, along the axis and across
  double offset = 0;            ///< about the centre
  double upper = 0, lower = 0;  ///< depth of the plane in the balls about the ends of the axis
  /// The distance by which the plane has passed the side y = -r, times the cosine: `enter` where it enters the upper
  /// end of the cylinder, and `leave` where it leaves the lower end.
  double enter = 0, leave = 0;
};
PlaneCut cut_of(const Revolved& body, const WideAxis& at, const WidePlane& plane);

/// Directions in the plane through the axis that is orthogonal to a cut: the axis, on the side of the cut's normal,
/// and across it.
struct SymmetryFrame {
  Vec3 axis, sideways;

  SymmetryFrame(const Revolved& body, Vec3 normal) {
    if (body.ball()) {
      axis = any_orthogonal(normal), sideways = normal;
      return;
    }
    axis = dot(body.axis, normal) < 0 ? -body.axis : body.axis;
    const Vec3 across = normal - dot(normal, axis) * axis;
    sideways = norm2(across) > 0 ? unit(across) : any_orthogonal(axis);
  }
};

/// The part of the body that the plane leaves.
RevolvedPart below(const Revolved& body, const PlaneCut& cut);

/// The angle θ at which y = −r cos θ has risen from −r by `risen`.
double angle_at(double r, double risen);
/// angle_at(r, risen + more) − angle_at(r, risen), without cancellation.
double angle_between(double r, double risen, double more);

/// Calls integrand(x, x - from, weight) at Gauss's sixteen nodes: they integrate cos(4θ) over half a turn to
/// rounding.
template <class Integrand>
void integrate(double from, double width, Integrand integrand) {
  for (int i = 0; i < 8; ++i)
    for (const double side : {-1.0, 1.0}) {
      const double advance = width * (1 + side * quadric::kGaussNode[i]) / 2;
      integrand(from + advance, advance, width * quadric::kGaussWeight[i] / 2);
    }
}

}  // namespace overlapper::closed_forms
