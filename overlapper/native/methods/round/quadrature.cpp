#include "methods/round/quadrature.h"

#include <algorithm>
#include <array>
#include <cfloat>
#include <limits>

namespace overlapper::slicing {
namespace {

/// A node x < 0 of the rule of Gauss and Legendre with twenty nodes, θ = π/2 (1 + x); its mirror image has the same
/// numbers, those for odd coefficients negated. Made with mpmath.
struct Node {
  double share;               ///< sin²(θ/2): of the interval, how much lies below
  double weight;              ///< of the slice there, for an interval of length one
  double sine;                ///< sin θ
  double last, last_but_one;  ///< what it gives to the coefficients 19 and 18 of the Legendre series
  double tenth, ninth;        ///< likewise
};
constexpr std::array<Node, 10> kNodes{{
    {2.9125011836602692e-5, 0.00014931545975041974, 0.01079336158391596, -0.021416031600054791, 0.041418332533339329,
     0.12128237786003706, -0.11937908034964661},
    {0.00080047156645094384, 0.0018036832407043526, 0.056562560469704602, 0.073905784380102392, -0.13873656589564789,
     -0.084252230981265755, 0.0299883161974961},
    {0.0047439508469752285, 0.0067644309727544863, 0.13742555479002748, -0.14141296162008345, 0.25121397742423528,
     -0.22394445191677136, 0.23952959948397038},
    {0.015881358827840478, 0.016353516719622385, 0.25003312796205107, 0.21644186508752798, -0.3536811352151889,
     0.14556478637625199, 0.014926122863695763},
    {0.039170373544543074, 0.03106164566633978, 0.38800028546857557, -0.29299971492323504, 0.42584085924972273,
     0.27249009898101702, -0.30264365538440568},
    {0.079504896271153461, 0.050225577761862857, 0.54105034050471344, 0.36579330002083763, -0.45308286683915951,
     -0.1979093838205187, -0.090260186092919599},
    {0.14046330817633844, 0.071875659245456093, 0.69493414718949425, -0.43015043504117464, 0.42793355453058784,
     -0.29296872251053843, 0.32286908653152735},
    {0.22306042564076279, 0.092919518105004433, 0.83259707458944275, 0.48211063670381045, -0.35085285124816943,
     0.2415078446362778, 0.17451125550826214},
    {0.32489037012850178, 0.10974017094932422, 0.93666774797954242, -0.51855508252321621, 0.23002220531294431,
     0.29214655760977506, -0.3033496366166081},
    {0.44004085488196592, 0.11910648187918097, 0.99278376480825779, 0.53732818115559507, -0.080075509852663748,
     -0.27391687623426469, -0.25034997048389792},
}};

/// The relative errors of a rule that are not worth halving for, at first.
constexpr double kVolumeError = 2e-14, kAreaError = 1e-12;
/// The relative size at which the last coefficients of the series leave no error worth halving for: a rule of n nodes
/// integrates the first 2 n terms, so that its error is as small as the square of the n-th.
constexpr double kVolumeTail = 2e-9, kAreaTail = 1e-7;
constexpr int kMostHalvings = 48;
/// Rules after which halving goes on for ever: where two surfaces touch along a line.
constexpr int kMostRules = 300;

/// Coefficients in the middle and at the end of a Legendre series, from values at the nodes.
struct Series {
  double last = 0, last_but_one = 0, tenth = 0, ninth = 0;
  void add(const Node& node, double low, double high) {
    last += node.last * (low - high);
    last_but_one += node.last_but_one * (low + high);
    tenth += node.tenth * (low + high);
    ninth += node.ninth * (low - high);
  }
  double tail() const { return std::max(std::abs(last), std::abs(last_but_one)); }
  /// A rule of n nodes integrates the first 2 n terms. From the tenth to the twentieth, terms have become smaller by a
  /// factor; to the fortieth, they do so twice again, and more if the integrand has no singularity nearby.
  double error() const {
    const double middle = std::max(std::abs(tenth), std::abs(ninth)), ratio = middle > 0 ? tail() / middle : 1;
    return 30 * tail() * std::min(1.0, ratio * ratio);
  }
};

bool integrate(const Stack& stack, const Outline& outline, double low, double high, double volume, double area,
               double strictness, int halvings, Sum& sum) {
  if (++sum.rules > kMostRules) return false;
  const double width = high - low;
  Integrals here;
  Series of_volume, of_area;
  std::array<Sample, 20> samples;
  for (size_t i = 0; i < kNodes.size(); ++i) {
    const Node& node = kNodes[i];
    const double step = width * node.share;
    const Integrals below = measure(Slice(stack, low + step), outline);
    const Integrals above = measure(Slice(stack, high - step), outline);
    here.add(width * node.weight, below);
    here.add(width * node.weight, above);
    of_volume.add(node, node.sine * below.volume, node.sine * above.volume);
    of_area.add(node, node.sine * below.area, node.sine * above.area);
    samples[i] = {low + step, below.volume};
    samples[samples.size() - 1 - i] = {high - step, above.volume};
  }
  // The coefficients as volumes and areas; the error beyond the rule goes like the square of what is left.
  const double tail = width * of_volume.tail();
  const double whole = std::max(volume, here.volume), whole_area = std::max(area, here.area);
  // Of what rounding leaves, halving makes no less.
  const double rounding = 16 * DBL_EPSILON * here.blur / here.volume;
  const auto rough = [&](const Series& series, double sum_here, double sum_whole, double limit, double limit_of_tail) {
    const double end = width * series.tail();
    if (end <= rounding * sum_here) return false;
    return strictness > 0 ? strictness * end > limit_of_tail * sum_whole : width * series.error() > limit * sum_whole;
  };
  if ((rough(of_volume, here.volume, whole, kVolumeError, kVolumeTail) ||
       rough(of_area, here.area, whole_area, kAreaError, kAreaTail)) &&
      halvings < kMostHalvings && width > 1e-14 * (std::abs(low) + std::abs(high))) {
    const double middle = low + width / 2;
    return integrate(stack, outline, low, middle, whole, whole_area, strictness, halvings + 1, sum) &&
           integrate(stack, outline, middle, high, whole, whole_area, strictness, halvings + 1, sum);
  }
  sum.integrals.add(1, here);
  sum.samples.insert(sum.samples.end(), samples.begin(), samples.end());
  const double ratio = whole > 0 ? tail / whole : 0;
  sum.error += strictness > 0 ? whole * std::min(ratio, 30 * ratio * std::sqrt(ratio)) : width * of_volume.error();
  return true;
}

/// Of slices that are polygons, the integrands are polynomials of degree four at most, which the rule of Gauss and
/// Legendre with three nodes integrates exactly.
void integrate_polygons(const Stack& stack, const Interval& interval, Sum& sum) {
  constexpr double kShare = 0.1127016653792583, kOuter = 5.0 / 18, kInner = 8.0 / 18;
  const double width = interval.high - interval.low;
  const auto add = [&](double t, double weight) {
    const Integrals slice = measure(Slice(stack, t), interval.outline);
    sum.integrals.add(width * weight, slice);
    sum.samples.push_back({t, slice.volume});
  };
  add(interval.low + kShare * width, kOuter);
  add(interval.low + 0.5 * width, kInner);
  add(interval.high - kShare * width, kOuter);
}

}  // namespace

bool integrate(const Stack& stack, const Interval& interval, double volume, double area, double strictness, Sum& sum) {
  if (stack.quadrics == 0) {
    integrate_polygons(stack, interval, sum);
    return true;
  }
  return integrate(stack, interval.outline, interval.low, interval.high, volume, area + sum.integrals.area, strictness,
                   0, sum);
}

namespace {

/// The integral of the square of what rises from p to q.
double of_square(double width, double p, double q) { return width / 3 * (p * p + p * q + q * q); }

}  // namespace

bool within_chords(double begin, double end, Sum& sum) {
  std::vector<Sample>& samples = sum.samples;
  // Slopes between samples that lie very near each other would be rounding.
  const double low = samples.front().t, range = samples.back().t - low;
  double last_kept = -std::numeric_limits<double>::infinity();
  std::erase_if(samples, [&](const Sample& sample) {
    if (!(sample.t > last_kept + 2e-3 * range)) return true;
    last_kept = sample.t;
    return false;
  });
  const int last = static_cast<int>(samples.size()) - 1;
  if (last < 3) return true;
  const auto root = [&](int i) { return std::sqrt(std::max(0.0, samples[i].area)); };
  const auto slope = [&](int i) { return (root(i + 1) - root(i)) / (samples[i + 1].t - samples[i].t); };
  double below = 0, above = 0;
  for (int i = 0; i < last; ++i) {
    const double width = samples[i + 1].t - samples[i].t, p = root(i), q = root(i + 1);
    below += of_square(width, p, q);
    // The chords beside, drawn out, meet over the interval; at the ends there is one only.
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
