#include "forces/constraint.h"

#include <algorithm>
#include <cmath>

namespace overlapper {
namespace {

/// Forces or torques move nothing if their mobility is less than this part of that of the others.
constexpr double kImmobile = 1e-20;

/// Combinations of directions are free if their mobility is less than this part of the largest mobility of a direction.
constexpr double kDependent = 1e-9;

/// Passes over the directions of a constraint if its largest force does not suffice in one of them.
constexpr int kPasses = 50;

SixNumbers operator*(const SixBySix& m, const SixNumbers& v) {
  SixNumbers product{};
  for (int i = 0; i < 6; ++i)
    for (int k = 0; k < 6; ++k) product[i] += m[i][k] * v[k];
  return product;
}

/// Turns a symmetric matrix into a diagonal one by Jacobi's rotations. Returns the axes, one a row.
SixBySix diagonalise(SixBySix& m) {
  SixBySix axes{};
  for (int i = 0; i < 6; ++i) axes[i][i] = 1;
  constexpr int kSweeps = 12;  // the error is squared in each sweep
  for (int sweep = 0; sweep < kSweeps; ++sweep)
    for (int p = 0; p < 6; ++p)
      for (int q = p + 1; q < 6; ++q) {
        if (m[p][q] == 0) continue;
        const double half = (m[q][q] - m[p][p]) / (2 * m[p][q]);
        const double tangent = std::copysign(1 / (std::abs(half) + std::hypot(half, 1)), half);
        const double cosine = 1 / std::hypot(tangent, 1), sine = tangent * cosine;
        const auto turn = [&](double& of_p, double& of_q) {
          const double before = of_p;
          of_p = cosine * before - sine * of_q, of_q = sine * before + cosine * of_q;
        };
        for (int k = 0; k < 6; ++k) turn(m[k][p], m[k][q]);
        for (int k = 0; k < 6; ++k) turn(m[p][k], m[q][k]), turn(axes[p][k], axes[q][k]);
        m[p][q] = m[q][p] = 0;
      }
  return axes;
}

/// The angles by which the first frame is turned relative to the second, about the axes of the first: those of Euler in
/// the order xyz, as in Bullet.
Vec3 angles_between(const Mat3& first, const Mat3& second) {
  const Mat3 turn = transposed(second) * first;
  const double y = std::asin(std::clamp(turn.row0.z, -1.0, 1.0));
  if (std::abs(turn.row0.z) >= 1) return {std::copysign(1.0, y) * std::atan2(turn.row1.x, turn.row1.y), y, 0};
  return {std::atan2(-turn.row1.z, turn.row2.z), y, std::atan2(-turn.row0.y, turn.row0.x)};
}

}  // namespace

Directions directions(const Constraint& constraint, const std::array<Pose, 2>& links) {
  Directions found{};
  std::array<Mat3, 2> turns;
  for (int i = 0; i < 2; ++i) {
    const Pose& frame = constraint.frames[i];
    const bool world = constraint.links[i] < 0;
    found.points[i] = world ? frame.translation : links[i] * frame.translation;
    turns[i] = world ? frame.rotation : links[i].rotation * frame.rotation;
  }
  const Mat3 columns = transposed(turns[0]);
  const std::array<Vec3, 3> own{columns.row0, columns.row1, columns.row2};
  if (constraint.kind == Constraint::Kind::kSlider) {
    const Vec3 axis = unit(constraint.links[0] < 0 ? constraint.axis : links[0].rotation * constraint.axis);
    found.axes[0] = any_orthogonal(axis);
    found.axes[1] = cross(axis, found.axes[0]);
  } else {
    found.axes = {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}};
  }
  const Vec3 apart = found.points[0] - found.points[1];
  for (int i = 0; i < 3; ++i) found.target[i] = -constraint.correction * dot(apart, found.axes[i]);
  if (constraint.kind == Constraint::Kind::kPoint) return found;
  const Vec3 angles = angles_between(turns[0], turns[1]);
  for (int i = 0; i < 3; ++i) {
    found.axes[i + 3] = own[i];
    found.target[i + 3] = -constraint.correction * angles[i];
  }
  return found;
}

Bilateral::Bilateral(const SixBySix& mobility, const SixNumbers& target, double limit)
    : mobility_(mobility), target_(target), limit_(limit) {
  const auto largest = [&](int first) {
    return std::max({mobility[first][first], mobility[first + 1][first + 1], mobility[first + 2][first + 2]});
  };
  // Forces and torques have different units. All forces are alike, so that the part of an error that they can correct
  // does not depend on the axes.
  const double linear = largest(0), angular = largest(3);
  for (int i = 0; i < 6; ++i) {
    const double own = i < 3 ? linear : angular, other = i < 3 ? angular : linear;
    root_[i] = own > kImmobile * other ? std::sqrt(own) : 0;
  }
  const auto inverse = [](double x) { return x > 0 ? 1 / x : 0; };
  SixBySix scaled{};
  for (int i = 0; i < 6; ++i)
    for (int k = 0; k < 6; ++k) scaled[i][k] = inverse(root_[i]) * mobility[i][k] * inverse(root_[k]);
  const SixBySix axes = diagonalise(scaled);
  for (int a = 0; a < 6; ++a) {
    if (!(scaled[a][a] > kDependent)) continue;
    for (int i = 0; i < 6; ++i)
      for (int k = 0; k < 6; ++k) {
        const double both = axes[a][i] * axes[a][k];
        possible_[i][k] += root_[i] * both * inverse(root_[k]);
        inverse_[i][k] += inverse(root_[i]) * both * inverse(root_[k]) / scaled[a][a];
        hold_[i][k] += inverse(root_[i]) * both * inverse(root_[k]);
      }
  }
}

SixNumbers Bilateral::beside(const SixNumbers& slip) const {
  SixNumbers off{};
  for (int i = 0; i < 6; ++i) off[i] = slip[i] - target_[i];
  return possible_ * off;
}

SixNumbers Bilateral::answer(const SixNumbers& slip, const SixNumbers& present) const {
  const SixNumbers off = beside(slip), push = inverse_ * off;
  SixNumbers force{};
  bool suffices = true;
  for (int i = 0; i < 6; ++i) {
    force[i] = present[i] - push[i];
    suffices = suffices && std::abs(force[i]) <= limit_;
  }
  if (suffices) return force;
  for (double& each : force) each = std::clamp(each, -limit_, limit_);
  for (int pass = 0; pass < kPasses; ++pass)
    for (int i = 0; i < 6; ++i) {
      if (!(mobility_[i][i] > kDependent * root_[i] * root_[i])) continue;
      double rest = off[i];
      for (int k = 0; k < 6; ++k) rest += mobility_[i][k] * (force[k] - present[k]);
      force[i] = std::clamp(force[i] - rest / mobility_[i][i], -limit_, limit_);
    }
  return force;
}

Bilateral::Near Bilateral::held(const SixNumbers& slip, const SixNumbers& before, double give) const {
  SixNumbers off{};
  for (int i = 0; i < 6; ++i) off[i] = slip[i] - target_[i];
  const SixNumbers push = hold_ * off;
  Near found;
  for (int i = 0; i < 6; ++i) {
    const double asked = before[i] - push[i] / give;
    found.value[i] = std::clamp(asked, -limit_, limit_);
    if (std::abs(asked) >= limit_) continue;
    for (int k = 0; k < 6; ++k) found.by_slip[i][k] = -hold_[i][k] / give;
  }
  return found;
}

double Bilateral::speed(const SixNumbers& slip) const {
  double largest = 0;
  for (int i = 0; i < 6; ++i) {
    const double radius = i < 3 || !(root_[0] > 0) ? 1 : root_[i] > 0 ? root_[0] / root_[i] : 0;
    largest = std::max(largest, radius * std::abs(slip[i]));
  }
  return largest;
}

double Bilateral::missing(const SixNumbers& slip) const { return speed(beside(slip)); }

}  // namespace overlapper
