#include "methods/dual/wide_ball.h"

#include <array>
#include <cmath>
#include <numbers>

#include "geometry/constants.h"
#include "methods/dual/basis.h"

namespace overlapper {
namespace {

WidePlane supporting(const WideBody& body, const WideVector& outward) {
  const WideVector normal = unit(outward);
  return {normal, dot(normal, body.support(normal))};
}

/// A tetrahedron around one of the bounded bodies; around everything relevant if none is bounded.
std::array<Owned<WidePlane>, 4> surrounding_simplex(std::span<const WideBody> bodies, double reach) {
  const std::array<Vec3, 4> directions{Vec3{1, 1, 1}, Vec3{1, -1, -1}, Vec3{-1, 1, -1}, Vec3{-1, -1, 1}};
  std::array<Owned<WidePlane>, 4> simplex;
  for (int k = 0; k < 4; ++k) {
    simplex[k] = {{unit(wide(directions[k])), {1e6 * reach}}, -1};
    bool first = true;
    for (const WideBody& body : bodies) {
      if (!bounded(body.shape)) continue;
      const WidePlane plane = supporting(body, wide(directions[k]));
      if (first || plane.offset < simplex[k].plane.offset) simplex[k].plane = plane;
      first = false;
    }
  }
  return simplex;
}

Owned<WidePlane> tightest(std::span<const WideBody> bodies, const WideVector& point) {
  Owned<WidePlane> worst{{}, -1};
  DoubleDouble outside{-kInfinity};
  for (int i = 0; i < static_cast<int>(bodies.size()); ++i) {
    const WidePlane plane = bodies[i].tightest(point);
    const DoubleDouble d = signed_distance(plane, point);
    if (d > outside) outside = d, worst = {plane, i};
  }
  return worst;
}

}  // namespace

WideBall wide_deepest_ball(std::span<const WideBody> bodies, std::span<const OwnedPlane> hints, double margin,
                           double reach, double rounding) {
  const std::array<Owned<WidePlane>, 4> simplex = surrounding_simplex(bodies, reach);
  Basis basis(simplex);
  WideBall best{{}, -kInfinity, kInfinity, {}};
  best.cuts.assign(simplex.begin(), simplex.end());
  /// Adds a plane to the basis, moved out by `out`.
  const auto enter = [&](const Owned<WidePlane>& cut, double out = 0) {
    best.cuts.push_back(cut);
    return basis.exchange({{cut.plane.normal, cut.plane.offset + DoubleDouble{out}}, cut.owner});
  };
  for (const auto& [plane, owner] : hints) {
    if (owner < 0 || !bounded(bodies[owner].shape)) continue;
    const WidePlane exactly = supporting(bodies[owner], wide(plane.normal));
    if (signed_distance(exactly, basis.ball().first).head > 0) enter({exactly, owner});
  }
  const auto decided = [&] {
    const bool deep = best.lower > margin && best.lower >= best.upper / 4;
    const bool shallow = best.upper <= margin && best.lower >= -margin;
    return deep || shallow || best.upper < -margin || best.upper - best.lower <= 4 * rounding;
  };
  /// Updates how far inside all bodies the ball's centre is. Returns the plane nearest to the centre, or violated.
  const auto looked_at = [&](const WideVector& centre) {
    const Owned<WidePlane> worst = tightest(bodies, centre);
    const double slack = -signed_distance(worst.plane, centre).head - rounding;
    if (slack > best.lower) best.lower = slack, best.centre = centre;
    return worst;
  };
  constexpr int kMaxRounds = 512;
  for (int round = 0; round < kMaxRounds; ++round) {
    const WideVector centre = basis.ball().first;
    best.upper = std::min(best.upper, basis.certified_radius(centre, reach + norm(centre).head) + rounding);
    const Owned<WidePlane> worst = looked_at(centre);
    if (decided() || !enter(worst)) break;
  }
  if (decided() || !(best.upper > margin)) return best;
  // Where many planes touch the largest ball, the simplex method may cycle. It does not cycle if each plane is moved
  // out by a different small fraction of the radius. The depth of that ball's centre then comes from the bodies
  // themselves.
  basis = Basis(simplex);
  double part = 0;
  for (int round = 0; round < kMaxRounds && !decided(); ++round) {
    part = std::fmod(part + std::numbers::phi, 1.0);
    if (!enter(looked_at(basis.ball().first), 0x1p-10 * best.upper * (1 + part))) break;
  }
  return best;
}

}  // namespace overlapper
