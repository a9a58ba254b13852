#include "forces/contact_solver.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <utility>

#include "forces/block_system.h"
#include "forces/linear.h"

namespace overlapper {
namespace {

/// The most visits of patches in a step. The number of sweeps stays between kFewest and kMost.
constexpr int kVisits = 10000;
constexpr int kFewest = 10;
constexpr int kMost = 2000;

/// A step of Newton's method follows each sweep from this one on.
constexpr int kPlain = 4;

/// Wrenches are extrapolated from this sweep on where Newton's method is not used.
constexpr int kAlone = 8;

/// Newton's method is for islands of at most so many coordinates. Elimination takes too much time for larger ones.
constexpr int kUnknowns = 300;

/// After so many steps of Newton's method times the number of coordinates, sweeps go on alone.
constexpr int kWork = 60000;

/// The most steps of Newton's method between two sweeps. If they are not enough, what they did is undone.
constexpr int kSteps = 12;

/// After so many solutions of a step, motors change from holding to their largest force only. Otherwise they may go
/// around in circles, because forces of several feet that stick are not unique.
constexpr int kRounds = 4;

/// How much sticking forces give way at first, and in the end.
constexpr double kGive = 1e-2, kLeastGive = 1e-9;
/// Groups with more coordinates keep how they share sticking forces: to share them anew takes many steps.
constexpr int kFewCoordinates = 60;

/// A search along a step ends when the power is less than this part of the power at its beginning.
constexpr double kSearched = 0.1;

/// Slips are sums of what wrenches do alone. Changes below this share of the largest term count as rounding. Six stiff
/// contacts in a row ended at 1e-12.
constexpr double kLeastChange = 1e-11;

/// The axis of a rotation times its angle in rad. NaN above a third of a turn, where rounding would matter.
Vec3 rotation_vector(const Mat3& turn) {
  const Vec3 twice{turn.row2.y - turn.row1.z, turn.row0.z - turn.row2.x, turn.row1.x - turn.row0.y};
  const double sine = norm(twice) / 2, cosine = (turn.row0.x + turn.row1.y + turn.row2.z - 1) / 2;
  if (!(sine > 0)) return cosine > 0 ? Vec3{} : Vec3{NAN, NAN, NAN};
  return (cosine > -0.5 ? std::atan2(sine, cosine) / (2 * sine) : NAN) * twice;
}

}  // namespace

struct ContactSolver::Laws {
  Six wrench;                             ///< of pressures, friction and rolling resistance, or of a constraint
  std::optional<Bilateral> constraint{};  ///< of a row that is no patch: nothing below counts then
  std::optional<Pressure> pressure{};
  std::optional<PatchFriction> friction{};
  std::optional<Coulomb> rolling{};  ///< normal; a patch may have none
  Drift drift{};
  double relative_damping = 0;  ///< N, see find_relative_damping()

  Three pressures() const { return rolling ? wrench.normal - rolling->wrench() : wrench.normal; }
};

ContactSolver::Row::Row(const ElasticPatch& patch)
    : normal(patch.normal),
      along(any_orthogonal(patch.normal)),
      across(cross(patch.normal, along)),
      area(patch, along, across) {}

ContactSolver::Screw ContactSolver::Row::world(const Six& of) const {
  const Three &n = of.normal, &t = of.tangential;
  return {n[0] * normal + t[0] * along + t[1] * across, n[1] * along + n[2] * across + t[2] * normal};
}

ContactSolver::Six ContactSolver::Row::local(const Screw& of) const {
  return {{overlapper::dot(normal, of.along), overlapper::dot(along, of.about), overlapper::dot(across, of.about)},
          {overlapper::dot(along, of.along), overlapper::dot(across, of.along), overlapper::dot(normal, of.about)}};
}

// ------------------------------------------------------------------------------------------------------------ placing

const ContactSolver::Known* ContactSolver::find(std::span<const Known> among, std::int64_t key) {
  const auto at = std::ranges::lower_bound(among, key, {}, &Known::key);
  return at != among.end() && at->key == key ? &*at : nullptr;
}

std::vector<ContactSolver::Before> ContactSolver::before() const {
  std::vector<Before> found;
  for (const ElasticPatch& patch : patches_) {
    const Known* last = find(known_before_, patch.key);
    const Known* now = known(patch.key);
    found.push_back(last ? Before{last->centroid, last->duration, last->staying, now ? now->staying : 0} : Before{});
  }
  return found;
}

std::vector<double> ContactSolver::place(std::span<const Pose> frames, std::vector<ElasticPatch> patches) {
  bodies_.place(frames);
  mobilities_.assign(bodies_.bodies().size(), {});
  for (size_t i = 0; i < mobilities_.size(); ++i) {
    if (bodies_.bodies()[i].links != 1 || !bodies_.bodies()[i].movable) continue;
    const std::span<const double> m = bodies_.inverse_mass(int(i));
    mobilities_[i] = {m[0], {{m[21], m[22], m[23]}, {m[27], m[28], m[29]}, {m[33], m[34], m[35]}}};
  }
  patches_ = std::move(patches);
  // A patch without a direction is pushed in its last direction.
  for (ElasticPatch& patch : patches_)
    if (const Known* last = patch.area > 0 ? nullptr : known(patch.key)) patch.normal = last->normal;
  make_rows();
  std::vector<double> of_body(bodies_.bodies().size());
  for (size_t i = 0; i < patches_.size(); ++i) {
    const ElasticPatch& patch = patches_[i];
    const Row& row = rows_[i];
    const double swing = largest_eigenvalue(row.area.foundation(patch.stiffness), row.normal_by_normal);
    const int a = bodies_.body_of(patch.link_a), b = bodies_.body_of(patch.link_b);
    of_body[a] += swing;
    if (a != b) of_body[b] += swing;
  }
  std::vector<double> frequency2;
  frequency2.reserve(patches_.size());
  for (const ElasticPatch& patch : patches_) {
    double highest = 0;
    for (int body : {bodies_.body_of(patch.link_a), bodies_.body_of(patch.link_b)})
      if (bodies_.bodies()[body].movable) highest = std::max(highest, of_body[body]);
    frequency2.push_back(highest);
  }
  return frequency2;
}

/// Makes the rows of patches, and those of the constraints of a step.
void ContactSolver::make_rows(const Step* step) {
  rows_.clear(), pool_.clear();
  rows_.reserve(patches_.size() + (step ? step->constraints.size() : 0));
  for (const ElasticPatch& patch : patches_) add_sides(rows_.emplace_back(patch), patch);
  share_damping();
  if (!step) return;
  for (const Constraint& constraint : step->constraints) add_constraint(constraint);
}

/// Finds the damping along the normals by `recovery`. The patches of two links are damped as one patch, as far as they
/// have the same normal: a body that consists of parts moves like a whole body. The damping follows the mean of their
/// slips, weighted by their forces. This is the slip at the centroid of the whole volume.
void ContactSolver::share_damping() {
  // A body that is about to be swallowed has a deep overlap with a small patch. The size of the overlap, over the time
  // of recovery, limits the speed with which it leaves.
  const auto leaving = [&](int i) {
    const double size = std::cbrt(patches_[i].volume);
    return std::max(rows_[i].area.area, size * size);
  };
  std::map<std::pair<int, int>, std::vector<int>> of_links;
  for (int i = 0; i < int(patches_.size()); ++i) {
    const ElasticPatch& patch = patches_[i];
    if (!(patch.recovery > 0 && patch.force > 0)) continue;
    if (patch.area > 0) {
      of_links[{patch.link_a, patch.link_b}].push_back(i);
    } else {
      rows_[i].damping = patch.recovery * patch.stiffness * leaving(i);
    }
  }
  for (const auto& [links, group] : of_links) {
    for (int i : group) {
      double stiffness = 0, force = 0;
      std::vector<Share> shares;
      for (int j : group) {
        const ElasticPatch& other = patches_[j];
        const double same = j == i ? 1 : std::max(0.0, overlapper::dot(patches_[i].normal, other.normal));
        stiffness += same * other.stiffness * (leaving(j) + other.hardened);
        force += same * other.force;
        if (j != i && same > 0) shares.push_back({j, same * other.force});
      }
      rows_[i].damping = patches_[i].recovery * stiffness * (patches_[i].force / force);
      for (Share& share : shares) share.part *= rows_[i].damping / force;
      rows_[i].damped_with = std::move(shares);
    }
  }
}

/// The damping by the motion of other patches relative to each patch, in N. It is 0 for patches that are damped alone.
void ContactSolver::find_relative_damping(const Island& island, std::span<const double> velocity,
                                          std::span<Laws> laws) const {
  for (int i : island.rows) {
    laws[i].relative_damping = 0;
    if (rows_[i].damped_with.empty()) continue;
    const double own = slip_of(rows_[i], velocity).normal[0];
    for (const auto [other, part] : rows_[i].damped_with)
      laws[i].relative_damping += part * (slip_of(rows_[other], velocity).normal[0] - own);
  }
}

/// The velocity of a link's point in all its directions, by the coordinates of its body.
std::vector<double> ContactSolver::jacobian_of(int link, Vec3 point, double sign) const {
  std::vector<double> rows(size_t(6) * bodies_.bodies()[bodies_.body_of(link)].coordinates);
  bodies_.jacobian(link, point, rows);
  for (double& each : rows) each *= sign;
  return rows;
}

void ContactSolver::add_sides(Row& row, const ElasticPatch& patch) {
  const int a = bodies_.body_of(patch.link_a), b = bodies_.body_of(patch.link_b);
  if (a == b) {
    std::vector<double> jacobian = jacobian_of(patch.link_a, patch.centroid, 1);
    const std::vector<double> other = jacobian_of(patch.link_b, patch.centroid, -1);
    for (size_t i = 0; i < jacobian.size(); ++i) jacobian[i] += other[i];
    return add_side(row, a, jacobian);
  }
  for (const auto& [link, sign] : {std::pair{patch.link_a, 1.0}, std::pair{patch.link_b, -1.0}}) {
    const int body = bodies_.body_of(link);
    if (bodies_.bodies()[body].links == 1) add_single(row, link, sign, patch.centroid);
    else add_side(row, body, jacobian_of(link, patch.centroid, sign));
  }
}

ContactSolver::Row& ContactSolver::add_held(const Held& held) {
  ElasticPatch none;
  none.normal = {0, 0, 1};
  Row& row = rows_.emplace_back(none);
  row.held = held;
  return row;
}

void ContactSolver::add_constraint(const Constraint& constraint) {
  std::array<Pose, 2> frames;
  for (int i = 0; i < 2; ++i)
    if (constraint.links[i] >= 0) frames[i] = bodies_.frame(constraint.links[i]);
  const Directions along = directions(constraint, frames);
  std::array<int, 2> bodies{-1, -1};
  std::array<std::vector<double>, 2> rows;
  for (int i = 0; i < 2; ++i) {
    const int link = constraint.links[i];
    if (link < 0) continue;
    bodies[i] = bodies_.body_of(link);
    const size_t n = bodies_.bodies()[bodies[i]].coordinates;
    const std::vector<double> jacobian = jacobian_of(link, along.points[i], i == 0 ? 1 : -1);
    rows[i].resize(6 * n);
    for (size_t r = 0; r < 6; ++r)
      for (size_t axis = 0; axis < 3; ++axis)
        for (size_t c = 0; c < n; ++c)
          rows[i][r * n + c] += along.axes[r][int(axis)] * jacobian[((r < 3 ? 0 : 3) + axis) * n + c];
  }
  Row& row = add_held({constraint.key, along.target, constraint.limit});
  add_between(row, bodies, std::move(rows));
}

/// Adds the sides of two bodies, which may be the same. -1 is the world, which never moves.
void ContactSolver::add_between(Row& row, std::array<int, 2> bodies, std::array<std::vector<double>, 2> rows) {
  if (bodies[0] == bodies[1]) {
    for (size_t i = 0; i < rows[0].size(); ++i) rows[0][i] += rows[1][i];
    bodies[1] = -1;
  }
  for (int i = 0; i < 2; ++i)
    if (bodies[i] >= 0) add_rows(row, bodies[i], rows[i]);
}

/// The motion that a wrench on a body of one link gives to its point of application. Both have the sign of the side.
ContactSolver::Screw ContactSolver::answer(const Side& side, const Screw& wrench) const {
  const Mobility& mobility = mobilities_[side.body];
  return {mobility.linear * wrench.along, mobility.angular * (wrench.about + cross(side.arm, wrench.along))};
}

void ContactSolver::add_single(Row& row, int link, double sign, Vec3 centroid) {
  const int number = bodies_.body_of(link);
  const Multibodies::Body& body = bodies_.bodies()[number];
  const Side side{
      number, body.first_coordinate, body.coordinates, body.movable, true, sign, centroid - bodies_.centre(link), 0, 0};
  row.sides[row.sides_used++] = side;
  if (!side.moves) return;
  for (int k = 0; k < 6; ++k) {
    Six unit;
    (k < 3 ? unit.normal : unit.tangential)[k % 3] = 1;
    const Screw moved = answer(side, row.world(unit));
    const Six slip = row.local({moved.along + cross(moved.about, side.arm), moved.about});
    for (int i = 0; i < 3; ++i) {
      (k < 3 ? row.normal_by_normal : row.normal_by_tangential)[i][k % 3] += slip.normal[i];
      (k < 3 ? row.tangential_by_normal : row.tangential_by_tangential)[i][k % 3] += slip.tangential[i];
    }
  }
}

void ContactSolver::add_side(Row& row, int number, std::span<const double> jacobian) {
  const size_t n = bodies_.bodies()[number].coordinates;
  std::vector<double> rows(6 * n);
  for (size_t c = 0; c < n; ++c) {
    const auto at = [&](size_t r) { return jacobian[r * n + c]; };
    const Six slip = row.local({{at(0), at(1), at(2)}, {at(3), at(4), at(5)}});
    for (size_t i = 0; i < 3; ++i) rows[i * n + c] = slip.normal[i], rows[(i + 3) * n + c] = slip.tangential[i];
  }
  add_rows(row, number, rows);
}

/// Adds a side. `given` are 6 rows: the slip by the coordinates of its body.
void ContactSolver::add_rows(Row& row, int number, std::span<const double> given) {
  const Multibodies::Body& body = bodies_.bodies()[number];
  const size_t n = body.coordinates, first = pool_.size();
  row.sides[row.sides_used++] = {number, body.first_coordinate, body.coordinates, body.movable, false, 1, {},
                                 first,  first + 6 * n};
  pool_.resize(first + 12 * n);
  double *rows = pool_.data() + first, *answers = rows + 6 * n;
  std::ranges::copy(given, rows);
  if (!body.movable) return;
  const std::span<const double> inverse = bodies_.inverse_mass(number);
  for (size_t c = 0; c < n; ++c)
    for (size_t k = 0; k < 6; ++k)
      for (size_t j = 0; j < n; ++j) answers[c * 6 + k] += inverse[c * n + j] * rows[k * n + j];
  for (size_t i = 0; i < 3; ++i)
    for (size_t k = 0; k < 3; ++k)
      for (size_t c = 0; c < n; ++c) {
        const double* answer = &answers[c * 6];
        row.normal_by_normal[i][k] += rows[i * n + c] * answer[k];
        row.normal_by_tangential[i][k] += rows[i * n + c] * answer[k + 3];
        row.tangential_by_normal[i][k] += rows[(i + 3) * n + c] * answer[k];
        row.tangential_by_tangential[i][k] += rows[(i + 3) * n + c] * answer[k + 3];
      }
}

std::vector<ContactSolver::Travel> ContactSolver::travel_of_patches(double duration,
                                                                    std::span<const double> velocity) const {
  std::vector<Travel> found;
  found.reserve(rows_.size());
  for (const Row& row : rows_) {
    const auto [n, t] = slip_of(row, velocity);
    found.push_back({duration * norm(Vec3{n[0], t[0], t[1]}), duration * norm(Vec3{n[1], n[2], t[2]})});
  }
  return found;
}

std::vector<ContactSolver::Travel> ContactSolver::travel_of_links(double duration,
                                                                  std::span<const double> velocity) const {
  std::vector<Travel> found;
  found.reserve(bodies_.links());
  for (int link = 0; link < bodies_.links(); ++link) {
    const auto [linear, angular] = bodies_.twist(link, velocity);
    found.push_back({duration * norm(linear), duration * norm(angular)});
  }
  return found;
}

// ------------------------------------------------------------------------------------------------------------- solving

ContactSolver::Six ContactSolver::slip_of(const Row& row, std::span<const double> velocity) const {
  Six slip;
  Screw single{};
  for (int s = 0; s < row.sides_used; ++s) {
    const Side& side = row.sides[s];
    const double* v = velocity.data() + side.first;
    if (side.single) {
      const Vec3 about{v[3], v[4], v[5]};
      single.along += side.sign * (Vec3{v[0], v[1], v[2]} + cross(about, side.arm));
      single.about += side.sign * about;
      continue;
    }
    const double* rows = pool_.data() + side.rows;
    const int n = side.coordinates;
    for (int i = 0; i < 3; ++i)
      for (int c = 0; c < n; ++c) {
        slip.normal[i] += rows[i * n + c] * v[c];
        slip.tangential[i] += rows[(i + 3) * n + c] * v[c];
      }
  }
  const Six more = row.local(single);
  return {slip.normal + more.normal, slip.tangential + more.tangential};
}

void ContactSolver::push(const Row& row, const Six& wrench, double factor, std::span<double> velocity) const {
  const Screw whole = row.world({factor * wrench.normal, factor * wrench.tangential});
  for (int s = 0; s < row.sides_used; ++s) {
    const Side& side = row.sides[s];
    if (!side.moves) continue;
    double* v = &velocity[side.first];
    if (side.single) {
      const Screw moved = answer(side, whole);
      for (int i = 0; i < 3; ++i) v[i] += side.sign * moved.along[i], v[i + 3] += side.sign * moved.about[i];
      continue;
    }
    const double* answers = &pool_[side.answers];
    for (int c = 0; c < side.coordinates; ++c)
      for (int k = 0; k < 3; ++k)
        v[c] += factor * (answers[c * 6 + k] * wrench.normal[k] + answers[c * 6 + k + 3] * wrench.tangential[k]);
  }
}

ContactSolver::Six ContactSolver::known_wrench(size_t patch) const {
  const Known* last = known(patches_[patch].key);
  return last ? rows_[patch].local(last->wrench) : Six{{std::max(0.0, patches_[patch].force), 0, 0}, {}};
}

/// The share of a body's spin that moves its surface away from the contact. It is 1 if the contact keeps its place. An
/// edge about which the body tips does so. It is 0 if the contact goes on with the centre of the body, as below a
/// wheel. It may be anything below a face that rocks: its centroid goes to and fro much faster than the surface. The
/// velocities are those of the centre, and of the surface at the contact relative to the centre.
double ContactSolver::staying(const ElasticPatch& patch, Vec3 centre_velocity, Vec3 by_spin) const {
  const Known* last = known(patch.key);
  if (!last || !(norm2(by_spin) > 0)) return 0;
  const Vec3 moved = patch.centroid - last->centroid;
  if (norm2(moved) == 0) return last->staying;  // the same poses again, or no motion
  return overlapper::dot(moved / last->duration - centre_velocity, by_spin) / norm2(by_spin);
}

/// Without it, a body on a turntable leaves its circle along a tangent in every step. The body that turns less carries
/// the other one around: what sticks to it moves along arcs. The other body may also turn relative to the first.
/// `rotations` are the rotation vectors of the links.
ContactSolver::Drift ContactSolver::drift(size_t patch, const Step& step, std::span<const MovedOn> ahead,
                                          std::span<const Vec3> rotations) const {
  const ElasticPatch& p = patches_[patch];
  const double h = step.duration;
  std::array<Vec3, 2> velocity, spin, bend, twist;
  const std::array<int, 2> link{p.link_a, p.link_b};
  for (int i = 0; i < 2; ++i) {
    const auto [linear, angular] = bodies_.twist(link[i], step.velocity);
    velocity[i] = linear, spin[i] = angular;
    bend[i] = (ahead[link[i]].centre - bodies_.centre(link[i])) / h - linear;
    twist[i] = rotations[link[i]] / h - angular;
    if (!finite(twist[i])) return {};  // half a turn in a step has no direction
  }
  const int carrier = norm2(spin[0]) < norm2(spin[1]) ? 0 : 1, other = 1 - carrier;
  const Vec3 apart = bodies_.centre(link[1]) - bodies_.centre(link[0]);
  const Vec3 around = (ahead[link[carrier]].turn * apart - apart) / h - cross(spin[carrier], apart);
  const Vec3 arm = p.centroid - bodies_.centre(link[other]), beside = spin[other] - spin[carrier];
  const Vec3 by_spin = cross(spin[other], arm);
  const double stays = staying(p, velocity[other], by_spin);
  const Vec3 turning = cross(spin[carrier], cross(beside, arm)) + std::clamp(stays, 0.0, 1.0) * cross(beside, by_spin);
  const Vec3 along = bend[0] - bend[1] + around + (other == 0 ? h / 2 : -h / 2) * turning;
  return {rows_[patch].local({along, twist[0] - twist[1]}).tangential, stays};
}

Pressure::Damping ContactSolver::damping(size_t patch, std::span<const Six> before,
                                         std::span<const Drift> drifts) const {
  const Row& row = rows_[patch];
  if (!(row.damping > 0)) return {};
  // The patches of two links have the same numbers, so that parts of a body, and prisms below it, act as a whole.
  // A face that rocks keeps its place.
  const auto kept = [&](size_t i) { return drifts[i].staying < -1 ? 1 : std::clamp(drifts[i].staying, 0.0, 1.0); };
  double approach = before[patch].normal[0], staying = kept(patch);
  for (const auto [other, part] : row.damped_with) {
    approach += part / row.damping * (before[other].normal[0] - before[patch].normal[0]);
    staying += part / row.damping * (kept(other) - kept(patch));
  }
  return {row.damping, approach, staying};
}

/// Updates pressures first, then rolling resistance and friction, because pressures limit these. Returns the change of
/// the slip.
double ContactSolver::visit(size_t index, Laws& laws, double duration, std::span<double> velocity) const {
  const Row& row = rows_[index];
  const Six slip = slip_of(row, velocity), last = laws.wrench;
  if (laws.constraint) {
    laws.wrench = six(laws.constraint->answer(numbers(slip), numbers(last)));
  } else {
    const Three pressures = laws.pressures(), without = slip.normal - duration * (row.normal_by_normal * pressures);
    const Three pressed = laws.pressure->answer(without, laws.relative_damping);
    laws.wrench.normal = pressed;
    if (laws.rolling) {
      laws.rolling->answer(slip.normal + duration * (row.normal_by_normal * (pressed - pressures)), pressed[0]);
      laws.wrench.normal = pressed + laws.rolling->wrench();
    }
    const Three normal = laws.wrench.normal - last.normal;
    const Three tangential = slip.tangential + laws.drift.slip + duration * (row.tangential_by_normal * normal);
    laws.wrench.tangential = laws.friction->answer(tangential, pressed[0]);
  }
  const Six change{laws.wrench.normal - last.normal, laws.wrench.tangential - last.tangential};
  push(row, change, duration, velocity);
  return largest_change(row, laws, change, duration);
}

/// The largest change of a velocity of a row, in m/s, if its wrench changes so. Angular velocities of a patch are
/// multiplied by the mean distance of its points from the centroid: where a body sticks and tips, nothing else changes.
double ContactSolver::largest_change(const Row& row, const Laws& laws, const Six& change, double duration) const {
  const Six moved = response(row, change);
  if (laws.constraint) return duration * laws.constraint->speed(numbers(moved));
  const auto [n, t] = moved;
  const double turned = std::max({std::abs(n[1]), std::abs(n[2]), std::abs(t[2])}) * row.area.distance;
  return duration * std::max({std::abs(n[0]), std::abs(t[0]), std::abs(t[1]), turned});
}

/// The slip of a patch in m/s, or the speed that a constraint misses.
double ContactSolver::speed(const Row& row, const Laws& laws, std::span<const double> velocity) const {
  const Six slip = slip_of(row, velocity);
  if (laws.constraint) return laws.constraint->missing(numbers(slip));
  return std::max({std::abs(slip.normal[0]), std::abs(slip.tangential[0]), std::abs(slip.tangential[1])});
}

SixNumbers ContactSolver::numbers(const Six& of) {
  const Three &n = of.normal, &t = of.tangential;
  return {n[0], n[1], n[2], t[0], t[1], t[2]};
}

ContactSolver::Six ContactSolver::six(const SixNumbers& of) { return {{of[0], of[1], of[2]}, {of[3], of[4], of[5]}}; }

ContactSolver::Six ContactSolver::response(const Row& row, const Six& wrench) {
  return {row.normal_by_normal * wrench.normal + row.normal_by_tangential * wrench.tangential,
          row.tangential_by_normal * wrench.normal + row.tangential_by_tangential * wrench.tangential};
}

std::vector<ContactSolver::Island> ContactSolver::islands() const {
  const std::span<const Multibodies::Body> bodies = bodies_.bodies();
  std::vector<int> root(bodies.size());
  std::iota(root.begin(), root.end(), 0);
  const auto find = [&](int body) {
    while (root[body] != body) body = root[body] = root[root[body]];
    return body;
  };
  for (const Row& row : rows_)
    if (row.sides_used == 2 && row.sides[0].moves && row.sides[1].moves)
      root[find(row.sides[1].body)] = find(row.sides[0].body);
  std::vector<Island> found;
  std::vector<int> of_root(bodies.size(), -1);
  for (int i = 0; i < int(rows_.size()); ++i) {
    const Row& row = rows_[i];
    const Side& side = row.sides[row.sides[0].moves ? 0 : row.sides_used - 1];
    int alone = -1;  // nothing moves
    int& island = side.moves ? of_root[find(side.body)] : alone;
    if (island < 0) island = int(found.size()), found.emplace_back();
    found[island].rows.push_back(i);
  }
  for (int body = 0; body < int(bodies.size()); ++body)
    if (const int island = of_root[find(body)]; island >= 0 && bodies[body].movable)
      found[island].bodies.push_back(body);
  return found;
}

/// Newton's method for all patches of an island at once. The unknowns are the changes of the velocities of its bodies,
/// as these are few. Sticking forces give way a little from those before, so that the wrenches are functions of the
/// velocities, see Coulomb::held. A few calls of `settle` leave nothing of that. In small groups, the first call gives
/// way from no forces: patches that could share forces in many ways share them evenly.
class ContactSolver::Newton {
 public:
  Newton(const ContactSolver& solver, const Island& island)
      : solver_(solver),
        island_(island),
        system_(sizes(solver, island), pairs(solver, island)),
        afresh_(system_.unknowns() <= kFewCoordinates),
        patches_(island.rows.size()) {
    moved_.resize(solver.bodies_.coordinates());
    find_parts();
  }

  /// Finds wrenches and velocities that agree, such that the wrenches change slips by `enough` at most.
  void settle(std::span<Laws> laws, double duration, double enough, std::span<double> velocity) {
    const std::vector<double> begun(velocity.begin(), velocity.end());
    bool agreed = false;
    double last = INFINITY, last_but_one = INFINITY;
    for (size_t k = 0; k < patches_.size(); ++k) {
      const Laws& law = laws[island_.rows[k]];
      patches_[k].begin = law.wrench, patches_[k].before = law.pressures();
    }
    for (int step = 0; step < kSteps; ++step) {
      const double off = linearise(laws, duration, velocity);
      ++steps_;
      if (agreed = off <= enough; agreed) break;
      system_.solve(right_);
      // A patch without a derivative, as at the very edge of its area, makes a step useless.
      if (!std::ranges::all_of(right_, [](double each) { return std::isfinite(each); })) break;
      for (size_t b = 0; b < island_.bodies.size(); ++b) {
        const Multibodies::Body& body = solver_.bodies_.bodies()[island_.bodies[b]];
        std::copy_n(&right_[system_.first(int(b))], body.coordinates, &moved_[body.first_coordinate]);
      }
      find_changes();
      // A step that leads back to where the last one began is halved.
      const double part = search(laws) * (off > 0.9 * last_but_one ? 0.5 : 1);
      last_but_one = last, last = off;
      for (size_t k = 0; k < patches_.size(); ++k) {
        const int i = island_.rows[k];
        const Six& change = patches_[k].change;
        laws[i].wrench = sum(laws[i].wrench, change, part);
        solver_.push(solver_.rows_[i], change, part * duration, velocity);
      }
    }
    for (size_t k = 0; k < patches_.size(); ++k) {
      const int i = island_.rows[k];
      const Six present = std::exchange(laws[i].wrench, agreed ? patches_[k].wrench : patches_[k].begin);
      if (!agreed) continue;
      solver_.push(solver_.rows_[i], sum(laws[i].wrench, present, -1), duration, velocity);
      if (laws[i].friction) laws[i].friction->take();
      if (laws[i].rolling) laws[i].rolling->take();
    }
    if (!agreed) std::ranges::copy(begun, velocity.begin());
    give_ = agreed ? std::max(kLeastGive, give_ / tightening_) : std::min(1.0, give_ * 10);
    if (!agreed) tightening_ = 2;
    if (agreed) afresh_ = false;
  }

  int steps() const { return steps_; }

 private:
  static double& at(Six& of, int k) { return k < 3 ? of.normal[k] : of.tangential[k - 3]; }
  static double at(const Six& of, int k) { return k < 3 ? of.normal[k] : of.tangential[k - 3]; }

  /// A side of a patch that moves. `rows` has the slip by each of its coordinates (6 rows). `answers` has the change of
  /// each coordinate by a wrench in 1 s (rows of 6).
  struct Part {
    int block = -1, coordinates = 0;
    const double *rows = nullptr, *answers = nullptr;
  };

  /// A patch in a step: slip and relative damping, the wrench by its laws, what is missing to it, and the changes.
  struct OfPatch {
    Six begin;  ///< the wrench at first, and its pressures
    Three before;
    Six slip;
    double more = 0;
    Six wrench, missing;
    SixBySix by_slip{};
    SixNumbers by_damping{};
    Six slip_change, change;
    double more_change = 0;
    std::array<Part, 2> parts{};
  };

  static std::vector<int> sizes(const ContactSolver& solver, const Island& island) {
    std::vector<int> found;
    for (int body : island.bodies) found.push_back(solver.bodies_.bodies()[body].coordinates);
    return found;
  }

  static std::vector<std::array<int, 2>> pairs(const ContactSolver& solver, const Island& island) {
    std::vector<std::array<int, 2>> found;
    for (int i : island.rows)
      if (const Row& row = solver.rows_[i]; row.sides_used == 2 && row.sides[0].moves && row.sides[1].moves)
        found.push_back({place(island, row.sides[0]), place(island, row.sides[1])});
    return found;
  }

  static int place(const Island& island, const Side& side) {
    return int(std::ranges::lower_bound(island.bodies, side.body) - island.bodies.begin());
  }

  void find_parts() {
    size_t singles = 0;
    for (int i : island_.rows)
      for (const Side& side : solver_.rows_[i].sides) singles += side.single && side.moves;
    pool_.resize(singles * 72);
    double* at = pool_.data();
    for (size_t k = 0; k < patches_.size(); ++k) {
      const Row& row = solver_.rows_[island_.rows[k]];
      for (int s = 0; s < row.sides_used; ++s) {
        const Side& side = row.sides[s];
        if (!side.moves) continue;
        Part& part = patches_[k].parts[s];
        const double* pool = solver_.pool_.data();
        part = {place(island_, side), side.coordinates, pool + side.rows, pool + side.answers};
        if (!side.single) continue;
        rows_of(row, side, at), answers_of(row, side, at + 36);
        part.rows = at, part.answers = at + 36;
        at += 72;
      }
    }
  }

  static void rows_of(const Row& row, const Side& side, double* rows) {
    for (int c = 0; c < 6; ++c) {
      Vec3 axis{};
      (c % 3 == 0 ? axis.x : c % 3 == 1 ? axis.y : axis.z) = side.sign;
      const Six slip = row.local(c < 3 ? Screw{axis, {}} : Screw{cross(axis, side.arm), axis});
      for (int i = 0; i < 3; ++i) rows[i * 6 + c] = slip.normal[i], rows[(i + 3) * 6 + c] = slip.tangential[i];
    }
  }

  void answers_of(const Row& row, const Side& side, double* answers) const {
    for (int k = 0; k < 6; ++k) {
      Six unit;
      (k < 3 ? unit.normal : unit.tangential)[k % 3] = side.sign;
      const Screw moved = solver_.answer(side, row.world(unit));
      for (int c = 0; c < 3; ++c) answers[c * 6 + k] = moved.along[c], answers[(c + 3) * 6 + k] = moved.about[c];
    }
  }

  static Six sum(const Six& a, const Six& b, double part) {
    return {a.normal + part * b.normal, a.tangential + part * b.tangential};
  }

  /// The wrench of a patch near a slip.
  struct Near {
    Linear pressed, rubbed, rolled;
    Six wrench() const { return {pressed.value + rolled.value, rubbed.value}; }
  };
  Near near(Laws& laws, const Three& before, const Six& slip, double more) const {
    Near found;
    found.pressed = laws.pressure->held(slip.normal, more, give_, before, laws.pressures());
    const double pressing = found.pressed.value[0];
    found.rubbed = laws.friction->held(slip.tangential + laws.drift.slip, pressing, give_, afresh_);
    if (laws.rolling) found.rolled = laws.rolling->held(slip.normal, pressing, give_, afresh_);
    return found;
  }

  Six wrench_near(Laws& laws, const OfPatch& of, const Six& slip, double more) const {
    if (laws.constraint) return six(laws.constraint->held(numbers(slip), numbers(of.begin), give_).value);
    return near(laws, of.before, slip, more).wrench();
  }

  /// Finds the wrench of a row by its law, and how it changes by the slip.
  void find_law(Laws& laws, OfPatch& of) const {
    if (laws.constraint) {
      const auto [value, by_slip] = laws.constraint->held(numbers(of.slip), numbers(of.begin), give_);
      of.wrench = six(value), of.by_slip = by_slip, of.by_damping = {};
      return;
    }
    const Near found = near(laws, of.before, of.slip, of.more);
    of.wrench = found.wrench();
    of.by_slip = {}, of.by_damping = {};
    const auto put = [&](const Linear& part, int first) {
      // Its other number is the pressing force.
      for (int r = 0; r < 3; ++r) {
        of.by_damping[first + r] += part.by_other[r] * found.pressed.by_other[0];
        for (int c = 0; c < 3; ++c) {
          of.by_slip[first + r][first + c] += part.by_slip[r][c];
          of.by_slip[first + r][c] += part.by_other[r] * found.pressed.by_slip[0][c];
        }
      }
    };
    put(found.rubbed, 3);
    put(found.rolled, 0);
    for (int r = 0; r < 3; ++r) {
      of.by_damping[r] += found.pressed.by_other[r];
      for (int c = 0; c < 3; ++c) of.by_slip[r][c] += found.pressed.by_slip[r][c];
    }
  }

  /// Makes the system for a step. Returns the largest change of a slip by a wrench that its law would give now.
  double linearise(std::span<Laws> laws, double duration, std::span<const double> velocity) {
    solver_.find_relative_damping(island_, velocity, laws);
    system_.reset();
    right_.assign(system_.unknowns(), 0.0);
    double off = 0;
    for (size_t k = 0; k < patches_.size(); ++k) {
      const int i = island_.rows[k];
      const Row& row = solver_.rows_[i];
      OfPatch& of = patches_[k];
      of.slip = solver_.slip_of(row, velocity), of.more = laws[i].relative_damping;
      find_law(laws[i], of);
      of.missing = sum(of.wrench, laws[i].wrench, -1);
      off = std::max(off, solver_.largest_change(row, laws[i], of.missing, duration));
      add(row, of, duration);
    }
    return off;
  }

  /// Finds the changes of slips and wrenches by the whole step.
  void find_changes() {
    for (size_t k = 0; k < patches_.size(); ++k) {
      const Row& row = solver_.rows_[island_.rows[k]];
      OfPatch& of = patches_[k];
      of.slip_change = solver_.slip_of(row, moved_), of.more_change = 0;
      for (const auto [other, part] : row.damped_with)
        of.more_change += part * (solver_.slip_of(solver_.rows_[other], moved_).normal[0] - of.slip_change.normal[0]);
      of.change = of.missing;
      for (int r = 0; r < 6; ++r) {
        double by = of.by_damping[r] * of.more_change;
        for (int c = 0; c < 6; ++c) by += of.by_slip[r][c] * at(of.slip_change, c);
        at(of.change, r) += by;
      }
    }
  }

  /// The part of the step after which the power of the wrenches that are missing is 0, or 1. Laws that take energy away
  /// let this power grow along the step.
  double search(std::span<Laws> laws) {
    const auto power = [&](double part) {
      double sum_of = 0;
      for (size_t k = 0; k < patches_.size(); ++k) {
        const int i = island_.rows[k];
        const OfPatch& of = patches_[k];
        const Six slip = sum(of.slip, of.slip_change, part);
        const Six found = wrench_near(laws[i], of, slip, of.more + part * of.more_change);
        for (int r = 0; r < 6; ++r)
          sum_of += (at(laws[i].wrench, r) + part * at(of.change, r) - at(found, r)) * at(of.slip_change, r);
      }
      return sum_of;
    };
    double low = 0, high = 1, at_low = 0;
    for (const OfPatch& of : patches_)
      for (int r = 0; r < 6; ++r) at_low -= at(of.missing, r) * at(of.slip_change, r);
    const double begin = std::abs(at_low);
    double at_high = power(1);
    if (!(at_low < 0) || !(at_high > kSearched * begin)) return 1;
    double part = 1;
    for (int k = 0; k < 12; ++k) {
      // Regula falsi in the form of Illinois.
      part = (low * at_high - high * at_low) / (at_high - at_low);
      const double here = power(part);
      if (std::abs(here) <= kSearched * begin) break;
      if (here > 0) high = part, at_high = here, at_low /= 2;
      else low = part, at_low = here, at_high /= 2;
    }
    return part;
  }

  /// Adds the change of a patch's wrench to the system.
  void add(const Row& row, const OfPatch& of, double duration) {
    for (const Part& part : of.parts) {
      for (int c = 0; c < part.coordinates; ++c)
        for (int k = 0; k < 6; ++k)
          right_[system_.first(part.block) + c] += duration * part.answers[c * 6 + k] * at(of.missing, k);
    }
    for (size_t t = 0; t < 2; ++t) {
      const Part& to = of.parts[t];
      if (to.block < 0) continue;
      const size_t n = to.coordinates;
      wrench_.assign(6 * n, 0.0);
      for (size_t r = 0; r < 6; ++r) add_product(&wrench_[r * n], &of.by_slip[r][0], to.rows, n);
      for (const auto [other, share] : row.damped_with) {
        const auto at = std::ranges::lower_bound(island_.rows, other) - island_.rows.begin();
        const double* others = patches_[at].parts[t].rows;
        for (size_t r = 0; r < 6; ++r)
          for (size_t c = 0; c < n; ++c) wrench_[r * n + c] += of.by_damping[r] * share * (others[c] - to.rows[c]);
      }
      for (double& each : wrench_) each *= -duration;
      for (const Part& from : of.parts) {
        if (from.block < 0) continue;
        double* block = system_.at(from.block, to.block);
        for (int i = 0; i < from.coordinates; ++i) add_product(block + i * n, from.answers + i * 6, wrench_.data(), n);
      }
    }
  }

  /// Adds six factors times 6 rows of n numbers to one row.
  static void add_product(double* to, const double* factors, const double* rows, size_t n) {
    const double *r0 = rows, *r1 = r0 + n, *r2 = r1 + n, *r3 = r2 + n, *r4 = r3 + n, *r5 = r4 + n;
    const double f0 = factors[0], f1 = factors[1], f2 = factors[2], f3 = factors[3], f4 = factors[4], f5 = factors[5];
    for (size_t c = 0; c < n; ++c) to[c] += f0 * r0[c] + f1 * r1[c] + f2 * r2[c] + f3 * r3[c] + f4 * r4[c] + f5 * r5[c];
  }

  const ContactSolver& solver_;
  const Island& island_;
  BlockSystem system_;
  double give_ = kGive, tightening_ = 30;
  bool afresh_;  ///< sticking forces are shared anew
  int steps_ = 0;
  std::vector<OfPatch> patches_;
  std::vector<double> right_, moved_, wrench_;
  std::vector<double> pool_;  ///< of parts of bodies of one link
};

/// Extrapolates the wrenches after a sweep there and back (Nesterov 1983). It begins anew when the sweeps go against
/// the extrapolation (O'Donoghue and Candès 2015). The next visits replace the wrenches, so these need not obey the
/// laws.
void ContactSolver::extrapolate(Momentum& momentum, const Island& island, std::span<Laws> laws, double duration,
                                std::span<double> velocity) const {
  auto& [before, begun, weight] = momentum;
  double against = before.empty() ? 1 : 0;
  for (size_t j = 0; j < before.size(); ++j) {
    const Row& row = rows_[island.rows[j]];
    const Six &now = laws[island.rows[j]].wrench, &last = before[j], &from = begun[j];
    for (int k = 0; k < 3; ++k) {
      against += row.normal_by_normal[k][k] * (from.normal[k] - now.normal[k]) * (now.normal[k] - last.normal[k]);
      against += row.tangential_by_tangential[k][k] * (from.tangential[k] - now.tangential[k]) *
                 (now.tangential[k] - last.tangential[k]);
    }
  }
  before.resize(island.rows.size()), begun.resize(island.rows.size());
  if (against > 0) weight = 1;
  const double next = (1 + std::sqrt(1 + 4 * weight * weight)) / 2, factor = (weight - 1) / next;
  weight = next;
  for (size_t j = 0; j < before.size(); ++j) {
    Laws& law = laws[island.rows[j]];
    const Six more{factor * (law.wrench.normal - before[j].normal),
                   factor * (law.wrench.tangential - before[j].tangential)};
    push(rows_[island.rows[j]], more, duration, velocity);
    before[j] = law.wrench;
    law.wrench = begun[j] = {law.wrench.normal + more.normal, law.wrench.tangential + more.tangential};
    if (law.friction) law.friction->begin(law.wrench.tangential);
  }
}

/// Sweeps and steps of Newton's method until nothing changes. `largest` is the largest slip without forces.
ContactSolver::Ended ContactSolver::settle(const Island& island, std::span<Laws> laws, const Step& step, double largest,
                                           std::span<double> velocity) const {
  const double duration = step.duration;
  const int count = int(island.rows.size());
  Ended ended;
  std::optional<Newton> newton;
  int unknowns = 0;
  for (int body : island.bodies) unknowns += bodies_.bodies()[body].coordinates;
  const bool small = unknowns > 0 && unknowns <= kUnknowns;
  // Bodies may be at rest until they are pushed.
  const auto fastest = [&, free = largest] {
    double found = free;
    for (int i : island.rows) {
      const double pushed = largest_change(rows_[i], laws[i], laws[i].wrench, duration);
      found = std::max({found, speed(rows_[i], laws[i], velocity), kLeastChange / kSettled * pushed});
    }
    return found;
  };
  double changed = 0;
  Momentum momentum;
  for (const int most = std::clamp(kVisits / count, kFewest, kMost); ended.sweeps < most;) {
    // Sweeps go there and back, so that a push at one end of a stack soon reaches the other end.
    changed = 0;
    find_relative_damping(island, velocity, laws);
    for (int k = 0; k < count; ++k) {
      const int i = island.rows[ended.sweeps % 2 ? count - 1 - k : k];
      changed = std::max(changed, visit(i, laws[i], duration, velocity));
    }
    if (++ended.sweeps == 1) largest = fastest();
    // The first sweep may leave slips much larger than those of the solution.
    if (changed <= step.settled * largest && changed <= step.settled * (largest = fastest())) break;
    if (!small && ended.sweeps >= kAlone && ended.sweeps % 2 == 0 && ended.sweeps + 2 <= most &&
        step.friction == Friction::kEllipsoid)
      extrapolate(momentum, island, laws, duration, velocity);
    if (!small || ended.sweeps < kPlain || ended.sweeps == most || (newton && newton->steps() * unknowns >= kWork))
      continue;
    if (!newton) newton.emplace(*this, island);
    newton->settle(laws, duration, std::max(step.settled / 10 * largest, kSearched / 10 * changed), velocity);
  }
  ended.residual = changed > 0 ? changed / largest : 0;
  return ended;
}

ContactSolver::Solution ContactSolver::solve(const Step& step) {
  std::vector<double> velocity(step.velocity.begin(), step.velocity.end());
  for (size_t i = 0; i < velocity.size(); ++i) velocity[i] += step.duration * step.acceleration[i];
  if (!step.motors.empty()) return solve_with_motors(step, std::move(velocity));
  if (step.constraints.empty()) return solve_patches(step, std::move(velocity));
  make_rows(&step);
  Solution solution = solve_patches(step, std::move(velocity));
  rows_.erase(rows_.begin() + std::ptrdiff_t(patches_.size()), rows_.end());
  return solution;
}

/// Which motors push with their largest force is taken to be as in the last step at first. It is found anew until it
/// agrees with the forces of the patches.
ContactSolver::Solution ContactSolver::solve_with_motors(const Step& step, std::vector<double> velocity) {
  const double h = step.duration;
  full_.resize(velocity.size());
  std::map<int, std::vector<Motor>> of_bodies;
  const std::span<const Multibodies::Body> bodies = bodies_.bodies();
  for (Motor motor : step.motors) {
    const int number = bodies_.body_with(motor.coordinate);
    motor.coordinate -= bodies[number].first_coordinate;
    if (!bodies_.mass(number).empty()) of_bodies[number].push_back(motor);
  }
  std::map<int, std::vector<double>> without;  // motors: the inverse mass matrices
  Solution solution;
  bool changed = true;
  for (int round = 0; changed; ++round) {
    std::vector<std::pair<int, MotorsOfBody>> driven;
    std::vector<double> start = velocity;
    for (const auto& [number, motors] : of_bodies) {
      const Multibodies::Body& body = bodies[number];
      const size_t first = body.first_coordinate, n = body.coordinates;
      const std::span<const double> free(&velocity[first], n);
      driven.emplace_back(number, MotorsOfBody(motors, bodies_.mass(number), free, h, std::span(&full_[first], n)));
      const MotorsOfBody& of = driven.back().second;
      std::ranges::copy(of.velocity(), &start[first]);
      std::vector<double> before = bodies_.exchange_inverse_mass(number, of.inverse_mass());
      if (round == 0) without[number] = std::move(before);
    }
    make_rows(&step);
    solution = solve_patches(step, start);
    changed = false;
    for (auto& [number, of] : driven) {
      const Multibodies::Body& body = bodies[number];
      const size_t first = body.first_coordinate, n = body.coordinates;
      std::vector<double> end(n), impulses = forces_on_coordinates(number, solution);
      for (size_t c = 0; c < n; ++c) {
        end[c] = start[first + c] + h * solution.acceleration[first + c];
        impulses[c] *= h;
        solution.acceleration[first + c] = (end[c] - velocity[first + c]) / h;
      }
      changed = of.changes(end, impulses, round >= kRounds) || changed;
    }
  }
  for (auto& [number, inverse_mass] : without) bodies_.exchange_inverse_mass(number, std::move(inverse_mass));
  make_rows();
  return solution;
}

/// The forces on the coordinates of a body with joints by the patches and the constraints.
std::vector<double> ContactSolver::forces_on_coordinates(int number, const Solution& solution) const {
  std::vector<double> forces(bodies_.bodies()[number].coordinates);
  const size_t n = forces.size();
  for (size_t i = 0; i < rows_.size(); ++i) {
    const Row& row = rows_[i];
    const size_t count = patches_.size();
    const Six wrench = i < count ? row.local({solution.patches[i].force, solution.patches[i].torque})
                                 : six(solution.constraints[i - count]);
    for (int s = 0; s < row.sides_used; ++s) {
      if (row.sides[s].body != number) continue;
      const double* rows = &pool_[row.sides[s].rows];
      for (size_t k = 0; k < 3; ++k)
        for (size_t c = 0; c < n; ++c)
          forces[c] += rows[k * n + c] * wrench.normal[k] + rows[(k + 3) * n + c] * wrench.tangential[k];
    }
  }
  return forces;
}

ContactSolver::Solution ContactSolver::solve_patches(const Step& step, std::vector<double> velocity) {
  const double h = step.duration;
  const int count = int(rows_.size());
  const size_t patches = patches_.size();
  std::vector<MovedOn> found;
  if (step.ahead.empty() && patches > 0) found = bodies_.ahead(h, step.velocity);
  const std::span<const MovedOn> ahead = step.ahead.empty() ? std::span<const MovedOn>(found) : step.ahead;
  std::vector<Vec3> rotations;
  rotations.reserve(ahead.size());
  for (const MovedOn& link : ahead) rotations.push_back(rotation_vector(link.turn));
  std::vector<Laws> laws;
  laws.reserve(count);
  std::vector<Six> before;
  std::vector<Drift> drifts;
  before.reserve(patches), drifts.reserve(patches);
  for (size_t i = 0; i < patches; ++i) before.push_back(slip_of(rows_[i], step.velocity));
  for (size_t i = 0; i < patches; ++i) drifts.push_back(drift(i, step, ahead, rotations));
  for (size_t i = 0; i < patches; ++i) {
    const ElasticPatch& patch = patches_[i];
    const Row& row = rows_[i];
    const Rule rule = step.damped[i] ? Rule::kDamping : Rule::kKeeping;
    const Pressure::Damping damped = damping(i, before, drifts);
    Laws& law = laws.emplace_back();
    law.wrench = known_wrench(i), law.drift = drifts[i];
    law.pressure.emplace(patch, row.area, row.normal_by_normal, damped, before[i].normal, h, rule);
    law.friction.emplace(patch, row.area, h * row.tangential_by_tangential, step.friction);
    if (patch.rolling > 0) {
      const ThreeByThree turns{{{0, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
      law.rolling.emplace(turns, h * row.normal_by_normal, patch.rolling);
    }
    law.wrench.tangential = law.friction->begin(law.wrench.tangential);
  }
  for (size_t i = patches; i < rows_.size(); ++i) {
    const Row& row = rows_[i];
    SixBySix mobility{};
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) {
        mobility[r][c] = h * row.normal_by_normal[r][c], mobility[r][c + 3] = h * row.normal_by_tangential[r][c];
        mobility[r + 3][c] = h * row.tangential_by_normal[r][c];
        mobility[r + 3][c + 3] = h * row.tangential_by_tangential[r][c];
      }
    Laws& law = laws.emplace_back();
    law.constraint.emplace(mobility, row.held->target, row.held->limit);
    const auto last = std::ranges::find(known_held_, row.held->key, &KnownHeld::key);
    if (last != known_held_.end()) law.wrench = last->wrench;
  }
  std::vector<double> free;
  for (size_t i = 0; i < rows_.size(); ++i) free.push_back(speed(rows_[i], laws[i], velocity));
  for (int i = 0; i < count; ++i) push(rows_[i], laws[i].wrench, h, velocity);
  Ended all;
  for (const Island& island : islands()) {
    double largest = 0;
    for (int i : island.rows) largest = std::max(largest, free[i]);
    const Ended ended = settle(island, laws, step, largest, velocity);
    all = {std::max(all.sweeps, ended.sweeps), std::max(all.residual, ended.residual)};
  }
  Solution solution = solved(laws, velocity);
  solution.sweeps = all.sweeps;
  solution.residual = all.residual;
  remember(solution, laws, h);
  return solution;
}

ContactSolver::Solution ContactSolver::solved(std::span<const Laws> laws, std::span<const double> velocity) const {
  Solution solution;
  solution.links.assign(bodies_.links(), {Vec3{}, Vec3{}});
  solution.acceleration.assign(velocity.size(), 0);
  for (size_t i = patches_.size(); i < laws.size(); ++i) {
    solution.constraints.push_back(numbers(laws[i].wrench));
    push(rows_[i], laws[i].wrench, 1, solution.acceleration);
  }
  for (size_t i = 0; i < patches_.size(); ++i) {
    const ElasticPatch& patch = patches_[i];
    const Screw wrench = rows_[i].world(laws[i].wrench);
    const Six slip{{}, slip_of(rows_[i], velocity).tangential + laws[i].drift.slip};
    solution.patches.push_back({wrench.along, wrench.about, rows_[i].world(slip).along});
    push(rows_[i], laws[i].wrench, 1, solution.acceleration);
    for (const auto& [link, sign] : {std::pair{patch.link_a, 1.0}, std::pair{patch.link_b, -1.0}}) {
      auto& [force, torque] = solution.links[link];
      force += sign * wrench.along;
      torque += sign * (wrench.about + cross(patch.centroid - bodies_.centre(link), wrench.along));
    }
  }
  return solution;
}

void ContactSolver::remember(const Solution& solution, std::span<const Laws> laws, double duration) {
  std::swap(known_, known_before_);
  known_.clear();
  for (size_t i = 0; i < patches_.size(); ++i)
    known_.push_back({patches_[i].key,
                      patches_[i].normal,
                      patches_[i].centroid,
                      {solution.patches[i].force, solution.patches[i].torque},
                      duration,
                      laws[i].drift.staying});
  std::ranges::sort(known_, {}, &Known::key);
  known_held_.clear();
  for (size_t i = patches_.size(); i < rows_.size(); ++i) known_held_.push_back({rows_[i].held->key, laws[i].wrench});
}

}  // namespace overlapper
