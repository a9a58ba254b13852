#include "methods/choose.h"

#include <algorithm>
#include <numeric>
#include <stdexcept>

#include "distance/gjk.h"
#include "distance/wide_gap.h"
#include "geometry/constants.h"
#include "geometry/rounding.h"
#include "methods/clipping/clip.h"
#include "methods/half_spaces_alone.h"
#include "methods/round/round.h"
#include "methods/tracing/trace.h"
#include "shapes/canonical_order.h"
#include "shapes/mesh.h"
#include "shapes/planes_asked.h"

namespace overlapper {
namespace {

template <class S>
Traits traits(const S& shape) {
  Traits own{};
  own.bodies = 1;
  own.bounded = S::kBounded;
  own.flat = !S::kSmooth;
  if constexpr (S::kSmooth) {
    own.round = shape.revolution().has_value();
    own.rounded = shape.polytope() != nullptr;
    own.stretched = shape.stretched() != nullptr;
    own.other = !own.round && !own.rounded && !own.stretched;
    own.ellipsoids =
        own.stretched || (own.round && shape.revolution()->round_ends && shape.revolution()->half_length == 0);
  } else {
    own.clippable = shape.edges_known() && shape.facet_count() <= static_cast<int>(kMostFacetsClipped);
  }
  return own;
}
Traits traits(const Shape& shape) {
  return ask(shape, [](const auto& s) { return traits(s); });
}

Traits operator+(const Traits& a, const Traits& b) {
  return {a.bodies + b.bodies, a.bounded || b.bounded,     a.clippable && b.clippable, false,
          a.round || b.round,  a.rounded || b.rounded,     a.stretched || b.stretched, a.flat || b.flat,
          a.other || b.other,  a.ellipsoids + b.ellipsoids};
}

/// Unrolled line by line, so that the compiler sees each condition: a search through pointers slows down two separated
/// boxes.
template <size_t kLine>
const Choice& first_that_fits(const Traits& traits) {
  constexpr const Choice& choice = kChoices[kLine];
  if constexpr (kLine + 1 == kChoices.size()) return choice;
  else return choice.fits(traits) ? choice : first_that_fits<kLine + 1>(traits);
}

}  // namespace

Traits traits(const Placed& a, const Placed& b) {
  Traits both = traits(a.shape) + traits(b.shape);
  both.many_facet_pairs = has_graph(a.shape) && has_graph(b.shape) &&
                          static_cast<double>(facets(a.shape)) * facets(b.shape) > kLeastPairsTraced;
  return both;
}

Traits traits(std::span<const Placed> bodies) {
  if (bodies.size() == 2) return traits(bodies[0], bodies[1]);
  Traits all = traits(bodies[0].shape);
  for (const Placed& body : bodies.subspan(1)) all = all + traits(body.shape);
  return all;
}

const Choice& choose(const Traits& traits) { return first_that_fits<0>(traits); }

std::optional<Measures> measure_at_once(const Placed& a, const Placed& b, std::optional<SideAreas>* sides,
                                        std::optional<Patch>* patch) {
  const Choice& choice = choose(traits(a, b));
  if (choice.tries(Way::kTracing))
    if (auto measures = trace(a, b)) return measures;
  return choice.tries(Way::kClipping) ? clip(a, b, sides, patch) : std::nullopt;
}

std::optional<Measures> measure_at_once(std::span<const Placed> bodies) {
  if (bodies.size() == 2) return measure_at_once(bodies[0], bodies[1]);
  return choose(traits(bodies)).tries(Way::kClipping) ? clip(bodies) : std::nullopt;
}

// ------------------------------------------------------------------------------------------------------------- search

Arrangement arranged(std::span<const Placed> bodies) {
  Arrangement at{canonical_order(bodies), {}, {}};
  at.reference = bodies[at.order[0]].pose.translation;
  at.relative.reserve(bodies.size());
  for (int body : at.order) at.relative.push_back(bodies[body].seen_from(at.reference));
  return at;
}

std::vector<WideBody> Arrangement::wide_bodies() const {
  std::vector<WideBody> bodies;
  for (const Placed& body : relative) bodies.emplace_back(body, wide(reference));
  return bodies;
}

double magnitude(const Placed& relative) {
  if (const Plane* plane = only_plane(relative.shape)) return norm(relative.pose.translation) + std::abs(plane->offset);
  const Bounds box = bounds(relative);
  return reach(relative, norm(max(abs(box.lower), abs(box.upper)))) + flatness(relative.shape) / rounding(1);
}

double wide_rounding(double reach) { return 0x1p-96 * reach; }

namespace {

void append_planes(const Placed& body, std::vector<Plane>& planes) {
  append_planes(body.shape, planes);
  for (Plane& plane : planes) plane = body.pose * plane;
}
void append_planes(const WideBody& body, std::vector<WidePlane>& planes) { body.append_planes(planes); }

template <class Body>
std::vector<Owned<PlaneOf<Body>>> gather_planes(std::span<const Body> bodies) {
  std::vector<Owned<PlaneOf<Body>>> planes;
  std::vector<PlaneOf<Body>> own;
  for (int i = 0; i < static_cast<int>(bodies.size()); ++i) {
    own.clear();
    append_planes(bodies[i], own);
    for (const PlaneOf<Body>& plane : own) planes.push_back({plane, i});
  }
  planes_asked += planes.size();
  return planes;
}

/// Two planes that face each other across the gap of a pair, or across the lens of two smooth bodies.
std::vector<OwnedPlane> facing_planes(std::span<const Placed> bodies, const Distance& d) {
  if (norm2(d.normal) == 0) return {};
  std::vector<OwnedPlane> planes;
  for (int i = 0; i < 2; ++i) {
    if (!bounded(bodies[i].shape)) continue;
    const Vec3 outward = i == 0 ? -d.normal : d.normal;
    planes.push_back({{outward, dot(outward, bodies[i].support(outward))}, i});
  }
  return planes;
}

/// The answer of double-double arithmetic about a gap or a common ball, if doubles are uncertain. Empty if
/// double-doubles are uncertain, too.
struct Settled {
  Status status = Status::kTouching;
  std::optional<WideBall> ball;
};

/// The relevant sizes do not depend on mirror images, axes and order.
Settled settled_in_wide_arithmetic(const Arrangement& at, double reach, std::vector<OwnedPlane> hints) {
  const double plane_rounding = wide_rounding(reach);
  double least_size = kInfinity, largest_size = 0;
  for (const Placed& body : at.relative) {
    if (!bounded(body.shape)) continue;
    const Bounds box = bounds(body);
    const double size = norm(box.upper - box.lower);
    least_size = std::min(least_size, size);
    largest_size = std::max(largest_size, size);
  }
  if (!std::isfinite(least_size)) return {};
  const std::vector<WideBody> bodies = at.wide_bodies();
  // Bodies touch if their distance or common thickness is below the rounding of their coordinates, but never above
  // 1e-12 of the smaller body's size.
  const double margin = std::max(4 * plane_rounding, std::min(rounding(largest_size / 2), 0x1p-41 * least_size));
  if (bodies.size() == 2) {
    const WideGap gap = wide_gap(bodies[0], bodies[1], plane_rounding);
    if (gap.certified > margin) return {Status::kSeparated, {}};
    if (norm2(gap.normal) > 0) hints.insert(hints.end(), {{{-gap.normal, 0}, 0}, {{gap.normal, 0}, 1}});
  }
  Settled settled{Status::kTouching, wide_deepest_ball(bodies, hints, margin, reach, plane_rounding)};
  if (settled.ball->upper < -margin) settled.status = Status::kSeparated;
  if (settled.ball->lower > margin) settled.status = Status::kOverlapping;
  return settled;
}

/// The largest ball in the common set of bodies that overlap, however thin the set is.
WideBall wide_ball_of_overlap(const Arrangement& at, double reach, std::span<const OwnedPlane> hints) {
  const double plane_rounding = wide_rounding(reach);
  return wide_deepest_ball(at.wide_bodies(), hints, 4 * plane_rounding, reach, plane_rounding);
}

/// Up to so many half-spaces, any four of all are tried. With more, any four of those that the search has looked at are
/// tried.
constexpr size_t kMostTried = 16;

/// Settles the status of half-spaces alone exactly. The search looks only near their planes, and rounding tilts these.
/// Throws std::invalid_argument if the common set is unbounded, or is far from the places where the search looked.
void settle_half_spaces(std::span<const Placed> bodies, std::span<const OwnedPlane> cuts, Search& search) {
  if (search.status != Status::kOverlapping) {
    std::vector<bool> tried(bodies.size(), bodies.size() <= kMostTried);
    for (const OwnedPlane& cut : cuts)
      if (cut.owner >= 0) tried[cut.owner] = true;
    std::vector<Placed> some;
    for (size_t i = 0; i < bodies.size(); ++i)
      if (tried[i]) some.push_back(bodies[i]);
    if (have_no_common_point(some)) {
      if (search.status != Status::kSeparated) search.status = Status::kSeparated, search.way = Way::kWideSeparation;
      return;
    }
  }
  if (!bound_a_set(bodies))
    throw std::invalid_argument("shapes must have a bounded common set: half-spaces alone do not bound it");
  if (search.status == Status::kSeparated)
    throw std::invalid_argument("shapes must meet near their planes: half-spaces alone meet too far away");
}

/// Takes the ball of double-double arithmetic.
void look_closely(Inside& inside, WideBall ball, double reach) {
  inside.ball.upper = ball.upper, inside.ball.rounding = wide_rounding(reach);
  inside.wide_ball = std::move(ball);
}

/// True if the bodies certainly overlap because the distance of their cores is less than the sum of their radii. A
/// point of one core is then inside the other body, with interior points of its own body nearby.
bool cores_reach(const Placed& a, const Placed& b, const Distance& d, double reach) {
  return core_radius(a.shape) + core_radius(b.shape) > 0 && norm2(d.normal) > 0 && -d.distance > doubt(reach);
}

/// True if a rounded hull certainly overlaps a flat body because their cores do, beyond the doubt with the radius.
bool cores_overlap(const Placed& a, const Placed& b, const Distance& d, double reach) {
  const double radius = core_radius(a.shape) + core_radius(b.shape);
  const bool fits = (rounded_hull(a.shape) && !smooth(b.shape)) || (rounded_hull(b.shape) && !smooth(a.shape));
  return fits && d.overlap > 0 && d.overlap + radius > doubt(reach);
}

/// m: lower bound of the distance of a point from the surface of a body, negative outside. No value for a rounded hull.
std::optional<double> distance_inside(const Placed& body, Vec3 point) {
  if (!smooth(body.shape)) return -signed_distance(body.tightest(point), point);
  const Vec3 x = apply_transposed(body.pose.rotation, point - body.pose.translation);
  if (const Ellipsoid* own = stretched(body.shape)) {
    const Vec3 h = own->half_axes;
    return (1 - norm(Vec3{x.x / h.x, x.y / h.y, x.z / h.z})) * std::min({h.x, h.y, h.z});
  }
  const std::optional<Revolution> own = revolution(body.shape);
  if (!own) return std::nullopt;
  const double across = std::hypot(x.x, x.y), beyond = std::abs(x.z) - own->half_length;
  if (!own->round_ends) return std::min(own->radius - across, -beyond);
  return own->radius - std::hypot(across, std::max(beyond, 0.0));
}

/// m: what is deeper than this is certain, though the rounding of points is not bounded. Other proofs decide shallower
/// contacts.
double certain_depth(const Placed& body, double reach) {
  constexpr double kOfSize = 1e-9;
  return std::max(doubt(reach), kOfSize * radius(body.shape));
}

/// True if a body certainly holds a point, and all points near it.
bool holds(const Placed& body, Vec3 point, double reach) {
  const std::optional<double> inside = distance_inside(body, point);
  return inside && *inside > certain_depth(body, reach);
}

/// True if the bodies certainly overlap because one body holds the nearest point of the other. Interior points of the
/// other body are near that point.
bool one_holds_a_point(const Placed& a, const Placed& b, const Distance& d, double reach) {
  const auto beyond_plane = [&](const Placed& body, const Placed& other) {
    return !bounded(other.shape) && smooth(body.shape) && -d.distance > certain_depth(body, reach);
  };
  return holds(a, d.witness_b, reach) || holds(b, d.witness_a, reach) || beyond_plane(a, b) || beyond_plane(b, a);
}

Vec3 centre(const Placed& body) {
  const HullData* hull = polytope_of(body.shape);
  return hull ? body.pose * hull->centroid : body.pose.translation;
}

/// A point that both bodies certainly hold, at or near a point that one of them holds. Distances inside are concave. So
/// towards the centre of a body, the distance inside that body grows.
std::optional<Vec3> point_both_hold(const Placed& a, const Placed& b, Vec3 point, double reach) {
  const auto both_hold = [&](Vec3 p) { return holds(a, p, reach) && holds(b, p, reach); };
  if (both_hold(point)) return point;
  for (const auto& [inner, outer] : {std::pair(&a, &b), std::pair(&b, &a)}) {
    if (!bounded(outer->shape) || !holds(*inner, point, reach)) continue;
    const Vec3 way = centre(*outer) - point;
    const Vec3 moved = point + std::min(1.0, *distance_inside(*inner, point) / 2 / norm(way)) * way;
    if (both_hold(moved)) return moved;
  }
  return std::nullopt;
}

/// The middle of what two bodies share of the line between their centres. No value if they share nothing of it.
std::optional<Vec3> common_point_on_line_of_centres(const Placed& a, const Placed& b) {
  const Vec3 from = centre(a), to = centre(b), way = to - from;
  if (norm2(way) == 0) return from;
  const auto exit = [](const Placed& body, Vec3 start, Vec3 along) {
    const Plane plane = body.ray_exit(start, along);
    return -signed_distance(plane, start) / dot(plane.normal, along);
  };
  const double first = std::max(0.0, 1 - exit(b, to, -way)), last = std::min(1.0, exit(a, from, way));
  if (!(first < last)) return std::nullopt;
  return from + (first + last) / 2 * way;
}

/// Proves without a search that deep bodies overlap, one of them a ball, a capsule, a cylinder or an ellipsoid: one
/// body certainly holds a point of the other body.
bool overlap_at_centres(const Placed& a, const Placed& b, Search& search) {
  const auto known = [](const Shape& shape) { return bounded(shape) && !rounded_hull(shape); };
  if (!known(a.shape) || !known(b.shape) || !(smooth(a.shape) || smooth(b.shape))) return false;
  const std::optional<Vec3> point = common_point_on_line_of_centres(a, b);
  if (!point || !(holds(a, *point, search.reach) || holds(b, *point, search.reach))) return false;
  search.status = Status::kOverlapping, search.way = Way::kDual;
  search.between = point_both_hold(a, b, *point, search.reach);
  return true;
}

/// A point inside both bodies, about in the middle of what both radii reach between the nearest points of the cores. No
/// value if one body is its own core.
std::optional<Vec3> point_between(const Placed& a, const Placed& b, const Distance& d) {
  const auto inward = [](const Shape& shape) { return bounded(shape) ? core_radius(shape) : kInfinity; };
  const double depth = -d.distance, from_a = inward(a.shape), from_b = inward(b.shape);
  if (!(from_a > 0 && from_b > 0)) return std::nullopt;
  const double into_a = std::clamp(depth / 2, depth - std::min(depth, from_b), from_a);
  return d.witness_a + into_a * d.normal;
}

Region owned_as_given(Region region, const Arrangement& at) {
  for (Region::Facet& facet : region.facets) facet.owner = at.order[facet.owner];
  return region;
}

/// m: bound of the movement of a body's planes by rounding in double-double.
///
/// Entries of a rotation are off by 28 u² at most for u = 2^-53, so a direction is off by 84 u². The products of a
/// normal and a place, and their sum with an offset, take 28 u² more. Both are less than 2^-99. Crossings of edges and
/// tangent planes cancel digits, but only relative to the body's own size.
double wide_rounding_of_planes(const Placed& relative) {
  if (only_plane(relative.shape)) return 0x1p-99 * magnitude(relative);
  Placed own = relative;
  own.pose.translation = {};
  return wide_rounding(magnitude(own)) + 0x1p-99 * norm(relative.pose.translation);
}

Region grown_about(const WideBall& ball, const Arrangement& at, double tolerance) {
  const std::vector<WideBody> bodies = at.wide_bodies();
  const std::vector<Owned<WidePlane>> planes = gather_planes<WideBody>(bodies);
  const FrameAbout<WideVector> frame = round_frame<WideBody>(bodies, planes, ball.cuts, ball.centre);
  double rounding = 0;
  for (const Placed& body : at.relative) rounding = std::max(rounding, wide_rounding_of_planes(body));
  return owned_as_given(grow<WideBody>(bodies, planes, frame, tolerance, rounding, at.reference), at);
}

}  // namespace

Search search(const Arrangement& at) {
  const std::vector<Placed>& bodies = at.relative;
  Search search;
  for (const Placed& body : bodies) search.reaches.push_back(magnitude(body));
  search.reach = *std::ranges::max_element(search.reaches);
  if (bodies.size() == 2 && (bounded(bodies[0].shape) || bounded(bodies[1].shape))) {
    if (overlap_at_centres(bodies[0], bodies[1], search)) return search;
    const Distance d = distance(bodies[0], bodies[1]);
    if (d.gap > doubt(search.reach)) return search;
    search.hints = facing_planes(bodies, d);
    const bool by_cores = cores_reach(bodies[0], bodies[1], d, search.reach);
    const bool cores_meet = cores_overlap(bodies[0], bodies[1], d, search.reach);
    if (by_cores || cores_meet || (!polyhedral(bodies) && one_holds_a_point(bodies[0], bodies[1], d, search.reach))) {
      search.status = Status::kOverlapping, search.way = Way::kDual;
      if (by_cores) search.between = point_between(bodies[0], bodies[1], d);
      if (smooth(bodies[0].shape) != smooth(bodies[1].shape)) {
        if (by_cores) search.nearest = smooth(bodies[0].shape) ? d.witness_b : d.witness_a, search.depth = -d.distance;
        else if (cores_meet) search.nearest = (d.witness_a + d.witness_b) / 2, search.depth = kInfinity;
      }
      if (!search.between)
        search.between = point_both_hold(bodies[0], bodies[1], (d.witness_a + d.witness_b) / 2, search.reach);
      return search;
    }
  }
  Inside inside{gather_planes<Placed>(bodies), {}, {}};
  inside.ball = deepest_ball(bodies, search.reaches, inside.planes, search.hints);
  if (inside.ball.sure) {
    search.status = Status::kOverlapping, search.way = Way::kDual;
  } else if (!inside.ball.apart) {
    Settled settled = settled_in_wide_arithmetic(at, search.reach, inside.ball.cuts);
    search.status = settled.status;
    search.way = settled.status == Status::kSeparated     ? Way::kWideSeparation
                 : settled.status == Status::kOverlapping ? Way::kWideDual
                                                          : Way::kDoubt;
    if (settled.ball) look_closely(inside, std::move(*settled.ball), search.reach);
  }
  if (std::ranges::none_of(bodies, [](const Placed& body) { return bounded(body.shape); }))
    settle_half_spaces(bodies, inside.ball.cuts, search);
  search.inside = std::move(inside);
  return search;
}

Inside look_inside(const Arrangement& at, const Search& found) {
  Inside inside{gather_planes<Placed>(at.relative), {}, {}};
  inside.ball = deepest_ball(at.relative, found.reaches, inside.planes, found.hints);
  if (!inside.ball.sure) look_closely(inside, wide_ball_of_overlap(at, found.reach, inside.ball.cuts), found.reach);
  return inside;
}

double touching_volume(std::span<const Placed> bodies, const DeepestBall& ball) {
  double least = kInfinity;
  const double inradius = std::max(0.0, ball.upper) + ball.rounding;
  for (const Placed& body : bodies) {
    if (!bounded(body.shape)) continue;
    least = std::min(least, inradius * surface(bounds(body)));
  }
  return least;
}

// ----------------------------------------------------------------------------------------------------------- measures

Region grown(const Arrangement& at, const Inside& inside, double reach, double tolerance) {
  if (inside.wide_ball) return grown_about(*inside.wide_ball, at, tolerance);
  const Frame frame = round_frame<Placed>(at.relative, inside.planes, inside.ball.cuts, inside.ball.centre);
  return owned_as_given(grow<Placed>(at.relative, inside.planes, frame, tolerance, rounding(reach), at.reference), at);
}

namespace {

/// The closed form's answer, if it is as accurate as a polytope's. Where its terms nearly cancel, the polytope is more
/// accurate.
std::optional<MeasuresAndInertia> by_formula(const OverlappingBodies& overlapping, double finest) {
  const Arrangement& at = overlapping.at;
  auto found = closed_form(at.relative[0], at.relative[1], rounding(overlapping.search().reach), at.reference);
  if (!found || found->measures.volume_error > finest * found->measures.volume) return std::nullopt;
  if (at.order[0] == 1) std::swap(found->measures.pulls[0], found->measures.pulls[1]);
  return found;
}

MeasuresAndInertia by_region(const Region& region, std::span<const Placed> bodies, Way way) {
  MeasuresAndInertia answer = measure(region, bodies);
  answer.measures.way = way;
  return answer;
}

/// The region about the middle of the largest ball in double-double, if there is one. The point for doubles may not be
/// inside after all, or its frame may not be round.
std::optional<Region> grown_in_wide_arithmetic(const OverlappingBodies& overlapping) {
  const double reach = overlapping.search().reach;
  const Arrangement& at = overlapping.at;
  const WideBall ball = wide_ball_of_overlap(at, reach, overlapping.inside().ball.cuts);
  if (!(ball.lower > 0)) return std::nullopt;
  return grown_about(ball, at, overlapping.tolerance);
}

/// The relative error of a volume; infinite if rounding has turned the polytope inside out.
double error_of(const Measures& m) { return m.volume > 0 && m.volume_error >= 0 ? m.volume_error : kInfinity; }

/// The error of a volume is not larger than the volume of what may be common to the bodies, however flat the polytope.
/// If rounding has turned the polytope inside out, the volume is between 0 and that bound.
void bound_by_ball(const OverlappingBodies& overlapping, Measures& m) {
  const double most = touching_volume(overlapping.bodies, overlapping.inside().ball);
  if (!(m.volume > 0)) m.volume = m.volume_error = most / 2;
  else if (!(m.volume_error <= std::max(m.volume, most))) m.volume_error = std::max(m.volume, most);
}

WideVector point_inside(const OverlappingBodies& overlapping) {
  if (overlapping.search().between) return wide(*overlapping.search().between);
  const Inside& found = overlapping.inside();
  return found.wide_ball ? found.wide_ball->centre : wide(found.ball.centre);
}

}  // namespace

namespace {

/// The measures by slices, without pulls.
MeasuresAndInertia by_slices(const pieces::RoundMeasures& round, Vec3 reference) {
  MeasuresAndInertia answer;
  Measures& m = answer.measures;
  m.status = Status::kOverlapping;
  m.way = Way::kSlicing;
  m.facets_touched = round.facets_touched;
  m.volume = round.volume, m.volume_error = round.volume_error, m.area = round.area;
  m.area_error = round.area_error, m.area_known = round.area_known, m.rounding = round.rounding;
  m.centroid = reference + round.centroid;
  answer.inertia = round.inertia, answer.inertia_error = round.inertia_error;
  return answer;
}

pieces::SlicedGroup sliced_group(const OverlappingBodies& overlapping) {
  return {overlapping.at.relative, overlapping.at.reference, point_inside(overlapping)};
}

/// The pull of the last body is opposite to the sum of all others, because area vectors of a closed surface add up to
/// zero.
std::optional<MeasuresAndInertia> sliced_as_group(const OverlappingBodies& overlapping) {
  const Arrangement& at = overlapping.at;
  const pieces::SlicedGroup group = sliced_group(overlapping);
  const int bodies = static_cast<int>(at.order.size());
  std::vector<int> all_but_last(bodies - 1);
  std::iota(all_but_last.begin(), all_but_last.end(), 0);
  const auto found = pieces::measure_group(group, all_but_last);
  if (!found) return std::nullopt;
  MeasuresAndInertia answer = by_slices(found->front(), at.reference);
  std::vector<Pull> pulls(bodies);
  for (int i = 0; i + 1 < bodies; ++i) {
    pulls[i] = (*found)[i].pull;
    pulls.back() += {-pulls[i].force, -pulls[i].moment};
  }
  answer.measures.pulls_of_group.resize(bodies);
  for (int i = 0; i < bodies; ++i)
    answer.measures.pulls_of_group[at.order[i]] =
        about(pulls[i], at.reference, overlapping.bodies[at.order[i]].position);
  return answer;
}

Spread spread_between(const pieces::RoundMeasures& large, const pieces::RoundMeasures& small, double area_error) {
  const double of_rules = large.area_error + area_error + small.area_error;
  const double first = std::abs(large.first_area - small.first_area);
  const double second = std::abs((large.area - large.first_area) - (small.area - small.first_area));
  return {std::max(0.0, large.volume - small.volume), std::max(0.0, large.area - small.area) + of_rules,
          std::max(first, second) + of_rules};
}

/// All bodies move for volume and area. For the owned area, one body moves at a time.
std::optional<Spread> spread_of_group(const OverlappingBodies& overlapping, double moved, double area_error) {
  const pieces::SlicedGroup group = sliced_group(overlapping);
  const auto between = [&](int first, int only) -> std::optional<Spread> {
    const auto large = pieces::measure_group(group, std::span(&first, 1), {moved, only});
    const auto small = pieces::measure_group(group, std::span(&first, 1), {-moved, only});
    if (!large || !small) return std::nullopt;
    return spread_between(large->front(), small->front(), area_error);
  };
  std::optional<Spread> all = between(0, -1);
  for (int i = 0; all && i < static_cast<int>(group.bodies.size()); ++i) {
    const auto alone = between(i, i);
    if (!alone) return std::nullopt;
    all->owned = std::max(all->owned, alone->owned);
  }
  return all;
}

}  // namespace

std::optional<MeasuresAndInertia> sliced(const OverlappingBodies& overlapping, bool with_area) {
  if (!choose(traits(overlapping.bodies)).tries(Way::kSlicing)) return std::nullopt;
  const Arrangement& at = overlapping.at;
  if (at.order.size() > 2) return sliced_as_group(overlapping);
  const WideVector inside = point_inside(overlapping);
  const auto round = measure_by_slices({at.relative[0], at.relative[1], at.reference, inside, 0, with_area});
  if (!round) return std::nullopt;
  MeasuresAndInertia answer = by_slices(*round, at.reference);
  for (int i = 0; i < 2; ++i) {
    const double side = i == 0 ? 1 : -1;
    const int body = at.order[i];
    answer.measures.pulls[body] =
        about({side * round->pull.force, side * round->pull.moment}, at.reference, overlapping.bodies[body].position);
  }
  return answer;
}

std::optional<Spread> spread(const OverlappingBodies& overlapping, const Measures& sliced, const Measures& stated) {
  const Arrangement& at = overlapping.at;
  const double moved = sliced.rounding + std::max(sliced.volume_error, stated.volume_error) / sliced.area;
  if (at.order.size() > 2) return spread_of_group(overlapping, moved, sliced.area_error);
  const WideVector inside = point_inside(overlapping);
  const auto with_moved = [&](double outwards) {
    return measure_by_slices({at.relative[0], at.relative[1], at.reference, inside, outwards});
  };
  const auto large = with_moved(moved), small = with_moved(-moved);
  if (!large || !small) return std::nullopt;
  return spread_between(*large, *small, sliced.area_error);
}

std::optional<Patch> sliced_patch(const OverlappingBodies& overlapping, Vec3 centroid, Vec3 area) {
  const Arrangement& at = overlapping.at;
  const WideVector inside = point_inside(overlapping);
  const bool swapped = at.order[0] == 1;
  PatchSums sums(centroid - at.reference - rounded(inside), area);
  if (!measure_by_slices({at.relative[0], at.relative[1], at.reference, inside, 0, false, swapped ? 0 : 1, &sums}))
    return std::nullopt;
  Patch patch = sums.patch();
  patch.centre += rounded(inside) + at.reference;
  return patch;
}

std::optional<VolumeAlone> volume_alone(const OverlappingBodies& overlapping) {
  if (!choose(traits(overlapping.bodies)).tries(Way::kClosedForm) || overlapping.bodies.size() != 2)
    return std::nullopt;
  const Placed &a = overlapping.at.relative[0], &b = overlapping.at.relative[1];
  const Search& search = overlapping.search();
  std::optional<Vec3> nearest = search.nearest;
  double depth = search.depth;
  // If the search ended at the centres, the point is searched for now, unless a deep point is known.
  const bool flat_and_round = smooth(a.shape) != smooth(b.shape) && core_radius(a.shape) + core_radius(b.shape) > 0;
  if (!nearest && search.between && flat_and_round) {
    const double inside = std::min(distance_inside(a, *search.between).value_or(kInfinity),
                                   distance_inside(b, *search.between).value_or(kInfinity));
    constexpr double kDeep = 0x1p-43;
    if (rounding(search.reach) < kDeep * inside) return std::nullopt;
    const Distance d = distance(a, b);
    if (cores_reach(a, b, d, search.reach)) nearest = smooth(a.shape) ? d.witness_b : d.witness_a, depth = -d.distance;
  }
  return volume_by_surface(a, b, search.between, nearest, depth);
}

namespace {

MeasuresAndInertia all_measures(const OverlappingBodies& overlapping) {
  const Arrangement& at = overlapping.at;
  const auto in_wide_arithmetic = [&] { return !overlapping.traced && overlapping.inside().wide_ball; };
  const bool in_doubt = !overlapping.traced && overlapping.search().inside && in_wide_arithmetic();
  const Choice& choice = choose(traits(overlapping.bodies));
  const double finest = std::max(overlapping.tolerance, kFinest);
  MeasuresAndInertia kept;
  const auto error = [&](const auto& found) { return error_of(found->measures) / found->measures.volume; };
  auto formula = choice.tries(Way::kClosedForm) && !in_doubt ? by_formula(overlapping, finest) : std::nullopt;
  if (choice.tries(Way::kSlicing) && !(formula && error(formula) <= kEnoughOfRound)) {
    const auto& sliced = overlapping.sliced();
    if (sliced && error(sliced) <= kEnoughOfRound) return *sliced;
    if (in_doubt && choice.tries(Way::kClosedForm)) formula = by_formula(overlapping, finest);
    // If slices give up, features lie so near each other that a closed form may confuse them, too.
    if (formula && !(error(formula) <= kSureOfFormula)) formula.reset();
    if (sliced && !(formula && error(formula) < error(sliced))) return *sliced;
  }
  if (formula) return *std::move(formula);
  if (in_doubt) {
    kept = by_region(overlapping.region(), overlapping.bodies, Way::kWideDual);
    bound_by_ball(overlapping, kept.measures);
    return kept;
  }
  kept = by_region(overlapping.region(), overlapping.bodies, overlapping.traced ? Way::kTracing : Way::kDual);
  const auto keep_better = [&](const Region& region) {
    MeasuresAndInertia again = by_region(region, overlapping.bodies, Way::kWideDual);
    if (!widened(kept.measures.way) || error_of(again.measures) < error_of(kept.measures)) kept = std::move(again);
  };
  const auto enough = [&] { return error_of(kept.measures) <= kEnough * kept.measures.volume; };
  const bool exact = polyhedral(overlapping.bodies);
  if (exact && !enough())
    if (auto wide = widened(at.relative, overlapping.region())) keep_better(owned_as_given(std::move(*wide), at));
  const auto reach = [&] { return overlapping.search().reach; };
  if (!enough() && (exact || rounding(reach()) * kept.measures.area > finest * kept.measures.volume)) {
    if (const auto wide = grown_in_wide_arithmetic(overlapping)) keep_better(*wide);
    else if (exact)
      kept.measures.volume_error +=
          kept.measures.volume + touching_volume(overlapping.bodies, overlapping.inside().ball);
  }
  if (!(error_of(kept.measures) <= kept.measures.volume) && in_wide_arithmetic())
    bound_by_ball(overlapping, kept.measures);
  return kept;
}

}  // namespace

MeasuresAndInertia measure_in_full(const OverlappingBodies& overlapping) {
  MeasuresAndInertia found = all_measures(overlapping);
  if (const auto& alone = overlapping.volume_alone()) {
    found.measures.volume = alone->volume, found.measures.volume_error = alone->error;
    found.measures.way = Way::kClosedForm;
  }
  return found;
}

Region finest_region(const OverlappingBodies& overlapping) {
  if (!polyhedral(overlapping.bodies)) return overlapping.region();
  if (auto wide = widened(overlapping.at.relative, overlapping.region()))
    return owned_as_given(std::move(*wide), overlapping.at);
  if (auto wide = grown_in_wide_arithmetic(overlapping)) return std::move(*wide);
  return overlapping.region();
}

}  // namespace overlapper
