#include "methods/round/slicing/quadrature.h"

#include <algorithm>
#include <array>
#include <cfloat>
#include <cmath>
#include <limits>
#include <optional>
#include <span>

#include "geometry/wide.h"
#include "methods/round/slicing/nodes.h"
#include "methods/round/slicing/rules.h"

namespace overlapper::slicing {
namespace {

constexpr std::array<Rule, 4> kRules{kNodes8, kNodes16, kNodes24, kNodes32};
static_assert(2 * kNodes32.size() == kMostNodes);
static_assert(std::ranges::all_of(kRules, [](Rule rule) { return rule.size() % 2 == 0; }));

/// If the relative error of a rule is smaller, no other rule is tried.
constexpr double kVolumeError = 1e-14, kAreaError = 1e-12, kCutError = 1e-13;
/// The same for the area of a stretched ball, from a bound of its terms.
constexpr double kStretchedAreaError = 1e-11;
/// If the last coefficients of the series are smaller, relative to the whole, halving is not worth it. A rule of n
/// nodes integrates the first 2 n terms, so its error is about the square of the n-th term.
constexpr double kVolumeTail = 2e-9, kAreaTail = 1e-7;
/// More nodes than any rule has. If so many are needed, half the interval would need hardly fewer.
constexpr double kHopeless = 36;
static_assert(kHopeless > kMostNodes);
/// An interval is small if its width is a smaller fraction of that of all intervals.
constexpr double kSmall = 0.1;
constexpr int kMostHalvings = 48;
/// The largest number of rules. Without it, halving would never end where two surfaces touch along a line.
constexpr int kMostRules = 600;
/// After so many rules, the area of a stretched ball keeps its error. Its element may change as sharply as at an edge.
constexpr int kMostRulesForStretch = 240;

/// The answer of a rule for the slices of a range.
struct RulePart {
  const Outline* outline;
  Range range;
  Rule rule;
  Integrals integrals;
  double cut_area = 0;  ///< m²
  Series volume, area, cut;
  std::array<Sample, kMostNodes> samples;
};

RulePart apply(const Stack& stack, const Outline& outline, const Range& range, Rule rule) {
  RulePart part{&outline, range, rule, {}, 0, {}, {}, {}, {}};
  const int half = static_cast<int>(rule.size()), size = 2 * half;
  Nodes nodes;
  nodes.size = size;
  std::array<double, kMostNodes> rate;
  const auto put = [&](int i, const Range::Place& place) {
    const DoubleDouble t = two_sum(place.end, place.step);
    nodes.t[i] = t.head, nodes.tail[i] = t.tail, nodes.weight[i] = place.weight, rate[i] = place.rate;
  };
  for (int i = 0; i < half; ++i) {
    const auto [low, high] = range.places(rule[i]);
    put(i, low), put(size - 1 - i, high);
  }
  Slices slices;
  part.integrals = measure(stack, outline, nodes, slices);
  for (int i = 0; i < half; ++i) {
    const int mirror = size - 1 - i;
    part.volume.add(rule[i], rate[i] * slices.volume[i], rate[mirror] * slices.volume[mirror]);
    part.area.add(rule[i], rate[i] * slices.area[i], rate[mirror] * slices.area[mirror]);
    if (!stack.cuts) continue;
    part.cut.add(rule[i], rate[i] * slices.cut[i], rate[mirror] * slices.cut[mirror]);
    part.cut_area += nodes.weight[i] * slices.cut[i] + nodes.weight[mirror] * slices.cut[mirror];
  }
  for (int i = 0; i < size; ++i) part.samples[i] = {nodes.t[i], slices.volume[i]};
  return part;
}

class Integrating {
 public:
  Integrating(const Stack& stack, double volume, double area, bool few, double strictness, Sum& sum)
      : stack_(stack),
        volume_(volume),
        area_(area),
        few_(few),
        alone_(volume == 0),
        strictness_(strictness),
        sum_(sum) {}

  bool run(std::span<const Interval> intervals) {
    thread_local std::vector<RulePart> parts;
    parts.clear();
    const double whole = intervals.back().high - intervals.front().low;
    for (size_t i = 0; i < intervals.size(); ++i) {
      Range range{intervals[i].low, intervals[i].high};
      if (i > 0) range.before = intervals[i - 1].high - intervals[i - 1].low;
      if (i + 1 < intervals.size()) range.after = intervals[i + 1].high - intervals[i + 1].low;
      parts.push_back(apply(stack_, intervals[i].outline, range, first(range.high - range.low < kSmall * whole)));
    }
    for (const RulePart& part : parts)
      sum_.about += part.integrals.volume, area_ += part.integrals.area, cut_area_ += part.cut_area;
    volume_ += sum_.about;
    for (const RulePart& part : parts)
      if (!add(part, 0)) return false;
    return true;
  }

 private:
  /// With few nodes, a small rule is enough for small intervals. It is hardly ever enough for others. If a piece is
  /// alone, most of its intervals need 24 nodes.
  Rule first(bool small) const { return kRules[few_ ? (small ? 0 : 1) + alone_ : 2]; }

  /// The number of missing nodes of a rule, in halves of its present number.
  double lacks(const RulePart& part) const {
    // A finer rule does not reduce rounding.
    const double rounding = 16 * DBL_EPSILON * part.integrals.blur / part.integrals.volume;
    const auto of = [&](const Series& series, double here, double whole, double limit, double limit_of_tail) {
      const double end = series.tail();
      if (end <= rounding * here) return 0.0;
      if (strictness_ > 0) return strictness_ * end > limit_of_tail * whole ? 100.0 : 0.0;
      return series.halves_until(limit * whole);
    };
    const double volume = of(part.volume, part.integrals.volume, volume_, kVolumeError, kVolumeTail);
    if (stack_.stretch) {
      if (!stack_.areas || sum_.rules > kMostRulesForStretch) return volume;
      // If terms fall slowly, more nodes help little.
      if (part.area.stretched_error(part.integrals.area) > kStretchedAreaError * area_) return kHopeless;
    }
    const double area = of(part.area, part.integrals.area, area_, kAreaError, kAreaTail);
    if (!stack_.cuts) return std::max(volume, area);
    // A volume may be accurate long before the chords of its cuts are. The surface between two pieces then does not
    // close.
    const double by_roots = std::pow(part.range.fall_by_roots(), 2 * static_cast<double>(part.rule.size()));
    const auto slow = [&](const Series& series, double here, double whole) {
      const double end = series.tail();
      return end > rounding * here && by_roots * end > kCutError * whole ? kHopeless : 0;
    };
    return std::max({volume, area, of(part.cut, part.cut_area, cut_area_, kCutError, kAreaTail),
                     slow(part.cut, part.cut_area, cut_area_), slow(part.area, part.integrals.area, area_)});
  }

  /// The rule with enough more nodes, or the largest one. No value if halves need fewer nodes.
  std::optional<Rule> finer(const RulePart& part, double lacking) const {
    // In a series of few nodes, the terms in the middle have not begun to fall. Later terms fall twice as fast.
    const double nodes = static_cast<double>(part.rule.size()) * (2 + lacking / 2);
    if (!(nodes < kHopeless)) return std::nullopt;
    for (const Rule& rule : kRules)
      if (rule.size() > part.rule.size() &&
          (2 * static_cast<double>(rule.size()) >= nodes || rule.size() == kRules.back().size()))
        return rule;
    return std::nullopt;
  }

  bool add(const RulePart& part, int halvings) {
    if (++sum_.rules > kMostRules) return false;
    if (const double lacking = lacks(part); lacking > 0) {
      if (const auto rule = finer(part, lacking)) return add(apply(stack_, *part.outline, part.range, *rule), halvings);
      if (halvings < kMostHalvings && part.range.can_be_halved()) {
        const auto [below, above] = part.range.halves();
        return add(apply(stack_, *part.outline, below, first(false)), halvings + 1) &&
               add(apply(stack_, *part.outline, above, first(false)), halvings + 1);
      }
    }
    add_as_it_is(part);
    return true;
  }

  void add_as_it_is(const RulePart& part) {
    sum_.integrals.add(1, part.integrals);
    sum_.samples.insert(sum_.samples.end(), part.samples.begin(), part.samples.begin() + 2 * part.rule.size());
    // If halving for the area has ended, terms count as falling no further.
    const bool ended = sum_.rules > kMostRulesForStretch;
    const double of_stretched = ended ? 30 * part.area.tail() : part.area.stretched_error(part.integrals.area);
    sum_.area_error += stack_.stretch ? of_stretched : part.area.error();
    const double ratio = volume_ > 0 ? part.volume.tail() / volume_ : 0;
    sum_.error += strictness_ > 0 ? volume_ * std::min(ratio, 30 * ratio * std::sqrt(ratio)) : part.volume.error();
  }

  const Stack& stack_;
  double volume_, area_;  ///< about the totals of all pieces so far and of this one
  double cut_area_ = 0;   ///< of this piece
  bool few_;
  bool alone_;  ///< no piece was measured before
  double strictness_;
  Sum& sum_;
};

/// Slices that are polygons have integrands of degree four at most. The rule of Gauss and Legendre with three nodes
/// integrates these exactly.
void integrate_polygons(const Stack& stack, const Interval& interval, Sum& sum) {
  constexpr double kShare = 0.1127016653792583, kOuter = 5.0 / 18, kInner = 8.0 / 18;
  const double width = interval.high - interval.low;
  Nodes nodes;
  nodes.append(interval.low + kShare * width, width * kOuter);
  nodes.append(interval.low + 0.5 * width, width * kInner);
  nodes.append(interval.high - kShare * width, width * kOuter);
  Slices slices;
  sum.integrals.add(1, measure(stack, interval.outline, nodes, slices));
  for (int i = 0; i < nodes.size; ++i) sum.samples.push_back({nodes.t[i], slices.volume[i]});
}

}  // namespace

bool integrate(const Stack& stack, std::span<const Interval> intervals, double volume, double area, bool few,
               double strictness, Sum& sum) {
  if (stack.quadrics > 0) return Integrating(stack, volume, area, few, strictness, sum).run(intervals);
  for (const Interval& interval : intervals) integrate_polygons(stack, interval, sum);
  return true;
}

namespace {

/// The integral of the square of a function that rises linearly from p to q.
double of_square(double width, double p, double q) { return width / 3 * (p * p + p * q + q * q); }

}  // namespace

bool within_chords(double begin, double end, Sum& sum) {
  std::vector<Sample>& samples = sum.samples;
  // Slopes between two samples very near each other would be rounding.
  const double low = samples.front().t, range = samples.back().t - low;
  double last_kept = -std::numeric_limits<double>::infinity();
  std::erase_if(samples, [&](const Sample& sample) {
    if (!(sample.t > last_kept + 2e-3 * range)) return true;
    last_kept = sample.t;
    return false;
  });
  const int last = static_cast<int>(samples.size()) - 1;
  if (last < 3) return true;
  for (Sample& sample : samples) sample.area = std::sqrt(std::max(0.0, sample.area));
  const auto root = [&](int i) { return samples[i].area; };
  const auto slope = [&](int i) { return (root(i + 1) - root(i)) / (samples[i + 1].t - samples[i].t); };
  double below = 0, above = 0;
  for (int i = 0; i < last; ++i) {
    const double width = samples[i + 1].t - samples[i].t, p = root(i), q = root(i + 1);
    below += of_square(width, p, q);
    // The chords on both sides, drawn out, meet over the interval. An end has a chord on one side only.
    const double rise = i > 0 ? slope(i - 1) : 0, fall = i + 1 < last ? slope(i + 1) : 0;
    double peak = i == 0 ? 0 : width;
    if (i > 0 && i + 1 < last && rise > fall) peak = std::clamp((q - p - fall * width) / (rise - fall), 0.0, width);
    const double height = i == 0 ? q - fall * width : p + rise * peak;
    above += of_square(peak, p, height) + of_square(width - peak, height, i + 1 == last ? height : q);
  }
  const double before = samples.front().t - begin, after = end - samples.back().t;
  above += of_square(before, root(0) - slope(0) * before, root(0));
  above += of_square(after, root(last), root(last) + slope(last - 1) * after);
  const double volume = sum.integrals.volume;
  return below * (1 - 1e-9) <= volume && volume <= above * (1 + 1e-9);
}

}  // namespace overlapper::slicing
