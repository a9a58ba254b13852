#include "distance/wide_parting.h"

#include <algorithm>
#include <array>
#include <limits>
#include <vector>

#include "distance/wide_gap.h"

namespace overlapper {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Of directions in doubles that are right to the last bits, and of dot products with them: the share of a point's
/// distance from the origin that may be lost.
constexpr double kLost = 0x1p-46;

/// Two directions of a smaller sine than this have their product taken in double-double.
constexpr double kNearlyParallel = 0x1p-3;

/// Directions in double-double, per sine of the angle that they were made from.
constexpr double kLostWide = 0x1p-96;

/// Of the sine between an arc's middle and a direction that is along it or against it: sums of unit vectors, times
/// sines that may be as small as what is lost.
constexpr double kDoubtful = 0x1p-40;

/// The least double that is surely no smaller than the sum, and the greatest that is no larger.
double up(double x) { return std::nextafter(x, kInfinity); }
double down(double x) { return std::nextafter(x, -kInfinity); }

struct Corner {
  Vec3 at;
  double lost;  ///< m: of dot products with it
};

struct Facet {
  Vec3 normal;
  std::array<int, 3> corners;  ///< of a triangle; of a box the axis, and whether it is the far side
};

struct Ridge {
  int from, to, left, right;  ///< no facets beside a segment: -1
  Vec3 along;                 ///< unit
  Corner near;                ///< its point nearest to the origin
};

/// What a polytope is made of, about a point near the contact; a point and a segment are polytopes too.
class Core {
 public:
  Core(const WideBody& body, const WideVector& about) : body_(body), about_(about), local_(corners_of(body.shape)) {
    for (Vec3 p : local_) {
      const Vec3 at = rounded(body.placed(wide(p)) - about);
      corners.push_back({at, kLost * norm(at)});
      radius = std::max(radius, norm(at));
    }
  }

  /// Keeps the corners beyond a plane, then finds the facets and ridges that any of them belongs to.
  void cut(Vec3 direction, double height) {
    std::vector<char> kept;
    for (const Corner& c : corners) kept.push_back(dot(direction, c.at) + c.lost >= height);
    std::visit([&](const auto& shape) { gather(shape, kept); }, body_.shape);
    for (Facet& facet : facets) facet.normal = rounded(normal(facet));
    for (Ridge& ridge : ridges) complete(ridge);
    size_t next = 0;
    std::erase_if(corners, [&](const Corner&) { return !kept[next++]; });
  }

  std::vector<Corner> corners;
  std::vector<Facet> facets;
  std::vector<Ridge> ridges;
  double radius = 0;  ///< about the origin

  WideVector normal(const Facet& facet) const {
    const auto& [i, j, k] = facet.corners;
    if (k < 0) return body_.turned(wide(j == 0 ? -unit_vector(i) : unit_vector(i)));
    return body_.turned(unit(wide_normal(local_[i], local_[j], local_[k])));
  }
  WideVector along(const Ridge& ridge) const {
    return body_.turned(unit(wide_difference(local_[ridge.to], local_[ridge.from])));
  }

  /// How far off the direction of a needle's normal may be.
  double lost(const Facet& facet) const {
    const auto& [i, j, k] = facet.corners;
    if (k < 0) return kLostWide;
    const Vec3 u = local_[j] - local_[i], v = local_[k] - local_[i];
    return kLostWide * (1 + norm(u) * norm(v) / norm(rounded(wide_normal(local_[i], local_[j], local_[k]))));
  }

  /// At least and at most so far it reaches along any direction that `direction` may be the rounding of.
  double least_reach(Vec3 direction) const {
    double farthest = -kInfinity;
    for (const Corner& c : corners) farthest = std::max(farthest, dot(direction, c.at) - c.lost);
    return farthest;
  }
  double most_reach(Vec3 direction) const {
    double farthest = -kInfinity;
    for (const Corner& c : corners) farthest = std::max(farthest, dot(direction, c.at) + c.lost);
    return farthest;
  }

 private:
  static Vec3 unit_vector(int axis) { return {axis == 0 ? 1.0 : 0.0, axis == 1 ? 1.0 : 0.0, axis == 2 ? 1.0 : 0.0}; }

  static std::vector<Vec3> corners_of(const Shape& shape) {
    if (const HullData* hull = polytope_of(shape)) return hull->corners;
    if (const Capsule* capsule = std::get_if<Capsule>(&shape); capsule && capsule->length > 0)
      return {{0, 0, -capsule->length / 2}, {0, 0, capsule->length / 2}};
    const Box* box = std::get_if<Box>(&shape);
    if (!box) return {{}};
    std::vector<Vec3> corners;
    for (int i = 0; i < 8; ++i) corners.push_back(corner(*box, i));
    return corners;
  }

  void gather(const auto&, const std::vector<char>&) {}
  void gather(const Capsule& capsule, const std::vector<char>&) {
    if (capsule.length > 0) ridges = {{0, 1, -1, -1, {}, {}}};
  }
  void gather(const Box&, const std::vector<char>& kept) {
    for (int f = 0; f < 6; ++f) facets.push_back({{}, {f / 2, f & 1, -1}});
    for (int i = 0; i < 8; ++i)
      for (int k = 0; k < 3; ++k) {
        const int j = i | 1 << k;
        if (j == i || !(kept[i] || kept[j])) continue;
        const auto side_of = [&](int axis) { return 2 * axis + (i >> axis & 1); };
        ridges.push_back({i, j, side_of((k + 1) % 3), side_of((k + 2) % 3), {}, {}});
      }
  }
  void gather(const Hull& hull, const std::vector<char>& kept) { gather(*hull.data, kept); }
  void gather(const RoundedHull& hull, const std::vector<char>& kept) { gather(*hull.core.data, kept); }
  void gather(const HullData& hull, const std::vector<char>& kept) {
    struct Side {
      int from, to, facet;
    };
    std::vector<Side> sides;
    for (const auto& triangle : hull.triangles) {
      if (!(kept[triangle[0]] || kept[triangle[1]] || kept[triangle[2]])) continue;
      for (int i = 0; i < 3; ++i) {
        const auto [from, to] = std::minmax(triangle[i], triangle[(i + 1) % 3]);
        if (kept[from] || kept[to]) sides.push_back({from, to, static_cast<int>(facets.size())});
      }
      facets.push_back({{}, triangle});
    }
    // Two triangles run along every ridge.
    std::ranges::sort(sides, {}, [](const Side& s) { return std::pair(s.from, s.to); });
    for (size_t i = 0; i + 1 < sides.size(); i += 2)
      ridges.push_back({sides[i].from, sides[i].to, sides[i].facet, sides[i + 1].facet, {}, {}});
  }

  void complete(Ridge& ridge) const {
    ridge.along = rounded(along(ridge));
    const Vec3 from = corners[ridge.from].at, to = corners[ridge.to].at;  // all of them are there still
    const double t = std::clamp(-dot(from, to - from) / norm2(to - from), 0.0, 1.0);
    ridge.near.at = from + t * (to - from);
    ridge.near.lost = kLost * std::max(norm(from), norm(to));
    // Of a long edge that passes nearby, doubles do not know where.
    if (ridge.near.lost > 0x1p-20 * norm(ridge.near.at)) ridge.near = nearest(ridge);
  }

  Corner nearest(const Ridge& ridge) const {
    const WideVector p = body_.placed(wide(local_[ridge.from])) - about_,
                     q = body_.placed(wide(local_[ridge.to])) - about_, step = q - p;
    const DoubleDouble share = -dot(p, step) / dot(step, step);
    const Vec3 near = rounded(share.head <= 0 ? p : share.head >= 1 ? q : p + share * step);
    return {near, kLost * norm(near) + 0x1p-90 * std::max(norm(rounded(p)), norm(rounded(q)))};
  }

  const WideBody& body_;
  WideVector about_;
  std::vector<Vec3> local_;
};

/// A normal of the difference's that may be the least way out.
struct Candidate {
  double least;  ///< m: the way along it is no shorter
  enum Kind { kFacetOfA, kFacetOfB, kRidges } kind;
  int of_a, of_b;
  double sign;  ///< of the product of two ridges
};

class Search {
 public:
  Search(const WideBody& a, const WideBody& b, const WideVector& about)
      : wide_a_(a), wide_b_(b), a_(a, about), b_(b, about), lost_(0x1p-94 * (a.reach() + b.reach())) {}

  void run(Vec3 hint) {
    const Vec3 outward = norm2(hint) > 0 ? -hint : Vec3{0, 0, 1};
    measure(unit(wide(outward)), 0);
    // Where the bodies part, a point of each is on the other, or as near as the way out is long.
    const double farthest_a = a_.most_reach(outward), farthest_b = b_.most_reach(-outward);
    const double room = up(way_.head * (1 + 0x1p-40)) + lost_;
    a_.cut(outward, -farthest_b - room);
    b_.cut(-outward, -farthest_a - room);
    for (int f = 0; f < static_cast<int>(a_.facets.size()); ++f)
      consider({0, Candidate::kFacetOfA, f, -1, 1}, a_.facets[f].normal);
    for (int f = 0; f < static_cast<int>(b_.facets.size()); ++f)
      consider({0, Candidate::kFacetOfB, -1, f, 1}, -b_.facets[f].normal);
    consider_ridges();
    std::ranges::sort(candidates_, {}, &Candidate::least);
    for (const Candidate& candidate : candidates_) {
      // The rest are longer.
      if (candidate.least > way_.head) break;
      lower_ = std::min(lower_, measured(candidate));
    }
    lower_ = std::min(lower_, way_.head - lost_);
  }

  DoubleDouble way() const { return way_; }
  const WideVector& direction() const { return direction_; }
  double lower() const { return lower_; }
  double lost() const { return lost_; }
  /// True if the difference has an inside, so that its least way out is along the normal of a facet.
  bool solid() const { return !a_.facets.empty() || !b_.facets.empty(); }

 private:
  /// The way along a unit direction in which A - B is left, and a lower bound of that along a direction off by `lost`.
  double measure(const WideVector& direction, double lost) {
    const DoubleDouble way = dot(direction, wide_a_.core_support(direction) - wide_b_.core_support(-direction));
    if (way < way_) way_ = way, direction_ = direction;
    return way.head - lost_ - lost * (a_.radius + b_.radius);
  }

  double measured(const Candidate& c) {
    if (c.kind == Candidate::kFacetOfA) return measure(a_.normal(a_.facets[c.of_a]), a_.lost(a_.facets[c.of_a]));
    if (c.kind == Candidate::kFacetOfB) return measure(-b_.normal(b_.facets[c.of_b]), b_.lost(b_.facets[c.of_b]));
    const WideVector product = cross(a_.along(a_.ridges[c.of_a]), b_.along(b_.ridges[c.of_b]));
    return measure(c.sign * unit(product), kLostWide / norm(product).head);
  }

  void consider(Candidate candidate, Vec3 direction) {
    candidate.least = a_.least_reach(direction) + b_.least_reach(-direction) - lost_;
    if (candidate.least <= way_.head) candidates_.push_back(candidate);
  }

  /// False if no point of the ridge is as near to the other body as the way out is long.
  bool near(const Ridge& ridge, const Core& other) const {
    return norm(ridge.near.at) - ridge.near.lost <= way_.head + other.radius;
  }

  void consider_ridges() {
    std::vector<int> of_b;
    for (int j = 0; j < static_cast<int>(b_.ridges.size()); ++j)
      if (near(b_.ridges[j], a_)) of_b.push_back(j);
    std::vector<double> across(b_.facets.size());
    for (int i = 0; i < static_cast<int>(a_.ridges.size()); ++i) {
      const Ridge& ridge = a_.ridges[i];
      if (!near(ridge, b_)) continue;
      for (size_t f = 0; f < across.size(); ++f) across[f] = dot(b_.facets[f].normal, ridge.along);
      for (int j : of_b) consider_ridges(i, j, across);
    }
  }

  /// Two ridges make a facet where the arcs between the normals of the facets beside each, one of them reversed, cross.
  void consider_ridges(int i, int j, const std::vector<double>& across) {
    const Ridge &of_a = a_.ridges[i], &of_b = b_.ridges[j];
    Vec3 arc_a, arc_b;
    if (of_a.left >= 0) {
      const Vec3 left = a_.facets[of_a.left].normal, right = a_.facets[of_a.right].normal;
      if (!crossed(left, dot(left, of_b.along), right, dot(right, of_b.along), arc_a)) return;
    }
    if (of_b.left >= 0) {
      const Vec3 left = b_.facets[of_b.left].normal, right = b_.facets[of_b.right].normal;
      if (!crossed(left, across[of_b.left], right, across[of_b.right], arc_b)) return;
    }
    Vec3 product = cross(of_a.along, of_b.along);
    double sine = norm(product);
    if (sine < kNearlyParallel) {
      product = rounded(cross(a_.along(of_a), b_.along(of_b)));
      sine = norm(product);
      // Parallel ridges make no facet that is not one of a body's, too.
      if (sine < kLostWide) return;
    }
    product = product / sine;
    const double apart = dot(product, of_a.near.at - of_b.near.at), lost = of_a.near.lost + of_b.near.lost + lost_;
    for (double sign : {1.0, -1.0}) {
      if (sign * dot(arc_a, product) < -kDoubtful || sign * dot(arc_b, product) > kDoubtful) continue;
      if (sign * apart - lost <= way_.head) consider({0, Candidate::kRidges, i, j, sign}, sign * product);
    }
  }

  /// False if the arc from `left` to `right`, which are so far to one side of a plane, does not cross it; `at` is then
  /// about where it does.
  static bool crossed(Vec3 left, double left_side, Vec3 right, double right_side, Vec3& at) {
    if (std::min(left_side, right_side) > kLost || std::max(left_side, right_side) < -kLost) return false;
    if (std::min(std::abs(left_side), std::abs(right_side)) > kLost)
      at = std::abs(right_side) * left + std::abs(left_side) * right;
    return true;
  }

  const WideBody &wide_a_, &wide_b_;
  Core a_, b_;
  double lost_;  ///< m: by double-doubles, of the way along a direction
  std::vector<Candidate> candidates_;
  DoubleDouble way_{kInfinity};
  WideVector direction_;
  double lower_ = kInfinity;
};

}  // namespace

WideParting wide_parting(const WideBody& a, const WideBody& b, Vec3 hint) {
  const double radius_a = core_radius(a.shape), radius_b = core_radius(b.shape);
  const DoubleDouble radii = two_sum(radius_a, radius_b);
  const auto found = [&](const Search& search, double lower) {
    const double depth = (search.way() + radii).head;
    return WideParting{depth, down((DoubleDouble{lower} + radii).head), up(depth + search.lost()),
                       -rounded(search.direction())};
  };
  const auto is_polytope = [](const WideBody& body) { return !smooth(body.shape) && bounded(body.shape); };
  if (is_polytope(a) && is_polytope(b) && norm2(hint) > 0) {
    const WideVector way = wide(hint);
    Search search(a, b, radius(a.shape) < radius(b.shape) ? a.support(-way) : b.support(way));
    search.run(hint);
    if (search.lower() > 0) return found(search, search.lower());
  }
  const double lost = 0x1p-94 * (a.reach() + b.reach());
  const WideGap gap = wide_gap(a, b, lost / 4);
  if (norm2(gap.normal) > 0) return {-gap.distance, down(-gap.distance - lost), up(-gap.certified + lost), gap.normal};
  Search search(a, b, gap.witness_a);
  search.run(hint);
  // Cores without an inside, or without a common point, are left at once by moving one of them to the other.
  const bool inside = search.solid() && search.lower() > 0;
  return found(search, inside ? search.lower() : -(gap.distance + radii.head) - lost);
}

}  // namespace overlapper
