#include "methods/dual/region.h"

#include <cassert>
#include <cfloat>
#include <deque>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "geometry/cancellation.h"
#include "geometry/predicates.h"
#include "geometry/sum_in_pairs.h"
#include "methods/dual/wide_dual.h"

namespace overlapper {
namespace {

/// The dual hull of a region while it grows.
template <class Body>
struct Growth {
  using Cut = Owned<PlaneOf<Body>>;

  std::span<const Body> bodies;
  FrameAbout<PointOf<Body>> frame;
  ExpandingHull hull;
  std::vector<Cut> planes;    ///< parallel to hull.points
  std::vector<double> inner;  ///< per hull facet, parallel to hull.facets

  void add(const Cut& plane) {
    hull.add(dual_in_frame(frame, plane.plane));
    planes.push_back(plane);
  }

  double slack(const Cut& plane) const { return -rounded(signed_distance(plane.plane, frame.origin)); }

  PointOf<Body> direction_to(Vec3 vertex) const {
    if constexpr (std::is_same_v<Body, Placed>) return frame.axes * vertex;
    else return frame.axes * wide(vertex);
  }

  /// The plane of the smooth bodies through which the ray from the origin to `vertex` leaves first. `reach` is the
  /// distance of the vertex divided by that of the exit.
  std::optional<Cut> first_exit(Vec3 vertex, double& reach) const {
    std::optional<Cut> first;
    reach = 0;
    const PointOf<Body> direction = direction_to(vertex);
    for (int i = 0; i < static_cast<int>(bodies.size()); ++i) {
      if (!smooth(bodies[i].shape)) continue;
      const PlaneOf<Body> plane = bodies[i].ray_exit(frame.origin, direction);
      const double ratio = dot(dual_in_frame(frame, plane), vertex);
      if (ratio > reach) reach = ratio, first = {plane, i};
    }
    return first;
  }

  /// Adds tangent planes where a vertex lies too far outside a smooth body, until none does.
  void refine(double tolerance) {
    constexpr int kMostPlanes = 1 << 20;  // the error bound includes the rest
    inner.assign(hull.facets.size(), 1);
    std::deque<int> unsettled(hull.facets.size());
    std::iota(unsettled.begin(), unsettled.end(), 0);
    while (!unsettled.empty()) {
      cancellation_point();
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

/// How far a polytope may shrink about its origin within a volume error of `tolerance`. Shrinking by s loses less than
/// 3 s of the volume, and measure() leaves 7/12 of that in doubt. The remainder is for rounding.
double shrinking_within(double tolerance) { return 0.56 * tolerance; }

/// Sets the region's reference and frame. The given frame is about `reference`.
void set_frame(Region& region, const Frame& frame, Vec3 reference) {
  region.reference = reference;
  region.frame = frame;
}
void set_frame(Region& region, const FrameAbout<WideVector>& frame, Vec3 reference) {
  const WideVector origin = wide(reference) + frame.origin;
  region.reference = rounded(origin);
  region.frame = {tail(origin), frame.axes};
}

}  // namespace

template <class Body>
Region grow(std::span<const Body> bodies, std::span<const Owned<PlaneOf<Body>>> planes,
            const FrameAbout<PointOf<Body>>& frame, double tolerance, double rounding, Vec3 reference) {
  constexpr bool kWide = std::is_same_v<Body, WideBody>;
  Growth<Body> growth{bodies, frame, {}, {}, {}};
  std::vector<double> negligible;
  for (const auto& p : planes) {
    cancellation_point();
    growth.add(p);
    negligible.push_back(4 * rounding / growth.slack(p) + (kWide ? kLastRounding : 0));
  }
  const bool solid = growth.hull.build(negligible);
  assert(solid);
  if (!solid) throw std::logic_error("the dual points of an overlap lie in one plane");
  growth.refine(shrinking_within(tolerance));

  Region region;
  set_frame(region, frame, reference);
  region.polytope = polar_dual(growth.hull);
  region.facets_touched = growth.hull.inserted();
  const double farthest = kWide ? farthest_vertex(region.polytope) : 0;
  for (int f = 0; f < region.polytope.facets(); ++f) {
    cancellation_point();
    const auto& owned = growth.planes[region.polytope.plane[f]];
    const double slack = growth.slack(owned);
    const double of_dual = kWide ? rounding_of_dual(slack, region.polytope.dual[f], farthest) : 0;
    region.facets.push_back({overlapper::rounded(owned.plane.normal), slack, rounding + of_dual, owned.owner});
  }
  for (int f = 0; f < static_cast<int>(growth.hull.facets.size()); ++f)
    if (!growth.hull.facets[f].removed()) region.inner.push_back(growth.inner[f]);
  return region;
}

template Region grow<Placed>(std::span<const Placed>, std::span<const OwnedPlane>, const Frame&, double, double, Vec3);
template Region grow<WideBody>(std::span<const WideBody>, std::span<const Owned<WidePlane>>,
                               const FrameAbout<WideVector>&, double, double, Vec3);

std::optional<Region> widened(std::span<const Placed> bodies, const Region& region) {
  const double reach = farthest_vertex(region.polytope);
  const std::vector<WideDual> duals = wide_duals(bodies, region.reference, region.frame, reach);
  ExpandingHull hull;
  std::vector<double> negligible;
  for (const WideDual& dual : duals) {
    if (!(dual.slack > 0)) return std::nullopt;
    hull.points.push_back(dual.point);
    negligible.push_back(kLastRounding);
  }
  if (!hull.build(negligible)) return std::nullopt;

  Region wide;
  wide.reference = region.reference;
  wide.frame = region.frame;
  wide.polytope = polar_dual(hull);
  const double farthest = farthest_vertex(wide.polytope);
  for (int p : wide.polytope.plane) {
    const double rounding = rounding_of_dual(duals[p].slack, duals[p].point, farthest);
    wide.facets.push_back({duals[p].normal, duals[p].slack, rounding, duals[p].owner});
  }
  wide.facets_touched = region.facets_touched;
  wide.inner.assign(wide.polytope.vertices.size(), 1);
  return wide;
}

namespace {

/// The volume of the star about the origin over the vertices, pulled in to the common set. Each of its tetrahedra has
/// its corners in the set, so it lies inside.
double inner_volume(const Region& region) {
  const Polytope& p = region.polytope;
  SumInPairs<double> sum;
  for (int f = 0; f < p.facets(); ++f) {
    const auto ring = p.facet(f);
    const auto pulled = [&](int v) { return region.inner[v] * p.vertices[v]; };
    // The fan starts at the corner with the least pull.
    size_t first = 0;
    for (size_t i = 1; i < ring.size(); ++i)
      if (region.inner[ring[i]] > region.inner[ring[first]]) first = i;
    const Vec3 a = pulled(ring[first]);
    for (size_t i = 1; i + 1 < ring.size(); ++i) {
      const Vec3 b = pulled(ring[(first + i) % ring.size()]), c = pulled(ring[(first + i + 1) % ring.size()]);
      sum.add(dot(a, cross(b, c)) / 6);
    }
  }
  return sum.total();
}

/// Inertia tensor tr(S) I - S of the second moments S.
Mat3 inertia_tensor(const Mat3& s) {
  const double diagonal = s.row0.x + s.row1.y + s.row2.z;
  Mat3 inertia{-s.row0, -s.row1, -s.row2};
  inertia.row0.x += diagonal;
  inertia.row1.y += diagonal;
  inertia.row2.z += diagonal;
  return inertia;
}

}  // namespace

MeasuresAndInertia measure(const Region& region, std::span<const Placed> bodies) {
  const PolytopeMoments in_frame = moments(region.polytope);
  const Mat3& axes = region.frame.axes;
  const double scale = determinant(axes);
  Measures m;
  m.status = Status::kOverlapping;
  m.way = Way::kDual;
  m.measured = true;
  m.facets_touched = region.facets_touched;
  const double outer = scale * in_frame.volume;
  const bool exact = std::all_of(region.inner.begin(), region.inner.end(), [](double t) { return t == 1; });
  const double inner = exact ? outer : scale * inner_volume(region);
  // On a doubly curved surface, a regular facet's tangent polygon leaves 5/12 of the shell between the two polytopes
  // outside the body. The fan over its pulled-in corners leaves 7/12 inside.
  m.volume = outer - 5.0 / 12.0 * (outer - inner);

  const Vec3 centre = in_frame.first_moment / in_frame.volume;
  m.centroid = region.to_world(centre);
  Mat3 second = in_frame.second_moment;
  second.row0 -= in_frame.volume * centre.x * centre;
  second.row1 -= in_frame.volume * centre.y * centre;
  second.row2 -= in_frame.volume * centre.z * centre;
  Mat3 spread = axes * second * transposed(axes);
  for (Vec3* row : {&spread.row0, &spread.row1, &spread.row2}) *row = scale * *row;

  SumInPairs<double> areas, moves;
  std::vector<SumInPairs<Pull>> pulls(bodies.size());
  double farthest = 0, least_slack = std::numeric_limits<double>::infinity();
  for (int f = 0; f < region.polytope.facets(); ++f) {
    cancellation_point();
    const Region::Facet& facet = region.facets[f];
    const double area = 3 * scale * in_frame.cone_volume[f] / facet.slack;
    areas.add(area);
    const Vec3 force = area * facet.normal, at = region.frame.origin + axes * in_frame.facet_centroid[f];
    pulls[facet.owner].add({force, cross(at + (region.reference - bodies[facet.owner].position), force)});
    moves.add(area * facet.rounding);
    farthest = std::max(farthest, facet.rounding);
    least_slack = std::min(least_slack, facet.slack);
  }
  m.area = areas.total();
  if (bodies.size() > 2) m.pulls_of_group.resize(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) (bodies.size() > 2 ? m.pulls_of_group[i] : m.pulls[i]) = pulls[i].total();
  // To first order, the error is the volume that all planes add when moved by their rounding. The area also grows on
  // the way.
  const double moved = moves.total() * growth(farthest, least_slack) / 3;
  // The error of the sums follows: vertices are placed to about a hundred roundings.
  m.volume_error = 7.0 / 12.0 * (outer - inner) + moved + 256 * DBL_EPSILON * outer;
  return {std::move(m), inertia_tensor(spread)};
}

}  // namespace overlapper
