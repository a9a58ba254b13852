#include "methods/round/offset/two_rounded.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "geometry/bounds.h"
#include "geometry/cancellation.h"
#include "geometry/constants.h"
#include "geometry/rounding.h"
#include "geometry/scratch.h"
#include "geometry/wide_pose.h"
#include "methods/round/offset/solid_angle.h"
#include "methods/round/slicing/rules.h"
#include "shapes/hull_data.h"

namespace overlapper::offset {
namespace {

/// Rounding of a term, relative to its size. No term takes more than 60 operations that each may round.
constexpr double kOfTermsOfTwo = 64 * kUnit;
/// Rounding of a point of a crossing, relative to its distances from the origin and from centres. On an exact curve, it
/// is relative to the terms of the point.
constexpr double kOfPlaces = 8 * kUnit;
/// Directions that differ less have no certain cross product.
constexpr double kAlike = 1e-7;
constexpr double kAlikeAxes = 1e-3;

/// The plane between two features. On the side of `element`, normals point from facets to bands, and from patches to
/// bands.
struct Border {
  Plane plane;
  int element;
};
struct MovedFacet {
  Plane plane;
  Vec3 nearest;  ///< to the origin
  double twice_area = 0;
  bool kept = false;
};
/// Points of the band are foot + t along + r u, for u = cos φ middle + sin φ across, |φ| ≤ half and begin ≤ t ≤ end.
/// With the direction w from the foot to the origin, x · u at the band is rise + lever (1 − w · u).
struct Band {
  Vec3 foot;  ///< of the origin on the axis
  Vec3 along, middle, across;
  double begin = 0, end = 0, half = 0;
  double sine = 0, cosine = -1;  ///< of `half`
  double base = 0;               ///< m: integrals count t from here
  Vec3 toward;                   ///< w
  double rise = 0, lever = 0;
  Vec3 near;                  ///< rise w: near the origin, it keeps the digits that foot + r w loses
  double plain = 0, cap = 0;  ///< ∫∫ 1, 1 − w · u over φ and t
  Vec3 vector;                ///< m²: ∫ u over the area
};
/// Points of the patch are centre + r u. With a direction w, x · u is rise + lever (1 − w · u) + aside · u.
struct Patch {
  Vec3 centre;
  Vec3 toward;             ///< w, not opposite to a normal
  bool to_origin = false;  ///< w leads from the centre to the origin
  double rise = 0, lever = 0;
  Vec3 near;  ///< centre + r w
  Vec3 aside;
  double angle = 0, cap = 0;  ///< ∫ 1, 1 − w · u over the solid angle
  Vec3 vector;                ///< m²: ∫ u over the area
};
/// A point where an element, a line or an arc between two features, passes through the surface of the other body.
struct Crossing {
  int element;
  double at;  ///< t or φ
  bool leaves;
  Vec3 point;
  double moment;  ///< m²: bound of |x · u| times the arm of a gap, at features beside it
};
struct Around {
  Bounds box;
  int feature;
};

/// A body in the common coordinates. Features are facets, then bands, then patches. Elements are the two long sides of
/// each band, then its two ends. A capsule is a band between two patches. A cylinder is a band between two facets, its
/// discs. Number 0 is at the beginning of the band.
struct Side {
  const OffsetSurface* surface = nullptr;  ///< null for a capsule or a cylinder
  const HullData* hull = nullptr;
  double r = 0, half_length = 0;
  bool discs = false;  ///< a cylinder
  Mat3 rotation;
  WideMatrix wide_rotation;
  WideVector inner;  ///< the origin in the coordinates of the core
  std::vector<Vec3> vertices;
  std::vector<char> near;  ///< for each vertex: 1 if its sphere may reach the other body
  std::vector<MovedFacet> facets;
  std::vector<Band> bands;
  std::vector<Patch> patches;
  std::vector<Border> lines, ends;
  std::vector<Around> around;
  std::vector<Crossing> crossings;
  std::vector<char> crossed;  ///< for each feature
  std::vector<char> refined;  ///< for each feature: 1 if its numbers come from double-doubles
  std::vector<int> elements;  ///< that may be in the other body
  std::vector<int> root;      ///< of nodes that elements without a crossing join
  std::vector<char> inside;   ///< for each node: 0, 1 or 2 if not known
  Bounds bounds;

  int first_band() const { return static_cast<int>(facets.size()); }
  int first_patch() const { return first_band() + static_cast<int>(bands.size()); }
  int features() const { return first_patch() + static_cast<int>(patches.size()); }
  bool revolved() const { return surface == nullptr; }
  int nodes() const { return revolved() ? 2 : static_cast<int>(hull->ring.size()); }
  /// The nodes at the beginning and the end of an element.
  std::pair<int, int> ends_of(int element) const {
    const int lines_of = 2 * static_cast<int>(bands.size());
    if (revolved()) return {element - lines_of, element - lines_of};
    const auto& corners = surface->edges[(element % lines_of) / 2].corners;
    if (element < lines_of)
      return element % 2 == 0 ? std::pair{corners[0], corners[1]} : std::pair{corners[2], corners[3]};
    return element % 2 == 0 ? std::pair{corners[0], corners[2]} : std::pair{corners[1], corners[3]};
  }
};

Vec3 corner_of(const Side& side, int v) {
  if (!side.revolved()) return side.hull->vertices[v];
  return {0, 0, v == 0 ? -side.half_length : side.half_length};
}
WideVector wide_corner(const Side& side, int v) { return wide(corner_of(side, v)) - side.inner; }
std::pair<int, int> ends_of_band(const Side& side, int e) {
  if (side.revolved()) return {0, 1};
  return {side.surface->edges[e].from, side.surface->edges[e].to};
}
WideVector wide_along(const Side& side, int e) {
  const auto [from, to] = ends_of_band(side, e);
  return unit(wide_difference(corner_of(side, to), corner_of(side, from)));
}
/// The plane of a moved facet about the origin.
WidePlane wide_plane(const Side& side, int f) {
  if (side.discs) {
    const DoubleDouble outward{f == 0 ? -1.0 : 1.0};
    return {{{}, {}, outward}, DoubleDouble{side.half_length} - outward * side.inner.z};
  }
  const auto [a, b, c] = side.hull->facet_corners[f];
  const auto& corners = side.hull->corners;
  const WideVector normal = unit(wide_normal(corners[a], corners[b], corners[c]));
  return {normal, dot(normal, wide(corners[a]) - side.inner) + DoubleDouble{side.r}};
}
/// The direction of a difference that is orthogonal to an axis but for rounding, which counts if it is short.
Vec3 across_axis(Vec3 across, Vec3 axis) { return unit(across - dot(across, axis) * axis); }
/// A direction across an axis, where a circle begins and ends. Other features of aligned bodies hardly cross it there.
Vec3 beside(Vec3 axis) {
  const Vec3 x = any_orthogonal(axis);
  return 0.54 * x + std::sqrt(1 - 0.54 * 0.54) * cross(axis, x);
}
void aim(Band& band) {
  band.base = std::clamp(0.0, band.begin, band.end);
  // If the axis passes the origin up to rounding, the foot has no certain direction.
  const Vec3 across = band.foot - dot(band.foot, band.along) * band.along;
  const bool beside = norm2(across) > norm2(band.foot) / 2;
  band.toward = beside ? -unit(across) : band.middle;
  band.lever = -dot(band.foot, band.toward);
}

/// Takes the distances of a feature from the origin from double-doubles.
void refine(int feature, Side& side) {
  if (std::exchange(side.refined[feature], 1)) return;
  if (feature < side.first_band()) {
    // The border of a disc is the end of its band.
    if (side.discs) refine(side.first_band(), side);
    MovedFacet& facet = side.facets[feature];
    facet.plane.offset = wide_plane(side, feature).offset.head, facet.nearest = facet.plane.offset * facet.plane.normal;
  } else if (feature < side.first_patch()) {
    const int e = feature - side.first_band();
    Band& band = side.bands[e];
    const auto [from, to] = ends_of_band(side, e);
    const WideVector begin = wide_corner(side, from), along = wide_along(side, e);
    const DoubleDouble t = dot(begin, along);
    const WideVector foot = begin - t * along;
    band.begin = t.head, band.end = dot(wide_corner(side, to), along).head, band.foot = side.rotation * rounded(foot);
    aim(band);
    band.rise = (DoubleDouble{side.r} - norm(foot)).head, band.near = band.rise * band.toward;
    side.ends[2 * e].plane.offset = band.begin, side.ends[2 * e + 1].plane.offset = -band.end;
    // Angles near the origin begin at 0.
    if (side.discs) band.middle = band.toward, band.across = cross(band.along, band.toward);
    if (!side.revolved())
      for (const int i : {2 * e, 2 * e + 1}) side.lines[i].plane.offset = dot(side.lines[i].plane.normal, band.foot);
  } else {
    const int v = feature - side.first_patch();
    Patch& patch = side.patches[v];
    if (!patch.to_origin) return;
    patch.rise = (DoubleDouble{side.r} - norm(wide_corner(side, v))).head, patch.near = patch.rise * patch.toward;
  }
}

/// The inside of a plane, or of a sphere about the centre of a disc, whose border is on it.
struct Limit {
  Plane plane;
  int element;
  int body;
  double radius = 0;  ///< of the sphere; 0 for a plane
  Vec3 place{};       ///< of the sphere, with the normal of `plane`: heights near it keep their digits

  double height(Vec3 point) const {
    if (radius == 0) return signed_distance(plane, point);
    const Vec3 from = point - place;
    return norm2(from) / (2 * radius) + dot(plane.normal, from);
  }
  double slope(Vec3 point, Vec3 rate) const {
    return dot(radius == 0 ? plane.normal : plane.normal + (point - place) / radius, rate);
  }
};
constexpr Limit kSeam{{}, -1, -1};

struct Root {
  double at;
  int limit;
};

struct TwoWork {
  std::array<Side, 2> sides;
  std::vector<Limit> limits;
  std::vector<Root> roots;
  std::vector<int> doubtful;
  std::vector<std::array<int, 2>> pairs;  ///< of features that may cross
};

struct At {
  Vec3 point, rate;
};

/// Where two features cross, as a function of a parameter s.
struct Curve {
  enum class Kind { kLine, kLong, kConic, kQuartic };
  Kind kind;
  /// start + s x, or start + cos s x + sin s y.
  Vec3 start, x, y;
  /// A long curve is start + s e + r u, for u = cos ψ x + sin ψ y and cos ψ = p + p1 s.
  /// A quartic is start + r u + t e, for u = cos ψ x + sin ψ y. With S = sin² ψ/2, t is `slant` sin ψ ± `stretch` times
  /// √((p − p1 S) (q + q1 S)). On a closed curve, sin ψ/2 = κ sin s, with p = p1 κ². Otherwise ψ = 2 s.
  Vec3 e;
  double r = 0, slant = 0, stretch = 1, p = 0, p1 = 0, q = 1, q1 = 0, kappa = 1, sign = 1;
  bool closed = false;
  double loss = 1;  ///< error of a point, relative to that of a place
  /// With a point for s = 0 or ψ = 0 in place of `start`, from double-doubles.
  bool exact = false;
  /// An exact conic has the sizes of the terms of the distance from the other surface, for 1, 1 − cos s and sin s. An
  /// exact quartic has 1 / (2 R) in `constant`, for the other radius R.
  double constant = 0, round = 0, tilt = 0;

  /// Sizes of the terms of a point, and of its distance from the other surface.
  struct Sizes {
    double place, off;
  };
  Sizes sizes(double sine, double cosine) const {
    const double whole = std::sqrt(norm2(start));
    if (kind == Kind::kConic) {
      const double less = 1 - cosine, beside = std::abs(sine);
      return {whole + less * std::sqrt(norm2(x)) + beside * std::sqrt(norm2(y)),
              constant + less * round + beside * tilt};
    }
    const double half_sine = closed ? kappa * sine : sine, square = half_sine * half_sine;
    const double w = 2 * std::abs(half_sine) * std::sqrt(std::max(0.0, 1 - square));
    const double other = q + q1 * square, root = std::sqrt(std::max(0.0, (p - p1 * square) * other));
    const double aside = std::abs(slant) * w, chord = std::abs(stretch) * root;
    return {whole + r * (2 * square + w) + aside + chord,
            constant * ((p + p1 * square) * other + 2 * root * (aside + chord) / std::abs(stretch))};
  }

  At operator()(double s) const {
    if (kind == Kind::kLine) return {start + s * x, x};
    if (kind != Kind::kLong) return (*this)(std::sin(s), std::cos(s));
    const double c = p + p1 * s, w = sign * std::sqrt((1 - c) * (1 + c));
    return {start + s * e + r * (c * x + w * y), e + r * p1 * (x - c / w * y)};
  }
  At operator()(double sine, double cosine) const {
    if (kind == Kind::kConic) {
      // 1 − cos s without a difference
      const double along = !exact ? cosine : cosine > 0 ? -sine * sine / (1 + cosine) : cosine - 1;
      return {start + along * x + sine * y, cosine * y - sine * x};
    }
    double half_sine = sine, half_cosine = cosine, turn = 2, half_rate = cosine, root, rate;
    if (closed) {
      half_sine = kappa * sine, half_cosine = std::sqrt((1 - half_sine) * (1 + half_sine));
      half_rate = kappa * cosine, turn = 2 * half_rate / half_cosine;
    }
    const double square = half_sine * half_sine, square_rate = 2 * half_sine * half_rate;
    if (closed) {
      const double other = std::sqrt(p * (q + q1 * square));
      root = cosine * other, rate = -sine * other + cosine * p * q1 * square_rate / (2 * other);
    } else {
      const double one = p - p1 * square, other = q + q1 * square;
      root = sign * std::sqrt(one * other), rate = (q1 * one - p1 * other) * square_rate / (2 * root);
    }
    const double c = 1 - 2 * square, w = 2 * half_sine * half_cosine;
    const double t = slant * w + stretch * root, t_rate = slant * c * turn + stretch * rate;
    return {start + r * ((exact ? -2 * square : c) * x + w * y) + t * e, r * turn * (c * y - w * x) + t_rate * e};
  }
};

class TwoRounded {
 public:
  /// In `wide` arithmetic, depths and curves come from double-doubles, and signs of depths are certain beyond `off`.
  TwoRounded(TwoWork& work, bool wide, double tie, double off, double extent)
      : work_(work), wide_(wide), tie_(tie), off_(off), extent_(extent) {}

  bool cross_all() {
    const std::array<std::span<const Around>, 2> around{work_.sides[0].around, work_.sides[1].around};
    work_.pairs.clear();
    size_t i = 0, k = 0;
    // The box that begins first is compared with all boxes of the other body that begin before its end.
    while (i < around[0].size() && k < around[1].size()) {
      const bool first = around[0][i].box.lower.x <= around[1][k].box.lower.x;
      const Around& one = first ? around[0][i] : around[1][k];
      const Side &side = work_.sides[first ? 0 : 1], &others = work_.sides[first ? 1 : 0];
      for (const Around& other : first ? around[1].subspan(k) : around[0].subspan(i)) {
        if (other.box.lower.x > one.box.upper.x) break;
        if (other.box.lower.y > one.box.upper.y || one.box.lower.y > other.box.upper.y) continue;
        if (other.box.lower.z > one.box.upper.z || one.box.lower.z > other.box.upper.z) continue;
        if (misses(side, one.feature, other.box) || misses(others, other.feature, one.box)) continue;
        if (first) work_.pairs.push_back({one.feature, other.feature});
        else work_.pairs.push_back({other.feature, one.feature});
      }
      first ? ++i : ++k;
    }
    if (wide_)
      for (const std::array<int, 2>& pair : work_.pairs)
        for (const int body : {0, 1}) refine(pair[body], work_.sides[body]);
    cancellation_point(work_.pairs.size());
    return std::ranges::all_of(work_.pairs, [&](const std::array<int, 2>& pair) { return cross(pair); });
  }

  /// `holds(i, point)` is the distance of a point from body i, negative inside.
  template <class Holds>
  bool add_all(Holds holds) {
    for (const int i : {0, 1})
      if (!add_side(i, holds)) return false;
    return true;
  }

  double volume() const { return thrice_ / 3; }
  bool crossed() const { return crossed_; }
  double error() const {
    const double reach = std::min(extent_, reach_);
    // Rounding of places leaves area vectors that do not add up to zero, but that is not an error of the volume.
    const double unbalanced = std::max(0.0, norm(unbalanced_) - kOfPlaces * border_ - gaps_);
    return off_ * area_ + (kOfTermsOfTwo * size_ + open_ + kOfPlaces * raised_) / 3 + unbalanced * reach;
  }

 private:
  // ---------------------------------------------------------------------------------------------------------- curves

  Vec3 normal_at(const Side& side, int feature, Vec3 point) const {
    if (feature < side.first_band()) return side.facets[feature].plane.normal;
    if (feature < side.first_patch()) {
      const Band& band = side.bands[feature - side.first_band()];
      const Vec3 from = point - band.foot;
      return (from - dot(from, band.along) * band.along) / side.r;
    }
    return (point - side.patches[feature - side.first_patch()].centre) / side.r;
  }

  /// Calls f(border, sign) for the planes around a feature. The feature is where they are negative, by their sign.
  template <class F>
  static void for_borders(const Side& side, int feature, F f) {
    if (feature < side.first_band()) {
      if (side.discs) return;
      const int begin = side.hull->ring_start[feature], end = side.hull->ring_start[feature + 1];
      for (int k = begin; k < end; ++k) f(side.lines[side.surface->sides[k]], 1);
    } else if (feature < side.first_patch()) {
      const int e = feature - side.first_band();
      f(side.ends[2 * e], -1), f(side.ends[2 * e + 1], -1);
      if (!side.revolved()) f(side.lines[2 * e], -1), f(side.lines[2 * e + 1], -1);
    } else if (side.revolved()) {
      f(side.ends[feature - side.first_patch()], 1);
    } else {
      const int v = feature - side.first_patch();
      for (const int e : side.surface->edges_at(v)) f(side.ends[2 * e + (side.surface->edges[e].from == v ? 0 : 1)], 1);
    }
  }

  void append_limits(int body, int feature, bool lines) {
    const Side& side = work_.sides[body];
    const int count = lines ? 0 : 2 * static_cast<int>(side.bands.size());
    for_borders(side, feature, [&](const Border& border, double sign) {
      if (border.element < count) return;
      work_.limits.push_back({{sign * border.plane.normal, sign * border.plane.offset}, border.element, body});
    });
  }

  bool is_disc(int body, int feature) const {
    return work_.sides[body].discs && feature < work_.sides[body].first_band();
  }
  /// The border of a disc.
  Limit rim(int body, int f) const {
    const Side& side = work_.sides[body];
    const Band& band = side.bands[0];
    const Vec3 place = band.near + (f == 0 ? band.begin : band.end) * band.along;
    return {{band.toward, 0}, side.ends[f].element, body, side.r, place};
  }

  /// True if a feature certainly has no point in a box.
  static bool misses(const Side& side, int feature, const Bounds& box) {
    const Vec3 middle = 0.5 * (box.lower + box.upper), half = 0.5 * (box.upper - box.lower);
    bool beyond = false;
    if (feature < side.first_band()) {
      const Plane& plane = side.facets[feature].plane;
      if (std::abs(signed_distance(plane, middle)) > dot(abs(plane.normal), half)) return true;
    } else {
      Vec3 from;
      if (feature < side.first_patch()) {
        const Band& band = side.bands[feature - side.first_band()];
        from = middle - band.foot;
        from -= dot(from, band.along) * band.along;
      } else {
        from = middle - side.patches[feature - side.first_patch()].centre;
      }
      const double distance = std::sqrt(norm2(from)), size = std::sqrt(norm2(half));
      if (std::abs(distance - side.r) > size) return true;
    }
    for_borders(side, feature, [&](const Border& border, double sign) {
      beyond = beyond || sign * signed_distance(border.plane, middle) > dot(abs(border.plane.normal), half);
    });
    return beyond;
  }

  /// True if all of a band or a sphere is certainly beyond a border of a feature of the other body.
  bool beyond(const Side& side, int round, const Side& other, int feature) const {
    const bool is_band = round < side.first_patch();
    const Band* band = is_band ? &side.bands[round - side.first_band()] : nullptr;
    const Vec3 from = is_band ? band->foot : side.patches[round - side.first_patch()].centre;
    bool found = false;
    for_borders(other, feature, [&](const Border& border, double sign) {
      const Vec3 normal = sign * border.plane.normal;
      double height = dot(normal, from) - sign * border.plane.offset;
      if (is_band) {
        const double m = dot(normal, band->middle), a = std::abs(dot(normal, band->across)),
                     t = dot(normal, band->along);
        const bool all = band->cosine < 0 || (m < 0 && a * band->cosine <= -m * band->sine);
        const double least = all ? -std::sqrt(m * m + a * a) : m * band->cosine - a * band->sine;
        height += side.r * least + std::min(t * band->begin, t * band->end);
      } else {
        height -= side.r;
      }
      found = found || height > tie_;
    });
    return found;
  }

  /// Adds where the features of the two bodies cross. False if that is not certain.
  bool cross(const std::array<int, 2>& features) {
    const Side &a = work_.sides[0], &b = work_.sides[1];
    features_ = features;
    const bool facet_a = features[0] < a.first_band(), facet_b = features[1] < b.first_band();
    if (facet_a && facet_b) return cross_facets();
    if (!facet_a && beyond(a, features[0], b, features[1])) return true;
    if (!facet_b && beyond(b, features[1], a, features[0])) return true;
    if (facet_a) return cross_facet(0);
    if (facet_b) return cross_facet(1);
    const bool band_a = features[0] < a.first_patch(), band_b = features[1] < b.first_patch();
    if (band_a && band_b) return cross_bands();
    if (band_a) return cross_band_and_patch(0);
    if (band_b) return cross_band_and_patch(1);
    return cross_patches();
  }

  bool cross_facets() {
    const Plane &one = work_.sides[0].facets[features_[0]].plane, &other = work_.sides[1].facets[features_[1]].plane;
    const Vec3 way = overlapper::cross(one.normal, other.normal);
    const double square = norm2(way);
    if (!(square > kAlike * kAlike)) {
      // Common points are nearer to the origin than `extent_`.
      const double facing = dot(one.normal, other.normal) > 0 ? 1 : -1;
      const double turned = std::sqrt(norm2(one.normal - facing * other.normal)) + 4 * kUnit;
      return std::abs(one.offset - facing * other.offset) > turned * extent_ + tie_;
    }
    Curve line{};
    line.loss = 1 / std::sqrt(square);
    line.kind = Curve::Kind::kLine, line.x = way / std::sqrt(square);
    line.start =
        (one.offset * overlapper::cross(other.normal, way) + other.offset * overlapper::cross(way, one.normal)) /
        square;
    return add_line(line);
  }

  /// Adds the part of a line on both features.
  bool add_line(const Curve& line) {
    work_.limits.clear();
    append_limits(0, features_[0], true), append_limits(1, features_[1], true);
    double low = -kInfinity, high = kInfinity;
    const Limit *lowest = nullptr, *highest = nullptr;
    for (const Limit& limit : work_.limits) {
      const double slope = dot(limit.plane.normal, line.x), height = signed_distance(limit.plane, line.start);
      if (std::abs(slope) < kAlike) {
        if (std::abs(height) < kAlike * extent_) return false;
        if (height > 0) return true;
        continue;
      }
      const double at = -height / slope;
      if (slope > 0 && at < high) high = at, highest = &limit;
      if (slope < 0 && at > low) low = at, lowest = &limit;
    }
    std::array<Limit, 2> rims;
    for (const int body : {0, 1}) {
      if (!is_disc(body, features_[body])) continue;
      rims[body] = rim(body, features_[body]);
      // The roots of s² + 2 b s + c
      const double r = rims[body].radius, c = 2 * r * rims[body].height(line.start);
      const double b = r * rims[body].slope(line.start, line.x), square = b * b - c;
      if (std::abs(square) < 2 * r * tie_) return false;
      if (square < 0) return true;
      const double larger = -(b + std::copysign(std::sqrt(square), b)), smaller = c / larger;
      if (std::max(larger, smaller) < high) high = std::max(larger, smaller), highest = &rims[body];
      if (std::min(larger, smaller) > low) low = std::min(larger, smaller), lowest = &rims[body];
    }
    if (std::abs(high - low) < tie_) return false;
    if (!(low < high)) return true;
    return lowest && highest && add(line, low, high, *lowest, *highest);
  }

  bool cross_facet(int body) {
    const Plane& plane = work_.sides[body].facets[features_[body]].plane;
    const Side& side = work_.sides[1 - body];
    const int feature = features_[1 - body];
    work_.limits.clear();
    append_limits(body, features_[body], true), append_limits(1 - body, feature, false);
    const bool disc = work_.sides[body].discs;
    const Limit border = disc ? rim(body, features_[body]) : Limit{};
    Curve conic{};
    conic.kind = Curve::Kind::kConic;
    double low = -kPi, high = kPi;
    Limit first = kSeam, last = kSeam;
    const bool is_band = feature < side.first_patch();
    if (is_band) {
      const Band& band = side.bands[feature - side.first_band()];
      const double slope = dot(plane.normal, band.along);
      if (std::abs(slope) < kAlike) return cross_parallel_band(body, slope);
      if (std::abs(slope) < kAlikeAxes && crosses_along(body, slope)) return cross_along(body, slope);
      conic.loss = 1 / std::abs(slope);
      const auto along_plane = [&](Vec3 way) { return way - dot(plane.normal, way) / slope * band.along; };
      conic.start = band.foot - signed_distance(plane, band.foot) / slope * band.along;
      conic.x = side.r * along_plane(band.middle), conic.y = side.r * along_plane(band.across);
      if (!side.revolved()) {
        const int e = feature - side.first_band();
        low = -band.half, high = band.half;
        first = {{}, side.lines[2 * e].element, 1 - body}, last = {{}, side.lines[2 * e + 1].element, 1 - body};
      }
      if (disc) {
        const double distance = std::sqrt(norm2(conic.start - (border.place - border.radius * border.plane.normal)));
        const double most = std::sqrt(norm2(conic.x) + norm2(conic.y));
        if (distance - most > border.radius + tie_) return true;
        if (!(distance + most < border.radius - tie_)) work_.limits.push_back(border);
      }
      if (wide_) {
        const double at = sharpen_ellipse(conic, body, feature - side.first_band());
        low -= at, high -= at;
      }
    } else {
      const int v = feature - side.first_patch();
      const Vec3 centre = side.patches[v].centre;
      const double depth = wide_ ? wide_depth_below(body, features_[body], v) : side.r - signed_distance(plane, centre);
      if (std::abs(depth) < sure_ || std::abs(2 * side.r - depth) < sure_) return false;
      if (depth < 0 || depth > 2 * side.r) return true;
      circle(conic, plane.offset * plane.normal + (centre - dot(plane.normal, centre) * plane.normal), plane.normal,
             std::sqrt(depth * (2 * side.r - depth)));
      const Vec3 apart = conic.start - (border.place - border.radius * border.plane.normal);
      if (wide_) {
        const auto [across, offset] = wide_facet(body, features_[body]);
        const WideVector middle = side.wide_rotation * wide_corner(side, v);
        sharpen_circle(conic, across, offset, middle, side.r, DoubleDouble{side.r} - (dot(across, middle) - offset), 0);
      }
      if (disc) {
        // Two circles in a plane cross where the line through both points cuts them.
        const double distance = std::sqrt(norm2(apart)), radius = std::sqrt(norm2(conic.x));
        const double within = border.radius - std::abs(distance - radius), all = border.radius - distance - radius;
        if (std::abs(within) < tie_ || std::abs(all) < tie_) return false;
        if (within < 0) return true;
        if (all < 0) {
          const Vec3 normal = apart / distance, begin = conic.exact ? conic.start : conic.start + conic.x;
          const double height = border.radius * border.height(begin) / distance;
          work_.limits.push_back({{normal, dot(normal, begin) - height}, border.element, body});
        }
      }
    }
    return divide(conic, low, high, first, last);
  }

  /// The same for a facet and a band that is parallel to it: two lines. Up to kOfPlaces, what they turn is rounding.
  bool cross_parallel_band(int body, double slope) {
    const Plane& plane = work_.sides[body].facets[features_[body]].plane;
    const Side& side = work_.sides[1 - body];
    const Band& band = side.bands[features_[1 - body] - side.first_band()];
    const double height = signed_distance(plane, band.foot), depth = side.r - std::abs(height);
    if (-depth > std::abs(slope) * extent_ + tie_) return true;
    if (wide_ || !(depth > tie_)) return false;
    if (std::abs(slope) > kOfPlaces) return crosses_along(body, slope) && cross_along(body, slope);
    const double width = std::sqrt(depth * (side.r + std::abs(height)));
    return add_two_lines(band, unit(plane.normal - slope * band.along), -height, width, side.r / width);
  }

  /// True if the plane of a facet cuts both ends of a band, and more than it turns on the way.
  bool crosses_along(int body, double slope) const {
    const Plane& plane = work_.sides[body].facets[features_[body]].plane;
    const Side& side = work_.sides[1 - body];
    const Band& band = side.bands[features_[1 - body] - side.first_band()];
    const double height = signed_distance(plane, band.foot);
    const double farthest = std::max(std::abs(height + slope * band.begin), std::abs(height + slope * band.end));
    return !wide_ && side.r - farthest > std::abs(slope) * (side.r + band.end - band.begin) + tie_;
  }

  /// Adds the two curves in which a facet crosses a band that is nearly parallel to it.
  bool cross_along(int body, double slope) {
    const Plane& plane = work_.sides[body].facets[features_[body]].plane;
    const Side& side = work_.sides[1 - body];
    const int e = features_[1 - body] - side.first_band();
    const Band& band = side.bands[e];
    const double height = signed_distance(plane, band.foot), across = std::sqrt((1 - slope) * (1 + slope));
    work_.limits.clear();
    if (!side.revolved())
      for (const Border& line : {side.lines[2 * e], side.lines[2 * e + 1]})
        work_.limits.push_back({{-line.plane.normal, -line.plane.offset}, line.element, 1 - body});
    append_limits(body, features_[body], true);
    if (work_.sides[body].discs) work_.limits.push_back(rim(body, features_[body]));
    Curve curve{};
    curve.kind = Curve::Kind::kLong, curve.start = band.foot, curve.e = band.along, curve.r = side.r;
    curve.x = unit(plane.normal - slope * band.along), curve.y = overlapper::cross(band.along, curve.x);
    curve.p = -height / (side.r * across), curve.p1 = -slope / (side.r * across);
    const double most = std::max(std::abs(curve.p + curve.p1 * band.begin), std::abs(curve.p + curve.p1 * band.end));
    curve.loss = 1 / std::sqrt((1 - most) * (1 + most));
    const Limit first{{}, side.ends[2 * e].element, 1 - body}, last{{}, side.ends[2 * e + 1].element, 1 - body};
    for (const double sign : {1.0, -1.0}) {
      curve.sign = sign;
      if (!divide(curve, band.begin, band.end, first, last)) return false;
    }
    return true;
  }

  /// Adds two lines along a band, at `level` from its axis in the direction `x`, and at `width` beside that.
  bool add_two_lines(const Band& band, Vec3 x, double level, double width, double loss) {
    const Vec3 y = overlapper::cross(band.along, x);
    Curve line{};
    line.kind = Curve::Kind::kLine, line.x = band.along, line.loss = loss;
    for (const double sign : {1.0, -1.0}) {
      line.start = band.foot + level * x + sign * width * y;
      if (!add_line(line)) return false;
    }
    return true;
  }

  /// How deep the sphere of a patch reaches below the plane of a facet of another body.
  double wide_depth_below(int body, int f, int v) const {
    const Side &side = work_.sides[body], &other = work_.sides[1 - body];
    const WidePlane plane = wide_plane(side, f);
    const WideVector centre = apply_transposed(side.wide_rotation, other.wide_rotation * wide_corner(other, v));
    return (DoubleDouble{other.r} - signed_distance(plane, centre)).head;
  }
  double wide_depth_of_patches(int v, int w) const {
    const Side &a = work_.sides[0], &b = work_.sides[1];
    const WideVector apart = b.wide_rotation * wide_corner(b, w) - a.wide_rotation * wide_corner(a, v);
    return (two_sum(a.r, b.r) - norm(apart)).head;
  }
  double wide_depth_at_band(int body, int e, int v) const {
    const Side &side = work_.sides[body], &other = work_.sides[1 - body];
    const WideVector centre = apply_transposed(side.wide_rotation, other.wide_rotation * wide_corner(other, v));
    const WideVector apart = centre - wide_corner(side, ends_of_band(side, e).first);
    return (two_sum(side.r, other.r) - norm(overlapper::cross(apart, wide_along(side, e)))).head;
  }
  double wide_depth_of_bands(int e, int g) const {
    const Side &a = work_.sides[0], &b = work_.sides[1];
    const WideVector along = a.wide_rotation * wide_along(a, e), far = b.wide_rotation * wide_along(b, g);
    const WideVector apart = b.wide_rotation * wide_corner(b, ends_of_band(b, g).first) -
                             a.wide_rotation * wide_corner(a, ends_of_band(a, e).first);
    const WideVector common = overlapper::cross(along, far);
    return (two_sum(a.r, b.r) - abs(dot(apart, common)) / norm(common)).head;
  }

  static void circle(Curve& conic, Vec3 centre, Vec3 axis, double radius) {
    conic.kind = Curve::Kind::kConic;
    const Vec3 x = beside(axis);
    conic.start = centre, conic.x = radius * x, conic.y = radius * overlapper::cross(axis, x);
  }

  bool cross_patches() {
    const Side &a = work_.sides[0], &b = work_.sides[1];
    const int v = features_[0] - a.first_patch(), w = features_[1] - b.first_patch();
    const Vec3 from = a.patches[v].centre, apart = b.patches[w].centre - from;
    const double distance = std::sqrt(norm2(apart)), nested = distance - std::abs(a.r - b.r);
    const double depth = wide_ ? wide_depth_of_patches(v, w) : a.r + b.r - distance;
    if (std::abs(depth) < sure_ || std::abs(nested) < tie_) return false;
    if (depth < 0 || nested < 0) return true;
    // From the centre of a: level, and a.r − level.
    const double below = depth * (b.r + distance - a.r) / (2 * distance), level = a.r - below;
    Curve conic{};
    const Vec3 axis = apart / distance;
    circle(conic, from + level * axis, axis, std::sqrt(below * (a.r + level)));
    if (wide_) sharpen_patches(conic, v, w);
    work_.limits.clear();
    append_limits(0, features_[0], true), append_limits(1, features_[1], true);
    return divide(conic, -kPi, kPi, kSeam, kSeam);
  }

  bool cross_band_and_patch(int body) {
    const Side &side = work_.sides[body], &other = work_.sides[1 - body];
    const Band& band = side.bands[features_[body] - side.first_band()];
    const int v = features_[1 - body] - other.first_patch();
    const Vec3 apart = other.patches[v].centre - band.foot;
    const double foot = dot(apart, band.along), r = side.r, ball = other.r;
    const Vec3 across = apart - foot * band.along;
    const double distance = std::sqrt(norm2(across));
    Curve quartic{};
    quartic.kind = Curve::Kind::kQuartic;
    const double depth = wide_ ? wide_depth_at_band(body, features_[body] - side.first_band(), v) : ball + r - distance;
    const double deep = ball - r + distance;
    if (std::abs(depth) < sure_ || std::abs(deep) < tie_) return false;
    if (depth < 0 || deep < 0) return true;
    quartic.p = depth * deep;
    const double reach = std::sqrt(quartic.p);
    if (foot + reach < band.begin - tie_ || foot - reach > band.end + tie_) return true;
    quartic.start = band.foot + foot * band.along, quartic.e = band.along, quartic.r = r;
    quartic.x = distance > tie_ ? across_axis(across, band.along) : any_orthogonal(band.along);
    quartic.y = overlapper::cross(band.along, quartic.x);
    quartic.p1 = 4 * distance * r;
    if (wide_) sharpen_band_and_patch(quartic, body, features_[body] - side.first_band(), v);
    return divide_quartic(quartic, body, band);
  }

  bool cross_bands() {
    // From the band with the smaller radius.
    const int body = work_.sides[0].r <= work_.sides[1].r ? 0 : 1;
    const Side &side = work_.sides[body], &other = work_.sides[1 - body];
    const Band& band = side.bands[features_[body] - side.first_band()];
    const Band& far = other.bands[features_[1 - body] - other.first_band()];
    const double r = side.r, ball = other.r;
    Vec3 common = overlapper::cross(band.along, far.along);
    const double sine = std::sqrt(norm2(common)), cosine = dot(band.along, far.along);
    const Vec3 apart = far.foot - band.foot;
    if (!(sine > kAlikeAxes)) {
      // The nearest points of the segments of both axes may be anywhere.
      const Vec3 across = apart - dot(apart, band.along) * band.along;
      const double distance = std::sqrt(norm2(across));
      const double turned = sine * std::max(std::abs(far.begin), std::abs(far.end)) + tie_;
      if (distance - turned > r + ball || distance + turned + ball * sine * sine < ball - r) return true;
      // Up to kOfPlaces, what they turn is rounding. The sections are circles.
      const double depth = r + ball - distance, below = depth * (ball + distance - r) / (2 * distance);
      if (wide_ || sine > kOfPlaces || !(depth > tie_) || !(distance - (ball - r) > tie_)) return false;
      const double level = r - below, width = std::sqrt(below * (r + level));
      return add_two_lines(band, across_axis(across, band.along), level, width, r * ball / (distance * width));
    }
    common = common / sine;
    const double foot = dot(overlapper::cross(apart, far.along), common) / sine;
    const double far_foot = dot(overlapper::cross(apart, band.along), common) / sine;
    const Vec3 between = apart + far_foot * far.along - foot * band.along;
    double distance = dot(between, common);
    if (distance < 0) common = -common, distance = -distance;
    const double depth = wide_ ? wide_depth_of_bands(features_[0] - work_.sides[0].first_band(),
                                                     features_[1] - work_.sides[1].first_band())
                               : r + ball - distance;
    if (std::abs(depth) < sure_) return false;
    if (depth < 0) return true;
    const double reach = (ball + r * std::abs(cosine)) / sine, far_reach = (r + ball * std::abs(cosine)) / sine;
    if (foot + reach < band.begin - tie_ || foot - reach > band.end + tie_) return true;
    if (far_foot + far_reach < far.begin - tie_ || far_foot - far_reach > far.end + tie_) return true;
    Curve quartic{};
    quartic.kind = Curve::Kind::kQuartic;
    quartic.start = band.foot + foot * band.along, quartic.e = band.along, quartic.r = r;
    quartic.x = common, quartic.y = overlapper::cross(band.along, common);
    // Across both axes, a point of the band is r sin ψ cos γ + t e · (far × common) from the other axis.
    const double along = dot(band.along, overlapper::cross(far.along, common));
    const double turned = dot(quartic.y, overlapper::cross(far.along, common));
    quartic.slant = -r * turned / along, quartic.stretch = 1 / along, quartic.loss = 1 / sine;
    quartic.p = depth, quartic.p1 = 2 * r, quartic.q = ball - r + distance, quartic.q1 = 2 * r;
    if (wide_)
      sharpen_bands(quartic, body, features_[body] - side.first_band(), features_[1 - body] - other.first_band());
    return divide_quartic(quartic, body, band);
  }

  // ---------------------------------------------------------------------------------------------------- exact curves
  // In a shallow contact, surfaces cross at small angles, and a curve loses what these angles lose. So they come from
  // double-doubles, and points are sums from a point near the origin.

  /// A plane or an axis, in the directions of the common coordinates.
  std::pair<WideVector, DoubleDouble> wide_facet(int body, int f) const {
    const WidePlane plane = wide_plane(work_.sides[body], f);
    return {work_.sides[body].wide_rotation * plane.normal, plane.offset};
  }
  struct WideAxis {
    WideVector along, foot;
  };
  WideAxis wide_axis(int body, int e) const {
    const Side& side = work_.sides[body];
    const WideVector along = side.wide_rotation * wide_along(side, e),
                     begin = side.wide_rotation * wide_corner(side, ends_of_band(side, e).first);
    return {along, begin - dot(begin, along) * along};
  }

  /// The ellipse of a facet and a band. It begins at the direction from the band's axis to the origin. Returns its
  /// angle.
  double sharpen_ellipse(Curve& conic, int body, int e) const {
    const auto [across, offset] = wide_facet(body, features_[body]);
    const auto [along, foot] = wide_axis(1 - body, e);
    const DoubleDouble distance = norm(foot), r{work_.sides[1 - body].r}, rise = r - distance;
    const Band& band = work_.sides[1 - body].bands[e];
    if (!(distance.head > r.head / 2)) return 0;
    const WideVector toward = -(foot / distance), beside = overlapper::cross(along, toward);
    const DoubleDouble by_toward = dot(across, toward), by_beside = dot(across, beside), slope = dot(across, along),
                       left = offset - rise * by_toward;
    const Vec3 e_rounded = rounded(along), w = rounded(toward);
    conic.start = rise.head * w + (left / slope).head * e_rounded;
    conic.x = r.head * (w - (by_toward / slope).head * e_rounded);
    conic.y = r.head * (rounded(beside) - (by_beside / slope).head * e_rounded);
    conic.constant = std::abs(left.head), conic.round = r.head * std::abs(by_toward.head),
    conic.tilt = r.head * std::abs(by_beside.head), conic.exact = true;
    return std::atan2(dot(w, band.across), dot(w, band.middle));
  }

  /// The circle of a plane and a sphere that reaches `depth` below it. `more` is 1 / r of another sphere in place of
  /// the plane.
  void sharpen_circle(Curve& conic, const WideVector& across, DoubleDouble offset, const WideVector& centre, double r,
                      DoubleDouble depth, double more) const {
    const WideVector beside = centre - dot(across, centre) * across;
    const DoubleDouble distance = norm(beside), square = depth * (DoubleDouble{2 * r} - depth);
    const double radius = std::sqrt(square.head);
    const Vec3 axis = rounded(across);
    // If the centre is across the plane from the origin up to rounding, it is in no certain direction.
    Vec3 away = distance.head > 0 ? -rounded(beside / distance) : Vec3{};
    away = away - dot(away, axis) * axis;
    away = norm2(away) > 0.5 ? unit(away) : any_orthogonal(axis);
    const double inside = (distance * distance - square).head / (distance.head + radius);
    conic.start = offset.head * axis - inside * away;
    conic.x = radius * away, conic.y = radius * overlapper::cross(axis, away);
    const double slope = radius * (1 / r + more);
    conic.constant = slope * std::sqrt(norm2(conic.start)), conic.round = conic.tilt = slope * radius;
    conic.exact = true;
  }
  void sharpen_patches(Curve& conic, int v, int w) const {
    const Side &a = work_.sides[0], &b = work_.sides[1];
    const WideVector from = a.wide_rotation * wide_corner(a, v), apart = b.wide_rotation * wide_corner(b, w) - from;
    const DoubleDouble distance = norm(apart), depth = two_sum(a.r, b.r) - distance;
    const DoubleDouble below =
        depth * (DoubleDouble{b.r} + distance - DoubleDouble{a.r}) / (DoubleDouble{2} * distance);
    const WideVector axis = apart / distance;
    sharpen_circle(conic, axis, dot(axis, from) + (DoubleDouble{a.r} - below), from, a.r, below, 1 / b.r);
  }

  void sharpen_band_and_patch(Curve& quartic, int body, int e, int v) const {
    const Side &side = work_.sides[body], &other = work_.sides[1 - body];
    const auto [along, foot] = wide_axis(body, e);
    const WideVector centre = other.wide_rotation * wide_corner(other, v), apart = centre - foot,
                     across = apart - dot(apart, along) * along;
    const DoubleDouble distance = norm(across), r{side.r}, ball{other.r};
    if (!(distance.head > (r.head + ball.head) / 2)) return;
    const WideVector way = across / distance;
    quartic.start = rounded(centre - (distance - r) * way);
    quartic.x = rounded(way), quartic.e = rounded(along), quartic.y = rounded(overlapper::cross(along, way));
    quartic.p = ((ball + r - distance) * (ball - r + distance)).head, quartic.p1 = 4 * distance.head * r.head;
    quartic.constant = 1 / (2 * ball.head), quartic.exact = true;
  }
  void sharpen_bands(Curve& quartic, int body, int e, int g) const {
    const auto [along, foot] = wide_axis(body, e);
    const auto [far, far_foot] = wide_axis(1 - body, g);
    const DoubleDouble r{work_.sides[body].r}, ball{work_.sides[1 - body].r};
    const WideVector both = overlapper::cross(along, far), apart = far_foot - foot;
    const DoubleDouble sine = norm(both);
    WideVector common = both / sine;
    DoubleDouble distance = dot(apart, common);
    const DoubleDouble at = dot(overlapper::cross(apart, far), common) / sine;
    if (distance < DoubleDouble{0}) common = -common, distance = -distance;
    if (!(distance.head > (r.head + ball.head) / 2)) return;
    const WideVector beside = overlapper::cross(along, common), across = overlapper::cross(far, common);
    const DoubleDouble slope = dot(along, across);
    quartic.start = rounded(foot + at * along + r * common);
    quartic.x = rounded(common), quartic.e = rounded(along), quartic.y = rounded(beside);
    quartic.slant = -(r * dot(beside, across) / slope).head, quartic.stretch = (DoubleDouble{1} / slope).head;
    quartic.p = (r + ball - distance).head, quartic.q = (ball - r + distance).head;
    quartic.constant = 1 / (2 * ball.head), quartic.exact = true;
  }

  bool divide_quartic(Curve& quartic, int body, const Band& band) {
    const Side& side = work_.sides[body];
    work_.limits.clear();
    append_limits(body, features_[body], false), append_limits(1 - body, features_[1 - body], true);
    const double ratio = quartic.p1 > 0 ? std::sqrt(quartic.p / quartic.p1) : kInfinity;
    quartic.closed = ratio < 1, quartic.kappa = std::min(ratio, 1.0);
    Limit low = kSeam, high = kSeam;
    double start = -kPi, end = kPi;
    if (!side.revolved()) {
      const int e = features_[body] - side.first_band();
      low = {{}, side.lines[2 * e].element, body}, high = {{}, side.lines[2 * e + 1].element, body};
      const double at = std::atan2(dot(quartic.x, band.across), dot(quartic.x, band.middle));
      start = -band.half - at, end = band.half - at;
    }
    for (const double turn : {-2 * kPi, 0.0, 2 * kPi}) {
      const double from = std::max(start + turn, -kPi), to = std::min(end + turn, kPi);
      // In aligned bodies, a band may begin or end where ψ does, up to rounding.
      constexpr double kSame = 16 * kUnit;
      if (!(to - from > kSame)) continue;
      Limit first = start + turn > -kPi - kSame ? low : kSeam, last = end + turn < kPi + kSame ? high : kSeam;
      if (!quartic.closed) {
        for (const double sign : {1.0, -1.0}) {
          quartic.sign = sign;
          if (!divide(quartic, from / 2, to / 2, first, last)) return false;
        }
        continue;
      }
      const auto place = [&](double psi, Limit& limit) {
        const double sine = std::sin(psi / 2) / quartic.kappa;
        if (std::abs(sine) < 1) return std::asin(sine);
        limit = kSeam;
        return std::copysign(kPi / 2, sine);
      };
      const double a = place(from, first), b = place(to, last);
      if (!(a < b)) continue;
      if (!divide(quartic, a, b, first, last) || !divide(quartic, kPi - b, kPi - a, last, first)) return false;
    }
    return true;
  }

  // ------------------------------------------------------------------------------------------------ parts of a curve

  /// Adds the parts of a curve from `low` to `high` that are within all limits.
  bool divide(const Curve& curve, double low, double high, const Limit& first, const Limit& last) {
    work_.roots.clear(), work_.doubtful.clear();
    constexpr int kFirst = -1, kLast = -2;
    const int count = static_cast<int>(work_.limits.size());
    // A sphere is the last limit.
    const int planes = count > 0 && work_.limits.back().radius > 0 ? count - 1 : count;
    if (curve.kind == Curve::Kind::kConic) {
      for (int l = 0; l < planes; ++l) {
        const Plane& plane = work_.limits[l].plane;
        const double a = dot(plane.normal, curve.x), b = dot(plane.normal, curve.y), size = std::sqrt(a * a + b * b);
        const double c = signed_distance(plane, curve.start) - (curve.exact ? a : 0);
        if (std::abs(std::abs(c) - size) < tie_) return false;
        if (c > size) return true;
        if (c > -size) work_.doubtful.push_back(l);
      }
      for (const int l : work_.doubtful) {
        const Plane& plane = work_.limits[l].plane;
        const double a = dot(plane.normal, curve.x), b = dot(plane.normal, curve.y);
        const double height = signed_distance(plane, curve.start);
        std::array<double, 2> angles;
        if (curve.exact) {
          // By the tangent of half an angle, near 0 without a difference.
          const double steep = 2 * a - height, root = std::sqrt(std::max(0.0, b * b + height * steep));
          const double sum = b + std::copysign(root, b);
          angles = {2 * std::atan2(sum, steep), 2 * std::atan2(-height, sum)};
        } else {
          const double size = std::sqrt(a * a + b * b), middle = std::atan2(b, a), off = std::acos(-height / size);
          angles = {middle - off, middle + off};
        }
        for (const double root : angles)
          for (const double turn : {-2 * kPi, 0.0, 2 * kPi})
            if (root + turn > low && root + turn < high) work_.roots.push_back({root + turn, l});
      }
      if (planes < count && !find_roots(curve, low, high, planes)) return true;
    } else if (!find_roots(curve, low, high, 0)) {
      return true;
    }
    if (failed_) return false;
    work_.roots.push_back({low, kFirst}), work_.roots.push_back({high, kLast});
    std::ranges::sort(work_.roots, {}, &Root::at);
    const auto limit_of = [&](int l) -> const Limit& {
      return l == kFirst ? first : l == kLast ? last : work_.limits[l];
    };
    for (size_t i = 0; i + 1 < work_.roots.size(); ++i) {
      const Root from = work_.roots[i], to = work_.roots[i + 1];
      const Vec3 middle = curve((from.at + to.at) / 2).point;
      bool within = true, certain = true;
      for (const int l : work_.doubtful) {
        const double height = work_.limits[l].height(middle);
        within = within && height < tie_, certain = certain && height < -tie_;
      }
      if (!within) continue;
      if (!certain || !add(curve, from.at, to.at, limit_of(from.limit), limit_of(to.limit))) return false;
    }
    return true;
  }

  /// Finds where a curve passes its limits from number `from` on. False if all of it is beyond one of them.
  bool find_roots(const Curve& curve, double low, double high, int from) {
    constexpr int kMost = 16;
    std::array<At, kMost + 1> samples;
    const int parts = high - low > 1 ? kMost : kMost / 2;
    const double step = (high - low) / parts, sine = std::sin(step), cosine = std::cos(step);
    double s = std::sin(low), c = std::cos(low);
    for (int i = 0; i <= parts; ++i) {
      samples[i] = curve.kind == Curve::Kind::kLong ? curve(low + i * step) : curve(s, c);
      const double next = s * cosine + c * sine;
      c = c * cosine - s * sine, s = next;
    }
    const auto place = [&](int i) { return i == parts ? high : low + i * step; };
    for (int l = from; l < static_cast<int>(work_.limits.size()); ++l) {
      const Limit& limit = work_.limits[l];
      const size_t before = work_.roots.size();
      double height = limit.height(samples[0].point), rise = limit.slope(samples[0].point, samples[0].rate);
      double least = std::abs(height);
      for (int i = 0; i < parts; ++i) {
        const double next = limit.height(samples[i + 1].point),
                     next_rise = limit.slope(samples[i + 1].point, samples[i + 1].rate);
        // Between heights of the same side there is no root, unless they turn.
        const bool steady = height > 0 ? next > 0 && !(rise < 0 && next_rise > 0)
                                       : height < 0 && next < 0 && !(rise > 0 && next_rise < 0);
        if (!steady) find_root(curve, limit, l, place(i), samples[i], place(i + 1), samples[i + 1], 0);
        height = next, rise = next_rise, least = std::min(least, std::abs(next));
      }
      if (work_.roots.size() > before) work_.doubtful.push_back(l);
      // A long curve may run along its limit.
      else if (curve.kind == Curve::Kind::kLong && least < tie_) failed_ = true;
      else if (height > 0) return false;
    }
    return true;
  }

  void find_root(const Curve& curve, const Limit& limit, int l, double from, const At& a, double to, const At& b,
                 int halvings) {
    const double step = to - from;
    double one = limit.height(a.point), other = limit.height(b.point);
    double rise = step * limit.slope(a.point, a.rate), other_rise = step * limit.slope(b.point, b.rate);
    const bool changes = (one > 0) != (other > 0);
    if (one < 0 || (one == 0 && other > 0)) one = -one, other = -other, rise = -rise, other_rise = -other_rise;
    bool sure = changes ? rise < 0 && other_rise < 0 : !(rise < 0 && other_rise > 0);
    if (!changes && !sure) {
      // The least value of the cubic is not below that of both tangents.
      const double meet = (other - other_rise - one) / (rise - other_rise);
      sure = one + rise * meet > 0.2 * std::min(one, other);
    }
    constexpr int kMostHalvings = 12;
    if (!sure && halvings < kMostHalvings) {
      const double middle = (from + to) / 2;
      const At between = curve(middle);
      find_root(curve, limit, l, from, a, middle, between, halvings + 1);
      find_root(curve, limit, l, middle, between, to, b, halvings + 1);
      return;
    }
    if (!sure) failed_ = true;
    if (!changes) return;
    // Newton's steps, or halves.
    const double sign = limit.height(a.point) > 0 || one == 0 ? 1 : -1;
    double low = from, high = to, at = from + step * one / (one - other);
    for (int i = 0; i < 60; ++i) {
      const At here = curve(at);
      const double height = sign * limit.height(here.point), slope = sign * limit.slope(here.point, here.rate);
      (height > 0 ? low : high) = at;
      double next = at - height / slope;
      if (!(next > low && next < high)) next = (low + high) / 2;
      if (std::abs(next - at) <= 4 * kUnit * std::max(std::abs(at), step)) break;
      at = next;
    }
    work_.roots.push_back({at, l});
  }

  /// A feature with a curve on its border, and the sign of its direction.
  struct Target {
    int body, feature;
    double sign;
  };
  /// Facet: twice the area. Band and patch: ∫ 1, 1 − w · u over φ and t or over the solid angle, and ∫ u over the area.
  static constexpr int kTerms = 5;
  using Terms = std::array<double, kTerms>;

  /// Adds a part of a curve to the borders of both features.
  bool add(const Curve& curve, double low, double high, const Limit& first, const Limit& last) {
    const Vec3 middle = curve((low + high) / 2).point, rate = curve((low + high) / 2).rate;
    std::array<Vec3, 2> normals;
    for (const int i : {0, 1}) normals[i] = normal_at(work_.sides[i], features_[i], middle);
    const Vec3 way = overlapper::cross(normals[0], normals[1]);
    const double forwards = dot(way, rate);
    if (!(std::abs(forwards) > kAlike * std::sqrt(norm2(rate)))) return false;
    for (const auto& [limit, s] : {std::pair(&first, low), std::pair(&last, high)}) {
      if (limit->element < 0) continue;
      const At end = curve(s);
      const Side& side = work_.sides[limit->body];
      const int other = 1 - limit->body, lines = 2 * static_cast<int>(side.bands.size());
      const Band& band = side.bands[(limit->element % lines) / 2];
      const Vec3 from = end.point - band.foot, outward = normal_at(work_.sides[other], features_[other], end.point);
      const bool line = limit->element < lines;
      const Vec3 along = line ? band.along : overlapper::cross(band.along, from) / side.r;
      // From a band's middle to the origin, places near the origin keep their digits.
      const Vec3 near = side.discs && wide_ ? end.point - band.near : from;
      const double ahead = dot(near, band.middle) + (side.discs && wide_ ? side.r : 0);
      const double at = line ? dot(end.point, band.along) : std::atan2(dot(near, band.across), ahead);
      const double slope = dot(along, outward);
      if (!(std::abs(slope) > kAlike)) return false;
      double moment = 0;
      Terms unused;
      for (const int i : {0, 1}) {
        const double height = terms({i, features_[i], 1}, end, unused);
        moment = std::max(moment, height * arm(work_.sides[i], features_[i], end.point));
      }
      work_.sides[limit->body].crossings.push_back({limit->element, at, slope > 0, end.point, moment});
    }
    crossed_ = true;
    const double side = forwards > 0 ? 1 : -1;
    std::array<Target, 2> targets;
    for (const int i : {0, 1}) {
      work_.sides[i].crossed[features_[i]] = 1;
      targets[i] = {i, features_[i], i == 0 ? side : -side};
    }
    return integrate(curve, low, high, targets, 0);
  }

  // ------------------------------------------------------------------------------------------------------- integrals

  /// Finds the terms of the border of a feature at a point. Returns a bound of |x · u|.
  double terms(const Target& target, const At& at, Terms& result) {
    const Side& side = work_.sides[target.body];
    const int feature = target.feature;
    double height;
    if (feature < side.first_band()) {
      const MovedFacet& facet = side.facets[feature];
      result = {dot(facet.plane.normal, overlapper::cross(at.point - facet.nearest, at.rate)), 0, 0, 0, 0};
      height = facet.plane.offset;
    } else if (feature < side.first_patch()) {
      const Band& band = side.bands[feature - side.first_band()];
      const Vec3 from = at.point - band.near;
      const double t = dot(from, band.along), minus_t = band.base - t;
      const Vec3 apart = from - t * band.along, out = apart + side.r * band.toward,
                 turn = overlapper::cross(at.rate, band.along);
      const double rate = minus_t * dot(out, turn) / (side.r * side.r);
      const double versine = norm2(apart) / (2 * side.r * side.r);
      result = {rate, versine * rate, minus_t * turn.x, minus_t * turn.y, minus_t * turn.z};
      height = band.rise + band.lever * versine;
    } else {
      const Patch& patch = side.patches[feature - side.first_patch()];
      const Vec3 apart = at.point - patch.near;
      const double versine = norm2(apart) / (2 * side.r * side.r);
      const double rate = dot(patch.toward, overlapper::cross(apart, at.rate)) / (side.r * side.r * (2 - versine));
      const Vec3 swept = 0.5 * overlapper::cross(at.point, at.rate);
      result = {rate, versine * rate / 2, swept.x, swept.y, swept.z};
      height = std::abs(patch.rise + patch.lever * versine) + std::sqrt(norm2(patch.aside));
    }
    return std::abs(height);
  }

  /// m: a gap in a border near a point changes the area by at most the gap times this.
  static double arm(const Side& side, int feature, Vec3 point) {
    const double distance = std::sqrt(norm2(point));
    if (feature < side.first_patch()) return distance;
    const Patch& patch = side.patches[feature - side.first_patch()];
    // Solid angles are seen from the centre, about `toward`.
    return std::max(distance, std::sqrt(norm2(overlapper::cross(point - patch.centre, patch.toward))));
  }

  /// Three times the volume that the terms of a feature add, and the sum of the sizes.
  std::pair<double, double> cone(const Target& target, const Terms& term) const {
    const Side& side = work_.sides[target.body];
    const int feature = target.feature;
    if (feature < side.first_band()) {
      const double value = side.facets[feature].plane.offset * term[0] / 2;
      return {value, std::abs(value)};
    }
    if (feature < side.first_patch()) {
      const Band& band = side.bands[feature - side.first_band()];
      const double plain = side.r * band.rise * term[0], cap = side.r * band.lever * term[1];
      return {plain + cap, std::abs(plain) + std::abs(cap)};
    }
    const Patch& patch = side.patches[feature - side.first_patch()];
    const double square = side.r * side.r, angle = square * patch.rise * term[0], cap = square * patch.lever * term[1];
    const double x = patch.aside.x * term[2], y = patch.aside.y * term[3], z = patch.aside.z * term[4];
    return {angle + cap + x + y + z, std::abs(angle) + std::abs(cap) + std::abs(x) + std::abs(y) + std::abs(z)};
  }

  void put(const Target& target, const Terms& term) {
    Side& side = work_.sides[target.body];
    const int feature = target.feature;
    const double sign = target.sign;
    if (feature < side.first_band()) {
      side.facets[feature].twice_area += sign * term[0];
    } else if (feature < side.first_patch()) {
      Band& band = side.bands[feature - side.first_band()];
      band.plain += sign * term[0], band.cap += sign * term[1], band.vector += sign * Vec3{term[2], term[3], term[4]};
    } else {
      Patch& patch = side.patches[feature - side.first_patch()];
      patch.angle += sign * term[0], patch.cap += sign * term[1],
          patch.vector += sign * Vec3{term[2], term[3], term[4]};
    }
  }

  bool integrate(const Curve& curve, double low, double high, std::span<const Target> targets, int halvings) {
    if (curve.kind == Curve::Kind::kLine) {
      const At from = curve(low);
      const At whole{from.point, (high - low) * from.rate};
      double farthest = 0;
      for (const double s : {low, high}) farthest = std::max(farthest, std::sqrt(norm2(curve(s).point)));
      const double length = curve.loss * (high - low) * farthest;
      for (const Target& target : targets) {
        Terms term;
        raised_ += length * terms(target, whole, term);
        put(target, term);
        size_ += cone(target, term).second;
      }
      border_ += length, reach_ = std::max(reach_, farthest);
      return true;
    }
    const double span = curve.kind == Curve::Kind::kLong ? 0 : high - low;
    if (span < 0.8 && by(slicing::kNodes8, curve, low, high, targets)) return true;
    if (span < 1.6 && by(slicing::kNodes16, curve, low, high, targets)) return true;
    if (by(slicing::kNodes32, curve, low, high, targets)) return true;
    constexpr int kMostHalvings = 6;
    if (halvings == kMostHalvings) return false;
    const double middle = (low + high) / 2;
    return integrate(curve, low, middle, targets, halvings + 1) &&
           integrate(curve, middle, high, targets, halvings + 1);
  }

  /// The largest of the last two terms of a series, relative to the whole.
  static constexpr double kTail = 1e-8;

  /// By a rule of Gauss and Legendre. False if its error counts.
  template <class Rule>
  bool by(const Rule& rule, const Curve& curve, double low, double high, std::span<const Target> targets) {
    const double middle = (low + high) / 2, half = (high - low) / 2;
    std::array<Terms, 2> sums{}, sizes{};
    std::array<std::array<slicing::Series, kTerms>, 2> series{};
    double length = 0, raised = 0, farthest = 0, exact_raised = 0, exact_length = 0;
    const double sine = std::sin(middle), cosine = std::cos(middle);
    for (const slicing::Node& node : rule) {
      const double step = half * (1 - 2 * node.fraction), weight = node.weight / node.sine;
      const double s = std::sin(step), c = std::cos(step);
      const bool turns = curve.kind != Curve::Kind::kLong;
      const At below = turns ? curve(sine * c - cosine * s, cosine * c + sine * s) : curve(middle - step);
      const At above = turns ? curve(sine * c + cosine * s, cosine * c - sine * s) : curve(middle + step);
      const double before = weight * std::sqrt(norm2(below.rate)), after = weight * std::sqrt(norm2(above.rate));
      length += before + after;
      Curve::Sizes first{}, last{};
      if (curve.exact) {
        first = curve.sizes(sine * c - cosine * s, cosine * c + sine * s);
        last = curve.sizes(sine * c + cosine * s, cosine * c - sine * s);
        // An area that a moved curve sweeps is a part of both features, but for a strip from one to the other.
        exact_raised +=
            before * first.off * std::sqrt(norm2(below.point)) + after * last.off * std::sqrt(norm2(above.point));
        exact_length += before * first.place + after * last.place;
      }
      farthest = std::max({farthest, norm2(below.point), norm2(above.point)});
      for (size_t i = 0; i < targets.size(); ++i) {
        Terms one, other;
        const double height = before * terms(targets[i], below, one), next = after * terms(targets[i], above, other);
        raised += height + next, exact_raised += height * first.place + next * last.place;
        for (int k = 0; k < kTerms; ++k) {
          sums[i][k] += weight * (one[k] + other[k]), sizes[i][k] += weight * (std::abs(one[k]) + std::abs(other[k]));
          series[i][k].add(node, one[k], other[k]);
        }
      }
    }
    // The weights of these nodes are for an integral over cos θ, and for an interval of length 1.
    const double scale = 4 * half / kPi;
    double error = 0;
    for (size_t i = 0; i < targets.size(); ++i) {
      Terms tails;
      for (int k = 0; k < kTerms; ++k) tails[k] = series[i][k].tail() * kPi / 2;
      const double tail = cone(targets[i], tails).second, size = cone(targets[i], sizes[i]).second;
      const double vector = std::max({sizes[i][2], sizes[i][3], sizes[i][4]});
      // Terms that rounding alone leaves do not fall. That rounding counts as that of places.
      const double of_places = kOfPlaces * largest_;
      if (tail > std::max(kTail * size, of_places * raised)) return false;
      if (std::max({tails[2], tails[3], tails[4]}) > std::max(kTail * vector, of_places * length)) return false;
      // A rule of n nodes integrates the first 2 n terms of the series exactly.
      if (size > 0) error += scale * tail * std::min(1.0, tail / size);
    }
    const double away = std::sqrt(farthest), lost = curve.loss * scale * (largest_ + away);
    size_ += error / kOfTermsOfTwo, reach_ = std::max(reach_, away);
    border_ += curve.exact ? curve.loss * scale * exact_length : lost * length;
    raised_ += curve.exact ? scale * exact_raised : lost * raised;
    for (size_t i = 0; i < targets.size(); ++i) {
      for (double& sum : sums[i]) sum *= scale;
      put(targets[i], sums[i]);
      // A direction from an axis or a centre loses what places lose, relative to the radius.
      const Side& side = work_.sides[targets[i].body];
      const double of_direction = targets[i].feature < side.first_band() ? 0 : kOfPlaces * away / side.r;
      size_ += scale * cone(targets[i], sizes[i]).second * (1 + of_direction / kOfTermsOfTwo);
    }
    return true;
  }

  // -------------------------------------------------------------------------------------------------------- features

  static int find(std::vector<int>& root, int node) {
    while (root[node] != node) node = root[node] = root[root[node]];
    return node;
  }

  Vec3 point_of(const Side& side, int element, double at) const {
    const int lines = 2 * static_cast<int>(side.bands.size());
    const Band& band = side.bands[(element % lines) / 2];
    const bool line = element < lines, first = element % 2 == 0;
    const double t = line ? at : first ? band.begin : band.end, turn = !line ? at : first ? -band.half : band.half;
    return band.foot + t * band.along + side.r * (std::cos(turn) * band.middle + std::sin(turn) * band.across);
  }

  template <class Holds>
  bool add_side(int body, Holds holds) {
    Side& side = work_.sides[body];
    const int bands = static_cast<int>(side.bands.size()), lines = 2 * bands;
    std::vector<Crossing>& crossings = side.crossings;
    std::ranges::sort(crossings, [](const Crossing& a, const Crossing& b) {
      return a.element != b.element ? a.element < b.element : a.at < b.at;
    });
    constexpr char kUnknown = 2;
    side.root.resize(side.nodes()), side.inside.assign(side.nodes(), kUnknown);
    std::iota(side.root.begin(), side.root.end(), 0);
    // Elements in the other body are beside a band near it.
    std::vector<int>& near = side.elements;
    near.clear();
    for (const Around& around : side.around) {
      const int e = around.feature - side.first_band();
      if (e < 0 || e >= bands) continue;
      if (!side.revolved()) near.push_back(2 * e), near.push_back(2 * e + 1);
      near.push_back(lines + 2 * e), near.push_back(lines + 2 * e + 1);
    }
    std::ranges::sort(near);
    // Both features beside an element have found its crossings.
    if (crossings.size() % 2 != 0) return false;
    size_t next = 0;
    for (const int element : near) {
      if (next < crossings.size() && crossings[next].element == element) {
        while (next < crossings.size() && crossings[next].element == element) next += 2;
        continue;
      }
      const auto [from, to] = side.ends_of(element);
      side.root[find(side.root, from)] = find(side.root, to);
    }
    const auto set = [&](int node, bool inside) {
      char& known = side.inside[find(side.root, node)];
      const bool agrees = known == kUnknown || known == static_cast<char>(inside);
      known = inside;
      return agrees;
    };
    for (size_t i = 0; i < crossings.size(); i += 2) {
      const Crossing &one = crossings[i], &other = crossings[i + 1];
      const double apart = std::sqrt(norm2(one.point - other.point));
      constexpr double kFar = 1e-9;
      if (one.element != other.element || one.leaves != other.leaves || apart > kFar * extent_) return false;
      open_ += apart * std::max(one.moment, other.moment), gaps_ += apart * std::sqrt(norm2(one.point));
      const auto [from, to] = side.ends_of(one.element);
      const bool first = i == 0 || crossings[i - 1].element != one.element;
      const bool last = i + 2 == crossings.size() || crossings[i + 2].element != one.element;
      if (!first && crossings[i - 1].leaves == one.leaves) return false;
      if (first && !set(from, one.leaves)) return false;
      if (last && !set(to, !one.leaves)) return false;
    }
    for (const int element : near) {
      if (element < lines) continue;
      const auto [from, to] = side.ends_of(element);
      const double half = side.bands[(element - lines) / 2].half;
      for (const auto& [node, at] : {std::pair(from, -half), std::pair(to, half)}) {
        char& known = side.inside[find(side.root, node)];
        if (known != kUnknown) continue;
        const double distance = holds(1 - body, point_of(side, element, at));
        if (std::abs(distance) < tie_) return false;
        known = distance < 0;
      }
    }
    // Near the origin, closed forms of whole bands and patches are differences that lose digits. Their borders do not.
    if (wide_)
      for (const Around& around : side.around) {
        const int f = around.feature;
        if (f < side.first_band() || side.crossed[f] || !holds_whole(side, f)) continue;
        refine(f, side), side.crossed[f] = 1;
      }
    // The parts of elements in the other body.
    next = 0;
    for (const int element : near) {
      const Band& band = side.bands[(element % lines) / 2];
      const bool line = element < lines;
      double from = line ? band.begin : -band.half;
      bool inside = side.inside[find(side.root, side.ends_of(element).first)] == 1;
      for (; next < crossings.size() && crossings[next].element == element; next += 2) {
        const double at = (crossings[next].at + crossings[next + 1].at) / 2;
        if (inside && !add_element(body, element, from, at)) return false;
        inside = !inside, from = at;
      }
      if (inside && !add_element(body, element, from, line ? band.end : band.half)) return false;
    }
    if (next != crossings.size()) return false;
    add_features(body);
    return true;
  }

  bool add_element(int body, int element, double from, double to) {
    Side& side = work_.sides[body];
    const int bands = static_cast<int>(side.bands.size()), lines = 2 * bands, e = (element % lines) / 2;
    const Band& band = side.bands[e];
    const bool first = element % 2 == 0;
    for (const double at : {from, to}) reach_ = std::max(reach_, std::sqrt(norm2(point_of(side, element, at))));
    if (element < lines) {
      const int f = first ? side.surface->edges[e].left : side.surface->edges[e].right;
      if (!side.crossed[f]) return true;
      const MovedFacet& facet = side.facets[f];
      // The facet's normal is more exact than the point at the end of the band.
      const Vec3 start = band.foot + side.r * facet.plane.normal - facet.nearest;
      const Vec3 swept = overlapper::cross(start, (to - from) * band.along);
      const Target target{body, f, first ? 1.0 : -1.0};
      const Terms term{dot(facet.plane.normal, swept), 0, 0, 0, 0};
      put(target, term);
      size_ += cone(target, term).second;
      // The band ends at an angle, and the facet at a place that loses what the axis loses.
      const double lost = (side.r + norm(band.foot)) * (to - from);
      border_ += lost, raised_ += lost * std::abs(facet.plane.offset);
      return true;
    }
    const auto [at_begin, at_end] = ends_of_band(side, e);
    std::array<Target, 2> targets;
    size_t count = 0;
    const double t = first ? band.begin : band.end, sign = first ? 1 : -1;
    const int v = first ? at_begin : at_end, of_band = side.first_band() + e;
    const int beside = side.discs ? v : side.first_patch() + v;
    if (side.crossed[of_band] && t != band.base) targets[count++] = {body, of_band, sign};
    if (side.crossed[beside]) targets[count++] = {body, beside, -sign};
    if (count == 0) return true;
    Curve arc{};
    arc.kind = Curve::Kind::kConic, arc.start = band.foot + t * band.along;
    arc.x = side.r * band.middle, arc.y = side.r * band.across;
    // The bound of places holds for each of both features alone, so no distance from the other one is added.
    if (side.discs && wide_) arc.start = band.near + t * band.along, arc.exact = true;
    return integrate(arc, from, to, std::span(targets).first(count), 0);
  }

  /// True if the other body holds a feature that it does not cross.
  static bool holds_whole(Side& side, int feature) {
    const int ends = 2 * static_cast<int>(side.bands.size()), v = feature - side.first_patch();
    int node;
    if (feature < side.first_band()) {
      node = side.discs ? feature : side.hull->ring_start[feature];
    } else if (v < 0) {
      node = side.ends_of(ends + 2 * (feature - side.first_band())).first;
    } else if (side.revolved()) {
      node = v;
    } else {
      const int e = side.surface->edges_at(v)[0];
      node = side.ends_of(ends + 2 * e + (side.surface->edges[e].from == v ? 0 : 1)).first;
    }
    return side.inside[find(side.root, node)] == 1;
  }

  /// Adds the parts of all features in the other body.
  void add_features(int body) {
    Side& side = work_.sides[body];
    const auto finish = [&](int feature, const Terms& term, double area) {
      const auto [value, size] = cone({body, feature, 1}, term);
      thrice_ += value, size_ += size, area_ += std::abs(area), unbalanced_ += Vec3{term[2], term[3], term[4]};
    };
    for (const Around& around : side.around) {
      const int f = around.feature;
      const bool crossed = side.crossed[f];
      if (!crossed && !holds_whole(side, f)) continue;
      if (f < side.first_band()) {
        MovedFacet& facet = side.facets[f];
        if (!crossed) {
          if (wide_) refine(f, side);
          facet.twice_area = 2 * (side.discs ? kPi * side.r * side.r : side.surface->facets[f].area);
        }
        const double area = facet.twice_area / 2;
        const Vec3 vector = area * facet.plane.normal;
        finish(f, {facet.twice_area, 0, vector.x, vector.y, vector.z}, area);
      } else if (f < side.first_patch()) {
        const int e = f - side.first_band();
        Band& band = side.bands[e];
        if (!crossed) {
          const double length = band.end - band.begin, chord = side.revolved() ? 0 : side.surface->edges[e].chord;
          band.plain = 2 * band.half * length, band.vector = side.r * chord * length * band.middle;
          band.cap = band.plain - dot(band.toward, band.vector) / side.r;
          size_ += side.r * std::abs(band.lever) * band.plain;
        }
        finish(f, {band.plain, band.cap, band.vector.x, band.vector.y, band.vector.z}, side.r * band.plain);
      } else {
        const int v = f - side.first_patch();
        Patch& patch = side.patches[v];
        const double square = side.r * side.r;
        if (!crossed) {
          const Vec3 normals = side.revolved() ? Vec3{0, 0, v == 0 ? -kPi : kPi} : side.surface->vertices[v].normals;
          patch.angle = side.revolved() ? 2 * kPi : side.surface->vertices[v].solid_angle;
          patch.vector = square * (side.rotation * normals);
          patch.cap = patch.angle - dot(patch.toward, patch.vector) / square;
          // The solid angle is a difference of angles, too.
          size_ += square * (std::abs(patch.rise) + std::abs(patch.lever)) * (1 + patch.angle);
        }
        finish(f, {patch.angle, patch.cap, patch.vector.x, patch.vector.y, patch.vector.z}, square * patch.angle);
        if (!patch.to_origin) raised_ += (largest_ + extent_) * square * std::abs(patch.angle);
      }
    }
  }

  TwoWork& work_;
  bool wide_;
  double tie_;     ///< m: nearer to a border, nothing is certain
  double off_;     ///< m: bound of the error of depths
  double extent_;  ///< m: of a box around the common set
  double sure_ = wide_ ? 4 * off_ : tie_;
  double largest_ = std::max(work_.sides[0].r, work_.sides[1].r);
  std::array<int, 2> features_{};
  bool failed_ = false;
  bool crossed_ = false;  ///< the surfaces cross
  double thrice_ = 0, size_ = 0, area_ = 0;
  double open_ = 0;    ///< m³: sum of the gaps where crossings go on, by their moments
  double gaps_ = 0;    ///< m²: the same, by |x| alone
  double border_ = 0;  ///< m²: length of all crossings, by the sizes that places lose digits of, and by their loss
  double raised_ = 0;  ///< m³: the same, by |x · u| too
  double reach_ = 0;   ///< m: bound of |x| on crossings
  Vec3 unbalanced_;    ///< m²
};
void extend(Bounds& box, Vec3 point) { box = {min(box.lower, point), max(box.upper, point)}; }
constexpr Bounds kNothing{{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}};
Bounds grown(const Bounds& box, double by) { return {box.lower - by * Vec3{1, 1, 1}, box.upper + by * Vec3{1, 1, 1}}; }

/// The half sizes of the box around a disc of radius 1 across an axis.
Vec3 reach_of_disc(Vec3 axis) {
  const auto across = [](double a, double b) { return std::sqrt(a * a + b * b); };
  return {across(axis.y, axis.z), across(axis.z, axis.x), across(axis.x, axis.y)};
}

/// Starts with a body whose origin of coordinates is at `inner`.
void start(const Placed& body, const WideVector& inner, Side& side) {
  side.hull = polytope_of(body.shape), side.surface = side.hull ? &offset_surface(*side.hull) : nullptr;
  side.r = core_radius(body.shape), side.rotation = body.pose.rotation, side.inner = inner;
  const auto revolved = revolution(body.shape);
  side.half_length = revolved ? revolved->half_length : 0, side.discs = revolved && !revolved->round_ends;
  if (revolved) side.r = revolved->radius;
  side.vertices.clear();
  const int count = side.hull ? static_cast<int>(side.hull->vertices.size()) : 2;
  // Two differences keep the digits near the origin.
  const Vec3 from = rounded(inner), rest = tail(inner);
  side.bounds = kNothing;
  for (int v = 0; v < count; ++v) {
    side.vertices.push_back(side.rotation * ((corner_of(side, v) - from) - rest));
    extend(side.bounds, side.vertices.back());
  }
  if (side.discs) {
    const Vec3 reach = side.r * reach_of_disc(side.rotation * Vec3{0, 0, 1});
    side.bounds = {side.bounds.lower - reach, side.bounds.upper + reach};
  } else {
    side.bounds = grown(side.bounds, side.r);
  }
}

/// The least and the greatest of direction · x over a body.
std::pair<double, double> extent_along(const Side& side, Vec3 direction) {
  double low = kInfinity, high = -kInfinity;
  for (const Vec3 v : side.vertices) low = std::min(low, dot(direction, v)), high = std::max(high, dot(direction, v));
  const double r = side.discs ? side.r * norm(cross(direction, side.rotation * Vec3{0, 0, 1})) : side.r;
  return {low - r, high + r};
}

/// Keeps the vertices whose spheres reach below `most` along `normal`.
void keep_near(Vec3 normal, double most, Side& side) {
  side.near.resize(side.vertices.size());
  for (size_t v = 0; v < side.vertices.size(); ++v) side.near[v] = dot(normal, side.vertices[v]) - side.r <= most;
}

/// Places the features that may reach the box `other`. The other body reaches at most `depth` below the plane across
/// `outward` that the side touches. False if the normals of a vertex are spread too far.
bool place_features(double slack, const Bounds& other, Vec3 outward, double depth, Side& side) {
  const double r = side.r;
  const int facets = side.discs ? 2 : side.revolved() ? 0 : static_cast<int>(side.surface->facets.size());
  const int bands = side.revolved() ? 1 : static_cast<int>(side.surface->edges.size());
  const int patches = side.discs ? 0 : static_cast<int>(side.vertices.size());
  side.facets.resize(facets), side.bands.resize(bands), side.patches.resize(patches);
  side.lines.resize(2 * bands), side.ends.resize(2 * bands), side.around.clear(), side.crossings.clear();
  side.crossed.assign(side.features(), 0), side.refined.assign(side.features(), 0);
  const auto keep = [&](const Bounds& box, int feature) {
    const Bounds large = grown(box, slack);
    const bool kept = meet(large, other);
    if (kept) side.around.push_back({large, feature});
    return kept;
  };
  const Vec3 axis = side.rotation * Vec3{0, 0, 1}, around_axis = r * reach_of_disc(axis);
  for (int f = 0; f < facets; ++f) {
    if (side.discs) {
      MovedFacet& facet = side.facets[f];
      const Vec3 normal = f == 0 ? -axis : axis, centre = side.vertices[f];
      facet = {{normal, dot(normal, centre)}, {}, 0, keep({centre - around_axis, centre + around_axis}, f)};
      facet.nearest = facet.plane.offset * normal;
      continue;
    }
    const auto ring = side.hull->facet(f);
    MovedFacet& facet = side.facets[f];
    facet.kept = false;
    if (std::ranges::none_of(ring, [&](int v) { return side.near[v]; })) continue;
    facet = {{side.rotation * side.surface->facets[f].normal, 0}, {}, 0, false};
    Bounds box = kNothing;
    for (const int v : ring) extend(box, side.vertices[v]);
    const Vec3 normal = facet.plane.normal;
    facet.kept = keep({box.lower + r * normal, box.upper + r * normal}, f);
    if (!facet.kept) continue;
    facet.plane.offset = dot(normal, side.vertices[ring[0]]) + r;
    facet.nearest = facet.plane.offset * normal;
  }
  for (int e = 0; e < bands; ++e) {
    const auto [v, w] = ends_of_band(side, e);
    const bool near = side.revolved() || side.near[v] || side.near[w];
    const auto kept_facet = [&](int f) { return side.facets[f].kept; };
    if (!near && !kept_facet(side.surface->edges[e].left) && !kept_facet(side.surface->edges[e].right)) continue;
    Band& band = side.bands[e];
    band = {};
    const Vec3 from = side.vertices[v], to = side.vertices[w];
    Bounds box = kNothing;
    double bulge = 0;
    if (side.revolved()) {
      band.along = axis, band.middle = beside(axis), band.half = kPi;
      box = {-around_axis, around_axis};
    } else {
      const OffsetSurface::Edge& edge = side.surface->edges[e];
      band.along = side.rotation * edge.along, band.middle = side.rotation * edge.middle, band.half = edge.angle / 2;
      band.sine = edge.chord / 2, band.cosine = std::sqrt(std::max(0.0, (1 - band.sine) * (1 + band.sine)));
      for (const int f : {edge.left, edge.right}) extend(box, r * side.facets[f].plane.normal);
      bulge = r * std::max(0.0, 1 - dot(side.facets[edge.left].plane.normal, band.middle));
    }
    box = {box.lower + min(from, to), box.upper + max(from, to)};
    const bool kept = near && keep(grown(box, bulge), facets + e);
    band.across = cross(band.along, band.middle);
    // From the nearer end.
    band.begin = dot(from, band.along), band.end = dot(to, band.along);
    band.foot = std::abs(band.begin) < std::abs(band.end) ? from - band.begin * band.along : to - band.end * band.along;
    // Patches beside the band are kept if a part of them is near.
    side.ends[2 * e] = {{band.along, band.begin}, 2 * bands + 2 * e};
    side.ends[2 * e + 1] = {{-band.along, -band.end}, 2 * bands + 2 * e + 1};
    if (!side.revolved()) {
      const OffsetSurface::Edge& edge = side.surface->edges[e];
      const Vec3 left = cross(band.along, side.facets[edge.left].plane.normal);
      const Vec3 right = cross(side.facets[edge.right].plane.normal, band.along);
      side.lines[2 * e] = {{left, dot(left, band.foot)}, 2 * e};
      side.lines[2 * e + 1] = {{right, dot(right, band.foot)}, 2 * e + 1};
    }
    if (!kept && !side.discs) continue;
    aim(band);
    band.rise = r - band.lever, band.near = band.rise * band.toward;
  }
  for (int v = 0; v < patches; ++v) {
    if (!side.near[v]) continue;
    Patch& patch = side.patches[v];
    patch = {};
    patch.centre = side.vertices[v];
    Bounds box = kNothing;
    Vec3 pole{};
    double least = side.revolved() ? 0 : 1;
    if (side.revolved()) {
      pole = v == 0 ? -side.bands[0].along : side.bands[0].along;
    } else {
      pole = unit(side.rotation * side.surface->vertices[v].normals);
      for (const int e : side.surface->edges_at(v))
        for (const int f : {side.surface->edges[e].left, side.surface->edges[e].right}) {
          const Vec3 normal = side.facets[f].plane.normal;
          least = std::min(least, dot(normal, pole)), extend(box, r * normal);
        }
    }
    // All normals are in the cap about the pole, and in the hull of the corners' normals but for its bulge.
    constexpr double kWide = 0.5;
    const bool large = least < kWide;
    if (large) box = {{}, {}};
    box = {box.lower + patch.centre, box.upper + patch.centre};
    if (!keep(grown(box, large ? r : r * std::max(0.0, 1 - least)), facets + bands + v)) continue;
    const double distance = std::sqrt(norm2(patch.centre));
    const Vec3 toward = distance > 0 ? -patch.centre / distance : pole;
    // No integral about a direction is certain if a normal is nearly opposite to it.
    constexpr double kOppositeToPole = -0.9, kFarOff = 0.5, kSpread = -0.3;
    if (least < kOppositeToPole) return false;
    // In a shallow contact, normals are near `outward`.
    const bool shallow = depth + slack < r / 2 && dot(toward, outward) > kFarOff;
    if (shallow || (dot(toward, pole) > kFarOff && least > kSpread)) {
      patch.to_origin = true, patch.toward = toward, patch.lever = distance, patch.rise = r - distance;
      patch.near = patch.rise * toward;
    } else {
      patch.toward = pole, patch.lever = -dot(patch.centre, pole), patch.rise = r - patch.lever;
      patch.aside = patch.centre + patch.lever * pole, patch.near = patch.centre + r * pole;
    }
  }
  std::ranges::sort(side.around, {}, [](const Around& around) { return around.box.lower.x; });
  return true;
}

}  // namespace

std::optional<VolumeAlone> volume_of_two_rounded(const Placed& a, const Placed& b, const std::optional<Vec3>& between) {
  const std::array<const Placed*, 2> bodies{&a, &b};
  const Scratch<TwoWork> work;
  auto& sides = work->sides;
  for (const Placed* body : bodies)
    if (const HullData* hull = polytope_of(body->shape); hull && !offset_surface(*hull).exact) return std::nullopt;
  const double apart = norm(a.pose.translation - b.pose.translation), size = apart + reach(a.shape) + reach(b.shape);
  Vec3 origin;
  if (between) {
    origin = *between;
  } else {
    const Bounds of_a = bounds(a), of_b = bounds(b);
    origin = 0.5 * (max(of_a.lower, of_b.lower) + min(of_a.upper, of_b.upper));
  }
  for (bool again = false;; again = true) {
    // The origin has exact coordinates in the first body's core.
    const Vec3 inner = apply_transposed(a.pose.rotation, origin - a.pose.translation);
    for (const int i : {0, 1}) sides[i].wide_rotation = wide_rotation(bodies[i]->orientation);
    const WideVector in_other =
        apply_transposed(sides[1].wide_rotation, sides[0].wide_rotation * (wide(inner) + wide(data_origin(a.shape))) +
                                                     wide_difference(a.position, b.position)) -
        wide(data_origin(b.shape));
    start(a, wide(inner), sides[0]), start(b, in_other, sides[1]);
    const double magnitude = reach(a, reach(b, size)), rounded_off = rounding(magnitude), slack = 4 * rounded_off;
    const Bounds common{max(sides[0].bounds.lower, sides[1].bounds.lower),
                        min(sides[0].bounds.upper, sides[1].bounds.upper)};
    const double extent = norm(common.upper - common.lower);
    // No point of a body is beyond its own plane across this direction.
    const Vec3 way = between ? a.tightest(origin).normal : unit(b.pose.translation - a.pose.translation);
    const double highest = extent_along(sides[0], way).second, lowest = extent_along(sides[1], way).first;
    keep_near(-way, -lowest + slack, sides[0]), keep_near(way, highest + slack, sides[1]);
    const auto distance = [&](int body, Vec3 point) { return signed_distance(bodies[body]->tightest(point), point); };
    const auto measured = [&](bool wide_too) -> std::optional<VolumeAlone> {
      const double off = wide_too ? wide_placing(magnitude, true) : rounded_off;
      const double tie = wide_too ? 16 * kUnit * (sides[0].r + sides[1].r + extent) : slack;
      for (const int i : {0, 1})
        if (!place_features(slack, sides[1 - i].bounds, i == 0 ? way : -way, highest - lowest, sides[i]))
          return std::nullopt;
      TwoRounded both(*work, wide_too, tie, off, extent);
      if (!both.cross_all()) return std::nullopt;
      if (both.crossed()) {
        if (!both.add_all([&](int body, Vec3 point) { return distance(body, point + origin); })) return std::nullopt;
        return VolumeAlone{both.volume(), both.error()};
      }
      // One body holds the other one.
      for (const int i : {0, 1}) {
        const double whole = volume(bodies[i]->shape);
        if (distance(1 - i, bodies[i]->support({1, 0, 0})) < -slack) return VolumeAlone{whole, kOfTermsOfTwo * whole};
      }
      return std::nullopt;
    };
    const auto enough = [](const VolumeAlone& found) {
      return found.volume > 0 && found.error <= kEnough * found.volume;
    };
    // The volume is at most half the area times the distance of both planes, and in most contacts about a quarter of
    // that. The error is at least the area times what doubles lose.
    const bool shallow = 8 * rounded_off > kEnough * (highest - lowest);
    const std::optional<VolumeAlone> found = measured(again || shallow);
    if (!found || enough(*found)) return found;
    if (again) return std::nullopt;
    // From the middle of the crossings, terms are smaller.
    Vec3 sum;
    size_t count = 0;
    for (const Side& side : sides)
      for (const Crossing& crossing : side.crossings) sum += crossing.point, ++count;
    if (count > 0) origin += sum / static_cast<double>(count);
  }
}

}  // namespace overlapper::offset
