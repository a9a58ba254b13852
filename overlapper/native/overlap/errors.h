#pragma once

#include <array>
#include <span>
#include <vector>

#include "methods/choose.h"
#include "methods/dual/region.h"
#include "overlap/boundary.h"
#include "shapes/shape.h"

namespace overlapper {

/// Error bounds of the measures of a common set, in world coordinates and SI units.
struct Errors {
  double volume = 0;                            ///< m³
  double area = 0;                              ///< m²
  double centroid = 0;                          ///< m: distance from the true centroid
  double inertia = 0;                           ///< m⁵, for each entry
  std::vector<std::array<double, 2>> gradient;  ///< per body: m², length of the force's error; m³, of the moment's
};

/// Measures to be given error bounds.
struct Stated {
  double area = 0;
  Vec3 centroid;
  Mat3 inertia{{}, {}, {}};
  std::vector<std::array<double, 6>> gradient;
};

struct StatedWithErrors {
  Stated stated;
  Errors errors;
  double displaced = 0;  ///< m: errors.centroid without the last bits of world coordinates
  double radius = 0;     ///< m: upper bound of the distance of points from the centroid
};

/// The measures of a region, and how far they may be from those of the common set.
///
/// The polytope P has the origin of the region's frame inside. Let s_f be the slack of plane f at the origin, and d_f
/// the bound of its movement by rounding. The common set then lies between λP and μP, with μ = 1 + max d_f / s_f. λ is
/// 2 - μ, less how far vertices are pulled into smooth shapes. Volume and area of convex sets are monotone under
/// inclusion, which bounds both. The volumes of the two sets differ by at most (μ³ - λ³) times the volume. All of that
/// difference is no farther from the centroid than the farthest vertex, which bounds the centroid and the inertia.
///
/// The gradient depends on the owner of each facet. The owner is certain at a point of a facet if no plane of another
/// body is as near as both planes may have moved. Elsewhere, in a strip along the seam or on a facet that two bodies
/// share, either body may own the area.
StatedWithErrors measured_with_errors(const Region& region, std::span<const Placed> bodies);

/// m: bound of the Hausdorff distance between the common set and the hull of the vertices of a region's boundary, at
/// most the diameter of the smallest body.
double error_of_vertices(const Region& region, const Boundary& boundary, std::span<const Placed> bodies);

/// The errors of `stated`, compared with other measures whose errors are known: the known errors plus the difference of
/// the two. The error of the volume is taken over.
Errors errors_beside(const StatedWithErrors& other, const Stated& stated);

/// The errors of measures by slices or by a closed form, from the errors of the slices. The volume's error comes from
/// rounding of the arguments. No measure has a degree in the arguments more than four higher than the volume. Areas and
/// their owners depend on where surfaces are, as `spread` tells. Where surfaces are tangent, or nearly, areas change
/// far more than the surfaces move. Ownership by slices and by a closed form has the same bounds. All other errors grow
/// by the difference of the two.
Errors errors_of_slices(const MeasuresAndInertia& sliced, const Spread& spread, const Stated& stated,
                        std::span<const Placed> bodies);

/// m⁵, for each entry.
///
/// Rounding in closed forms and slices, and the error of quadrature, change the common set by at most the error of the
/// volume. The inertia has a higher degree: there the factor is four. No part of that change is farther from the
/// centroid than the farthest point of the common set.
double error_of_integrated_inertia(const MeasuresAndInertia& values, const Spread& spread);

/// m²: upper bound of the squared distance R² of the points of a convex set from its centroid.
///
/// The centroid of a solid is at least a quarter of the width from either side. So the set is at least w = 4 R / 3 wide
/// along the line to its farthest point. ∫ x² dV along a line is least for a double cone: w² / 40 of the volume. So V
/// R² is at most 45 / 2 of ∫ |x|² dV, which is half of the trace.
double most_distance2(const Mat3& inertia, double volume);

/// m: the largest distance of a point of either cloud from the nearest point of the other. Infinite if there are too
/// many points to compare.
double farthest_apart(std::span<const Vec3> a, std::span<const Vec3> b);

/// The errors of any statement about bodies whose common set has at most this volume.
Errors errors_of_anything(double volume, std::span<const Placed> bodies);

/// m: the diameter of a box around the smallest body.
double least_diameter(std::span<const Placed> bodies);

/// Limits each error to what the smallest body allows. The measures must be those of some part of that body.
Errors no_more_than_all(Errors errors, std::span<const Placed> bodies);

}  // namespace overlapper
