#include "shapes/wide_triangles.h"

#include "geometry/constants.h"
#include "shapes/hull_data.h"

namespace overlapper {

WideTriangles::WideTriangles(const HullData* hull) : hull_(hull) {
  if (!hull) return;
  for (const auto& [i, j, k] : hull->triangles) {
    const Vec3 a = hull->corners[i], b = hull->corners[j], c = hull->corners[k];
    // One ulp for each difference of corners and each product, as in orientation().
    const Vec3 normal = cross(b - a, c - a);
    const double length = norm(normal);
    const double doubt = length > 0 ? 16 * 0x1p-53 * (1 + norm(b - a) * norm(c - a) / length) : kInfinity;
    glances_.push_back({a, length > 0 ? normal / length : Vec3{}, doubt});
  }
}

WidePlane WideTriangles::plane(int triangle, double radius) const {
  const auto& [a, b, c] = hull_->triangles[triangle];
  const WideVector normal = unit(wide_normal(hull_->corners[a], hull_->corners[b], hull_->corners[c]));
  return {normal, dot(normal, wide(hull_->corners[a])) + DoubleDouble{radius}};
}

WidePlane WideTriangles::tightest(const WideVector& point) const {
  const Vec3 p = rounded(point);
  const auto seen = [&](const Glance& g, double& error) {
    const Vec3 away = p - g.corner;
    error = g.doubt * norm(away) + 4 * 0x1p-53 * (norm(p) + norm(g.corner));
    return dot(g.normal, away);
  };
  double surely = -kInfinity, error = 0;
  for (const Glance& g : glances_) surely = std::max(surely, seen(g, error) - error);
  WidePlane nearest{};
  DoubleDouble least{-kInfinity};
  for (int t = 0; t < size(); ++t) {
    const double outside = seen(glances_[t], error);
    if (outside + error < surely) continue;
    const WidePlane candidate = plane(t, 0);
    const DoubleDouble distance = signed_distance(candidate, point);
    if (distance > least) least = distance, nearest = candidate;
  }
  return nearest;
}

WideVector farthest_corner(const HullData& hull, const WideVector& direction) {
  const Vec3 d = rounded(direction);
  double surely = -kInfinity;
  const auto error = [&](Vec3 corner) { return 8 * 0x1p-53 * dot(abs(d), abs(corner)); };
  for (Vec3 corner : hull.corners) surely = std::max(surely, dot(d, corner) - error(corner));
  Vec3 farthest;
  DoubleDouble largest{-kInfinity};
  for (Vec3 corner : hull.corners) {
    if (dot(d, corner) + error(corner) < surely) continue;
    const DoubleDouble value = dot(direction, wide(corner));
    if (value > largest) largest = value, farthest = corner;
  }
  return wide(farthest);
}

}  // namespace overlapper
