#include "overlap/rounded_surface.h"

#include <algorithm>
#include <cmath>

#include "geometry/cancellation.h"
#include "geometry/constants.h"
#include "methods/round/quadric/gauss.h"
#include "methods/round/seam/seam.h"
#include "overlap/facet_sections.h"
#include "overlap/shape_gradient.h"

namespace overlapper {
namespace {

class RoundedSurface {
 public:
  RoundedSurface(const Placed& body, Vec3 inside) : hull_(*polytope_of(body.shape)), radius_(core_radius(body.shape)) {
    const Placed relative = body.seen_from(inside);
    for (Vec3 v : hull_.vertices) vertices_.push_back(relative.pose * (hull_.origin + v));
    at_vertex_.resize(vertices_.size());
    sums_.by_vertex.resize(vertices_.size(), Mat3{{}, {}, {}});
  }

  void add_face(const FacetSection& face) {
    const double distance = dot(face.normal, face.first);
    sums_.distance += distance, sums_.moment += distance / face.area * face.first, sums_.by_radius += face.first;
    sums_.area += face.area;
  }

  void add_seam(const BorderNode& node) {
    cancellation_point();
    constexpr double kNear = 1e-9;
    const Vec3 core = node.place - radius_ * node.normal;
    const int vertex = nearest_vertex(core);
    if (norm(core - vertices_[vertex]) <= kNear * hull_.radius) {
      at_vertex_[vertex].push_back(node);
      return;
    }
    double least = kNear * hull_.radius;
    const Edge* nearest = nullptr;
    for (const Edge& edge : hull_.edges) {
      const Vec3 from = vertices_[edge.from], way = vertices_[edge.to] - from;
      const double share = std::clamp(dot(core - from, way) / norm2(way), 0.0, 1.0);
      const double away = norm(core - from - share * way);
      if (away <= least) least = away, nearest = &edge;
    }
    if (nearest) add_at_edge(*nearest, node);
  }

  /// The normal of the arc's plane is along the edge, away from it.
  void add_rim(const BorderNode& node) {
    const int vertex = nearest_vertex(node.place - radius_ * node.normal);
    const Vec3 out = unit(cross(node.step, node.normal));
    double most = 0;
    const Edge* along = nullptr;
    for (const Edge& edge : hull_.edges) {
      if (edge.from != vertex && edge.to != vertex) continue;
      const Vec3 way = unit(vertices_[edge.to] - vertices_[edge.from]);
      const double towards = dot(out, edge.to == vertex ? way : -way);
      if (towards > most) most = towards, along = &edge;
    }
    if (!along) return;
    add_at_edge(*along, node);
    at_vertex_[vertex].push_back({node.place, -node.step, node.normal});
  }

  SurfaceSums sums() {
    for (size_t v = 0; v < vertices_.size(); ++v) add_vertex(v, at_vertex_[v]);
    return sums_;
  }

 private:
  int nearest_vertex(Vec3 point) const {
    const auto away = [&](Vec3 vertex) { return norm2(vertex - point); };
    return static_cast<int>(std::ranges::min_element(vertices_, {}, away) - vertices_.begin());
  }

  /// Integrals along the axis begin beside the inner point.
  void add_at_edge(const Edge& edge, const BorderNode& node) {
    const Vec3 axis = unit(vertices_[edge.to] - vertices_[edge.from]), x = node.place;
    const double far = dot(axis, x), area = -far * dot(axis, cross(node.normal, node.step));
    add_point(x - far / 2 * axis, node.normal, area);
    // Shares are linear along the edge. Gauss's two nodes are exact.
    const double length = norm(vertices_[edge.to] - vertices_[edge.from]), step = std::sqrt(1.0 / 12);
    for (const double part : {0.5 - step, 0.5 + step}) {
      const Vec3 place = x + (part - 1) * far * axis;
      const double share = dot(axis, place - vertices_[edge.from]) / length;
      add_to_vertex(edge.to, share * area / 2, place, node.normal);
      add_to_vertex(edge.from, (1 - share) * area / 2, place, node.normal);
    }
  }

  void add_to_vertex(size_t v, double area, Vec3 x, Vec3 normal) {
    sums_.by_vertex[v] = sums_.by_vertex[v] + outer(area * x, normal);
  }

  void add_vertex(size_t v, std::span<const BorderNode> border) {
    const Vec3 vertex = vertices_[v];
    Vec3 sum;
    for (const BorderNode& node : border) sum += node.normal;
    const Vec3 pole = unit(sum);
    for (const BorderNode& node : border) {
      const double cosine = dot(pole, node.normal);
      const Vec3 across = node.normal - cosine * pole;
      const double sine = norm(across);
      if (!(sine > 0)) continue;
      const double turn = dot(pole, cross(across, node.step)) / (radius_ * sine * sine);
      const double half = std::atan2(sine, cosine) / 2;
      for (int i = 0; i < 16; ++i) {
        const double angle = half * (1 + (i % 2 == 0 ? -1 : 1) * quadric::kGaussNode[i / 2]);
        const Vec3 normal = std::cos(angle) * pole + std::sin(angle) / sine * across;
        const Vec3 x = vertex + radius_ * normal;
        const double area = turn * half * quadric::kGaussWeight[i / 2] * radius_ * radius_ * std::sin(angle);
        add_point(x, normal, area), add_to_vertex(v, area, x, normal);
      }
    }
  }

  void add_point(Vec3 x, Vec3 normal, double area) {
    const double distance = area * dot(x, normal);
    sums_.distance += distance, sums_.moment += distance * x, sums_.by_radius += area * x, sums_.area += area;
  }

  const HullData& hull_;
  double radius_;
  std::vector<Vec3> vertices_;
  std::vector<std::vector<BorderNode>> at_vertex_;
  SurfaceSums sums_;
};

}  // namespace

std::optional<Borders> borders_of(const Overlap& overlap) {
  Borders found;
  std::array<std::vector<seam::SeamPoint>, 2> rims;
  const auto points = seam::seam_of(overlap.bodies()[0], overlap.bodies()[1], overlap.centroid(), &rims);
  if (!points) return std::nullopt;
  for (const seam::SeamPoint& point : *points) {
    const auto& [n, m] = point.outward;
    const Vec3 step = point.weight * cross(n, m);
    found.seam[0].push_back({point.place, step, unit(n)}), found.seam[1].push_back({point.place, -step, unit(m)});
  }
  for (const int i : {0, 1})
    for (const seam::SeamPoint& point : rims[i]) {
      const auto& [n, m] = point.outward;
      found.rims[i].push_back({point.place, point.weight * cross(n, m), unit(n)});
    }
  return found;
}

SurfaceSums rounded_surface(const Overlap& overlap, int body, Vec3 inside, std::span<const BorderNode> border,
                            std::span<const BorderNode> rims) {
  const Placed& rounded = overlap.bodies()[body];
  constexpr Vec3 kUnknown{kNoDerivative, kNoDerivative, kNoDerivative};
  if (polytope_of(rounded.shape)->edges.empty()) {
    const Mat3 of_vertex{kUnknown, kUnknown, kUnknown};
    const size_t vertices = polytope_of(rounded.shape)->vertices.size();
    return {kNoDerivative, kUnknown, kUnknown, {}, kNoDerivative, std::vector<Mat3>(vertices, of_vertex)};
  }
  RoundedSurface surface(rounded, inside);
  for (const FacetSection& face : facet_sections(overlap, body, inside)) surface.add_face(face);
  for (const BorderNode& node : border) surface.add_seam(node);
  for (const BorderNode& node : rims) surface.add_rim(node);
  return surface.sums();
}

}  // namespace overlapper
