#include "overlap/facet_sections.h"

#include <algorithm>
#include <cmath>

#include "geometry/cancellation.h"
#include "geometry/scratch.h"
#include "geometry/wide_pose.h"
#include "methods/round/pieces/planar_part.h"
#include "methods/round/pieces/stretched.h"

namespace overlapper {
namespace {

using pieces::PlanarPart;
using pieces::WidePolygon;

class OtherBody {
 public:
  OtherBody(const Placed& body, const Placed& flat, Vec3 inside)
      : body_(body), box_(bounds(body)), ellipsoid_(stretched(body.shape)) {
    pieces_->clear();
    pieces::EnclosingPolytope common;
    const bool many = facets(body.shape) > 0;
    if (many) pieces::enclose(std::to_array({&flat, &body}), inside, common);
    pieces::cut(body, flat, many ? &common : nullptr, 0, {}, wide(inside), *pieces_);
    if (ellipsoid_) pieces::into_ball(body, ellipsoid_->half_axes, *pieces_);
    rotation_ = wide_rotation(body.orientation);
    const double margin = 1e-9 * (reach(body.shape) + norm(inside));
    box_ = {box_.lower - inside - margin * Vec3{1, 1, 1}, box_.upper - inside + margin * Vec3{1, 1, 1}};
  }

  bool reaches(const WidePolygon& polygon) const {
    Bounds around{rounded(polygon[0]), rounded(polygon[0])};
    for (const WideVector& p : polygon) around = {min(around.lower, rounded(p)), max(around.upper, rounded(p))};
    const Vec3 gap = max(around.lower - box_.upper, box_.lower - around.upper);
    return max_component(gap) <= 0;
  }

  /// The error of the area also has that of the surfaces, which are `misplaced`.
  PlanarPart part(const WidePolygon& polygon, const WideVector& normal, double misplaced) const {
    PlanarPart found;
    if (!ellipsoid_) {
      pieces::add_planar_part(polygon, normal, *pieces_, found);
      found.error += found.rim * (misplaced + pieces_->misplaced()) + pieces_->gap_area;
      return found;
    }
    const quadric::Stretch stretch(ellipsoid_->half_axes);
    const Vec3 h = stretch.half_axes;
    WidePolygon own;
    for (const WideVector& p : polygon) own.push_back(over(apply_transposed(rotation_, p), h));
    const WideVector turned = apply_transposed(rotation_, normal);
    const WideVector across =
        unit(WideVector{DoubleDouble{h.x} * turned.x, DoubleDouble{h.y} * turned.y, DoubleDouble{h.z} * turned.z});
    pieces::add_planar_part(own, across, *pieces_, found);
    const double scale = stretch.area(rounded(across));
    found.error += found.rim * (misplaced + pieces_->misplaced()) / std::min({h.x, h.y, h.z});
    const Mat3 sizes{{h.x, 0, 0}, {0, h.y, 0}, {0, 0, h.z}}, map = body_.pose.rotation * sizes;
    const Mat3 second = map * found.second * transposed(map);
    return {scale * found.area,
            scale * (map * found.first),
            {scale * second.row0, scale * second.row1, scale * second.row2},
            scale * found.error,
            0};
  }

 private:
  static WideVector over(const WideVector& v, Vec3 by) {
    return {v.x / DoubleDouble{by.x}, v.y / DoubleDouble{by.y}, v.z / DoubleDouble{by.z}};
  }

  const Placed& body_;
  Bounds box_;  ///< about the inner point
  const Ellipsoid* ellipsoid_;
  Scratch<pieces::Pieces> pieces_;
  WideMatrix rotation_;
};

}  // namespace

std::vector<FacetSection> facet_sections(const Overlap& overlap, int body, Vec3 reference) {
  const Placed &flat = overlap.bodies()[body], &round = overlap.bodies()[1 - body];
  const OtherBody within(round, flat, reference);
  const WideMatrix rotation = wide_rotation(flat.orientation);
  const WideVector position = wide_difference(flat.position, reference);
  std::vector<FacetSection> found;
  WidePolygon polygon;
  const auto add = [&](const std::array<int, 3>& corners, const WideVector& normal, double misplaced) {
    cancellation_point();
    if (!within.reaches(polygon)) return;
    const PlanarPart part = within.part(polygon, normal, misplaced);
    if (part.area > 0) found.push_back({corners, rounded(normal), part.area, part.first, part.second, part.error});
  };
  const auto place = [&](const WideVector& local) { polygon.push_back(position + rotation * local); };
  if (const HullData* hull = polytope_of(flat.shape)) {
    const auto at = [&](int v) { return hull->vertices[v]; };
    for (int f = 0; f < static_cast<int>(hull->planes.size()); ++f) {
      const auto ring = hull->facet(f);
      for (size_t i = 1; i + 1 < ring.size(); ++i) {
        const std::array<int, 3> corners{ring[0], ring[i], ring[i + 1]};
        polygon.clear();
        const WideVector normal = unit(wide_normal(at(corners[0]), at(corners[1]), at(corners[2])));
        const WideVector out = DoubleDouble{core_radius(flat.shape)} * normal;
        for (const int v : corners) place(wide(hull->origin) + wide(at(v)) + out);
        add(corners, rotation * normal, hull->flatness);
      }
    }
    return found;
  }
  std::vector<pieces::Wall> walls;
  for (int f = 0; f < facets(flat.shape); ++f) {
    const WidePlane plane = *unit_facet(flat.shape, f);
    const WideVector normal = rotation * plane.normal;
    walls.push_back({normal, plane.offset + dot(normal, position), 0});
  }
  const auto [lower, upper] = bounds(round);
  const WideVector middle = wide((lower - reference) / 2 + (upper - reference) / 2);
  const double size = norm(upper - lower);
  for (size_t f = 0; f < walls.size(); ++f)
    if (pieces::face_within(walls, f, middle, size, polygon)) add({}, walls[f].normal, 0);
  return found;
}

}  // namespace overlapper
