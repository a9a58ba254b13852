#pragma once

#include <array>
#include <vector>

#include "methods/round/quadric/gauss.h"
#include "methods/round/seam/seam.h"
#include "methods/round/slicing/wall.h"

namespace overlapper::seam {

/// The surface { x : |k x|² − 2 dot(b, x) + slack = 0 } of a ball, a cylinder or an ellipsoid about the inner point.
/// The slack is small if the surface is near the inner point, and has digits of its own.
struct Quadric {
  Mat3 k;
  Vec3 b;
  double slack = 0;
  bool cylinder = false, ball = false;
  Vec3 centre;        ///< the nearest point of the axis of a cylinder
  Vec3 axis;          ///< of a cylinder, unit
  double radius = 0;  ///< of a ball or a cylinder
  Mat3 stretch;       ///< of a ball or an ellipsoid: maps the unit ball to it
  double value(Vec3 x) const { return norm2(k * x) - 2 * dot(b, x) + slack; }
  Vec3 gradient(Vec3 x) const { return apply_transposed(k, k * x) - b; }  ///< half of it
};

Quadric quadric_of(const slicing::Round& round);
Quadric quadric_of(const Placed& ellipsoid, Vec3 half_axes, Vec3 inside);

/// { x : dot(normal, x) <= slack }.
struct Face {
  Vec3 normal;
  double slack;
  int owner;  ///< slicing::kCut for a cut between two pieces of one body
};

/// The common part of a piece of each body. Adds the nodes of its seam.
class Part {
 public:
  std::vector<slicing::Wall> walls;
  std::array<const Quadric*, 2> round{};  ///< of each body's piece, if any
  double extent = 0;                      ///< m: upper bound of the distance of common points from the inner point
  double misplaced = 0;                   ///< m: error of surfaces

  void add(std::vector<SeamPoint>& points);
  /// Surfaces of both bodies coincide or touch along a line.
  bool touching() const { return touching_; }

  /// The two surfaces that cross in a line of the seam: numbers of walls, and kRound for a quadric.
  using Sides = std::array<int, 2>;
  static constexpr int kRound = -1;

  /// Whether a point of the line is on the border of the common part.
  bool holds(Vec3 x, Sides sides);
  const std::vector<Face>& faces() const { return faces_; }
  /// The quadric that bounds a line in a face: that of the face's own piece, if any.
  const Quadric* beside(Sides sides) const;
  void touch() { touching_ = true; }

  /// Adds the arcs in which the cylinder of a body ends at cuts. The body has the walls from one number to the other.
  void add_rims(int body, size_t first, size_t last, std::vector<SeamPoint>& points);

 private:
  void add_ridge(int of_first, int of_second, std::vector<SeamPoint>& points);
  bool coincide(const Quadric& a, const Quadric& b) const;
  bool anything() const;

  std::vector<Face> faces_;
  int rim_of_ = -1;                        ///< the body, while its arcs are added
  std::vector<std::array<int, 2>> flush_;  ///< faces of both bodies in one plane
  bool touching_ = false;
};

/// Adds the crossing of the plane of a face with a quadric.
void add_section(Part& part, int face, const Quadric& quadric, std::vector<SeamPoint>& points);
/// Adds the crossing of two balls, or of two parallel cylinders.
void add_radical(Part& part, std::vector<SeamPoint>& points);
/// Adds the crossing of a cylinder, which is the round of body `number`, with the other round.
void add_on_cylinder(Part& part, int number, std::vector<SeamPoint>& points);
/// Adds the crossing of two ellipsoids, or of an ellipsoid and a ball.
void add_followed(Part& part, std::vector<SeamPoint>& points);

/// Adds nodes of a smooth line between two values of its parameter. at(t) is a SeamPoint with the weight per t.
template <class At>
class Quadrature {
 public:
  Quadrature(const At& at, std::vector<SeamPoint>& points) : at_(at), points_(points) {}

  /// False if the line is not smooth.
  bool add(double low, double high) {
    rules_ = 0;
    return refine(low, high, apply(low, high), kMostHalvings);
  }

 private:
  static constexpr int kMostHalvings = 24, kMostRules = 2000;
  static constexpr double kError = 1e-12;
  struct Panel {
    std::array<SeamPoint, 16> node;
    std::array<Vec3, 3> sum{};
    double size = 0, blur = 0;
  };

  Panel apply(double low, double high) const {
    Panel panel;
    const double middle = low / 2 + high / 2, half = (high - low) / 2;
    for (int i = 0; i < 16; ++i) {
      const int k = i / 2;
      SeamPoint point = at_(middle + (i % 2 == 0 ? -half : half) * quadric::kGaussNode[k]);
      point.weight *= half * quadric::kGaussWeight[k];
      const Vec3 n = point.weight * point.outward[0], m = point.outward[1];
      panel.sum[0] += n.x * m, panel.sum[1] += n.y * m, panel.sum[2] += n.z * m;
      panel.size += norm(n) * norm(m), panel.blur += norm(n) * norm(m) * point.blur;
      panel.node[i] = point;
    }
    return panel;
  }

  bool refine(double low, double high, const Panel& whole, int halvings) {
    if (++rules_ > kMostRules) return false;
    const double middle = low / 2 + high / 2;
    const Panel left = apply(low, middle), right = apply(middle, high);
    double error = 0;
    for (int i = 0; i < 3; ++i) error += norm(whole.sum[i] - left.sum[i] - right.sum[i]);
    size_ = std::max(size_, left.size + right.size);
    if (halvings > 0 && error > kError * size_ + left.blur + right.blur) {
      return refine(low, middle, left, halvings - 1) && refine(middle, high, right, halvings - 1);
    }
    for (const Panel* half : {&left, &right}) points_.insert(points_.end(), half->node.begin(), half->node.end());
    return true;
  }

  const At& at_;
  std::vector<SeamPoint>& points_;
  double size_ = 0;
  int rules_ = 0;
};

}  // namespace overlapper::seam
