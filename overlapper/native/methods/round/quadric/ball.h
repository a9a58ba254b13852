#pragma once

#include <optional>
#include <span>

#include "geometry/moments.h"
#include "methods/round/quadric/polyhedron.h"

namespace overlapper::quadric {

/// The common part of a ball and a polyhedron, about the ball's centre, along the polyhedron's axes.
struct BallPart : Moments {
  double error = 0;  ///< of the volume: what rounding may have done to it, that of the arguments not counted
  Vec3 flat;         ///< ∫ n dA over the polyhedron's faces; over the curved part, its opposite
  double area = 0;   ///< m², of the surface without cuts
  int faces = 0;     ///< of the polyhedron, that take part
  std::span<const Section> sections;  ///< of each of the polyhedron's planes; good until the next part is measured
};

/// In closed form; nothing if a plane leaves nothing of the ball. The error has no bound where a corner is in the
/// middle of the disc that a plane cuts from the ball. Compare Strobl, Formella and Pöschel (2016).
std::optional<BallPart> measure_ball(const Polyhedron& polyhedron, Vec3 centre, double radius);

}  // namespace overlapper::quadric
