#pragma once

#include <optional>
#include <span>

#include "geometry/moments.h"
#include "methods/round/quadric/polyhedron.h"

namespace overlapper::quadric {

/// The common part of a ball and a polyhedron, about the ball's centre, along the polyhedron's axes.
struct BallPart : Moments {
  double error = 0;                   ///< error of the volume by rounding, without the error of the arguments
  Vec3 flat;                          ///< ∫ n dA over the polyhedron's faces; the curved part has the opposite
  double area = 0;                    ///< m², of the surface without cuts
  int faces = 0;                      ///< number of the polyhedron's faces in the common part
  std::span<const Section> sections;  ///< per plane of the polyhedron; valid until the next part is measured
};

/// The common part in closed form; no value if a plane leaves nothing of the ball. The error is infinite if a corner is
/// at the middle of the disc that a plane cuts from the ball. `second_moments` of sections may be wanted. Compare
/// Strobl, Formella and Pöschel (2016).
std::optional<BallPart> measure_ball(const Polyhedron& polyhedron, Vec3 centre, double radius,
                                     bool second_moments = false);

}  // namespace overlapper::quadric
