#include "forces/contact_solver.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "forces/friction.h"

namespace overlapper {
namespace {

/// Of the step, the part by which velocities are ahead of the pressures: a quarter keeps the energy of a swing and is
/// stable whatever the step; the whole of it is backward Euler.
constexpr double kKeeping = 0.25;
constexpr double kDamping = 1;

/// Sweeps end when no slip changes by more than this fraction of the largest that there was.
constexpr double kSettled = 1e-9;

/// Patches visited in all sweeps of a step, but so many sweeps at least and at most.
constexpr int kVisits = 10000;
constexpr int kFewest = 10;
constexpr int kMost = 2000;

/// The centre of pressure stays within this many radii of gyration: the half width of a rectangle.
constexpr double kReach2 = 3;

using Matrix3 = std::array<std::array<double, 3>, 3>;

Three operator*(const Matrix3& m, const Three& v) {
  Three out{};
  for (int i = 0; i < 3; ++i) out[i] = m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2];
  return out;
}

Matrix3 inverse(const Matrix3& m) {
  const Vec3 a{m[0][0], m[0][1], m[0][2]}, b{m[1][0], m[1][1], m[1][2]}, c{m[2][0], m[2][1], m[2][2]};
  const Vec3 x = cross(b, c), y = cross(c, a), z = cross(a, b);
  const double determinant = dot(a, x);
  Matrix3 out;
  for (int i = 0; i < 3; ++i) out[i] = {x[i] / determinant, y[i] / determinant, z[i] / determinant};
  return out;
}

/// The largest eigenvalue of the product of two symmetric matrices that are not negative.
double largest_eigenvalue(const Matrix3& a, const Matrix3& b) {
  Matrix3 product{};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) product[i][j] += a[i][k] * b[k][j];
  // Its eigenvalues are real: the roots of a cubic by Viète's formula.
  const double trace = product[0][0] + product[1][1] + product[2][2];
  if (!(trace > 0)) return 0;
  const double mean = trace / 3;
  Matrix3 off = product;
  for (int i = 0; i < 3; ++i) off[i][i] -= mean;
  double square = 0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) square += off[i][j] * off[j][i];
  const double spread = std::sqrt(std::max(square / 6, 0.0));
  if (!(spread > 1e-12 * mean)) return mean;
  const double determinant = off[0][0] * (off[1][1] * off[2][2] - off[1][2] * off[2][1]) -
                             off[0][1] * (off[1][0] * off[2][2] - off[1][2] * off[2][0]) +
                             off[0][2] * (off[1][0] * off[2][1] - off[1][1] * off[2][0]);
  const double half = std::clamp(determinant / (2 * spread * spread * spread), -1.0, 1.0);
  return mean + 2 * spread * std::cos(std::acos(half) / 3);
}

/// The points that stand for a patch where friction is distributed: of a rectangle with its area moments.
constexpr int kSide = 4;
constexpr int kPoints = kSide * kSide;
constexpr std::array<double, kSide> kNodes{-0.8611363115940526, -0.3399810435848563, 0.3399810435848563,
                                           0.8611363115940526};
constexpr std::array<double, kSide> kWeights{0.1739274225687269, 0.3260725774312731, 0.3260725774312731,
                                             0.1739274225687269};

}  // namespace

/// What is asked of the force of a patch in a step, and the force as it is so far.
struct ContactSolver::Law {
  Three rest{};      ///< the pressures' force and torques if the slip vanished
  Matrix3 response;  ///< of these to a slip, negative
  Matrix3 implicit;  ///< (1 + response * duration * mobility)⁻¹
  bool elastic;
  double u = 0, v = 0;               ///< m: of the centre of the area, in the plane
  double suu = 1, suv = 0, svv = 1;  ///< of the inverse of its squared radii of gyration
  double friction = 0;
  double distance = 0;
  ThreeByThree grip{};  ///< what friction does to the slip, the third scaled by the distance
  std::array<double, 6> wrench{};
  double shift = 0;
  struct Point {
    double u, v, share;
    std::array<double, 2> force;
    double shift = 0;
  };
  std::vector<Point> points;

  /// Pressures only push, and their centre stays on the patch.
  Three allowed(const Three& asked, const Three& target, double duration, const Matrix3& mobility) const {
    double force = asked[0];
    if (!(force > 0)) return {};
    if (!elastic) return {force, 0, 0};
    const double x = -asked[2] / force - u, y = asked[1] / force - v;
    const double far = suu * x * x + 2 * suv * x * y + svv * y * y;
    if (far <= kReach2) return asked;
    const double back = std::sqrt(kReach2 / far);
    const Three per_force{1, v + back * y, -(u + back * x)};
    const Three moved = response * (mobility * per_force);
    force = std::max(0.0, target[0] / (1 + duration * moved[0]));
    return {force, force * per_force[1], force * per_force[2]};
  }
};

/// How the point of a body of one link is moved by a wrench at that point; times the sign, as are both.
ContactSolver::Screw ContactSolver::answer(const Side& side, const Screw& wrench) const {
  const Mobility& mobility = mobilities_[side.body];
  const Vec3 turn = mobility.angular * (wrench.about + cross(side.arm, wrench.along));
  return {mobility.linear * wrench.along, turn};
}

void ContactSolver::add_single(Row& row, int link, double sign, Vec3 centroid) {
  const int number = bodies_.body_of(link);
  const Multibodies::Body& body = bodies_.bodies()[number];
  const Side side{number, body.first_coordinate, 6, body.movable, true, sign, centroid - bodies_.centre(link), 0, 0};
  const Vec3 normal = row.normal;
  if (side.moves) {
    const std::array<Screw, 6> wrenches{
        {{normal, {}}, {{}, row.along}, {{}, row.across}, {row.along, {}}, {row.across, {}}, {{}, normal}}};
    for (int k = 0; k < 6; ++k) {
      const Screw moved = answer(side, wrenches[k]);
      const Vec3 point = moved.along + cross(moved.about, side.arm);
      const Six slip{dot(normal, point),    dot(row.along, moved.about), dot(row.across, moved.about),
                     dot(row.along, point), dot(row.across, point),      dot(normal, moved.about)};
      for (int i = 0; i < 6; ++i) row.mobility[i][k] += slip[i];
    }
  }
  row.sides[row.sides_used++] = side;
}

void ContactSolver::add_side(Row& row, int number, const std::vector<double>& jacobian) {
  const Multibodies::Body& body = bodies_.bodies()[number];
  const int n = body.coordinates;
  Side side{number, body.first_coordinate, n, body.movable, false, 1, {}, pool_.size(), 0};
  const auto along = [&](Vec3 axis, int from, int c) {
    const auto at = [&](int r) { return jacobian[size_t(from + r) * n + c]; };
    return axis.x * at(0) + axis.y * at(1) + axis.z * at(2);
  };
  const std::array<std::pair<Vec3, int>, 6> rows{
      {{row.normal, 0}, {row.along, 3}, {row.across, 3}, {row.along, 0}, {row.across, 0}, {row.normal, 3}}};
  for (const auto& [axis, from] : rows)
    for (int c = 0; c < n; ++c) pool_.push_back(along(axis, from, c));
  if (side.moves) {
    side.answers = pool_.size();
    pool_.resize(pool_.size() + size_t(6) * n);
    const std::span<const double> inverse = bodies_.inverse_mass(number);
    for (int c = 0; c < n; ++c)
      for (int k = 0; k < 6; ++k) {
        double sum = 0;
        for (int j = 0; j < n; ++j) sum += inverse[size_t(c) * n + j] * pool_[side.rows + size_t(k) * n + j];
        pool_[side.answers + size_t(c) * 6 + k] = sum;
      }
    for (int i = 0; i < 6; ++i)
      for (int k = 0; k < 6; ++k) {
        double sum = 0;
        for (int c = 0; c < n; ++c)
          sum += pool_[side.rows + size_t(i) * n + c] * pool_[side.answers + size_t(c) * 6 + k];
        row.mobility[i][k] += sum;
      }
  }
  row.sides[row.sides_used++] = side;
}

std::vector<double> ContactSolver::place(std::span<const Pose> frames, std::vector<ElasticPatch> patches) {
  bodies_.place(frames);
  patches_ = std::move(patches);
  rows_.clear();
  pool_.clear();
  std::vector<double> frequency2(patches_.size());
  std::vector<double> of_body(bodies_.bodies().size());
  std::vector<double> of_a, of_b;
  mobilities_.assign(bodies_.bodies().size(), {});
  for (size_t i = 0; i < mobilities_.size(); ++i) {
    if (bodies_.bodies()[i].links > 1 || !bodies_.bodies()[i].movable) continue;
    const std::span<const double> m = bodies_.inverse_mass(int(i));
    mobilities_[i] = {m[0], {{m[21], m[22], m[23]}, {m[27], m[28], m[29]}, {m[33], m[34], m[35]}}};
  }
  for (ElasticPatch& patch : patches_) {
    if (!(patch.area > 0)) {
      // What has no direction now is pushed where it was pushed last.
      const auto at = std::ranges::lower_bound(directed_, patch.key, {}, &Directed::key);
      if (at != directed_.end() && at->key == patch.key) patch.normal = at->normal;
    }
    Row row{};
    row.normal = patch.normal;
    row.along = any_orthogonal(patch.normal);
    row.across = cross(patch.normal, row.along);
    const int a = bodies_.body_of(patch.link_a), b = bodies_.body_of(patch.link_b);
    const auto rows_of = [&](int link, double sign, std::vector<double>& rows) {
      rows.resize(size_t(6) * bodies_.bodies()[bodies_.body_of(link)].coordinates);
      bodies_.jacobian(link, patch.centroid, rows);
      for (double& each : rows) each *= sign;
    };
    if (a == b) {
      rows_of(patch.link_a, 1, of_a);
      rows_of(patch.link_b, -1, of_b);
      for (size_t i = 0; i < of_a.size(); ++i) of_a[i] += of_b[i];
      add_side(row, a, of_a);
    } else {
      for (const auto& [link, sign] : {std::pair{patch.link_a, 1.0}, std::pair{patch.link_b, -1.0}}) {
        const int body = bodies_.body_of(link);
        if (bodies_.bodies()[body].links == 1) {
          add_single(row, link, sign, patch.centroid);
        } else {
          rows_of(link, sign, of_a);
          add_side(row, body, of_a);
        }
      }
    }
    if (patch.area > 0) {
      const Vec3 to = patch.centre - patch.centroid, m1 = patch.moments * row.along, m2 = patch.moments * row.across;
      const double u = dot(to, row.along), v = dot(to, row.across), area = patch.area, k = patch.stiffness;
      const double uu = dot(row.along, m1) + area * u * u, uv = dot(row.along, m2) + area * u * v;
      const double vv = dot(row.across, m2) + area * v * v;
      row.foundation = {
          {{k * area, k * area * v, -k * area * u}, {k * area * v, k * vv, -k * uv}, {-k * area * u, -k * uv, k * uu}}};
    }
    Matrix3 mobility;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) mobility[i][j] = row.mobility[i][j];
    const double own = largest_eigenvalue(row.foundation, mobility);
    for (int body : {a, b})
      if (bodies_.bodies()[body].movable) of_body[body] += a == b ? own / 2 : own;
    rows_.push_back(row);
  }
  for (size_t i = 0; i < patches_.size(); ++i) {
    const int a = bodies_.body_of(patches_[i].link_a), b = bodies_.body_of(patches_[i].link_b);
    frequency2[i] = std::max(of_body[a], of_body[b]);
  }
  directed_.clear();
  for (const ElasticPatch& patch : patches_) directed_.push_back({patch.key, patch.normal});
  std::ranges::sort(directed_, {}, &Directed::key);
  return frequency2;
}

ContactSolver::Six ContactSolver::slip_of(const Row& row, std::span<const double> velocity) const {
  Six slip{};
  Screw single{};
  for (int s = 0; s < row.sides_used; ++s) {
    const Side& side = row.sides[s];
    const double* v = &velocity[side.first];
    if (side.single) {
      const Vec3 about{v[3], v[4], v[5]};
      single.along += side.sign * (Vec3{v[0], v[1], v[2]} + cross(about, side.arm));
      single.about += side.sign * about;
      continue;
    }
    const double* rows = &pool_[side.rows];
    const int n = side.coordinates;
    for (int i = 0; i < 6; ++i) {
      double sum = 0;
      for (int c = 0; c < n; ++c) sum += rows[i * n + c] * v[c];
      slip[i] += sum;
    }
  }
  slip[0] += dot(row.normal, single.along), slip[1] += dot(row.along, single.about);
  slip[2] += dot(row.across, single.about), slip[3] += dot(row.along, single.along);
  slip[4] += dot(row.across, single.along), slip[5] += dot(row.normal, single.about);
  return slip;
}

void ContactSolver::push(const Row& row, const Six& wrench, double factor, std::span<double> velocity) const {
  const Screw whole{factor * (wrench[0] * row.normal + wrench[3] * row.along + wrench[4] * row.across),
                    factor * (wrench[1] * row.along + wrench[2] * row.across + wrench[5] * row.normal)};
  for (int s = 0; s < row.sides_used; ++s) {
    const Side& side = row.sides[s];
    if (!side.moves) continue;
    double* v = &velocity[side.first];
    if (side.single) {
      const Screw moved = answer(side, whole);
      v[0] += side.sign * moved.along.x, v[1] += side.sign * moved.along.y, v[2] += side.sign * moved.along.z;
      v[3] += side.sign * moved.about.x, v[4] += side.sign * moved.about.y, v[5] += side.sign * moved.about.z;
      continue;
    }
    const double* answers = &pool_[side.answers];
    for (int c = 0; c < side.coordinates; ++c) {
      double sum = 0;
      for (int k = 0; k < 6; ++k) sum += answers[c * 6 + k] * wrench[k];
      v[c] += factor * sum;
    }
  }
}

ContactSolver::Solution ContactSolver::solve(const Step& step) {
  const double h = step.duration;
  const size_t count = rows_.size();
  std::vector<double> velocity(step.velocity.begin(), step.velocity.end());
  for (size_t i = 0; i < velocity.size(); ++i) velocity[i] += h * step.acceleration[i];
  std::vector<Law> laws(count);
  double largest = 0;
  for (size_t i = 0; i < count; ++i) {
    const ElasticPatch& patch = patches_[i];
    const Row& row = rows_[i];
    Law& law = laws[i];
    const double ahead = (step.damped[i] ? kDamping : kKeeping) * h;
    const Six before = slip_of(row, step.velocity), free = slip_of(row, velocity);
    for (double each : {free[0], free[3], free[4]}) largest = std::max(largest, std::abs(each));
    const double lag = ahead + patch.dissipation;
    // Backward Euler is of the velocity itself, the other rule of its change.
    const Three still = row.foundation * Three{before[0], before[1], before[2]};
    const double known = step.damped[i] ? 0 : ahead;
    law.rest = {patch.force + known * still[0], known * still[1], known * still[2]};
    Matrix3 mobility, matrix;
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) {
        law.response[r][c] = lag * row.foundation[r][c];
        mobility[r][c] = row.mobility[r][c];
      }
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) {
        matrix[r][c] = r == c;
        for (int k = 0; k < 3; ++k) matrix[r][c] += h * law.response[r][k] * mobility[k][c];
      }
    law.implicit = inverse(matrix);
    law.elastic = patch.area > 0;
    law.friction = patch.friction;
    law.distance = patch.distance > 0 ? patch.distance : 0;
    if (law.elastic) {
      const Vec3 to = patch.centre - patch.centroid, m1 = patch.moments * row.along, m2 = patch.moments * row.across;
      law.u = dot(to, row.along), law.v = dot(to, row.across);
      double uu = dot(row.along, m1) / patch.area, uv = dot(row.along, m2) / patch.area;
      double vv = dot(row.across, m2) / patch.area;
      const double least = 1e-9 * (uu + vv) + 1e-24;
      uu += least, vv += least;
      const double determinant = uu * vv - uv * uv;
      law.suu = vv / determinant, law.suv = -uv / determinant, law.svv = uu / determinant;
      if (step.friction == Friction::kDistributed) {
        const double half = (uu - vv) / 2, spread = std::hypot(half, uv), mean = (uu + vv) / 2;
        const double turn = 0.5 * std::atan2(uv, half), c = std::cos(turn), s = std::sin(turn);
        const double a = std::sqrt(kReach2 * (mean + spread)), b = std::sqrt(kReach2 * std::max(mean - spread, 0.0));
        // Pressures that lead to the centroid: linear over the patch, and none below zero.
        const double slope_u = -(law.suu * law.u + law.suv * law.v), slope_v = -(law.suv * law.u + law.svv * law.v);
        double reach = 0;
        for (int p = 0; p < kPoints; ++p) {
          const double x = a * kNodes[p / kSide], y = b * kNodes[p % kSide];
          const double du = c * x - s * y, dv = s * x + c * y, share = kWeights[p / kSide] * kWeights[p % kSide];
          law.points.push_back({du, dv, share, {}, 0});
          reach += share * std::hypot(law.u + du, law.v + dv);
        }
        // As far from the centroid as the area is in the mean, so that what resists a spin is right.
        const double stretch = law.distance > 0 && reach > 0 ? law.distance / reach : 1;
        double total = 0;
        for (Law::Point& point : law.points) {
          point.share *= std::max(0.0, 1 + slope_u * point.u + slope_v * point.v);
          point.u = law.u + stretch * point.u, point.v = law.v + stretch * point.v;
          total += point.share;
        }
        for (Law::Point& point : law.points) point.share /= total;
      }
    }
    const double d = law.distance;
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) law.grip[r][c] = h * row.mobility[r + 3][c + 3] * (r == 2 ? d : 1) * (c == 2 ? d : 1);
    const auto at = std::lower_bound(known_.begin(), known_.end(), patch.key);
    if (at != known_.end() && *at == patch.key) {
      const auto& [force, torque] = wrenches_[at - known_.begin()];
      law.wrench = {dot(force, patch.normal), dot(torque, row.along), dot(torque, row.across),
                    dot(force, row.along),    dot(force, row.across), dot(torque, patch.normal)};
      for (Law::Point& point : law.points) point.force = {point.share * law.wrench[3], point.share * law.wrench[4]};
      if (!law.points.empty()) {
        law.wrench[5] = 0;
        for (const Law::Point& p : law.points) law.wrench[5] += p.u * p.force[1] - p.v * p.force[0];
      }
    } else {
      law.wrench[0] = std::max(0.0, patch.force);
    }
  }
  for (size_t i = 0; i < count; ++i) push(rows_[i], laws[i].wrench, h, velocity);

  const auto visit = [&](size_t i) {
    const Row& row = rows_[i];
    Law& law = laws[i];
    Six slip = slip_of(row, velocity);
    const Six old = law.wrench;
    Six change{};
    const auto add = [&](int first, const Three& now) {
      for (int k = 0; k < 3; ++k) change[first + k] = now[k] - old[first + k], law.wrench[first + k] = now[k];
      for (int r = 0; r < 6; ++r)
        for (int k = 0; k < 3; ++k) slip[r] += h * row.mobility[r][first + k] * change[first + k];
    };
    // Pressures first, then friction, whose limit they are.
    Matrix3 mobility;
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) mobility[r][c] = row.mobility[r][c];
    const Three own = mobility * Three{old[0], old[1], old[2]};
    const Three answer = law.response * Three{slip[0] - h * own[0], slip[1] - h * own[1], slip[2] - h * own[2]};
    const Three target{law.rest[0] - answer[0], law.rest[1] - answer[1], law.rest[2] - answer[2]};
    const Three asked = law.implicit * target;
    add(0, law.allowed(asked, target, h, mobility));
    const double limit = law.friction * law.wrench[0];
    if (!law.points.empty()) {
      Three total{};
      for (Law::Point& p : law.points) {
        // The slip of the point, and what a force there does to it.
        const Three by_u{1, 0, -p.v}, by_v{0, 1, p.u};
        Three of_u{}, of_v{};
        for (int r = 0; r < 3; ++r)
          for (int k = 0; k < 3; ++k) {
            of_u[r] += h * row.mobility[r + 3][k + 3] * by_u[k];
            of_v[r] += h * row.mobility[r + 3][k + 3] * by_v[k];
          }
        const auto along = [&](const Three& of, int axis) {
          return axis == 0 ? of[0] - p.v * of[2] : of[1] + p.u * of[2];
        };
        ThreeByThree grip{};
        grip[0] = {along(of_u, 0), along(of_v, 0), 0};
        grip[1] = {along(of_u, 1), along(of_v, 1), 0};
        grip[2] = {0, 0, 1};
        const Three tangential{slip[3], slip[4], slip[5]};
        Three free{along(tangential, 0), along(tangential, 1), 0};
        for (int r = 0; r < 2; ++r) free[r] -= grip[r][0] * p.force[0] + grip[r][1] * p.force[1];
        const Three force = opposing(grip, free, limit * p.share, p.shift);
        const double du = force[0] - p.force[0], dv = force[1] - p.force[1];
        p.force = {force[0], force[1]};
        for (int r = 0; r < 3; ++r) slip[r + 3] += of_u[r] * du + of_v[r] * dv;
        for (int k = 0; k < 3; ++k) total[k] += by_u[k] * force[0] + by_v[k] * force[1];
      }
      for (int k = 0; k < 3; ++k) change[3 + k] = total[k] - old[3 + k], law.wrench[3 + k] = total[k];
    } else {
      const double d = law.distance;
      const Three had{old[3], old[4], d > 0 ? old[5] / d : 0};
      Three free{slip[3], slip[4], d * slip[5]};
      for (int r = 0; r < 3; ++r)
        for (int k = 0; k < 3; ++k) free[r] -= law.grip[r][k] * had[k];
      const Three force = opposing(law.grip, free, limit, law.shift);
      add(3, {force[0], force[1], d * force[2]});
    }
    push(row, change, h, velocity);
    double most = 0;
    for (int r : {0, 3, 4}) {
      double moved = 0;
      for (int k = 0; k < 6; ++k) moved += row.mobility[r][k] * change[k];
      most = std::max(most, std::abs(h * moved));
    }
    return most;
  };
  Solution solution;
  const int sweeps = std::clamp(kVisits / std::max(1, int(count)), kFewest, kMost);
  for (int sweep = 0; sweep < sweeps && count > 0; ++sweep) {
    double most = 0;
    for (size_t k = 0; k < count; ++k) most = std::max(most, visit(sweep % 2 ? count - 1 - k : k));
    ++solution.sweeps;
    if (most <= kSettled * largest) break;
  }

  solution.links.assign(bodies_.links().size(), {Vec3{}, Vec3{}});
  solution.acceleration.assign(velocity.size(), 0);
  std::vector<size_t> order(count);
  std::iota(order.begin(), order.end(), size_t{0});
  std::sort(order.begin(), order.end(), [&](size_t i, size_t j) { return patches_[i].key < patches_[j].key; });
  known_.clear(), wrenches_.clear();
  solution.patches.resize(count);
  for (size_t i = 0; i < count; ++i) {
    const ElasticPatch& patch = patches_[i];
    const Row& row = rows_[i];
    const Six& w = laws[i].wrench;
    const Six slip = slip_of(row, velocity);
    PatchForce& found = solution.patches[i];
    found.force = w[0] * patch.normal + w[3] * row.along + w[4] * row.across;
    found.torque = w[1] * row.along + w[2] * row.across + w[5] * patch.normal;
    found.slip = slip[3] * row.along + slip[4] * row.across;
    push(row, w, 1, solution.acceleration);
    for (const auto& [link, sign] : {std::pair{patch.link_a, 1.0}, std::pair{patch.link_b, -1.0}}) {
      auto& [force, torque] = solution.links[link];
      force += sign * found.force;
      torque += sign * (found.torque + cross(patch.centroid - bodies_.centre(link), found.force));
    }
  }
  for (size_t i : order) {
    known_.push_back(patches_[i].key);
    wrenches_.push_back({solution.patches[i].force, solution.patches[i].torque});
  }
  return solution;
}

}  // namespace overlapper
