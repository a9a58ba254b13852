#include <algorithm>
#include <climits>

#include "batch/batch.h"
#include "forces/contact_solver.h"
#include "geometry/wide_pose.h"
#include "python/arrays.h"
#include "python/frames.h"

namespace overlapper::python {
namespace {

/// A patch has no direction if its area vector is less than this fraction of the surface of the common set.
constexpr double kNoDirection = 1e-6;

std::vector<double> numbers(nb::handle given, const char* name, size_t rows, size_t columns = 1) {
  const Doubles array = to_doubles(given, name, "an array of numbers");
  if (array.size() != rows * columns)
    fail(name, "must have " + std::to_string(rows * columns) + " numbers, not " + std::to_string(array.size()));
  return {array.data(), array.data() + array.size()};
}

ContactSolver to_solver(nb::handle parents_given, nb::handle joints_given, nb::handle axes_given,
                        nb::handle pivots_given, nb::handle masses_given, nb::handle inertias_given) {
  const auto parents = to_indices(parents_given, "parents"), joints = to_indices(joints_given, "joints");
  const size_t n = parents.size();
  const std::vector<Vec3> axes = to_rows(axes_given, "axes"), pivots = to_rows(pivots_given, "pivots"),
                          inertias = to_rows(inertias_given, "inertias");
  const std::vector<double> masses = numbers(masses_given, "masses", n);
  if (joints.size() != n || axes.size() != n || pivots.size() != n || inertias.size() != n)
    fail("links", "must have a row in each array");
  std::vector<TreeLink> links(n);
  for (size_t i = 0; i < n; ++i) {
    if (joints[i] < 0 || joints[i] > int(Joint::kSpherical)) fail("joints", "must be from 0 to 3");
    links[i] = {int(parents[i]), Joint(joints[i]), axes[i], pivots[i], masses[i], inertias[i]};
  }
  return ContactSolver(Multibodies(std::move(links)));
}

/// `moved` has a row of each coordinate that moves a link: the place of the link, and the coordinate within its tree.
ContactSolver of_trees(nb::handle coordinates_given, nb::handle trees_given, nb::handle moved_given) {
  const auto coordinates = to_indices(coordinates_given, "coordinates"), trees = to_indices(trees_given, "trees"),
             moved = to_indices(moved_given, "moved", 2);
  const auto within = [](std::int64_t number) { return int(std::clamp<std::int64_t>(number, -2, INT_MAX)); };
  std::vector<MovedLink> links;
  for (std::int64_t tree : trees) links.push_back({within(tree), {}});
  for (size_t i = 0; i < moved.size(); i += 2) {
    if (moved[i] < 0 || moved[i] >= std::int64_t(links.size())) fail("moved", "must begin with places of links");
    links[moved[i]].moved.push_back(within(moved[i + 1]));
  }
  return ContactSolver(Multibodies(coordinates, std::move(links)));
}

void move(ContactSolver& solver, nb::handle linear_given, nb::handle angular_given, nb::handle points_given,
          nb::handle inverse_mass_given) {
  const size_t count = solver.bodies().coordinates();
  const std::vector<Vec3> linear = to_rows(linear_given, "linear"), angular = to_rows(angular_given, "angular"),
                          points = to_rows(points_given, "points");
  if (linear.size() != count || angular.size() != count || points.size() != count)
    fail("motions", "must have a row for each coordinate in each array");
  size_t width = 0;
  for (const Multibodies::Body& body : solver.bodies().bodies()) width = std::max(width, size_t(body.coordinates));
  const std::vector<double> inverse_mass = numbers(inverse_mass_given, "inverse_mass", count, width);
  std::vector<Motion> motions;
  for (size_t i = 0; i < count; ++i) motions.push_back({linear[i], angular[i], points[i]});
  solver.bodies().move(std::move(motions), inverse_mass, int(width));
}

Pose to_pose(nb::handle given) {
  const Frame frame = to_frame(given);
  return make_placed(Sphere(1), frame.position, frame.orientation).pose;
}

/// The top of a prism of a height field, for the patch of the prism with another shape. The walls of the prism are
/// vertical and inside the field, so nothing presses against them.
struct Top {
  Vec3 up, normal;  ///< unit, on the side of the row's first shape
};

/// The tops of rows with a prism. `tops` has the normal of each prism's top in its own frame, and zeros for all other
/// shapes.
std::vector<std::optional<Top>> tops_of(const Overlaps& found, std::span<const Vec3> tops) {
  std::vector<std::optional<Top>> seen(found.size());
  for (size_t i = 0; i < found.size(); ++i) {
    for (int side : {0, 1}) {
      const int shape = found.pairs[i][side];
      if (shape >= int(tops.size()) || tops[shape] == Vec3{}) continue;
      const PoseNumbers& at = (*found.poses)[shape];
      const Mat3 turn = make_placed(Sphere(1), {}, {at[3], at[4], at[5], at[6]}).pose.rotation;
      const double sign = side == 0 ? -1 : 1;
      seen[i] = Top{sign * (turn * Vec3{0, 0, 1}), sign * (turn * unit(tops[shape]))};
    }
  }
  return seen;
}

/// Whether an area of this size has a direction, rounding aside.
bool has_direction(const Overlaps& found, size_t row, double size) {
  return size > kNoDirection * found.area_bound[row] || (size > 0 && size > kNoDirection * found.overlap(row)->area());
}

/// Gives a patch pressures that grow faster than the depth below the half-space of its pair.
void harden(ElasticPatch& patch, double hardening, const Overlaps& found, size_t row) {
  for (int shape : found.pairs[row]) {
    const Shape& half = (*found.shapes)[shape];
    if (bounded(half)) continue;
    const PoseNumbers& p = (*found.poses)[shape];
    const Pose pose = make_placed(half, {p[0], p[1], p[2]}, {p[3], p[4], p[5], p[6]}).pose;
    std::vector<Plane> planes;
    append_planes(half, planes);
    const Vec3 normal = pose.rotation * planes[0].normal, out = patch.centroid - pose.translation;
    Mat3 spread = found.overlap(row)->inertia();
    const double trace = (spread.row0.x + spread.row1.y + spread.row2.z) / 2;
    spread = {Vec3{trace, 0, 0} - spread.row0, Vec3{0, trace, 0} - spread.row1, Vec3{0, 0, trace} - spread.row2};
    return patch.harden(hardening, planes[0].offset - dot(normal, out), spread, normal);
  }
  fail("hardening", "must be 0 for pairs without a half-space");
}

/// The patch of each row: that of the top for prisms.
std::vector<Patch> patches_of(const Overlaps& found, std::span<const std::optional<Top>> tops) {
  std::vector<Patch> patches;
  for (size_t i = 0; i < found.size(); ++i) {
    const auto& pull = found.gradient[i][1];
    const Vec3 area{pull[0], pull[1], pull[2]};
    if (!tops[i]) {
      patches.push_back(found.patch(i));
      patches.back().area = area;
    } else if (has_direction(found, i, dot(area, tops[i]->up))) {
      patches.push_back(lifted(found.patch(i, tops[i]->up), found.centroid[i], tops[i]->normal));
    } else {
      patches.push_back(PatchSums({}, {}).patch());
    }
  }
  return patches;
}

nb::object place(ContactSolver& solver, nb::handle frames_given, const Overlaps& found, nb::handle links_given,
                 nb::handle stiffness_given, nb::handle dissipation_given, nb::handle friction_given,
                 nb::handle recovery_given, nb::handle restitution_given, nb::handle rolling_given,
                 nb::handle spinning_given, nb::handle tops_given, nb::handle hardening_given) {
  std::vector<Pose> frames;
  for (nb::handle each : frames_given) frames.push_back(to_pose(each));
  const size_t count = found.size(), links = size_t(solver.bodies().links());
  if (frames.size() != links) fail("frames", "must be one for each link");
  const auto link_of = to_indices(links_given, "links");
  const auto stiffness = numbers(stiffness_given, "stiffness", count);
  const auto dissipation = numbers(dissipation_given, "dissipation", count);
  const auto friction = numbers(friction_given, "friction", count);
  const auto optional = [&](nb::handle given, const char* name) {
    return given.is_none() ? std::vector<double>(count) : numbers(given, name, count);
  };
  const auto recovery = optional(recovery_given, "recovery");
  const auto restitution = optional(restitution_given, "restitution");
  const auto rolling = optional(rolling_given, "rolling");
  const auto spinning = optional(spinning_given, "spinning");
  const auto hardening = optional(hardening_given, "hardening");
  std::vector<Vec3> tops(link_of.size());
  if (!tops_given.is_none()) tops = to_rows(tops_given, "tops");
  if (tops.size() != link_of.size()) fail("tops", "must have a row for each shape");
  const std::vector<std::optional<Top>> seen = tops_of(found, tops);
  const std::vector<Patch> shared = unlocked([&] { return patches_of(found, seen); });
  std::vector<ElasticPatch> patches(count);
  for (size_t i = 0; i < count; ++i) {
    const auto [a, b] = found.pairs[i];
    for (int shape : {a, b})
      if (shape >= int(link_of.size()) || link_of[shape] < 0 || link_of[shape] >= std::int64_t(links))
        fail("links", "must be places of links, one for each shape");
    ElasticPatch& patch = patches[i];
    patch.key = std::int64_t(a) << 32 | b;
    patch.link_a = int(link_of[a]), patch.link_b = int(link_of[b]);
    if (seen[i]) patch.normal = seen[i]->normal;
    patch.stiffness = stiffness[i], patch.dissipation = dissipation[i];
    patch.recovery = recovery[i], patch.restitution = restitution[i];
    patch.friction = friction[i], patch.rolling = rolling[i], patch.spinning = spinning[i];
    if (found.status[i] != std::int8_t(Status::kOverlapping)) {
      if (!seen[i]) patch.normal = found.normal_of(i);
      continue;
    }
    patch.volume = found.volume[i], patch.force = stiffness[i] * found.volume[i];
    patch.centroid = found.centroid[i];
    const auto& [area, centre, moments, distance] = shared[i];
    if (has_direction(found, i, norm(area)) && finite(centre)) {
      patch.area = norm(area);
      patch.normal = unit(area);
      patch.centre = centre, patch.moments = moments, patch.distance = distance;
    } else if (!seen[i]) {
      patch.normal = found.normal_of(i);
    }
    if (hardening[i] > 0) harden(patch, hardening[i], found, i);
  }
  std::vector<double> frequency2 = solver.place(frames, std::move(patches));
  const size_t rows = frequency2.size();
  return nb::cast(to_numpy<Vector>(std::move(frequency2), {rows}), nb::rv_policy::move);
}

std::vector<Motor> to_motors(nb::handle given, size_t coordinates) {
  std::vector<Motor> motors;
  if (given.is_none()) return motors;
  const Doubles rows = to_doubles(given, "motors", "an array of numbers");
  if (rows.size() % 4 != 0) fail("motors", "must have 4 numbers in a row");
  for (size_t i = 0; i < rows.size(); i += 4) {
    const double *row = rows.data() + i, coordinate = row[0], gain = row[2], limit = row[3];
    if (!(coordinate >= 0 && coordinate < double(coordinates))) fail("motors", "must begin with coordinates");
    if (!(gain >= 0 && gain <= 1 && limit >= 0 && std::isfinite(row[1])))
      fail("motors", "must have a finite target, a gain from 0 to 1 and a limit from 0");
    motors.push_back({int(coordinate), row[1], gain, limit});
  }
  return motors;
}

Mat3 rotation_of(const double* quaternion) {
  const double *q = quaternion, squared = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  if (!(squared > 0)) fail("constraints", "must have quaternions that are not 0");
  return rotation_matrix({q[0], q[1], q[2], q[3]});
}

std::vector<Constraint> to_constraints(nb::handle given, const Multibodies& bodies) {
  std::vector<Constraint> constraints;
  if (given.is_none()) return constraints;
  constexpr size_t kWidth = 23;
  const Doubles rows = to_doubles(given, "constraints", "an array of numbers");
  if (rows.size() % kWidth != 0) fail("constraints", "must have 23 numbers in a row");
  if (rows.size() > 0 && !bodies.has_links()) fail("constraints", "must be empty for the trees of a simulator");
  for (size_t i = 0; i < rows.size(); i += kWidth) {
    const double* row = rows.data() + i;
    if (!std::all_of(row, row + kWidth - 1, [](double each) { return std::isfinite(each); }))
      fail("constraints", "must be finite");
    if (!(row[1] >= 0 && row[1] <= 2)) fail("constraints", "must be of a kind from 0 to 2");
    if (!(row[22] >= 0)) fail("constraints", "must have a limit from 0");
    Constraint& made = constraints.emplace_back();
    made.key = std::int64_t(row[0]), made.kind = Constraint::Kind(int(row[1]));
    for (size_t side : {0, 1}) {
      const double* at = row + 4 + 7 * side;
      if (!(row[2 + side] >= -1 && row[2 + side] < bodies.links())) fail("constraints", "must be between links, or -1");
      made.links[side] = int(row[2 + side]);
      made.frames[side] = {rotation_of(at + 3), {at[0], at[1], at[2]}};
    }
    made.axis = {row[18], row[19], row[20]};
    if (made.kind == Constraint::Kind::kSlider && !(norm2(made.axis) > 0)) fail("constraints", "must have an axis");
    made.correction = row[21], made.limit = row[22];
  }
  return constraints;
}

nb::tuple solve(ContactSolver& solver, double duration, nb::handle velocity_given, nb::handle acceleration_given,
                nb::handle damped_given, bool distributed, nb::handle ahead_given, nb::handle motors_given,
                nb::handle constraints_given, double settled) {
  const size_t coordinates = solver.bodies().coordinates(), count = solver.patches().size();
  const auto velocity = numbers(velocity_given, "velocity", coordinates);
  const auto acceleration = numbers(acceleration_given, "acceleration", coordinates);
  std::vector<char> damped(count);
  if (!damped_given.is_none())
    std::ranges::transform(numbers(damped_given, "damped", count), damped.begin(),
                           [](double each) { return each != 0; });
  std::vector<MovedOn> ahead;
  if (!ahead_given.is_none()) {
    for (nb::handle each : ahead_given) {
      const Pose pose = to_pose(each);
      ahead.push_back({pose.translation, pose.rotation});
    }
    if (ahead.size() != size_t(solver.bodies().links())) fail("ahead", "must be one for each link");
  } else if (count > 0 && !solver.bodies().has_links()) {
    fail("ahead", "must be given for the trees of a simulator");
  }
  const std::vector<Motor> motors = to_motors(motors_given, coordinates);
  const std::vector<Constraint> constraints = to_constraints(constraints_given, solver.bodies());
  ContactSolver::Solution solution;
  {
    const nb::gil_scoped_release release;
    solution = solver.solve({duration, velocity, acceleration, damped,
                             distributed ? Friction::kDistributed : Friction::kEllipsoid, ahead, motors, constraints,
                             settled});
  }
  std::vector<Vec3> force, torque, slip, normal;
  for (const PatchForce& each : solution.patches)
    force.push_back(each.force), torque.push_back(each.torque), slip.push_back(each.slip);
  std::vector<char> directed;
  for (const ElasticPatch& each : solver.patches())
    normal.push_back(each.normal), directed.push_back(each.area > 0 || !(each.force > 0));
  std::vector<double> links;
  for (const auto& [f, t] : solution.links) links.insert(links.end(), {f.x, f.y, f.z, t.x, t.y, t.z});
  std::vector<double> held;
  for (const SixNumbers& each : solution.constraints) held.insert(held.end(), each.begin(), each.end());
  const size_t rows = solution.links.size(), constrained = solution.constraints.size();
  const auto array = [](const std::vector<Vec3>& values) { return to_numpy(std::span<const Vec3>(values)); };
  using Flags = nb::ndarray<nb::numpy, const bool, nb::ndim<1>>;
  auto* flags = new std::vector<char>(std::move(directed));
  const nb::capsule owner(flags, [](void* p) noexcept { delete static_cast<std::vector<char>*>(p); });
  return nb::make_tuple(
      array(force), array(torque), array(slip), array(normal),
      Flags(reinterpret_cast<const bool*>(flags->data()), {count}, owner),
      to_numpy<Matrix>(std::move(links), {rows, 6}), to_numpy<Matrix>(std::move(held), {constrained, 6}),
      to_numpy<Vector>(std::move(solution.acceleration), {coordinates}), solution.sweeps, solution.residual);
}

/// Rows of lengths and angles: of patches, and of links.
nb::tuple travel(const ContactSolver& solver, double duration, nb::handle velocity_given) {
  const auto velocity = numbers(velocity_given, "velocity", solver.bodies().coordinates());
  const auto rows = [](const std::vector<ContactSolver::Travel>& found) {
    std::vector<double> flat;
    for (const auto [length, angle] : found) flat.insert(flat.end(), {length, angle});
    const size_t count = found.size();
    return to_numpy<Matrix>(std::move(flat), {count, 2});
  };
  return nb::make_tuple(rows(solver.travel_of_patches(duration, velocity)),
                        rows(solver.travel_of_links(duration, velocity)));
}

/// The poses of shapes after `duration` at the present velocities of their links.
nb::tuple ahead(const ContactSolver& solver, double duration, nb::handle velocity_given, nb::handle links_given,
                nb::handle positions_given, nb::handle orientations_given) {
  const Multibodies& bodies = solver.bodies();
  const auto velocity = numbers(velocity_given, "velocity", bodies.coordinates());
  const auto links = to_indices(links_given, "links");
  const size_t k = links.size();
  std::vector<double> positions = numbers(positions_given, "positions", k, 3);
  std::vector<double> orientations = numbers(orientations_given, "orientations", k, 4);
  for (size_t i = 0; i < k; ++i) {
    if (links[i] < 0 || links[i] >= bodies.links()) fail("links", "must be places of links");
    const int link = int(links[i]);
    const auto [linear, angular] = bodies.twist(link, velocity);
    double *p = &positions[3 * i], *q = &orientations[4 * i];
    const double angle = duration * norm(angular);
    const Vec3 half = std::sin(angle / 2) * unit(angular);
    const Quaternion turn{half.x, half.y, half.z, std::cos(angle / 2)};
    const Vec3 centre = bodies.centre(link), at{p[0], p[1], p[2]};
    const Vec3 now = centre + duration * linear + rotated(turn, at - centre);
    const Quaternion orientation = turn * Quaternion{q[0], q[1], q[2], q[3]};
    p[0] = now.x, p[1] = now.y, p[2] = now.z;
    q[0] = orientation.x, q[1] = orientation.y, q[2] = orientation.z, q[3] = orientation.w;
  }
  return nb::make_tuple(to_numpy<Matrix>(std::move(positions), {k, 3}),
                        to_numpy<Matrix>(std::move(orientations), {k, 4}));
}

}  // namespace

void define_forces(nb::module_& m) {
  nb::class_<ContactSolver> cls(
      m, "ContactSolver",
      R"(The forces of patches on bodies of links; `simulation.VolumetricContact` is made of it.

A link is a row of each array: the place of its parent, before it, or -1 of a base, with which a body begins; its joint,
0 held, 1 revolute, 2 prismatic, 3 spherical; axis and pivot of the joint in the parent's inertial frame; mass, 0 of a
base that is held; principal moments of inertia. Coordinates are those of each body: of its base, linear and angular, in
the world, then of its joints.)");
  cls.def(
      "__init__",
      [](ContactSolver* self, nb::handle parents, nb::handle joints, nb::handle axes, nb::handle pivots,
         nb::handle masses,
         nb::handle inertias) { new (self) ContactSolver(to_solver(parents, joints, axes, pivots, masses, inertias)); },
      "parents"_a, "joints"_a, "axes"_a, "pivots"_a, "masses"_a, "inertias"_a,
      nb::sig("def __init__(self, parents: numpy.typing.ArrayLike, joints: numpy.typing.ArrayLike, axes: "
              "numpy.typing.ArrayLike, pivots: numpy.typing.ArrayLike, masses: numpy.typing.ArrayLike, inertias: "
              "numpy.typing.ArrayLike) -> None"));
  cls.def_prop_ro("coordinates", [](const ContactSolver& self) { return self.bodies().coordinates(); });
  cls.def_static("of_trees", &of_trees, "coordinates"_a, "trees"_a, "moved"_a,
                 nb::sig("def of_trees(coordinates: numpy.typing.ArrayLike, trees: numpy.typing.ArrayLike, moved: "
                         "numpy.typing.ArrayLike) -> ContactSolver"),
                 R"(A solver for trees of a simulator that knows masses and motions itself and gives them to `move`.

`coordinates` (t,) are the numbers of coordinates of the trees. `trees` (n,) is the tree of each link, -1 of a link that
stands still. `moved` (m, 2) has a row for each coordinate that moves a link: the place of the link, and the place of
the coordinate in the tree.)");
  cls.def("move", &move, "linear"_a, "angular"_a, "points"_a, "inverse_mass"_a,
          nb::sig("def move(self, linear: numpy.typing.ArrayLike, angular: numpy.typing.ArrayLike, points: "
                  "numpy.typing.ArrayLike, inverse_mass: numpy.typing.ArrayLike) -> None"),
          R"(Take the motions and the masses of trees, before `place`.

A unit of a coordinate moves its links by a row of each of three (c, 3) arrays: the velocity at a point, the angular
velocity, and that point, in the world. `inverse_mass` (c, w) has a row for each coordinate. The row begins with the
numbers for the coordinates of its tree; w is the size of the largest tree.)");
  cls.def(
      "copy", [](const ContactSolver& self) { return self; }, nb::sig("def copy(self) -> ContactSolver"),
      "Another one that knows the same of the last step: what it solves changes nothing here.");
  cls.def(
      "place", &place, "frames"_a, "overlaps"_a, "links"_a, "stiffness"_a, "dissipation"_a, "friction"_a,
      "recovery"_a.none() = nb::none(), "restitution"_a.none() = nb::none(), "rolling"_a.none() = nb::none(),
      "spinning"_a.none() = nb::none(), "tops"_a.none() = nb::none(), "hardening"_a.none() = nb::none(),
      nb::sig(
          "def place(self, frames: collections.abc.Sequence[typing.Any], overlaps: Overlaps, links: "
          "numpy.typing.NDArray[numpy.int64], stiffness: numpy.typing.ArrayLike, dissipation: "
          "numpy.typing.ArrayLike, friction: numpy.typing.ArrayLike, recovery: numpy.typing.ArrayLike | None = None, "
          "restitution: numpy.typing.ArrayLike | None = None, rolling: numpy.typing.ArrayLike | None = None, "
          "spinning: numpy.typing.ArrayLike | None = None, "
          "tops: numpy.typing.ArrayLike | None = None, hardening: numpy.typing.ArrayLike | None = None) "
          "-> numpy.typing.NDArray[numpy.float64]"),
      R"(Put the links where they are, and take what their shapes share; `links` (k,) is the place of each shape's link.

`frames` begin with position and quaternion of the inertial frame, as pybullet's answers do. By row of `overlaps` (p,):
stiffness in Pa/m, dissipation in s, and the coefficient of friction. The others are 0 if they are not given: `recovery`
in s, by which pressures follow the mean motion of the two links along the normal besides the dissipation; `restitution`,
the speed after an impact over the speed before, which needs a recovery; `rolling` and `spinning` in m, the torques
against rolling and against spinning over the force. Friction on the area resists spinning besides. `tops` (k, 3) has the normal of the top of each prism of a height field, in the frame of the prism,
and zeros for other shapes. A prism presses with its top alone, because its vertical walls are inside the field.
`hardening` in 1/m is c of the pressure k d (1 + c d) at the depth d. It must be 0 for pairs without a half-space. The
answer (p,) is the square of a frequency,
(rad/s)², that no way of swinging of the two bodies on all of their patches exceeds.)");
  cls.def_prop_ro(
      "depths",
      [](const ContactSolver& self) {
        std::vector<double> found;
        for (const ElasticPatch& each : self.patches()) found.push_back(each.area > 0 ? each.volume / each.area : 0);
        const size_t count = found.size();
        return nb::cast(to_numpy<Vector>(std::move(found), {count}), nb::rv_policy::move);
      },
      nb::sig("def depths(self) -> numpy.typing.NDArray[numpy.float64]"),
      "(p,) the mean depth of each patch in m: its volume over its area, 0 without a patch.");
  cls.def_prop_ro(
      "before",
      [](const ContactSolver& self) {
        std::vector<double> found;
        for (const auto& [centroid, duration, staying, stays] : self.before())
          found.insert(found.end(), {centroid.x, centroid.y, centroid.z, duration, staying, stays});
        const size_t count = found.size() / 6;
        return nb::cast(to_numpy<Matrix>(std::move(found), {count, 6}), nb::rv_policy::move);
      },
      nb::sig("def before(self) -> numpy.typing.NDArray[numpy.float64]"),
      R"((p, 6) what the last `solve` took from the step before for each patch: its centroid then in m, the duration of that
step in s, and to which part the patch kept its place then and now. All are 0 for patches that were not known then.)");
  cls.def("travel", &travel, "duration"_a, "velocity"_a,
          nb::sig("def travel(self, duration: float, velocity: numpy.typing.ArrayLike) -> "
                  "tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]"),
          R"(How far bodies move within `duration` (s) at this `velocity` of all coordinates.

(p, 2): how far the two surfaces of each patch move over each other at its centroid, in m, and how far they turn, in
rad. (n, 2): the same for the centre of mass of each link in the world.)");
  cls.def(
      "ahead", &ahead, "duration"_a, "velocity"_a, "links"_a, "positions"_a, "orientations"_a,
      nb::sig("def ahead(self, duration: float, velocity: numpy.typing.ArrayLike, links: "
              "numpy.typing.NDArray[numpy.int64], positions: numpy.typing.ArrayLike, orientations: "
              "numpy.typing.ArrayLike) -> tuple[numpy.typing.NDArray[numpy.float64], "
              "numpy.typing.NDArray[numpy.float64]]"),
      R"((k, 3) positions in m and (k, 4) quaternions xyzw where shapes on these `links`, (k,) as for `place`, come to after
`duration` (s), from where they are now, if links go on with the `velocity` of all coordinates.)");
  cls.def(
      "solve", &solve, "duration"_a, "velocity"_a, "acceleration"_a, "damped"_a.none(), "distributed"_a,
      "ahead"_a.none() = nb::none(), "motors"_a.none() = nb::none(), "constraints"_a.none() = nb::none(),
      "settled"_a = ContactSolver::kSettled,
      nb::sig("def solve(self, duration: float, velocity: numpy.typing.ArrayLike, acceleration: "
              "numpy.typing.ArrayLike, damped: numpy.typing.ArrayLike | None, distributed: bool, ahead: "
              "collections.abc.Sequence[typing.Any] | None = None, motors: numpy.typing.ArrayLike | None = None, "
              "constraints: numpy.typing.ArrayLike | None = None, settled: float = 1e-08) -> "
              "tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], "
              "numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], "
              "numpy.typing.NDArray[numpy.bool_], numpy.typing.NDArray[numpy.float64], "
              "numpy.typing.NDArray[numpy.float64], "
              "numpy.typing.NDArray[numpy.float64], int, float]"),
      R"(The forces within a step of that `duration` (s), from `velocity` and `acceleration` of all coordinates, the latter
without the patches, the motors and the constraints. Rows that are `damped` choose stability over energy; without the argument, no row
does. `ahead` has a pair for each link: the position of its centre of mass after the step, in m, if the coordinates keep
their velocity, and the quaternion xyzw of its rotation until then. The trees of a simulator need it if there are
patches. `motors` (m, 4) are rows of a coordinate, a target, a gain from 0 to 1 and the largest force. A motor alone
changes the velocity v that its coordinate would have without it to (1 - gain) v + target. Motors of the trees of a
simulator do nothing.

`constraints` (k, 23) are constraints between two links, which hold as Bullet's do. A row has a key, which is the same in
every step; the kind, 0 for a point, 1 fixed, 2 for a slider; the places of the links, -1 for the world; position and
quaternion xyzw of the constraint in the inertial frame of each link; the axis of a slider in the frame of the first
link; the velocity that corrects an error of position over the error, in 1/s; and the largest force in each direction.

(p, 3) force, torque about the centroid and slip of a over b, (p, 3) normal, (p,) whether that is one of now and not the
last known, (n, 6) force and torque of patches on the links about their centres of mass, (k, 6) the forces of
constraints on their first links, three forces and three torques along their directions, the part of patches, motors and constraints in the acceleration, how often the patches were gone through, and the largest
change of a slip in the last time, as a fraction of the largest slip.)");
}

}  // namespace overlapper::python
