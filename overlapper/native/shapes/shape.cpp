#include "shapes/shape.h"

#include <cassert>
#include <cfloat>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>

#include "geometry/expanding_hull.h"
#include "geometry/polytope.h"
#include "geometry/predicates.h"
#include "geometry/wide.h"
#include "shapes/planes_asked.h"

namespace overlapper {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Products of a few coordinates, and of their reciprocals, must neither overflow nor underflow.
constexpr double kSmallest = 1e-100, kLargest = 1e100;

void require(bool condition, const std::string& message) {
  if (!condition) throw std::invalid_argument(message);
}

void require_size(double value, const char* name) {
  require(std::isfinite(value), std::string(name) + " must be finite");
  require(value > 0, std::string(name) + " must be greater than 0, not " + std::to_string(value));
  require(value > kSmallest && value < kLargest, std::string(name) + " must be between 1e-100 and 1e100 m");
}

double radial(Vec3 v) { return std::hypot(v.x, v.y); }

/// The smallest t >= 0 at which |q + t d|² = r², for q inside. The form without cancellation of the two usual ones.
double leave_disc(double qq, double qd, double dd, double r) {
  const double inside = std::max(0.0, r * r - qq);
  const double root = std::sqrt(qd * qd + dd * inside);
  return qd > 0 ? inside / (qd + root) : (root - qd) / dd;
}

Plane tangent(Vec3 outward, Vec3 centre, double radius) {
  const Vec3 normal = unit(outward);
  return {normal, dot(normal, centre) + radius};
}

double sign(double x) { return x < 0 ? -1 : 1; }

Vec3 axis(int i) { return {i == 0 ? 1.0 : 0.0, i == 1 ? 1.0 : 0.0, i == 2 ? 1.0 : 0.0}; }

/// The plane among `planes` with the largest `value(plane)`.
template <class Value>
Plane best_plane(const std::vector<Plane>& planes, Value value) {
  int best = 0;
  double largest = -kInfinity;
  for (int i = 0; i < static_cast<int>(planes.size()); ++i) {
    const double v = value(planes[i]);
    if (v > largest) largest = v, best = i;
  }
  return planes[best];
}

}  // namespace

Plane Sphere::ray_exit(Vec3 origin, Vec3 direction) const {
  const double t = leave_disc(norm2(origin), dot(origin, direction), norm2(direction), radius);
  return tangent(origin + t * direction, {}, radius);
}

Plane Sphere::tightest(Vec3 point) const { return tangent(norm2(point) > 0 ? point : Vec3{0, 0, 1}, {}, radius); }

Vec3 Box::support(Vec3 d) const {
  return {std::copysign(half_extents.x, d.x), std::copysign(half_extents.y, d.y), std::copysign(half_extents.z, d.z)};
}

Plane Box::ray_exit(Vec3 origin, Vec3 direction) const {
  int first = 0;
  double soonest = kInfinity;
  for (int i = 0; i < 3; ++i) {
    if (direction[i] == 0) continue;
    const double t = (half_extents[i] - sign(direction[i]) * origin[i]) / std::abs(direction[i]);
    if (t < soonest) soonest = t, first = i;
  }
  return {sign(direction[first]) * axis(first), half_extents[first]};
}

Plane Box::tightest(Vec3 point) const {
  const Vec3 outside = abs(point) - half_extents;
  const int i = outside.x >= outside.y && outside.x >= outside.z ? 0 : outside.y >= outside.z ? 1 : 2;
  return {sign(point[i]) * axis(i), half_extents[i]};
}

Vec3 Capsule::support(Vec3 d) const { return Vec3{0, 0, sign(d.z) * length / 2} + radius * unit(d); }

Plane Capsule::ray_exit(Vec3 origin, Vec3 d) const {
  const double half = length / 2, dd = d.x * d.x + d.y * d.y;
  double past = d.z;
  if (dd > 0) {
    const double t = leave_disc(origin.x * origin.x + origin.y * origin.y, origin.x * d.x + origin.y * d.y, dd, radius);
    const Vec3 side = origin + t * d;
    if (std::abs(side.z) <= half) return tangent({side.x, side.y, 0}, {}, radius);
    past = side.z;
  }
  // The ray meets the infinite cylinder past one end, so it has left through the ball around that end.
  const Vec3 end{0, 0, sign(past) * half};
  const Vec3 q = origin - end;
  // Lagrange's identity: seen from afar, the difference of dot(q, d)² and |q|² |d|² would cancel.
  const double discriminant = std::max(0.0, norm2(d) * radius * radius - norm2(cross(q, d)));
  const double t = (std::sqrt(discriminant) - dot(q, d)) / norm2(d);
  Vec3 outward = q + t * d;
  // Where the end begins, rounding may have the ray leave just before it, and there that ball has tangents that cut off
  // the other end.
  if (outward.z * end.z < 0) outward.z = 0;
  return tangent(outward, end, radius);
}

Plane Capsule::tightest(Vec3 point) const {
  const Vec3 core{0, 0, std::clamp(point.z, -length / 2, length / 2)};
  const Vec3 outward = point - core;
  return tangent(norm2(outward) > 0 ? outward : Vec3{1, 0, 0}, core, radius);
}

Vec3 Cylinder::support(Vec3 d) const {
  const double r = radial(d);
  const double z = sign(d.z) * length / 2;
  return r > 0 ? Vec3{radius * d.x / r, radius * d.y / r, z} : Vec3{radius, 0, z};
}

Plane Cylinder::ray_exit(Vec3 origin, Vec3 d) const {
  const double half = length / 2, dd = d.x * d.x + d.y * d.y;
  const Plane cap{{0, 0, sign(d.z)}, half};
  if (dd == 0) return cap;
  const double t = leave_disc(origin.x * origin.x + origin.y * origin.y, origin.x * d.x + origin.y * d.y, dd, radius);
  const Vec3 side = origin + t * d;
  return std::abs(side.z) > half ? cap : tangent({side.x, side.y, 0}, {}, radius);
}

Plane Cylinder::tightest(Vec3 point) const {
  const double r = radial(point);
  if (std::abs(point.z) - length / 2 >= r - radius) return {{0, 0, sign(point.z)}, length / 2};
  return {r > 0 ? Vec3{point.x / r, point.y / r, 0} : Vec3{1, 0, 0}, radius};
}

Vec3 HalfSpace::support(Vec3 direction) const {
  const double along = dot(unit(direction), plane.normal);
  if (along > 0 && norm2(cross(unit(direction), plane.normal)) == 0) return plane.offset * plane.normal;
  return kInfinity * Vec3{sign(direction.x), sign(direction.y), sign(direction.z)};
}

Vec3 Hull::support(Vec3 direction) const {
  const std::vector<Vec3>& vertices = data->vertices;
  if (data->graph) return vertices[data->graph->farthest_vertex(*data, direction)];
  int best = 0;
  double largest = -kInfinity;
  for (int i = 0; i < static_cast<int>(vertices.size()); ++i) {
    const double value = dot(vertices[i], direction);
    if (value > largest) largest = value, best = i;
  }
  return vertices[best];
}

Plane Hull::ray_exit(Vec3 origin, Vec3 direction) const {
  double rate;
  if (data->graph) return data->planes[data->graph->ray_exit(*data, origin, direction, rate)];
  return best_plane(data->planes,
                    [&](const Plane& p) { return dot(p.normal, direction) / -signed_distance(p, origin); });
}

Plane Hull::tightest(Vec3 point) const {
  return best_plane(data->planes, [&](const Plane& p) { return signed_distance(p, point); });
}

Sphere make_sphere(double radius) {
  require_size(radius, "radius");
  return {radius};
}

Box make_box(Vec3 half_extents) {
  for (int i = 0; i < 3; ++i) require_size(half_extents[i], "half_extents");
  return {half_extents};
}

Capsule make_capsule(double radius, double length) {
  require_size(radius, "radius");
  require(std::isfinite(length), "length must be finite");
  require(length >= 0, "length must not be negative, it is " + std::to_string(length));
  return {radius, length};
}

Cylinder make_cylinder(double radius, double length) {
  require_size(radius, "radius");
  require_size(length, "length");
  return {radius, length};
}

HalfSpace make_half_space(Vec3 normal, double offset) {
  require(finite(normal), "normal must be finite");
  require(std::isfinite(offset), "offset must be finite");
  const double length = norm(normal);
  require(length > 0, "normal must not be zero");
  // A normal that is unit but for its last bits stays as given, so that planes read back and built anew are the same.
  if (std::abs(length - 1) <= 2 * DBL_EPSILON) return {{normal, offset}, normal, offset};
  return {{normal / length, offset / length}, normal, offset};
}

double volume(const Shape& shape) {
  struct Visitor {
    double operator()(const Sphere& s) const { return 4.0 / 3.0 * std::numbers::pi * s.radius * s.radius * s.radius; }
    double operator()(const Box& b) const { return 8 * b.half_extents.x * b.half_extents.y * b.half_extents.z; }
    double operator()(const Capsule& c) const {
      return std::numbers::pi * c.radius * c.radius * (c.length + 4.0 / 3.0 * c.radius);
    }
    double operator()(const Cylinder& c) const { return std::numbers::pi * c.radius * c.radius * c.length; }
    double operator()(const Hull& h) const { return h.data->volume; }
    double operator()(const HalfSpace&) const { return kInfinity; }
    double operator()(const RoundedHull& h) const { return h.volume(); }
  };
  return std::visit(Visitor{}, shape);
}

Vec3 centroid(const Shape& shape) {
  if (const Hull* hull = std::get_if<Hull>(&shape)) return hull->data->centroid;
  if (const HalfSpace* half = std::get_if<HalfSpace>(&shape)) return half->plane.offset * half->plane.normal;
  if (const RoundedHull* hull = std::get_if<RoundedHull>(&shape)) return hull->centroid();
  return {};
}

bool bounded(const Shape& shape) { return !std::holds_alternative<HalfSpace>(shape); }

bool smooth(const Shape& shape) {
  return std::holds_alternative<Sphere>(shape) || std::holds_alternative<Capsule>(shape) ||
         std::holds_alternative<Cylinder>(shape) || std::holds_alternative<RoundedHull>(shape);
}

void append_planes(const Shape& shape, std::vector<Plane>& planes) {
  const auto six = [&](Vec3 extent) {
    for (int i = 0; i < 3; ++i)
      for (double s : {-1.0, 1.0}) planes.push_back({s * axis(i), extent[i]});
  };
  struct Visitor {
    decltype(six)& box_of;
    std::vector<Plane>& out;
    void operator()(const Sphere& s) const { box_of({s.radius, s.radius, s.radius}); }
    void operator()(const Box& b) const { box_of(b.half_extents); }
    void operator()(const Capsule& c) const { box_of({c.radius, c.radius, c.radius + c.length / 2}); }
    void operator()(const Cylinder& c) const { box_of({c.radius, c.radius, c.length / 2}); }
    void operator()(const Hull& h) const { out.insert(out.end(), h.data->planes.begin(), h.data->planes.end()); }
    void operator()(const HalfSpace& h) const { out.push_back(h.plane); }
    void operator()(const RoundedHull& h) const {
      for (const Plane& plane : h.core.data->planes) out.push_back({plane.normal, plane.offset + h.radius});
    }
  };
  std::visit(Visitor{six, planes}, shape);
}

double core_radius(const Shape& shape) {
  if (const Sphere* sphere = std::get_if<Sphere>(&shape)) return sphere->radius;
  if (const Capsule* capsule = std::get_if<Capsule>(&shape)) return capsule->radius;
  if (const RoundedHull* hull = std::get_if<RoundedHull>(&shape)) return hull->radius;
  return 0;
}

const HullData* polytope_of(const Shape& shape) {
  if (const Hull* hull = std::get_if<Hull>(&shape)) return hull->data.get();
  if (const RoundedHull* hull = std::get_if<RoundedHull>(&shape)) return hull->core.data.get();
  return nullptr;
}

Placed make_placed(Shape shape, Vec3 position, Quaternion orientation) {
  Placed placed{std::move(shape), {}, {}, {}};
  placed.move_to(position, orientation);
  return placed;
}

void Placed::move_to(Vec3 new_position, Quaternion q) {
  require(finite(new_position), "position must be finite");
  require(max_component(abs(new_position)) < kLargest, "position must be closer to the origin than 1e100 m");
  require(std::isfinite(q.x) && std::isfinite(q.y) && std::isfinite(q.z) && std::isfinite(q.w),
          "orientation must be finite");
  const double length = std::hypot(std::hypot(q.x, q.y), std::hypot(q.z, q.w));
  require(length > 0, "orientation must not be the zero quaternion");
  if (std::abs(length - 1) > DBL_EPSILON) q = {q.x / length, q.y / length, q.z / length, q.w / length};
  position = new_position;
  orientation = q;
  pose = {rotation_matrix(q), new_position};
  if (const HullData* hull = polytope_of(shape)) pose.translation = pose * hull->origin;
}

Vec3 Placed::support(Vec3 direction) const {
  const Vec3 local = apply_transposed(pose.rotation, direction);
  return pose * std::visit([&](const auto& s) { return s.support(local); }, shape);
}

Vec3 Placed::core_support(Vec3 direction) const {
  if (std::holds_alternative<Sphere>(shape)) return pose.translation;
  if (const Capsule* capsule = std::get_if<Capsule>(&shape)) {
    const Vec3 along = pose.rotation * Vec3{0, 0, capsule->length / 2};
    return pose.translation + (dot(along, direction) < 0 ? -along : along);
  }
  if (const RoundedHull* hull = std::get_if<RoundedHull>(&shape))
    return pose * hull->core.support(apply_transposed(pose.rotation, direction));
  return support(direction);
}

Plane Placed::ray_exit(Vec3 origin, Vec3 direction) const {
  ++planes_asked;
  const Vec3 from = apply_transposed(pose.rotation, origin - pose.translation);
  const Vec3 along = apply_transposed(pose.rotation, direction);
  return pose * std::visit([&](const auto& s) { return s.ray_exit(from, along); }, shape);
}

Plane Placed::tightest(Vec3 point) const {
  ++planes_asked;
  const Vec3 local = apply_transposed(pose.rotation, point - pose.translation);
  return pose * std::visit([&](const auto& s) { return s.tightest(local); }, shape);
}

Placed Placed::seen_from(Vec3 reference) const {
  Placed seen = *this;
  seen.pose.translation -= reference;
  return seen;
}

Bounds bounds(const Placed& placed) {
  if (const HalfSpace* half = std::get_if<HalfSpace>(&placed.shape)) {
    const Plane plane = placed.pose * half->plane;
    const Vec3 touch = plane.offset * plane.normal;
    const auto limit = [&](int i, double side) { return side * plane.normal[i] == 1 ? touch[i] : side * kInfinity; };
    return {{limit(0, -1), limit(1, -1), limit(2, -1)}, {limit(0, 1), limit(1, 1), limit(2, 1)}};
  }
  const auto reach = [&](int i, double side) { return placed.support(side * axis(i))[i]; };
  return {{reach(0, -1), reach(1, -1), reach(2, -1)}, {reach(0, 1), reach(1, 1), reach(2, 1)}};
}

// ---------------------------------------------------------------------------------------------------------------- hulls

namespace {

/// Subtracting it is exact: Sterbenz' lemma holds for coordinates within a factor of two of the middle, so the middle
/// is used on an axis only where the points keep farther from zero than that.
Vec3 lossless_origin(Vec3 lower, Vec3 upper) {
  const auto middle = [](double low, double high) {
    const double centre = low / 2 + high / 2;
    return std::abs(centre) >= 2 * (high - low) ? centre : 0;
  };
  return {middle(lower.x, upper.x), middle(lower.y, upper.y), middle(lower.z, upper.z)};
}

/// Which facet each triangle of a hull belongs to. A triangle joins its neighbour's facet if it lies within rounding of
/// the facet's plane, that of its largest triangle.
struct CoplanarRegions {
  const ExpandingHull& hull;
  double rounding;
  std::vector<int> region;  ///< per triangle of the hull, -1 for removed ones
  std::vector<int> first;   ///< per region: its largest triangle

  Plane plane_of(int triangle) const {
    const auto& [a, b, c] = hull.facets[triangle].vertex;
    const Vec3 normal = unit(accurate_normal(hull.points[a], hull.points[b], hull.points[c]));
    return {normal, dot(normal, hull.points[a])};
  }

  void grow(int triangle) {
    const int id = static_cast<int>(first.size());
    first.push_back(triangle);
    const Plane plane = plane_of(triangle);
    std::vector<int> stack{triangle};
    region[triangle] = id;
    while (!stack.empty()) {
      const int t = stack.back();
      stack.pop_back();
      for (int other : hull.facets[t].neighbour) {
        if (region[other] >= 0) continue;
        // The far side of a plate thinner than rounding is another facet.
        bool flat = dot(plane_of(other).normal, plane.normal) >= 0;
        for (int v : hull.facets[other].vertex) flat &= std::abs(signed_distance(plane, hull.points[v])) <= rounding;
        if (!flat) continue;
        region[other] = id;
        stack.push_back(other);
      }
    }
  }
};

CoplanarRegions merge_coplanar(const ExpandingHull& hull, double rounding) {
  CoplanarRegions regions{hull, rounding, std::vector<int>(hull.facets.size(), -1), {}};
  std::vector<int> by_area;
  for (int t = 0; t < static_cast<int>(hull.facets.size()); ++t)
    if (!hull.facets[t].removed()) by_area.push_back(t);
  std::sort(by_area.begin(), by_area.end(),
            [&](int a, int b) { return norm2(hull.facets[a].normal) > norm2(hull.facets[b].normal); });
  for (int t : by_area)
    if (regions.region[t] < 0) regions.grow(t);
  return regions;
}

/// The directed ridges that leave each region, chained into one loop of point indices per region.
std::vector<std::vector<int>> region_loops(const CoplanarRegions& regions) {
  const ExpandingHull& hull = regions.hull;
  struct Ridge {
    int from, to;
  };
  std::vector<std::vector<Ridge>> border(regions.first.size());
  for (int t = 0; t < static_cast<int>(hull.facets.size()); ++t) {
    if (hull.facets[t].removed()) continue;
    for (int i = 0; i < 3; ++i)
      if (regions.region[hull.facets[t].neighbour[i]] != regions.region[t])
        border[regions.region[t]].push_back({hull.facets[t].vertex[i], hull.facets[t].vertex[(i + 1) % 3]});
  }
  std::vector<std::vector<int>> loops(border.size());
  std::vector<int> next(hull.points.size(), -1);
  for (int r = 0; r < static_cast<int>(border.size()); ++r) {
    if (border[r].empty()) continue;
    for (const Ridge& ridge : border[r]) next[ridge.from] = ridge.to;
    const int begin = border[r][0].from;
    int v = begin;
    do {
      loops[r].push_back(v);
      v = next[v];
    } while (v != begin && loops[r].size() < border[r].size());
  }
  return loops;
}

/// Points in the middle of an edge lie on two facets only: they are no vertices of the solid.
void drop_edge_points(std::vector<std::vector<int>>& loops, int points) {
  std::vector<int> facets_at(points, 0);
  for (const auto& loop : loops)
    for (int v : loop) ++facets_at[v];
  for (auto& loop : loops) {
    std::erase_if(loop, [&](int v) { return facets_at[v] < 3; });
    if (loop.size() < 3) loop.clear();
  }
}

/// Newell's normal of a polygon, taken about its first corner; the offset is that of its outermost corner.
Plane supporting_plane(const std::vector<Vec3>& vertices, std::span<const int> ring) {
  const Vec3 apex = vertices[ring[0]];
  Vec3 normal;
  if (ring.size() == 3) {
    normal = unit(accurate_normal(apex, vertices[ring[1]], vertices[ring[2]]));
  } else {
    // On a slender facet the products of doubles nearly cancel.
    WideVector sum;
    for (size_t i = 1; i + 1 < ring.size(); ++i)
      sum = sum + wide_cross(wide_difference(vertices[ring[i]], apex), wide_difference(vertices[ring[i + 1]], apex));
    normal = unit(rounded(sum));
  }
  double offset = -kInfinity;
  for (int v : ring) offset = std::max(offset, dot(normal, vertices[v]));
  return {normal, offset};
}

/// Per region: the corners of its largest triangle, unless rounding alone has merged others with that.
std::vector<std::array<int, 3>> exact_corners(const CoplanarRegions& regions) {
  const ExpandingHull& hull = regions.hull;
  std::vector<std::array<int, 3>> corners;
  for (int t : regions.first) corners.push_back(hull.facets[t].vertex);
  for (int t = 0; t < static_cast<int>(hull.facets.size()); ++t) {
    if (hull.facets[t].removed() || regions.first[regions.region[t]] == t) continue;
    std::array<int, 3>& corner = corners[regions.region[t]];
    if (corner[0] < 0) continue;
    const auto [a, b, c] = corner;
    for (int v : hull.facets[t].vertex)
      if (orientation(hull.points[a], hull.points[b], hull.points[c], hull.points[v]) != 0) corner = {-1, -1, -1};
  }
  return corners;
}

HullData hull_data(const CoplanarRegions& regions, const std::vector<std::vector<int>>& loops, Vec3 origin,
                   std::vector<int>* source) {
  const ExpandingHull& hull = regions.hull;
  HullData data;
  data.origin = origin;
  std::vector<int> index(hull.points.size(), -1);
  for (const auto& loop : loops) {
    if (loop.empty()) continue;
    for (int p : loop) {
      if (index[p] < 0) {
        index[p] = static_cast<int>(data.vertices.size());
        data.vertices.push_back(hull.points[p]);
        if (source) source->push_back(p);
      }
      data.ring.push_back(index[p]);
    }
    data.ring_start.push_back(static_cast<int>(data.ring.size()));
  }
  std::vector<int> corner(hull.points.size(), -1);
  for (const ExpandingHull::Facet& facet : hull.facets) {
    if (facet.removed()) continue;
    std::array<int, 3> triangle;
    for (int i = 0; i < 3; ++i) {
      const int p = facet.vertex[i];
      if (corner[p] < 0) {
        corner[p] = static_cast<int>(data.corners.size());
        data.corners.push_back(hull.points[p]);
      }
      triangle[i] = corner[p];
    }
    data.triangles.push_back(triangle);
  }
  const std::vector<std::array<int, 3>> exact = exact_corners(regions);
  for (int r = 0; r < static_cast<int>(loops.size()); ++r) {
    if (loops[r].empty()) continue;
    const auto& [a, b, c] = exact[r];
    data.facet_corners.push_back(a < 0 ? exact[r] : std::array{corner[a], corner[b], corner[c]});
    data.planes.push_back(supporting_plane(data.vertices, data.facet(static_cast<int>(data.planes.size()))));
  }
  return data;
}

}  // namespace

namespace {

std::vector<Edge> edges_of(const HullData& data) {
  struct Side {
    int from, to, facet;
  };
  std::vector<Side> sides;
  for (int f = 0; f < static_cast<int>(data.planes.size()); ++f) {
    const auto ring = data.facet(f);
    for (size_t i = 0; i < ring.size(); ++i) sides.push_back({ring[i], ring[(i + 1) % ring.size()], f});
  }
  const auto ends = [](const Side& s) { return std::minmax(s.from, s.to); };
  std::stable_sort(sides.begin(), sides.end(), [&](const Side& a, const Side& b) { return ends(a) < ends(b); });
  std::vector<Edge> edges;
  for (size_t i = 0; i < sides.size(); i += 2) {
    const bool paired = i + 1 < sides.size() && sides[i].from == sides[i + 1].to && sides[i].to == sides[i + 1].from;
    if (!paired || (i + 2 < sides.size() && ends(sides[i + 2]) == ends(sides[i]))) return {};
    edges.push_back({sides[i].from, sides[i].to, sides[i].facet, sides[i + 1].facet});
  }
  return edges;
}

/// Of the facets around a vertex: the first, the one at the largest angle to it, and the one that with these spans
/// most.
std::array<int, 3> well_spread(std::span<const int> around, const std::vector<Plane>& planes) {
  const auto most = [&](auto spread) {
    return *std::max_element(around.begin(), around.end(), [&](int f, int g) { return spread(f) < spread(g); });
  };
  const Vec3 a = planes[around[0]].normal;
  const int second = most([&](int f) { return norm2(cross(a, planes[f].normal)); });
  const Vec3 ab = cross(a, planes[second].normal);
  return {around[0], second, most([&](int f) { return std::abs(dot(ab, planes[f].normal)); })};
}

}  // namespace

void complete(HullData& data) {
  data.edges = edges_of(data);
  std::vector<std::vector<int>> around(data.vertices.size());
  for (int f = 0; f < static_cast<int>(data.planes.size()); ++f) {
    for (int v : data.facet(f)) {
      around[v].push_back(f);
      data.flatness = std::max(data.flatness, -signed_distance(data.planes[f], data.vertices[v]));
    }
  }
  for (const Edge& e : data.edges)
    for (const auto& [facet, beside] : {std::pair(e.left, e.right), std::pair(e.right, e.left)})
      for (int v : data.facet(beside))
        data.flatness = std::max(data.flatness, signed_distance(data.planes[facet], data.vertices[v]));
  for (const auto& facets : around) data.facets_meet.push_back(well_spread(facets, data.planes));
  for (Vec3 v : data.vertices) data.radius = std::max(data.radius, norm(v));
}

std::shared_ptr<HullData> hull_of(std::span<const Vec3> points, std::vector<int>* source) {
  Vec3 lower = points[0], upper = points[0];
  for (Vec3 p : points) lower = min(lower, p), upper = max(upper, p);
  const Vec3 origin = lossless_origin(lower, upper);
  ExpandingHull hull;
  hull.points.reserve(points.size());
  for (Vec3 p : points) hull.points.push_back(p - origin);
  if (!hull.build()) return nullptr;

  // Corners computed by a user as centre plus rotated half extents carry a few roundings each, relative to the extent;
  // a plane through three of them misses a fourth by up to about eight of those.
  const double rounding = 16 * DBL_EPSILON * max_component(max(abs(lower - origin), abs(upper - origin)));
  const CoplanarRegions regions = merge_coplanar(hull, rounding);
  std::vector<std::vector<int>> loops = region_loops(regions);
  drop_edge_points(loops, static_cast<int>(hull.points.size()));
  auto data = std::make_shared<HullData>(hull_data(regions, loops, origin, source));
  if (data->planes.size() < 4) return nullptr;
  const HullMeasures measures = measure(*data);
  data->volume = measures.volume;
  data->centroid = measures.centroid;
  complete(*data);
  // A solid thinner than the rounding of its corners has no inside to speak of.
  if (!(data->volume > rounding * measures.area / 2)) return nullptr;
  return data;
}

Hull make_hull(std::span<const Vec3> points) {
  require(points.size() >= 4, "vertices must hold at least four points, not " + std::to_string(points.size()));
  for (Vec3 p : points) require(finite(p), "vertices must be finite");
  double largest = 0;
  for (Vec3 p : points) largest = std::max(largest, max_component(abs(p)));
  require(largest < kLargest, "vertices must be closer to the origin than 1e100 m");
  auto data = hull_of(points);
  require(data != nullptr, "vertices are flat: they all lie in one plane");
  data->graph = graph_of(*data);
  return {std::move(data)};
}

Hull tessellated(const Shape& shape, double tolerance) {
  if (const Hull* hull = std::get_if<Hull>(&shape)) return *hull;
  require(!std::holds_alternative<RoundedHull>(shape), "shapes must not be rounded hulls for method 'paper'");
  std::vector<Vec3> points;
  const auto circle = [&](double radius, double z, int n) {
    for (int i = 0; i < n; ++i) {
      const double angle = 2 * std::numbers::pi * i / n;
      points.push_back({radius * std::cos(angle), radius * std::sin(angle), z});
    }
  };
  if (const Box* box = std::get_if<Box>(&shape)) {
    for (double x : {-1.0, 1.0})
      for (double y : {-1.0, 1.0})
        for (double z : {-1.0, 1.0})
          points.push_back({x * box->half_extents.x, y * box->half_extents.y, z * box->half_extents.z});
  } else if (const Cylinder* cylinder = std::get_if<Cylinder>(&shape)) {
    // An inscribed n-gon lacks 2/3 (π/n)² of its disc.
    require(tolerance >= 1e-11, "tolerance must be 1e-11 or more where method 'paper' tessellates a cylinder");
    const int n = std::max(8, static_cast<int>(std::ceil(std::numbers::pi * std::sqrt(2 / (3 * tolerance)))));
    circle(cylinder->radius, -cylinder->length / 2, n);
    circle(cylinder->radius, cylinder->length / 2, n);
  } else if (bounded(shape)) {
    // A grid of latitudes and longitudes with the same step s lacks at most about s²/2 of the ball.
    const double radius = core_radius(shape), half = shape.index() == 0 ? 0 : std::get<Capsule>(shape).length / 2;
    // Two latitudes' worth of points per band: beyond a million or so their hull is out of reach.
    require(tolerance >= 1e-5, "tolerance must be 1e-5 or more where method 'paper' tessellates a round shape");
    const int bands = std::max(4, static_cast<int>(std::ceil(std::numbers::pi / std::sqrt(2 * tolerance))));
    points.push_back({0, 0, radius + half});
    points.push_back({0, 0, -radius - half});
    for (int band = 1; band < bands; ++band) {
      const double latitude = std::numbers::pi * (static_cast<double>(band) / bands - 0.5);
      const double r = radius * std::cos(latitude), z = radius * std::sin(latitude);
      const int around = std::max(6, static_cast<int>(std::ceil(2 * bands * std::cos(latitude))));
      if (z <= 0) circle(r, z - half, around);
      if (z >= 0) circle(r, z + half, around);
    }
  } else {
    throw std::invalid_argument("a half-space is unbounded and has no vertices");
  }
  return make_hull(points);
}

}  // namespace overlapper
