#include "overlap/overlap.h"

#include <algorithm>
#include <cassert>
#include <limits>
#include <stdexcept>

#include "distance/penetration.h"
#include "distance/wide_gap.h"
#include "geometry/expanding_hull.h"
#include "geometry/predicates.h"
#include "geometry/rounding.h"
#include "methods/closed_forms.h"
#include "methods/paper.h"
#include "shapes/canonical_order.h"
#include "shapes/planes_asked.h"
#include "shapes/solid.h"

namespace overlapper {
namespace {

/// How far the numbers that describe a body reach, from the reference and from its own coordinates.
double magnitude(const Placed& relative) {
  if (const HalfSpace* half = std::get_if<HalfSpace>(&relative.shape))
    return norm(relative.pose.translation) + std::abs(half->plane.offset);
  const Bounds box = bounds(relative);
  double reach = norm(max(abs(box.lower), abs(box.upper)));
  reach += lost_far_away(relative);
  return reach + flatness(relative.shape) / rounding(1);
}

/// Of its volume, what as many planes as a region may have leave of a round body at best.
constexpr double kFinest = 1e-7;

bool smooth_body(const Placed& body) { return smooth(body.shape); }
bool rounded_hull(const Placed& body) { return std::holds_alternative<RoundedHull>(body.shape); }

/// True if one of the bodies is bounded, or the half-spaces close up: the origin is strictly inside the hull of their
/// normals.
bool bounds_space(std::span<const Placed> bodies) {
  ExpandingHull normals;
  for (const Placed& body : bodies) {
    const HalfSpace* half = std::get_if<HalfSpace>(&body.shape);
    if (!half) return true;
    normals.points.push_back(body.pose.rotation * half->plane.normal);
  }
  if (!normals.build()) return false;
  for (const ExpandingHull::Facet& facet : normals.facets) {
    if (facet.removed()) continue;
    const auto [a, b, c] = facet.vertex;
    if (orientation(normals.points[a], normals.points[b], normals.points[c], {}) >= 0) return false;
  }
  return true;
}

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

}  // namespace

// --------------------------------------------------------------------------------------------------------------- Overlap

Overlap::Overlap(std::vector<Placed> bodies, double tolerance, Method method) : tolerance_(tolerance), method_(method) {
  if (bodies.size() < 2) throw std::invalid_argument("shapes must be two or more");
  if (bodies.size() == 2) two_ = {std::move(bodies[0]), std::move(bodies[1])};
  else bodies_ = std::move(bodies);
  start();
}

Overlap::Overlap(const Placed& a, const Placed& b, double tolerance, Method method)
    : two_{a, b}, tolerance_(tolerance), method_(method) {
  start();
}

Overlap::Overlap(const Placed& a, const Placed& b, double tolerance, const std::optional<ClippedPair>& clipped)
    : two_{a, b}, tolerance_(tolerance), method_(Method::kAuto), clipped_(clipped) {
  settle();
}

void Overlap::start() {
  if (!(tolerance_ > 0 && tolerance_ < 1))
    throw std::invalid_argument("tolerance must be greater than 0 and less than 1");
  if (method_ == Method::kPaper) {
    PaperResult result = intersect_as_in_paper(arrangement().relative, tolerance_);
    status_ = result.status;
    if (result.region) {
      Region region = owned_as_given(std::move(*result.region));
      region.reference = arrangement().reference;
      lazy().region.get([&] { return std::move(region); });
    }
    return;
  }
  if (pair()) {
    clipped_ = clip(two_[0], two_[1]);
  } else if (auto group = clip(bodies_)) {
    clipped_ = ClippedPair{*group, {}, {}};
    pulls_ = std::move(group->pulls);
  }
  settle();
}

/// What clipping has left open.
void Overlap::settle() {
  // What is too thin for clipping to measure may be too thin to be more than touching.
  if (clipped_ && clipped_->status == Status::kOverlapping && !clipped_->measured && !clipped_->traced)
    clipped_.reset();
  status_ = clipped_ ? clipped_->status : search().status;
  measured_by_clipping_ = clipped_ && clipped_->measured;
}

Overlap::Overlap(Overlap&& other) noexcept
    : two_(std::move(other.two_)),
      bodies_(std::move(other.bodies_)),
      tolerance_(other.tolerance_),
      method_(other.method_),
      status_(other.status_),
      clipped_(other.clipped_),
      pulls_(std::move(other.pulls_)),
      measured_by_clipping_(other.measured_by_clipping_),
      lazy_(std::move(other.lazy_)) {}

const Overlap::Lazy& Overlap::lazy() const {
  return lazy_.get([] { return Lazy{}; });
}

const Overlap::Arrangement& Overlap::arrangement() const {
  return lazy().arrangement.get([this] { return arranged(); });
}

const Overlap::Search& Overlap::search() const {
  return lazy().search.get([this] { return searched(); });
}

const Region& Overlap::region() const {
  return lazy().region.get([this] { return grown(); });
}

const Quantities& Overlap::quantities() const {
  return lazy().quantities.get([this] { return measured(); });
}

const Surface& Overlap::surface() const {
  return lazy().surface.get([this] { return surface_of(region(), static_cast<int>(bodies().size())); });
}

const Overlap::Contact& Overlap::contact() const {
  return lazy().contact.get([this] { return in_contact(); });
}

Overlap::Arrangement Overlap::arranged() const {
  Arrangement arrangement{canonical_order(bodies()), {}, {}};
  arrangement.reference = bodies()[arrangement.order[0]].pose.translation;
  arrangement.relative.reserve(bodies().size());
  for (int body : arrangement.order) arrangement.relative.push_back(bodies()[body].seen_from(arrangement.reference));
  return arrangement;
}

Overlap::Search Overlap::searched() const {
  const std::vector<Placed>& relative = arrangement().relative;
  Search search{};
  for (const Placed& body : relative) search.reach.push_back(magnitude(body));
  std::vector<OwnedPlane> hints;
  if (pair() && (bounded(relative[0].shape) || bounded(relative[1].shape))) {
    const Distance d = overlapper::distance(relative[0], relative[1]);
    if (d.gap > doubt(std::max(search.reach[0], search.reach[1]))) return search;
    hints = facing_planes(relative, d);
  }
  search.planes = gather_planes<Placed>(relative);
  search.ball = deepest_ball(relative, search.reach, search.planes, hints);
  if (search.ball.sure) {
    search.status = Status::kOverlapping;
  } else if (!search.ball.apart) {
    search.status = Status::kTouching;
    settle_in_wide_arithmetic(search);
  }
  if (search.status != Status::kSeparated && !bounds_space(bodies()))
    throw std::invalid_argument("shapes must have a bounded common set: half-spaces alone leave it open");
  return search;
}

/// How large the numbers are that describe the bodies.
double Overlap::largest_reach() const {
  const std::vector<double>& reach = search().reach;
  return *std::max_element(reach.begin(), reach.end());
}

std::vector<WideBody> Overlap::wide_bodies() const {
  std::vector<WideBody> bodies;
  for (const Placed& body : arrangement().relative) bodies.emplace_back(body, wide(arrangement().reference));
  return bodies;
}

/// How far rounding in double-double may move a plane of bodies that reach so far.
double wide_noise(double reach) { return 0x1p-96 * reach; }

/// Where doubles are not sure of a gap or of a common ball. The sizes that count are the same for a mirror image, for
/// other axes and for another order.
void Overlap::settle_in_wide_arithmetic(Search& search) const {
  const std::vector<Placed>& relative = arrangement().relative;
  // Their oracle knows the nearest point of a polytope in doubles only.
  if (std::any_of(relative.begin(), relative.end(), rounded_hull)) return;
  const double reach = *std::max_element(search.reach.begin(), search.reach.end()), noise = wide_noise(reach);
  double least_size = std::numeric_limits<double>::infinity(), largest_size = 0;
  for (const Placed& body : relative) {
    if (!bounded(body.shape)) continue;
    const Bounds box = bounds(body);
    const double size = norm(box.upper - box.lower);
    least_size = std::min(least_size, size);
    largest_size = std::max(largest_size, size);
  }
  if (!std::isfinite(least_size)) return;
  const std::vector<WideBody> bodies = wide_bodies();
  // Nearer or thinner than the rounding of their coordinates, bodies touch, but not by 1e-12 of the smaller one's size.
  const double margin = std::max(4 * noise, std::min(rounding(largest_size / 2), 0x1p-41 * least_size));
  std::vector<OwnedPlane> hints = search.ball.cuts;
  if (pair()) {
    const WideGap gap = wide_gap(bodies[0], bodies[1], noise);
    if (gap.certified > margin) {
      search.status = Status::kSeparated;
      return;
    }
    if (norm2(gap.normal) > 0) hints.insert(hints.end(), {{{-gap.normal, 0}, 0}, {{gap.normal, 0}, 1}});
  }
  search.wide_ball = wide_deepest_ball(bodies, hints, margin, reach, noise);
  if (search.wide_ball->upper < -margin) search.status = Status::kSeparated;
  if (search.wide_ball->lower > margin) search.status = Status::kOverlapping;
  search.ball.upper = search.wide_ball->upper;
  search.ball.rounding = noise;
}

double Overlap::volume() const {
  if (status_ != Status::kOverlapping) return 0;
  return measured_by_clipping_ ? clipped_->volume : quantities().volume;
}

double Overlap::volume_error() const {
  if (method_ == Method::kAuto) {
    if (status_ == Status::kSeparated) return 0;
    if (measured_by_clipping_) return clipped_->volume_error;
    if (status_ == Status::kOverlapping) return quantities().volume_error;
    return touching_volume(search().ball);
  }
  return lazy().error_of_paper.get([this] {
    const Overlap judge({bodies().begin(), bodies().end()}, tolerance_, Method::kAuto);
    return std::abs(volume() - judge.volume()) + judge.volume_error();
  });
}

double Overlap::area() const {
  if (status_ != Status::kOverlapping) return 0;
  return measured_by_clipping_ ? clipped_->area : quantities().area;
}

Vec3 Overlap::centroid() const { return measured_by_clipping_ ? clipped_->centroid : quantities().centroid; }

bool Overlap::widened() const {
  if (measured_by_clipping_) return clipped_->widened;
  return status_ == Status::kOverlapping && quantities().widened;
}

int Overlap::facets_touched() const {
  if (status_ != Status::kOverlapping) return 0;
  return clipped_ ? clipped_->facets_touched : quantities().facets_touched;
}

/// The inradius is rounding, and a convex set's volume is at most its inradius times its surface, which is no larger
/// than that of a box around any of the bodies.
double Overlap::touching_volume(const DeepestBall& ball) const {
  double least = std::numeric_limits<double>::infinity();
  const double inradius = std::max(0.0, ball.upper) + ball.rounding;
  for (const Placed& body : bodies()) {
    if (!bounded(body.shape)) continue;
    const Bounds box = bounds(body);
    const Vec3 side = box.upper - box.lower;
    least = std::min(least, 2 * inradius * (side.x * side.y + side.y * side.z + side.z * side.x));
  }
  return least;
}

Region Overlap::owned_as_given(Region region) const {
  for (Region::Facet& facet : region.facets) facet.owner = arrangement().order[facet.owner];
  return region;
}

Region Overlap::grown() const {
  assert(status_ == Status::kOverlapping);
  if (traced()) {
    const Arrangement& at = arrangement();
    if (auto region = region_of_clipped(bodies()[at.order[0]], bodies()[at.order[1]], at.reference))
      return owned_as_given(std::move(*region));
  }
  const Search& found = search();
  const double reach = largest_reach();
  if (found.wide_ball) return grown_about(*found.wide_ball, reach);
  const Arrangement& about = arrangement();
  const Frame frame = round_frame<Placed>(about.relative, found.planes, found.ball.cuts, found.ball.centre);
  return owned_as_given(
      grow<Placed>(about.relative, found.planes, frame, tolerance_, rounding(reach), about.reference));
}

Region Overlap::grown_about(const WideBall& ball, double reach) const {
  const std::vector<WideBody> bodies = wide_bodies();
  const std::vector<Owned<WidePlane>> planes = gather_planes<WideBody>(bodies);
  const FrameAbout<WideVector> frame = round_frame<WideBody>(bodies, planes, ball.cuts, ball.centre);
  return owned_as_given(grow<WideBody>(bodies, planes, frame, tolerance_, wide_noise(reach), arrangement().reference));
}

Quantities Overlap::measured() const {
  if (method_ == Method::kPaper) return measure(region());
  const Arrangement& at = arrangement();
  const double finest = std::max(tolerance_, kFinest);
  std::optional<Quantities> kept;
  if (!traced()) {
    if (search().wide_ball) {
      Quantities in_wide_arithmetic = measure(region());
      in_wide_arithmetic.widened = true;
      return in_wide_arithmetic;
    }
    if (pair()) {
      kept = closed_form(at.relative[0], at.relative[1], rounding(largest_reach()), at.reference);
      // Where its terms nearly cancel, a polytope knows more.
      if (kept && kept->volume_error > finest * kept->volume) kept.reset();
      if (kept)
        for (Quantities::Pull& pull : kept->pulls) pull.owner = at.order[pull.owner];
    }
  }
  if (!kept) kept = measure(region());
  const auto keep_better = [&](const Region& region) {
    Quantities again = measure(region);
    again.widened = true;
    if (!kept->widened || again.volume_error < kept->volume_error) kept = std::move(again);
  };
  const bool polyhedral = std::ranges::none_of(bodies(), smooth_body);
  const auto enough = [&] { return kept->volume_error <= kEnough * kept->volume; };
  if (polyhedral && !enough())
    if (auto wide = overlapper::widened(at.relative, region())) keep_better(owned_as_given(std::move(*wide)));
  if (polyhedral ? !enough() : rounding(largest_reach()) * kept->area > finest * kept->volume) {
    // The point about which the region was grown may not be inside after all, or its frame not be round.
    const double noise = wide_noise(largest_reach());
    const WideBall ball = wide_deepest_ball(wide_bodies(), search().ball.cuts, 4 * noise, largest_reach(), noise);
    if (ball.lower > 0) keep_better(grown_about(ball, largest_reach()));
    else if (polyhedral) kept->volume_error += kept->volume + touching_volume(search().ball);
  }
  return *kept;
}

Mat3 Overlap::inertia() const {
  const Quantities& q = quantities();
  if (!q.closed_form) return q.inertia;
  const Quantities of_polytope = measure(region());
  const double share = q.volume / of_polytope.volume;
  const Mat3& i = of_polytope.inertia;
  return {share * i.row0, share * i.row1, share * i.row2};
}

namespace {

void add_pull(std::array<double, 6>& row, Vec3 force, Vec3 moment) {
  for (int i = 0; i < 3; ++i) row[i] += force[i], row[3 + i] += moment[i];
}

void add_pull_at(Vec3 centroid, std::array<double, 6>& row, Vec3 force, Vec3 moment, Vec3 position) {
  add_pull(row, force, moment + cross(centroid - position, force));
}

}  // namespace

std::array<std::array<double, 6>, 2> gradient_of_clipped(const ClippedPair& clipped, Vec3 position_a, Vec3 position_b) {
  std::array<std::array<double, 6>, 2> rows{};
  add_pull_at(clipped.centroid, rows[0], clipped.pull, clipped.moment, position_a);
  add_pull_at(clipped.centroid, rows[1], -clipped.pull, -clipped.moment, position_b);
  return rows;
}

std::vector<std::array<double, 6>> Overlap::gradient() const {
  std::vector<std::array<double, 6>> rows(bodies().size());
  if (status_ != Status::kOverlapping) return rows;
  if (measured_by_clipping_ && pair()) {
    std::ranges::copy(gradient_of_clipped(*clipped_, two_[0].position, two_[1].position), rows.begin());
  } else if (measured_by_clipping_) {
    for (size_t i = 0; i < rows.size(); ++i)
      add_pull_at(clipped_->centroid, rows[i], pulls_[i].force, pulls_[i].moment, bodies_[i].position);
  } else {
    for (const auto& [owner, area_vector, centroid] : quantities().pulls)
      add_pull(rows[owner], area_vector, cross(centroid - bodies()[owner].position, area_vector));
  }
  return rows;
}

Distance Overlap::wide_distance(double reach) const {
  const std::vector<WideBody> bodies = wide_bodies();
  const WideGap gap = wide_gap(bodies[0], bodies[1], wide_noise(reach));
  return {gap.distance, gap.certified, gap.normal, rounded(gap.witness_a), rounded(gap.witness_b)};
}

/// The shortest way out along one of the normals or of those of the planes between which the deepest ball lies.
Penetration Overlap::parting(std::vector<Vec3> normals) const {
  const std::vector<WideBody> bodies = wide_bodies();
  if (!clipped_ && method_ == Method::kAuto && search().wide_ball)
    for (const auto& [plane, owner] : search().wide_ball->cuts)
      if (owner >= 0) normals.push_back(owner == 0 ? -rounded(plane.normal) : rounded(plane.normal));
  Penetration least{std::numeric_limits<double>::infinity(), {}};
  for (Vec3 normal : normals) {
    const double depth = wide_depth(bodies[0], bodies[1], wide(normal));
    if (depth < least.depth) least = {depth, normal};
  }
  return least;
}

Penetration penetration_of_clipped(const Placed& a, const Placed& b) {
  const bool swapped = comes_before(b, a);
  const Placed &first = swapped ? b : a, &second = swapped ? a : b;
  const Vec3 reference = first.pose.translation;
  Penetration p = penetration(first.seen_from(reference), second.seen_from(reference));
  if (swapped) p.normal = Vec3{} - p.normal;  // and not -normal, which would make negative zeros
  return p;
}

Overlap::Contact Overlap::in_contact() const {
  assert(pair());
  Contact contact;
  if (measured_by_clipping_) {
    const auto [depth, normal] = penetration_of_clipped(two_[0], two_[1]);
    contact.depth = depth;
    contact.normal = normal;
    return contact;
  }
  const auto& [order, relative, reference] = arrangement();
  const Placed &a = relative[0], &b = relative[1];
  const auto reach = [&] { return std::max(magnitude(a), magnitude(b)); };
  const bool doubtful = method_ == Method::kAuto && !clipped_ && search().wide_ball;
  if (status_ == Status::kOverlapping) {
    Penetration p = penetration(a, b);
    if (doubtful || p.depth <= doubt(reach())) p = parting({p.normal});
    contact.depth = p.depth;
    contact.normal = p.normal;
  } else {
    Distance d = overlapper::distance(a, b);
    const double size = reach();
    if (!(d.gap > doubt(size)) && (bounded(a.shape) || bounded(b.shape))) d = wide_distance(size);
    contact.normal = d.normal;
    // Where the bodies touch, which method "paper" may call apart, the line between the witness points may be all
    // rounding; the way out is not.
    if ((status_ == Status::kTouching || method_ == Method::kPaper) && !(d.gap > 0))
      contact.normal = parting({penetration(a, b).normal}).normal;
    // Method "paper" may call apart what is not.
    contact.distance = status_ == Status::kSeparated ? std::max(0.0, d.distance) : 0;
    contact.witness_a = d.witness_a + reference;
    contact.witness_b = d.witness_b + reference;
    // Half-way between the supports; a half-space reaches to its witness point.
    const double level_a = dot(contact.normal, bounded(a.shape) ? a.support(-contact.normal) : d.witness_a);
    const double level_b = dot(contact.normal, bounded(b.shape) ? b.support(contact.normal) : d.witness_b);
    const double level = level_a / 2 + level_b / 2;
    contact.separating = {contact.normal, level + dot(contact.normal, reference)};
  }
  if (order[0] == 1) {
    contact.normal = Vec3{} - contact.normal;  // and not -normal, which would make negative zeros
    contact.separating = {contact.normal, -contact.separating.offset};
    std::swap(contact.witness_a, contact.witness_b);
  }
  return contact;
}

}  // namespace overlapper
