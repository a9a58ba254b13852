#include "methods/round/lenses/integrate.h"

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <numbers>
#include <span>
#include <tuple>

#include "geometry/constants.h"
#include "geometry/wide.h"
#include "methods/round/lenses/outlines.h"
#include "methods/round/slicing/rules.h"

namespace overlapper::lenses {
namespace {

using slicing::Range;
using slicing::Rule;
using slicing::Series;

/// If the relative error of a rule is not larger, no finer rule follows.
constexpr double kVolumeError = 2e-15, kVolumeErrorInWalls = 1e-14, kSlowVolumeError = 1e-14, kAreaError = 1e-11,
                 kBorderError = 1e-12, kBorderErrorClosely = 1e-11;
constexpr int kMostHalvings = 40;
constexpr int kMostRules = 400;

struct Part {
  Range range;
  int nodes;
  Sums sums;
  Series volume, area, border;
};

class Integrating {
 public:
  Integrating(const Discs& discs, const Wanted& wanted)
      : discs_(discs), wanted_(wanted), volume_(wanted.volume), border_(wanted.border) {}

  Integral run() {
    const Changes at = changes(discs_);
    // Walls have singular places, too, which are not known away from the real line. kOfRules is for these.
    if (discs_.cuts == 0) singular_ = std::span(at.singular.data(), at.singulars);
    std::array<Part, std::tuple_size_v<decltype(Changes::t)>> parts;
    int count = 0;
    for (int i = 0; i + 1 < at.count; ++i) {
      if (!(at.t[i] < at.t[i + 1])) continue;
      const double middle = at.t[i] / 2 + at.t[i + 1] / 2;
      if (section(discs_, middle).outline == Outline::kNothing) continue;
      if (discs_.cuts > 0 && !(slice(discs_, middle, {}).moments.volume > 0)) continue;
      Range range{at.t[i], at.t[i + 1]};
      if (i > 0 && at.t[i - 1] < at.t[i]) range.before = at.t[i] - at.t[i - 1];
      if (i + 2 < at.count && at.t[i + 1] < at.t[i + 2]) range.after = at.t[i + 2] - at.t[i + 1];
      parts[count++] = apply(range, slicing::kNodes24);
    }
    for (int i = 0; i < count; ++i)
      volume_ += parts[i].sums.moments.volume, border_ += parts[i].sums.border,
          area_ += parts[i].sums.first_area + parts[i].sums.second_area;
    for (int i = 0; i < count; ++i) add(parts[i], true, 0);
    for (const bool high : {false, true}) {
      const std::optional<Cut>& end = discs_.end[high];
      const double t = at.count > 0 ? at.t[high ? at.count - 1 : 0] : 0;
      if (end && at.count > 0 && t == end->offset / end->rate)
        add_end(discs_, *end, slice(discs_, t, {}).moments.volume, wanted_, result_.sums);
    }
    return result_;
  }

 private:
  Part apply(const Range& range, Rule rule) {
    Part part{range, 2 * static_cast<int>(rule.size()), {}, {}, {}, {}};
    ++rules_;
    for (const slicing::Node& node : rule) {
      std::array<Sums, 2> at;
      const std::array<Range::Place, 2> places = range.places(node);
      for (int i = 0; i < 2; ++i) {
        const DoubleDouble t = two_sum(places[i].end, places[i].step);
        at[i] = slice(discs_, t.head, wanted_, t.tail);
        part.sums.add(places[i].weight, at[i], wanted_);
      }
      const auto add = [&](Series& series, double low, double high) {
        series.add(node, places[0].rate * low, places[1].rate * high);
      };
      const auto& [low, high] = at;
      add(part.volume, low.moments.volume, high.moments.volume);
      if (wanted_.closing) add(part.border, low.border, high.border);
      if (wanted_.first) add(part.area, low.first_area + low.second_area, high.first_area + high.second_area);
    }
    result_.nodes += 2 * static_cast<int>(rule.size());
    return part;
  }

  /// The error of a sum. Where a square root lies near an interval, terms of the series fall fast at first, and then as
  /// slowly as the last two do.
  static double error_of_series(const Series& series) {
    const double last = std::abs(series.last), before = std::abs(series.last_but_one);
    const double fall = last < before ? last / before : 1;
    return std::max(series.error(), series.tail() * std::pow(fall, 24));
  }

  /// The error by terms that come from singular places. From the last term to the last one that the rule integrates,
  /// they fall by as many powers of 1 / ρ. ρ is the sum of the half axes of the Bernstein ellipse in x about [-1, 1]
  /// through the place nearest by that measure. In an end of the interval, slices are analytic in x.
  double slow_error(const Part& part) const {
    if (part.range.near != 0) return 0;
    double least = kInfinity;
    const double low = part.range.low, high = part.range.high, half = (high - low) / 2, middle = low + half;
    for (const auto& [t, aside] : singular_) {
      const double place = (middle - t) / half, off = aside / half;
      const double from_low = std::hypot(place - 1, off), from_high = std::hypot(place + 1, off);
      constexpr double kAtEnd = 1e-9, kNear = 0.2, kBeside = 1.3;  // elsewhere, ρ is 1.9 or more
      const double nearest = std::min(from_low, from_high);
      if (nearest <= kAtEnd || (nearest > kNear && (std::abs(place) > 1 || off > kBeside))) continue;
      // The angle θ of the place, and x = 2 θ / π − 1.
      const double real = std::acos(std::clamp((from_high - from_low) / 2, -1.0, 1.0)),
                   imaginary = std::acosh(std::max(1.0, (from_high + from_low) / 2));
      const double x = 2 / std::numbers::pi * real - 1, y = 2 / std::numbers::pi * imaginary;
      least = std::min(least, (std::hypot(x - 1, y) + std::hypot(x + 1, y)) / 2);
    }
    if (!(least < kInfinity)) return 0;
    const double fall = least - std::sqrt(std::max(0.0, least * least - 1));
    return part.volume.tail() * std::pow(fall, part.nodes);
  }

  bool enough(const Part& part) const {
    const double limit = discs_.cuts > 0 ? kVolumeErrorInWalls : kVolumeError;
    const double small = std::max(limit * volume_, 4 * DBL_EPSILON * part.sums.blur);
    const bool rounded = part.volume.tail() <= 16 * DBL_EPSILON * part.sums.moments.volume;
    if (!rounded &&
        (error_of_series(part.volume) > small || slow_error(part) > std::max(small, kSlowVolumeError * volume_)))
      return false;
    if (wanted_.closing && border_error(part) > border_ && part.border.tail() > 64 * DBL_EPSILON * part.sums.border)
      return false;
    return !wanted_.first ||
           part.area.stretched_error(part.sums.first_area + part.sums.second_area) <= kAreaError * area_;
  }

  /// The error of the border, in units of the largest error that is accurate enough.
  double border_error(const Part& part) const {
    return wanted_.closely ? part.border.stretched_error(part.sums.border) / kBorderErrorClosely
                           : part.border.error() / kBorderError;
  }

  /// Whether the finest rule may be accurate enough. Terms of the border then have to fall as fast as before, for 8
  /// more nodes and up to the last term that the rule integrates.
  bool suits_finer(const Part& part) const {
    return part.volume.ratio() < 1e-3 &&
           !(wanted_.closing && border_error(part) * std::pow(part.border.ratio(), 4.0 / 3) > border_);
  }

  void add(const Part& part, bool may_be_finer, int halvings) {
    if (!enough(part) && rules_ < kMostRules) {
      if (may_be_finer && suits_finer(part)) return add(apply(part.range, slicing::kNodes32), false, halvings);
      if (halvings < kMostHalvings) {
        for (const Range& half : part.range.halves()) add(apply(half, slicing::kNodes24), true, halvings + 1);
        return;
      }
    }
    result_.sums.add(1, part.sums, wanted_);
    result_.error += std::max(error_of_series(part.volume), slow_error(part));
    const double area = part.sums.first_area + part.sums.second_area;
    if (wanted_.first) result_.area_error += part.area.stretched_error(area);
  }

  const Discs& discs_;
  const Wanted& wanted_;
  double volume_, border_, area_ = 0;
  std::span<const Changes::Singular> singular_;
  int rules_ = 0;
  Integral result_;
};

}  // namespace

Integral integrate(const Discs& discs, const Wanted& wanted) { return Integrating(discs, wanted).run(); }

}  // namespace overlapper::lenses
