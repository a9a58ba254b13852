#pragma once

#include <optional>

#include "geometry/measures.h"
#include "methods/quadric/polyhedron.h"

namespace overlapper::quadric {

/// What a cylinder without ends about the z axis and a polyhedron share, about the origin.
struct CylinderPart {
  double volume = 0;
  double error = 0;  ///< of the volume: what rounding may have done to it, that of the arguments not counted
  Vec3 first;        ///< ∫ x dV
  /// ∫ n dA and ∫ x × n dA over the curved part, and over the polyhedron's faces without cuts.
  Pull curved, flat;
  double area = 0;        ///< m², of the surface without cuts
  double whole_area = 0;  ///< with them
  int faces = 0;          ///< that take part
};

/// In closed form; nothing where rounding leaves open which way round a face's border goes, or how wide it is.
std::optional<CylinderPart> measure_cylinder(const Rings& polyhedron, double radius);

}  // namespace overlapper::quadric
