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
#include "methods/round/offset/solid_angle.h"
#include "methods/round/slicing/rules.h"
#include "shapes/hull_data.h"

namespace overlapper::offset {
namespace {

/// Rounding of a term, relative to its size. No term takes more than 60 operations that each may round.
constexpr double kOfTermsOfTwo = 64 * kUnit;
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
  Vec3 origin;  ///< nearest to the origin of coordinates
  double twice_area = 0;
};
/// Points of the band are from + t along + r (cos φ middle + sin φ across), for |φ| ≤ half.
struct Band {
  Vec3 from, along, middle, across;
  double length = 0, half = 0;
  double base = 0;                         ///< m: integrals count t from here
  double plain = 0, cosine = 0, sine = 0;  ///< ∫∫ 1, cos φ, sin φ over φ and t
};
struct Patch {
  Vec3 centre, pole;
  double least = 1;  ///< cosine of the largest angle between the pole and a normal
  Vec3 normals;      ///< ∫ u over the solid angle
  double angle = 0;  ///< the solid angle
};
/// A point where an element, a line or an arc between two features, passes through the surface of the other body.
struct Crossing {
  int element;
  double at;  ///< t or φ
  bool leaves;
  Vec3 point;
};
struct Around {
  Bounds box;
  int feature;
};

/// A body in the common coordinates. Features are facets, then bands, then patches. Elements are the two long sides of
/// each band, then its two ends.
struct Side {
  const OffsetSurface* surface = nullptr;  ///< null for a capsule
  const HullData* hull = nullptr;
  double r = 0;
  std::vector<Vec3> vertices;
  std::vector<MovedFacet> facets;
  std::vector<Band> bands;
  std::vector<Patch> patches;
  std::vector<Border> lines, ends;
  std::vector<Around> around;
  std::vector<Crossing> crossings;
  std::vector<char> crossed;  ///< for each feature
  std::vector<int> root;      ///< of nodes that elements without a crossing join
  std::vector<char> inside;   ///< for each node: 0, 1 or 2 if not known
  Bounds bounds;

  int count(const std::vector<Band>&) const { return static_cast<int>(bands.size()); }
  int first_band() const { return static_cast<int>(facets.size()); }
  int first_patch() const { return first_band() + static_cast<int>(bands.size()); }
  int features() const { return first_patch() + static_cast<int>(patches.size()); }
  bool capsule() const { return surface == nullptr; }
  int nodes() const { return capsule() ? 2 : static_cast<int>(hull->ring.size()); }
  /// The nodes at the beginning and the end of an element.
  std::pair<int, int> ends_of(int element) const {
    const int lines_of = 2 * static_cast<int>(bands.size());
    if (capsule()) return {element - lines_of, element - lines_of};
    const auto& corners = surface->edges[(element % lines_of) / 2].corners;
    if (element < lines_of)
      return element % 2 == 0 ? std::pair{corners[0], corners[1]} : std::pair{corners[2], corners[3]};
    return element % 2 == 0 ? std::pair{corners[0], corners[2]} : std::pair{corners[1], corners[3]};
  }
};

struct Limit {
  Plane plane;
  int element;
  int body;
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
};

struct At {
  Vec3 point, rate;
};

/// Where two features cross, as a function of a parameter s.
struct Curve {
  enum class Kind { kLine, kConic, kQuartic };
  Kind kind;
  /// start + s x, or start + cos s x + sin s y.
  Vec3 start, x, y;
  /// A quartic is start + r u + t e, for u = cos ψ x + sin ψ y. With S = sin² ψ/2, t is `slant` sin ψ ± `stretch` times
  /// √((p − p1 S) (q + q1 S)). On a closed curve, sin ψ/2 = κ sin s, with p = p1 κ². Otherwise ψ = 2 s.
  Vec3 e;
  double r = 0, slant = 0, stretch = 1, p = 0, p1 = 0, q = 1, q1 = 0, kappa = 1, sign = 1;
  bool closed = false;

  At operator()(double s) const {
    if (kind == Kind::kLine) return {start + s * x, x};
    const double sine = std::sin(s), cosine = std::cos(s);
    if (kind == Kind::kConic) return {start + cosine * x + sine * y, cosine * y - sine * x};
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
    return {start + r * (c * x + w * y) + t * e, r * turn * (c * y - w * x) + t_rate * e};
  }
};

class TwoRounded {
 public:
  TwoRounded(TwoWork& work, double tie, double extent) : work_(work), tie_(tie), extent_(extent) {}

  bool cross_all() {
    std::array<std::span<const Around>, 2> around{work_.sides[0].around, work_.sides[1].around};
    size_t i = 0, k = 0;
    // The box that begins first is compared with all boxes of the other body that begin before its end.
    while (i < around[0].size() && k < around[1].size()) {
      const bool first = around[0][i].box.lower.x <= around[1][k].box.lower.x;
      const Around& one = first ? around[0][i] : around[1][k];
      const std::span<const Around> others = first ? around[1].subspan(k) : around[0].subspan(i);
      for (const Around& other : others) {
        if (other.box.lower.x > one.box.upper.x) break;
        if (other.box.lower.y > one.box.upper.y || one.box.lower.y > other.box.upper.y) continue;
        if (other.box.lower.z > one.box.upper.z || one.box.lower.z > other.box.upper.z) continue;
        if (!(first ? cross(one, other) : cross(other, one))) return false;
      }
      first ? ++i : ++k;
    }
    return true;
  }

  /// `holds(i, point)` is the distance of a point from body i, negative inside.
  template <class Holds>
  bool add_all(Holds holds) {
    for (const int i : {0, 1})
      if (!add_side(i, holds)) return false;
    return true;
  }

  double volume() const { return thrice_ / 3; }
  double error(double rounding) const {
    return (rounding + off_) * area_ + kOfTermsOfTwo * size_ + norm(unbalanced_) * extent_ + open_ * extent_ * extent_;
  }

 private:
  // ---------------------------------------------------------------------------------------------------------- curves

  Vec3 normal_at(const Side& side, int feature, Vec3 point) const {
    if (feature < side.first_band()) return side.facets[feature].plane.normal;
    if (feature < side.first_patch()) {
      const Band& band = side.bands[feature - side.first_band()];
      const Vec3 from = point - band.from;
      return (from - dot(from, band.along) * band.along) / side.r;
    }
    return (point - side.patches[feature - side.first_patch()].centre) / side.r;
  }

  void append_limits(int body, int feature, bool lines) {
    const Side& side = work_.sides[body];
    const auto put = [&](const Border& border, double sign) {
      work_.limits.push_back({{sign * border.plane.normal, sign * border.plane.offset}, border.element, body});
    };
    if (feature < side.first_band()) {
      const int begin = side.hull->ring_start[feature], end = side.hull->ring_start[feature + 1];
      for (int k = begin; k < end; ++k) put(side.lines[side.surface->sides[k]], 1);
    } else if (feature < side.first_patch()) {
      const int e = feature - side.first_band();
      if (lines && !side.capsule()) put(side.lines[2 * e], -1), put(side.lines[2 * e + 1], -1);
      put(side.ends[2 * e], -1), put(side.ends[2 * e + 1], -1);
    } else if (side.capsule()) {
      put(side.ends[feature - side.first_patch()], 1);
    } else {
      const int v = feature - side.first_patch();
      for (const int e : side.surface->edges_at(v))
        put(side.ends[2 * e + (side.surface->edges[e].from == v ? 0 : 1)], 1);
    }
  }

  /// Adds where the features of the two bodies cross. False if that is not certain.
  bool cross(const Around& one, const Around& other) {
    const Side &a = work_.sides[0], &b = work_.sides[1];
    features_ = {one.feature, other.feature};
    const bool facet_a = one.feature < a.first_band(), facet_b = other.feature < b.first_band();
    const auto beside = [](const Plane& plane, const Bounds& box) {
      const Vec3 middle = 0.5 * (box.lower + box.upper), half = 0.5 * (box.upper - box.lower);
      return std::abs(signed_distance(plane, middle)) > dot(abs(plane.normal), half);
    };
    if (facet_a && beside(a.facets[one.feature].plane, other.box)) return true;
    if (facet_b && beside(b.facets[other.feature].plane, one.box)) return true;
    if (facet_a && facet_b) return cross_facets();
    if (facet_a) return cross_facet(0);
    if (facet_b) return cross_facet(1);
    const bool band_a = one.feature < a.first_patch(), band_b = other.feature < b.first_patch();
    if (band_a && band_b) return cross_bands();
    if (band_a) return cross_band_and_patch(0);
    if (band_b) return cross_band_and_patch(1);
    return cross_patches();
  }

  bool cross_facets() {
    const Plane &one = work_.sides[0].facets[features_[0]].plane, &other = work_.sides[1].facets[features_[1]].plane;
    const Vec3 way = overlapper::cross(one.normal, other.normal);
    const double square = norm2(way);
    if (!(square > kAlike * kAlike)) return false;
    Curve line{};
    line.kind = Curve::Kind::kLine, line.x = way / std::sqrt(square);
    line.start =
        (one.offset * overlapper::cross(other.normal, way) + other.offset * overlapper::cross(way, one.normal)) /
        square;
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
    if (std::abs(high - low) < tie_) return false;
    if (!(low < high)) return true;
    return lowest && highest && add(line, low, high, *lowest, *highest);
  }

  bool cross_facet(int body) {
    const Plane& plane = work_.sides[body].facets[features_[body]].plane;
    const Side& side = work_.sides[1 - body];
    const int feature = features_[1 - body];
    Curve conic{};
    conic.kind = Curve::Kind::kConic;
    double low = -kPi, high = kPi;
    Limit first = kSeam, last = kSeam;
    const bool is_band = feature < side.first_patch();
    if (is_band) {
      const Band& band = side.bands[feature - side.first_band()];
      const double slope = dot(plane.normal, band.along);
      if (std::abs(slope) < kAlike) return false;
      const auto along_plane = [&](Vec3 way) { return way - dot(plane.normal, way) / slope * band.along; };
      conic.start = band.from - signed_distance(plane, band.from) / slope * band.along;
      conic.x = side.r * along_plane(band.middle), conic.y = side.r * along_plane(band.across);
      if (!side.capsule()) {
        const int e = feature - side.first_band();
        low = -band.half, high = band.half;
        first = {{}, side.lines[2 * e].element, 1 - body}, last = {{}, side.lines[2 * e + 1].element, 1 - body};
      }
    } else {
      const Patch& patch = side.patches[feature - side.first_patch()];
      const double level = -signed_distance(plane, patch.centre), square = (side.r - level) * (side.r + level);
      if (std::abs(std::abs(level) - side.r) < tie_) return false;
      if (!(square > 0)) return true;
      circle(conic, patch.centre + level * plane.normal, plane.normal, std::sqrt(square));
    }
    work_.limits.clear();
    append_limits(body, features_[body], true), append_limits(1 - body, feature, false);
    return divide(conic, low, high, first, last);
  }

  static void circle(Curve& conic, Vec3 centre, Vec3 axis, double radius) {
    conic.kind = Curve::Kind::kConic;
    const Vec3 x = any_orthogonal(axis);
    conic.start = centre, conic.x = radius * x, conic.y = radius * overlapper::cross(axis, x);
  }

  bool cross_patches() {
    const Side &a = work_.sides[0], &b = work_.sides[1];
    const Vec3 from = a.patches[features_[0] - a.first_patch()].centre;
    const Vec3 apart = b.patches[features_[1] - b.first_patch()].centre - from;
    const double distance = std::sqrt(norm2(apart)), depth = a.r + b.r - distance,
                 nested = distance - std::abs(a.r - b.r);
    if (std::abs(depth) < tie_ || std::abs(nested) < tie_) return false;
    if (depth < 0 || nested < 0) return true;
    // From the centre of a: level, and a.r − level.
    const double below = depth * (b.r + distance - a.r) / (2 * distance), level = a.r - below;
    Curve conic{};
    const Vec3 axis = apart / distance;
    circle(conic, from + level * axis, axis, std::sqrt(below * (a.r + level)));
    work_.limits.clear();
    append_limits(0, features_[0], true), append_limits(1, features_[1], true);
    return divide(conic, -kPi, kPi, kSeam, kSeam);
  }

  bool cross_band_and_patch(int body) {
    const Side &side = work_.sides[body], &other = work_.sides[1 - body];
    const Band& band = side.bands[features_[body] - side.first_band()];
    const Vec3 apart = other.patches[features_[1 - body] - other.first_patch()].centre - band.from;
    const double foot = dot(apart, band.along), r = side.r, ball = other.r;
    const Vec3 across = apart - foot * band.along;
    const double distance = std::sqrt(norm2(across));
    Curve quartic{};
    quartic.kind = Curve::Kind::kQuartic;
    const double depth = ball + r - distance, deep = ball - r + distance;
    if (std::abs(depth) < tie_ || std::abs(deep) < tie_) return false;
    if (depth < 0 || deep < 0) return true;
    quartic.p = depth * deep;
    const double reach = std::sqrt(quartic.p);
    if (foot + reach < -tie_ || foot - reach > band.length + tie_) return true;
    quartic.start = band.from + foot * band.along, quartic.e = band.along, quartic.r = r;
    quartic.x = distance > tie_ ? across / distance : any_orthogonal(band.along);
    quartic.y = overlapper::cross(band.along, quartic.x);
    quartic.p1 = 4 * distance * r;
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
    const Vec3 apart = far.from - band.from;
    if (!(sine > kAlikeAxes)) {
      // The nearest points of the segments of both axes may be anywhere.
      const Vec3 across = apart - dot(apart, band.along) * band.along;
      return std::sqrt(norm2(across)) - sine * far.length > r + ball + tie_;
    }
    common = common / sine;
    const double foot = dot(overlapper::cross(apart, far.along), common) / sine;
    const double far_foot = dot(overlapper::cross(apart, band.along), common) / sine;
    const Vec3 between = apart + far_foot * far.along - foot * band.along;
    double distance = dot(between, common);
    if (distance < 0) common = -common, distance = -distance;
    const double depth = r + ball - distance;
    if (std::abs(depth) < tie_) return false;
    if (depth < 0) return true;
    const double reach = (ball + r * std::abs(cosine)) / sine, far_reach = (r + ball * std::abs(cosine)) / sine;
    if (foot + reach < -tie_ || foot - reach > band.length + tie_) return true;
    if (far_foot + far_reach < -tie_ || far_foot - far_reach > far.length + tie_) return true;
    Curve quartic{};
    quartic.kind = Curve::Kind::kQuartic;
    quartic.start = band.from + foot * band.along, quartic.e = band.along, quartic.r = r;
    quartic.x = common, quartic.y = overlapper::cross(band.along, common);
    // Across both axes, a point of the band is r sin ψ cos γ + t e · (far × common) from the other axis.
    const double along = dot(band.along, overlapper::cross(far.along, common));
    const double turned = dot(quartic.y, overlapper::cross(far.along, common));
    quartic.slant = -r * turned / along, quartic.stretch = 1 / along;
    quartic.p = depth, quartic.p1 = 2 * r, quartic.q = ball - r + distance, quartic.q1 = 2 * r;
    return divide_quartic(quartic, body, band);
  }

  bool divide_quartic(Curve& quartic, int body, const Band& band) {
    const Side& side = work_.sides[body];
    work_.limits.clear();
    append_limits(body, features_[body], false), append_limits(1 - body, features_[1 - body], true);
    const double ratio = quartic.p1 > 0 ? std::sqrt(quartic.p / quartic.p1) : kInfinity;
    quartic.closed = ratio < 1, quartic.kappa = std::min(ratio, 1.0);
    Limit low = kSeam, high = kSeam;
    double start = -kPi, end = kPi;
    if (!side.capsule()) {
      const int e = features_[body] - side.first_band();
      low = {{}, side.lines[2 * e].element, body}, high = {{}, side.lines[2 * e + 1].element, body};
      const double at = std::atan2(dot(quartic.x, band.across), dot(quartic.x, band.middle));
      start = -band.half - at, end = band.half - at;
    }
    for (const double turn : {-2 * kPi, 0.0, 2 * kPi}) {
      const double from = std::max(start + turn, -kPi), to = std::min(end + turn, kPi);
      if (!(from < to)) continue;
      Limit first = from > -kPi ? low : kSeam, last = to < kPi ? high : kSeam;
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
    if (curve.kind == Curve::Kind::kConic) {
      for (int l = 0; l < count; ++l) {
        const Plane& plane = work_.limits[l].plane;
        const double c = signed_distance(plane, curve.start), a = dot(plane.normal, curve.x),
                     b = dot(plane.normal, curve.y);
        const double size = std::sqrt(a * a + b * b);
        if (std::abs(std::abs(c) - size) < tie_) return false;
        if (c > size) return true;
        if (c < -size) continue;
        work_.doubtful.push_back(l);
        const double middle = std::atan2(b, a), off = std::acos(-c / size);
        for (const double root : {middle - off, middle + off})
          for (const double turn : {-2 * kPi, 0.0, 2 * kPi})
            if (root + turn > low && root + turn < high) work_.roots.push_back({root + turn, l});
      }
    } else if (!find_roots(curve, low, high)) {
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
        const double height = signed_distance(work_.limits[l].plane, middle);
        within = within && height < tie_, certain = certain && height < -tie_;
      }
      if (!within) continue;
      if (!certain || !add(curve, from.at, to.at, limit_of(from.limit), limit_of(to.limit))) return false;
    }
    return true;
  }

  /// Finds where a quartic passes its limits. False if all of it is beyond one of them.
  bool find_roots(const Curve& curve, double low, double high) {
    constexpr int kMost = 16;
    std::array<At, kMost + 1> samples;
    const int parts = high - low > 1 ? kMost : kMost / 2;
    const double step = (high - low) / parts;
    for (int i = 0; i <= parts; ++i) samples[i] = curve(i == parts ? high : low + i * step);
    for (int l = 0; l < static_cast<int>(work_.limits.size()); ++l) {
      const Plane& plane = work_.limits[l].plane;
      const size_t before = work_.roots.size();
      for (int i = 0; i < parts; ++i)
        find_root(curve, plane, l, low + i * step, samples[i], i + 1 == parts ? high : low + (i + 1) * step,
                  samples[i + 1], 0);
      if (work_.roots.size() > before) work_.doubtful.push_back(l);
      else if (signed_distance(plane, samples[parts / 2].point) > 0) return false;
    }
    return true;
  }

  void find_root(const Curve& curve, const Plane& plane, int l, double from, const At& a, double to, const At& b,
                 int halvings) {
    const double step = to - from;
    double one = signed_distance(plane, a.point), other = signed_distance(plane, b.point);
    double rise = step * dot(plane.normal, a.rate), other_rise = step * dot(plane.normal, b.rate);
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
      find_root(curve, plane, l, from, a, middle, between, halvings + 1);
      find_root(curve, plane, l, middle, between, to, b, halvings + 1);
      return;
    }
    if (!sure) failed_ = true;
    if (!changes) return;
    // Newton's steps, or halves.
    const double sign = signed_distance(plane, a.point) > 0 || one == 0 ? 1 : -1;
    double low = from, high = to, at = from + step * one / (one - other);
    for (int i = 0; i < 60; ++i) {
      const At here = curve(at);
      const double height = sign * signed_distance(plane, here.point), slope = sign * dot(plane.normal, here.rate);
      (height > 0 ? low : high) = at;
      double next = at - height / slope;
      if (!(next > low && next < high)) next = (low + high) / 2;
      if (std::abs(next - at) <= 4 * kUnit * std::max(std::abs(at), step)) break;
      at = next;
    }
    work_.roots.push_back({at, l});
  }

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
      const Vec3 from = end.point - band.from, outward = normal_at(work_.sides[other], features_[other], end.point);
      const bool line = limit->element < lines;
      const Vec3 along = line ? band.along : overlapper::cross(band.along, from) / side.r;
      const double at = line ? dot(from, band.along) : std::atan2(dot(from, band.across), dot(from, band.middle));
      const double slope = dot(along, outward);
      if (!(std::abs(slope) > kAlike)) return false;
      work_.sides[limit->body].crossings.push_back({limit->element, at, slope > 0, end.point});
    }
    for (const int i : {0, 1}) {
      work_.sides[i].crossed[features_[i]] = 1;
      const double off = off_surface(i, middle);
      off_ = std::max(off_, off);
    }
    return integrate(curve, low, high, forwards > 0 ? 1 : -1, 0);
  }

  double off_surface(int body, Vec3 point) const {
    const Side& side = work_.sides[body];
    if (features_[body] < side.first_band())
      return std::abs(signed_distance(side.facets[features_[body]].plane, point));
    return side.r * std::abs(std::sqrt(norm2(normal_at(side, features_[body], point))) - 1);
  }

  // ------------------------------------------------------------------------------------------------------- integrals

  static constexpr int kTerms = 4;
  /// The terms of the border of one feature at a point. A facet: twice the area. A band: ∫ over t of 1, cos φ, sin φ. A
  /// patch: the solid angle, and ∫ u over it.
  void terms(int body, const At& at, std::array<double, kTerms>& result) const {
    const Side& side = work_.sides[body];
    const int feature = features_[body];
    if (feature < side.first_band()) {
      const MovedFacet& facet = side.facets[feature];
      result = {dot(facet.plane.normal, overlapper::cross(at.point - facet.origin, at.rate)), 0, 0, 0};
    } else if (feature < side.first_patch()) {
      const Band& band = side.bands[feature - side.first_band()];
      const Vec3 from = at.point - band.from;
      const double minus_t = band.base - dot(from, band.along);
      const double x = dot(from, band.middle), y = dot(from, band.across), dx = dot(at.rate, band.middle),
                   dy = dot(at.rate, band.across);
      result = {minus_t * (x * dy - y * dx) / (side.r * side.r), minus_t * dy / side.r, -minus_t * dx / side.r, 0};
    } else {
      const Patch& patch = side.patches[feature - side.first_patch()];
      const Vec3 from = at.point - patch.centre;
      const Vec3 turn = overlapper::cross(from, at.rate) / (side.r * side.r);
      result = {dot(patch.pole, turn) / (1 + dot(patch.pole, from) / side.r), turn.x / 2, turn.y / 2, turn.z / 2};
    }
  }

  /// What the terms of a feature add to three times the volume, and the sum of the sizes.
  std::pair<double, double> cone(int body, int feature, const std::array<double, kTerms>& term) const {
    const Side& side = work_.sides[body];
    if (feature < side.first_band()) {
      const double value = side.facets[feature].plane.offset * term[0] / 2;
      return {value, std::abs(value)};
    }
    if (feature < side.first_patch()) {
      const Band& band = side.bands[feature - side.first_band()];
      const double c = side.r * dot(band.from, band.middle) * term[1],
                   s = side.r * dot(band.from, band.across) * term[2], one = side.r * side.r * term[0];
      return {one + c + s, std::abs(one) + std::abs(c) + std::abs(s)};
    }
    const Vec3 centre = side.patches[feature - side.first_patch()].centre;
    const double square = side.r * side.r, x = centre.x * term[1], y = centre.y * term[2], z = centre.z * term[3],
                 angle = side.r * term[0];
    return {square * (x + y + z + angle), square * (std::abs(x) + std::abs(y) + std::abs(z) + std::abs(angle))};
  }

  void put(int body, int feature, double sign, const std::array<double, kTerms>& term) {
    Side& side = work_.sides[body];
    size_ += cone(body, feature, term).second;
    if (feature < side.first_band()) {
      side.facets[feature].twice_area += sign * term[0];
    } else if (feature < side.first_patch()) {
      Band& band = side.bands[feature - side.first_band()];
      band.plain += sign * term[0], band.cosine += sign * term[1], band.sine += sign * term[2];
    } else {
      Patch& patch = side.patches[feature - side.first_patch()];
      patch.angle += sign * term[0], patch.normals += sign * Vec3{term[1], term[2], term[3]};
    }
  }

  bool integrate(const Curve& curve, double low, double high, double sign, int halvings) {
    if (curve.kind == Curve::Kind::kLine) {
      const At from = curve(low);
      const At whole{from.point, (high - low) * from.rate};
      for (const int i : {0, 1}) {
        std::array<double, kTerms> term;
        terms(i, whole, term);
        put(i, features_[i], i == 0 ? sign : -sign, term);
      }
      return true;
    }
    const double span = high - low;
    if (span < 0.8 && by(slicing::kNodes8, curve, low, high, sign)) return true;
    if (span < 1.6 && by(slicing::kNodes16, curve, low, high, sign)) return true;
    if (by(slicing::kNodes32, curve, low, high, sign)) return true;
    constexpr int kMostHalvings = 6;
    if (halvings == kMostHalvings) return false;
    const double middle = (low + high) / 2;
    return integrate(curve, low, middle, sign, halvings + 1) && integrate(curve, middle, high, sign, halvings + 1);
  }

  /// By a rule of Gauss and Legendre. False if its error counts.
  template <class Rule>
  bool by(const Rule& rule, const Curve& curve, double low, double high, double sign) {
    const double middle = (low + high) / 2, half = (high - low) / 2;
    std::array<std::array<double, kTerms>, 2> sums{}, sizes{};
    std::array<std::array<slicing::Series, kTerms>, 2> series{};
    for (const slicing::Node& node : rule) {
      const double step = half * (1 - 2 * node.fraction), weight = node.weight / node.sine;
      const At below = curve(middle - step), above = curve(middle + step);
      for (const int i : {0, 1}) {
        std::array<double, kTerms> one, other;
        terms(i, below, one), terms(i, above, other);
        for (int k = 0; k < kTerms; ++k) {
          sums[i][k] += weight * (one[k] + other[k]), sizes[i][k] += weight * (std::abs(one[k]) + std::abs(other[k]));
          series[i][k].add(node, one[k], other[k]);
        }
      }
    }
    // The weights of these nodes are for an integral over cos θ, and for an interval of length 1.
    const double scale = 4 * half / kPi;
    double error = 0;
    for (const int i : {0, 1}) {
      const double most = std::ranges::max(sizes[i]) * 2 / kPi;
      double worst = 0;
      for (const slicing::Series& s : series[i]) {
        if (s.tail() > kTail * most) return false;
        worst = std::max(worst, s.tail());
      }
      // A rule of n nodes integrates the first 2 n terms of the series exactly.
      if (most > 0) {
        std::array<double, kTerms> all;
        all.fill(2 * half * worst * worst / most);
        error += cone(i, features_[i], all).second;
      }
    }
    size_ += error / kOfTermsOfTwo;
    for (const int i : {0, 1}) {
      for (double& sum : sums[i]) sum *= scale;
      put(i, features_[i], i == 0 ? sign : -sign, sums[i]);
    }
    return true;
  }
  /// The largest of the last two terms of a series, relative to the first.
  static constexpr double kTail = 1e-8;

  // -------------------------------------------------------------------------------------------------------- features

  static int find(std::vector<int>& root, int node) {
    while (root[node] != node) node = root[node] = root[root[node]];
    return node;
  }

  Vec3 point_of(const Side& side, int element, double at) const {
    const int lines = 2 * static_cast<int>(side.bands.size());
    const Band& band = side.bands[(element % lines) / 2];
    if (element < lines) {
      const double turn = element % 2 == 0 ? -band.half : band.half;
      return band.from + at * band.along + side.r * (std::cos(turn) * band.middle + std::sin(turn) * band.across);
    }
    const Vec3 end = element % 2 == 0 ? band.from : band.from + band.length * band.along;
    return end + side.r * (std::cos(at) * band.middle + std::sin(at) * band.across);
  }

  template <class Holds>
  bool add_side(int body, Holds holds) {
    Side& side = work_.sides[body];
    const int bands = static_cast<int>(side.bands.size()), lines = 2 * bands, elements = 2 * lines;
    std::vector<Crossing>& crossings = side.crossings;
    std::ranges::sort(crossings, [](const Crossing& a, const Crossing& b) {
      return a.element != b.element ? a.element < b.element : a.at < b.at;
    });
    constexpr char kUnknown = 2;
    side.root.resize(side.nodes()), side.inside.assign(side.nodes(), kUnknown);
    std::iota(side.root.begin(), side.root.end(), 0);
    // Both features beside an element have found its crossings.
    if (crossings.size() % 2 != 0) return false;
    size_t next = 0;
    for (int element = side.capsule() ? lines : 0; element < elements; ++element) {
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
      open_ += apart;
      const auto [from, to] = side.ends_of(one.element);
      const bool first = i == 0 || crossings[i - 1].element != one.element;
      const bool last = i + 2 == crossings.size() || crossings[i + 2].element != one.element;
      if (!first && crossings[i - 1].leaves == one.leaves) return false;
      if (first && !set(from, one.leaves)) return false;
      if (last && !set(to, !one.leaves)) return false;
    }
    for (int element = lines; element < elements; ++element) {
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
    // The parts of elements in the other body.
    next = 0;
    for (int element = side.capsule() ? lines : 0; element < elements; ++element) {
      const Band& band = side.bands[(element % lines) / 2];
      const bool line = element < lines;
      double from = line ? 0 : -band.half;
      bool inside = side.inside[find(side.root, side.ends_of(element).first)] == 1;
      for (; next < crossings.size() && crossings[next].element == element; next += 2) {
        const double at = (crossings[next].at + crossings[next + 1].at) / 2;
        if (inside) add_element(body, element, from, at);
        inside = !inside, from = at;
      }
      if (inside) add_element(body, element, from, line ? band.length : band.half);
    }
    add_features(body);
    return true;
  }

  void add_element(int body, int element, double from, double to) {
    Side& side = work_.sides[body];
    const int bands = static_cast<int>(side.bands.size()), lines = 2 * bands, e = (element % lines) / 2;
    const Band& band = side.bands[e];
    std::array<double, kTerms> term{};
    if (element < lines) {
      const bool left = element % 2 == 0;
      const int f = left ? side.surface->edges[e].left : side.surface->edges[e].right;
      if (!side.crossed[f]) return;
      const MovedFacet& facet = side.facets[f];
      // The facet's normal is more exact than the point at the end of the band.
      const Vec3 start = band.from + side.r * facet.plane.normal - facet.origin;
      term[0] = dot(facet.plane.normal, overlapper::cross(start, (to - from) * band.along));
      put(body, f, left ? 1 : -1, term);
      return;
    }
    const bool at_from = element % 2 == 0;
    const double sine = std::sin(to) - std::sin(from), cosine = std::cos(from) - std::cos(to);
    if (const int f = side.first_band() + e; side.crossed[f]) {
      const double minus_t = at_from ? band.base : band.base - band.length;
      if (minus_t != 0) {
        term = {minus_t * (to - from), minus_t * sine, minus_t * cosine, 0};
        put(body, f, at_from ? 1 : -1, term);
      }
    }
    const int v = side.capsule() ? (at_from ? 0 : 1)
                  : at_from      ? side.surface->edges[e].from
                                 : side.surface->edges[e].to;
    if (const int f = side.first_patch() + v; side.crossed[f]) {
      const Vec3 pole = side.patches[v].pole;
      const auto direction = [&](double at) { return std::cos(at) * band.middle + std::sin(at) * band.across; };
      // ∫ u × du
      const Vec3 turn = (to - from) / 2 * band.along;
      double angle = 0;
      const int parts = to - from > kPi ? 4 : 1;
      for (int i = 0; i < parts; ++i) {
        const double a = from + (to - from) * i / parts, b = from + (to - from) * (i + 1) / parts;
        angle += solid_angle(pole, direction(a), direction((a + b) / 2), direction(b), b - a);
      }
      term = {angle, turn.x, turn.y, turn.z};
      put(body, f, at_from ? -1 : 1, term);
    }
  }

  /// Adds the parts of all features in the other body.
  void add_features(int body) {
    Side& side = work_.sides[body];
    const int bands = static_cast<int>(side.bands.size());
    const auto holds = [&](int node) { return side.inside[find(side.root, node)] == 1; };
    const auto finish = [&](int feature, const std::array<double, kTerms>& term, Vec3 vector, double area) {
      const auto [value, size] = cone(body, feature, term);
      thrice_ += value, size_ += size, area_ += area, unbalanced_ += vector;
    };
    for (int f = 0; f < side.first_band(); ++f) {
      MovedFacet& facet = side.facets[f];
      if (!side.crossed[f]) {
        if (!holds(side.hull->ring_start[f])) continue;
        facet.twice_area = 2 * side.surface->facets[f].area;
      }
      const double area = facet.twice_area / 2;
      finish(f, {facet.twice_area, 0, 0, 0}, area * facet.plane.normal, std::abs(area));
    }
    for (int e = 0; e < bands; ++e) {
      Band& band = side.bands[e];
      const int f = side.first_band() + e;
      if (!side.crossed[f]) {
        if (!holds(side.ends_of(4 * bands - 2 * bands + 2 * e).first)) continue;
        const double chord = side.capsule() ? 0 : side.surface->edges[e].chord;
        band.plain = 2 * band.half * band.length, band.cosine = chord * band.length;
      }
      finish(f, {band.plain, band.cosine, band.sine, 0}, side.r * (band.cosine * band.middle + band.sine * band.across),
             side.r * std::abs(band.plain));
    }
    for (int v = 0; v < static_cast<int>(side.patches.size()); ++v) {
      Patch& patch = side.patches[v];
      const int f = side.first_patch() + v;
      if (!side.crossed[f]) {
        int element = 2 * bands + v;
        if (!side.capsule()) {
          const int e = side.surface->edges_at(v)[0];
          element = 2 * bands + 2 * e + (side.surface->edges[e].from == v ? 0 : 1);
        }
        if (!holds(side.ends_of(element).first)) continue;
        patch.angle = side.capsule() ? 2 * kPi : side.surface->vertices[v].solid_angle;
        // For a whole patch, the pole is along the normals.
        patch.normals = (side.capsule() ? kPi : std::sqrt(norm2(side.surface->vertices[v].normals))) * patch.pole;
      }
      const double square = side.r * side.r;
      finish(f, {patch.angle, patch.normals.x, patch.normals.y, patch.normals.z}, square * patch.normals,
             square * std::abs(patch.angle));
    }
  }

  TwoWork& work_;
  double tie_, extent_;
  std::array<int, 2> features_{};
  bool failed_ = false;
  double thrice_ = 0, size_ = 0, area_ = 0, open_ = 0, off_ = 0;
  Vec3 unbalanced_;
};

/// The corners of the core about `pose`.
void place_corners(const Placed& body, const Pose& pose, Side& side) {
  side.vertices.clear();
  side.hull = polytope_of(body.shape), side.surface = side.hull ? &offset_surface(*side.hull) : nullptr;
  side.r = core_radius(body.shape);
  if (side.hull) {
    for (const Vec3 v : side.hull->vertices) side.vertices.push_back(pose * v);
  } else {
    const double half = revolution(body.shape)->half_length;
    for (const double z : {-half, half}) side.vertices.push_back(pose * Vec3{0, 0, z});
  }
}

void extend(Bounds& box, Vec3 point) { box = {min(box.lower, point), max(box.upper, point)}; }
constexpr Bounds kNothing{{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}};
Bounds grown(const Bounds& box, double by) { return {box.lower - by * Vec3{1, 1, 1}, box.upper + by * Vec3{1, 1, 1}}; }

/// Places all features about the origin of coordinates. `slack` covers rounding of boxes.
void place_features(const Mat3& rotation, double slack, Side& side) {
  const double r = side.r;
  side.facets.clear(), side.bands.clear(), side.patches.clear(), side.lines.clear(), side.ends.clear(),
      side.around.clear(), side.crossings.clear();
  if (side.capsule()) {
    const Vec3 way = side.vertices[1] - side.vertices[0], along = rotation * Vec3{0, 0, 1};
    Band band;
    band.from = side.vertices[0], band.along = along, band.middle = any_orthogonal(along);
    band.across = cross(along, band.middle), band.length = norm(way), band.half = kPi;
    side.bands.push_back(band);
    side.patches.push_back({side.vertices[0], -along, 0, {}, 0});
    side.patches.push_back({side.vertices[1], along, 0, {}, 0});
    side.ends = {{{along, dot(along, side.vertices[0])}, 2}, {{-along, -dot(along, side.vertices[1])}, 3}};
  } else {
    const OffsetSurface& surface = *side.surface;
    const int bands = static_cast<int>(surface.edges.size());
    for (size_t f = 0; f < surface.facets.size(); ++f) {
      const Vec3 normal = rotation * surface.facets[f].normal;
      const double offset = dot(normal, side.vertices[side.hull->facet(static_cast<int>(f))[0]]) + r;
      side.facets.push_back({{normal, offset}, offset * normal, 0});
    }
    for (int e = 0; e < bands; ++e) {
      const OffsetSurface::Edge& edge = surface.edges[e];
      Band band;
      band.from = side.vertices[edge.from], band.along = rotation * edge.along, band.middle = rotation * edge.middle;
      band.across = cross(band.along, band.middle), band.length = edge.length, band.half = edge.angle / 2;
      side.bands.push_back(band);
      const Vec3 to = side.vertices[edge.to];
      const Vec3 left = cross(band.along, side.facets[edge.left].plane.normal);
      const Vec3 right = -cross(band.along, side.facets[edge.right].plane.normal);
      side.lines.push_back({{left, dot(left, band.from)}, 2 * e});
      side.lines.push_back({{right, dot(right, band.from)}, 2 * e + 1});
      side.ends.push_back({{band.along, dot(band.along, band.from)}, 2 * bands + 2 * e});
      side.ends.push_back({{-band.along, -dot(band.along, to)}, 2 * bands + 2 * e + 1});
    }
    for (size_t v = 0; v < surface.vertices.size(); ++v)
      side.patches.push_back({side.vertices[v], unit(rotation * surface.vertices[v].normals), 1, {}, 0});
  }
  for (Band& band : side.bands) band.base = std::clamp(-dot(band.from, band.along), 0.0, band.length);
  side.crossed.assign(side.features(), 0);

  int feature = 0;
  for (size_t f = 0; f < side.facets.size(); ++f) {
    Bounds box = kNothing;
    for (const int v : side.hull->facet(static_cast<int>(f))) extend(box, side.vertices[v]);
    const Vec3 out = r * side.facets[f].plane.normal;
    side.around.push_back({grown({box.lower + out, box.upper + out}, slack), feature++});
  }
  for (const Band& band : side.bands) {
    Bounds box = kNothing;
    double bulge = r;
    if (side.capsule()) {
      extend(box, {});
    } else {
      const double cosine = std::cos(band.half), sine = std::sin(band.half);
      for (const double s : {-sine, sine}) extend(box, r * (cosine * band.middle + s * band.across));
      bulge = r * (1 - cosine);
    }
    const Vec3 to = band.from + band.length * band.along;
    box = {box.lower + min(band.from, to), box.upper + max(band.from, to)};
    side.around.push_back({grown(box, bulge + slack), feature++});
  }
  for (size_t v = 0; v < side.patches.size(); ++v) {
    Patch& patch = side.patches[v];
    Bounds box = kNothing;
    if (!side.capsule())
      for (const int e : side.surface->edges_at(static_cast<int>(v))) {
        const OffsetSurface::Edge& edge = side.surface->edges[e];
        for (const int f : {edge.left, edge.right}) {
          const Vec3 normal = side.facets[f].plane.normal;
          patch.least = std::min(patch.least, dot(normal, patch.pole)), extend(box, r * normal);
        }
      }
    // All normals are in the cap about the pole, and in the hull of the corners' normals but for its bulge.
    constexpr double kWide = 0.5;
    const bool wide = patch.least < kWide;
    if (wide) box = {{}, {}};
    box = {box.lower + patch.centre, box.upper + patch.centre};
    side.around.push_back({grown(box, (wide ? r : r * (1 - patch.least)) + slack), feature++});
  }
  side.bounds = kNothing;
  for (const Around& around : side.around) extend(side.bounds, around.box.lower), extend(side.bounds, around.box.upper);
}

}  // namespace

std::optional<VolumeAlone> volume_of_two_rounded(const Placed& a, const Placed& b) {
  const std::array<const Placed*, 2> bodies{&a, &b};
  const Scratch<TwoWork> work;
  auto& sides = work->sides;
  Pose relative = relative_pose(a.pose, b.pose);
  place_corners(a, {}, sides[0]), place_corners(b, relative, sides[1]);
  std::array<Bounds, 2> bounds{kNothing, kNothing};
  for (const int i : {0, 1}) {
    if (!sides[i].capsule() && !sides[i].surface->exact) return std::nullopt;
    for (const Vec3 v : sides[i].vertices) extend(bounds[i], v);
    bounds[i] = grown(bounds[i], sides[i].r);
  }
  const Vec3 lower = max(bounds[0].lower, bounds[1].lower), upper = min(bounds[0].upper, bounds[1].upper);
  const Vec3 origin = 0.5 * (lower + upper);
  const double extent = norm(upper - lower);
  const double size = norm(a.pose.translation - b.pose.translation) + reach(a.shape) + reach(b.shape);
  const double off = rounding(reach(a, reach(b, size))), tie = 4 * off;
  for (const int i : {0, 1}) {
    for (Vec3& v : sides[i].vertices) v -= origin;
    place_features(i == 0 ? Mat3{} : relative.rotation, tie, sides[i]);
  }
  for (const int i : {0, 1}) {
    const Bounds other = sides[1 - i].bounds;
    std::erase_if(sides[i].around, [&](const Around& around) {
      const Bounds& box = around.box;
      return box.lower.x > other.upper.x || other.lower.x > box.upper.x || box.lower.y > other.upper.y ||
             other.lower.y > box.upper.y || box.lower.z > other.upper.z || other.lower.z > box.upper.z;
    });
    std::ranges::sort(sides[i].around, {}, [](const Around& around) { return around.box.lower.x; });
  }
  TwoRounded both(*work, tie, extent);
  if (!both.cross_all()) return std::nullopt;
  const auto holds = [&](int body, Vec3 point) {
    const Vec3 placed = a.pose * (point + origin);
    return signed_distance(bodies[body]->tightest(placed), placed);
  };
  if (!both.add_all(holds)) return std::nullopt;
  const VolumeAlone found{both.volume(), both.error(off)};
  if (!(found.volume > 0 && found.error <= kEnough * found.volume)) return std::nullopt;
  return found;
}

}  // namespace overlapper::offset
