#pragma once

#include <cstdint>

#include "forces/three.h"
#include "geometry/vec.h"

namespace overlapper {

/// The overlap of two links as an elastic foundation (Winkler): the pressure is `stiffness` times the depth.
struct ElasticPatch {
  std::int64_t key = 0;  ///< the same in every step, so that a step begins with the solution of the last one
  int link_a = 0, link_b = 0;
  Vec3 normal;               ///< unit, from b to a
  Vec3 centroid;             ///< m, of the volume: the force at rest goes through it
  double force = 0;          ///< N, at rest
  double stiffness = 0;      ///< Pa/m
  double dissipation = 0;    ///< s
  double recovery = 0;       ///< s: by this time more, pressures follow the mean motion of the two links along normals
  double restitution = 0;    ///< speed after an impact over the speed before; only with a recovery
  double friction = 0;       ///< coefficient of friction
  double rolling = 0;        ///< m: the largest torque against rolling, over the force
  double spinning = 0;       ///< m: the torque against spinning besides the friction on the area, over the force
  double area = 0;           ///< m²; 0 for a patch without a direction, whose force does not depend on the depth
  Vec3 centre;               ///< m, of this area
  Mat3 moments{{}, {}, {}};  ///< m⁴, of this area about its centre
  double distance = 0;       ///< m: mean distance of this area's points from the centroid
};

/// The area of a patch in its plane, along two axes through the centroid of the volume.
struct PlaneArea {
  PlaneArea(const ElasticPatch& patch, Vec3 along, Vec3 across);

  double area;        ///< m²
  double u, v;        ///< m: its centre
  double uu, uv, vv;  ///< m²: the mean products of the coordinates of its points about the centre
  double distance;    ///< m: the mean distance of its points from the centroid

  /// The response of a foundation of this stiffness to motion along the normal and about both axes, in N/m, N and N m.
  ThreeByThree foundation(double stiffness) const;
};

}  // namespace overlapper
