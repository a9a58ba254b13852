#include "geometry/polytope.h"

#include "geometry/cancellation.h"
#include "geometry/predicates.h"
#include "geometry/sum_in_pairs.h"

namespace overlapper {

double farthest_vertex(const Polytope& polytope) {
  double farthest = 0;
  for (Vec3 y : polytope.vertices) farthest = std::max(farthest, norm(y));
  return farthest;
}

Polytope polar_dual(const ExpandingHull& hull) {
  Polytope polytope;
  std::vector<int> vertex_of(hull.facets.size(), -1);
  for (int f = 0; f < static_cast<int>(hull.facets.size()); ++f) {
    const ExpandingHull::Facet& facet = hull.facets[f];
    if (facet.removed()) continue;
    cancellation_point();
    const auto [a, b, c] = facet.vertex;
    vertex_of[f] = static_cast<int>(polytope.vertices.size());
    polytope.vertices.push_back(polar_vertex(hull.points[a], hull.points[b], hull.points[c]));
  }
  const std::vector<int> at = hull.facet_at_vertex();
  polytope.ring_start.push_back(0);
  for (int p = 0; p < static_cast<int>(hull.points.size()); ++p) {
    if (at[p] < 0) continue;
    cancellation_point();
    int f = at[p];
    do {
      polytope.ring.push_back(vertex_of[f]);
      f = hull.next_around(f, p);
    } while (f != at[p]);
    polytope.ring_start.push_back(static_cast<int>(polytope.ring.size()));
    polytope.dual.push_back(hull.points[p]);
    polytope.plane.push_back(p);
  }
  return polytope;
}

namespace {

void add(Mat3& m, double s, const Mat3& other) {
  m.row0 += s * other.row0;
  m.row1 += s * other.row1;
  m.row2 += s * other.row2;
}

struct Integrals {
  double volume = 0;
  Vec3 first;
  Mat3 second{{}, {}, {}};

  Integrals& operator+=(const Integrals& other) {
    volume += other.volume;
    first += other.first;
    add(second, 1, other.second);
    return *this;
  }
};

}  // namespace

PolytopeMoments moments(const Polytope& polytope) {
  PolytopeMoments sum;
  SumInPairs<Integrals> integrals;
  sum.cone_volume.reserve(polytope.facets());
  sum.facet_centroid.reserve(polytope.facets());
  for (int f = 0; f < polytope.facets(); ++f) {
    cancellation_point();
    const auto ring = polytope.facet(f);
    const Vec3 a = polytope.vertices[ring[0]];
    double cone = 0;
    Vec3 weighted;
    for (size_t i = 1; i + 1 < ring.size(); ++i) {
      const Vec3 b = polytope.vertices[ring[i]], c = polytope.vertices[ring[i + 1]];
      const double tetrahedron = dot(a, cross(b, c)) / 6;
      const Vec3 corners = a + b + c;
      cone += tetrahedron;
      weighted += tetrahedron * corners;
      Integrals term{tetrahedron, tetrahedron / 4 * corners};
      // ∫ x xᵀ over a tetrahedron with one corner at the origin: V / 20 (Σ pᵢ pᵢᵀ + (Σ pᵢ)(Σ pᵢ)ᵀ).
      for (Vec3 p : {a, b, c, corners}) add(term.second, tetrahedron / 20, outer(p, p));
      integrals.add(term);
    }
    sum.cone_volume.push_back(cone);
    sum.facet_centroid.push_back(cone > 0 ? weighted / (3 * cone) : a);
  }
  const Integrals total = integrals.total();
  sum.volume = total.volume, sum.first_moment = total.first, sum.second_moment = total.second;
  return sum;
}

}  // namespace overlapper
