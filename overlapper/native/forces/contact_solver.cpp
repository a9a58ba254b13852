#include "forces/contact_solver.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace overlapper {
namespace {

/// Sweeps end when no slip changes by more than this fraction of the largest slip without forces, or of the largest
/// change of a sweep.
constexpr double kSettled = 1e-8;

/// The most visits of patches in a step. The number of sweeps stays between kFewest and kMost.
constexpr int kVisits = 10000;
constexpr int kFewest = 10;
constexpr int kMost = 2000;

/// Wrenches are extrapolated from this sweep on.
constexpr int kPlain = 8;

/// The axis of a rotation times its angle in rad. NaN above a third of a turn, where rounding would matter.
Vec3 rotation_vector(const Mat3& turn) {
  const Vec3 twice{turn.row2.y - turn.row1.z, turn.row0.z - turn.row2.x, turn.row1.x - turn.row0.y};
  const double sine = norm(twice) / 2, cosine = (turn.row0.x + turn.row1.y + turn.row2.z - 1) / 2;
  if (!(sine > 0)) return cosine > 0 ? Vec3{} : Vec3{NAN, NAN, NAN};
  return (cosine > -0.5 ? std::atan2(sine, cosine) / (2 * sine) : NAN) * twice;
}

}  // namespace

struct ContactSolver::Laws {
  Pressure pressure;
  PatchFriction friction;
  Six wrench;  ///< of pressures, friction and rolling resistance
  Drift drift;
  Three rolling{};              ///< the part of the rolling resistance, normal
  double shift = 0;             ///< of the rolling resistance, see opposing()
  double relative_damping = 0;  ///< N, see find_relative_damping()
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

const ContactSolver::Known* ContactSolver::known(std::int64_t key) const {
  const auto at = std::ranges::lower_bound(known_, key, {}, &Known::key);
  return at != known_.end() && at->key == key ? &*at : nullptr;
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
  rows_.clear(), pool_.clear();
  rows_.reserve(patches_.size());
  std::vector<double> of_body(bodies_.bodies().size());
  for (ElasticPatch& patch : patches_) {
    // A patch without a direction is pushed in its last direction.
    if (const Known* last = patch.area > 0 ? nullptr : known(patch.key)) patch.normal = last->normal;
    Row& row = rows_.emplace_back(patch);
    add_sides(row, patch);
    const double swing = largest_eigenvalue(row.area.foundation(patch.stiffness), row.normal_by_normal);
    const int a = bodies_.body_of(patch.link_a), b = bodies_.body_of(patch.link_b);
    of_body[a] += swing;
    if (a != b) of_body[b] += swing;
  }
  share_damping();
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

/// Finds the damping along the normals by `recovery`. The patches of two links are damped as one patch, as far as they
/// have the same normal: a body that consists of parts moves like a whole body. The damping follows the mean of their
/// slips, weighted by their forces. This is the slip at the centroid of the whole volume.
void ContactSolver::share_damping() {
  std::map<std::pair<int, int>, std::vector<int>> of_links;
  for (int i = 0; i < int(rows_.size()); ++i) {
    const ElasticPatch& patch = patches_[i];
    if (!(patch.recovery > 0 && patch.force > 0)) continue;
    if (patch.area > 0) {
      of_links[{patch.link_a, patch.link_b}].push_back(i);
    } else {
      // A body without a direction leaves the other one with its own size over the time of recovery at most.
      const double size = std::cbrt(patch.force / patch.stiffness);
      rows_[i].damping = patch.recovery * patch.stiffness * size * size;
    }
  }
  for (const auto& [links, group] : of_links) {
    for (int i : group) {
      double stiffness = 0, force = 0;
      std::vector<Share> shares;
      for (int j : group) {
        const ElasticPatch& other = patches_[j];
        const double same = j == i ? 1 : std::max(0.0, overlapper::dot(patches_[i].normal, other.normal));
        stiffness += same * other.stiffness * rows_[j].area.area;
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
void ContactSolver::find_relative_damping(std::span<const double> velocity, std::span<Laws> laws) const {
  std::vector<double> slip;
  for (size_t i = 0; i < rows_.size(); ++i) {
    if (rows_[i].damped_with.empty()) continue;
    if (slip.empty()) {
      slip.resize(rows_.size());
      for (size_t j = 0; j < rows_.size(); ++j)
        if (!rows_[j].damped_with.empty()) slip[j] = slip_of(rows_[j], velocity).normal[0];
    }
    laws[i].relative_damping = 0;
    for (const auto [other, part] : rows_[i].damped_with) laws[i].relative_damping += part * (slip[other] - slip[i]);
  }
}

void ContactSolver::add_sides(Row& row, const ElasticPatch& patch) {
  std::vector<double> jacobian, other;
  const auto jacobian_of = [&](int link, double sign) {
    std::vector<double> rows(size_t(6) * bodies_.bodies()[bodies_.body_of(link)].coordinates);
    bodies_.jacobian(link, patch.centroid, rows);
    for (double& each : rows) each *= sign;
    return rows;
  };
  const int a = bodies_.body_of(patch.link_a), b = bodies_.body_of(patch.link_b);
  if (a == b) {
    jacobian = jacobian_of(patch.link_a, 1), other = jacobian_of(patch.link_b, -1);
    for (size_t i = 0; i < jacobian.size(); ++i) jacobian[i] += other[i];
    return add_side(row, a, jacobian);
  }
  for (const auto& [link, sign] : {std::pair{patch.link_a, 1.0}, std::pair{patch.link_b, -1.0}}) {
    const int body = bodies_.body_of(link);
    if (bodies_.bodies()[body].links == 1) add_single(row, link, sign, patch.centroid);
    else add_side(row, body, jacobian_of(link, sign));
  }
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
  const Multibodies::Body& body = bodies_.bodies()[number];
  const size_t n = body.coordinates, first = pool_.size();
  row.sides[row.sides_used++] = {number, body.first_coordinate, body.coordinates, body.movable, false, 1, {},
                                 first,  first + 6 * n};
  pool_.resize(first + 12 * n);
  double *rows = pool_.data() + first, *answers = rows + 6 * n;
  for (size_t c = 0; c < n; ++c) {
    const auto at = [&](size_t r) { return jacobian[r * n + c]; };
    const Six slip = row.local({{at(0), at(1), at(2)}, {at(3), at(4), at(5)}});
    for (size_t i = 0; i < 3; ++i) rows[i * n + c] = slip.normal[i], rows[(i + 3) * n + c] = slip.tangential[i];
  }
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
/// wheel. The velocities are those of the centre, and of the surface at the contact relative to the centre.
double ContactSolver::staying(const ElasticPatch& patch, Vec3 centre_velocity, Vec3 by_spin) const {
  const Known* last = known(patch.key);
  if (!last || !(norm2(by_spin) > 0)) return 0;
  const Vec3 moved = patch.centroid - last->centroid;
  if (norm2(moved) == 0) return last->staying;  // the same poses again, or no motion
  return std::clamp(overlapper::dot(moved / last->duration - centre_velocity, by_spin) / norm2(by_spin), 0.0, 1.0);
}

/// Without it, a body on a turntable leaves its circle along a tangent in every step. The body that turns less carries
/// the other one around: what sticks to it moves along arcs. The other body may also turn relative to the first.
ContactSolver::Drift ContactSolver::drift(size_t patch, const Step& step, std::span<const MovedOn> ahead) const {
  const ElasticPatch& p = patches_[patch];
  const double h = step.duration;
  std::array<Vec3, 2> velocity, spin, bend, twist;
  const std::array<int, 2> link{p.link_a, p.link_b};
  for (int i = 0; i < 2; ++i) {
    const auto [linear, angular] = bodies_.twist(link[i], step.velocity);
    velocity[i] = linear, spin[i] = angular;
    bend[i] = (ahead[link[i]].centre - bodies_.centre(link[i])) / h - linear;
    twist[i] = rotation_vector(ahead[link[i]].turn) / h - angular;
    if (!finite(twist[i])) return {};  // half a turn in a step has no direction
  }
  const int carrier = norm2(spin[0]) < norm2(spin[1]) ? 0 : 1, other = 1 - carrier;
  const Vec3 apart = bodies_.centre(link[1]) - bodies_.centre(link[0]);
  const Vec3 around = (ahead[link[carrier]].turn * apart - apart) / h - cross(spin[carrier], apart);
  const Vec3 arm = p.centroid - bodies_.centre(link[other]), beside = spin[other] - spin[carrier];
  const Vec3 by_spin = cross(spin[other], arm);
  const double stays = staying(p, velocity[other], by_spin);
  const Vec3 turning = cross(spin[carrier], cross(beside, arm)) + stays * cross(beside, by_spin);
  const Vec3 along = bend[0] - bend[1] + around + (other == 0 ? h / 2 : -h / 2) * turning;
  return {rows_[patch].local({along, twist[0] - twist[1]}).tangential, stays};
}

Pressure::Damping ContactSolver::damping(size_t patch, std::span<const Six> before,
                                         std::span<const Drift> drifts) const {
  const Row& row = rows_[patch];
  if (!(row.damping > 0)) return {};
  // The patches of two links have the same numbers, so that parts of a body, and prisms below it, act as a whole.
  double approach = before[patch].normal[0], staying = drifts[patch].staying;
  for (const auto [other, part] : row.damped_with) {
    approach += part / row.damping * (before[other].normal[0] - before[patch].normal[0]);
    staying += part / row.damping * (drifts[other].staying - drifts[patch].staying);
  }
  return {row.damping, approach, staying};
}

/// Updates pressures first, then rolling resistance and friction, because pressures limit these. Returns the change of
/// the slip.
double ContactSolver::visit(size_t patch, Laws& laws, double duration, std::span<double> velocity) const {
  const Row& row = rows_[patch];
  const Six slip = slip_of(row, velocity), last = laws.wrench;
  const Three pressures = last.normal - laws.rolling;
  const Three without = slip.normal - duration * (row.normal_by_normal * pressures);
  laws.wrench.normal = laws.pressure.answer(without, laws.relative_damping) + laws.rolling;
  if (patches_[patch].rolling > 0) {
    const Three pressed = laws.wrench.normal - last.normal;
    roll(patch, laws, duration, slip.normal + duration * (row.normal_by_normal * pressed));
  }
  const Three pressed = laws.wrench.normal - last.normal;
  const Three tangential = slip.tangential + laws.drift.slip + duration * (row.tangential_by_normal * pressed);
  laws.wrench.tangential = laws.friction.answer(tangential, last.tangential, laws.wrench.normal[0]);
  const Six change{pressed, laws.wrench.tangential - last.tangential};
  push(row, change, duration, velocity);
  const Three normal = row.normal_by_normal * change.normal + row.normal_by_tangential * change.tangential;
  const Three along = row.tangential_by_normal * change.normal + row.tangential_by_tangential * change.tangential;
  return duration * std::max({std::abs(normal[0]), std::abs(along[0]), std::abs(along[1])});
}

/// Updates the rolling resistance: Coulomb's law for the two angular velocities of `slip`, a normal part.
void ContactSolver::roll(size_t patch, Laws& laws, double duration, const Three& slip) const {
  ThreeByThree mobility = duration * rows_[patch].normal_by_normal;
  const Three had = laws.rolling, pressure = laws.wrench.normal - had;
  const Three free = slip - mobility * had;
  mobility[0] = {1, 0, 0}, mobility[1][0] = mobility[2][0] = 0;
  laws.rolling = opposing(mobility, {0, free[1], free[2]}, patches_[patch].rolling * pressure[0], laws.shift);
  laws.wrench.normal = pressure + laws.rolling;
}

/// Extrapolates the wrenches after a sweep there and back (Nesterov 1983). It begins anew when the sweeps go against
/// the extrapolation (O'Donoghue and Candès 2015). The next visits replace the wrenches, so these need not obey the
/// laws. Without extrapolation, patches of one body that cannot all stick need thousands of sweeps. Each sweep adds the
/// same small wrench to those by which the patches hold each other, until one patch slides.
void ContactSolver::extrapolate(Momentum& momentum, std::span<Laws> laws, double duration,
                                std::span<double> velocity) const {
  auto& [before, begun, weight] = momentum;
  double against = before.empty() ? 1 : 0;
  for (size_t i = 0; i < before.size(); ++i)
    for (int k = 0; k < 3; ++k) {
      const Six &now = laws[i].wrench, &last = before[i], &from = begun[i];
      against += rows_[i].normal_by_normal[k][k] * (from.normal[k] - now.normal[k]) * (now.normal[k] - last.normal[k]);
      against += rows_[i].tangential_by_tangential[k][k] * (from.tangential[k] - now.tangential[k]) *
                 (now.tangential[k] - last.tangential[k]);
    }
  before.resize(laws.size()), begun.resize(laws.size());
  if (against > 0) weight = 1;
  const double next = (1 + std::sqrt(1 + 4 * weight * weight)) / 2, factor = (weight - 1) / next;
  weight = next;
  for (size_t i = 0; i < laws.size(); ++i) {
    Six& wrench = laws[i].wrench;
    const Six more{factor * (wrench.normal - before[i].normal), factor * (wrench.tangential - before[i].tangential)};
    push(rows_[i], more, duration, velocity);
    before[i] = wrench;
    begun[i] = wrench = {wrench.normal + more.normal, wrench.tangential + more.tangential};
  }
}

ContactSolver::Solution ContactSolver::solve(const Step& step) {
  const double h = step.duration;
  const int count = int(rows_.size());
  std::vector<double> velocity(step.velocity.begin(), step.velocity.end());
  for (size_t i = 0; i < velocity.size(); ++i) velocity[i] += h * step.acceleration[i];
  std::vector<MovedOn> found;
  if (step.ahead.empty() && count > 0) found = bodies_.ahead(h, step.velocity);
  const std::span<const MovedOn> ahead = step.ahead.empty() ? std::span<const MovedOn>(found) : step.ahead;
  std::vector<Laws> laws;
  laws.reserve(count);
  double largest = 0;
  std::vector<Six> before;
  std::vector<Drift> drifts;
  for (const Row& row : rows_) before.push_back(slip_of(row, step.velocity));
  for (size_t i = 0; i < rows_.size(); ++i) drifts.push_back(drift(i, step, ahead));
  for (int i = 0; i < count; ++i) {
    const ElasticPatch& patch = patches_[i];
    const Row& row = rows_[i];
    const Six free = slip_of(row, velocity);
    largest = std::max({largest, std::abs(free.normal[0]), std::abs(free.tangential[0]), std::abs(free.tangential[1])});
    const Rule rule = step.damped[i] ? Rule::kDamping : Rule::kKeeping;
    const Pressure::Damping damped = damping(i, before, drifts);
    laws.push_back({{patch, row.area, row.normal_by_normal, damped, before[i].normal, h, rule},
                    {patch, row.area, h * row.tangential_by_tangential, step.friction},
                    known_wrench(i),
                    drifts[i]});
    laws[i].wrench.tangential = laws[i].friction.begin(laws[i].wrench.tangential);
  }
  for (int i = 0; i < count; ++i) push(rows_[i], laws[i].wrench, h, velocity);
  int sweeps = 0;
  double changed = 0;
  Momentum momentum;
  for (const int most = std::clamp(kVisits / std::max(1, count), kFewest, kMost); sweeps < most && count > 0;) {
    // Sweeps go there and back, so that a push at one end of a stack soon reaches the other end.
    changed = 0;
    find_relative_damping(velocity, laws);
    for (int k = 0; k < count; ++k) {
      const int i = sweeps % 2 ? count - 1 - k : k;
      changed = std::max(changed, visit(i, laws[i], h, velocity));
    }
    ++sweeps;
    largest = std::max(largest, changed);  // bodies may be at rest until they are pushed
    if (changed <= kSettled * largest) break;
    const bool there_and_back = sweeps >= kPlain && sweeps % 2 == 0 && sweeps + 2 <= most;
    if (there_and_back && step.friction == Friction::kEllipsoid) extrapolate(momentum, laws, h, velocity);
  }
  Solution solution = solved(laws, velocity);
  solution.sweeps = sweeps;
  solution.residual = changed > 0 ? changed / largest : 0;
  remember(solution, laws, h);
  return solution;
}

ContactSolver::Solution ContactSolver::solved(std::span<const Laws> laws, std::span<const double> velocity) const {
  Solution solution;
  solution.links.assign(bodies_.links(), {Vec3{}, Vec3{}});
  solution.acceleration.assign(velocity.size(), 0);
  for (size_t i = 0; i < laws.size(); ++i) {
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
  known_.clear();
  for (size_t i = 0; i < patches_.size(); ++i)
    known_.push_back({patches_[i].key,
                      patches_[i].normal,
                      patches_[i].centroid,
                      {solution.patches[i].force, solution.patches[i].torque},
                      duration,
                      laws[i].drift.staying});
  std::ranges::sort(known_, {}, &Known::key);
}

}  // namespace overlapper
