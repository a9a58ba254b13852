#pragma once

#include <optional>
#include <span>

#include "geometry/measures.h"
#include "geometry/moments.h"
#include "methods/round/quadric/polyhedron.h"

namespace overlapper::quadric {

/// The common part of a polyhedron and an infinite cylinder about the z axis, about the origin.
struct CylinderPart : Moments {
  double error = 0;  ///< m³: error by rounding, without `misplaced` times the area
  /// ∫ n dA and ∫ x × n dA: over the curved part, and over the polyhedron's faces without cuts.
  Pull curved, flat;
  double area = 0;                    ///< m², of the surface without cuts
  double whole_area = 0;              ///< m², with cuts
  int faces = 0;                      ///< number of faces in the common part
  std::span<const Section> sections;  ///< per plane of the polyhedron; valid until the next part is measured
};

/// The common part in closed form. `misplaced` is the rounding of the polyhedron's corners and planes, in m. No value
/// if rounding leaves the direction of a face's border, or its width, uncertain.
std::optional<CylinderPart> measure_cylinder(const Rings& polyhedron, double radius, double misplaced);

}  // namespace overlapper::quadric
