#include "distance/portal.h"

#include "distance/simplex.h"

namespace overlapper {
namespace {

class Refinement {
 public:
  Refinement(const Mesh& a, const Mesh& b, const Pose& pose, double doubt)
      : a_(a), b_(b), pose_(pose), doubt_(doubt), inner_{a.data().centroid, pose * b.data().centroid} {}

  Portal run() {
    if (!surround_ray()) return portal_;
    for (int round = 0; round < kMaxRounds; ++round) {
      const Vec3 first = corner_[0].difference();
      const Vec3 outward = cross(corner_[1].difference() - first, corner_[2].difference() - first);
      if (dot(outward, first) >= 0) {
        stop_inside(outward);
        break;
      }
      const DifferencePoint farther = support(outward);
      if (separates(farther, outward)) break;
      const double moved = dot(outward, farther.difference() - first);
      if (!(moved > doubt_ * std::sqrt(norm2(outward)))) break;
      narrow(farther);
    }
    return portal_;
  }

 private:
  static constexpr int kMaxRounds = 128;

  DifferencePoint support(Vec3 direction) const {
    const int i = a_.graph().farthest_vertex(a_.data(), direction);
    const int j = b_.graph().farthest_vertex(b_.data(), -apply_transposed(pose_.rotation, direction));
    return {a_.data().vertices[i], pose_ * b_.data().vertices[j]};
  }

  /// True if the search ends because all of A - B lies on the far side of a plane, or too near to decide.
  bool separates(const DifferencePoint& farthest, Vec3 direction) {
    const double reached = dot(farthest.difference(), direction);
    if (reached > 0) return false;
    if (-reached > doubt_ * std::sqrt(norm2(direction))) portal_.answer = Portal::Answer::kApart;
    return true;
  }

  /// Finds three support points around the ray. False if the search ends here, with an answer or without.
  bool surround_ray() {
    const Vec3 inner = inner_.difference();
    corner_[0] = support(-inner);
    if (separates(corner_[0], -inner)) return false;
    Vec3 direction = cross(corner_[0].difference(), inner);
    if (!(norm2(direction) > 0x1p-80 * norm2(inner) * norm2(inner))) direction = any_orthogonal(unit(inner));
    corner_[1] = support(direction);
    if (separates(corner_[1], direction)) return false;
    direction = cross(corner_[0].difference() - inner, corner_[1].difference() - inner);
    if (dot(direction, inner) > 0) {
      std::swap(corner_[0], corner_[1]);
      direction = -direction;
    }
    for (int round = 0; round < kMaxRounds; ++round) {
      corner_[2] = support(direction);
      if (separates(corner_[2], direction)) return false;
      const Vec3 third = corner_[2].difference();
      if (dot(cross(corner_[0].difference(), third), inner) < 0) {
        corner_[1] = corner_[2];
      } else if (dot(cross(third, corner_[1].difference()), inner) < 0) {
        corner_[0] = corner_[2];
      } else {
        return true;
      }
      direction = cross(corner_[0].difference() - inner, corner_[1].difference() - inner);
    }
    return false;
  }

  /// Replaces one corner of the portal by the new corner, so that the ray still leaves through the portal.
  void narrow(const DifferencePoint& farther) {
    const Vec3 across = cross(farther.difference(), inner_.difference());
    if (dot(corner_[0].difference(), across) > 0) {
      corner_[dot(corner_[1].difference(), across) > 0 ? 0 : 2] = farther;
    } else {
      corner_[dot(corner_[2].difference(), across) > 0 ? 1 : 0] = farther;
    }
  }

  /// The origin as a combination of the inner point and the corners; the weights are fractions of volume.
  void stop_inside(Vec3 outward) {
    const Vec3 o = inner_.difference(), p = corner_[0].difference(), q = corner_[1].difference(),
               r = corner_[2].difference();
    const double at_inner = std::max(0.0, dot(outward, p)), at_p = std::max(0.0, dot(cross(r, q), o)),
                 at_q = std::max(0.0, dot(cross(p, r), o)), at_r = std::max(0.0, dot(cross(q, p), o));
    const double sum = at_inner + at_p + at_q + at_r;
    if (!(sum > 0)) return;
    portal_.point =
        (at_inner * inner_.on_a + at_p * corner_[0].on_a + at_q * corner_[1].on_a + at_r * corner_[2].on_a) / sum;
    portal_.normal = outward;
    portal_.answer = Portal::Answer::kCommon;
  }

  const Mesh &a_, &b_;
  Pose pose_;
  double doubt_;
  DifferencePoint inner_;
  std::array<DifferencePoint, 3> corner_;
  Portal portal_;
};

}  // namespace

Portal find_portal(const Mesh& a, const Mesh& b, const Pose& pose, double doubt) {
  const Vec3 centre_a = a.data().centroid, centre_b = pose * b.data().centroid;
  const Vec3 between = centre_b - centre_a;
  const double apart2 = norm2(between), near = std::max(a.graph().inradius, b.graph().inradius) / 2;
  // A centroid deep inside the other body is a common point.
  if (apart2 < near * near) {
    const Vec3 point = a.graph().inradius > b.graph().inradius ? centre_b : centre_a;
    return {Portal::Answer::kCommon, point, apart2 > 0 ? between : Vec3{1, 0, 0}};
  }
  return Refinement(a, b, pose, doubt).run();
}

}  // namespace overlapper
