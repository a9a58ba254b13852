#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "forces/constraint.h"
#include "forces/elastic_patch.h"
#include "forces/friction.h"
#include "forces/motor.h"
#include "forces/multibody.h"
#include "forces/pressure.h"
#include "forces/three.h"
#include "geometry/vec.h"

namespace overlapper {

struct PatchForce {
  Vec3 force, torque;  ///< N and N m, on a, about the centroid of the volume; the opposite acts on b
  Vec3 slip;           ///< m/s: the remaining velocity of a over b there, along the patch
};

/// The forces of patches on bodies within one step, implicit in the velocities at its end. Pressures follow a rule that
/// keeps energy. Friction follows Coulomb's law. Patches and constraints are solved one by one (projected
/// Gauss–Seidel), and all those of bodies that are connected at once (Newton's method) until nothing changes.
class ContactSolver {
 public:
  /// Sweeps end when no slip changes by more than this fraction of the largest slip, without forces or with them.
  static constexpr double kSettled = 1e-8;

  explicit ContactSolver(Multibodies bodies) : bodies_(std::move(bodies)) {}

  Multibodies& bodies() { return bodies_; }
  const Multibodies& bodies() const { return bodies_; }
  std::span<const ElasticPatch> patches() const { return patches_; }

  /// Takes the poses of links, and the patches. Returns for each patch the square of a frequency, in (rad/s)². No
  /// oscillation of the patch's bodies on all of their patches is faster.
  std::vector<double> place(std::span<const Pose> frames, std::vector<ElasticPatch> patches);

  /// A distance and an angle.
  struct Travel {
    double length, angle;  ///< m, rad
  };

  /// How far the surfaces of each patch move over each other within `duration` (s) at this velocity of all coordinates.
  std::vector<Travel> travel_of_patches(double duration, std::span<const double> velocity) const;

  /// How far the centre of mass of each link moves within `duration` (s), and how far the link turns.
  std::vector<Travel> travel_of_links(double duration, std::span<const double> velocity) const;

  struct Step {
    double duration;                       ///< s
    std::span<const double> velocity;      ///< of all coordinates, at the beginning
    std::span<const double> acceleration;  ///< without the patches and the motors
    std::span<const char> damped;          ///< per patch: whether to choose stability over energy (backward Euler)
    Friction friction = Friction::kEllipsoid;
    std::span<const MovedOn> ahead;  ///< the links at the end, with that velocity; found here for bodies with links
    /// Only of bodies with links.
    std::span<const Motor> motors;
    std::span<const Constraint> constraints;
    double settled = kSettled;  ///< see kSettled
  };

  struct Solution {
    std::vector<PatchForce> patches;
    std::vector<SixNumbers> constraints;     ///< on the first link, along `Directions`
    std::vector<std::array<Vec3, 2>> links;  ///< force and torque of patches on each link, about its centre of mass
    std::vector<double> acceleration;        ///< of all coordinates, by the patches, the motors and the constraints
    int sweeps = 0;
    double residual = 0;  ///< the largest change of a slip in the last sweep, over the largest slip without forces
  };

  /// Solves a step with the patches as they were placed.
  Solution solve(const Step& step);

  /// The values that the last solution took from the one before. A patch that was not known then has a duration of 0.
  struct Before {
    Vec3 centroid;    ///< m
    double duration;  ///< s, of that step
    double staying;   ///< see staying(), then and now
    double stays;
  };

  /// For each patch of the last solution.
  std::vector<Before> before() const;

 private:
  /// A force and a torque, or a velocity and an angular velocity, about the same point, in the world.
  struct Screw {
    Vec3 along, about;
  };

  /// A screw in the frame of a patch. The part of the pressures is along the normal and about two axes in the plane.
  /// The part of friction is along these axes and about the normal.
  struct Six {
    Three normal{}, tangential{};
  };

  /// One body's part in the velocity of a over b, and the responses of its coordinates to a wrench.
  struct Side {
    int body, first, coordinates;
    bool moves;
    bool single;     ///< a body of one link: it has a sign and an arm; other bodies have rows and answers
    double sign;     ///< 1 for a, -1 for b
    Vec3 arm;        ///< m, from its centre of mass to the centroid
    size_t rows;     ///< in `pool_`: 6 rows of so many coordinates
    size_t answers;  ///< in `pool_`: so many rows of 6; unused if the body does not move
  };

  /// The part of a patch's damping that follows the slip of another patch, in N s/m.
  struct Share {
    int other;
    double part;
  };

  /// A constraint: its velocity and its largest force.
  struct Held {
    std::int64_t key;
    SixNumbers target;
    double limit;
  };

  /// A patch or a constraint. The six numbers of the latter are its directions, the first three of them normal.
  struct Row {
    explicit Row(const ElasticPatch& patch);

    Screw world(const Six& of) const;
    Six local(const Screw& of) const;

    Vec3 normal, along, across;  ///< unit, the latter two in the plane
    PlaneArea area;
    std::array<Side, 2> sides{};
    int sides_used = 0;
    double damping = 0;              ///< N s/m, along the normal, by `recovery`
    std::vector<Share> damped_with;  ///< the other patches of the same two links
    /// The change of the slip by a wrench in 1 s: of the normal part by the normal part, and so on.
    ThreeByThree normal_by_normal{}, normal_by_tangential{}, tangential_by_normal{}, tangential_by_tangential{};
    std::optional<Held> held{};  ///< for a constraint, which has no directions of a patch
  };

  /// The inverse of the mass and of the inertia of a body of one link.
  struct Mobility {
    double linear = 0;  ///< 1/kg
    Mat3 angular;       ///< 1/(kg m²), in the world
  };

  /// How much the mean of the slip over a step differs from the slip at its beginning, because bodies turn.
  struct Drift {
    Three slip;      ///< tangential
    double staying;  ///< see staying()
  };

  /// The laws of a patch in a step, and its present wrench.
  struct Laws;

  /// Rows whose bodies are connected, directly or through others. Bodies that forces do not move do not count.
  struct Island {
    std::vector<int> rows;
    std::vector<int> bodies;
  };

  /// The wrenches of an island two sweeps before, the extrapolated wrenches with which the last two sweeps began, and
  /// the weight of the extrapolation.
  struct Momentum {
    std::vector<Six> before, begun;
    double weight = 1;
  };

  /// How an island was solved, see Solution.
  struct Ended {
    int sweeps = 0;
    double residual = 0;
  };

  class Newton;

  void make_rows(const Step* step = nullptr);
  void add_sides(Row& row, const ElasticPatch& patch);
  Row& add_held(const Held& held);
  void add_constraint(const Constraint& constraint);
  void add_between(Row& row, std::array<int, 2> bodies, std::array<std::vector<double>, 2> rows);
  void share_damping();
  void find_relative_damping(const Island& island, std::span<const double> velocity, std::span<Laws> laws) const;
  std::vector<Island> islands() const;
  Ended settle(const Island& island, std::span<Laws> laws, const Step& step, double largest,
               std::span<double> velocity) const;
  void extrapolate(Momentum& momentum, const Island& island, std::span<Laws> laws, double duration,
                   std::span<double> velocity) const;
  void add_single(Row& row, int link, double sign, Vec3 centroid);
  void add_side(Row& row, int body, std::span<const double> jacobian);
  void add_rows(Row& row, int body, std::span<const double> rows);
  Screw answer(const Side& side, const Screw& wrench) const;
  Six slip_of(const Row& row, std::span<const double> velocity) const;
  void push(const Row& row, const Six& wrench, double factor, std::span<double> velocity) const;
  static Six response(const Row& row, const Six& wrench);
  static SixNumbers numbers(const Six& of);
  static Six six(const SixNumbers& of);
  Six known_wrench(size_t patch) const;
  double staying(const ElasticPatch& patch, Vec3 centre_velocity, Vec3 by_spin) const;
  Drift drift(size_t patch, const Step& step, std::span<const MovedOn> ahead, std::span<const Vec3> rotations) const;
  Pressure::Damping damping(size_t patch, std::span<const Six> before, std::span<const Drift> drifts) const;
  std::vector<double> jacobian_of(int link, Vec3 point, double sign) const;
  Solution solve_with_motors(const Step& step, std::vector<double> velocity);
  Solution solve_patches(const Step& step, std::vector<double> velocity);
  std::vector<double> forces_on_coordinates(int body, const Solution& solution) const;
  double visit(size_t index, Laws& laws, double duration, std::span<double> velocity) const;
  double largest_change(const Row& row, const Laws& laws, const Six& change, double duration) const;
  double speed(const Row& row, const Laws& laws, std::span<const double> velocity) const;
  Solution solved(std::span<const Laws> laws, std::span<const double> velocity) const;
  void remember(const Solution& solution, std::span<const Laws> laws, double duration);

  /// The solution of a patch, as a start for the next step.
  struct Known {
    std::int64_t key;
    Vec3 normal, centroid;
    Screw wrench;
    double duration, staying;
  };
  static const Known* find(std::span<const Known> among, std::int64_t key);
  const Known* known(std::int64_t key) const { return find(known_, key); }

  /// The same for a constraint.
  struct KnownHeld {
    std::int64_t key;
    Six wrench;
  };

  Multibodies bodies_;
  std::vector<ElasticPatch> patches_;
  std::vector<Row> rows_;
  std::vector<double> pool_;
  std::vector<Mobility> mobilities_;   ///< per body
  std::vector<Known> known_;           ///< of the last step, sorted by key
  std::vector<Known> known_before_;    ///< of the step before
  std::vector<KnownHeld> known_held_;  ///< of the last step
  std::vector<signed char> full_;      ///< per coordinate, see MotorsOfBody
};

}  // namespace overlapper
