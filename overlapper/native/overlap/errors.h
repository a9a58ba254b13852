#pragma once

#include <array>
#include <span>
#include <vector>

#include "methods/choose.h"
#include "methods/dual/region.h"
#include "overlap/boundary.h"
#include "shapes/shape.h"

namespace overlapper {

/// How far what is stated of a common set may be off, in world coordinates and SI units.
struct Errors {
  double volume = 0;    ///< m³
  double area = 0;      ///< m²
  double centroid = 0;  ///< m: the true centroid is no farther away
  double inertia = 0;   ///< m⁵, of each entry
  double vertices = 0;  ///< m: Hausdorff distance between the common set and the hull of the vertices
  std::vector<std::array<double, 2>> gradient;  ///< per body: m² of the force, m³ of the moment, each of its length
};

/// Measures whose errors are looked for.
struct Stated {
  double area = 0;
  Vec3 centroid;
  Mat3 inertia{{}, {}, {}};
  std::vector<std::array<double, 6>> gradient;
};

struct StatedWithErrors {
  Stated stated;
  Errors errors;
};

/// The measures of a region, and how far they may be from those of the common set.
///
/// The polytope P has the origin of the region's frame inside, and its plane f, at the slack s_f from there, is moved
/// by rounding by no more than d_f. So the common set lies between λP and μP, with μ = 1 + max d_f / s_f, and λ = 2 - μ
/// less what vertices are pulled into smooth shapes. Volume and area of convex sets grow with the set, which bounds
/// both; the two sets differ by no more than (μ³ - λ³) times the volume, all of it as near to the centroid as the
/// farthest vertex, which bounds the centroid and the inertia.
///
/// The gradient needs to know which body owns what. Where no plane of another body is as near to a point of a facet as
/// both planes may have moved, the owner is beyond doubt; the area where one is, a strip along the seam or a whole
/// facet that two bodies share, may belong to either.
StatedWithErrors measured_with_errors(const Region& region, std::span<const Placed> bodies);

/// The error of the vertices of a region's boundary.
double error_of_vertices(const Region& region, const Boundary& boundary, std::span<const Placed> bodies);

/// The errors of what is stated, beside something else whose errors are known: those, and how far the two are apart.
/// Those of the volume and of the vertices stay.
Errors errors_beside(const StatedWithErrors& other, const Stated& stated);

/// The errors of measures by slices, or by a formula, from those of slices. Arguments that are off by rounding are what
/// the volume is off by, and no measure is of a higher degree in them than four more. Areas, and who owns them, change
/// with where surfaces are as `spread` tells: where these are tangent, or nearly, by far more than they are moved. What
/// is owned according to slices and to a formula lies between the same bounds; all else is off by as much more as the
/// two are apart. Beyond the region, nothing is common.
Errors errors_of_slices(const MeasuresAndInertia& sliced, const Spread& spread, const Stated& stated,
                        const Region& drawn, std::span<const Placed> bodies);

/// m⁵, of each entry.
///
/// Formulas and slices that are off by rounding, and rules that end, are those of a set that differs from the common
/// set by no more than the volume may be off, or by four times that, as the inertia is of a degree so much higher. Of
/// that, no part is farther from the centroid than the farthest point of the common set, at R. A convex set is at least
/// 4 R / 3 wide along the line there, as the centroid of a solid is at least a quarter of the width from either side;
/// and ∫ x² dV along a line is least, for a width w, of a double cone: w² / 40 of the volume. So V R² is no more than
/// 45 / 2 of ∫ |x|² dV, which is half of the trace.
double error_of_integrated_inertia(const MeasuresAndInertia& values, const Spread& spread);

/// m: how far any of the points of one cloud is from the nearest of the other; infinite where they are too many to be
/// compared, each with each.
double farthest_apart(std::span<const Vec3> a, std::span<const Vec3> b);

/// The errors of whatever is stated of bodies whose common set is anything up to that volume.
Errors errors_of_anything(double volume, std::span<const Placed> bodies);

/// No error is larger than what the smallest body leaves open: of measures that are true of some part of it.
Errors no_more_than_all(Errors errors, std::span<const Placed> bodies);

}  // namespace overlapper
