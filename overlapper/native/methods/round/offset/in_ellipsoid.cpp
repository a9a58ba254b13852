#include "methods/round/offset/in_ellipsoid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <vector>

#include "geometry/constants.h"
#include "geometry/rounding.h"
#include "geometry/scratch.h"
#include "geometry/wide_pose.h"
#include "methods/round/slicing/polynomials.h"
#include "methods/round/slicing/rules.h"
#include "methods/round/slicing/slice.h"
#include "shapes/hull_data.h"

namespace overlapper::offset {
namespace {
namespace in_ellipsoid {

/// Rounding of a term, relative to its size. No term takes more than 100 operations that each may round.
constexpr double kOfTermsInEllipsoid = 64 * kUnit;
/// Rounding of places, relative to the sizes of all numbers they come from. A difference, a rotation and a stretch take
/// no more than eight roundings that add up. The terms of the excess take no more, either.
constexpr double kOfPlaces = 8 * kUnit;

/// The sums of a part of a surface, or of a border.
struct Share {
  double value = 0, size = 0;  ///< m³: three times the cones, and the sum of all terms without their signs
  double area = 0;             ///< m²; parts of a border may be negative
  Vec3 force;                  ///< m²: area vector
  // The next sums are for the line in which both surfaces cross.
  double length = 0;  ///< m
  Vec3 places;        ///< m: ∫ of the place from the point; seen
  double off = 0;     ///< m²: ∫ of the distance from the point
  double doubt = 0;   ///< m³: what rounding of its places and direction, and gaps, may add to three times the cones
  double gaps = 0;    ///< m²: the area vectors that these gaps leave

  Share& operator+=(const Share& other) {
    value += other.value, size += other.size, area += other.area, force += other.force;
    length += other.length, places += other.places, off += other.off, doubt += other.doubt, gaps += other.gaps;
    return *this;
  }
};
Share operator*(double factor, const Share& s) {
  const double positive = std::abs(factor);
  return {factor * s.value,    positive * s.size, factor * s.area,    factor * s.force, positive * s.length,
          positive * s.places, positive * s.off,  positive * s.doubt, positive * s.gaps};
}

/// The cones from a point over a part of a unit sphere, as an integral along the border of the part. Directions are u,
/// and the point is x. The cones are ∫ (1 − x·u) dω. For a pole a, and a part not around −a, this is
/// ∮ (a / (1 + a·u) − x / 2)·((u − a) × du).
struct Pole {
  Vec3 axis;                     ///< a
  Vec3 point;                    ///< x
  bool over = false;             ///< the point is on the axis ...
  double length = 0, slack = 0;  ///< ... at this distance, and 1 less it. Then no term is a difference.

  /// For u − a, and the derivative of u along the border. `area` is the solid angle.
  Share along(Vec3 apart, Vec3 slope) const {
    const Vec3 turned = cross(apart, slope);
    const double apart2 = norm2(apart), beyond = 2 - apart2 / 2, angle = dot(axis, turned) / beyond;
    Share share;
    share.area = angle;
    if (over) {
      share.value = angle * (slack + length / 4 * apart2), share.size = std::abs(share.value);
    } else {
      const double second = dot(point, turned) / 2;
      share.value = angle - second, share.size = std::abs(angle) + std::abs(second);
    }
    // Near −a, the divisor is a small difference.
    constexpr double kNearOpposite = 0.25;
    if (beyond < kNearOpposite) share.size += std::abs(angle) / beyond;
    return share;
  }
  /// The most that a piece of border adds, for its length.
  double lever(Vec3 apart) const {
    const double apart2 = norm2(apart), divisor = 1 / std::abs(2 - apart2 / 2);
    const double height = over ? (std::abs(slack) + length / 4 * apart2) * divisor : divisor + norm(point) / 2;
    return std::sqrt(apart2) * height;
  }
  /// The most that the integral changes if its border moves off the sphere, for the length and the distance. It is
  /// ∮ φ a·(w × dw) − x·(w × dw) / 2 for w = u − a. There φ(w²) has the numerator `slack` + length w² / 4, or 1. A
  /// displacement δ along u adds ∮ 2 φ a·m + 2 φ' w² (a·m + w·m / 2) − x·m for m = δ u × dw. |a·m| and |w·m| are at
  /// most δ |w| |dw|.
  double spread(Vec3 apart) const {
    const double apart2 = norm2(apart), divisor = 1 / std::abs(2 - apart2 / 2);
    const double height = (over ? std::abs(slack) + length / 4 * apart2 : 1) * divisor;
    const double rate = ((over ? length / 4 : 0) + height / 2) * divisor;
    return std::sqrt(apart2) * (2 * height + 3 * rate * apart2) + (over ? 0 : norm(point));
  }
};

/// Coordinates are along the ellipsoid's axes. `seen` means in units of its half axes.
struct StretchedCorner {
  Vec3 place;                    ///< m, from the ellipsoid's centre
  Vec3 seen;                     ///< the same
  Vec3 away;                     ///< unit, from the inside of the core
  Vec3 apart;                    ///< m, from the point to the vertex
  WideVector exactly;            ///< the same
  bool in = false, out = false;  ///< the whole ball around the vertex
  bool placed = false;
  Pole pole;  ///< of its sphere
  Vec3 base;  ///< seen, from the point to where the pole is on the sphere
};

/// Where the border of a vertex's part of its sphere crosses the ellipsoid.
struct Crossing {
  int corner;
  Vec3 apart;  ///< the direction from the vertex, less its pole
  bool first;  ///< the border goes on along the line in which both surfaces cross
  int loop = -1;
  double place = 0;  ///< angle along that line
};

using slicing::Point;
double norm2(Point a) { return dot(a, a); }

/// Where the border of a facet crosses the ellipsoid.
struct FacetEnd {
  Point at;
  bool leaves;
};

/// A moved facet.
struct StretchedFacet {
  Vec3 normal;         ///< unit, in m
  double size;         ///< m: half the width of the ellipsoid along the normal
  double offset;       ///< from the ellipsoid's centre; seen
  bool apart = false;  ///< nothing of it is in the ellipsoid
};

struct StretchedWork {
  std::vector<StretchedCorner> corners;
  std::vector<StretchedFacet> facets;
  std::vector<char> edges_apart;  ///< nothing of their bands is in the ellipsoid
  std::vector<Crossing> crossings;
  std::vector<FacetEnd> ends;
};

struct Integrated {
  Share total;
  double error = 0;    ///< of the value
  bool rough = false;  ///< any rule is enough
};

/// Adds ∫ f dx. False if a rule is not enough.
template <class Nodes, class F>
bool by_rule(const Nodes& nodes, double low, double high, F f, Integrated& sum) {
  Share total;
  slicing::Series series;
  const double width = high - low;
  for (const slicing::Node& node : nodes) {
    const double step = width * node.fraction;
    // The weights of these nodes are for an integral over cos θ.
    const double weight = width * 2 / kPi * node.weight / node.sine;
    const Share a = f(low + step), b = f(high - step);
    series.add(node, width * a.value, width * b.value);
    total += weight * a, total += weight * b;
  }
  constexpr double kEnoughOfPart = 1e-14, kEnoughOfAll = 4e-15;
  const double error = series.error();
  if (!(sum.rough || error <= std::max(kEnoughOfPart * total.size, kEnoughOfAll * sum.total.size))) return false;
  sum.total += total, sum.error += error;
  return true;
}

template <class F>
bool integrate(double low, double high, F f, Integrated& sum, int halvings = 0) {
  if (by_rule(slicing::kNodes8, low, high, f, sum) || by_rule(slicing::kNodes16, low, high, f, sum)) return true;
  constexpr int kMostHalvings = 8;
  if (halvings == kMostHalvings) return false;
  const double middle = low + (high - low) / 2;
  return integrate(low, middle, f, sum, halvings + 1) && integrate(middle, high, f, sum, halvings + 1);
}

/// Adds ∫ f dx for an f of x, and of its distances from both ends, with a square root of the distance from a place
/// beyond an end. That root is the variable. Places are so far beyond the ends; negative if there is none.
template <class F>
bool integrate_roots(double low, double high, double beyond_low, double beyond_high, F f, Integrated& sum) {
  const double width = high - low;
  if (!(beyond_low >= 0 || beyond_high >= 0))
    return integrate(low, high, [&](double x) { return f(x, x - low, high - x); }, sum);
  const double share = beyond_low >= 0 && beyond_high >= 0 ? width / 2 : width;
  const auto from_low = [&](double root) {
    const double before = root * root - beyond_low;
    return 2 * root * f(low + before, before, width - before);
  };
  const auto from_high = [&](double root) {
    const double after = root * root - beyond_high;
    return 2 * root * f(high - after, width - after, after);
  };
  return (beyond_low < 0 || integrate(std::sqrt(beyond_low), std::sqrt(beyond_low + share), from_low, sum)) &&
         (beyond_high < 0 || integrate(std::sqrt(beyond_high), std::sqrt(beyond_high + share), from_high, sum));
}

WideVector over(const WideVector& a, Vec3 b) {
  return {a.x / DoubleDouble{b.x}, a.y / DoubleDouble{b.y}, a.z / DoubleDouble{b.z}};
}
Vec3 over(Vec3 a, Vec3 b) { return {a.x / b.x, a.y / b.y, a.z / b.z}; }

using Quartic = std::array<double, 5>;

/// Divides by t − root.
void divide(Quartic& polynomial, double root) {
  double carried = 0;
  for (size_t i = 5; i-- > 0;) {
    const double next = polynomial[i] + carried * root;
    polynomial[i] = carried, carried = next;
  }
}

/// Sizes of the terms of an excess, and of half its derivative along a border.
struct Sizes {
  double places = 0, excess = 0, slope = 0;
};

/// A vector as a polynomial of degree 2.
struct VectorSquare {
  Vec3 p0, p1, p2;
  Vec3 at(double t) const { return p0 + t * (p1 + t * p2); }
  std::array<double, 3> along(Vec3 a) const { return {dot(p0, a), dot(p1, a), dot(p2, a)}; }
};

/// The bodies along the axes of the ellipsoid, about its centre.
struct Setting {
  const HullData& hull;
  const OffsetSurface& surface;
  double r;
  Vec3 half_axes;
  WideVector centre;  ///< of the ellipsoid, in the coordinates of the core
  WideMatrix turn;    ///< from the coordinates of the core
};

/// Marks moved facets and bands that are clearly outside of the ellipsoid.
void mark_outside(const Setting& of, StretchedWork& work) {
  const Vec3 h = of.half_axes, k = of.r * over(Vec3{1, 1, 1}, h);
  constexpr double kClearly = 1 + 1e-6;
  for (size_t f = 0; f < work.facets.size(); ++f) {
    StretchedFacet& facet = work.facets[f];
    const double square = (1 - facet.offset) * (1 + facet.offset);
    facet.apart = std::abs(facet.offset) > kClearly;
    if (!(square > 0)) continue;
    // The ellipsoid's disc in the plane is beyond a side.
    const Vec3 normal = scaled(h, facet.normal) / facet.size, moved = scaled(k, facet.normal);
    const auto ring = of.hull.facet(static_cast<int>(f));
    Vec3 p = work.corners[ring.back()].seen + moved;
    for (const int v : ring) {
      const Vec3 q = work.corners[v].seen + moved, side = q - p;
      const double turn = dot(normal, cross(p, side));
      if (turn < 0 && turn * turn > kClearly * norm2(side) * (square + kClearly - 1)) {
        facet.apart = true;
        break;
      }
      p = q;
    }
  }
  work.edges_apart.clear();
  for (const OffsetSurface::Edge& edge : of.surface.edges) {
    const Vec3 from = work.corners[edge.from].seen, to = work.corners[edge.to].seen, whole = to - from;
    const double nearest = std::clamp(-dot(from, whole) / norm2(whole), 0.0, 1.0);
    const double reach = 1 + k.z;
    work.edges_apart.push_back(norm2(nearest == 1 ? to : from + nearest * whole) > reach * reach);
  }
}

/// The sum of cones from a point over both surfaces, in the coordinates in which the ellipsoid is the unit ball. Each
/// cone is an area times a height above the point. The *excess* of a place is its squared distance from the centre,
/// less 1.
class InStretched {
 public:
  InStretched(const Setting& of, StretchedWork& work)
      : of_(of),
        surface_(of.surface),
        hull_(of.hull),
        r_(of.r),
        h_(of.half_axes),
        k_(of.r * over(Vec3{1, 1, 1}, h_)),
        abc_(h_.x * h_.y * h_.z),
        half_cofactors_(abc_ / 2 * over(Vec3{1, 1, 1}, h_)),
        turn_{rounded(of.turn.row0), rounded(of.turn.row1), rounded(of.turn.row2)},
        work_(work) {}

  /// Adds all features, as cones from a point. False if a border is not certain.
  bool add_all(Vec3 point, bool exactly, bool roughly) {
    point_ = point, wide_ = exactly, sum_.rough = roughly;
    place_point();
    work_.crossings.clear();
    // Large terms first: the error of others counts relative to these.
    for (size_t f = 0; f < surface_.facets.size(); ++f)
      if (!add_facet(static_cast<int>(f))) return false;
    for (const OffsetSurface::Edge& edge : surface_.edges)
      if (!add_edge(edge)) return false;
    auto& crossings = work_.crossings;
    std::ranges::sort(crossings, {}, &Crossing::corner);
    size_t next = 0;
    for (size_t v = 0; v < work_.corners.size(); ++v) {
      const size_t begin = next;
      while (next < crossings.size() && crossings[next].corner == static_cast<int>(v)) ++next;
      if (!add_corner(static_cast<int>(v), std::span(crossings).subspan(begin, next - begin))) return false;
    }
    return true;
  }

  bool crossed() const { return crossed_; }
  bool poking() const { return poking_; }  ///< the ellipsoid certainly pokes out of the rounded hull
  const Integrated& sum() const { return sum_; }
  /// m³: the same of gaps between features, which rounding moves along the surface.
  double gaps(double border, double to_border) const {
    return kOfPlaces * std::max(lateral_, to_border) * border * height_;
  }

 private:
  void place_point() {
    const double length = norm(point_);
    excess_ = wide_ ? (dot(wide(point_), wide(point_)) - DoubleDouble{1}).head : (length - 1) * (length + 1);
    ball_.point = point_;
    if (wide_) {
      steepness_ = over(wide(point_), h_);
      exact_point_ = {two_product(h_.x, point_.x), two_product(h_.y, point_.y), two_product(h_.z, point_.z)};
    }
    const StretchedFacet& facet = *std::ranges::min_element(work_.facets, {}, &StretchedFacet::offset);
    constexpr double kFarAway = 0.25, kFarFromCentre = 0.25;
    ball_.over = length > kFarFromCentre && outside(-point_ / length) > kFarAway;
    poking_ = ball_.over || facet.offset < 1;
    Vec3 opposite = scaled(h_, facet.normal) / facet.size;
    if (!poking_) {
      // The place of the ellipsoid that is farthest along the direction from the nearest vertex.
      const auto distance2 = [](const StretchedCorner& corner) { return norm2(corner.place); };
      const Vec3 away = -std::ranges::min_element(work_.corners, {}, distance2)->place, far = scaled(h_, away);
      const double size = std::sqrt(norm2(far));
      if (size > 0 && outside(far / size) > kFarAway) opposite = far / size, poking_ = true;
    }
    ball_.length = length, ball_.slack = -excess_ / (1 + length);
    ball_.axis = ball_.over ? point_ / length : -opposite;
    from_pole_ = ball_.over ? -ball_.slack * ball_.axis : point_ - ball_.axis;
    for (StretchedCorner& corner : work_.corners) corner.placed = false;
  }

  /// At least how far a place on the ball is outside of the rounded hull; seen. By planes across the direction from the
  /// point, and across the ellipsoid's normal.
  double outside(Vec3 at) const {
    double most = -kInfinity;
    for (const Vec3 way : {scaled(h_, at - point_), over(at, h_)}) {
      double support = -kInfinity;
      for (const StretchedCorner& corner : work_.corners) support = std::max(support, dot(way, corner.place));
      const Vec3 across = scaled(h_, way);
      most = std::max(most, (dot(across, at) - support - r_ * std::sqrt(norm2(way))) / std::sqrt(norm2(across)));
    }
    return most;
  }

  StretchedCorner& corner_at(int v) {
    StretchedCorner& corner = work_.corners[v];
    if (corner.placed) return corner;
    corner.placed = true;
    double apart, slack;
    const Vec3 point = scaled(h_, point_);
    if (wide_) {
      const WideVector exactly = wide(hull_.vertices[v]) - of_.centre;
      corner.exactly = of_.turn * exactly - exact_point_;
      corner.apart = rounded(corner.exactly);
      const DoubleDouble distance = overlapper::norm(corner.exactly);
      apart = distance.head, slack = (DoubleDouble{r_} - distance).head;
    } else {
      corner.apart = corner.place - point;
      apart = std::sqrt(norm2(corner.apart)), slack = r_ - apart;
    }
    Pole& pole = corner.pole;
    pole.point = -corner.apart / r_;
    // All normals of the vertex are on one side of the plane across the direction from the core.
    constexpr double kAcross = 0.5;
    pole.over = apart > r_ / 2 && -dot(corner.apart, corner.away) > kAcross * apart;
    pole.axis = pole.over ? -corner.apart / apart : corner.away;
    pole.length = apart / r_, pole.slack = slack / r_;
    corner.base = over(pole.over ? slack * pole.axis : corner.apart + r_ * pole.axis, h_);
    return corner;
  }

  double excess(Vec3 from_point) const { return norm2(from_point) + 2 * dot(point_, from_point) + excess_; }

  /// A part of the ball's border, from the line in which both surfaces cross.
  Share ball_share(Vec3 from_point, Vec3 slope) const {
    Share share = ball_.along(from_point + from_pole_, slope);
    share.value *= abc_, share.size *= abc_;
    share.area *= abc_ / h_.z;
    share.force = scaled(half_cofactors_, cross(from_point, slope));
    share.length = std::sqrt(norm2(scaled(h_, slope)));
    share.places = share.length * from_point;
    share.off = share.length * std::sqrt(norm2(scaled(h_, from_point)));
    return share;
  }
  /// Adds the most that a piece of the ball's border may add. Its length is seen.
  void doubt(Share& share, Vec3 from_point, double length) const {
    share.doubt += abc_ * ball_.lever(from_point + from_pole_) * length;
    share.gaps += abc_ / (2 * h_.z) * norm(from_point) * length;
  }
  /// The most that three times the cones change if a piece of the line in which both surfaces cross moves, and its
  /// excess changes by `excess`. Along the feature, the piece sweeps an area, which both surfaces share but for a strip
  /// across the ball. The cone over the strip has the distance from the point as its height.
  double ball_moved(Vec3 from_point, double length, double excess) const {
    return abc_ * length * (norm(from_point) + ball_.spread(from_point + from_pole_)) * excess / 2;
  }
  /// The same if a place of it is off by so much, seen.
  double ball_off(Vec3 from_point, double length, double off) const {
    const Vec3 apart = from_point + from_pole_;
    const double height = ball_.over ? std::abs(ball_.slack) + norm2(apart) : 1 + norm(point_);
    return abc_ * length * (height + ball_.spread(apart)) * off;
  }
  /// A part of the border of a vertex's part of its sphere.
  Share corner_share(const StretchedCorner& corner, Vec3 apart, Vec3 slope) const {
    Share share = corner.pole.along(apart, slope);
    share.value *= r_ * r_ * r_, share.size *= r_ * r_ * r_;
    share.area *= r_ * r_, share.force = r_ * r_ / 2 * cross(apart, slope);
    return share;
  }

  bool add_edge(const OffsetSurface::Edge& edge) {
    const StretchedCorner &a_from = work_.corners[edge.from], &a_to = work_.corners[edge.to];
    if (a_from.in && a_to.in) {
      const Vec3 middle = turn_ * edge.middle;
      const double height = edge.chord * dot(corner_at(edge.from).apart, middle), plain = r_ * edge.angle;
      Share share;
      share.value = plain + height, share.size = plain + std::abs(height);
      share.area = edge.angle, share.force = edge.chord * middle;
      sum_.total += (r_ * edge.length) * share;
      return true;
    }
    if (work_.edges_apart[&edge - surface_.edges.data()]) return true;
    const StretchedCorner &from = corner_at(edge.from), &to = corner_at(edge.to);
    WideVector along_exactly, line_exactly;
    DoubleDouble apart_exactly;
    Vec3 e, line;                  // the direction, and from the point to the line of the edge
    double low_end, apart, slack;  // along the edge from the foot of the point
    if (wide_) {
      const WideVector along = overlapper::unit(to.exactly - from.exactly);
      const DoubleDouble first = dot(from.exactly, along);
      const WideVector across = from.exactly - first * along;
      const DoubleDouble distance = overlapper::norm(across);
      e = rounded(along), line = rounded(across), low_end = first.head, apart = distance.head;
      slack = (DoubleDouble{r_} - distance).head;
      along_exactly = along, line_exactly = across, apart_exactly = distance;
    } else {
      e = turn_ * edge.along, low_end = dot(from.apart, e), line = from.apart - low_end * e;
      apart = std::sqrt(norm2(line)), slack = r_ - apart;
    }
    const double high_end = low_end + edge.length;
    // Normals are at angles from a reference: from the direction to the point, if no normal is far from there.
    Vec3 middle = turn_ * edge.middle, across = turn_ * edge.across, base = line + r_ * middle;
    const double quarter = std::tan(edge.angle / 4);
    double low = -quarter, high = quarter;
    bool by_slack = false;
    if (apart > r_ / 2) {
      const Vec3 to_point = -line / apart, beside = cross(e, to_point);
      const double along = dot(middle, to_point), half = dot(middle, beside) / (1 + along);
      constexpr double kFar = 0.2;
      if (along > 0 && 1 - std::abs(half) * quarter > kFar) {
        low = (half - quarter) / (1 + half * quarter), high = (half + quarter) / (1 - half * quarter);
        middle = to_point, across = beside, base = slack * to_point, by_slack = true;
      }
    }
    double height_at_middle = dot(line, middle) + r_;
    WideVector middle_exactly, base_exactly;
    if (wide_) {
      const WideVector reference = wide(middle);
      middle_exactly = by_slack ? -(DoubleDouble{1} / apart_exactly * line_exactly)
                                : overlapper::unit(reference - dot(reference, along_exactly) * along_exactly);
      base_exactly = by_slack ? (DoubleDouble{r_} - apart_exactly) * middle_exactly
                              : line_exactly + DoubleDouble{r_} * middle_exactly;
      if (!by_slack) {
        middle = rounded(middle_exactly), across = rounded(cross(along_exactly, middle_exactly));
        base = rounded(base_exactly), height_at_middle = dot(base_exactly, middle_exactly).head;
      }
    }
    const Vec3 seen = over(base, h_), a = over(e, h_);
    const double a2 = norm2(a);
    // The direction is u = middle + 2 (t across − t² middle) / (1 + t²).
    const VectorSquare p{seen, 2 * scaled(k_, across), seen - 2 * scaled(k_, middle)};
    // p · point, and a · point. In a shallow contact, both are small differences.
    std::array<double, 3> y = p.along(point_);
    double slant = dot(a, point_);
    if (wide_) {
      const DoubleDouble twice{2 * r_}, first = dot(steepness_, base_exactly);
      y = {first.head, (twice * dot(steepness_, cross(along_exactly, middle_exactly))).head,
           (first - twice * dot(steepness_, middle_exactly)).head};
      slant = dot(steepness_, along_exactly).head;
    }
    const auto excess_of = [&](double end) {
      const VectorSquare q{p.p0 + end * a, p.p1, p.p2 + end * a};
      const double first = y[0] + end * slant, last = y[2] + end * slant;
      return Quartic{norm2(q.p0) + 2 * first + excess_, 2 * (dot(q.p0, q.p1) + y[1]),
                     norm2(q.p1) + 2 * (dot(q.p0, q.p2) + first + last + excess_), 2 * (dot(q.p1, q.p2) + y[1]),
                     norm2(q.p2) + 2 * last + excess_};
    };
    const Quartic q_from = excess_of(low_end), q_to = excess_of(high_end), q = excess_of(0);
    std::array<double, 3> along = p.along(a);
    along[0] += slant, along[2] += slant;
    Quartic chord = slicing::product(along, along);
    for (size_t i = 0; i < 5; ++i) chord[i] -= a2 * q[i];
    std::array<double, 16> breaks;
    int count = 0;
    breaks[count++] = low;
    const auto add_roots = [&](const Quartic& of) {
      const slicing::Roots found = slicing::roots<4>(of, low, high);
      for (int i = 0; i < found.count; ++i) breaks[count++] = found.t[i];
      return found;
    };
    const auto turned = [&](double t) { return 2 * t / (1 + t * t) * (across - t * middle); };
    const auto add_crossings = [&](int v, const Quartic& of, bool rising_first) {
      const slicing::Roots found = add_roots(of);
      bool outside = slicing::value(of, low) >= 0;
      const Vec3 reference = middle - work_.corners[v].pole.axis;
      for (int i = 0; i < found.count; ++i, outside = !outside)
        work_.crossings.push_back({v, reference + turned(found.t[i]), outside != rising_first});
    };
    if (!from.in && !from.out) add_crossings(edge.from, q_from, false);
    if (!to.in && !to.out) add_crossings(edge.to, q_to, true);
    // A line with an end inside is tangent nowhere. Tangent lines just beyond the band count, too: the square of half a
    // chord is a small difference near them.
    const double beyond = (high - low) / 2;
    const slicing::Roots tangent =
        from.in || to.in ? slicing::Roots{} : slicing::roots<4>(chord, low - beyond, high + beyond);
    for (int i = 0; i < tangent.count; ++i)
      if (low < tangent.t[i] && tangent.t[i] < high) breaks[count++] = tangent.t[i];
    breaks[count++] = high;
    std::sort(breaks.begin(), breaks.begin() + count);
    const Vec3 at_from = middle - from.pole.axis, at_to = middle - to.pole.axis;
    for (int i = 0; i + 1 < count; ++i) {
      const double begin = breaks[i], end = breaks[i + 1], inner = begin + (end - begin) / 2;
      if (!(begin < inner && inner < end)) continue;
      const bool from_in = from.in || (!from.out && slicing::value(q_from, inner) < 0),
                 to_in = to.in || (!to.out && slicing::value(q_to, inner) < 0);
      if (!from_in && !to_in) {
        if (!(slicing::value(chord, inner) > 0)) continue;
        const double foot = -slicing::value(along, inner) / (1 + inner * inner);
        if (!(foot > low_end * a2 && foot < high_end * a2)) continue;
      }
      if (!from_in || !to_in) crossed_ = true;
      if (by_slack) height_ = std::max(height_, std::abs(slack)), lateral_ = std::max(lateral_, r_);
      // The square of half a chord is a product, with a factor for a root at an end, or just beyond.
      Quartic rest = chord;
      double to_before = -1, to_after = -1;
      const double near = (end - begin) / 2;
      for (int j = 0; j < tangent.count; ++j) {
        const double before = begin - tangent.t[j], after = tangent.t[j] - end;
        if (before >= 0 && before <= near && !(to_before >= 0 && to_before <= before)) to_before = before;
        if (after >= 0 && after <= near && !(to_after >= 0 && to_after <= after)) to_after = after;
      }
      if (to_before >= 0) divide(rest, begin - to_before);
      if (to_after >= 0) divide(rest, end + to_after);
      const double sign = to_after >= 0 ? -1.0 : 1.0;
      // Sizes of the terms of a place, and of the excess there. Rounding of the excess moves the place along the line
      // of the band. It moves farther if that line meets the ellipsoid at a small angle.
      const double size0 = norm(p.p0), size1 = norm(p.p1), size2 = norm(p.p2), length = std::sqrt(a2);
      const double from_centre = norm(point_) + norm(from.seen);
      const auto sizes_of = [&](double t, double at) {
        const double scale = 1 / (1 + t * t), once = std::abs(t), along_line = std::abs(at);
        const double places = scale * (size0 + once * (size1 + once * size2)) + along_line * length;
        const double turning = scale * (size1 + 2 * once * (size2 + size0)) + 2 * once * along_line * length;
        Sizes sizes;
        sizes.places = places;
        if (wide_) {
          const double heights = scale * (std::abs(y[0]) + once * (std::abs(y[1]) + once * std::abs(y[2])));
          const double heights_turning = scale * (std::abs(y[1]) + 2 * once * (std::abs(y[0]) + std::abs(y[2])));
          sizes.excess = places * places + 2 * (heights + along_line * std::abs(slant)) + std::abs(excess_);
          sizes.slope = places * turning + heights_turning + once * (along_line * std::abs(slant) + std::abs(excess_));
        } else {
          const double all = places + from_centre;
          sizes.excess = all * all + 1, sizes.slope = all * (turning + once);
        }
        return sizes;
      };
      const auto add_gap = [&](double t, bool tangent_here) {
        if (tangent_here) return;
        const double scale = 1 / (1 + t * t), pa = scale * slicing::value(along, t);
        const double root = scale * std::sqrt(std::max(0.0, slicing::value(chord, t)));
        for (const bool is_last : {false, true}) {
          if (is_last ? to_in : from_in) continue;
          const double at = ((is_last ? root : -root) - pa) / a2, rounding = kOfPlaces * sizes_of(t, at).excess;
          const double gap = std::min(rounding / root, std::sqrt(rounding / a2));
          doubt(sum_.total, scale * p.at(t) + at * a, gap * length);
        }
      };
      const std::array<double, 4> half_slope{q[1] / 2, q[2], 3 * q[3] / 2, 2 * q[4]};
      const auto f = [&](double t, double before, double after) {
        const double scale = 1 / (1 + t * t), sine = 2 * t * scale, cosine = (1 - t) * (1 + t) * scale;
        const Vec3 moved = sine * (across - t * middle), slope = 2 * scale * (cosine * across - sine * middle);
        const double pa = scale * slicing::value(along, t);
        const double factor =
            sign * (to_before >= 0 ? to_before + before : 1.0) * (to_after >= 0 ? to_after + after : 1.0);
        const double root = scale * std::sqrt(std::max(0.0, factor * slicing::value(rest, t)));
        const double product = scale * scale * slicing::value(q, t);
        const double first = from_in ? low_end : pa < 0 ? product / (root - pa) : -(pa + root) / a2;
        const double last = to_in ? high_end : pa < 0 ? (root - pa) / a2 : -product / (pa + root);
        const double least = by_slack ? slack : height_at_middle;
        const double more = by_slack ? apart * sine * t : dot(line, moved);
        const double area = 2 * scale * r_ * (last - first);
        Share share;
        share.value = area * (least + more), share.size = area * (by_slack ? std::abs(least) + std::abs(more)
                                                                  : wide_  ? std::abs(least) + apart * norm(moved)
                                                                           : std::abs(least + more) + r_);
        share.area = area, share.force = area * (middle + moved);
        const auto on_line = [&](double at, double signed_root) {
          const Vec3 z = scale * p.at(t) + at * a, turning = scaled(k_, slope);
          // Half the derivative of the excess. The excess is zero here.
          const double rise = slicing::value(half_slope, t) +
                              at * (2 * t * slicing::value(along, t) + (1 + t * t) * (along[1] + 2 * t * along[2])) +
                              2 * a2 * at * at * t * (1 + t * t);
          Share border = ball_share(z, turning - scale * scale * rise / signed_root * a);
          const Sizes sizes = sizes_of(t, at);
          if (root > 0) doubt(border, z, kOfPlaces * scale * sizes.slope / root * length);
          if (wide_) {
            const double along_border = norm(turning - scale * scale * rise / signed_root * a);
            border.doubt += ball_moved(z, along_border, kOfPlaces * sizes.excess);
            if (!by_slack) {
              // The band and the ball round the same place in two ways, relative to the distance of the band.
              border.doubt += ball_off(z, along_border, kOfPlaces * sizes.places) +
                              kOfPlaces * (apart + r_) * std::abs(least + more) * border.length;
            }
          }
          return border;
        };
        if (!from_in) {
          share += -1.0 * on_line(first, -root);
        } else if (!from.in) {
          share += -1.0 * corner_share(from, at_from + moved, slope);
        }
        if (!to_in) {
          share += on_line(last, root);
        } else if (!to.in) {
          share += corner_share(to, at_to + moved, slope);
        }
        return share;
      };
      if (!integrate_roots(begin, end, to_before, to_after, f, sum_)) return false;
      add_gap(begin, to_before == 0), add_gap(end, to_after == 0);
    }
    return true;
  }

  bool add_facet(int f) {
    const StretchedFacet& facet = work_.facets[f];
    const Vec3 n = facet.normal;
    const double size = facet.size;
    const auto ring = hull_.facet(f);
    const auto is_in = [&](int v) { return work_.corners[v].in; };
    const bool whole = std::ranges::all_of(ring, is_in);
    if (!whole && facet.apart) return true;
    // The height of the facet above the point.
    WideVector normal_exactly;
    double height = dot(n, corner_at(ring[0]).apart) + r_;
    if (wide_) {
      const auto [i, j, k] = hull_.facet_corners[f];
      normal_exactly = of_.turn * overlapper::unit(wide_normal(hull_.corners[i], hull_.corners[j], hull_.corners[k]));
      const WideVector at = of_.turn * (wide(hull_.corners[i]) - of_.centre) - exact_point_;
      height = (dot(normal_exactly, at) + DoubleDouble{r_}).head;
    }
    const auto add_area = [&](double area) {
      Share share;
      share.value = height * area, share.size = std::abs(height) * area;
      share.area = area, share.force = area * n;
      sum_.total += share;
    };
    if (whole) return add_area(surface_.facets[f].area), true;
    const Vec3 normal = scaled(h_, n) / size;
    Vec3 x = any_orthogonal(normal), y = cross(normal, x);
    // In the plane, about the foot of the point. The middle of the disc is at −beside.
    const double above = height / size, inside = -(excess_ + above * (above + 2 * dot(point_, normal)));
    Point beside{dot(point_, x), dot(point_, y)};
    WideVector first_axis, second_axis;  // 1/m
    if (wide_) {
      const WideVector& own = normal_exactly;
      const WideVector across =
          overlapper::unit({DoubleDouble{h_.x} * own.x, DoubleDouble{h_.y} * own.y, DoubleDouble{h_.z} * own.z});
      const WideVector first = overlapper::unit(wide(x) - dot(wide(x), across) * across), then = cross(across, first);
      x = rounded(first), y = rounded(then);
      beside = {dot(wide(point_), first).head, dot(wide(point_), then).head};
      first_axis = over(first, h_), second_axis = over(then, h_);
    }
    const double square = norm2(beside) + inside;
    if (!(square > 0)) return true;
    const auto flat = [&](int v) -> std::array<DoubleDouble, 2> {
      const StretchedCorner& corner = corner_at(v);
      if (wide_) {
        const WideVector at = corner.exactly + DoubleDouble{r_} * normal_exactly;
        return {dot(at, first_axis), dot(at, second_axis)};
      }
      const Vec3 at = over(corner.apart, h_) + scaled(k_, n);
      return {DoubleDouble{dot(at, x)}, DoubleDouble{dot(at, y)}};
    };
    const auto plain = [](const std::array<DoubleDouble, 2>& at) { return Point{at[0].head, at[1].head}; };
    const auto excess_at = [&](Point at) { return norm2(at) + 2 * dot(beside, at) - inside; };
    const Vec3 foot = above * normal;
    const double to_middle = std::sqrt(norm2(beside));
    const double of_inside = std::abs(excess_) + std::abs(above) * (std::abs(above) + 2 * norm(point_));
    double area = 0;
    bool around = true, any = false;
    auto& ends = work_.ends;
    ends.clear();
    auto from = flat(ring.back());
    double p_out = excess_at(plain(from));
    for (const int v : ring) {
      const auto to = flat(v);
      const Point p = plain(from), q = plain(to), d = q - p;
      // A place of the side near the point, so that far corners do not cost its digits.
      const double d2 = norm2(d), near = wide_ ? -dot(p, d) / d2 : 0;
      const Point base = wide_ ? Point{(from[0] + DoubleDouble{near} * (to[0] - from[0])).head,
                                       (from[1] + DoubleDouble{near} * (to[1] - from[1])).head}
                               : p;
      const double q_out = excess_at(q), base_out = excess_at(base), along = dot(base + beside, d);
      const double turn = cross(base + beside, d), chord = d2 * square - turn * turn;
      around = around && turn > 0;
      const bool in = p_out < 0, stays = q_out < 0;
      if (in || stays || (chord > 0 && -along > -near * d2 && -along < (1 - near) * d2)) {
        any = true;
        const double root = std::sqrt(std::max(0.0, chord));
        const Point first = in ? p : base + (along < 0 ? base_out / (root - along) : -(along + root) / d2) * d;
        const Point last = stays ? q : base + (along < 0 ? (root - along) / d2 : -base_out / (along + root)) * d;
        area += cross(first, last) / 2;
        const auto add_end = [&](Point at, bool leaves) {
          ends.push_back({at, leaves});
          // Rounding of the excess moves an end along its side.
          const double all = std::sqrt(norm2(at) + above * above), to_at = std::abs(dot(beside, at));
          const double within = all + norm(point_) + norm(work_.corners[v].seen);
          const double terms = wide_ ? norm2(at) + 2 * to_at + of_inside : within * within + 1;
          const double rounding = kOfPlaces * terms;
          const double gap = std::min(rounding * std::sqrt(d2) / root, std::sqrt(rounding));
          doubt(sum_.total, foot + (at.x * x + at.y * y), gap);
        };
        if (!in) add_end(first, false);
        if (!stays) add_end(last, true);
      }
      from = to, p_out = q_out;
    }
    const double to_area = abc_ / size;
    // An arc of the disc's border, where the facet is on the left and the ball's part on the right.
    const auto add_arc = [&](Point begin, double angle) {
      crossed_ = true;
      height_ = std::max(height_, std::abs(height));
      const Point arm = begin + beside;
      const int parts = 1 + static_cast<int>(angle);
      const double most = std::tan(angle / parts / 2);
      for (int i = 0; i < parts; ++i) {
        const double before = angle * i / parts, sine = std::sin(before), half = std::sin(before / 2);
        const double less = 2 * half * half;
        const Point start{begin.x - less * arm.x - sine * arm.y, begin.y - less * arm.y + sine * arm.x};
        const Point own{start.x + beside.x, start.y + beside.y};
        // By the tangent of half an angle.
        const auto of_arc = [&](double t) {
          const double scale = 2 / (1 + t * t), s = t * scale, c = t * s;
          const Point at{start.x - c * own.x - s * own.y, start.y - c * own.y + s * own.x};
          const Point slope{scale * (-s * own.x - (1 - c) * own.y), scale * (-s * own.y + (1 - c) * own.x)};
          const Vec3 z = foot + (at.x * x + at.y * y);
          Share share = -1.0 * ball_share(z, slope.x * x + slope.y * y);
          if (wide_) {
            const double once = std::sqrt(norm2(at)), terms = once * (once + 2 * to_middle) + of_inside;
            share.doubt += ball_moved(z, std::sqrt(norm2(slope)), kOfPlaces * terms);
          }
          const double more = to_area * cross(at, slope) / 2;
          share.value += height * more, share.size += std::abs(height * more);
          share.area += more, share.force += more * n;
          return share;
        };
        if (!integrate(0, most, of_arc, sum_)) return false;
      }
      return true;
    };
    if (!any) return !around || add_arc(Point{std::sqrt(square), 0} - beside, 2 * kPi);
    for (size_t i = 0; i < ends.size(); ++i) {
      const FacetEnd &a = ends[i], &b = ends[(i + 1) % ends.size()];
      if (a.leaves == b.leaves) return false;
      if (!a.leaves) continue;
      const Point arm = a.at + beside, to = b.at - a.at;
      // A turn of nearly nothing may as well be a whole turn.
      constexpr double kDoubtful = 1e-9;
      if (!(norm2(to) > kDoubtful * kDoubtful * (norm2(a.at) + norm2(b.at)))) return false;
      double angle = std::atan2(cross(arm, to), norm2(arm) + dot(arm, to));
      if (angle < 0) angle += 2 * kPi;
      if (!add_arc(a.at, angle)) return false;
    }
    add_area(area * to_area);
    return true;
  }

  /// A closed line in which the ellipsoid crosses the sphere around a vertex. Directions u from the vertex have
  /// n·(u − pole) = s between `low` and `high`, with s = middle − half cos λ. Across n, both are circles.
  struct Loop {
    double low, high;
    std::array<double, 3> rest;  ///< of the quartic, without these two roots
    double middle() const { return low + (high - low) / 2; }
  };

  bool add_corner(int v, std::span<Crossing> crossings) {
    if (work_.corners[v].in) {
      const OffsetSurface::Vertex& own = surface_.vertices[v];
      const Vec3 normals = turn_ * own.normals;
      const double height = dot(corner_at(v).apart, normals), plain = r_ * own.solid_angle;
      Share share;
      share.value = plain + height, share.size = plain + std::abs(height);
      share.area = own.solid_angle, share.force = normals;
      sum_.total += (r_ * r_) * share;
      return crossings.empty();
    }
    if (work_.corners[v].out) return crossings.empty();
    const StretchedCorner& corner = corner_at(v);
    // For u = pole + w, the excess of a point over the ball is E + 2 g·w + γ² (n₊·w) (n₋·w), as |u| = 1.
    const double first = (k_.z - k_.y) * (k_.z + k_.y), last = (k_.y - k_.x) * (k_.y + k_.x), gamma2 = first + last;
    const double alpha = std::sqrt(first / gamma2), beta = std::sqrt(last / gamma2);
    const Vec3 pole = corner.pole.axis, to_base = point_ + corner.base;
    const Vec3 g = scaled(to_base, k_) - k_.y * k_.y * pole;
    // g × pole is small in a shallow contact.
    Vec3 aside = cross(g, pole);
    if (wide_ && corner.pole.over) {
      const WideVector exactly = overlapper::unit(-corner.exactly);
      aside = rounded(DoubleDouble{r_} * cross(steepness_, exactly)) + cross(scaled(k_, corner.base), pole);
    }
    const Vec3 plus{beta, 0, alpha}, minus{-beta, 0, alpha};
    const bool by_plus = std::abs(dot(plus, g)) <= std::abs(dot(minus, g));
    const Vec3 n = by_plus ? plus : minus, other = by_plus ? minus : plus, p{n.z, 0, -n.x}, m{0, 1, 0};
    // At n·w = s: A + B X + C Y = 0, with (s + pole_n)² + (X + pole_p)² + (Y + pole_m)² = 1.
    const double g_p = dot(g, p), g_m = dot(g, m), other_p = dot(other, p);
    const double pole_n = dot(pole, n), pole_p = dot(pole, p), pole_m = dot(pole, m);
    const std::array<double, 3> level{excess(corner.base), 2 * dot(g, n), gamma2 * dot(other, n)};
    const std::array<double, 2> slant{2 * g_p, gamma2 * other_p};
    const double side = 2 * g_m;
    const std::array<double, 2> turned{2 * dot(aside, n), gamma2 * other_p * pole_m};
    const std::array<double, 2> along{slant[0] * pole_p + side * pole_m, slant[1] * pole_p};
    std::array<double, 3> slope2 = slicing::product(slant, slant);
    slope2[0] += side * side;
    Quartic chord = slicing::product(slope2, std::array<double, 3>{0, -2 * pole_n, -1});
    const auto turned2 = slicing::product(turned, turned);
    const Quartic level2 = slicing::product(level, level);
    const auto both = slicing::product(level, along);
    for (size_t i = 0; i < 5; ++i) chord[i] += (i < 3 ? turned2[i] : 0) - level2[i] + (i < 4 ? 2 * both[i] : 0);
    // The same, without a difference of large terms.
    chord[1] = 4 * (slant[0] * dot(aside, m) - side * dot(aside, p)) + turned2[1] - level2[1] + 2 * level[0] * along[1];
    slicing::Roots bends;
    const slicing::Roots found = slicing::roots<4>(chord, -1 - pole_n, 1 - pole_n, &bends);
    if (found.count % 2 != 0) return false;
    // Where A, B and C are all small, points lose digits. A line may lie in one of the planes, as around the axis of an
    // ellipsoid of revolution: then the quartic has a double root, or none by rounding.
    constexpr double kLeastSlope = 1e-3;
    const auto slope_at = [&](double s) { return std::sqrt(slicing::value(slope2, s)); };
    const double largest = 2 * std::sqrt(norm2(g)) + gamma2, least = kLeastSlope * largest;
    for (int i = 0; i < bends.count; ++i) {
      const double s = bends.t[i];
      if (slope_at(s) <= least && std::abs(slicing::value(chord, s)) <= least * least) return false;
    }
    if (found.count == 0) return crossings.empty();
    const double flattest = -slope2[1] / (2 * slope2[2]);
    std::array<Loop, 2> loops;
    const int count = found.count / 2;
    for (int i = 0; i < count; ++i) {
      Loop& loop = loops[i];
      loop.low = found.t[2 * i], loop.high = found.t[2 * i + 1];
      if (!(slicing::value(chord, loop.middle()) > 0)) return false;
      const double inner = flattest > loop.low && flattest < loop.high ? slope_at(flattest) : largest;
      if (!(std::min({slope_at(loop.low), slope_at(loop.high), inner}) > least)) return false;
      const double sum = loop.low + loop.high, product = loop.low * loop.high;
      const double b = chord[3] + chord[4] * sum, a = chord[2] + b * sum - chord[4] * product;
      loop.rest = {-a, -b, -chord[4]};
    }
    // (pole + w) × the gradient of the excess
    const Vec3 of_base = scaled(k_, to_base), squares = scaled(k_, k_);
    const auto across_gradient = [&](Vec3 w) {
      return 2 * (cross(w, of_base) + cross(pole + w, scaled(squares, w)) - aside);
    };
    for (Crossing& crossing : crossings) {
      const double s = dot(n, crossing.apart);
      crossing.loop = count > 1 && s - loops[0].high > loops[1].low - s ? 1 : 0;
      const Loop& loop = loops[crossing.loop];
      const double rest = slicing::value(loop.rest, s);
      if (!(rest > 0)) return false;
      const double across = dot(n, across_gradient(crossing.apart));
      crossing.place = std::atan2(across / std::sqrt(rest), loop.middle() - s);
      if (crossing.place < 0) crossing.place += 2 * kPi;
    }
    std::ranges::sort(crossings, [](const Crossing& a, const Crossing& b) {
      return a.loop != b.loop ? a.loop < b.loop : a.place < b.place;
    });
    // Sizes of the terms of the gradient: their sum is small if surfaces meet at a small angle.
    const double terms = 2 * (norm(of_base) + norm(to_base) * k_.z + k_.z * k_.z);
    const double terms_aside = 2 * (wide_ && corner.pole.over ? norm(aside) : norm(to_base) * k_.z + k_.y * k_.y);
    size_t next = 0;
    for (int i = 0; i < count; ++i) {
      const Loop& loop = loops[i];
      const double middle = loop.middle(), half = (loop.high - loop.low) / 2;
      const auto apart = [&](double angle) {
        const double s = middle - half * std::cos(angle), rest = slicing::value(loop.rest, s);
        const double a = slicing::value(level, s), b = slicing::value(slant, s), slope = slicing::value(slope2, s);
        const double root = half * std::sin(angle) * std::sqrt(std::max(0.0, rest)) + slicing::value(turned, s);
        return s * n + ((-a * b + root * side) / slope) * p + ((-a * side - root * b) / slope) * m;
      };
      const auto add_doubt = [&](Share& share, Vec3 w, double off) {
        share.doubt += r_ * r_ * r_ * corner.pole.lever(w) * off;
        doubt(share, corner.base + scaled(k_, w), k_.z * off);
      };
      // m: how far places may be off by rounding, at a distance from the point. Two bounds: one by sizes, one by the
      // terms of the excess. Most of these terms are small in a shallow contact.
      const auto misplaced = [&](double seen) {
        const double slope = norm(aside) / k_.x, by_excess = h_.x * (slope * seen + std::abs(excess_) + seen * seen);
        return kOfPlaces * std::max(corner.pole.over ? 0 : norm(corner.apart) + r_, std::min(h_.x * seen, by_excess));
      };
      const auto of_line = [&](double angle) {
        const double s = middle - half * std::cos(angle), root = std::sqrt(std::max(0.0, slicing::value(loop.rest, s)));
        const Vec3 w = apart(angle), slope = across_gradient(w) / root;
        Share share = corner_share(corner, w, slope);
        share += -1.0 * ball_share(corner.base + scaled(k_, w), scaled(k_, slope));
        const double away = norm(w);
        const double rounding = kOfPlaces * (terms * away * (1 + away) + terms_aside) / root;
        // The derivative of s is known, too.
        add_doubt(share, w, rounding + std::abs(dot(n, slope) - half * std::sin(angle)));
        if (wide_) share.doubt += 3 * misplaced(norm(corner.base + scaled(k_, w))) * share.off;
        return share;
      };
      const auto add = [&](double begin, double end) {
        crossed_ = true;
        // A height above the point is a difference, which loses digits of its terms.
        if (wide_ && !corner.pole.over)
          sum_.total.doubt += 3 * kOfPlaces * (norm(corner.apart) + r_) * r_ * r_ * surface_.vertices[v].solid_angle;
        height_ = std::max(height_, std::abs(corner.pole.slack * r_)), lateral_ = std::max(lateral_, r_);
        const int parts = 1 + static_cast<int>((end - begin) / 2);
        for (int part = 0; part < parts; ++part)
          if (!integrate(begin + (end - begin) * part / parts, begin + (end - begin) * (part + 1) / parts, of_line,
                         sum_))
            return false;
        return true;
      };
      const size_t begin = next;
      while (next < crossings.size() && crossings[next].loop == i) ++next;
      const auto on_loop = crossings.subspan(begin, next - begin);
      for (const Crossing& crossing : on_loop)
        add_doubt(sum_.total, crossing.apart, norm(apart(crossing.place) - crossing.apart));
      if (on_loop.empty()) {
        // The whole loop is in the vertex's part of the sphere, or nothing of it.
        double surest = 0;
        for (const double angle : {0.0, kPi / 2, kPi, 3 * kPi / 2}) {
          const double outside = most_outside(v, pole + apart(angle));
          if (std::abs(outside) > std::abs(surest)) surest = outside;
        }
        constexpr double kDoubtful = 1e-9;
        if (!(std::abs(surest) > kDoubtful)) return false;
        if (surest < 0 && !add(0, 2 * kPi)) return false;
        continue;
      }
      for (size_t j = 0; j < on_loop.size(); ++j) {
        const Crossing &a = on_loop[j], &b = on_loop[(j + 1) % on_loop.size()];
        if (a.first == b.first) return false;
        if (a.first && !add(a.place, b.place > a.place ? b.place : b.place + 2 * kPi)) return false;
      }
    }
    return true;
  }

  /// How far a direction is outside of the normals of a vertex, as a sine; negative inside.
  double most_outside(int v, Vec3 u) const {
    double most = -kInfinity;
    for (const int i : surface_.edges_at(v)) {
      const OffsetSurface::Edge& edge = surface_.edges[i];
      const double outside = dot(u, turn_ * edge.along);
      most = std::max(most, edge.from == v ? outside : -outside);
    }
    return most;
  }

  const Setting& of_;
  const OffsetSurface& surface_;
  const HullData& hull_;
  double r_;
  Vec3 h_, k_;  ///< half axes from the longest, and r in these units
  double abc_;
  Vec3 half_cofactors_;
  Mat3 turn_;
  StretchedWork& work_;
  Vec3 point_;  ///< that cones are from; seen
  bool wide_ = false;
  double excess_ = 0;  ///< |point|² − 1
  Pole ball_;
  Vec3 from_pole_;
  bool crossed_ = false, poking_ = false;
  WideVector steepness_;    ///< 1/m: the point over the half axes
  WideVector exact_point_;  ///< m
  // The next numbers are the largest of all features that are used.
  double height_ = 0, lateral_ = 0;  ///< m: heights above the point, and sizes along the surface
  Integrated sum_;
};

}  // namespace in_ellipsoid
}  // namespace

std::optional<VolumeAlone> volume_in_ellipsoid(const Placed& rounded_hull, const Placed& ellipsoid) {
  using namespace in_ellipsoid;
  const HullData& hull = *polytope_of(rounded_hull.shape);
  const OffsetSurface& surface = offset_surface(hull);
  if (!surface.exact) return std::nullopt;
  const double r = core_radius(rounded_hull.shape);
  Vec3 h = stretched(ellipsoid.shape)->half_axes;
  // Half axes from the longest to the shortest, with the axes a right-handed frame.
  const WideMatrix of_ellipsoid = wide_rotation(ellipsoid.orientation),
                   of_hull = wide_rotation(rounded_hull.orientation);
  const auto column = [&](DoubleDouble WideVector::* i) {
    return apply_transposed(of_hull, {of_ellipsoid.row0.*i, of_ellipsoid.row1.*i, of_ellipsoid.row2.*i});
  };
  WideMatrix turn{column(&WideVector::x), column(&WideVector::y), column(&WideVector::z)};
  const auto order = [&](double& a, WideVector& row_a, double& b, WideVector& row_b) {
    if (a < b) std::swap(a, b), std::swap(row_a, row_b), row_b = -row_b;
  };
  order(h.x, turn.row0, h.y, turn.row1), order(h.y, turn.row1, h.z, turn.row2), order(h.x, turn.row0, h.y, turn.row1);
  const WideVector apart = apply_transposed(of_hull, wide_difference(ellipsoid.position, rounded_hull.position));
  const Setting setting{hull, surface, r, h, apart - wide(hull.origin), turn};
  const Mat3 plain{rounded(turn.row0), rounded(turn.row1), rounded(turn.row2)};
  const Vec3 centre = rounded(setting.centre);

  const Scratch<StretchedWork> work;
  work->corners.assign(hull.vertices.size(), {}), work->facets.clear();
  const double thin = r / h.z;
  bool all_in = true;
  double size = 0;
  for (size_t v = 0; v < hull.vertices.size(); ++v) {
    StretchedCorner& corner = work->corners[v];
    corner.place = plain * (hull.vertices[v] - centre), corner.seen = over(corner.place, h);
    corner.away = plain * unit(hull.vertices[v] - hull.centroid);
    const double seen = std::sqrt(norm2(corner.seen));
    corner.in = seen + thin <= 1, corner.out = seen - thin >= 1;
    all_in = all_in && corner.in;
    size = std::max(size, std::sqrt(norm2(corner.place)));
  }
  if (all_in) {
    const double whole = surface.volume(r);
    return VolumeAlone{whole, kOfTermsInEllipsoid * whole};
  }
  double least = kInfinity, highest = -kInfinity;
  Vec3 point;
  for (size_t f = 0; f < surface.facets.size(); ++f) {
    const Vec3 n = plain * surface.facets[f].normal, stretched_normal = scaled(h, n);
    const double reach = std::sqrt(norm2(stretched_normal));
    const double height = dot(n, work->corners[hull.facet(static_cast<int>(f))[0]].place) + r;
    highest = std::max(highest, -height);
    work->facets.push_back({n, reach, height / reach});
    const double depth = reach + height;
    if (depth < least) least = depth, point = over((depth / 2) * n, h) - stretched_normal / reach;
  }
  mark_outside(setting, *work);
  bool roughly = true, exactly = false;
  // Deep contacts keep their digits from any point.
  constexpr double kDeep = 0.05;
  if (highest < 0) point = {};
  if (highest < 0 || least > kDeep * h.z) roughly = false;
  const double whole = 4.0 / 3.0 * kPi * h.x * h.y * h.z;
  for (int pass = 0; pass < 3; ++pass) {
    InStretched part(setting, *work);
    if (!part.add_all(point, exactly, roughly) || (part.crossed() && !part.poking())) return std::nullopt;
    if (!part.crossed() && !part.poking()) return VolumeAlone{whole, kOfTermsInEllipsoid * whole};
    const Share& total = part.sum().total;
    // The border may move by the rounding of places, and a gap along it is a part of the cones.
    const double border = total.off, volume = total.value / 3;
    const double to_border = total.length > 0 ? total.off / total.length : 0;
    double of_places = kOfPlaces * (size + h.x + r) * (total.area + border);
    if (exactly) {
      const double apart_by = norm(rounded_hull.position - ellipsoid.position);
      const double off = wide_placing(apart_by + norm(hull.origin) + reach(rounded_hull.shape), true);
      of_places = off * (total.area + border) + part.gaps(total.length, to_border);
    }
    if (!roughly) {
      // A gap in the surface leaves area vectors open, beyond the rounding of their own sum.
      const double open = norm(total.force), rounding = kOfTermsInEllipsoid * to_border * total.length + total.gaps;
      const double error = (part.sum().error + kOfTermsInEllipsoid * total.size + total.doubt) / 3 + of_places +
                           2 * std::max(0.0, open - rounding) * to_border;
      constexpr double kOpen = 1e-10;
      if (volume > 0 && std::isfinite(volume) && error <= kEnough * volume && open <= kOpen * total.area)
        return VolumeAlone{volume, error};
    }
    if (exactly || !(total.length > 0)) return std::nullopt;
    // The mean of the border is in the common part, as it is convex. Heights above it are small in a shallow contact.
    point += total.places / total.length;
    exactly = !(of_places <= kEnough / 2 * volume), roughly = false;
  }
  return std::nullopt;
}

}  // namespace overlapper::offset
