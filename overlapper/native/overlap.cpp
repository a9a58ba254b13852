#include "overlap.h"

#include <algorithm>
#include <cassert>
#include <limits>
#include <stdexcept>

#include "canonical_order.h"
#include "expanding_hull.h"
#include "minkowski.h"
#include "paper.h"
#include "predicates.h"
#include "wide_ball.h"
#include "wide_gap.h"

namespace overlapper {
namespace {

/// How far the numbers that describe a body reach, from the reference and from its own coordinates.
double magnitude(const Placed& relative) {
  if (const HalfSpace* half = std::get_if<HalfSpace>(&relative.shape))
    return norm(relative.pose.translation) + std::abs(half->plane.offset);
  const Bounds box = bounds(relative);
  double reach = norm(max(abs(box.lower), abs(box.upper)));
  // A hull whose points were counted from far away has had that distance rotated and added.
  if (const Hull* hull = std::get_if<Hull>(&relative.shape)) {
    const Vec3 origin = hull->data->origin;
    const bool turned = relative.orientation.w != 1;
    if (norm2(origin) > 0 && (turned || norm2(relative.position) > 0)) reach += norm(origin) + norm(relative.position);
  }
  return reach;
}

/// The relative error of a volume beyond which it is worth computing again in wider arithmetic.
constexpr double kEnough = 1e-12;

bool smooth_body(const Placed& body) { return smooth(body.shape); }

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

std::vector<OwnedPlane> gather_planes(std::span<const Placed> bodies) {
  std::vector<OwnedPlane> planes;
  std::vector<Plane> local;
  for (int i = 0; i < static_cast<int>(bodies.size()); ++i) {
    local.clear();
    append_planes(bodies[i].shape, local);
    for (const Plane& plane : local) planes.push_back({bodies[i].pose * plane, i});
  }
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

Overlap::Overlap(std::vector<Placed> bodies, double tolerance, Method method)
    : bodies_(std::move(bodies)), tolerance_(tolerance), method_(method) {
  if (bodies_.size() < 2) throw std::invalid_argument("shapes must be two or more");
  if (!(tolerance > 0 && tolerance < 1))
    throw std::invalid_argument("tolerance must be greater than 0 and less than 1");
  order_ = canonical_order(bodies_);
  reference_ = bodies_[order_[0]].pose.translation;
  for (int body : order_) relative_.push_back(bodies_[body].seen_from(reference_));
  if (method == Method::kPaper) {
    PaperResult result = intersect_as_in_paper(relative_, tolerance);
    status_ = result.status;
    if (result.region) {
      lazy_->region = owned_as_given(std::move(*result.region));
      lazy_->region->reference = reference_;
    }
    return;
  }

  for (const Placed& body : relative_) reach_.push_back(magnitude(body));
  std::vector<OwnedPlane> hints;
  if (pair() && (bounded(relative_[0].shape) || bounded(relative_[1].shape))) {
    const Distance d = overlapper::distance(relative_[0], relative_[1]);
    if (d.gap > rounding(std::max(reach_[0], reach_[1]))) return;
    hints = facing_planes(relative_, d);
  }
  std::vector<OwnedPlane> planes = gather_planes(relative_);
  ball_ = deepest_ball(relative_, reach_, planes, hints);
  if (ball_.lower > ball_.rounding) {
    status_ = Status::kOverlapping;
    lazy_->planes = std::move(planes);
  } else if (!ball_.apart) {
    status_ = Status::kTouching;
    settle_in_wide_arithmetic();
    if (status_ == Status::kOverlapping) lazy_->planes = std::move(planes);
  }
  if (status_ != Status::kSeparated && !bounds_space(bodies_))
    throw std::invalid_argument("shapes must have a bounded common set: half-spaces alone leave it open");
}

/// Where doubles see neither a gap nor a common ball, of slender bodies and of bodies of very different size there may
/// still be either.
void Overlap::settle_in_wide_arithmetic() {
  const double reach = *std::max_element(reach_.begin(), reach_.end());
  double least_size = std::numeric_limits<double>::infinity();
  std::vector<WideBody> bodies;
  for (const Placed& body : relative_) {
    bodies.emplace_back(body, wide(reference_));
    if (!bounded(body.shape)) continue;
    const Bounds box = bounds(body);
    least_size = std::min(least_size, norm(box.upper - box.lower));
  }
  if (!std::isfinite(least_size)) return;
  // Nearer or thinner than the rounding of their coordinates, bodies touch, but not by 1e-12 of the smaller one's size.
  const double margin = std::min(rounding(reach), 0x1p-41 * least_size), noise = 0x1p-96 * reach;
  WideVector apart;
  if (pair()) {
    const WideGap gap = wide_gap(bodies[0], bodies[1], noise);
    if (gap.certified > margin) {
      status_ = Status::kSeparated;
      return;
    }
    apart = wide(gap.normal);
  }
  const WideBall found = wide_deepest_ball(bodies, apart, margin, reach, noise);
  if (found.upper < -margin) status_ = Status::kSeparated;
  // What is thinner cannot be put into a frame in doubles about this reference.
  const double thick = 64 * rounding(reach);
  if (found.lower <= thick) return;
  status_ = Status::kOverlapping;
  ball_.centre = rounded(found.centre);
  ball_.lower = found.lower;
  ball_.upper = found.upper;
  ball_.rounding = rounding(reach);
}

double Overlap::volume() const { return status_ == Status::kOverlapping ? quantities().volume : 0; }

double Overlap::volume_error() const {
  if (method_ == Method::kAuto) {
    if (status_ == Status::kSeparated) return 0;
    return status_ == Status::kTouching ? touching_volume() : quantities().volume_error;
  }
  const double claimed = volume();
  const std::scoped_lock lock(lazy_->mutex);
  if (!lazy_->error_of_paper) {
    const Overlap judge(bodies_, tolerance_, Method::kAuto);
    lazy_->error_of_paper = std::abs(claimed - judge.volume()) + judge.volume_error();
  }
  return *lazy_->error_of_paper;
}

/// The inradius is rounding, and a convex set's volume is at most its inradius times its surface, which is no larger
/// than that of a box around any of the bodies.
double Overlap::touching_volume() const {
  double least = std::numeric_limits<double>::infinity();
  const double inradius = std::max(0.0, ball_.upper) + ball_.rounding;
  for (const Placed& body : bodies_) {
    if (!bounded(body.shape)) continue;
    const Bounds box = bounds(body);
    const Vec3 side = box.upper - box.lower;
    least = std::min(least, 2 * inradius * (side.x * side.y + side.y * side.z + side.z * side.x));
  }
  return least;
}

Region Overlap::owned_as_given(Region region) const {
  for (Region::Facet& facet : region.facets) facet.owner = order_[facet.owner];
  return region;
}

const Region& Overlap::region() const {
  assert(status_ == Status::kOverlapping);
  const std::scoped_lock lock(lazy_->mutex);
  if (!lazy_->region) {
    lazy_->region = owned_as_given(grow(relative_, lazy_->planes, ball_, tolerance_,
                                        rounding(*std::max_element(reach_.begin(), reach_.end())), reference_));
    lazy_->planes.clear();
  }
  return *lazy_->region;
}

const Quantities& Overlap::quantities() const {
  const Region& r = region();
  const std::scoped_lock lock(lazy_->mutex);
  if (!lazy_->quantities) {
    lazy_->quantities = measure(r);
    const bool enough = lazy_->quantities->volume_error <= kEnough * lazy_->quantities->volume;
    if (!enough && method_ == Method::kAuto && std::none_of(bodies_.begin(), bodies_.end(), smooth_body)) {
      if (auto wide = widened(relative_, r)) {
        lazy_->quantities = measure(owned_as_given(std::move(*wide)));
        lazy_->quantities->widened = true;
      } else {
        // The point about which the region was grown is not inside after all: all that is sure is how much could be.
        lazy_->quantities->volume_error += lazy_->quantities->volume + touching_volume();
      }
    }
  }
  return *lazy_->quantities;
}

const Surface& Overlap::surface() const {
  const Region& r = region();
  const std::scoped_lock lock(lazy_->mutex);
  if (!lazy_->surface) lazy_->surface = surface_of(r, static_cast<int>(bodies_.size()));
  return *lazy_->surface;
}

std::vector<std::array<double, 6>> Overlap::gradient() const {
  std::vector<std::array<double, 6>> rows(bodies_.size());
  if (status_ != Status::kOverlapping) return rows;
  for (const Quantities::Pull& pull : quantities().pulls) {
    const Vec3 force = pull.area_vector;
    const Vec3 moment = cross(pull.centroid - bodies_[pull.owner].position, force);
    std::array<double, 6>& row = rows[pull.owner];
    for (int i = 0; i < 3; ++i) row[i] += force[i], row[3 + i] += moment[i];
  }
  return rows;
}

const Overlap::Contact& Overlap::contact() const {
  assert(pair());
  const std::scoped_lock lock(lazy_->mutex);
  if (lazy_->contact) return *lazy_->contact;
  Contact contact;
  const Placed &a = relative_[0], &b = relative_[1];
  if (status_ == Status::kOverlapping) {
    const Penetration p = penetration(a, b);
    contact.depth = std::max(0.0, p.depth);
    contact.normal = p.normal;
  } else {
    const Distance d = overlapper::distance(a, b);
    contact.normal = d.normal;
    // Where the bodies touch, the line between the witness points may be all rounding; the way out is not.
    if (norm2(d.normal) == 0 || d.gap < 0) contact.normal = penetration(a, b).normal;
    contact.distance = status_ == Status::kSeparated ? std::max(0.0, d.distance) : 0;
    contact.witness_a = d.witness_a + reference_;
    contact.witness_b = d.witness_b + reference_;
    // Half-way between the supports; a half-space reaches to its witness point.
    const double level_a = dot(contact.normal, bounded(a.shape) ? a.support(-contact.normal) : d.witness_a);
    const double level_b = dot(contact.normal, bounded(b.shape) ? b.support(contact.normal) : d.witness_b);
    const double level = level_a / 2 + level_b / 2;
    contact.separating = {contact.normal, level + dot(contact.normal, reference_)};
  }
  if (order_[0] == 1) {
    contact.normal = Vec3{} - contact.normal;  // and not -normal, which would make negative zeros
    contact.separating = {contact.normal, -contact.separating.offset};
    std::swap(contact.witness_a, contact.witness_b);
  }
  lazy_->contact = contact;
  return *lazy_->contact;
}

}  // namespace overlapper
