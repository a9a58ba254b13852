#include "overlap/boundary.h"

#include <limits>
#include <numeric>
#include <utility>

#include "geometry/cancellation.h"
#include "geometry/ridges.h"
#include "geometry/sum_in_pairs.h"
#include "overlap/plane_tree.h"

namespace overlapper {
namespace {

/// Closed loops of vertices around each connected part of the surface of `owner`, counter-clockwise from outside.
void walk_around_patches(const Polytope& polytope, std::span<const Region::Facet> facets, const Ridges& ridges,
                         int owner, std::vector<std::vector<int>>& loops) {
  const auto mine = [&](int facet) { return facets[facet].owner == owner; };
  std::vector<std::pair<int, int>> border;
  for (int f = 0; f < polytope.facets(); ++f) {
    cancellation_point();
    if (!mine(f)) continue;
    const auto ring = polytope.facet(f);
    for (size_t i = 0; i < ring.size(); ++i) {
      const int from = ring[i], to = ring[(i + 1) % ring.size()];
      if (!mine(ridges.left_of(to, from))) border.push_back({from, to});
    }
  }
  std::vector<char> walked(polytope.ring.size(), false);
  for (const auto& [first_from, first_to] : border) {
    if (walked[ridges.number(first_from, first_to)]) continue;
    std::vector<int> loop;
    int from = first_from, to = first_to;
    while (!std::exchange(walked[ridges.number(from, to)], true)) {
      cancellation_point();
      loop.push_back(from);
      // At the head of the ridge, turn through the facets of this owner until the far side of the next ridge has
      // another owner.
      int next = ridges.after(from, to);
      while (mine(ridges.left_of(next, to))) next = ridges.after(next, to);
      from = to;
      to = next;
    }
    loops.push_back(std::move(loop));
  }
}

/// The number of each vertex's group: ridges that rounding alone may have made join the vertices of a group.
std::vector<int> merge_vertices(const Region& region, int& groups) {
  const Polytope& p = region.polytope;
  std::vector<double> rounding(p.vertices.size(), 0);
  for (int f = 0; f < p.facets(); ++f) {
    // The plane's rounding in the frame's coordinates. There the plane's distance from the origin is 1 / |dual|.
    const double moved = region.facets[f].rounding / region.facets[f].slack / norm(p.dual[f]);
    // Planes that meet at a small angle move their common vertex by a multiple of their rounding.
    for (int v : p.facet(f)) rounding[v] = std::max(rounding[v], std::min(1e-3, 512 * moved));
  }
  std::vector<int> parent(p.vertices.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  for (int f = 0; f < p.facets(); ++f) {
    cancellation_point();
    const auto ring = p.facet(f);
    for (size_t i = 0; i < ring.size(); ++i) {
      const int u = ring[i], v = ring[(i + 1) % ring.size()];
      if (norm(p.vertices[u] - p.vertices[v]) <= std::max(rounding[u], rounding[v]))
        parent[std::max(root(u), root(v))] = std::min(root(u), root(v));
    }
  }
  std::vector<int> group(p.vertices.size());
  groups = 0;
  for (int v = 0; v < static_cast<int>(group.size()); ++v) group[v] = root(v) == v ? groups++ : group[root(v)];
  return group;
}

/// The vertex of each group that lies nearest to the planes of all its facets. Planes that meet at a small angle place
/// some vertices badly.
std::vector<int> representatives(const Polytope& p, std::span<const int> group, int groups) {
  std::vector<std::vector<int>> members(groups), facets_of(groups);
  for (int v = 0; v < static_cast<int>(group.size()); ++v) members[group[v]].push_back(v);
  for (int f = 0; f < p.facets(); ++f)
    for (int v : p.facet(f))
      if (members[group[v]].size() > 1) facets_of[group[v]].push_back(f);
  std::vector<int> chosen(groups);
  for (int g = 0; g < groups; ++g) {
    cancellation_point();
    const std::vector<int>& vertices = members[g];
    chosen[g] = vertices[0];
    if (vertices.size() == 1) continue;
    const Vec3 centre = p.vertices[vertices[0]];
    double radius = 0;
    for (int v : vertices) radius = std::max(radius, norm(p.vertices[v] - centre));
    PlaneTree planes(p, facets_of[g], centre, radius);
    double least = std::numeric_limits<double>::infinity();
    for (int v : vertices) {
      cancellation_point();
      const double misfit = planes.misfit(p.vertices[v], least);
      if (misfit < least) least = misfit, chosen[g] = v;
    }
  }
  return chosen;
}

/// The ring with one vertex for each run of a group; empty if fewer than three remain.
std::vector<int> contracted(std::span<const int> ring, std::span<const int> group) {
  std::vector<int> result;
  for (int v : ring)
    if (result.empty() || result.back() != group[v]) result.push_back(group[v]);
  while (result.size() > 1 && result.back() == result.front()) result.pop_back();
  if (result.size() < 3) result.clear();
  return result;
}

}  // namespace

Patch patch_of(const Region& region, Vec3 centroid, const std::optional<Vec3>& direction) {
  const Polytope& p = region.polytope;
  const Ridges ridges(p);
  const auto along_border = [&](const auto& use) {
    for (int f = 0; f < p.facets(); ++f) {
      cancellation_point();
      if (region.facets[f].owner != 1) continue;
      const auto ring = p.facet(f);
      for (size_t i = 0; i < ring.size(); ++i) {
        const int from = ring[i], to = ring[(i + 1) % ring.size()];
        if (region.facets[ridges.left_of(to, from)].owner == 1) continue;
        use(region.frame.axes * p.vertices[from], region.frame.axes * p.vertices[to]);
      }
    }
  };
  SumInPairs<Vec3> area;
  along_border([&](Vec3 from, Vec3 to) { area.add(cross(from, to) / 2); });
  PatchSums sums(centroid - region.reference - region.frame.origin, seen_along(area.total(), direction));
  along_border([&](Vec3 from, Vec3 to) { sums.add_edge(from, to); });
  Patch patch = sums.patch();
  patch.centre += region.frame.origin + region.reference;
  return patch;
}

Boundary boundary_of(const Region& region, int bodies) {
  const Polytope& p = region.polytope;
  int groups = 0;
  const std::vector<int> group = merge_vertices(region, groups);
  Boundary boundary;
  boundary.vertices.resize(groups);
  const std::vector<int> chosen = representatives(p, group, groups);
  for (int g = 0; g < groups; ++g) boundary.vertices[g] = region.to_world(p.vertices[chosen[g]]);
  for (size_t v = 0; v < p.vertices.size(); ++v)
    boundary.merged =
        std::max(boundary.merged, norm(region.frame.axes * (p.vertices[v] - p.vertices[chosen[group[v]]])));
  boundary.ring_start.push_back(0);
  for (int f = 0; f < p.facets(); ++f) {
    cancellation_point();
    const std::vector<int> ring = contracted(p.facet(f), group);
    if (ring.empty()) continue;
    boundary.ring.insert(boundary.ring.end(), ring.begin(), ring.end());
    boundary.ring_start.push_back(static_cast<int>(boundary.ring.size()));
    const Region::Facet& facet = region.facets[f];
    const double offset = facet.slack + dot(facet.normal, region.frame.origin) + dot(facet.normal, region.reference);
    boundary.planes.push_back({facet.normal, offset});
    boundary.owner.push_back(facet.owner);
  }
  const Ridges ridges(p);
  std::vector<std::vector<int>> loops;
  for (int owner = 0; owner < (bodies == 2 ? 1 : bodies); ++owner)
    walk_around_patches(p, region.facets, ridges, owner, loops);
  for (const auto& loop : loops) {
    std::vector<Vec3> polygon;
    for (int v : contracted(loop, group)) polygon.push_back(boundary.vertices[v]);
    if (!polygon.empty()) boundary.patch.push_back(std::move(polygon));
  }
  return boundary;
}

}  // namespace overlapper
