#pragma once

#include <optional>
#include <span>

#include "geometry/measures.h"
#include "geometry/moments.h"
#include "methods/round/quadric/polyhedron.h"

namespace overlapper::quadric {

/// The common part of a polyhedron and a cylinder without ends about the z axis, about the origin.
struct CylinderPart : Moments {
  double error = 0;  ///< of the volume: what rounding may have done to it, that of the arguments not counted
  /// ∫ n dA and ∫ x × n dA over the curved part, and over the polyhedron's faces without cuts.
  Pull curved, flat;
  double area = 0;                    ///< m², of the surface without cuts
  double whole_area = 0;              ///< with them
  int faces = 0;                      ///< that take part
  std::span<const Section> sections;  ///< of each of the polyhedron's planes; good until the next part is measured
};

/// In closed form; nothing where rounding leaves open which way round a face's border goes, or how wide it is.
std::optional<CylinderPart> measure_cylinder(const Rings& polyhedron, double radius);

}  // namespace overlapper::quadric
