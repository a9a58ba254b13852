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

namespace overlapper::slicing {
namespace {

/// A node x < 0 of a rule of Gauss and Legendre with n nodes, and θ = π/2 (1 + x). The node at -x has the same numbers,
/// but those for odd coefficients are negated. Computed with mpmath.
struct Node {
  double share;               ///< sin²(θ/2): the fraction of the interval below the node
  double weight;              ///< of the slice, for an interval of length 1
  double sine;                ///< sin θ
  double last, last_but_one;  ///< its terms in the coefficients n − 1 and n − 2 of the Legendre series
  double even, odd;           ///< its terms in the coefficients n / 2 and n / 2 − 1; n is a multiple of four
};
// clang-format off
constexpr std::array<Node, 4> kNodes8{{
    {0.0009723930747465951, 0.004956013807543283, 0.06233610595649298, -0.11769245644771356, 0.2098921910670323, 0.29030541733775395, -0.2740188228304149},
    {0.025287307850590565, 0.054841235667607575, 0.3139927382106792, 0.3778969370845921, -0.5591073831433646, -0.24289619147803757, -0.053756356443960325},
    {0.13255503062228385, 0.16709469807274444, 0.6781863887723175, -0.6317745531190048, 0.6166048635025358, -0.46158532259653046, 0.4671207500358303},
    {0.3579160380490356, 0.27310805245210357, 0.9587745256447251, 0.7849065579218132, -0.26738967142620357, 0.41417609673681405, 0.32968848669588297},
}};
constexpr std::array<Node, 8> kNodes16{{
    {6.929546966908637e-05, 0.00035503112097767017, 0.016648203243229548, -0.03278130486396174, 0.06270545045312347, 0.15058800145020093, -0.14740575972423792},
    {0.00189372306883215, 0.004251385094079633, 0.08695140899998625, 0.1122209124505884, -0.20493540387013992, -0.10847571647570407, 0.025281105530178673},
    {0.011095931029013096, 0.015657646148953673, 0.20950237558187715, -0.21159853063188444, 0.3541214949557947, -0.27282166214653136, 0.292586524485687},
    {0.03645255560584376, 0.03668930032305557, 0.37482671620708485, 0.31691961779722083, -0.46284478766452636, 0.1895693337450734, 0.05269404819587083},
    {0.08739956378658222, 0.06636434224332013, 0.5648393755272285, -0.41664037702596135, 0.49770223675171826, 0.3211314759255782, -0.35201317927912984},
    {0.17051405730045766, 0.09992938781207442, 0.7521675705941965, 0.5008933497159644, -0.4435406121078921, -0.2559042813894806, -0.16501933751603287},
    {0.28597146820556574, 0.12961280457896754, 0.9037517083312625, -0.5617461448292791, 0.305833437439604, -0.32830696857627284, 0.3414173736623772},
    {0.4256540670547978, 0.14714010267857136, 0.988883577079744, 0.5936159289428018, -0.10904181595768207, 0.30421981746713633, 0.2717959571544673},
}};
constexpr std::array<Node, 12> kNodes24{{
    {1.4287943182011783e-05, 7.327571601569155e-05, 0.00755982513995963, -0.015074422043108972, 0.029351489020715417, 0.10150925819667533, -0.10025190784166031},
    {0.0003938971595899967, 0.0008893007537826567, 0.039685866734527224, 0.05225186613570152, -0.09964836396246231, -0.06873805069573369, 0.030606001998891554},
    {0.002348378028467179, 0.0033664783772112974, 0.09680626320858773, -0.10078656328461252, 0.18501939296171394, -0.18957472949225282, 0.20182229812545555},
    {0.007937163319033949, 0.008265449094038245, 0.1774729811264907, 0.15608887413910497, -0.2707035684056185, 0.1174497162931925, -0.003804099433388402},
    {0.019852721999046002, 0.016071442592121454, 0.27898811034361015, -0.21465007688006033, 0.34437421825650083, 0.23506230633227274, -0.2611955292245529},
    {0.041083958148993106, 0.02687224824024659, 0.39696884780448394, 0.273384265122517, -0.395879298679761, -0.15959948041355967, -0.047927981514031666},
    {0.07446413498096881, 0.040255283030036906, 0.5250494360819936, -0.32949021039193754, 0.41779665729859544, -0.2597555657954904, 0.2919797934483577},
    {0.12214222419855339, 0.055264739761756845, 0.6548999962326575, 0.3804443849065234, -0.4059832229947917, 0.1966314065314693, 0.11122580634829161},
    {0.18505901057631888, 0.07045979452940064, 0.7766908604607956, -0.4240372347791966, 0.3598916075978801, 0.26900217397948084, -0.29589202305082996},
    {0.26254230538810935, 0.08409560050528943, 0.8800314614139794, 0.4584224693630116, -0.282566041006413, -0.22762295528842091, -0.1758949494670128},
    {0.35214015559282785, 0.09441219942671737, 0.9552747592434061, -0.48216589541230115, 0.18029543451965438, -0.26547582192752966, 0.2749481630697655},
    {0.44977468483151917, 0.09997418797338287, 0.9949420439728673, 0.4942866471300963, -0.06194830460601351, 0.2511117422798965, 0.23299835560593826},
}};
// clang-format on
using Rule = std::span<const Node>;
constexpr std::array<Rule, 3> kRules{kNodes8, kNodes16, kNodes24};
static_assert(2 * kNodes24.size() == kMostNodes);
static_assert(std::ranges::all_of(kRules, [](Rule rule) { return rule.size() % 2 == 0; }));

/// If the relative error of a rule is smaller, no other rule is tried.
constexpr double kVolumeError = 1e-14, kAreaError = 1e-12;
/// The same for the area of a stretched ball, from a bound of its terms.
constexpr double kStretchedAreaError = 1e-11;
/// If the last coefficients of the series are smaller, relative to the whole, halving is not worth it. A rule of n
/// nodes integrates the first 2 n terms, so its error is about the square of the n-th term.
constexpr double kVolumeTail = 2e-9, kAreaTail = 1e-7;
/// More nodes than any rule has. If so many are needed, half the interval would need hardly fewer.
constexpr double kHopeless = 30;
static_assert(kHopeless > kMostNodes);
constexpr int kMostHalvings = 48;
/// Rules after which halving goes on for ever: where two surfaces touch along a line.
constexpr int kMostRules = 600;
/// Rules after which the area of a stretched ball, whose element may change as sharply as at an edge, has its error.
constexpr int kMostRulesForStretch = 240;

/// Coefficients in the middle and at the end of a Legendre series, summed over the nodes.
struct Series {
  double last = 0, last_but_one = 0, even = 0, odd = 0;
  void add(const Node& node, double low, double high) {
    last += node.last * (low - high);
    last_but_one += node.last_but_one * (low + high);
    even += node.even * (low + high);
    odd += node.odd * (low - high);
  }
  double tail() const { return std::max(std::abs(last), std::abs(last_but_one)); }
  /// The size of the last terms relative to those in the middle, at most 1.
  double ratio() const {
    const double middle = std::max(std::abs(even), std::abs(odd)), end = tail();
    return end < middle ? end / middle : 1;
  }
  /// A rule of n nodes integrates the first 2 n terms. From the middle to the n-th term, terms fall by the ratio. To
  /// the last one, they fall twice more by that ratio, or faster if the integrand has no singularity nearby.
  double error() const { return 30 * tail() * ratio() * ratio(); }
  /// The error if the element of the area is sharp near an end of the interval. Terms begin at about `whole`. They fall
  /// fast at first, and then as slowly as those of a root. They are taken to fall once more by the ratio, not twice. If
  /// they fell less to the end than to the middle, that fall is less by the square of the same factor.
  double stretched_error(double whole) const {
    const double middle = std::max(std::abs(even), std::abs(odd)), second = ratio();
    const double slowing = middle > 0 ? std::max(1.0, second * whole / middle) : 1;
    return 30 * tail() * std::min(1.0, second * slowing * slowing);
  }
  /// How many times half the nodes are needed until the error is so small, if terms keep falling at this rate.
  double halves_until(double small) const {
    const double now = error();
    if (now <= small) return 0;
    const double each = -2 * std::log(ratio());
    return each > 0 ? std::log(now / small) / each : std::numeric_limits<double>::infinity();
  }
};

/// The answer of a rule for the slices between two values of t.
struct RulePart {
  const Outline* outline;
  double low, high;
  Rule rule;
  Integrals integrals;
  Series volume, area;
  std::array<Sample, kMostNodes> samples;

  double width() const { return high - low; }
};

RulePart apply(const Stack& stack, const Outline& outline, double low, double high, Rule rule) {
  RulePart part{&outline, low, high, rule, {}, {}, {}, {}};
  const double width = high - low;
  const int half = static_cast<int>(rule.size()), size = 2 * half;
  Nodes nodes;
  nodes.size = size;
  for (int i = 0; i < half; ++i) {
    const double step = width * rule[i].share, weight = width * rule[i].weight;
    const DoubleDouble from_low = two_sum(low, step), from_high = two_sum(high, -step);
    nodes.t[i] = from_low.head, nodes.t[size - 1 - i] = from_high.head;
    nodes.tail[i] = from_low.tail, nodes.tail[size - 1 - i] = from_high.tail;
    nodes.weight[i] = nodes.weight[size - 1 - i] = weight;
  }
  Slices slices;
  part.integrals = measure(stack, outline, nodes, slices);
  for (int i = 0; i < half; ++i) {
    const double sine = width * rule[i].sine;
    const int mirror = size - 1 - i;
    part.volume.add(rule[i], sine * slices.volume[i], sine * slices.volume[mirror]);
    part.area.add(rule[i], sine * slices.area[i], sine * slices.area[mirror]);
  }
  for (int i = 0; i < size; ++i) part.samples[i] = {nodes.t[i], slices.volume[i]};
  return part;
}

class Integrating {
 public:
  Integrating(const Stack& stack, double volume, double area, bool few, double strictness, Sum& sum)
      : stack_(stack), volume_(volume), area_(area), few_(few), strictness_(strictness), sum_(sum) {}

  bool run(std::span<const Interval> intervals) {
    thread_local std::vector<RulePart> parts;
    parts.clear();
    for (const Interval& interval : intervals)
      parts.push_back(apply(stack_, interval.outline, interval.low, interval.high, first()));
    for (const RulePart& part : parts) sum_.about += part.integrals.volume, area_ += part.integrals.area;
    volume_ += sum_.about;
    for (const RulePart& part : parts)
      if (!add(part, 0)) return false;
    return true;
  }

 private:
  Rule first() const { return few_ ? kRules.front() : kRules.back(); }

  /// How many times half of its nodes a rule lacks.
  double lacks(const RulePart& part) const {
    // No rule makes rounding smaller.
    const double rounding = 16 * DBL_EPSILON * part.integrals.blur / part.integrals.volume;
    const auto of = [&](const Series& series, double here, double whole, double limit, double limit_of_tail) {
      const double end = series.tail();
      if (end <= rounding * here) return 0.0;
      if (strictness_ > 0) return strictness_ * end > limit_of_tail * whole ? 100.0 : 0.0;
      return series.halves_until(limit * whole);
    };
    const double volume = of(part.volume, part.integrals.volume, volume_, kVolumeError, kVolumeTail);
    if (stack_.stretch) {
      if (sum_.rules > kMostRulesForStretch) return volume;
      // If terms fall slowly, more nodes help little.
      if (part.area.stretched_error(part.integrals.area) > kStretchedAreaError * area_) return kHopeless;
    }
    return std::max(volume, of(part.area, part.integrals.area, area_, kAreaError, kAreaTail));
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
      if (const auto rule = finer(part, lacking))
        return add(apply(stack_, *part.outline, part.low, part.high, *rule), halvings);
      if (halvings < kMostHalvings && part.width() > 1e-14 * (std::abs(part.low) + std::abs(part.high))) {
        const double middle = part.low + part.width() / 2;
        return add(apply(stack_, *part.outline, part.low, middle, first()), halvings + 1) &&
               add(apply(stack_, *part.outline, middle, part.high, first()), halvings + 1);
      }
    }
    add_as_it_is(part);
    return true;
  }

  void add_as_it_is(const RulePart& part) {
    sum_.integrals.add(1, part.integrals);
    sum_.samples.insert(sum_.samples.end(), part.samples.begin(), part.samples.begin() + 2 * part.rule.size());
    // If halving for the area has ended, terms are not taken to fall further.
    const bool ended = sum_.rules > kMostRulesForStretch;
    const double of_stretched = ended ? 30 * part.area.tail() : part.area.stretched_error(part.integrals.area);
    sum_.area_error += stack_.stretch ? of_stretched : part.area.error();
    const double ratio = volume_ > 0 ? part.volume.tail() / volume_ : 0;
    sum_.error += strictness_ > 0 ? volume_ * std::min(ratio, 30 * ratio * std::sqrt(ratio)) : part.volume.error();
  }

  const Stack& stack_;
  double volume_, area_;  ///< about the totals of all pieces so far and of this one
  bool few_;
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
