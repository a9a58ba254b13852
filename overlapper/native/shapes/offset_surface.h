#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "geometry/once.h"
#include "geometry/vec.h"

namespace overlapper {

struct HullData;

/// The surface of a rounded hull by features of its core: a moved facet, a band of a cylinder along each edge, a part
/// of a sphere at each vertex. The numbers do not depend on the radius. Normals are rounded from double-doubles.
struct OffsetSurface {
  struct Facet {
    Vec3 normal;      ///< unit
    double area = 0;  ///< m²
  };
  /// The normals over an edge turn from the left facet's normal to the right facet's, by `angle` about `along`.
  struct Edge {
    int from = 0, to = 0, left = 0, right = 0;
    double length = 0;
    Vec3 along;            ///< unit, from `from` to `to`
    Vec3 middle, across;   ///< the normal in the middle, and `along` × `middle`; unit
    double angle = 0;      ///< rad
    double chord = 0;      ///< ∫ n is this times `middle`
    double of_middle = 0;  ///< ∫ n nᵀ is this times middle middleᵀ ...
    double of_across = 0;  ///< ... and this times across acrossᵀ
    /// Places in `HullData::ring`: of `from` and `to` in the left facet, and of `from` and `to` in the right facet.
    std::array<int, 4> corners{};
  };
  /// The normals at a vertex.
  struct Vertex {
    Vec3 normals;  ///< ∫ n over the solid angle
    double solid_angle = 0;
  };
  std::vector<Facet> facets;
  std::vector<Edge> edges;
  std::vector<Vertex> vertices;
  std::span<const int> edges_at(int vertex) const {
    return std::span(edges_by_vertex).subspan(first_edge[vertex], first_edge[vertex + 1] - first_edge[vertex]);
  }
  std::vector<int> edges_by_vertex, first_edge;
  /// For each place in `HullData::ring`, twice the number of the edge that begins there; 1 more on its right side.
  std::vector<int> sides;
  double core_volume = 0, area = 0, mean_width = 0;  ///< Steiner: the volume is V + area r + mean_width r² + 4/3 π r³
  bool exact = false;  ///< exact numbers give every facet, and no two facets turn inwards at their edge

  double volume(double radius) const;
};

/// The surface of a polytope, computed on first use. A copy of the polytope may change, so it starts without one.
class KeptOffsetSurface {
 public:
  KeptOffsetSurface() = default;
  KeptOffsetSurface(const KeptOffsetSurface&) {}
  KeptOffsetSurface& operator=(const KeptOffsetSurface&) {
    return kept_ = std::make_unique<Once<OffsetSurface>>(), *this;
  }

  template <class Compute>
  const OffsetSurface& get(Compute compute) const {
    return kept_->get(compute);
  }

 private:
  std::unique_ptr<Once<OffsetSurface>> kept_ = std::make_unique<Once<OffsetSurface>>();
};

const OffsetSurface& offset_surface(const HullData& core);

}  // namespace overlapper
