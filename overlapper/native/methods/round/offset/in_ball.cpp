#include "methods/round/offset/in_ball.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <vector>

#include "geometry/constants.h"
#include "geometry/lanes.h"
#include "geometry/rounding.h"
#include "geometry/scratch.h"
#include "geometry/wide_pose.h"
#include "methods/round/slicing/rules.h"
#include "shapes/hull_data.h"

namespace overlapper::offset {
namespace {

/// Rounding of unit vectors: normals and directions of edges.
constexpr double kOfDirections = 8 * kUnit;
/// Rounding of a term, relative to its size. No term takes more than 60 operations that each may round.
constexpr double kOfTermsInBall = 64 * kUnit;

double magnitude(double x) { return std::abs(x); }
TwoLanes root(TwoLanes x) { return TwoLanes{std::sqrt(x[0]), std::sqrt(x[1])}; }
TwoLanes magnitude(TwoLanes x) { return TwoLanes{std::abs(x[0]), std::abs(x[1])}; }

template <class T>
struct SumOf {
  T value{}, size{};
  void add(T term) { value += term, size += magnitude(term); }
  void add(const SumOf& other, T factor) { value += factor * other.value, size += magnitude(factor) * other.size; }
};
using Sum = SumOf<double>;

/// A direction in a plane, not unit.
struct Flat {
  double x, y;
};
double cross(Flat a, Flat b) { return a.x * b.y - a.y * b.x; }
/// From a to b. Opposite directions are half a turn apart, never minus half a turn.
double angle(Flat a, Flat b) { return std::atan2(cross(a, b) + 0.0, a.x * b.x + a.y * b.y); }

/// A closed line around the point where the ball's centre is seen.
struct Turns {
  Vec3 x, y;                   ///< two axes of the plane that it is seen in
  int around = 0;              ///< turns of the whole line
  double part = 0;             ///< angle of its parts in the ball
  double most = 0;             ///< m²: bound of R² − ρ² on these parts
  double segment = kInfinity;  ///< m²: bound of the area beyond a side
  Sum sums;                    ///< integrals over these parts

  Flat seen(Vec3 v) const {
    const Flat flat{dot(v, x), dot(v, y)};
    // The middle has no direction. Any direction will do for all lines that end there.
    return flat.x == 0 && flat.y == 0 ? Flat{1e-100, 0} : flat;
  }
  /// Counts how often the line crosses the negative x axis.
  void pass(Flat from, Flat to) {
    if ((from.y > 0) == (to.y > 0)) {
      // Along the x axis, it turns by half as angle() says: above the middle, and then onto the negative axis.
      if (from.y == 0 && to.y == 0 && from.x > 0 && to.x < 0) ++around;
      return;
    }
    const double side = cross(from, to);
    if (from.y > 0 && side >= 0) ++around;
    if (to.y > 0 && side < 0) --around;
  }
};

struct BallCorner {
  Vec3 apart;                  ///< from the ball's centre to the vertex
  WideVector exactly;          ///< the same, if `exact`
  double distance = 0;         ///< m, of the vertex
  double slack = 0, near = 0;  ///< R − ρ and ρ at the point of its sphere nearest to the centre
  double far = 0;              ///< R − ρ at the farthest point
  double power = 0;            ///< m²: distance² − r²
  double excess = 0;           ///< m²: power − R²
  Turns turns;                 ///< of the normals, about the direction to the centre
  bool exact = false;
};

struct BallFacet {
  double height = 0;           ///< m, of the ball's centre above the facet of the core
  int plane = -1;              ///< number of its plane in double-double
  WideVector foot;             ///< from the centre; zero if there is no such plane
  double slack = 0, near = 0;  ///< R − ρ and ρ at the point of its moved plane nearest to the centre
  bool reached = false;        ///< an edge of it is in `BallWork::edges`
  Turns turns;                 ///< of its corners, about the foot of the centre
};

/// An angle from −π to π.
struct BallAngle {
  double psi, half_sine, sine;
  explicit BallAngle(double of) : psi(of), half_sine(std::sin(of / 2)), sine(2 * half_sine * std::cos(of / 2)) {}
};

/// Where an edge of the core is, seen from the ball's centre.
struct BallEdge {
  int number = 0;
  Vec3 to_centre;              ///< unit, from the line of the edge
  double distance = 0;         ///< m, of the line
  double from = 0, to = 0;     ///< m, along the edge from the foot of the centre
  double depth = 0;            ///< R + r − distance
  double from2 = 0, to2 = 0;   ///< m²: R² − ρ² where the band's lines nearest to the centre end
  double left = 0, right = 0;  ///< angles ψ of the facets' normals from −π to π, if `exact`
  double off = 1;              ///< rounding of the direction to the centre, in units of `kOfDirections`
  bool exact = false;
};

struct BallWork {
  std::vector<WidePlane> planes;
  std::vector<BallCorner> corners;
  std::vector<BallFacet> facets;
  std::vector<BallEdge> edges;
};

/// An integral over an analytic function by rules of Gauss and Legendre. A rule of n nodes has an error of about
/// ϱ^-2n, for the largest ellipse about the ends of the range without a singularity, with half axes of sum ϱ
/// (Trefethen 2013). A range with a singularity too near is halved.
class Integral {
 public:
  /// A singularity, and its mirror images at the real axis and at zero.
  struct Singularity {
    double real, imaginary;
  };
  Integral(Singularity a, Singularity b) : singularities_{a, b} {}

  /// Half the larger axis of the ellipse, for half a range of 1.
  double axis(double low, double high) const {
    const double half = (high - low) / 2, middle = (low + high) / 2;
    double least = kInfinity;
    for (const Singularity& s : singularities_) {
      const double y = s.imaginary * s.imaginary;
      const double x = s.real - std::abs(middle), before = x + half, after = x - half;
      least = std::min(least, std::sqrt(before * before + y) + std::sqrt(after * after + y));
    }
    return least / (2 * half);
  }

  /// Adds the integral of f. False if a singularity is too near.
  template <class F>
  bool add(double low, double high, F f, Sum& sum, int halvings = 0) const {
    const double half = (high - low) / 2, middle = (low + high) / 2, least = axis(low, high);
    // ϱ^-2n is 2^-55 at 5.5, 1.80, 1.33 and 1.18, and less than 2^-57 at these.
    if (least > 6) return by(slicing::kNodes8, middle, half, f, sum), true;
    if (least > 1.9) return by(slicing::kNodes16, middle, half, f, sum), true;
    if (least > 1.4) return by(slicing::kNodes24, middle, half, f, sum), true;
    if (least > 1.23) return by(slicing::kNodes32, middle, half, f, sum), true;
    constexpr int kMost = 10;
    if (halvings == kMost || !(least >= 1)) return false;
    return add(low, middle, f, sum, halvings + 1) && add(middle, high, f, sum, halvings + 1);
  }

 private:
  template <class Nodes, class F>
  static void by(const Nodes& nodes, double middle, double half, F f, Sum& sum) {
    SumOf<TwoLanes> both;
    f.set(middle);
    for (const slicing::Node& node : nodes) {
      const SumOf<TwoLanes> terms = f(half * (1 - 2 * node.fraction));
      // The weights of these nodes are for an integral over cos θ.
      const double weight = node.weight / node.sine;
      both.value += weight * terms.value, both.size += weight * terms.size;
    }
    sum.value += 4 * half / kPi * (both.value[0] + both.value[1]);
    sum.size += 4 * half / kPi * (both.size[0] + both.size[1]);
  }

  std::array<Singularity, 2> singularities_;
};

/// The next terms of the series are less than 2^-56 of the sine and 2^-64 of the cosine.
std::array<double, 2> sine_and_cosine(double x) {
  if (!(x < 0.25)) return {std::sin(x), std::cos(x)};
  const double y = x * x;
  const double sine = y * (1.0 / 6 - y * (1.0 / 120 - y * (1.0 / 5040 - y * (1.0 / 362880 - y * (1.0 / 39916800)))));
  const double cosine = y * (1.0 / 24 - y * (1.0 / 720 - y * (1.0 / 40320 - y * (1.0 / 3628800 - y / 479001600))));
  return {x - x * sine, 1 - y * (0.5 - cosine)};
}

/// A function of sin χ and cos χ.
template <class F>
struct OfAngle {
  F f;
  double sine = 0, cosine = 1;
  void set(double middle) { sine = std::sin(middle), cosine = std::cos(middle); }
  SumOf<TwoLanes> operator()(double by) const {
    const auto [s, c] = sine_and_cosine(by);
    return f(TwoLanes{sine * c - cosine * s, sine * c + cosine * s},
             TwoLanes{cosine * c + sine * s, cosine * c - sine * s});
  }
};
template <class F>
OfAngle(F) -> OfAngle<F>;

template <class F>
struct OfLength {
  F f;
  double middle = 0;
  void set(double at) { middle = at; }
  SumOf<TwoLanes> operator()(double by) const { return f(TwoLanes{middle - by, middle + by}); }
};
template <class F>
OfLength(F) -> OfLength<F>;

/// Functions grow as exp(6 |Im χ|). From here on, that matters more than singularities.
constexpr double kFarthestPole = 1.2;
/// From these arguments on, inverse hyperbolic functions are more than `kFarthestPole`.
constexpr double kSinhOfFarthest = 1.5095, kCoshOfFarthest = 1.8107;
/// The inverse function or `kFarthestPole`, whichever is less.
double near_asinh(double x) { return x < kSinhOfFarthest ? std::min(std::asinh(x), kFarthestPole) : kFarthestPole; }
double near_acosh(double x) { return x < kCoshOfFarthest ? std::min(std::acosh(x), kFarthestPole) : kFarthestPole; }
/// A range with a shorter ellipse to the nearest singularity is integrated in another form.
constexpr double kLeastAxis = 1.4;
/// If R² − ρ² is more than this, relative to R², differences of terms lose no more than a few digits.
constexpr double kDeepInBall = 0.05;

class InBall {
 public:
  InBall(const OffsetSurface& surface, double r, double ball, BallWork& work)
      : surface_(surface), r_(r), ball_(ball), work_(work) {}

  bool add_all() {
    for (BallFacet& facet : work_.facets)
      if (facet.slack > 0) {
        const Vec3 n = surface_.facets[&facet - work_.facets.data()].normal;
        facet.turns = {any_orthogonal(n), {}, 0, 0, 0, kInfinity, {}}, facet.turns.y = cross(n, facet.turns.x);
      }
    for (BallCorner& corner : work_.corners)
      if (corner.slack > 0) {
        const Vec3 to_centre = -corner.apart / corner.distance;
        corner.turns = {any_orthogonal(to_centre), {}, 0, 0, 0, kInfinity, {}};
        corner.turns.y = cross(to_centre, corner.turns.x);
      }
    for (const OffsetSurface::Edge& edge : surface_.edges) turn(edge);
    for (const BallEdge& edge : work_.edges)
      if (!add_edge(edge)) return false;
    for (size_t f = 0; f < work_.facets.size(); ++f)
      if (work_.facets[f].slack > 0) add_facet(work_.facets[f], surface_.facets[f].area);
    for (size_t v = 0; v < work_.corners.size(); ++v)
      if (work_.corners[v].slack > 0) add_corner(work_.corners[v], surface_.vertices[v].solid_angle);
    return true;
  }
  const Sum& flux() const { return flux_; }
  /// If distances of the centre from features may be off by `rounding`.
  double error(double rounding) const {
    return rounding * area_ + kOfDirections * tilted_ + kOfTermsInBall * flux_.size;
  }

 private:
  void turn(const OffsetSurface::Edge& edge) {
    BallCorner &from = work_.corners[edge.from], &to = work_.corners[edge.to];
    const Vec3 left = surface_.facets[edge.left].normal, right = surface_.facets[edge.right].normal;
    for (const auto& [f, first, last] : {std::tuple{edge.left, &from, &to}, std::tuple{edge.right, &to, &from}})
      if (BallFacet& facet = work_.facets[f]; facet.slack > 0)
        facet.turns.pass(seen(*first, facet), seen(*last, facet));
    if (from.slack > 0) from.turns.pass(from.turns.seen(right), from.turns.seen(left));
    if (to.slack > 0) to.turns.pass(to.turns.seen(left), to.turns.seen(right));
  }

  /// A corner of a facet, from the foot of the centre. If the centre is high above the facet, doubles lose its digits.
  static Flat seen(const BallCorner& corner, const BallFacet& facet) {
    return facet.turns.seen(corner.exact ? rounded(corner.exactly - facet.foot) : corner.apart - rounded(facet.foot));
  }

  /// Adds the angle of the part from a to b of a line from `first` to `last`, or of the part from b to a of the
  /// opposite line if `side` is negative.
  static void add_part(Turns& turns, double side, Flat a, Flat b, Flat first, Flat last) {
    if (side < 0) std::swap(a, b), std::swap(first, last);
    const double whole = angle(first, last);
    double part = angle(a, b);
    // Past the middle, a part turns by half, one way or the other: always as the whole line does.
    if (part * whole < 0 && std::abs(part) > kPi / 2) part += std::copysign(2 * kPi, whole);
    turns.part += part;
  }

  /// |F·n| is not more at this distance from the centre.
  double most_at(double distance) const {
    return std::abs(ball_ * ball_ * ball_ / (distance * distance) - distance) / 3;
  }

  /// The distance of the edge's line from the centre, less the radius of its cylinder: from the smaller radius.
  double gap_of(const BallEdge& edge) const { return r_ < ball_ ? edge.distance - r_ : ball_ - edge.depth; }

  bool add_edge(const BallEdge& edge) {
    const OffsetSurface::Edge& own = surface_.edges[edge.number];
    const Vec3 e = own.along, g = edge.to_centre, k = cross(e, g);
    const Vec3 left = surface_.facets[own.left].normal, right = surface_.facets[own.right].normal;
    const double d = edge.distance, r = r_, ball = ball_, gap = gap_of(edge), fourfold = 4 * d * r;
    // Seen along the edge, the direction from its line to the centre is ψ = 0. The nearest line of the whole cylinder
    // has a chord of 2 √`chord2`.
    const double chord2 = edge.depth * (ball + gap);
    if (!(chord2 > 0)) return true;
    const double start = edge.exact ? edge.left : std::atan2(dot(left, k), dot(left, g));
    // From `start` to `end`, or past ±π to `end`.
    const double end = edge.exact ? edge.right : std::remainder(start + own.angle, 2 * kPi);
    const bool past = end < start;
    const BallAngle at_left(start), at_right(end);
    if (work_.facets[own.left].slack > 0)
      if (!add_line(edge, work_.facets[own.left], at_left, 1, own.from, own.to)) return false;
    if (work_.facets[own.right].slack > 0)
      if (!add_line(edge, work_.facets[own.right], at_right, -1, own.to, own.from)) return false;

    // sin ψ/2 = κ sin χ. If the sphere cuts all lines of the cylinder, κ = 1. Otherwise the chord is zero at χ = ±π/2,
    // and a smooth function of χ up to there.
    const double ratio = fourfold > 0 ? std::sqrt(chord2 / fourfold) : kInfinity, kappa = std::min(1.0, ratio);
    const double to_end = near_acosh(std::max(ratio, 1 / ratio));
    // The centre lies on the surface at χ = ±i y.
    const double to_surface = fourfold > 0 ? near_asinh(std::abs(gap) / (std::sqrt(fourfold) * kappa)) : kFarthestPole;
    const auto of_psi = [&](double psi) {
      if (ratio >= 1) return psi / 2;
      const double h = std::sin(psi / 2) / kappa;
      return std::abs(h) < 1 ? std::atan2(h, std::sqrt((1 - h) * (1 + h))) : std::copysign(kPi / 2, h);
    };
    const auto psi_of = [&](double chi) {
      return ratio < 1 ? 2 * std::asin(std::clamp(kappa * std::sin(chi), -1.0, 1.0)) : 2 * chi;
    };
    const auto widest = [&](double square) {
      if (!(square > 0)) return -1.0;
      if (ratio < 1) return std::atan2(std::sqrt(square), std::sqrt(std::max(0.0, chord2 - square)));
      return square < fourfold ? std::asin(std::sqrt(square / fourfold)) : kPi / 2;
    };
    const bool astride = edge.from < 0 && edge.to > 0;
    BallCorner &from = work_.corners[own.from], &to = work_.corners[own.to];
    const auto flats = [&](const BallCorner& corner) {
      return corner.slack > 0 ? std::array{corner.turns.seen(left), corner.turns.seen(right)}
                              : std::array{Flat{}, Flat{}};
    };
    End ends[2]{{from, edge.from, edge.from2, -1, edge.from >= 0 ? 1.0 : -1.0, flats(from)},
                {to, edge.to, edge.to2, 1, edge.to <= 0 ? 1.0 : -1.0, flats(to)}};
    const double widest_sine = std::max(std::abs(at_left.half_sine), std::abs(at_right.half_sine));
    if (!past && std::min(edge.from2, edge.to2) - fourfold * widest_sine * widest_sine > kDeepInBall * ball * ball) {
      // The whole band is deep in the ball. χ = ψ/2, and no chord is needed.
      const double low = start / 2, high = end / 2;
      const double surface = fourfold > 0 ? near_asinh(std::abs(gap) / std::sqrt(fourfold)) : kFarthestPole;
      double to_foot = surface, to_pole = kFarthestPole;
      for (End& one : ends) one.choose(d, 1, low, high, surface, kFarthestPole, to_foot, to_pole);
      const auto f = [&](TwoLanes sine, TwoLanes cosine) {
        const TwoLanes squared = sine * sine, moved = fourfold * squared, q2 = gap * gap + moved;
        const TwoLanes rho0 = root(q2 + ends[0].z * ends[0].z), rho1 = root(q2 + ends[1].z * ends[1].z);
        const TwoLanes scale = 2 * (2 * d * squared - gap);
        const TwoLanes more = ball * ball * ball * (ends[1].z * rho0 - ends[0].z * rho1) / (q2 * rho0 * rho1);
        SumOf<TwoLanes> sum{scale * (own.length - more), magnitude(scale) * (own.length + magnitude(more))};
        add_arc(ends[0], squared, cosine * cosine, rho0, ball - rho0, TwoLanes{2, 2}, d, sum);
        add_arc(ends[1], squared, cosine * cosine, rho1, ball - rho1, TwoLanes{2, 2}, d, sum);
        return sum;
      };
      Sum band;
      if (!Integral({0, to_foot}, {kPi / 2, to_pole}).add(low, high, OfAngle{f}, band)) return false;
      flux_.add(band, r / 3);
      for (End& one : ends) {
        if (one.anchored && !one.whole)
          add_part(one.corner.turns, one.side, one.flats[0], one.flats[1], one.flats[0], one.flats[1]);
        add_bounds(one, at_left, at_right, d, edge.off);
      }
      area_ += r * own.angle * own.length;
      return true;
    }
    for (const bool again : {false, true}) {
      const double first = again ? -kPi : start, last = past && !again ? kPi : end;
      if ((again && !past) || !(first < last)) continue;
      const double low = of_psi(first), high = of_psi(last);
      if (!(low < high)) continue;
      // Where the cylinder has no chord, the arc ends before the facet's normal.
      const auto has_chord = [&](double psi) { return ratio >= 1 || std::abs(std::sin(psi / 2)) < kappa; };
      const bool from_left = !again && has_chord(first), to_right = again == past && has_chord(last);
      const auto slope = [&](TwoLanes cosine, TwoLanes other) {
        return ratio < 1 ? 2 * kappa * cosine / root(other) : TwoLanes{2, 2};
      };
      const auto half_chord = [&](TwoLanes cosine, TwoLanes squared) {
        if (ratio < 1) return std::sqrt(chord2) * cosine;
        const TwoLanes left_over = chord2 - fourfold * squared;
        return root(TwoLanes{std::max(0.0, left_over[0]), std::max(0.0, left_over[1])});
      };
      if (astride) {
        const auto f = [&](TwoLanes sine, TwoLanes cosine) {
          const TwoLanes squared = kappa * sine * kappa * sine;
          const TwoLanes other = cosine * cosine + (1 - kappa) * (1 + kappa) * sine * sine;
          const TwoLanes q2 = gap * gap + fourfold * squared, w = half_chord(cosine, squared);
          const TwoLanes term = slope(cosine, other) * 2 * w * w * w / q2 * (gap - 2 * d * squared);
          return SumOf<TwoLanes>{term, magnitude(term)};
        };
        Sum band;
        if (!Integral({0, to_surface}, {kPi / 2, to_end}).add(low, high, OfAngle{f}, band)) return false;
        flux_.add(band, r / 3);
        const double chord = std::sqrt(chord2);
        area_ += r * (psi_of(high) - psi_of(low)) * (std::min(edge.to, chord) - std::max(edge.from, -chord));
      }
      for (End& one : ends) {
        const double width = widest(one.square), begin = std::max(low, -width), stop = std::min(high, width);
        if (!(begin < stop)) continue;
        const double away = std::abs(one.z), z2 = away * away;
        double to_foot = to_surface, to_pole = to_end;
        one.choose(d, kappa, begin, stop, to_surface, to_end, to_foot, to_pole);
        // The border of the band adds to the band and to the sphere around the vertex.
        const auto f = [&](TwoLanes sine, TwoLanes cosine) {
          const TwoLanes squared = kappa * sine * kappa * sine;
          const TwoLanes other = cosine * cosine + (1 - kappa) * (1 + kappa) * sine * sine;
          const TwoLanes rho = root(gap * gap + fourfold * squared + z2), w = half_chord(cosine, squared);
          const TwoLanes s = (one.square - fourfold * squared) / (ball + rho);
          const TwoLanes t =
              s * s * (ball + rho) * (w * (ball + rho) + ball * away) / ((w + away) * rho * (w * rho + ball * away));
          const TwoLanes scale = slope(cosine, other), of_band = scale * one.sign * t * (gap - 2 * d * squared);
          SumOf<TwoLanes> sum{of_band, magnitude(of_band)};
          add_arc(one, squared, other, rho, s, scale, d, sum);
          return sum;
        };
        Sum arcs;
        if (!Integral({0, to_foot}, {kPi / 2, to_pole}).add(begin, stop, OfAngle{f}, arcs)) return false;
        flux_.add(arcs, r / 3);
        const double begin_psi = psi_of(begin), stop_psi = psi_of(stop);
        if (one.anchored && !one.whole) {
          const auto seen = [&](double psi) { return one.corner.turns.seen(std::cos(psi) * g + std::sin(psi) * k); };
          add_part(one.corner.turns, one.side, begin > low || !from_left ? seen(begin_psi) : one.flats[0],
                   stop < high || !to_right ? seen(stop_psi) : one.flats[1], one.flats[0], one.flats[1]);
        }
        add_bounds(one, BallAngle(begin_psi), BallAngle(stop_psi), d, edge.off);
        if (!astride && one.sign > 0) area_ += r * (stop_psi - begin_psi) * (std::sqrt(chord2) - away);
      }
    }
    return true;
  }

  /// An end of a band.
  struct End {
    BallCorner& corner;
    double z;                   ///< m, along the edge from the foot of the centre
    double square;              ///< m²: R² − ρ² where the end is nearest to the centre
    double side;                ///< 1 if the vertex's normals are on the left of the arc
    double sign;                ///< of what is beyond the end, in the integral along the band
    std::array<Flat, 2> flats;  ///< the facets' normals
    bool with_arc = false, whole = false, anchored = false;

    /// Chooses a form for the arc, and lowers the distances of singularities.
    void choose(double d, double kappa, double low, double high, double to_surface, double to_end, double& to_foot,
                double& to_pole) {
      with_arc = corner.slack > 0, whole = corner.far > 0;
      if (!with_arc) return;
      // The arc has poles where the direction is towards the centre, and opposite to it.
      const double length = corner.distance;
      const double foot = near_asinh(std::abs(z) / (kappa * std::sqrt(2 * d * (length + d))));
      to_pole = std::min({to_pole, to_end, near_acosh(std::sqrt((1 + length / d) / 2))});
      const double nearest = std::min({to_foot, to_surface, foot});
      anchored = whole || !(Integral({0, nearest}, {kPi / 2, to_pole}).axis(low, high) > kLeastAxis);
      if (!anchored) to_foot = nearest;
    }
  };

  /// Adds what the arc at an end has of the flux through the sphere around the vertex, in units of r / 3, where
  /// `squared` is sin² ψ/2, and `other` is cos² ψ/2.
  void add_arc(const End& end, TwoLanes squared, TwoLanes other, TwoLanes rho, TwoLanes s, TwoLanes scale, double d,
               SumOf<TwoLanes>& sum) const {
    const BallCorner& corner = end.corner;
    if (end.anchored) {
      const TwoLanes factor =
          -end.side * end.z * scale /
          (rho * corner.near * (rho + corner.near) * (end.z * end.z / (corner.distance + d) + 2 * d * other));
      sum.add(fall(corner, s, rho), factor);
    } else if (end.with_arc) {
      const TwoLanes factor = end.side * end.z * scale / (2 * r_ * rho * (end.z * end.z + 4 * d * d * squared * other));
      sum.add(cap(corner, s, rho), factor);
    }
  }

  /// The flux through the cap of the sphere around a vertex, from R − ρ = s up to the ball's surface. For a radian, it
  /// is this over 6 ρ and the distance of the vertex. With the power p of the centre, distance² − r², the integral is
  /// that of (ρ − R³/ρ²) (ρ² − p). Far from the vertex, p − R² is exact; near its sphere, p is.
  template <class T>
  SumOf<T> cap(const BallCorner& corner, T s, T rho) const {
    const double ball = ball_;
    const bool close = corner.near < ball / 2;
    const T first = close ? rho * (ball * (s - 1.5 * ball) - s * s / 4) : ball * ball * s + rho * s * (ball - s / 4);
    const T second = (close ? corner.power : corner.excess) / 2 * (3 * ball - s);
    return {s * s * (first + second), s * s * (magnitude(first) + magnitude(second))};
  }

  /// How this flux falls from the nearest point of the sphere around the vertex to a point with R − ρ = s. For a
  /// radian, it is this times the difference of s, over 6 ρ ρ' and the distance of the vertex.
  template <class T>
  SumOf<T> fall(const BallCorner& corner, T s, T rho) const {
    const double s0 = corner.slack, ball = ball_, near = corner.near;
    const T both = rho * near, sum = rho + near;
    if (near < ball / 2) {
      const double cube = ball * ball * ball;
      const T first = both * (sum * (rho * rho + near * near) / 4 - cube);
      const T second = corner.power * (cube - both * sum / 2);
      return {first + second, both * cube + magnitude(second)};
    }
    const T y = s0 * s0 + s0 * s + s * s, x = s0 + s, xy = s0 * s;
    const T first = ball * ball * (ball * y - xy * x) + ball * y * both;
    const T second = x * (s0 * s0 + s * s) / 4 * both;
    const T third = corner.excess / 2 * (3 * ball * (ball * x - xy) - ball * y + xy * x);
    return {first - second + third, magnitude(first) + magnitude(second) + magnitude(third)};
  }

  void add_bounds(const End& end, const BallAngle& begin, const BallAngle& stop, double d, double off) {
    const bool across_zero = begin.psi < 0 && stop.psi > 0;
    const double least = across_zero ? 0 : std::min(std::abs(begin.half_sine), std::abs(stop.half_sine));
    const double nearest2 = (d - r_) * (d - r_) + 4 * d * r_ * least * least + end.z * end.z;
    tilted_ += off * r_ * r_ * (stop.psi - begin.psi) * most_at(std::sqrt(nearest2));
    BallCorner& corner = end.corner;
    corner.turns.most = std::max(corner.turns.most, ball_ * ball_ - nearest2);
    if (!end.with_arc) return;
    // The angle of an arc loses more, the nearer it passes to the direction to the centre.
    const double across = across_zero ? 0 : std::min(std::abs(begin.sine), std::abs(stop.sine));
    const double passed = std::sqrt(end.z * end.z + d * d * across * across);
    tilted_ += off * cap(corner, corner.slack, corner.near).size / (6 * corner.near * passed);
  }

  /// Adds a side of a moved facet, where it is a band's border at ψ. From first to last, the facet is on the left.
  bool add_line(const BallEdge& edge, BallFacet& facet, const BallAngle& at_psi, double side, int first, int last) {
    const double half_sine = at_psi.half_sine, d = edge.distance, gap = gap_of(edge);
    const double moved = 4 * d * r_ * half_sine * half_sine, ball = ball_;
    const double chord2 = edge.depth * (ball + gap) - moved;
    if (!(chord2 > 0)) return true;
    const double chord = std::sqrt(chord2);
    const double low = std::max(edge.from, -chord), high = std::min(edge.to, chord);
    if (!(low < high)) return true;
    const double q2 = gap * gap + moved, inner = side * d * at_psi.sine;  // from the side to the foot
    const double s0 = facet.slack, near = facet.near, inner2 = inner * inner;
    const double nearest2 = low < 0 && high > 0 ? 0 : std::min(low * low, high * high);
    tilted_ += edge.off * (edge.exact ? d * std::abs(at_psi.sine) + r_ : d + r_) * (high - low) *
               most_at(std::sqrt(q2 + nearest2));
    facet.turns.most = std::max(facet.turns.most, chord2 - nearest2);
    if (inner < 0)
      facet.turns.segment = std::min(facet.turns.segment, 2 * chord2 * chord / (-inner + std::sqrt(inner2 + chord2)));
    Sum sums;
    const auto done = [&] {
      // R² − ρ² is a difference, which loses digits of its largest value.
      facet.turns.sums.value += sums.value, facet.turns.sums.size += chord2 / (chord2 - nearest2) * sums.size;
      return true;
    };
    // Along the side, the field is singular at ±i √q2, and the angle seen from the foot at ±i `inner`.
    const Integral past_foot({0, std::abs(inner)}, {0, std::abs(inner)});
    if (past_foot.axis(low, high) > kLeastAxis) {
      const auto f = [&](TwoLanes t) {
        const TwoLanes t2 = t * t, rho = root(q2 + t2), s = (chord2 - t2) / (ball + rho);
        const TwoLanes term = -near * inner * s * s * (3 * ball - s) / (2 * rho * (inner2 + t2));
        return SumOf<TwoLanes>{term, magnitude(term)};
      };
      return past_foot.add(low, high, OfLength{f}, sums) && done();
    }
    const int number = side > 0 ? surface_.edges[edge.number].left : surface_.edges[edge.number].right;
    const Vec3 e = surface_.edges[edge.number].along;
    const Vec3 in_plane = side * cross(surface_.facets[number].normal, e);
    const Flat along = facet.turns.seen(e), inwards = facet.turns.seen(in_plane);
    const auto at = [&](double t) { return Flat{t * along.x - inner * inwards.x, t * along.y - inner * inwards.y}; };
    const Flat flat_first = seen(work_.corners[side > 0 ? first : last], facet);
    const Flat flat_last = seen(work_.corners[side > 0 ? last : first], facet);
    add_part(facet.turns, side, low > edge.from ? at(low) : flat_first, high < edge.to ? at(high) : flat_last,
             flat_first, flat_last);
    const Integral integral({0, std::sqrt(q2)}, {0, std::sqrt(q2)});
    if (integral.axis(low, high) > kLeastAxis) {
      const auto f = [&](TwoLanes t) {
        const TwoLanes rho = root(q2 + t * t), s = (chord2 - t * t) / (ball + rho);
        const TwoLanes y = s0 * s0 + s0 * s + s * s, x = s0 + s, xy = s0 * s;
        const TwoLanes term =
            inner * (3 * ball * ball * x - 3 * ball * xy - ball * y + xy * x) / (2 * rho * (rho + near));
        return SumOf<TwoLanes>{term, magnitude(term)};
      };
      return integral.add(low, high, OfLength{f}, sums) && done();
    }
    // The contact is deep. The angle seen from the foot is more than the solid angle seen from the centre, over the
    // height, by this much.
    const auto more = [&](double t) {
      const double t2 = t * t, rho = std::sqrt(q2 + t2);
      return std::atan2(t * inner * (inner2 + t2), (rho + near) * (inner2 * rho + near * t2));
    };
    sums.add(ball * ball * ball * (more(high) - more(low)));
    sums.add(-near * inner * (high - low) / 2);
    return done();
  }

  void add_facet(const BallFacet& facet, double area) {
    const Turns& turns = facet.turns;
    const double s = facet.slack, cap = s * s * (3 * ball_ - s) / 2;
    const double rest = 2 * kPi * turns.around - turns.part;
    const double side = facet.height > r_ ? 1.0 / 3 : -1.0 / 3;
    flux_.value += side * (turns.sums.value + cap * rest);
    flux_.size += turns.sums.size / 3 + cap / 3 * (2 * kPi * std::abs(turns.around) + std::abs(turns.part));
    area_ += turns.around == 0 ? std::min({area, turns.segment, kPi * turns.most})
                               : std::min(area, kPi * s * (2 * ball_ - s));
  }

  void add_corner(const BallCorner& corner, double solid_angle) {
    const Turns& turns = corner.turns;
    const double s = corner.slack, near = corner.near, far = corner.far;
    if (far > 0) {
      if (turns.around < 0) {
        // The normals are all around the direction away from the centre. The flux through the whole sphere is added.
        const double rho = ball_ - far;
        // R − ρ falls by the smaller of both diameters.
        const double factor = 2 * kPi * std::min(1.0, r_ / corner.distance) / (rho * near * 3);
        flux_.add(fall(corner, far, rho), factor);
      }
    } else {
      const Sum each = cap(corner, s, near);
      const double whole = 2 * kPi * std::max(0, turns.around), scale = 1 / (6 * corner.distance * near);
      flux_.value += scale * each.value * (whole - turns.part);
      flux_.size += scale * each.size * (whole + std::abs(turns.part));
    }
    const double most = turns.around == 0 ? turns.most : s * (2 * ball_ - s);
    area_ += r_ * std::min(r_ * solid_angle, kPi * most / corner.distance);
  }

  const OffsetSurface& surface_;
  double r_, ball_;
  BallWork& work_;
  Sum flux_;
  double area_ = 0;    ///< m²: bound of the area in the ball
  double tilted_ = 0;  ///< m³: what a tilt of unit vectors by 1 rad would add
};

WidePlane exact_plane(const HullData& hull, int f) {
  const auto [a, b, c] = hull.facet_corners[f];
  const WideVector normal = unit(wide_normal(hull.corners[a], hull.corners[b], hull.corners[c]));
  return {normal, dot(normal, wide(hull.corners[a]))};
}

}  // namespace

std::optional<VolumeAlone> volume_in_ball(const Placed& rounded_hull, const Placed& ball) {
  const HullData& hull = *polytope_of(rounded_hull.shape);
  const OffsetSurface& surface = offset_surface(hull);
  if (!surface.exact) return std::nullopt;
  const double r = core_radius(rounded_hull.shape), radius = revolution(ball.shape)->radius, sum = radius + r;
  const bool turned = !unturned(rounded_hull.orientation);
  WideVector exactly = wide_difference(ball.position, rounded_hull.position);
  const double apart = norm(rounded_hull.position - ball.position);
  if (turned) exactly = apply_transposed(wide_rotation(rounded_hull.orientation), exactly);
  exactly = exactly - wide(hull.origin);
  const Vec3 centre = rounded(exactly);

  const Scratch<BallWork> work;
  work->corners.resize(hull.vertices.size()), work->facets.resize(hull.planes.size());
  work->edges.clear(), work->planes.clear();
  double nearest = kInfinity, farthest = 0;  // distances of the core
  for (size_t v = 0; v < hull.vertices.size(); ++v) {
    BallCorner& corner = work->corners[v];
    corner.exact = false, corner.apart = hull.vertices[v] - centre, corner.distance = std::sqrt(norm2(corner.apart));
    nearest = std::min(nearest, corner.distance), farthest = std::max(farthest, corner.distance);
  }
  const double whole_ball = 4.0 / 3.0 * kPi * radius * radius * radius;
  if (farthest + r <= radius) {
    const double whole = surface.volume(r);
    return VolumeAlone{whole, kOfTermsInBall * whole};
  }
  double off = wide_placing(apart + norm(hull.origin) + reach(rounded_hull.shape), turned);
  double highest = -kInfinity;
  int highest_facet = 0;
  for (int f = 0; f < static_cast<int>(work->facets.size()); ++f) {
    BallFacet& facet = work->facets[f];
    facet.plane = -1, facet.foot = {}, facet.reached = false;
    facet.height = -dot(surface.facets[f].normal, work->corners[hull.facet(f)[0]].apart);
    if (facet.height > highest) highest = facet.height, highest_facet = f;
  }
  const double doubtful = off + kOfDirections * (farthest + radius);
  for (int i = 0; i < static_cast<int>(surface.edges.size()); ++i) {
    const OffsetSurface::Edge& own = surface.edges[i];
    const Vec3 a = work->corners[own.from].apart;
    BallEdge edge;
    edge.number = i, edge.from = dot(a, own.along), edge.to = edge.from + own.length;
    const Vec3 across = edge.from * own.along - a;
    const double line2 = norm2(across);
    const double beside = edge.from > 0 ? edge.from : edge.to < 0 ? edge.to : 0;
    if (line2 + beside * beside > (sum + doubtful) * (sum + doubtful)) continue;
    edge.distance = std::sqrt(line2);
    edge.to_centre = edge.distance > 0 ? across / edge.distance : any_orthogonal(own.along);
    if (beside == 0) nearest = std::min(nearest, edge.distance);
    work->facets[own.left].reached = work->facets[own.right].reached = true;
    work->edges.push_back(edge);
  }
  const auto foot_on = [&](int f) {
    const Vec3 n = surface.facets[f].normal;
    const auto ring = hull.facet(f);
    Vec3 a = work->corners[ring.back()].apart;
    for (const int corner : ring) {
      const Vec3 b = work->corners[corner].apart;
      if (!(dot(n, cross(a, b)) > 0)) return false;
      a = b;
    }
    return true;
  };
  // If the foot is on the facet, the plane is nearest.
  if (highest > 0 && foot_on(highest_facet)) nearest = std::min(nearest, highest);
  if (highest > 0 && std::abs(nearest - r) <= doubtful) return std::nullopt;
  const bool inside = highest <= 0 || nearest < r;
  const double depth = inside ? radius : sum - nearest;
  if (!(depth > 0)) return std::nullopt;

  // In a shallow contact, depths are taken in double-doubles.
  constexpr double kSure = 0x1p-45;
  const bool wide_too = !(doubtful < kSure * depth);
  for (int f = 0; f < static_cast<int>(work->facets.size()); ++f) {
    BallFacet& facet = work->facets[f];
    facet.slack = radius - std::abs(facet.height - r);
    // If no edge of a facet reaches the ball, the facet does so only around the foot of the centre. No edge is near the
    // foot then, and doubles are enough to decide whether it is on the facet.
    if (facet.slack >= -doubtful && !facet.reached && !foot_on(f)) facet.slack = -kInfinity;
    if (wide_too && facet.slack >= -doubtful) {
      facet.plane = static_cast<int>(work->planes.size());
      work->planes.push_back(exact_plane(hull, f));
      const DoubleDouble height = signed_distance(work->planes.back(), exactly);
      facet.foot = -height * work->planes.back().normal;
      facet.height = height.head, facet.slack = (DoubleDouble{radius} - abs(height - DoubleDouble{r})).head;
    }
    facet.near = radius - facet.slack;
  }
  for (BallCorner& corner : work->corners) corner.slack = radius - std::abs(corner.distance - r);
  for (BallEdge& edge : work->edges) {
    const OffsetSurface::Edge& own = surface.edges[edge.number];
    BallCorner &from = work->corners[own.from], &to = work->corners[own.to];
    if (!wide_too) {
      edge.depth = sum - edge.distance;
      edge.off = std::max(1.0, std::max(from.distance, to.distance) / edge.distance);
      const double chord2 = edge.depth * (radius - r + edge.distance);
      edge.from2 = chord2 - edge.from * edge.from, edge.to2 = chord2 - edge.to * edge.to;
      continue;
    }
    const Vec3 a = hull.vertices[own.from], b = hull.vertices[own.to];
    const WideVector to_a = wide(a) - exactly, to_b = wide(b) - exactly, along = unit(wide_difference(b, a));
    const DoubleDouble first = dot(to_a, along), last = dot(to_b, along);
    const WideVector across = to_a - first * along;
    const DoubleDouble line = norm(across);
    const DoubleDouble both = DoubleDouble{radius} + DoubleDouble{r};
    const DoubleDouble deep = both - line;
    const DoubleDouble chord2 = deep * (DoubleDouble{radius} - DoubleDouble{r} + line);
    edge.distance = line.head, edge.depth = deep.head, edge.from = first.head, edge.to = last.head;
    edge.from2 = (chord2 - first * first).head, edge.to2 = (chord2 - last * last).head;
    edge.exact = true;
    if (edge.distance > 0) edge.to_centre = unit(-rounded(across));
    // The line of the edge loses 2^-98 of the distance of the ends.
    edge.off = std::max(1.0, 0x1p-48 * std::max(from.distance, to.distance) / edge.distance);
    const auto angle_of = [&](int f) {
      const BallFacet& facet = work->facets[f];
      if (facet.plane < 0) {
        const Vec3 n = surface.facets[f].normal;
        return std::atan2(dot(n, cross(own.along, edge.to_centre)), dot(n, edge.to_centre));
      }
      return std::atan2(-dot(cross(work->planes[facet.plane].normal, along), to_a).head, facet.height);
    };
    // Both keep their digits. If rounding makes the right one the first one, there is no band.
    edge.left = angle_of(own.left), edge.right = angle_of(own.right);
    if (!(std::remainder(edge.right - edge.left, 2 * kPi) > 0)) edge.right = edge.left;
    for (const auto& [corner, to_it] : {std::pair{&from, to_a}, std::pair{&to, to_b}})
      if (!corner->exact) {
        const DoubleDouble distance = norm(to_it);
        corner->exact = true, corner->exactly = to_it, corner->apart = rounded(to_it);
        corner->distance = distance.head;
        corner->slack = (DoubleDouble{radius} - abs(distance - DoubleDouble{r})).head;
      }
  }
  for (BallCorner& corner : work->corners) {
    const double s = corner.slack, l = corner.distance;
    corner.near = radius - s, corner.far = radius - l - r;
    corner.power = (l > r ? corner.near : -corner.near) * (l + r);
    corner.excess = l > r ? 2 * r * corner.near - s * (2 * radius - s) : corner.power - radius * radius;
  }
  InBall part(surface, r, radius, *work);
  if (!part.add_all()) return std::nullopt;
  const double whole = inside ? whole_ball : 0;
  if (!wide_too) off = doubtful;
  const VolumeAlone found{whole + part.flux().value, part.error(off) + kOfTermsInBall * whole};
  if (!(found.volume > 0 && found.error <= kEnough * found.volume)) return std::nullopt;
  return found;
}

}  // namespace overlapper::offset
