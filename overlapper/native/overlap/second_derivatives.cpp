#include "overlap/second_derivatives.h"

#include <algorithm>
#include <array>
#include <cfloat>
#include <cmath>

#include "geometry/cancellation.h"
#include "geometry/ridges.h"
#include "methods/round/seam/seam.h"
#include "overlap/shape_gradient.h"

namespace overlapper {
namespace {

constexpr int kPose = 6;

/// How fast a point of a facet moves out, by each number of a body.
using Speeds = std::array<double, kNumbersOfBody>;

/// A facet of the common polytope, with the numbers of its owner.
struct MovingFacet {
  int owner;
  Vec3 normal;
  Vec3 size;  ///< speeds by the numbers of the owner's shape

  /// `lever` leads from the position of a body to the point.
  Speeds speeds(Vec3 lever) const {
    const Vec3 turning = cross(lever, normal);
    return {normal.x, normal.y, normal.z, turning.x, turning.y, turning.z, size.x, size.y, size.z};
  }
};

/// Sums over a seam. Places are about an origin, and `levers` lead to it from the position of each body.
class SumsOverSeam {
 public:
  /// The origin is at `place` about `reference`.
  SumsOverSeam(std::span<const Placed> bodies, Vec3 reference, Vec3 place)
      : bodies_(bodies), width_(kNumbersOfBody * bodies.size()), sums_(width_ * width_, 0) {
    for (const Placed& body : bodies) levers_.push_back(reference - body.position + place);
  }

  void add_at_seam(const MovingFacet& one, const MovingFacet& two, Vec3 x, double cosine, double weight) {
    const size_t a = one.owner, b = two.owner;
    const Speeds p = one.speeds(levers_[a] + x), q = two.speeds(levers_[b] + x);
    for (int k = 0; k < kNumbersOfBody; ++k)
      for (int l = 0; l < kNumbersOfBody; ++l) add_pair(a, k, b, l, weight * p[k] * q[l]);
    add_own(a, p, two.speeds(levers_[a] + x), cosine, weight);
    add_own(b, q, one.speeds(levers_[b] + x), cosine, weight);
  }

  /// The derivatives by two numbers of one body, at its seam with a facet that stays. `against` are the speeds of that
  /// facet if it moves along.
  void add_own(size_t body, const Speeds& own, const Speeds& against, double cosine, double weight) {
    for (int k = 0; k < kPose; ++k)
      for (int l = 0; l < kPose; ++l) add_pair(body, k, body, l, -weight / 2 * own[k] * against[l]);
    for (int k = kPose; k < kNumbersOfBody; ++k) {
      for (int l = 0; l < kPose; ++l) add_pair(body, k, body, l, -weight * cosine * own[k] * own[l]);
      for (int l = kPose; l < kNumbersOfBody; ++l) at(body, k, body, l) -= weight * cosine * own[k] * own[l];
    }
  }

  /// Adds what the turning of the area vectors adds.
  void add_turning(std::span<const std::array<double, 6>> gradient) {
    for (size_t i = 0; i < bodies_.size(); ++i) {
      const auto& row = gradient[i];
      const Vec3 force{row[0], row[1], row[2]};
      // dot(t, cross(r, F)), half of it on either side of the diagonal.
      for (int k = 0; k < 3; ++k) {
        const int after = (k + 1) % 3, before = (k + 2) % 3;
        add_pair(i, k, i, 3 + after, force[before] / 2);
        add_pair(i, k, i, 3 + before, -force[after] / 2);
      }
    }
  }

  std::vector<double> take() { return std::move(sums_); }

 protected:
  double& at(size_t body, int k, size_t other, int l) {
    return sums_[(kNumbersOfBody * body + k) * width_ + kNumbersOfBody * other + l];
  }
  void add_pair(size_t body, int k, size_t other, int l, double value) {
    at(body, k, other, l) += value, at(other, l, body, k) += value;
  }

  std::span<const Placed> bodies_;
  size_t width_;
  std::vector<double> sums_;
  std::vector<Vec3> levers_;
};

class SumsOverPolytope : public SumsOverSeam {
 public:
  explicit SumsOverPolytope(const Overlap& overlap)
      : SumsOverSeam(overlap.bodies(), overlap.drawn().reference, overlap.drawn().frame.origin),
        region_(overlap.drawn()) {
    for (const Region::Facet& facet : region_.facets) {
      const Shape& shape = bodies_[facet.owner].shape;
      Vec3 size;
      if (std::holds_alternative<Box>(shape)) {
        const int axis = axis_across(bodies_[facet.owner], facet.normal);
        size = {axis == 0 ? 1.0 : 0, axis == 1 ? 1.0 : 0, axis == 2 ? 1.0 : 0};
      }
      if (!bounded(shape)) size = {1, 0, 0};
      facets_.push_back({facet.owner, facet.normal, size});
    }
    for (Vec3 y : region_.polytope.vertices) corners_.push_back(region_.frame.axes * y);
  }

  std::vector<double> sums(std::span<const std::array<double, 6>> gradient) {
    if (flush()) return std::vector<double>(sums_.size(), kNoDerivative);
    const Ridges ridges(region_.polytope);
    for (int f = 0; f < region_.polytope.facets(); ++f) {
      cancellation_point();
      const auto ring = region_.polytope.facet(f);
      for (size_t i = 0; i < ring.size(); ++i) {
        const int from = ring[i], to = ring[(i + 1) % ring.size()], other = ridges.left_of(to, from);
        if (f < other) add_edge(facets_[f], facets_[other], corners_[from], corners_[to]);
      }
    }
    add_turning(gradient);
    return take();
  }

 private:
  /// True if a facet lies in the plane of another body's facet, but for rounding.
  bool flush() const {
    std::vector<Plane> planes;
    double farthest = 0;
    for (Vec3 corner : corners_) farthest = std::max(farthest, norm(corner));
    for (size_t b = 0; b < bodies_.size(); ++b) {
      const Placed relative = bodies_[b].seen_from(region_.reference);
      planes.clear();
      append_planes(relative.shape, planes);
      for (const Plane& own : planes) {
        cancellation_point();
        const Plane plane = relative.pose * own;
        const double slack = -signed_distance(plane, region_.frame.origin);
        for (int f = 0; f < region_.polytope.facets(); ++f) {
          const Region::Facet& facet = region_.facets[f];
          if (facet.owner == static_cast<int>(b) || !(dot(facet.normal, plane.normal) > 0)) continue;
          const double within = 4 * facet.rounding + 16 * DBL_EPSILON * (farthest + std::abs(plane.offset));
          const auto ring = region_.polytope.facet(f);
          if (std::ranges::all_of(ring,
                                  [&](int v) { return std::abs(slack - dot(plane.normal, corners_[v])) <= within; }))
            return true;
        }
      }
    }
    return false;
  }

  /// Adds the edge between two facets by Gauss's two nodes, which are exact for products of two linear functions.
  void add_edge(const MovingFacet& one, const MovingFacet& two, Vec3 from, Vec3 to) {
    const double sine = norm(cross(one.normal, two.normal)), cosine = dot(one.normal, two.normal);
    const double length = norm(to - from);
    if (!(sine > 0 && length > 0)) return;
    const double node = std::sqrt(1.0 / 12);
    for (const double share : {0.5 - node, 0.5 + node}) {
      const Vec3 x = from + share * (to - from);
      if (one.owner != two.owner) {
        add_at_seam(one, two, x, cosine, length / 2 / sine);
      } else if (std::holds_alternative<Box>(bodies_[one.owner].shape)) {
        add_at_edge_of_box(one, two, x, length / 2 / sine);
      }
    }
  }

  void add_at_edge_of_box(const MovingFacet& one, const MovingFacet& two, Vec3 x, double weight) {
    const size_t body = one.owner;
    const Speeds p = one.speeds(levers_[body] + x), q = two.speeds(levers_[body] + x);
    for (int k = kPose; k < kNumbersOfBody; ++k) {
      for (int l = 0; l < kPose; ++l) add_pair(body, k, body, l, weight * (p[k] * q[l] + q[k] * p[l]));
      for (int l = kPose; l < kNumbersOfBody; ++l) at(body, k, body, l) += weight * (p[k] * q[l] + q[k] * p[l]);
    }
  }

  const Region& region_;
  std::vector<MovingFacet> facets_;
  std::vector<Vec3> corners_;  ///< about the frame's origin
};

/// NaN for the numbers of shapes.
std::vector<double> of_round_pair(const Overlap& overlap) {
  constexpr size_t kWidth = 2 * kNumbersOfBody;
  std::vector<double> none(kWidth * kWidth, kNoDerivative);
  const std::span<const Placed> bodies = overlap.bodies();
  const Vec3 inside = overlap.centroid();
  const auto points = seam::seam_of(bodies[0], bodies[1], inside);
  if (!points) return none;
  SumsOverSeam sums(bodies, inside, {});
  for (const seam::SeamPoint& point : *points)
    sums.add_at_seam({0, point.outward[0], {}}, {1, point.outward[1], {}}, point.place, 0, point.weight);
  sums.add_turning(overlap.gradient());
  std::vector<double> found = sums.take();
  for (size_t k = 0; k < kWidth; ++k)
    for (size_t l = 0; l < kWidth; ++l)
      if (k % kNumbersOfBody >= kPose || l % kNumbersOfBody >= kPose) found[k * kWidth + l] = kNoDerivative;
  return found;
}

}  // namespace

std::vector<double> second_derivatives(const Overlap& overlap) {
  const size_t width = kNumbersOfBody * overlap.bodies().size();
  if (overlap.status() != Status::kOverlapping) return std::vector<double>(width * width, 0);
  if (polyhedral(overlap.bodies())) return SumsOverPolytope(overlap).sums(overlap.gradient());
  return overlap.pair() ? of_round_pair(overlap) : std::vector<double>(width * width, kNoDerivative);
}

std::vector<double> pose_hessian(const Overlap& overlap) {
  const size_t bodies = overlap.bodies().size(), width = kNumbersOfBody * bodies, poses = kPose * bodies;
  const std::vector<double> all = second_derivatives(overlap);
  std::vector<double> found;
  found.reserve(poses * poses);
  for (size_t k = 0; k < poses; ++k)
    for (size_t l = 0; l < poses; ++l)
      found.push_back(all[(k / kPose * kNumbersOfBody + k % kPose) * width + l / kPose * kNumbersOfBody + l % kPose]);
  return found;
}

}  // namespace overlapper
