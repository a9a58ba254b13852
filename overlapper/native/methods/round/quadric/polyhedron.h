#pragma once

#include <array>
#include <span>
#include <vector>

#include "geometry/patch.h"
#include "shapes/shape.h"

namespace overlapper::quadric {

/// A convex polyhedron to be intersected with a quadric.
struct Polyhedron {
  std::span<const Vec3> corners;
  std::span<const Plane> planes;
  std::span<const Edge> edges;
  size_t faces = 0;  ///< number of faces, the first planes; at the others, cuts, the surface goes on in the next piece
  double misplaced = 0;  ///< m: movement of corners by rounding, beyond that of their own numbers
};

/// The part of a polyhedron's face inside a quadric.
struct Section {
  double area = 0;
  Vec3 first;              ///< ∫ x dA
  Vec3 squares, products;  ///< ∫ x², y², z² dA and ∫ yz, zx, xy dA; for a ball only if they are wanted

  /// Adds c (p qᵀ + q pᵀ) to the second moments.
  void add_second(double c, Vec3 p, Vec3 q) {
    squares += 2 * c * scaled(p, q);
    products += c * Vec3{p.y * q.z + p.z * q.y, p.z * q.x + p.x * q.z, p.x * q.y + p.y * q.x};
  }
  /// ∫ (p · x) (q · x) dA.
  double second(Vec3 p, Vec3 q) const {
    return dot(squares, scaled(p, q)) + products.x * (p.y * q.z + p.z * q.y) + products.y * (p.z * q.x + p.x * q.z) +
           products.z * (p.x * q.y + p.y * q.x);
  }
};

/// How a patch sees sections: its coordinates are u0 + u · x and v0 + v · x, and an area vector counts by its component
/// along `normal`.
struct SectionView {
  double u0 = 0, v0 = 0;
  Vec3 u, v, normal;

  SectionView() = default;
  /// The sections are about the point `origin`, along axes that `rotation` turns to the world. Those of the first body
  /// are seen from behind.
  SectionView(const PatchSums& patch, Vec3 origin, const Mat3& rotation, bool of_first = false)
      : u0(dot(origin - patch.origin(), patch.u())),
        v0(dot(origin - patch.origin(), patch.v())),
        u(apply_transposed(rotation, patch.u())),
        v(apply_transposed(rotation, patch.v())),
        normal((of_first ? -1.0 : 1.0) * apply_transposed(rotation, patch.normal())) {}

  /// The view of sections about a centre, along the rows of `turn`.
  SectionView about(Vec3 centre, const Mat3& turn) const {
    SectionView view;
    view.u0 = u0 + dot(centre, u), view.v0 = v0 + dot(centre, v);
    view.u = turn * u, view.v = turn * v, view.normal = turn * normal;
    return view;
  }

  /// Adds a section by a plane with this unit normal.
  void add(const Section& s, Vec3 plane, PatchSums& patch) const {
    const double w = dot(plane, normal), a = s.area, fu = dot(s.first, u), fv = dot(s.first, v);
    patch.add(w * a, w * (u0 * a + fu), w * (v0 * a + fv), w * (u0 * (u0 * a + 2 * fu) + s.second(u, u)),
              w * (u0 * (v0 * a + fv) + v0 * fu + s.second(u, v)), w * (v0 * (v0 * a + 2 * fv) + s.second(v, v)));
  }
};

/// A convex polyhedron as the corners around each of its faces, counter-clockwise from outside. Planes can cut it.
class Rings {
 public:
  /// Becomes a placed box or hull; false for other shapes.
  bool become(const Shape& shape, const Pose& pose);
  /// Starts another polyhedron, to be added face by face.
  void clear() { corners_.clear(), planes_.clear(), ring_.clear(), start_.assign(1, 0), cuts_ = 0; }
  void add_corner(Vec3 at) { corners_.push_back(at); }
  void add_face(const Plane& plane, std::span<const int> ring) {
    planes_.push_back(plane);
    ring_.insert(ring_.end(), ring.begin(), ring.end());
    start_.push_back(static_cast<int>(ring_.size()));
  }
  /// Keeps the part below the height, or the part above it; false if rounding has made a face non-convex.
  bool cut(double height, bool keep_below);

  bool empty() const { return planes_.empty(); }
  std::span<const Vec3> corners() const { return corners_; }
  std::span<const Plane> planes() const { return planes_; }
  std::span<const int> ring(size_t face) const {
    return std::span(ring_).subspan(start_[face], start_[face + 1] - start_[face]);
  }
  /// Whether a plane is a face, and not a cut.
  bool face(size_t plane) const { return plane < planes_.size() - cuts_; }
  /// The polyhedron with its edges; valid until the rings change.
  Polyhedron polyhedron();

 private:
  int between(int above, int below, double height);
  template <class Outside>
  bool cut_face(size_t f, double height, int before, Outside outside);
  bool close_cut(const Plane& plane, int before);

  std::vector<Vec3> corners_;
  std::vector<Plane> planes_;
  std::vector<int> ring_, start_;
  size_t cuts_ = 0;
  std::vector<Edge> edges_;
  std::vector<Vec3> left_;
  // Work space.
  std::vector<Plane> kept_;
  std::vector<int> kept_ring_, kept_start_, after_, number_;
  std::vector<std::array<int, 3>> crossed_;  ///< the upper and the lower end of each cut edge, and the corner there
};

}  // namespace overlapper::quadric
