#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "geometry/moments.h"
#include "methods/round/quadric/stretch.h"
#include "methods/round/slicing/wall.h"

namespace overlapper::slicing {

/// The largest number of rounds of a stack: two cylinders that are not parallel, and a ball.
inline constexpr int kMostRounds = 3;

/// A point of a slice.
struct Point {
  double x = 0, y = 0;
};
inline Point operator+(Point a, Point b) { return {a.x + b.x, a.y + b.y}; }
inline Point operator-(Point a, Point b) { return {a.x - b.x, a.y - b.y}; }
inline Point operator*(double s, Point a) { return {s * a.x, s * a.y}; }
inline double dot(Point a, Point b) { return a.x * b.x + a.y * b.y; }
inline double norm(Point a) { return std::sqrt(dot(a, a)); }
inline double cross(Point a, Point b) { return a.x * b.y - a.y * b.x; }

/// The largest number of lines around a slice. Bodies with more planes, even after cuts, are measured in another way.
inline constexpr int kMostLines = 72;
inline constexpr size_t kMostWalls = kMostLines - 4;  ///< of a stack, which is inside a square

/// A quadric in coordinates (x, y, t) about a point of the common set: a ball, or a cylinder with its axis in the
/// slices. X = x l + y m + t T with T · n = 1, so t is the distance between slices, and T may be oblique. Seen along
/// its axis, a cylinder is a disc with the one coordinate `across` · (x, y).
struct Quadric {
  bool ball = false;
  int owner = 0;
  double radius = 0;
  Point across;                          ///< for a cylinder: the unit vector orthogonal to the axis
  Point shear;                           ///< components of T along l and m; for a cylinder only x, along `across`
  Point centre;                          ///< of a ball at t = 0; for a cylinder only x, along `across`
  double along = 0;                      ///< dot(T, centre), in the plane orthogonal to the axis
  double slack = 0;                      ///< |centre|² − radius²: not positive if the origin is inside
  double low = 0, high = 0;              ///< slices exist between these values of t
  double level = 0;                      ///< t of its centre
  static constexpr double kPole = 1e-6;  ///< squared side over the terms: below it, a difference is as accurate

  double half_chord2(double t) const { return (t - low) * (high - t); }
  /// The part of value() that does not depend on x and y, and the size of its terms.
  double constant(double t) const { return (1 + dot(shear, shear)) * t * t - 2 * along * t + slack; }
  double terms(double t) const { return (1 + dot(shear, shear)) * t * t + std::abs(2 * along * t) + std::abs(slack); }
  /// The root of y² − 2 middle y + constant that is nearer to zero, from the other root, without a difference. Near an
  /// end of the quadric, this root is smaller than the rounding of the constant, and a difference gives it.
  double nearer(double far, double middle, double constant, double t) const {
    return far * far > kPole * terms(t) ? constant / far : 2 * middle - far;
  }
  /// The value of |X − centre|² − radius² at a point of the slice's coordinates.
  double value(Point p, double t) const {
    const Point q = ball ? p : Point{dot(across, p), 0};
    return dot(q, q) - 2 * dot(q, centre) + 2 * dot(shear, q) * t + constant(t);
  }
};

/// A line of the slices: dot(normal, x) <= side(t). For a plane, side(t) = offset − rate t.
struct Line {
  Point normal;
  double length = 1;  ///< of the normal
  double offset = 0, rate = 0;
  int quadric = -1;   ///< the cylinder, if the line is a side of one
  bool upper = true;  ///< along `across` of the cylinder, or against it
  int owner = kCut;   ///< the body
  Vec3 face;          ///< the plane's unit normal in the world
  Point normal_tail;  ///< the rounding error of the plane's normal as a double
  double offset_tail = 0, rate_tail = 0;
};

/// The crossing of two lines, from their sides: the foot of the nearer line, and a step along that line to the other
/// one. The point lies on both lines but for the rounding of their sides. This also holds if the lines are nearly
/// parallel, or if one is much farther away.
struct LineCorner {
  struct Base {
    Point foot, way;
    double share, inverse;
  };
  std::array<Base, 2> base;
  std::array<double, 2> length;

  LineCorner(const Line& first, const Line& second) : length{first.length, second.length} {
    const Point a = first.normal, b = second.normal;
    const double both = dot(a, b), inverse = 1 / cross(a, b);
    base[0] = about(a, first.length, both, inverse), base[1] = about(b, second.length, both, -inverse);
  }
  Point operator()(double first_side, double second_side) const {
    const bool second = std::abs(second_side) * length[0] < std::abs(first_side) * length[1];
    const Base& nearer = base[second];
    const double side = second ? second_side : first_side, other = second ? first_side : second_side;
    const double along = (other - nearer.share * side) * nearer.inverse;
    return {side * nearer.foot.x + along * nearer.way.x, side * nearer.foot.y + along * nearer.way.y};
  }

 private:
  static Base about(Point normal, double length, double both, double inverse) {
    const double square = length * length;
    return {(1 / square) * normal, {-normal.y, normal.x}, both / square, inverse};
  }
};

/// A surface seen along a direction, in coordinates u and v across it.
struct View {
  int owner = 0;      ///< of the surface
  bool rest = false;  ///< shows all other surfaces from behind instead; these have no arcs if the owner has arcs
  double u0 = 0, v0 = 0;
  Vec3 u, v;    ///< gradients of u and v along x, y and t
  Vec3 normal;  ///< against the direction, along l, m and n

  bool sees(int of_owner) const { return (of_owner == owner) != rest; }
};

/// The common set of a polytope, at most two cylinders and at most one ball, as a stack of slices.
struct Stack {
  std::array<Line, kMostLines + 8> line;
  int lines = 0;
  std::array<Quadric, kMostRounds> quadric;
  int quadrics = 0;
  int ball = -1;                              ///< number of the ball among the quadrics, or -1
  double low = 0, high = 0;                   ///< slices lie between these values of t, if there are any
  std::optional<Line> low_plane, high_plane;  ///< planes parallel to the slices that end the stack, if any
  std::vector<Line> farther;                  ///< planes parallel to the slices, but for a tilt, beyond these ends
  Vec3 l, m, n, t;                            ///< the axes, in the world
  Point shear;                                ///< components of t along l and m
  std::optional<View> view;                   ///< set if a surface is viewed
  const quadric::Stretch* stretch = nullptr;  ///< for an ellipsoid: maps the ball and all else to the world
  bool areas = true;                          ///< wanted; otherwise, those of an ellipsoid are bounds
  bool cuts = false;                          ///< cuts through bodies are also integrated accurately

  /// The stretched area of a part of a plane with the area vector `normal` along l, m and n.
  double area(Vec3 normal) const { return stretch->area(normal.x * l + normal.y * m + normal.z * n); }
  /// place × normal, all along l, m and n; in the world if stretched.
  Vec3 moment(Vec3 place, Vec3 normal) const {
    if (!stretch) return cross(place, normal);
    const auto in_world = [&](Vec3 v) { return v.x * l + v.y * m + v.z * n; };
    const Vec3 found = stretch->moment(in_world(place), in_world(normal));
    return {dot(l, found), dot(m, found), dot(n, found)};
  }
};

/// The lines and the disc of one slice.
struct Slice {
  explicit Slice(const Stack& stack_, double t_);

  const Stack& stack;
  double t;
  std::array<double, kMostRounds> half_chord{}, upper{}, lower{};  ///< per quadric; upper and lower only for cylinders
  Point centre;                                                    ///< of the disc
  double slack = 0, radius = 0;                                    ///< |centre|² − radius²

  double side(int line) const {
    const Line& l = stack.line[line];
    if (l.quadric < 0) return l.offset - l.rate * t;
    return l.upper ? upper[l.quadric] : -lower[l.quadric];
  }
  Point corner(int first, int second) const {
    return LineCorner(stack.line[first], stack.line[second])(side(first), side(second));
  }
};

/// The border of a slice, counter-clockwise: pieces of lines, and arcs wherever a piece ends on the circle.
struct Outline {
  struct Edge {
    int line;
    bool from_circle, to_circle;
    friend bool operator==(const Edge&, const Edge&) = default;
  };
  std::array<Edge, kMostLines + 8> edge;
  int edges = 0;
  bool whole_disc = false;
  Outline() = default;
  Outline(const Outline& other) { *this = other; }
  Outline& operator=(const Outline& other) {
    if (this != &other) std::copy_n(other.edge.begin(), other.edges, edge.begin());
    edges = other.edges, whole_disc = other.whole_disc;
    return *this;
  }

  bool empty() const { return edges == 0 && !whole_disc; }
  friend bool operator==(const Outline& a, const Outline& b) {
    return a.edges == b.edges && a.whole_disc == b.whole_disc &&
           std::equal(a.edge.begin(), a.edge.begin() + a.edges, b.edge.begin());
  }
};
Outline outline(const Slice& slice);

/// Whether a slice certainly has the given outline. This is faster than finding the outline.
bool is_outline(const Slice& slice, const Outline& outline);

/// Integrals over a slice, or over slices, in coordinates x, y and t: of the volume and of the surfaces.
struct Integrals : Moments {
  double area = 0;        ///< of the bodies' parts of the surface, without cuts
  double first_area = 0;  ///< the first body's part of `area`
  /// ∫ N dA and ∫ X × N dA along l, m and n: for each body's surface, and for the cuts through bodies.
  std::array<Vec3, 3> pull{}, moment{};
  double across = 0;             ///< ∫ t N dA along n over all of the surface: equal to the volume
  double terms = 0;              ///< the size of the terms of `across`
  double border = 0;             ///< ∫ dA over all of the surface
  double cut_border = 0;         ///< ∫ dA over the cuts through bodies
  double correction = 0;         ///< of the volume: first-order effect of the tails of planes
  double uneven = 0;             ///< of the volume: bound of the second-order effects of the tilts of end planes
  double blur = 0;               ///< of the volume: the size of the terms in the sums for lines
  std::array<double, 6> seen{};  ///< ∫ 1, u, v, u², uv and v² over the viewed surface

  void add(double weight, const Integrals& other);
};
}  // namespace overlapper::slicing
