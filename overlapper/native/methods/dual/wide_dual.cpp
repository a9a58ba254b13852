#include "methods/dual/wide_dual.h"

#include "geometry/cancellation.h"
#include "geometry/wide_pose.h"

namespace overlapper {
namespace {

/// Makes the dual points of one body. It maps the frame's origin and axes to the body's own coordinates once, and
/// leaves the body's planes unchanged.
class BodyDuals {
 public:
  BodyDuals(const Placed& body, int owner, Vec3 reference, const Frame& frame)
      : owner_(owner), rotation_(wide_rotation(body.orientation)) {
    const WideVector from_body = wide_difference(reference, body.position) + wide(frame.origin);
    origin_ = apply_transposed(rotation_, from_body);
    if (const HullData* hull = polytope_of(body.shape)) origin_ = origin_ - wide(hull->origin);
    const Mat3 columns = transposed(frame.axes);
    axis_ = {apply_transposed(rotation_, wide(columns.row0)), apply_transposed(rotation_, wide(columns.row1)),
             apply_transposed(rotation_, wide(columns.row2))};
  }

  /// True if the plane of a triangle is certainly farther from the origin than `reach` in the frame. Uses doubles with
  /// an error bound, which decide for most planes of a large mesh.
  bool far(Vec3 a, Vec3 b, Vec3 c, double reach) const {
    const Vec3 normal = cross(b - a, c - a), away = a - rounded(origin_);
    const double slack = dot(normal, away) - 0x1p-46 * norm(b - a) * norm(c - a) * (norm(a) + norm(away));
    const Vec3 along{dot(rounded(axis_.row0), normal), dot(rounded(axis_.row1), normal),
                     dot(rounded(axis_.row2), normal)};
    return slack > 2 * reach * norm(along);
  }

  /// The dual of the plane through a point with that normal of any length; and of a plane with a normal of any length.
  WideDual through(const WideVector& normal, Vec3 point) const {
    return make(normal, dot(normal, wide(point) - origin_));
  }
  WideDual at(const WidePlane& plane) const { return make(plane.normal, plane.offset - dot(plane.normal, origin_)); }

 private:
  WideDual make(const WideVector& normal, DoubleDouble slack) const {
    const Vec3 direction = rounded(rotation_ * normal);
    const WideVector along = axis_ * normal;
    return {rounded({along.x / slack, along.y / slack, along.z / slack}), unit(direction), slack.head / norm(direction),
            owner_};
  }

  int owner_;
  WideMatrix rotation_;
  WideVector origin_;  ///< of the frame, in the body's coordinates
  WideMatrix axis_;    ///< of the frame, by rows, in the body's coordinates
};

}  // namespace

std::vector<WideDual> wide_duals(std::span<const Placed> bodies, Vec3 reference, const Frame& frame, double reach) {
  std::vector<WideDual> duals;
  for (int i = 0; i < static_cast<int>(bodies.size()); ++i) {
    const BodyDuals body(bodies[i], i, reference, frame);
    if (const HullData* hull = polytope_of(bodies[i].shape)) {
      for (const auto& [a, b, c] : hull->triangles) {
        cancellation_point();
        const std::vector<Vec3>& corner = hull->corners;
        if (body.far(corner[a], corner[b], corner[c], reach)) continue;
        duals.push_back(body.through(wide_normal(corner[a], corner[b], corner[c]), corner[a]));
      }
      continue;
    }
    for (int f = 0; f < facets(bodies[i].shape); ++f) duals.push_back(body.at(*wide_facet(bodies[i].shape, f)));
  }
  return duals;
}

}  // namespace overlapper
