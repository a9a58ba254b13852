#include <algorithm>
#include <span>

#include "geometry/constants.h"
#include "methods/round/closed_forms/closed_forms.h"
#include "methods/round/closed_forms/only_cut.h"
#include "methods/round/closed_forms/revolved_part.h"

namespace overlapper::closed_forms {
namespace {

/// An upper bound of dot(direction, x) over the part of `body` below the plane, about its centre. The search for the
/// least bound ends once the bound is `enough`. By weak duality, reach(direction − λ normal) + λ offset is a bound for
/// any λ >= 0. It is a convex function of λ.
double reach_below(const Revolved& body, Vec3 normal, double offset, Vec3 direction, double rounding, double enough) {
  if (body.ball()) return reach_of_cap(body.radius, normal, offset, direction, rounding);
  const auto bound = [&](double lambda) {
    return body.reach(direction - lambda * normal) + lambda * offset + (1 + lambda) * rounding;
  };
  constexpr double kGolden = 0.6180339887498949;
  double low = 0, high = 4;
  while (high < 1e6 && bound(high) < bound(high / 2)) high *= 2;
  double left = high - kGolden * (high - low), right = low + kGolden * (high - low);
  double at_left = bound(left), at_right = bound(right);
  for (int i = 0; i < 48 && std::min(at_left, at_right) > enough; ++i) {
    if (at_left < at_right) {
      high = right, right = left, at_right = at_left;
      left = high - kGolden * (high - low), at_left = bound(left);
    } else {
      low = left, left = right, at_left = at_right;
      right = low + kGolden * (high - low), at_right = bound(right);
    }
  }
  return std::min({bound(0), at_left, at_right});
}

/// The part of the round body below a plane that may be off by `rounding`.
std::optional<MeasuresAndInertia> measure_below(const RoundPair& pair, const PlaneCut& cut, Vec3 normal,
                                                double rounding) {
  const Revolved& body = *pair.revolved[pair.self];
  const SymmetryFrame frame(body, normal);
  const RevolvedPart part = below(body, cut);
  if (!(part.volume > 0)) return std::nullopt;
  const auto placed = [&](Vec3 p) { return body.centre + (p.x * frame.axis + p.y * frame.sideways); };
  Measures q = measures_in_closed_form();
  q.facets_touched = part.flat_area > 0 ? 1 : 0;
  q.volume = part.volume;
  q.area = part.flat_area + part.curved_area;
  q.centroid = pair.reference + placed(part.moment / part.volume);
  q.volume_error = rounding * q.area + kSummation * part.scale + kSummation * part.volume;
  // The area vectors of a closed surface sum to zero, and so do their moments.
  if (part.flat_area > 0)
    q.pulls = pulls_of_flat(pair, part.flat_area * normal, placed(part.flat_moment / part.flat_area));
  return MeasuresAndInertia{q, {}};
}

}  // namespace

std::optional<OnlyCut> only_cut(const Revolved& body, std::span<const Plane> planes, double rounding) {
  const Plane* deepest = nullptr;
  double most = -kInfinity;
  std::vector<const Plane*> cutting;
  for (const Plane& plane : planes) {
    const double beyond = body.reach(plane.normal) + signed_distance(plane, body.centre);
    if (beyond > most) most = beyond, deepest = &plane;
    if (beyond > 0) cutting.push_back(&plane);
  }
  double layers = 0;
  for (const Plane* plane : cutting) {
    if (plane == deepest) continue;
    const double offset = -signed_distance(*plane, body.centre);
    const double deepest_offset = -signed_distance(*deepest, body.centre);
    const double reach = reach_below(body, deepest->normal, deepest_offset, plane->normal, rounding, offset);
    if (reach > offset + 2 * rounding) return std::nullopt;
    if (reach > offset) layers += 4;  // The plane may cut off a layer of rounding.
  }
  return OnlyCut{deepest, layers};
}

std::optional<MeasuresAndInertia> cut_by_one_plane(const RoundPair& pair) {
  const Revolved& body = *pair.revolved[pair.self];
  const auto found = only_cut(body, pair.planes, pair.rounding);
  if (!found) return std::nullopt;
  const Vec3 normal = found->plane->normal;
  const Placed& flat = pair.flat_body();
  if (const auto plane = unit_facet(flat.shape, static_cast<int>(found->plane - pair.planes.data())))
    return measure_below(pair, cut_of(body, seen_from(flat, body), *plane), normal, found->layers * pair.rounding);
  const WideAxis at{wide(body.centre), wide(body.axis)};
  const PlaneCut cut = cut_of(body, at, {wide(normal), {found->plane->offset}});
  return measure_below(pair, cut, normal, (1 + found->layers) * pair.rounding);
}

}  // namespace overlapper::closed_forms
