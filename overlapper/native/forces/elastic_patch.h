#pragma once

#include <cstdint>

#include "forces/three.h"
#include "geometry/vec.h"

namespace overlapper {

/// The overlap of two links as an elastic foundation (Winkler): the pressure is `stiffness` times the depth. Below the
/// plane of a half-space it may grow faster, see harden().
struct ElasticPatch {
  std::int64_t key = 0;  ///< the same in every step, so that a step begins with the solution of the last one
  int link_a = 0, link_b = 0;
  Vec3 normal;               ///< unit, from b to a
  Vec3 centroid;             ///< m, of the volume: the force at rest goes through it
  double volume = 0;         ///< m³
  double force = 0;          ///< N, at rest
  Vec3 torque;               ///< N m, at rest, about the centroid: of pressures that grow faster than the depth
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
  double hardened = 0;       ///< m²: what the slope of pressures that grow faster than the depth adds to the area
  Mat3 hardened_moments{{}, {}, {}};  ///< m⁴: the same for the moments about the centroid

  /// Gives the patch the pressures k d (1 + c d) at the depth d below the plane of a half-space, in place of k d. The
  /// stiffness k is that of the patch, and `hardening` is c, in 1/m. `depth` is that of the centroid, and `spread` is
  /// ∫ x xᵀ dV about the centroid. `plane_normal` points out of the half-space. At the depth z of a point of the
  /// volume, the slope of the pressure is k (1 + 2 c z). Its integral over the volume is the force.
  void harden(double hardening, double depth, const Mat3& spread, Vec3 plane_normal) {
    force *= 1 + 2 * hardening * depth;
    torque = -2 * hardening * stiffness * cross(spread * plane_normal, normal);
    const double twice = 2 * hardening;
    hardened = twice * volume;
    hardened_moments = {twice * spread.row0, twice * spread.row1, twice * spread.row2};
  }
};

/// The area of a patch in its plane, along two axes through the centroid of the volume.
struct PlaneArea {
  PlaneArea(const ElasticPatch& patch, Vec3 along, Vec3 across);

  double area;        ///< m²
  double u, v;        ///< m: its centre
  double uu, uv, vv;  ///< m²: the mean products of the coordinates of its points about the centre
  double distance;    ///< m: the mean distance of its points from the centroid
  Three rest;         ///< N, N m: the pressures at rest
  double hardened;    ///< m², and about the centroid in m⁴: see ElasticPatch
  double hardened_uu, hardened_uv, hardened_vv;

  /// The response of a foundation of this stiffness to motion along the normal and about both axes, in N/m, N and N m.
  /// It includes the hardening.
  ThreeByThree foundation(double stiffness) const;
};

}  // namespace overlapper
