// The core's trees behind functions that ctypes can call.
#include <cstdint>
#include <limits>

#include "overlap/dual_tree.h"
#include "overlap/plane_tree.h"
#include "shapes/facet_tree.h"
#include "shapes/hull.h"

using namespace overlapper;

namespace {

std::vector<Vec3> vectors(const double* numbers, int count) {
  std::vector<Vec3> all;
  for (int i = 0; i < count; ++i) all.push_back({numbers[3 * i], numbers[3 * i + 1], numbers[3 * i + 2]});
  return all;
}

struct Faceted {
  HullData hull;
  FacetTree tree;
};

}  // namespace

extern "C" {

DualTree* make_dual_tree(const double* points, int count) {
  std::vector<DualTree::Entry> entries;
  for (Vec3 point : vectors(points, count)) entries.push_back({point, static_cast<int>(entries.size())});
  return new DualTree(std::move(entries));
}
void drop_dual_tree(const DualTree* tree) { delete tree; }

/// How many points were visited, at most so many: `corners` has a row for each point, of bytes for the polygon's
/// corners. One less than the negative of that if it ended because `most` were.
int reaching(const DualTree* tree, const double* polygon, int corners, double level, int most, std::uint8_t* reached) {
  const std::vector<Vec3> ring = vectors(polygon, corners);
  int visited = 0;
  const bool all = tree->reaching(ring, level, [&](int number, std::span<const int> near) {
    for (int corner : near) ++reached[number * corners + corner];
    return ++visited < most;
  });
  return all ? visited : -1 - visited;
}

/// How far each vertex is from the plane that it misses most, of the planes that `duals` are of.
void misfits(const double* duals, int planes, const double* vertices, int count, double enough, double* found) {
  Polytope polytope;
  polytope.dual = vectors(duals, planes);
  std::vector<int> facets;
  for (int f = 0; f < planes; ++f) facets.push_back(f);
  const std::vector<Vec3> all = vectors(vertices, count);
  double radius = 0;
  for (Vec3 vertex : all) radius = std::max(radius, norm(vertex - all[0]));
  PlaneTree tree(polytope, facets, all[0], radius);
  for (int i = 0; i < count; ++i) found[i] = tree.misfit(all[i], enough);
}

Faceted* make_facet_tree(const double* vertices, int count, const double* planes, const int* ring, const int* start,
                         int facets) {
  HullData hull;
  hull.vertices = vectors(vertices, count);
  hull.ring.assign(ring, ring + start[facets]);
  hull.ring_start.assign(start, start + facets + 1);
  for (int f = 0; f < facets; ++f) {
    const double* p = planes + 4 * f;
    hull.planes.push_back({{p[0], p[1], p[2]}, p[3]});
  }
  FacetTree tree(hull);
  return new Faceted{std::move(hull), std::move(tree)};
}
void drop_facet_tree(const Faceted* faceted) { delete faceted; }

/// The point, and the direction out of it, of the foot of x.
void foot(const Faceted* faceted, const double* x, double nearer_than2, double* found) {
  const Foot foot = faceted->tree.foot(faceted->hull, {x[0], x[1], x[2]}, nearer_than2);
  const double numbers[6] = {foot.point.x, foot.point.y, foot.point.z, foot.outward.x, foot.outward.y, foot.outward.z};
  std::copy(numbers, numbers + 6, found);
}
}
