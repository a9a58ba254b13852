#include "overlap/depth_gradient.h"

#include <algorithm>
#include <cmath>

#include "overlap/shape_gradient.h"

namespace overlapper {
namespace {

/// The derivatives of the farthest place along a unit direction, in the shape's own axes, by the numbers of the shape.
struct BySize {
  Vec3 along;

  Vec3 operator()(const Sphere&) const { return {1, 0, 0}; }
  Vec3 operator()(const RoundedHull&) const { return {1, 0, 0}; }
  Vec3 operator()(const HalfSpace&) const { return {1, 0, 0}; }
  Vec3 operator()(const Box&) const { return abs(along); }
  Vec3 operator()(const Capsule&) const { return {1, std::abs(along.z) / 2, 0}; }
  Vec3 operator()(const Cylinder&) const { return {std::hypot(along.x, along.y), std::abs(along.z) / 2, 0}; }
  Vec3 operator()(const Ellipsoid& e) const {
    const Vec3 stretched = scaled(e.half_axes, along);
    return 1 / norm(stretched) * scaled(stretched, along);
  }
  template <class Other>
  Vec3 operator()(const Other&) const {
    return {kNoDerivative, kNoDerivative, kNoDerivative};
  }
};

/// Where the bodies touch once they are apart. Farther along the normal, the nearest points stay the same.
Vec3 touching_point(const Overlap& overlap) {
  const Placed &a = overlap.bodies()[0], &b = overlap.bodies()[1];
  const Contact& contact = overlap.contact();
  const double size = !bounded(a.shape)   ? reach(b.shape)
                      : !bounded(b.shape) ? reach(a.shape)
                                          : std::min(reach(a.shape), reach(b.shape));
  const Placed beyond = make_placed(a.shape, a.position + (contact.depth + size) * contact.normal, a.orientation);
  return Overlap(beyond, b, overlap.tolerance(), Method::kAuto).contact().witness_b;
}

}  // namespace

DepthGradient depth_gradient(const Overlap& overlap) {
  DepthGradient found;
  if (overlap.status() != Status::kOverlapping) return found;
  const Vec3 normal = overlap.contact().normal, point = touching_point(overlap);
  for (int i = 0; i < 2; ++i) {
    const Placed& body = overlap.bodies()[i];
    const Vec3 outwards = i == 0 ? -normal : normal, moment = cross(point - body.position, outwards);
    found.pose[i] = {outwards.x, outwards.y, outwards.z, moment.x, moment.y, moment.z};
    found.shape[i] = ask(body.shape, BySize{apply_transposed(body.pose.rotation, outwards)});
  }
  return found;
}

}  // namespace overlapper
