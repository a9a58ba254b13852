#include "distance/near_polytope.h"

#include <algorithm>

namespace overlapper {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

Vec3 unit_vector(int axis) { return {axis == 0 ? 1.0 : 0.0, axis == 1 ? 1.0 : 0.0, axis == 2 ? 1.0 : 0.0}; }

std::vector<Vec3> corners_of(const Shape& shape) {
  if (const HullData* hull = polytope_of(shape)) return hull->corners;
  if (const Capsule* capsule = std::get_if<Capsule>(&shape); capsule && capsule->length > 0)
    return {{0, 0, -capsule->length / 2}, {0, 0, capsule->length / 2}};
  const Box* box = std::get_if<Box>(&shape);
  if (!box) return {{}};
  std::vector<Vec3> corners;
  for (int i = 0; i < 8; ++i) corners.push_back(corner(*box, i));
  return corners;
}

}  // namespace

NearPolytope::NearPolytope(const WideBody& body, const WideVector& about)
    : body_(body), about_(about), local_(corners_of(body.shape)) {
  for (Vec3 p : local_) {
    const Vec3 at = rounded(body.placed(wide(p)) - about);
    corners.push_back({at, kLost * norm(at), static_cast<int>(corners.size())});
    radius = std::max(radius, norm(at));
  }
}

void NearPolytope::cut(Vec3 direction, double height) {
  std::vector<char> kept;
  for (const NearCorner& c : corners) kept.push_back(dot(direction, c.at) + c.lost >= height);
  std::visit([&](const auto& shape) { gather(shape, kept); }, body_.shape);
  for (NearFacet& facet : facets) facet.normal = rounded(normal(facet));
  for (NearRidge& ridge : ridges) complete(ridge);
  size_t next = 0;
  std::erase_if(corners, [&](const NearCorner&) { return !kept[next++]; });
}

WideVector NearPolytope::normal(const NearFacet& facet) const {
  const auto& [i, j, k] = facet.corners;
  if (k < 0) return body_.turned(wide(j == 0 ? -unit_vector(i) : unit_vector(i)));
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
  double farthest = -kInfinity;
  for (const NearCorner& c : corners) farthest = std::max(farthest, dot(direction, c.at) - c.lost);
  return farthest;
}

double NearPolytope::most_reach(Vec3 direction) const {
  double farthest = -kInfinity;
  for (const NearCorner& c : corners) farthest = std::max(farthest, dot(direction, c.at) + c.lost);
  return farthest;
}

void NearPolytope::gather(const auto&, const std::vector<char>&) {}

void NearPolytope::gather(const Capsule& capsule, const std::vector<char>&) {
  if (capsule.length > 0) ridges = {{0, 1, -1, -1, {}, {}}};
}

void NearPolytope::gather(const Box&, const std::vector<char>& kept) {
  for (int f = 0; f < 6; ++f) facets.push_back({{}, {f / 2, f & 1, -1}});
  for (int i = 0; i < 8; ++i)
    for (int k = 0; k < 3; ++k) {
      const int j = i | 1 << k;
      if (j == i || !(kept[i] || kept[j])) continue;
      const auto side_of = [&](int axis) { return 2 * axis + (i >> axis & 1); };
      ridges.push_back({i, j, side_of((k + 1) % 3), side_of((k + 2) % 3), {}, {}});
    }
}

void NearPolytope::gather(const Hull& hull, const std::vector<char>& kept) { gather(*hull.data, kept); }

void NearPolytope::gather(const RoundedHull& hull, const std::vector<char>& kept) { gather(*hull.core.data, kept); }

void NearPolytope::gather(const HullData& hull, const std::vector<char>& kept) {
  struct Side {
    int from, to, facet;
  };
  std::vector<Side> sides;
  for (const auto& triangle : hull.triangles) {
    if (!(kept[triangle[0]] || kept[triangle[1]] || kept[triangle[2]])) continue;
    for (int i = 0; i < 3; ++i) {
      const auto [from, to] = std::minmax(triangle[i], triangle[(i + 1) % 3]);
      if (kept[from] || kept[to]) sides.push_back({from, to, static_cast<int>(facets.size())});
    }
    facets.push_back({{}, triangle});
  }
  // Two triangles run along every ridge.
  std::ranges::sort(sides, {}, [](const Side& s) { return std::pair(s.from, s.to); });
  for (size_t i = 0; i + 1 < sides.size(); i += 2)
    ridges.push_back({sides[i].from, sides[i].to, sides[i].facet, sides[i + 1].facet, {}, {}});
}

void NearPolytope::complete(NearRidge& ridge) const {
  ridge.along = rounded(along(ridge));
  const Vec3 from = corners[ridge.from].at, to = corners[ridge.to].at;  // all of them are there still
  const double t = std::clamp(-dot(from, to - from) / norm2(to - from), 0.0, 1.0);
  ridge.near.at = from + t * (to - from);
  ridge.near.lost = kLost * std::max(norm(from), norm(to));
  // Of a long edge that passes nearby, doubles do not know where.
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
