#pragma once

#include <optional>

#include "geometry/vec.h"

namespace overlapper {

/// The area within the line where the surfaces of two bodies cross, seen along the area vector of that line. If a
/// function does not change along this direction, its integral is the same over every surface within the line (Gauss).
struct Patch {
  Vec3 area;    ///< m²: the area vector of the second body's part of the surface; it points to the first body
  Vec3 centre;  ///< of that area, in the plane through the centroid of the volume; NaN without an area
  Mat3 moments{{}, {}, {}};  ///< m⁴: ∫ x xᵀ dA about the centre
  double distance = 0;       ///< m: the mean distance of its points from the centroid; NaN without an area
};

/// The same patch in other coordinates.
inline Patch turned(const Patch& patch, const Mat3& rotation, Vec3 translation) {
  return {rotation * patch.area, rotation * patch.centre + translation, rotation * patch.moments * transposed(rotation),
          patch.distance};
}

/// The area vector of a patch that is seen along a unit direction instead of its own area vector.
inline Vec3 seen_along(Vec3 area, const std::optional<Vec3>& direction) {
  return direction ? dot(area, *direction) * *direction : area;
}

/// The patch that lies in a plane with this unit normal, from the same patch seen along another direction. Its centre
/// is in the plane through the centroid.
Patch lifted(const Patch& seen, Vec3 centroid, Vec3 normal);

/// ∫ |x| dA over the triangle from the origin to the edge from (a, b) to (c, d). Negative if the edge goes clockwise.
double distance_over_edge(double a, double b, double c, double d);

/// The plane that a patch is seen in, with integrals over the patch of 1, u, v, u², uv and v². The coordinates u and v
/// are right-handed, about the centroid. The mean distance is exact if only edges bound the patch. Otherwise the patch
/// counts as an ellipse. The parts of both surfaces have the same ellipse, but not the same mean distance.
class PatchSums {
 public:
  PatchSums(Vec3 centroid, Vec3 area) : origin_(centroid), area_(area), size_(norm(area)) {
    normal_ = size_ > 0 ? area / size_ : Vec3{0, 0, 1};
    u_ = any_orthogonal(normal_);
    v_ = cross(normal_, u_);
  }

  Vec3 origin() const { return origin_; }
  Vec3 normal() const { return normal_; }
  Vec3 u() const { return u_; }
  Vec3 v() const { return v_; }

  /// Adds integrals over a part, or over everything on the left of a line.
  void add(double one, double u, double v, double uu, double uv, double vv) {
    sum(one, u, v, uu, uv, vv);
    edges_alone_ = false;
  }

  /// Adds an edge of the border, counter-clockwise seen against the normal (Green).
  void add_edge(Vec3 from, Vec3 to) {
    const double a = dot(from - origin_, u_), b = dot(from - origin_, v_);
    const double c = dot(to - origin_, u_), d = dot(to - origin_, v_), twice = a * d - b * c;
    sum(twice / 2, twice / 6 * (a + c), twice / 6 * (b + d), twice / 12 * (a * a + a * c + c * c),
        twice / 24 * (a * d + 2 * a * b + 2 * c * d + c * b), twice / 12 * (b * b + b * d + d * d));
    distance_ += distance_over_edge(a, b, c, d);
  }

  /// Adds a triangle with its area vector.
  void add_triangle(Vec3 p, Vec3 q, Vec3 r, Vec3 area) {
    const double w = dot(area, normal_);
    double au[3], av[3];
    int i = 0;
    for (const Vec3 corner : {p, q, r}) au[i] = dot(corner - origin_, u_), av[i] = dot(corner - origin_, v_), ++i;
    const double su = au[0] + au[1] + au[2], sv = av[0] + av[1] + av[2];
    const auto second = [&](const double* x, const double* y, double sums) {
      return w / 12 * (x[0] * y[0] + x[1] * y[1] + x[2] * y[2] + sums);
    };
    add(w, w / 3 * su, w / 3 * sv, second(au, au, su * su), second(au, av, su * sv), second(av, av, sv * sv));
  }

  /// Adds more - less, which both contain this already.
  void add_difference(const PatchSums& more, const PatchSums& less) {
    sum(more.one_ - less.one_, more.u1_ - less.u1_, more.v1_ - less.v1_, more.uu_ - less.uu_, more.uv_ - less.uv_,
        more.vv_ - less.vv_);
    edges_alone_ = false;
  }

  Patch patch() const;

 private:
  void sum(double one, double u, double v, double uu, double uv, double vv) {
    one_ += one, u1_ += u, v1_ += v, uu_ += uu, uv_ += uv, vv_ += vv;
  }

  Vec3 origin_, area_, normal_, u_, v_;
  double size_;
  double one_ = 0, u1_ = 0, v1_ = 0, uu_ = 0, uv_ = 0, vv_ = 0;
  double distance_ = 0;  ///< of the part within edges
  bool edges_alone_ = true;
};

}  // namespace overlapper
