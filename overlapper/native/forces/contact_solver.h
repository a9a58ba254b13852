#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "forces/multibody.h"
#include "geometry/vec.h"

namespace overlapper {

/// What two links share, as an elastic foundation: a pressure of `stiffness` times the depth.
struct ElasticPatch {
  std::int64_t key = 0;  ///< the same in the next step, so that its solution begins with that of this one
  int link_a = 0, link_b = 0;
  Vec3 normal;               ///< unit, from b to a
  Vec3 centroid;             ///< m, of the volume: what the force at rest goes through
  double force = 0;          ///< N, at rest
  double stiffness = 0;      ///< Pa/m
  double dissipation = 0;    ///< s
  double friction = 0;       ///< coefficient of
  double area = 0;           ///< m², 0 of what has no direction: its force does not change with the depth
  Vec3 centre;               ///< m, of that area
  Mat3 moments{{}, {}, {}};  ///< m⁴, of that area about its centre
  double distance = 0;       ///< m, mean, of that area's points from the centroid
};

/// How friction resists: by one law for the slip and the spin of a patch, or at points that are spread over it.
enum class Friction { kEllipsoid, kDistributed };

struct PatchForce {
  Vec3 force, torque;  ///< N and N m, on a, about the centroid of the volume; on b the opposite
  Vec3 slip;           ///< m/s: the velocity of a over b that is left there, along the patch
};

/// The forces of patches on bodies within one step, implicit in the velocities at its end: pressures by a rule that
/// keeps energy, friction by Coulomb's law, solved patch by patch until nothing changes (projected Gauss–Seidel).
class ContactSolver {
 public:
  explicit ContactSolver(std::vector<Link> links) : bodies_(std::move(links)) {}

  const Multibodies& bodies() const { return bodies_; }
  std::span<const ElasticPatch> patches() const { return patches_; }

  /// Puts links and patches where they are. The answer is by patch: the square of the frequency (rad/s)² that no way of
  /// swinging of the bodies of a patch on all of their patches exceeds.
  std::vector<double> place(std::span<const Pose> frames, std::vector<ElasticPatch> patches);

  struct Step {
    double duration;                       ///< s
    std::span<const double> velocity;      ///< of all coordinates, at the beginning
    std::span<const double> acceleration;  ///< without the patches
    std::span<const char> damped;          ///< by patch: whether to choose stability over energy (backward Euler)
    Friction friction = Friction::kEllipsoid;
  };

  struct Solution {
    std::vector<PatchForce> patches;
    std::vector<std::array<Vec3, 2>> links;  ///< force and torque, about its centre of mass, on each
    std::vector<double> acceleration;        ///< by the patches, of all coordinates
    int sweeps = 0;
  };

  /// Of the patches as they were placed.
  Solution solve(const Step& step);

 private:
  using Six = std::array<double, 6>;
  using Block = std::array<Six, 6>;

  /// The part of one body in the velocity of a over b, and what a wrench does to its coordinates.
  struct Side {
    int body, first, coordinates;
    bool moves;
    bool single;     ///< a body of one link, for which the next two suffice; what follows them is of others
    double sign;     ///< 1 of a, -1 of b
    Vec3 arm;        ///< m, from its centre of mass to the centroid
    size_t rows;     ///< in `pool_`: 6 rows of so many coordinates
    size_t answers;  ///< in `pool_`: so many rows of 6; none of what does not move
  };

  /// A force or a velocity, with the torque or the angular velocity about the same point.
  struct Screw {
    Vec3 along, about;
  };

  /// Everything in the frame of the patch: along the normal, then about two axes in the plane, then along these, then
  /// about the normal.
  struct Row {
    Vec3 normal, along, across;  ///< unit, the latter two in the plane
    std::array<Side, 2> sides;
    int sides_used;
    Block mobility;
    std::array<std::array<double, 3>, 3> foundation;
  };

  struct Law;

  /// Of a body of one link.
  struct Mobility {
    double linear = 0;  ///< 1/kg
    Mat3 angular;       ///< 1/(kg m²), in the world
  };

  void add_single(Row& row, int link, double sign, Vec3 centroid);
  void add_side(Row& row, int body, const std::vector<double>& rows);
  Screw answer(const Side& side, const Screw& wrench) const;
  Six slip_of(const Row& row, std::span<const double> velocity) const;
  void push(const Row& row, const Six& wrench, double factor, std::span<double> velocity) const;

  struct Directed {
    std::int64_t key;
    Vec3 normal;
  };

  Multibodies bodies_;
  std::vector<Directed> directed_;  ///< the patches of the last step, sorted
  std::vector<ElasticPatch> patches_;
  std::vector<Row> rows_;
  std::vector<double> pool_;
  std::vector<Mobility> mobilities_;  ///< per body
  /// Of the last solution, sorted by key: forces and torques in the world.
  std::vector<std::int64_t> known_;
  std::vector<std::array<Vec3, 2>> wrenches_;
};

}  // namespace overlapper
