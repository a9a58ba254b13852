#include "forces/pressure.h"

#include <algorithm>
#include <cmath>

namespace overlapper {
namespace {

/// The centre of pressure stays within this many squared radii of gyration: the border of a rectangle, on its axes.
constexpr double kReach2 = 3;

/// Bodies that approach each other more slowly, in m/s, do not bounce. It is Bullet's restitutionVelocityThreshold.
constexpr double kImpact = 0.2;

/// The pressure at the end of the step includes the velocity times this part of the step.
double ahead(Rule rule) { return rule == Rule::kKeeping ? 0.25 : 1; }

}  // namespace

PlaneArea::PlaneArea(const ElasticPatch& patch, Vec3 along, Vec3 across)
    : area(patch.area),
      distance(patch.distance),
      rest{patch.force, overlapper::dot(along, patch.torque), overlapper::dot(across, patch.torque)},
      hardened(patch.hardened) {
  const Vec3 hu = patch.hardened_moments * along, hv = patch.hardened_moments * across;
  hardened_uu = overlapper::dot(along, hu), hardened_uv = overlapper::dot(along, hv);
  hardened_vv = overlapper::dot(across, hv);
  if (!(area > 0)) {
    area = u = v = uu = uv = vv = distance = 0;
    return;
  }
  const Vec3 to = patch.centre - patch.centroid, mu = patch.moments * along, mv = patch.moments * across;
  u = overlapper::dot(to, along), v = overlapper::dot(to, across);
  uu = overlapper::dot(along, mu) / area, uv = overlapper::dot(along, mv) / area;
  vv = overlapper::dot(across, mv) / area;
}

ThreeByThree PlaneArea::foundation(double stiffness) const {
  // A point at (u, v) moves along the normal by 1, by v about the first axis, and by -u about the second.
  const double k = stiffness * area;
  ThreeByThree found{{{k, k * v, -k * u},
                      {k * v, k * (vv + v * v), -k * (uv + u * v)},
                      {-k * u, -k * (uv + u * v), k * (uu + u * u)}}};
  if (hardened > 0) {
    // The centroid is the origin, so the volume adds no first moments.
    found[0][0] += stiffness * hardened;
    found[1][1] += stiffness * hardened_vv, found[2][2] += stiffness * hardened_uu;
    found[1][2] -= stiffness * hardened_uv, found[2][1] -= stiffness * hardened_uv;
  }
  return found;
}

Pressure::Pressure(const ElasticPatch& patch, const PlaneArea& area, const ThreeByThree& mobility,
                   const Damping& damping, const Three& before, double duration, Rule rule)
    : area_(area), mobility_(mobility), duration_(duration) {
  const ThreeByThree foundation = area.foundation(patch.stiffness);
  const double lead = ahead(rule) * duration;
  response_ = (lead + damping.staying * (duration - lead) + patch.dissipation) * foundation;
  response_[0][0] += damping.factor;  // tipping and rolling are not damped
  // Backward Euler depends on the velocity at the end only. The other rule depends on the change of the velocity.
  const Three known = (rule == Rule::kKeeping ? lead : 0) * (foundation * before);
  rest_ = area.rest + known;
  // The pressure aims at the speed of a bounce if this is more than what the depth gives back.
  if (patch.restitution > 0 && damping.approach < -kImpact)
    rest_[0] = std::max(patch.force, -patch.restitution * response_[0][0] * damping.approach);
  ThreeByThree matrix = duration * (response_ * mobility);
  for (int i = 0; i < 3; ++i) matrix[i][i] += 1;
  implicit_ = inverse(matrix);
  // A line has only one radius of gyration; the other radius must not be zero here.
  const double least = 1e-9 * (area.uu + area.vv), uu = area.uu + least, vv = area.vv + least, uv = area.uv;
  const double square = uu * vv - uv * uv;
  in_radii_ = {vv / square, -uv / square, uu / square};
}

/// Whether the pressures that are asked for are on the patch, and the pressures by a force of 1 if not.
struct Pressure::Drawn {
  bool on_patch;
  Three per_force;
  double x, y, far, back;
};

Pressure::Drawn Pressure::drawn(const Three& asked) const {
  if (!(area_.area > 0)) return {false, {1, 0, 0}, 0, 0, 0, 0};
  // Torques without a force have their centre infinitely far away. A negative force may come from torques that the
  // patch cannot give. The force may be positive without these torques.
  const double share = std::max(0.0, asked[0]);
  const double x = -asked[2] - share * area_.u, y = asked[1] - share * area_.v;
  const double far = in_radii_[0] * x * x + 2 * in_radii_[1] * x * y + in_radii_[2] * y * y;
  const bool on_patch = asked[0] > 0 && !(far > kReach2 * asked[0] * asked[0]);
  const double back = far > 0 ? std::sqrt(kReach2 / far) : 0;
  return {on_patch, {1, area_.v + back * y, -(area_.u + back * x)}, x, y, far, back};
}

Three Pressure::answer(const Three& slip, double more) const {
  const Three target = rest_ - response_ * slip - Three{more, 0, 0};
  const Three asked = implicit_ * target;
  const Drawn to = drawn(asked);
  if (to.on_patch) return asked;
  const double moved = overlapper::dot(response_[0], mobility_ * to.per_force);
  return std::max(0.0, target[0] / (1 + duration_ * moved)) * to.per_force;
}

Linear Pressure::held(const Three& slip, double more, double give, const Three& before, const Three& present) const {
  const ThreeByThree pushed_back = duration_ * (response_ * mobility_);
  const Three target = rest_ - response_ * slip - Three{more, 0, 0};
  const Three asked = implicit_ * (target + pushed_back * present);
  const Drawn to = drawn(asked);
  const Three with_give = target + give * (pushed_back * before);
  if (to.on_patch) {
    const ThreeByThree whole = inverse(kIdentity + give * pushed_back);
    if (const Three held = whole * with_give; held[0] > 0)
      return {held, -1 * (whole * response_), -1 * transposed(whole)[0]};
  }
  const double stiff = 1 + give * overlapper::dot(pushed_back[0], to.per_force), force = with_give[0] / stiff;
  if (!(force > 0)) return {};
  Linear found{force * to.per_force, (-1 / stiff) * outer(to.per_force, response_[0]), (-1 / stiff) * to.per_force};
  if (!(to.far > 0)) return found;
  // The point to which the centre is drawn back turns about the centre of the area.
  const auto turned = [&](const Three& by) {
    const double grown = asked[0] > 0 ? by[0] : 0, dx = -by[2] - grown * area_.u, dy = by[1] - grown * area_.v;
    const double farther =
        (in_radii_[0] * to.x + in_radii_[1] * to.y) * dx + (in_radii_[1] * to.x + in_radii_[2] * to.y) * dy;
    const double nearer = -to.back * farther / to.far;
    const Three per_force{0, to.back * dy + nearer * to.y, -(to.back * dx + nearer * to.x)};
    return force * (per_force - (give * overlapper::dot(pushed_back[0], per_force) / stiff) * to.per_force);
  };
  const ThreeByThree by_slip = transposed(implicit_ * response_), by_present = transposed(implicit_ * pushed_back);
  ThreeByThree turned_by_slip{}, kept{};
  for (int k = 0; k < 3; ++k)
    turned_by_slip[k] = -1 * turned(by_slip[k]), kept[k] = kIdentity[k] - turned(by_present[k]);
  found.by_slip = found.by_slip + transposed(turned_by_slip);
  found.by_other = found.by_other - turned(transposed(implicit_)[0]);
  // The pressures at the end of a step of Newton's method are then those present.
  const ThreeByThree whole = inverse(transposed(kept));
  found.value = present + whole * (found.value - present);
  found.by_slip = whole * found.by_slip, found.by_other = whole * found.by_other;
  return found;
}

}  // namespace overlapper
