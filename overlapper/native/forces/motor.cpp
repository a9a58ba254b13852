#include "forces/motor.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "forces/multibody.h"

namespace overlapper {
namespace {

/// Motors of a smaller gain have this one, so that a velocity exists at which they do not push.
constexpr double kLeastGain = 1e-6;

/// A motor with its largest force is beyond it by more than this part of it.
constexpr double kBeyond = 1e-6;

}  // namespace

MotorsOfBody::MotorsOfBody(std::vector<Motor> motors, std::span<const double> mass, std::span<const double> velocity,
                           double duration, std::span<signed char> full)
    : mass_(mass), full_(full), free_(velocity.begin(), velocity.end()), inverse_mass_(mass.begin(), mass.end()) {
  const size_t n = velocity.size();
  invert_mass(inverse_mass_, int(n));
  for (const Motor& motor : motors) {
    const double mobility = inverse_mass_[size_t(motor.coordinate) * n + motor.coordinate];
    if (!(mobility > 0)) continue;
    const double gain = std::max(motor.gain, kLeastGain);
    const double stiffness = gain < 1 ? gain / ((1 - gain) * mobility) : INFINITY;
    motors_.push_back({motor, motor.target / gain, stiffness, motor.limit * duration});
  }
  // Held coordinates have no row. Others are heavier by the stiffness of their motors.
  std::vector<double> impulse(n), held(mass.begin(), mass.end());
  pushed_ = free_;
  for (const Held& each : motors_) {
    const size_t c = each.motor.coordinate;
    if (full_[c] == 0) continue;
    for (size_t i = 0; i < n; ++i) pushed_[i] += inverse_mass_[i * n + c] * full_[c] * each.most;
  }
  free_ = pushed_;
  for (const Held& each : motors_) {
    const size_t c = each.motor.coordinate;
    if (full_[c] != 0) continue;
    if (std::isinf(each.stiffness)) {
      pushed_[c] = each.velocity;
      for (size_t i = 0; i < n; ++i) held[i * n + c] = held[c * n + i] = 0;
    } else {
      held[c * n + c] += each.stiffness;
      impulse[c] = each.stiffness * (each.velocity - pushed_[c]);
    }
  }
  for (size_t i = 0; i < n; ++i)
    for (size_t k = 0; k < n; ++k) impulse[i] += mass[i * n + k] * (free_[k] - pushed_[k]);
  invert_mass(held, int(n));
  inverse_mass_ = std::move(held);
  for (size_t i = 0; i < n; ++i)
    for (size_t k = 0; k < n; ++k) pushed_[i] += inverse_mass_[i * n + k] * impulse[k];
}

bool MotorsOfBody::changes(std::span<const double> velocity, std::span<const double> impulses, bool last) {
  const size_t n = velocity.size();
  bool changed = false;
  for (const Held& each : motors_) {
    const size_t c = each.motor.coordinate;
    const signed char before = full_[c];
    if (before == 0) {
      double push = -impulses[c];
      for (size_t k = 0; k < n; ++k) push += mass_[c * n + k] * (velocity[k] - free_[k]);
      if (std::abs(push) > (1 + kBeyond) * each.most) full_[c] = push > 0 ? 1 : -1;
    } else if (!last) {
      const double beyond = before * (each.velocity - velocity[c]);
      const double most = std::isinf(each.stiffness) ? 0 : each.most / each.stiffness;
      if (beyond < most) full_[c] = 0;
    }
    changed = changed || full_[c] != before;
  }
  return changed;
}

}  // namespace overlapper
