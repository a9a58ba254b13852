#include "overlap.h"

#include <cassert>
#include <cfloat>
#include <deque>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <unordered_map>

#include "minkowski.h"
#include "paper.h"
#include "predicates.h"

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

// -------------------------------------------------------------------------------------------------------------- growth

/// The dual hull of a region while it grows.
struct Growth {
  std::span<const Placed> bodies;
  Frame frame;
  ExpandingHull hull;
  std::vector<OwnedPlane> planes;  ///< parallel to hull.points
  std::vector<double> inner;       ///< per hull facet, parallel to hull.facets

  void add(const OwnedPlane& plane) {
    hull.points.push_back(dual_in_frame(frame, plane.plane));
    planes.push_back(plane);
  }

  /// The plane of the smooth bodies through which the ray from the origin to `vertex` leaves first. `reach` is the
  /// distance of the vertex over that of the exit.
  std::optional<OwnedPlane> first_exit(Vec3 vertex, double& reach) const {
    std::optional<OwnedPlane> first;
    reach = 0;
    const Vec3 direction = frame.axes * vertex;
    for (int i = 0; i < static_cast<int>(bodies.size()); ++i) {
      if (!smooth(bodies[i].shape)) continue;
      const Plane plane = bodies[i].ray_exit(frame.origin, direction);
      const double ratio = dot(dual_in_frame(frame, plane), vertex);
      if (ratio > reach) reach = ratio, first = {plane, i};
    }
    return first;
  }

  /// Tangent planes where a vertex reaches too far out of a smooth body, until none does.
  void refine(double tolerance) {
    constexpr int kMostPlanes = 1 << 20;  // what is left beyond it is in the error bound
    inner.assign(hull.facets.size(), 1);
    std::deque<int> unsettled(hull.facets.size());
    std::iota(unsettled.begin(), unsettled.end(), 0);
    while (!unsettled.empty()) {
      const int f = unsettled.front();
      unsettled.pop_front();
      if (hull.facets[f].removed()) continue;
      const auto [a, b, c] = hull.facets[f].vertex;
      double reach = 0;
      const auto exit = first_exit(polar_vertex(hull.points[a], hull.points[b], hull.points[c]), reach);
      if (!exit) return;
      inner[f] = 1 / std::max(1.0, reach);
      if (reach * (1 - tolerance) <= 1 || planes.size() >= kMostPlanes) continue;
      add(*exit);
      const int p = static_cast<int>(hull.points.size()) - 1;
      if (!hull.sees(f, p)) continue;
      hull.insert(p, f);
      inner.resize(hull.facets.size(), 1);
      unsettled.insert(unsettled.end(), hull.cone().begin(), hull.cone().end());
    }
  }
};

Region grow(std::span<const Placed> bodies, std::span<const OwnedPlane> planes, const DeepestBall& ball,
            double tolerance, double rounding_of_planes) {
  Growth growth{bodies, round_frame(bodies, planes, ball), {}, {}, {}};
  std::vector<double> negligible;
  for (const OwnedPlane& p : planes) {
    growth.add(p);
    negligible.push_back(4 * rounding_of_planes / -signed_distance(p.plane, growth.frame.origin));
  }
  const bool solid = growth.hull.build(negligible);
  assert(solid);
  if (!solid) throw std::logic_error("the dual points of an overlap lie in one plane");
  growth.refine(tolerance);

  Region region;
  region.frame = growth.frame;
  region.polytope = polar_dual(growth.hull);
  region.rounding = rounding_of_planes;
  region.facets_touched = growth.hull.inserted();
  for (int& p : region.polytope.plane) {
    region.planes.push_back(growth.planes[p]);
    p = static_cast<int>(region.planes.size()) - 1;
  }
  for (int f = 0; f < static_cast<int>(growth.hull.facets.size()); ++f)
    if (!growth.hull.facets[f].removed()) region.inner.push_back(growth.inner.empty() ? 1 : growth.inner[f]);
  return region;
}

// ------------------------------------------------------------------------------------------------------------ quantities

/// The volume of the star about the origin over the vertices pulled in to where they lie in the common set. Each of its
/// tetrahedra has its corners in the set, so it lies inside.
double inner_volume(const Region& region) {
  const Polytope& p = region.polytope;
  double sum = 0;
  for (int f = 0; f < p.facets(); ++f) {
    const auto ring = p.facet(f);
    const auto pulled = [&](int v) { return region.inner[v] * p.vertices[v]; };
    // The fan starts at the corner that is pulled least.
    size_t first = 0;
    for (size_t i = 1; i < ring.size(); ++i)
      if (region.inner[ring[i]] > region.inner[ring[first]]) first = i;
    const Vec3 a = pulled(ring[first]);
    for (size_t i = 1; i + 1 < ring.size(); ++i) {
      const Vec3 b = pulled(ring[(first + i) % ring.size()]), c = pulled(ring[(first + i + 1) % ring.size()]);
      sum += dot(a, cross(b, c)) / 6;
    }
  }
  return sum;
}

/// Inertia tensor tr(S) I - S of the second moments S.
Mat3 inertia_tensor(const Mat3& s) {
  const double trace = s.row0.x + s.row1.y + s.row2.z;
  Mat3 inertia{-s.row0, -s.row1, -s.row2};
  inertia.row0.x += trace;
  inertia.row1.y += trace;
  inertia.row2.z += trace;
  return inertia;
}

Quantities measure_region(const Region& region) {
  const Measures in_frame = measure(region.polytope);
  const Mat3& axes = region.frame.axes;
  const double scale = determinant(axes);
  Quantities q;
  const double outer = scale * in_frame.volume;
  const bool exact = std::all_of(region.inner.begin(), region.inner.end(), [](double t) { return t == 1; });
  const double inner = exact ? outer : scale * inner_volume(region);
  // On a doubly curved surface, a regular facet's tangent polygon leaves 5/12 of the shell between the two polytopes
  // outside of the body and the fan over its pulled-in corners 7/12 inside of it.
  q.volume = outer - 5.0 / 12.0 * (outer - inner);

  const Vec3 centre = in_frame.first_moment / in_frame.volume;
  q.centroid = region.to_world(centre);
  Mat3 second = in_frame.second_moment;
  second.row0 -= in_frame.volume * centre.x * centre;
  second.row1 -= in_frame.volume * centre.y * centre;
  second.row2 -= in_frame.volume * centre.z * centre;
  Mat3 moments = axes * second * transposed(axes);
  for (Vec3* row : {&moments.row0, &moments.row1, &moments.row2}) *row = scale * *row;
  q.inertia = inertia_tensor(moments);

  for (int f = 0; f < region.polytope.facets(); ++f) {
    const Plane& plane = region.planes[f].plane;
    const double slack = -signed_distance(plane, region.frame.origin);
    const double area = 3 * scale * in_frame.cone_volume[f] / slack;
    q.area += area;
    q.area_vector.push_back(area * plane.normal);
    q.facet_centroid.push_back(region.to_world(in_frame.facet_centroid[f]));
  }
  double reach = 0;
  for (Vec3 y : region.polytope.vertices) reach = std::max(reach, norm(axes * y));
  // First order: every plane moved by `rounding`. Second and third: what the moved planes add along ridges and corners,
  // which is at most the shell of that thickness around a body that fits into a ball of radius `reach`. Then the sums
  // themselves.
  const double r = region.rounding;
  const double moved = r * (q.area + r * (4 * 3.15 * reach + 4.2 * r));
  q.volume_error = 7.0 / 12.0 * (outer - inner) + moved + 64 * DBL_EPSILON * outer;
  return q;
}

// --------------------------------------------------------------------------------------------------------------- surface

/// The facet on the other side of each directed ridge of a polytope.
class Ridges {
 public:
  explicit Ridges(const Polytope& polytope)
      : polytope_(polytope), count_(static_cast<int64_t>(polytope.vertices.size())) {
    for (int f = 0; f < polytope.facets(); ++f) {
      const auto ring = polytope.facet(f);
      for (size_t i = 0; i < ring.size(); ++i) facet_left_of_[key(ring[i], ring[(i + 1) % ring.size()])] = f;
    }
  }
  int left_of(int from, int to) const { return facet_left_of_.at(key(from, to)); }
  int next_in(int facet, int vertex) const {
    const auto ring = polytope_.facet(facet);
    size_t i = 0;
    while (ring[i] != vertex) ++i;
    return ring[(i + 1) % ring.size()];
  }

 private:
  int64_t key(int from, int to) const { return from * count_ + to; }
  const Polytope& polytope_;
  int64_t count_;
  std::unordered_map<int64_t, int> facet_left_of_;
};

/// Closed loops of vertices around every connected part of the surface that belongs to `owner`, counter-clockwise from
/// outside.
void trace_patch(const Polytope& polytope, std::span<const OwnedPlane> planes, const Ridges& ridges, int owner,
                 std::vector<std::vector<int>>& loops) {
  std::unordered_map<int, std::vector<int>>
      open;  // vertices that begin border ridges not yet walked, and where they lead
  const auto mine = [&](int facet) { return planes[facet].owner == owner; };
  std::vector<std::pair<int, int>> border;
  for (int f = 0; f < polytope.facets(); ++f) {
    if (!mine(f)) continue;
    const auto ring = polytope.facet(f);
    for (size_t i = 0; i < ring.size(); ++i) {
      const int from = ring[i], to = ring[(i + 1) % ring.size()];
      if (!mine(ridges.left_of(to, from))) border.push_back({from, to});
    }
  }
  std::unordered_map<int64_t, bool> walked;
  const int64_t n = static_cast<int64_t>(polytope.vertices.size());
  for (const auto& [first_from, first_to] : border) {
    if (walked[first_from * n + first_to]) continue;
    std::vector<int> loop;
    int from = first_from, to = first_to;
    while (!walked[from * n + to]) {
      walked[from * n + to] = true;
      loop.push_back(from);
      // At the head, turn through the facets of this owner until the next ridge has another on its far side.
      int facet = ridges.left_of(from, to);
      int next = ridges.next_in(facet, to);
      while (mine(ridges.left_of(next, to))) {
        facet = ridges.left_of(next, to);
        next = ridges.next_in(facet, to);
      }
      from = to;
      to = next;
    }
    loops.push_back(std::move(loop));
  }
}

/// Number of the group of each vertex: vertices joined by ridges that rounding alone may have made.
std::vector<int> merge_vertices(const Region& region, int& groups) {
  const Polytope& p = region.polytope;
  std::vector<double> blur(p.vertices.size(), 0);
  for (int f = 0; f < p.facets(); ++f) {
    const double relative = region.rounding / -signed_distance(region.planes[f].plane, region.frame.origin);
    for (int v : p.facet(f)) blur[v] = std::max(blur[v], std::min(1e-3, 64 * relative));
  }
  std::vector<int> parent(p.vertices.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  for (int f = 0; f < p.facets(); ++f) {
    const auto ring = p.facet(f);
    for (size_t i = 0; i < ring.size(); ++i) {
      const int u = ring[i], v = ring[(i + 1) % ring.size()];
      if (norm(p.vertices[u] - p.vertices[v]) <= std::max(blur[u], blur[v]) * std::max(1.0, norm(p.vertices[u])))
        parent[std::max(root(u), root(v))] = std::min(root(u), root(v));
    }
  }
  std::vector<int> group(p.vertices.size());
  groups = 0;
  for (int v = 0; v < static_cast<int>(group.size()); ++v) group[v] = root(v) == v ? groups++ : group[root(v)];
  return group;
}

/// The ring with each run of one group written once; empty if fewer than three remain.
std::vector<int> contracted(std::span<const int> ring, std::span<const int> group) {
  std::vector<int> result;
  for (int v : ring)
    if (result.empty() || result.back() != group[v]) result.push_back(group[v]);
  while (result.size() > 1 && result.back() == result.front()) result.pop_back();
  if (result.size() < 3) result.clear();
  return result;
}

Surface surface_of(const Region& region, int bodies) {
  const Polytope& p = region.polytope;
  int groups = 0;
  const std::vector<int> group = merge_vertices(region, groups);
  Surface surface;
  surface.vertices.resize(groups);
  for (int v = 0; v < static_cast<int>(group.size()); ++v) surface.vertices[group[v]] = region.to_world(p.vertices[v]);
  surface.ring_start.push_back(0);
  for (int f = 0; f < p.facets(); ++f) {
    const std::vector<int> ring = contracted(p.facet(f), group);
    if (ring.empty()) continue;
    surface.ring.insert(surface.ring.end(), ring.begin(), ring.end());
    surface.ring_start.push_back(static_cast<int>(surface.ring.size()));
    Plane plane = region.planes[f].plane;
    plane.offset += dot(plane.normal, region.reference);
    surface.planes.push_back(plane);
    surface.owner.push_back(region.planes[f].owner);
  }
  const Ridges ridges(p);
  std::vector<std::vector<int>> loops;
  for (int owner = 0; owner < (bodies == 2 ? 1 : bodies); ++owner) trace_patch(p, region.planes, ridges, owner, loops);
  for (const auto& loop : loops) {
    std::vector<Vec3> polygon;
    for (int v : contracted(loop, group)) polygon.push_back(surface.vertices[v]);
    if (!polygon.empty()) surface.patch.push_back(std::move(polygon));
  }
  return surface;
}

}  // namespace

// --------------------------------------------------------------------------------------------------------------- Overlap

Overlap::Overlap(std::vector<Placed> bodies, double tolerance, Method method)
    : bodies_(std::move(bodies)), tolerance_(tolerance), method_(method) {
  if (bodies_.size() < 2) throw std::invalid_argument("shapes must be two or more");
  if (!(tolerance > 0 && tolerance < 1))
    throw std::invalid_argument("tolerance must be greater than 0 and less than 1");
  reference_ = bodies_[0].pose.translation;
  for (const Placed& body : bodies_) relative_.push_back(body.seen_from(reference_));
  if (method == Method::kPaper) {
    PaperResult result = intersect_as_in_paper(relative_, tolerance);
    status_ = result.status;
    if (result.region) {
      lazy_->region = std::move(result.region);
      lazy_->region->reference = reference_;
    }
    return;
  }

  double reach = 0;
  for (const Placed& body : relative_) reach = std::max(reach, magnitude(body));
  std::vector<OwnedPlane> hints;
  if (pair() && (bounded(bodies_[0].shape) || bounded(bodies_[1].shape))) {
    const Distance d = overlapper::distance(relative_[0], relative_[1]);
    if (d.gap > rounding(reach)) return;
    hints = facing_planes(relative_, d);
  }
  std::vector<OwnedPlane> planes = gather_planes(relative_);
  ball_ = deepest_ball(relative_, planes, hints);
  if (ball_.lower > ball_.rounding) {
    status_ = Status::kOverlapping;
    lazy_->planes = std::move(planes);
    const bool none_bounded =
        std::none_of(bodies_.begin(), bodies_.end(), [](const Placed& b) { return bounded(b.shape); });
    if (none_bounded) {
      for (const OwnedPlane& plane : region().planes)
        if (plane.owner < 0)
          throw std::invalid_argument("shapes must have a bounded common set: half-spaces alone leave it open");
    }
  } else if (!ball_.apart) {
    status_ = Status::kTouching;
  }
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

const Region& Overlap::region() const {
  assert(status_ == Status::kOverlapping);
  const std::scoped_lock lock(lazy_->mutex);
  if (!lazy_->region) {
    double reach = 0;
    for (const Placed& body : relative_) reach = std::max(reach, magnitude(body));
    std::vector<OwnedPlane> planes = std::move(lazy_->planes);
    if (std::none_of(bodies_.begin(), bodies_.end(), [](const Placed& b) { return bounded(b.shape); }))
      planes.insert(planes.end(), ball_.cuts.begin(), ball_.cuts.begin() + 4);
    lazy_->region = grow(relative_, planes, ball_, tolerance_, rounding(reach));
    lazy_->region->reference = reference_;
  }
  return *lazy_->region;
}

const Quantities& Overlap::quantities() const {
  const Region& r = region();
  const std::scoped_lock lock(lazy_->mutex);
  if (!lazy_->quantities) lazy_->quantities = measure_region(r);
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
  const Region& r = region();
  const Quantities& q = quantities();
  for (size_t f = 0; f < q.area_vector.size(); ++f) {
    const int owner = r.planes[f].owner;
    const Vec3 force = q.area_vector[f];
    const Vec3 moment = cross(q.facet_centroid[f] - bodies_[owner].position, force);
    std::array<double, 6>& row = rows[owner];
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
  lazy_->contact = contact;
  return *lazy_->contact;
}

}  // namespace overlapper
