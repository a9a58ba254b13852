#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "geometry/constants.h"
#include "methods/round/closed_forms/closed_forms.h"
#include "methods/round/closed_forms/revolved_part.h"
#include "methods/round/quadric/segment.h"

namespace overlapper::closed_forms {
namespace {

/// A node of the rule of Gauss and Legendre with 24 nodes for θ from 0 to π. Its mirror image is a node, too.
struct Node {
  double share;   ///< sin²(θ/2): the fraction of an interval below the node
  double weight;  ///< for an interval of length 1
};
constexpr std::array<Node, 12> kNodes{{
    {1.4287943182011783e-05, 7.327571601569155e-05},
    {0.0003938971595899967, 0.0008893007537826567},
    {0.002348378028467179, 0.0033664783772112974},
    {0.007937163319033949, 0.008265449094038245},
    {0.019852721999046002, 0.016071442592121454},
    {0.041083958148993106, 0.02687224824024659},
    {0.07446413498096881, 0.040255283030036906},
    {0.12214222419855339, 0.055264739761756845},
    {0.18505901057631888, 0.07045979452940064},
    {0.26254230538810935, 0.08409560050528943},
    {0.35214015559282785, 0.09441219942671737},
    {0.44977468483151917, 0.09997418797338287},
}};

/// The least distance of a singularity from an end of an interval, over its width, at which the rule is accurate to
/// rounding. A singularity nearer than kAtEnd counts as at the end.
constexpr double kApart = 0.19, kAtEnd = 1e-11;
/// The same for singularities off the real line, beside an end and beside the interior.
constexpr double kApartBesideEnd = 0.4, kApartBeside = 0.9;
/// The part of an interval that is split off beside a singularity.
constexpr double kSplit = 1.0 / 6;
/// If the ball's centre is nearer to the axis, relative to the sum of both radii, sections count as concentric.
constexpr double kLeastDistance = 1e-3;

/// A ball and a body of revolution. Sections across the axis are two discs, `distance` apart; z counts from the ball's
/// centre along the axis.
struct BallAndAxis {
  double r, s;             ///< radii of the body and of the ball
  DoubleDouble distance;   ///< of the ball's centre from the axis
  DoubleDouble low, high;  ///< ends of the axis
  bool round;

  bool from_axis() const { return r < s; }
  double origin() const { return from_axis() ? 0 : distance.head; }
};

/// Integrals over the common set. Heights point away from the axis. They start at the axis or at the ball's centre,
/// whichever belongs to the smaller body.
struct SectionSums {
  double volume = 0, across = 0, along = 0;  ///< ∫ of 1, the height and z
  double area = 0;                           ///< m², of the surface
  int flat_ends = 0;                         ///< of the body, in the surface
  double force_across = 0, force_along = 0;  ///< ∫ N dA over the ball's surface, away from the axis and z
};

/// The part of the body between two values of z, which is part of a cylinder, or of a ball about the end of the axis.
class Part {
 public:
  Part(const BallAndAxis& at, bool end, DoubleDouble level, DoubleDouble low, DoubleDouble high, SectionSums& sums)
      : at_(at), end_(end), level_(level), low_(low), high_(high), d_(at.distance.head), sums_(sums) {
    const DoubleDouble r{at.r}, s{at.s};
    power_ = (at.distance - r) * (at.distance + r) + s * s;
    if (end) power_ = power_ + level * level;
    per_twice_distance_ = DoubleDouble{1} / (DoubleDouble{2} * at.distance);
    find_roots();
  }

  void add() {
    std::vector<DoubleDouble> cuts{low_, high_};
    for (int k = 0; k < roots_; ++k)
      if (root_[k] > low_ && root_[k] < high_) cuts.push_back(root_[k]);
    std::ranges::sort(cuts, [](DoubleDouble a, DoubleDouble b) { return a < b; });
    for (size_t k = 0; k + 1 < cuts.size(); ++k) add_between(cuts[k], cuts[k + 1]);
  }

 private:
  enum class Kind { kNothing, kLens, kBody, kBall };

  /// The data of the section at some z, from the distances of z from the ends of the interval.
  struct Discs {
    DoubleDouble at;                       ///< z
    double z, of_body2, of_ball2, chord2;  ///< squares of the radii, and of the chord times the distance
  };

  struct Span {
    DoubleDouble low, high;
    double width;
    // From the ends of the interval to the ends of the two quadrics and to the roots.
    double ball_low, ball_high, end_low = 0, end_high = 0;
    std::array<double, 4> gap{};
    std::array<bool, 4> below{};
  };

  /// Finds where the discs touch each other.
  void find_roots() {
    const DoubleDouble r{at_.r}, s{at_.s}, d = at_.distance;
    if (end_) {
      const DoubleDouble far = sqrt(d * d + level_ * level_);
      const DoubleDouble twice = DoubleDouble{2} * far;
      const DoubleDouble rest = (r - far + s) * (r + far - s) / twice;  // s − a
      const DoubleDouble a = s - rest, rho2 = rest * (s + a);
      lead_ = 4 * (far * far).head;
      if (!(rho2.head > 0)) return;
      const DoubleDouble middle = a * level_ / far, half = sqrt(rho2) * d / far;
      add_root(middle - half), add_root(middle + half);
      return;
    }
    lead_ = 1;
    const DoubleDouble outer2 = (s - d + r) * (s + d - r), inner2 = (s - d - r) * (s + d + r);
    if (!(outer2.head > 0)) {
      lead_ = -1;
      return;
    }
    const DoubleDouble outer = sqrt(outer2);
    add_root(-outer), add_root(outer);
    if (inner2.head > 0) {
      const DoubleDouble inner = sqrt(inner2);
      add_root(-inner), add_root(inner);
    } else {
      beside2_ = -inner2.head;
    }
  }
  void add_root(DoubleDouble z) { root_[roots_++] = z; }

  Span span_of(DoubleDouble low, DoubleDouble high) const {
    const DoubleDouble s{at_.s}, r{at_.r};
    Span span{low, high, (high - low).head, (low + s).head, (s - high).head};
    if (end_) span.end_low = (low - level_ + r).head, span.end_high = (level_ + r - high).head;
    for (int k = 0; k < roots_; ++k) {
      span.below[k] = !(root_[k] > low);
      span.gap[k] = span.below[k] ? (low - root_[k]).head : (root_[k] - high).head;
    }
    return span;
  }

  Discs discs_at(const Span& span, double x, double y) const {
    Discs discs;
    discs.at = x < y ? span.low + DoubleDouble{x} : span.high - DoubleDouble{y};
    discs.z = discs.at.head;
    discs.of_ball2 = (span.ball_low + x) * (span.ball_high + y);
    discs.of_body2 = end_ ? (span.end_low + x) * (span.end_high + y) : at_.r * at_.r;
    double product = roots_ > 0 ? lead_ : -1;
    for (int k = 0; k < roots_; ++k) product *= span.gap[k] + (span.below[k] ? x : y);
    if (!end_ && roots_ == 2) product *= discs.z * discs.z + beside2_;
    discs.chord2 = product;
    return discs;
  }

  /// Between roots. A product of four roots is positive between the second and the third, too.
  Kind kind_of(const Span& span) const {
    const Discs discs = discs_at(span, span.width / 2, span.width / 2);
    const double body = std::sqrt(std::max(0.0, discs.of_body2)), ball = std::sqrt(std::max(0.0, discs.of_ball2));
    const double z = discs.z;
    int outside = 0;
    for (int k = 0; k < roots_; ++k) outside += root_[k].head > z ? 1 : -1;
    const bool meets = roots_ == 2 ? outside == 0 : roots_ == 4 && std::abs(outside) == 2;
    if (meets) return Kind::kLens;
    if (std::abs(body - ball) < d_) return Kind::kNothing;
    return body < ball ? Kind::kBody : Kind::kBall;
  }

  void add_between(DoubleDouble low, DoubleDouble high) {
    const Span span = span_of(low, high);
    if (!(span.width > 0)) return;
    const Kind kind = kind_of(span);
    if (kind == Kind::kNothing) return;
    if (kind == Kind::kLens) add_lenses(low, high);
    else add_whole_discs(span, kind);
    if (end_ || at_.round) return;
    // The flat ends of the body.
    if (low == at_.low) add_flat_end(discs_at(span, 0, span.width), kind);
    if (high == at_.high) add_flat_end(discs_at(span, span.width, 0), kind);
  }

  void add_whole_discs(const Span& span, Kind kind) {
    const bool body = kind == Kind::kBody;
    integrate(0, span.width, [&](double x, double, double weight) {
      const Discs discs = discs_at(span, x, span.width - x);
      const double area = weight * kPi * (body ? discs.of_body2 : discs.of_ball2);
      sums_.volume += area, sums_.along += area * discs.z;
      sums_.across += area * ((body ? 0 : d_) - at_.origin());
      sums_.area += weight * 2 * kPi * (body ? at_.r : at_.s);
      if (body) return;
      sums_.force_along += weight * 2 * kPi * discs.z;
    });
  }

  struct Lens {
    double half, to_body, to_ball, of_body, of_ball;  ///< half the chord; heights of the chord; half angles
    double area, moment;
  };
  Lens lens_of(const Discs& discs) const {
    Lens lens;
    lens.half = std::sqrt(std::max(0.0, discs.chord2)) / (2 * d_);
    // The two heights are differences of numbers that may be much larger.
    const DoubleDouble slope = DoubleDouble{end_ ? 2.0 : 1.0} * (end_ ? level_ : discs.at);
    const DoubleDouble to_ball = (power_ - slope * discs.at) * per_twice_distance_;
    lens.to_ball = to_ball.head, lens.to_body = (at_.distance - to_ball).head;
    lens.of_body = std::atan2(lens.half, lens.to_body), lens.of_ball = std::atan2(lens.half, lens.to_ball);
    const double r2 = discs.of_body2, s2 = discs.of_ball2, r = std::sqrt(r2), s = std::sqrt(s2);
    const auto a = quadric::segment(lens.of_body, lens.half / r, lens.to_body / r);
    const auto b = quadric::segment(lens.of_ball, lens.half / s, lens.to_ball / s);
    lens.area = r2 * a.area + s2 * b.area;
    lens.moment = (at_.from_axis() ? lens.to_body : -lens.to_ball) * lens.area + r * r2 * a.first_across -
                  s * s2 * b.first_across;
    return lens;
  }
  void add_flat_end(const Discs& discs, Kind kind) {
    const double disc = kPi * (kind == Kind::kBody ? discs.of_body2 : discs.of_ball2);
    sums_.area += kind == Kind::kLens ? lens_of(discs).area : disc;
    ++sums_.flat_ends;
  }

  /// Splits an interval until all singularities are far enough from it: where the discs touch each other, and where one
  /// is a point.
  void add_lenses(DoubleDouble low, DoubleDouble high) {
    const Span span = span_of(low, high);
    const double width = span.width;
    const auto near = [&](double gap) { return gap > kAtEnd * width && gap < kApart * width; };
    bool near_low = near(span.ball_low), near_high = near(span.ball_high);
    if (end_) near_low = near_low || near(span.end_low), near_high = near_high || near(span.end_high);
    for (int k = 0; k < roots_; ++k) (span.below[k] ? near_low : near_high) |= near(span.gap[k]);
    if (!end_ && roots_ == 2) {
      const double beside = std::sqrt(beside2_), least = std::max(low.head, -high.head);
      if (least < 0 && beside < kApartBeside * width) {
        if (-low.head > kAtEnd * width && high.head > kAtEnd * width) {
          add_lenses(low, {}), add_lenses({}, high);
          return;
        }
      }
      const double far = std::hypot(std::max(0.0, least), beside);
      if (far > kAtEnd * width && far < kApartBesideEnd * width) (low.head > -high.head ? near_low : near_high) = true;
    }
    if (near_low || near_high) {
      const DoubleDouble part{kSplit * width}, middle = near_high ? high - part : low + part;
      add_lenses(low, middle), add_lenses(middle, high);
      return;
    }
    for (const Node& node : kNodes) {
      const double step = width * node.share, rest = width - step, weight = width * node.weight;
      add_lens(discs_at(span, step, rest), weight);
      add_lens(discs_at(span, rest, step), weight);
    }
  }

  void add_lens(const Discs& discs, double weight) {
    const Lens lens = lens_of(discs);
    sums_.volume += weight * lens.area;
    sums_.across += weight * lens.moment;
    sums_.along += weight * lens.area * discs.z;
    sums_.area += weight * 2 * (at_.r * lens.of_body + at_.s * lens.of_ball);
    sums_.force_across -= weight * 2 * lens.half;
    sums_.force_along += weight * 2 * lens.of_ball * discs.z;
  }

  const BallAndAxis& at_;
  bool end_;
  DoubleDouble level_, low_, high_;
  double d_;
  SectionSums& sums_;
  std::array<DoubleDouble, 4> root_{};
  int roots_ = 0;
  double lead_ = 1, beside2_ = 0;
  DoubleDouble power_;  ///< the chord's height below the ball's centre times twice the distance, where z is 0
  DoubleDouble per_twice_distance_;
};

DoubleDouble least(DoubleDouble a, DoubleDouble b) { return a < b ? a : b; }
DoubleDouble most(DoubleDouble a, DoubleDouble b) { return a < b ? b : a; }

SectionSums sums_of(const BallAndAxis& at) {
  SectionSums sums;
  const DoubleDouble s{at.s}, r{at.r};
  const auto add = [&](bool end, DoubleDouble level, DoubleDouble low, DoubleDouble high) {
    low = most(low, -s), high = least(high, s);
    if (low < high) Part(at, end, level, low, high, sums).add();
  };
  add(false, {}, at.low, at.high);
  if (at.round) add(true, at.low, at.low - r, at.low), add(true, at.high, at.high, at.high + r);
  return sums;
}

/// The end of a capsule that is nearer to the axis of another body: 1 or -1; 0 for a ball.
double nearer_end(const Revolved& body, const Revolved& other) {
  if (other.half_length == 0) return 0;
  const auto distance = [&](Vec3 point) {
    const Vec3 from = point - body.centre;
    return norm(from - std::clamp(dot(from, body.axis), -body.half_length, body.half_length) * body.axis);
  };
  const Vec3 arm = other.half_length * other.axis;
  return distance(other.centre + arm) < distance(other.centre - arm) ? 1 : -1;
}

/// Whether the common part of the body and a ball at the end of a capsule lies beyond a plane. The plane goes through
/// the ball's centre, across the capsule's axis. The body is below its tangent plane nearest to the centre.
bool keeps_beyond(const Revolved& body, Vec3 centre, double radius, Vec3 outward, double margin) {
  const Vec3 from = centre - body.centre;
  const double along = dot(from, body.axis), on_axis = std::clamp(along, -body.half_length, body.half_length);
  const bool beyond_flat = !body.round && on_axis != along;
  const Vec3 way = beyond_flat ? (along - on_axis) * body.axis : from - on_axis * body.axis;
  const double far = norm(way), offset = (beyond_flat ? 0 : body.radius) - far;
  if (!(far > 0) || !(std::abs(offset) < radius)) return false;
  return reach_of_cap(radius, way / far, offset, -outward, margin) < 0;
}

/// Measures the body `self` of the pair, by its axis, and the other body: a ball, or the nearer end of a capsule.
std::optional<MeasuresAndInertia> at_axis(const RoundPair& pair, int self) {
  constexpr double kMargin = 1e-9;  // relative to the capsule
  const Revolved &body = *pair.revolved[self], &other = *pair.revolved[1 - self];
  const double side = nearer_end(body, other);
  const Vec3 centre = other.centre + side * other.half_length * other.axis;
  const double margin = kMargin * (other.half_length + other.radius);
  if (side != 0 && !keeps_beyond(body, centre, other.radius, side * other.axis, margin)) return std::nullopt;
  const WideVector axis = axis_of(*body.placed);
  WideVector between = wide_difference(other.placed->position, body.placed->position);
  if (side != 0) between = between + side * other.half_length * axis_of(*other.placed);
  const DoubleDouble along = dot(between, axis), half{body.half_length};
  const WideVector out = between - along * axis;
  const BallAndAxis at{body.radius, other.radius, norm(out), -half - along, half - along, body.round};
  if (!(at.distance.head > kLeastDistance * (at.r + at.s))) return std::nullopt;
  const SectionSums sums = sums_of(at);
  if (!(sums.volume > 0)) return std::nullopt;
  const Vec3 normal = rounded(out / at.distance);
  Measures q = measures_in_closed_form();
  q.way = Way::kSlicing;
  q.volume = sums.volume, q.area = sums.area;
  q.volume_error = kSummation * q.volume;
  q.facets_touched = sums.flat_ends;
  q.centroid = pair.reference + (centre + (sums.across / q.volume + at.origin() - at.distance.head) * normal +
                                 sums.along / q.volume * body.axis);
  Vec3 on_ball = sums.force_across * normal + sums.force_along * body.axis;
  // If one body is inside the other, the sum is zero but for rounding.
  if (norm(on_ball) <= kSummation * q.area) on_ball = {};
  q.pulls = opposite_pulls(pair, self == 0 ? -on_ball : on_ball, centre);
  return MeasuresAndInertia{q, {}};
}

}  // namespace

std::optional<MeasuresAndInertia> ball_at_axis(const RoundPair& pair) {
  std::optional<MeasuresAndInertia> found;
  for (const int self : {0, 1})
    if (!found && pair.revolved[self]->half_length > 0 && pair.revolved[1 - self]->round) found = at_axis(pair, self);
  return found;
}

}  // namespace overlapper::closed_forms
