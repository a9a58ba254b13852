#include "shapes/hull_graph.h"

#include <algorithm>
#include <limits>

#include "geometry/cancellation.h"
#include "geometry/thresholds.h"
#include "shapes/hull_data.h"

namespace overlapper {
namespace {

/// Rounding error of a dot product; `lengths` is the product of the vectors' lengths. Two values closer than this may
/// be equal.
double rounding_of_dot(double lengths) { return 16 * 0x1p-53 * lengths; }

/// Elements already visited in one flood fill; one object per thread, cleared by counting up.
class Marks {
 public:
  void begin(int elements) {
    if (static_cast<int>(mark_.size()) < elements) mark_.resize(elements, 0);
    if (++now_ == std::numeric_limits<int>::max()) {
      std::fill(mark_.begin(), mark_.end(), 0);
      now_ = 1;
    }
  }
  bool first_time(int element) {
    if (mark_[element] == now_) return false;
    mark_[element] = now_;
    return true;
  }

 private:
  std::vector<int> mark_;
  int now_ = 0;
};

thread_local Marks flooded;
thread_local std::vector<int> plateau;

/// An element higher than the plateau around `top`, or -1 if none borders on the plateau. All elements of the plateau
/// are within `slack` of `top`. Where edges have no length or many facets share a plane, neighbours differ only by
/// rounding, and a climb would stop at the first of them.
template <class Value, class Neighbours>
int above_plateau(int top, double height, double slack, int elements, Value value, Neighbours neighbours) {
  flooded.begin(elements);
  flooded.first_time(top);
  plateau.assign(1, top);
  int found = -1;
  for (size_t i = 0; i < plateau.size() && found < 0; ++i)
    neighbours(plateau[i], [&](int other) {
      if (found >= 0 || !flooded.first_time(other)) return;
      const double v = value(other);
      if (v > height) found = other;
      if (v >= height - slack) plateau.push_back(other);
    });
  return found;
}

/// The place of the largest of values around a ring. The values rise to it from both sides, as a linear function does
/// around a convex polygon. Starts with a few corners, and then halves the step around the best one.
template <class Value>
int peak_of_ring(int size, Value value) {
  int stride = 1;
  while (8 * stride <= size) stride *= 2;
  int peak = 0;
  double highest = value(0);
  const auto look_at = [&](int place) {
    const double v = value(place);
    if (v > highest) highest = v, peak = place;
  };
  for (int place = stride; place < size; place += stride) look_at(place);
  while (stride > 1) {
    stride /= 2;
    const int middle = peak;
    if (middle + stride < size) look_at(middle + stride);
    look_at(middle > 0 ? middle - stride : (size - 1) / stride * stride);
  }
  return peak;
}

/// The neighbour of a fan with the steepest slope, by `slope(place)`; -1 without a fan.
template <class Slope>
int steepest(const std::vector<NeighbourFan>& fans, const std::vector<int>& fan_of, int element, Slope slope) {
  if (fan_of.empty() || fan_of[element] < 0) return -1;
  const NeighbourFan& fan = fans[fan_of[element]];
  return fan.neighbour[peak_of_ring(static_cast<int>(fan.neighbour.size()),
                                    [&](int place) { return slope(fan.neighbour[place]) * fan.inverse[place]; })];
}

/// After so many steps, a climb continues in a tree, if there is one.
constexpr int kStepsOfClimb = 2;
/// Up to so many steps between neighbouring cells of a map, a tree does not pay.
constexpr int kUsualSteps = 8;

/// `shortcut(top, height)` is the only neighbour to examine, or -1 for all. `leap(top, height)` is a higher element
/// anywhere, or `top`. `steps` is counted up.
template <class Value, class Neighbours, class Shortcut, class Leap>
int climb(int start, double slack, int elements, Value value, Neighbours neighbours, Shortcut shortcut, Leap leap,
          double& height, int& steps) {
  int top = start;
  height = value(top);
  for (int left = kStepsOfClimb;; --left) {
    if (left == 0) {
      top = leap(top, height);
      height = value(top);
    }
    int higher = -1;
    bool level = false;
    const double here = height;
    const auto visit = [&](int other) {
      const double v = value(other);
      if (v > height) height = v, higher = other;
      level |= v >= here - slack;
    };
    const int only = shortcut(top, here);
    if (only >= 0) visit(only);
    else neighbours(top, visit);
    if (higher < 0 && level) {
      higher = above_plateau(top, height, slack, elements, value, neighbours);
      if (higher >= 0) height = value(higher);
    }
    if (higher < 0) return top;
    top = higher;
    ++steps;
  }
}

/// The leap of climb() by a tree; better elements lie beyond the plane `aim(height)`.
template <class Aim, class Value>
auto leap_in(const PointTree& tree, Aim aim, Value value) {
  return
      [&tree, aim, value](int top, double height) { return tree.empty() ? top : tree.better(top, height, aim, value); };
}

template <class Value>
int scan(int elements, Value value, double& height) {
  int top = 0;
  height = value(0);
  for (int i = 1; i < elements; ++i) {
    const double v = value(i);
    if (v > height) height = v, top = i;
  }
  return top;
}

auto vertex_neighbours(const HullGraph& graph) {
  return [&graph](int v, auto visit) {
    for (int i = graph.around_start[v]; i < graph.around_start[v + 1]; ++i) visit(graph.around[i]);
  };
}

auto facet_neighbours(const HullGraph& graph, const HullData& hull) {
  return [&graph, &hull](int f, auto visit) {
    for (int h = hull.ring_start[f]; h < hull.ring_start[f + 1]; ++h) visit(graph.beside[h]);
  };
}

/// How much sooner the ray leaves through a neighbour of facet `f` than through `f`. The origin is any interior point;
/// `rate` is 1 / the length of the ray up to the plane of `f`.
auto facet_slope(const HullData& hull, Vec3 origin, Vec3 direction, double rate) {
  return [&hull, origin, direction, rate](int other) {
    const Plane& plane = hull.planes[other];
    return dot(plane.normal, direction) + rate * signed_distance(plane, origin);
  };
}

/// Finds twins by matching the half-edges that leave a vertex with those that arrive; false unless each half-edge has
/// exactly one.
bool link(const HullData& hull, HullGraph& graph) {
  const int edges = static_cast<int>(hull.ring.size()), vertices = static_cast<int>(hull.vertices.size());
  graph.next.resize(edges);
  graph.facet.resize(edges);
  graph.around_start.assign(vertices + 1, 0);
  for (int f = 0; f + 1 < static_cast<int>(hull.ring_start.size()); ++f)
    for (int h = hull.ring_start[f]; h < hull.ring_start[f + 1]; ++h) {
      graph.next[h] = h + 1 < hull.ring_start[f + 1] ? h + 1 : hull.ring_start[f];
      graph.facet[h] = f;
      ++graph.around_start[hull.ring[h] + 1];
    }
  for (int v = 0; v < vertices; ++v) graph.around_start[v + 1] += graph.around_start[v];
  // As many half-edges arrive at a vertex as leave it.
  std::vector<int> filled(graph.around_start.begin(), graph.around_start.end() - 1), met = filled;
  std::vector<int> leaving(edges), arriving(edges);
  graph.around.resize(edges);
  for (int h = 0; h < edges; ++h) {
    const int slot = filled[hull.ring[h]]++;
    graph.around[slot] = hull.ring[graph.next[h]];
    leaving[slot] = h;
    arriving[met[graph.around[slot]]++] = h;
  }
  graph.twin.assign(edges, -1);
  graph.beside.resize(edges);
  graph.leaving.assign(vertices, -1);
  for (int h = 0; h < edges; ++h) {
    cancellation_point();
    const int from = hull.ring[h], to = hull.ring[graph.next[h]];
    graph.leaving[from] = h;
    // For each edge, take the smaller degree of its two ends. In a planar graph, the sum over all edges is proportional
    // to their number (Chiba and Nishizeki 1985).
    const int *start = graph.around_start.data(), degree = start[to + 1] - start[to];
    const bool from_smaller = start[from + 1] - start[from] < degree;
    const int end = from_smaller ? from : to;
    for (int i = start[end]; i < start[end + 1]; ++i) {
      const int other = from_smaller ? arriving[i] : leaving[i];
      if (from_smaller ? hull.ring[other] != to : graph.around[i] != from) continue;
      if (graph.twin[h] >= 0) return false;
      graph.twin[h] = other;
    }
    if (graph.twin[h] < 0) return false;
    graph.beside[h] = graph.facet[graph.twin[h]];
  }
  for (int v = 0; v < vertices; ++v)
    if (graph.leaving[v] < 0) return false;
  return vertices - edges / 2 + static_cast<int>(hull.planes.size()) == 2;
}

/// True if no facet rises above the one beside it by more than `rounding`.
bool convex(const HullData& hull, const HullGraph& graph, double rounding) {
  for (int h = 0; h < static_cast<int>(hull.ring.size()); ++h) {
    cancellation_point();
    const int other = graph.beside[h];
    const size_t edge = graph.twin[h] - hull.ring_start[other];
    if (rise_beside(hull, hull.planes[graph.facet[h]], hull.facet(other), edge, rounding) > rounding) return false;
  }
  return true;
}

/// Adds the fan of an element, unless a neighbour is not farther inwards by more than rounding.
void add_fan(std::vector<NeighbourFan>& fans, std::vector<int>& fan_of, size_t elements, NeighbourFan fan) {
  if (!std::ranges::all_of(fan.inverse, [](double each) { return each > 0 && std::isfinite(each); })) return;
  fan_of.resize(elements, -1);
  fan_of[fan.element] = static_cast<int>(fans.size());
  fans.push_back(std::move(fan));
}

void make_fans(const HullData& hull, HullGraph& graph) {
  for (int v = 0; v < static_cast<int>(hull.vertices.size()); ++v) {
    if (graph.around_start[v + 1] - graph.around_start[v] <= kMostScanned) continue;
    NeighbourFan fan{v, {}, {}};
    Vec3 outside;
    int h = graph.leaving[v];
    do {
      fan.neighbour.push_back(hull.ring[graph.next[h]]);
      outside += hull.planes[graph.facet[h]].normal;
      h = graph.next[graph.twin[h]];
    } while (h != graph.leaving[v]);
    for (int u : fan.neighbour) fan.inverse.push_back(-1 / dot(outside, hull.vertices[u] - hull.vertices[v]));
    add_fan(graph.vertex_fans, graph.fan_of_vertex, hull.vertices.size(), std::move(fan));
  }
  for (int f = 0; f < static_cast<int>(hull.planes.size()); ++f) {
    const auto ring = hull.facet(f);
    if (ring.size() <= kMostScanned) continue;
    NeighbourFan fan{f, {graph.beside.begin() + hull.ring_start[f], graph.beside.begin() + hull.ring_start[f + 1]}, {}};
    // Seen from a point on the facet, the polar dual of the others is the polygon.
    Vec3 middle;
    for (int v : ring) middle += hull.vertices[v] / static_cast<double>(ring.size());
    for (int g : fan.neighbour) fan.inverse.push_back(-1 / signed_distance(hull.planes[g], middle));
    add_fan(graph.facet_fans, graph.fan_of_facet, hull.planes.size(), std::move(fan));
  }
}

int farthest_vertex_from(const HullData& hull, const HullGraph& graph, Vec3 direction, int start, int& steps) {
  const double size = graph.circumradius * std::sqrt(norm2(direction));
  // About the centroid, where coordinates are smallest.
  const auto value = [&](int v) { return dot(hull.vertices[v] - hull.centroid, direction); };
  const auto shortcut = [&](int top, double) {
    return steepest(graph.vertex_fans, graph.fan_of_vertex, top,
                    [&](int v) { return dot(hull.vertices[v] - hull.vertices[top], direction); });
  };
  const auto aim = [&](double height) { return PointTree::Beyond{direction, height}; };
  double height;
  return climb(start, rounding_of_dot(size), static_cast<int>(hull.vertices.size()), value, vertex_neighbours(graph),
               shortcut, leap_in(graph.vertex_tree, aim, value), height, steps);
}

int facet_towards_from(const HullData& hull, const HullGraph& graph, Vec3 from_centroid, double& gauge, int start,
                       int& steps) {
  const double size = std::sqrt(norm2(from_centroid)) / graph.inradius;
  const auto value = [&](int f) { return dot(graph.dual[f], from_centroid); };
  const auto shortcut = [&](int top, double here) {
    return steepest(graph.facet_fans, graph.fan_of_facet, top, facet_slope(hull, hull.centroid, from_centroid, here));
  };
  const auto aim = [&](double height) { return PointTree::Beyond{from_centroid, height}; };
  return climb(start, rounding_of_dot(size), static_cast<int>(graph.dual.size()), value, facet_neighbours(graph, hull),
               shortcut, leap_in(graph.facet_tree, aim, value), gauge, steps);
}

/// The map for so many elements by `nearest(direction, start, steps)`. Calls `plant()` once climbs between cells are
/// long.
template <class Nearest, class Plant>
DirectionMap filled(int elements, Nearest nearest, Plant plant) {
  const auto fill = [&](DirectionMap& map, double allowed) {
    int element = 0;
    for (int cell = 0; cell < map.cells(); ++cell) {
      cancellation_point();
      int steps = 0;
      map.set(cell, element = nearest(map.centre(cell), element, steps));
      allowed += kUsualSteps - steps;
      if (allowed < 0) return false;
    }
    return true;
  };
  DirectionMap map(elements);
  // Allows the steps to the first cell, and from the end of a row of cells to the next, on a body that is not slender.
  if (fill(map, 4 * std::sqrt(elements))) return map;
  plant();
  map = DirectionMap(elements / 16);
  fill(map, std::numeric_limits<double>::infinity());
  return map;
}

void fill_maps(const HullData& hull, HullGraph& graph) {
  const int vertices = static_cast<int>(hull.vertices.size()), facets = static_cast<int>(hull.planes.size());
  if (vertices > kMostScanned)
    graph.vertex_near = filled(
        vertices,
        [&](Vec3 direction, int start, int& steps) {
          return farthest_vertex_from(hull, graph, direction, start, steps);
        },
        [&] {
          std::vector<Vec3> points;
          for (Vec3 v : hull.vertices) points.push_back(v - hull.centroid);
          graph.vertex_tree = PointTree(points);
        });
  if (facets > kMostScanned)
    graph.facet_near = filled(
        facets,
        [&](Vec3 direction, int start, int& steps) {
          double gauge;
          return facet_towards_from(hull, graph, direction, gauge, start, steps);
        },
        [&] { graph.facet_tree = PointTree(graph.dual); });
}

}  // namespace

DirectionMap::DirectionMap(int elements)
    : side_(std::max(1, static_cast<int>(std::sqrt(elements / 12.0)))), nearest_(6 * side_ * side_, 0) {}

int DirectionMap::cell(Vec3 d) const {
  const Vec3 size = abs(d);
  const int major = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  const double along = d[major];
  const double u = major == 0 ? d.y : d.x, v = major == 2 ? d.y : d.z;
  const double scale = std::abs(along) > 0 ? 0.5 * side_ / std::abs(along) : 0;
  const auto index = [&](double w) {
    const double place = w * scale + 0.5 * side_;
    return place < side_ - 1 ? static_cast<int>(place) : side_ - 1;
  };
  return ((2 * major + (along < 0)) * side_ + index(u)) * side_ + index(v);
}

Vec3 DirectionMap::centre(int cell) const {
  const auto middle = [&](int i) { return (2 * i + 1.0) / side_ - 1; };
  const double v = middle(cell % side_), u = middle(cell / side_ % side_);
  const int face = cell / (side_ * side_);
  const double along = face % 2 == 0 ? 1 : -1;
  if (face / 2 == 0) return {along, u, v};
  if (face / 2 == 1) return {u, along, v};
  return {u, v, along};
}

int HullGraph::farthest_vertex(const HullData& hull, Vec3 direction) const {
  const int vertices = static_cast<int>(hull.vertices.size());
  if (vertices > kMostScanned) return farthest_vertex(hull, direction, vertex_near.near(direction));
  double height;
  return scan(vertices, [&](int v) { return dot(hull.vertices[v], direction); }, height);
}

int HullGraph::farthest_vertex(const HullData& hull, Vec3 direction, int start) const {
  int steps = 0;
  return farthest_vertex_from(hull, *this, direction, start, steps);
}

int HullGraph::facet_towards(const HullData& hull, Vec3 point, double& gauge) const {
  const int facets = static_cast<int>(dual.size());
  const Vec3 from_centroid = point - hull.centroid;
  if (facets > kMostScanned) return facet_towards(hull, point, gauge, facet_near.near(from_centroid));
  return scan(facets, [&](int f) { return dot(dual[f], from_centroid); }, gauge);
}

int HullGraph::facet_towards(const HullData& hull, Vec3 point, double& gauge, int start) const {
  int steps = 0;
  return facet_towards_from(hull, *this, point - hull.centroid, gauge, start, steps);
}

int HullGraph::ray_exit(const HullData& hull, Vec3 origin, Vec3 direction, double& rate) const {
  if (static_cast<int>(dual.size()) <= kMostScanned) return ray_exit(hull, origin, direction, rate, 0);
  // If the hull is nearly round, the ray leaves the hull near its exit from the ball around the hull.
  const Vec3 from_centroid = origin - hull.centroid;
  const double along = dot(from_centroid, direction), length2 = norm2(direction);
  const double inside = std::max(0.0, circumradius * circumradius - norm2(from_centroid));
  const double t = (std::sqrt(along * along + length2 * inside) - along) / length2;
  return ray_exit(hull, origin, direction, rate, facet_near.near(from_centroid + t * direction));
}

int HullGraph::ray_exit(const HullData& hull, Vec3 origin, Vec3 direction, double& rate, int start) const {
  const auto value = [&](int f) {
    const Plane& plane = hull.planes[f];
    return dot(plane.normal, direction) / std::max(-signed_distance(plane, origin), std::numeric_limits<double>::min());
  };
  const int facets = static_cast<int>(dual.size());
  if (facets <= kMostScanned) return scan(facets, value, rate);
  const auto shortcut = [&](int top, double here) {
    return steepest(facet_fans, fan_of_facet, top, facet_slope(hull, origin, direction, here));
  };
  // In the polar dual about the centroid, rates above one are points beyond a plane, too.
  const Vec3 from_centroid = origin - hull.centroid;
  const auto aim = [&](double above) { return PointTree::Beyond{direction + above * from_centroid, above}; };
  const auto leap = leap_in(facet_tree, aim, value);
  int steps = 0;
  const int first = climb(start, 0, facets, value, facet_neighbours(*this, hull), shortcut, leap, rate, steps);
  // Near the rate of the exit, slacks have similar rounding.
  const double slack = -signed_distance(hull.planes[first], origin);
  const double rounding = rounding_of_dot(circumradius + norm(from_centroid)) / std::max(slack, inradius * 0x1p-40);
  return climb(first, rate * rounding, facets, value, facet_neighbours(*this, hull), shortcut, leap, rate, steps);
}

std::shared_ptr<const HullGraph> graph_of(const HullData& hull) {
  auto graph = std::make_shared<HullGraph>();
  if (!link(hull, *graph)) return nullptr;
  double extent = 0;
  for (Vec3 v : hull.vertices) {
    extent = std::max(extent, max_component(abs(v)));
    graph->circumradius = std::max(graph->circumradius, norm(v - hull.centroid));
  }
  graph->triangular = hull.triangles.size() == hull.planes.size();
  // Merged facets are flat to 32 half-ulps of the extent, and so is their neighbours' common edge.
  if (!convex(hull, *graph, 128 * 0x1p-53 * extent)) return nullptr;
  graph->inradius = std::numeric_limits<double>::infinity();
  for (const Plane& plane : hull.planes) {
    const double slack = -signed_distance(plane, hull.centroid);
    if (!(slack > 0)) return nullptr;
    graph->inradius = std::min(graph->inradius, slack);
    graph->dual.push_back(plane.normal / slack);
  }
  make_fans(hull, *graph);
  fill_maps(hull, *graph);
  return graph;
}

}  // namespace overlapper
