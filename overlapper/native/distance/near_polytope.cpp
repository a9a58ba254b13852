#include "distance/near_polytope.h"

#include <algorithm>

#include "geometry/constants.h"
#include "geometry/predicates.h"

namespace overlapper {

NearPolytope::NearPolytope(const WideBody& body, const WideVector& about)
    : body_(body), about_(about), local_(ask(body.shape, [](const auto& s) { return s.core_corners(); })) {
  for (Vec3 p : local_) {
    const Vec3 at = rounded(body.placed(wide(p)) - about);
    corners.push_back({at, kLost * norm(at), static_cast<int>(corners.size())});
    radius = std::max(radius, norm(at));
  }
}

bool NearPolytope::in_a_plane(const Edge& ridge, const CoreSurface& surface) const {
  if (ridge.left < 0) return false;
  const auto &left = surface.facets[ridge.left], &right = surface.facets[ridge.right];
  if (left[2] < 0 || right[2] < 0) return false;
  return std::ranges::all_of(right, [&](int corner) {
    return orientation(local_[left[0]], local_[left[1]], local_[left[2]], local_[corner]) == 0;
  });
}

void NearPolytope::cut(Vec3 direction, double height) {
  std::vector<char> kept;
  for (const NearCorner& c : corners) kept.push_back(dot(direction, c.at) + c.lost >= height);
  CoreSurface surface;
  ask(body_.shape, [&](const auto& s) { s.append_core_surface(kept, surface); });
  for (const auto& facet : surface.facets) facets.push_back({{}, facet});
  for (const Edge& r : surface.ridges)
    if (!in_a_plane(r, surface)) ridges.push_back({r.from, r.to, r.left, r.right, {}, {}});
  for (NearFacet& facet : facets) facet.normal = rounded(normal(facet));
  for (NearRidge& ridge : ridges) complete(ridge);
  const auto height_of = [&](const NearCorner& c) { return dot(direction, c.at); };
  if (!corners.empty()) opposite_ = *std::ranges::min_element(corners, {}, height_of);
  size_t next = 0;
  std::erase_if(corners, [&](const NearCorner&) { return !kept[next++]; });
}

WideVector NearPolytope::normal(const NearFacet& facet) const {
  const auto& [i, j, k] = facet.corners;
  if (k < 0) return body_.turned(wide(j == 0 ? -tangents::axis(i) : tangents::axis(i)));
  return body_.turned(unit(wide_normal(local_[i], local_[j], local_[k])));
}

WideVector NearPolytope::along(const NearRidge& ridge) const {
  return body_.turned(unit(wide_difference(local_[ridge.to], local_[ridge.from])));
}

double NearPolytope::lost(const NearFacet& facet) const {
  const auto& [i, j, k] = facet.corners;
  if (k < 0) return kLostWide;
  const Vec3 u = local_[j] - local_[i], v = local_[k] - local_[i];
  return kLostWide * (1 + norm(u) * norm(v) / norm(rounded(wide_normal(local_[i], local_[j], local_[k]))));
}

double NearPolytope::least_reach(Vec3 direction) const {
  double farthest = opposite_ ? dot(direction, opposite_->at) - opposite_->lost : -kInfinity;
  for (const NearCorner& c : corners) farthest = std::max(farthest, dot(direction, c.at) - c.lost);
  return farthest;
}

double NearPolytope::most_reach(Vec3 direction) const {
  double farthest = -kInfinity;
  for (const NearCorner& c : corners) farthest = std::max(farthest, dot(direction, c.at) + c.lost);
  return farthest;
}

void NearPolytope::complete(NearRidge& ridge) const {
  ridge.along = rounded(along(ridge));
  const Vec3 from = corners[ridge.from].at, to = corners[ridge.to].at;  // no corner has been removed yet
  const double t = std::clamp(-dot(from, to - from) / norm2(to - from), 0.0, 1.0);
  ridge.near.at = from + t * (to - from);
  ridge.near.lost = kLost * std::max(norm(from), norm(to));
  // Doubles do not locate the nearest point of a long edge that passes nearby.
  if (ridge.near.lost > 0x1p-20 * norm(ridge.near.at)) ridge.near = nearest(ridge);
}

NearCorner NearPolytope::nearest(const NearRidge& ridge) const {
  const WideVector p = body_.placed(wide(local_[ridge.from])) - about_,
                   q = body_.placed(wide(local_[ridge.to])) - about_, step = q - p;
  const DoubleDouble share = -dot(p, step) / dot(step, step);
  const Vec3 near = rounded(share.head <= 0 ? p : share.head >= 1 ? q : p + share * step);
  return {near, kLost * norm(near) + 0x1p-90 * std::max(norm(rounded(p)), norm(rounded(q)))};
}

}  // namespace overlapper
