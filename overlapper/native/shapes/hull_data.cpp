#include "shapes/hull_data.h"

#include <algorithm>
#include <cfloat>
#include <numeric>
#include <optional>
#include <string>

#include "geometry/cancellation.h"
#include "geometry/constants.h"
#include "geometry/expanding_hull.h"
#include "geometry/predicates.h"
#include "geometry/sum_in_pairs.h"
#include "geometry/wide.h"
#include "shapes/limits.h"

namespace overlapper {
namespace {

/// An origin that can be subtracted exactly. Sterbenz' lemma holds for coordinates within a factor of two of the
/// middle. On each axis, the middle is therefore used only if the points are farther from zero than from the middle.
Vec3 lossless_origin(Vec3 lower, Vec3 upper) {
  const auto middle = [](double low, double high) {
    const double centre = low / 2 + high / 2;
    return std::abs(centre) >= 2 * (high - low) ? centre : 0;
  };
  return {middle(lower.x, upper.x), middle(lower.y, upper.y), middle(lower.z, upper.z)};
}

/// The facet of each triangle of a hull. A triangle joins its neighbour's facet if it lies in the facet's plane to
/// rounding. That plane is the plane of the facet's largest triangle.
struct CoplanarRegions {
  const ExpandingHull& hull;
  double rounding;
  std::vector<int> region;   ///< per triangle of the hull, -1 for removed ones
  std::vector<int> first;    ///< per region: its largest triangle
  std::vector<Vec3> normal;  ///< unit, per triangle of the hull

  void find_normals() {
    for (const ExpandingHull::Facet& facet : hull.facets) {
      cancellation_point();
      const auto& [a, b, c] = facet.vertex;
      normal.push_back(facet.removed() ? Vec3{}
                                       : unit(accurate_normal(hull.points[a], hull.points[b], hull.points[c])));
    }
  }

  Plane plane_of(int triangle) const {
    return {normal[triangle], dot(normal[triangle], hull.points[hull.facets[triangle].vertex[0]])};
  }

  bool lies_in(const Plane& plane, int triangle) const {
    for (int v : hull.facets[triangle].vertex)
      if (!(std::abs(signed_distance(plane, hull.points[v])) <= rounding)) return false;
    // The far side of a plate thinner than rounding is another facet.
    return dot(normal[triangle], plane.normal) >= 0;
  }

  bool alone(int triangle) const {
    const Plane plane = plane_of(triangle);
    return std::ranges::none_of(hull.facets[triangle].neighbour, [&](int other) { return lies_in(plane, other); });
  }

  void grow(int triangle, bool alone) {
    const int id = static_cast<int>(first.size());
    first.push_back(triangle);
    region[triangle] = id;
    if (alone) return;
    const Plane plane = plane_of(triangle);
    std::vector<int> stack{triangle};
    while (!stack.empty()) {
      const int t = stack.back();
      stack.pop_back();
      cancellation_point();
      for (int other : hull.facets[t].neighbour) {
        if (region[other] >= 0 || !lies_in(plane, other)) continue;
        region[other] = id;
        stack.push_back(other);
      }
    }
  }
};

CoplanarRegions merge_coplanar(const ExpandingHull& hull, double rounding) {
  CoplanarRegions regions{hull, rounding, std::vector<int>(hull.facets.size(), -1), {}, {}};
  regions.find_normals();
  // Triangles that are near in memory are near on the hull; triangles sorted by area are not. The work that needs
  // neighbours therefore runs first, in the order of memory.
  struct Seed {
    double area;
    int triangle;
    bool alone;
  };
  std::vector<Seed> by_area;
  for (int t = 0; t < static_cast<int>(hull.facets.size()); ++t) {
    cancellation_point();
    if (!hull.facets[t].removed()) by_area.push_back({norm2(hull.facets[t].normal), t, regions.alone(t)});
  }
  std::sort(by_area.begin(), by_area.end(), [](const Seed& a, const Seed& b) { return a.area > b.area; });
  for (const Seed& seed : by_area)
    if (regions.region[seed.triangle] < 0) regions.grow(seed.triangle, seed.alone);
  return regions;
}

/// Lists of numbers in one array.
struct Lists {
  std::vector<int> start{0}, number;

  int size() const { return static_cast<int>(start.size()) - 1; }
  std::span<const int> operator[](int i) const { return std::span(number).subspan(start[i], start[i + 1] - start[i]); }
  void end() { start.push_back(static_cast<int>(number.size())); }
};

/// The members of `count` groups. `each(use)` calls use(group, member), and runs twice.
template <class Each>
Lists grouped(int groups, Each each) {
  Lists lists;
  lists.start.assign(groups + 1, 0);
  each([&](int group, int) { ++lists.start[group + 1]; });
  std::partial_sum(lists.start.begin(), lists.start.end(), lists.start.begin());
  lists.number.resize(lists.start[groups]);
  std::vector<int> next(lists.start.begin(), lists.start.end() - 1);
  each([&](int group, int member) { lists.number[next[group]++] = member; });
  return lists;
}

/// The directed ridges that leave each region, chained into one loop of point indices per region.
Lists region_loops(const CoplanarRegions& regions) {
  const ExpandingHull& hull = regions.hull;
  const int count = static_cast<int>(regions.first.size());
  const Lists members = grouped(count, [&](auto use) {
    for (int t = 0; t < static_cast<int>(hull.facets.size()); ++t)
      if (regions.region[t] >= 0) use(regions.region[t], t);
  });
  Lists loops;
  loops.number.reserve(3 * static_cast<size_t>(count));
  loops.start.reserve(count + 1);
  std::vector<int> next(hull.points.size(), -1);
  for (int r = 0; r < count; ++r) {
    cancellation_point();
    if (members[r].size() == 1) {
      const auto& corners = hull.facets[members[r][0]].vertex;
      loops.number.insert(loops.number.end(), corners.begin(), corners.end());
      loops.end();
      continue;
    }
    int first = -1, ridges = 0;
    for (int t : members[r]) {
      cancellation_point();
      const ExpandingHull::Facet& facet = hull.facets[t];
      for (int i = 0; i < 3; ++i) {
        if (regions.region[facet.neighbour[i]] == r) continue;
        next[facet.vertex[i]] = facet.vertex[(i + 1) % 3];
        if (ridges++ == 0) first = facet.vertex[i];
      }
    }
    for (int v = first, chained = 0; chained < ridges; ++chained) {
      loops.number.push_back(v);
      v = next[v];
      if (v == first) break;
    }
    loops.end();
  }
  return loops;
}

std::vector<int> facets_at_points(const Lists& loops, size_t points) {
  std::vector<int> facets_at(points, 0);
  for (int v : loops.number) ++facets_at[v];
  return facets_at;
}

/// True if two regions meet at a sharp edge that bends. They are flat to rounding, so a corner of the edge may be far
/// from the line of its neighbours, but only these two regions meet there.
bool bends_sharp_edges(const CoplanarRegions& regions, const Lists& loops) {
  const std::vector<int> facets_at = facets_at_points(loops, regions.hull.points.size());
  std::vector<int> other(regions.hull.points.size(), -1);  // the first region at a point
  for (int r = 0; r < loops.size(); ++r) {
    cancellation_point();
    const auto loop = loops[r];
    for (size_t i = 0; i < loop.size(); ++i) {
      const int v = loop[i];
      if (facets_at[v] != 2) continue;
      if (other[v] < 0) {
        other[v] = r;
        continue;
      }
      if (dot(regions.normal[regions.first[r]], regions.normal[regions.first[other[v]]]) >= 0) continue;
      const auto point = [&](size_t k) { return regions.hull.points[loop[k % loop.size()]]; };
      const Vec3 before = point(i + loop.size() - 1), along = point(i + 1) - before;
      if (norm(cross(along, point(i) - before)) > 4 * regions.rounding * norm(along)) return true;
    }
  }
  return false;
}

/// A point inside an edge lies on two facets only: it is not a vertex of the solid.
void drop_edge_points(Lists& loops, int points) {
  const std::vector<int> facets_at = facets_at_points(loops, points);
  int kept = 0;
  for (int i = 0, from = 0; i < loops.size(); ++i) {
    cancellation_point();
    const int begin = kept, to = loops.start[i + 1];
    for (; from < to; ++from)
      if (facets_at[loops.number[from]] >= 3) loops.number[kept++] = loops.number[from];
    if (kept - begin < 3) kept = begin;
    loops.start[i + 1] = kept;
  }
  loops.number.resize(kept);
}

/// Newell's normal of a polygon, about its first corner; the offset is that of its outermost corner.
Plane supporting_plane(const std::vector<Vec3>& vertices, std::span<const int> ring) {
  const Vec3 apex = vertices[ring[0]];
  Vec3 normal;
  if (ring.size() == 3) {
    normal = unit(accurate_normal(apex, vertices[ring[1]], vertices[ring[2]]));
  } else {
    // On a slender facet the products of doubles nearly cancel.
    WideVector sum;
    for (size_t i = 1; i + 1 < ring.size(); ++i)
      sum = sum + cross(wide_difference(vertices[ring[i]], apex), wide_difference(vertices[ring[i + 1]], apex));
    normal = unit(rounded(sum));
  }
  double offset = -kInfinity;
  for (int v : ring) offset = std::max(offset, dot(normal, vertices[v]));
  return {normal, offset};
}

/// The corners of the largest triangle of each region, unless only rounding has merged other triangles into the region.
std::vector<std::array<int, 3>> exact_corners(const CoplanarRegions& regions) {
  const ExpandingHull& hull = regions.hull;
  std::vector<std::array<int, 3>> corners;
  for (int t : regions.first) corners.push_back(hull.facets[t].vertex);
  for (int t = 0; t < static_cast<int>(hull.facets.size()); ++t) {
    if (hull.facets[t].removed() || regions.first[regions.region[t]] == t) continue;
    cancellation_point();
    std::array<int, 3>& corner = corners[regions.region[t]];
    if (corner[0] < 0) continue;
    const auto [a, b, c] = corner;
    for (int v : hull.facets[t].vertex)
      if (orientation(hull.points[a], hull.points[b], hull.points[c], hull.points[v]) != 0) corner = {-1, -1, -1};
  }
  return corners;
}

HullData hull_data(const CoplanarRegions& regions, const Lists& loops, Vec3 origin, std::vector<int>* source) {
  const ExpandingHull& hull = regions.hull;
  HullData data;
  data.origin = origin;
  std::vector<int> index(hull.points.size(), -1);
  data.ring.reserve(loops.number.size());
  data.ring_start.reserve(loops.start.size());
  for (int i = 0; i < loops.size(); ++i) {
    cancellation_point();
    if (loops[i].empty()) continue;
    for (int p : loops[i]) {
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
    cancellation_point();
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
  data.facet_corners.reserve(data.ring_start.size() - 1), data.planes.reserve(data.ring_start.size() - 1);
  for (int r = 0; r < loops.size(); ++r) {
    if (loops[r].empty()) continue;
    cancellation_point();
    const auto& [a, b, c] = exact[r];
    data.facet_corners.push_back(a < 0 ? exact[r] : std::array{corner[a], corner[b], corner[c]});
    data.planes.push_back(supporting_plane(data.vertices, data.facet(static_cast<int>(data.planes.size()))));
  }
  return data;
}

/// `across[i]` becomes the facet beside the facet of ring[i], across the edge that begins there; -1 if there are no
/// edges.
std::vector<Edge> edges_of(const HullData& data, std::vector<int>& across) {
  across.assign(data.ring.size(), -1);
  struct Side {
    int from, to, facet, number;
  };
  const auto ends = [](const Side& s) { return std::minmax(s.from, s.to); };
  std::vector<Side> sides(data.ring.size());
  // Counting sort by the lower end of each edge; then by the other end, with few edges for each lower end.
  std::vector<int> starts(data.vertices.size() + 1, 0);
  const auto for_each_side = [&](auto use) {
    for (int f = 0, number = 0; f < static_cast<int>(data.planes.size()); ++f) {
      cancellation_point();
      const auto ring = data.facet(f);
      for (size_t i = 0; i < ring.size(); ++i) use(Side{ring[i], ring[(i + 1) % ring.size()], f, number++});
    }
  };
  for_each_side([&](const Side& s) { ++starts[ends(s).first + 1]; });
  for (size_t v = 1; v < starts.size(); ++v) starts[v] += starts[v - 1];
  for_each_side([&](const Side& s) { sides[starts[ends(s).first]++] = s; });
  // Each start has moved on to the next start.
  for (size_t v = 0, begin = 0; v < data.vertices.size(); begin = starts[v++]) {
    cancellation_point();
    std::sort(sides.begin() + begin, sides.begin() + starts[v], [&](const Side& a, const Side& b) {
      return std::pair(ends(a).second, a.number) < std::pair(ends(b).second, b.number);
    });
  }
  std::vector<Edge> edges;
  edges.reserve(sides.size() / 2);
  for (size_t i = 0; i < sides.size(); i += 2) {
    const bool paired = i + 1 < sides.size() && sides[i].from == sides[i + 1].to && sides[i].to == sides[i + 1].from;
    if (!paired || (i + 2 < sides.size() && ends(sides[i + 2]) == ends(sides[i]))) return {};
    edges.push_back({sides[i].from, sides[i].to, sides[i].facet, sides[i + 1].facet});
  }
  for (size_t i = 0; i < sides.size(); i += 2)
    across[sides[i].number] = sides[i + 1].facet, across[sides[i + 1].number] = sides[i].facet;
  return edges;
}

/// Three of the facets around a vertex: the first facet, the facet at the largest angle to it, and the facet that spans
/// most with these two.
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

double rise_beside(const HullData& data, const Plane& across, std::span<const int> ring, size_t edge, double rounding) {
  const size_t corners = ring.size();
  double highest = 0;
  const auto falls_away = [&](size_t place) {
    const double height = signed_distance(across, data.vertices[ring[place % corners]]);
    highest = std::max(highest, height);
    return height < -rounding;
  };
  size_t walked = 0;
  while (walked < corners && !falls_away(edge + 1 + walked)) ++walked;
  for (size_t back = 0; back < corners && !falls_away(edge + corners - back); ++back) continue;
  return highest;
}

namespace {

/// The largest rise_beside() over all edges.
double rise_over_edges(const HullData& data, std::span<const int> across, double rounding) {
  double highest = 0;
  for (int f = 0; f < static_cast<int>(data.planes.size()); ++f) {
    cancellation_point();
    const auto ring = data.facet(f);
    for (size_t i = 0; i < ring.size(); ++i)
      if (const int beside = across[data.ring_start[f] + i]; beside >= 0)
        highest = std::max(highest, rise_beside(data, data.planes[beside], ring, i, rounding));
  }
  return highest;
}

}  // namespace

void complete(HullData& data) {
  std::vector<int> across;
  data.edges = edges_of(data, across);
  const int vertices = static_cast<int>(data.vertices.size());
  const Lists around = grouped(vertices, [&](auto use) {
    for (int f = 0; f < static_cast<int>(data.planes.size()); ++f)
      for (int v : data.facet(f)) use(v, f);
  });
  for (int f = 0; f < static_cast<int>(data.planes.size()); ++f) {
    cancellation_point();
    for (int v : data.facet(f))
      data.flatness = std::max(data.flatness, -signed_distance(data.planes[f], data.vertices[v]));
  }
  data.facets_meet.reserve(vertices);
  for (int v = 0; v < vertices; ++v) {
    cancellation_point();
    data.facets_meet.push_back(well_spread(around[v], data.planes));
  }
  for (Vec3 v : data.vertices) data.radius = std::max(data.radius, norm(v));
  const double rounding = 256 * DBL_EPSILON * data.radius + 4 * data.flatness;
  data.flatness = std::max(data.flatness, rise_over_edges(data, across, rounding));
}

namespace {

/// The hull of a surface of triangles about `origin`, with coplanar triangles merged; null if it has no interior.
std::shared_ptr<HullData> merged(const ExpandingHull& hull, Vec3 origin, std::vector<int>* source) {
  double extent = 0;
  for (const ExpandingHull::Facet& facet : hull.facets)
    if (!facet.removed())
      for (int v : facet.vertex) extent = std::max(extent, max_component(abs(hull.points[v])));
  // Corners that a user computes as centre plus rotated half extents have a few roundings each, relative to the extent.
  // A plane through three corners misses a fourth by up to about eight roundings.
  const double rounding = 16 * DBL_EPSILON * extent;
  std::optional<CoplanarRegions> regions(merge_coplanar(hull, rounding));
  Lists loops = region_loops(*regions);
  if (bends_sharp_edges(*regions, loops)) {
    regions.emplace(merge_coplanar(hull, 0));
    loops = region_loops(*regions);
  }
  drop_edge_points(loops, static_cast<int>(hull.points.size()));
  auto data = std::make_shared<HullData>(hull_data(*regions, loops, origin, source));
  if (data->planes.size() < 4) return nullptr;
  const HullMeasures measures = measure(*data);
  data->volume = measures.volume;
  data->centroid = measures.centroid;
  complete(*data);
  // A solid thinner than the rounding of its corners counts as flat.
  if (!(data->volume > rounding * measures.area / 2)) return nullptr;
  return data;
}

Vec3 origin_of(std::span<const Vec3> points) {
  Vec3 lower = points[0], upper = points[0];
  for (Vec3 p : points) lower = min(lower, p), upper = max(upper, p);
  return lossless_origin(lower, upper);
}

}  // namespace

std::shared_ptr<HullData> hull_of(std::span<const Vec3> points, std::vector<int>* source) {
  const Vec3 origin = origin_of(points);
  ExpandingHull hull;
  hull.points.reserve(points.size());
  for (Vec3 p : points) hull.points.push_back(p - origin);
  return hull.build() ? merged(hull, origin, source) : nullptr;
}

std::shared_ptr<HullData> hull_of_surface(Vec3 origin, std::span<const Vec3> corners,
                                          std::span<const std::array<int, 3>> triangles) {
  constexpr const char* kNoHull = "state must be that of a hull";
  require(corners.size() >= 4 && triangles.size() >= 4, kNoHull);
  ExpandingHull hull;
  std::vector<Vec3> points;
  for (Vec3 p : corners) {
    require(finite(p) && finite(p + origin) && max_component(abs(p + origin)) < kLargest, kNoHull);
    hull.points.push_back(p);
    points.push_back(p + origin);
  }
  for (const auto& triangle : triangles)
    for (int corner : triangle) require(corner >= 0 && corner < static_cast<int>(corners.size()), kNoHull);
  require(origin_of(points) == origin && hull.assemble(triangles), kNoHull);
  auto data = merged(hull, origin, nullptr);
  require(data != nullptr, kNoHull);
  data->graph = graph_of(*data);
  return data;
}

std::shared_ptr<HullData> hull_of_vertices(std::span<const Vec3> points) {
  require(points.size() >= 4,
          [&] { return "vertices must hold at least four points, not " + std::to_string(points.size()); });
  for (Vec3 p : points) require(finite(p), "vertices must be finite");
  Vec3 lower = points[0], upper = points[0];
  for (Vec3 p : points) lower = min(lower, p), upper = max(upper, p);
  require(max_component(max(-lower, upper)) < kLargest, "vertices must be closer to the origin than 1e25 m");
  const double span = max_component(upper - lower);
  require(span == 0 || span > kSmallest, "vertices must span more than 1e-25 m");
  auto data = hull_of(points);
  require(data != nullptr, "vertices are flat: they all lie in one plane");
  data->graph = graph_of(*data);
  return data;
}

void append_core_surface(const HullData& hull, const std::vector<char>& kept, CoreSurface& surface) {
  struct Side {
    int from, to, facet;
  };
  std::vector<Side> sides;
  for (const auto& triangle : hull.triangles) {
    if (!(kept[triangle[0]] || kept[triangle[1]] || kept[triangle[2]])) continue;
    for (int i = 0; i < 3; ++i) {
      const auto [from, to] = std::minmax(triangle[i], triangle[(i + 1) % 3]);
      if (kept[from] || kept[to]) sides.push_back({from, to, static_cast<int>(surface.facets.size())});
    }
    surface.facets.push_back(triangle);
  }
  // Two triangles run along every ridge.
  std::ranges::sort(sides, {}, [](const Side& s) { return std::pair(s.from, s.to); });
  for (size_t i = 0; i + 1 < sides.size(); i += 2)
    surface.ridges.push_back({sides[i].from, sides[i].to, sides[i].facet, sides[i + 1].facet});
}

std::partial_ordering order_of(const HullData& a, const HullData& b) {
  if (&a == &b) return std::partial_ordering::equivalent;
  if (const auto by_volume = a.volume <=> b.volume; by_volume != 0) return by_volume;
  if (const auto by_origin = order_of(a.origin, b.origin); by_origin != 0) return by_origin;
  const auto &p = a.corners, &q = b.corners;
  const auto by_corners = std::lexicographical_compare_three_way(p.begin(), p.end(), q.begin(), q.end(),
                                                                 [](Vec3 u, Vec3 v) { return order_of(u, v); });
  // Interior points change only the order of facets.
  return by_corners != 0 ? by_corners : a.triangles <=> b.triangles;
}

HullMeasures measure(const HullData& hull) {
  Vec3 inside;
  for (Vec3 v : hull.vertices) inside += v / static_cast<double>(hull.vertices.size());
  SumInPairs<double> volume, area;
  SumInPairs<Vec3> moment;
  for (int f = 0; f + 1 < static_cast<int>(hull.ring_start.size()); ++f) {
    const auto ring = hull.facet(f);
    const Vec3 a = hull.vertices[ring[0]] - inside;
    for (size_t i = 1; i + 1 < ring.size(); ++i) {
      const Vec3 b = hull.vertices[ring[i]] - inside, c = hull.vertices[ring[i + 1]] - inside;
      const double tetrahedron = dot(a, cross(b, c)) / 6;
      volume.add(tetrahedron);
      area.add(norm(cross(b - a, c - a)) / 2);
      moment.add(tetrahedron / 4 * (a + b + c));
    }
  }
  return {volume.total(), area.total(), inside + moment.total() / volume.total()};
}

}  // namespace overlapper
