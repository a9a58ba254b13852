#include "shapes/wide_body.h"

#include <cassert>

#include "shapes/planes_asked.h"

namespace overlapper {

void WidePlanesAcrossAxes::append_wide_planes(const WideBody& body, std::vector<WidePlane>& planes) {
  body.append_planes_across_axes(planes);
}

WideBody::WideBody(const Placed& body, const WideVector& about)
    : shape(body.shape),
      triangles_(polytope_of(shape)),
      rotation_(wide_rotation(body.orientation)),
      translation_(wide(body.position) - about) {
  const HullData* hull = polytope_of(shape);
  reach_ = norm(rounded(translation_)) + radius(shape) + (hull ? norm(hull->origin) : 0);
  if (hull) translation_ = translation_ + rotation_ * wide(hull->origin);
}

WideVector WideBody::local(const WideVector& point) const { return apply_transposed(rotation_, point - translation_); }

WidePlane WideBody::in_world(const WidePlane& plane) const {
  const WideVector normal = rotation_ * plane.normal;
  return {normal, plane.offset + dot(normal, translation_)};
}

WidePlane WideBody::tightest(const WideVector& point) const {
  ++planes_asked;
  const WideVector p = local(point);
  return in_world(ask(shape, [&](const auto& s) { return s.wide_tightest(p, triangles_); }));
}

WidePlane WideBody::ray_exit(const WideVector& origin, const WideVector& direction) const {
  ++planes_asked;
  assert(smooth(shape));
  const WideVector o = local(origin), d = apply_transposed(rotation_, direction);
  return in_world(ask(shape, [&](const auto& s) -> WidePlane {
    if constexpr (std::decay_t<decltype(s)>::kSmooth) return s.wide_ray_exit(o, d);
    else return {};
  }));
}

WideVector WideBody::core_support(const WideVector& direction) const {
  const WideVector d = apply_transposed(rotation_, direction);
  return rotation_ * ask(shape, [&](const auto& s) { return s.wide_core_support(d); }) + translation_;
}

WideVector WideBody::support(const WideVector& direction) const {
  return core_support(direction) + DoubleDouble{core_radius(shape)} * unit(direction);
}

void WideBody::append_planes(std::vector<WidePlane>& planes) const {
  ask(shape, [&](const auto& s) { s.append_wide_planes(*this, planes); });
}

void WideBody::append_triangles(double radius, std::vector<WidePlane>& planes) const {
  for (int t = 0; t < triangles_.size(); ++t) planes.push_back(in_world(triangles_.plane(t, radius)));
}

void WideBody::append_planes_across_axes(std::vector<WidePlane>& planes) const {
  for (int i = 0; i < 3; ++i) {
    for (double side : {-1.0, 1.0}) {
      const WideVector normal = rotation_ * (side * tangents::wide_axis(i));
      planes.push_back({normal, dot(normal, support(normal))});
    }
  }
}

}  // namespace overlapper
