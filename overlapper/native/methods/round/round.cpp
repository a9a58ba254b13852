#include "methods/round/round.h"

#include <algorithm>

#include "geometry/rounding.h"
#include "methods/round/offset/in_ball.h"
#include "methods/round/offset/in_ellipsoid.h"
#include "methods/round/offset/in_polytope.h"
#include "methods/round/offset/two_rounded.h"

namespace overlapper {
namespace {

void count(const Placed& body, RoundTraits& traits) {
  if (const auto revolved = closed_forms::revolved(body)) {
    ++(revolved->ball() ? traits.balls : revolved->round ? traits.capsules : traits.cylinders);
  } else if (stretched(body.shape)) {
    ++traits.stretched;
  } else {
    ++(smooth(body.shape) ? traits.rounded_hulls : traits.flat);
  }
}

const RoundChoice& choose(const Placed& a, const Placed& b, bool outside) {
  RoundTraits traits;
  traits.outside = outside;
  count(a, traits), count(b, traits);
  return *std::ranges::find_if(kRoundChoices, [&](const RoundChoice& choice) { return choice.fits(traits); });
}

/// m³: the error of the volume by double-doubles, from which closed forms take depths and places.
double misplaced(const Placed& a, const Placed& b, const Measures& m) {
  const double apart = norm(a.pose.translation - b.pose.translation);
  const bool turned = !unturned(a.orientation) || !unturned(b.orientation);
  return wide_placing(reach(a, reach(b, apart + reach(a.shape) + reach(b.shape))), turned) * m.area;
}

double relative_error(const Measures& m) { return m.volume_error / m.volume; }

}  // namespace

std::optional<MeasuresAndInertia> closed_form(const Placed& a, const Placed& b, double rounding, Vec3 reference) {
  const closed_forms::RoundPair pair = closed_forms::round_pair(a, b, rounding, reference);
  std::optional<MeasuresAndInertia> best;
  for (const closed_forms::ClosedForm form : choose(a, b, pair.outside).forms) {
    if (!form) break;
    auto found = form(pair);
    if (found && !(best && relative_error(best->measures) <= relative_error(found->measures))) best = std::move(found);
    if (best && relative_error(best->measures) <= kEnoughOfRound) break;
  }
  if (best) best->measures.volume_error += misplaced(a, b, best->measures);
  return best;
}

std::optional<VolumeAlone> volume_by_surface(const Placed& a, const Placed& b, const std::optional<Vec3>& between,
                                             const std::optional<Vec3>& nearest, double depth) {
  const bool first = rounded_hull(a.shape) || (smooth(a.shape) && !smooth(b.shape));
  const Placed &rounded = first ? a : b, &other = first ? b : a;
  if (!rounded_hull(rounded.shape)) {
    const auto own = revolution(rounded.shape);
    if (smooth(other.shape) || !own || !own->round_ends || own->half_length == 0) return std::nullopt;
    return offset::volume_in_polytope(rounded, other, nearest, depth);
  }
  if (stretched(other.shape)) return offset::volume_in_ellipsoid(rounded, other);
  if (!smooth(other.shape)) return offset::volume_in_polytope(rounded, other, nearest, depth);
  if (rounded_hull(other.shape)) return offset::volume_of_two_rounded(rounded, other, between);
  const auto revolved = revolution(other.shape);
  if (!revolved) return std::nullopt;
  return revolved->round_ends && revolved->half_length == 0 ? offset::volume_in_ball(rounded, other)
                                                            : offset::volume_of_two_rounded(rounded, other, between);
}

std::optional<pieces::RoundMeasures> measure_by_slices(const pieces::SlicedPair& pair) {
  const pieces::Slicing slicing = choose(pair.a, pair.b, false).slicing;
  return slicing ? slicing(pair) : std::nullopt;
}

}  // namespace overlapper
