#include "shapes/hull_graph.h"

#include <limits>

#include "geometry/thresholds.h"
#include "shapes/shape.h"

namespace overlapper {
namespace {

/// Rounding of a dot product of vectors whose lengths have that product: two that differ by less may be equal.
double rounding_of_dot(double lengths) { return 16 * 0x1p-53 * lengths; }

/// Elements already looked at in one flood; one per thread, and forgotten by counting up.
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

/// An element higher than the plateau around `top`, all of whose elements lie within `slack` of it; -1 if none borders
/// on it. Where edges have no length or many facets share a plane, neighbours differ by rounding only, and what climbs
/// would stop at the first of them.
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

template <class Value, class Neighbours>
int climb(int start, double slack, int elements, Value value, Neighbours neighbours, double& height) {
  int top = start;
  height = value(top);
  while (true) {
    int higher = -1;
    bool level = false;
    const double here = height;
    neighbours(top, [&](int other) {
      const double v = value(other);
      if (v > height) height = v, higher = other;
      level |= v >= here - slack;
    });
    if (higher < 0 && level) {
      higher = above_plateau(top, height, slack, elements, value, neighbours);
      if (higher >= 0) height = value(higher);
    }
    if (higher < 0) return top;
    top = higher;
  }
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

/// Twins by matching what leaves a vertex with what arrives there; false unless each half-edge has exactly one.
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
  std::vector<int> filled(graph.around_start.begin(), graph.around_start.end() - 1), leaving(edges);
  graph.around.resize(edges);
  for (int h = 0; h < edges; ++h) {
    const int slot = filled[hull.ring[h]]++;
    graph.around[slot] = hull.ring[graph.next[h]];
    leaving[slot] = h;
  }
  graph.twin.assign(edges, -1);
  graph.beside.resize(edges);
  graph.leaving.assign(vertices, -1);
  for (int h = 0; h < edges; ++h) {
    const int from = hull.ring[h], to = hull.ring[graph.next[h]];
    graph.leaving[from] = h;
    for (int i = graph.around_start[to]; i < graph.around_start[to + 1]; ++i) {
      if (graph.around[i] != from) continue;
      if (graph.twin[h] >= 0) return false;
      graph.twin[h] = leaving[i];
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
    const Plane& plane = hull.planes[graph.facet[h]];
    for (int v : hull.facet(graph.beside[h]))
      if (signed_distance(plane, hull.vertices[v]) > rounding) return false;
  }
  return true;
}

void fill_maps(const HullData& hull, HullGraph& graph) {
  const int vertices = static_cast<int>(hull.vertices.size()), facets = static_cast<int>(hull.planes.size());
  if (vertices > kMostScanned) {
    DirectionMap map(vertices);
    int v = 0;
    for (int cell = 0; cell < map.cells(); ++cell) map.set(cell, v = graph.farthest_vertex(hull, map.centre(cell), v));
    graph.vertex_near = std::move(map);
  }
  if (facets > kMostScanned) {
    DirectionMap map(facets);
    int f = 0;
    double gauge;
    for (int cell = 0; cell < map.cells(); ++cell)
      map.set(cell, f = graph.facet_towards(hull, hull.centroid + map.centre(cell), gauge, f));
    graph.facet_near = std::move(map);
  }
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
  const double size = circumradius * std::sqrt(norm2(direction));
  double height;
  // About the centroid, where coordinates are as small as they get.
  return climb(
      start, rounding_of_dot(size), static_cast<int>(hull.vertices.size()),
      [&](int v) { return dot(hull.vertices[v] - hull.centroid, direction); }, vertex_neighbours(*this), height);
}

int HullGraph::facet_towards(const HullData& hull, Vec3 point, double& gauge) const {
  const int facets = static_cast<int>(dual.size());
  const Vec3 from_centroid = point - hull.centroid;
  if (facets > kMostScanned) return facet_towards(hull, point, gauge, facet_near.near(from_centroid));
  return scan(facets, [&](int f) { return dot(dual[f], from_centroid); }, gauge);
}

int HullGraph::facet_towards(const HullData& hull, Vec3 point, double& gauge, int start) const {
  const Vec3 from_centroid = point - hull.centroid;
  const double size = std::sqrt(norm2(from_centroid)) / inradius;
  return climb(
      start, rounding_of_dot(size), static_cast<int>(dual.size()), [&](int f) { return dot(dual[f], from_centroid); },
      facet_neighbours(*this, hull), gauge);
}

int HullGraph::ray_exit(const HullData& hull, Vec3 origin, Vec3 direction, double& rate) const {
  if (static_cast<int>(dual.size()) <= kMostScanned) return ray_exit(hull, origin, direction, rate, 0);
  // Where the ray leaves the ball around the hull is near where it leaves the hull, if that is round.
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
  const int first = climb(start, 0, facets, value, facet_neighbours(*this, hull), rate);
  // Rates near that of the exit have slacks that are rounded alike.
  const double slack = -signed_distance(hull.planes[first], origin);
  const double rounding =
      rounding_of_dot(circumradius + norm(origin - hull.centroid)) / std::max(slack, inradius * 0x1p-40);
  return climb(first, rate * rounding, facets, value, facet_neighbours(*this, hull), rate);
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
  fill_maps(hull, *graph);
  return graph;
}

}  // namespace overlapper
