#include "shapes/solid.h"

namespace overlapper {
void set_solid(Solid& solid, const Placed& body, int owner, const Pose* pose, double beyond) {
  ask_flat(body.shape, [&](const auto& s) { s.place(solid, pose, beyond); });
  std::fill(solid.owner.begin(), solid.owner.end(), owner);
  solid.whole = bounded(body.shape);
}

bool set_part(Solid& solid, const Placed& body, int owner, const Pose& pose, const Ball& ball, double beyond) {
  thread_local Solid whole;
  thread_local std::vector<int> facet_number, vertex_number, chosen;
  set_solid(whole, body, owner, &pose, beyond);
  facet_number.assign(whole.facets, -1);
  vertex_number.assign(whole.vertices, -1);
  chosen.clear();
  int kept = 0;
  for (int f = 0; f < whole.facets; ++f) {
    const double height = dot(whole.normal(f), ball.centre) - whole.offset[f];
    if (height > ball.radius) return false;
    if (height >= -ball.radius) facet_number[f] = kept++;
  }
  solid.own_edges.clear();
  const auto number = [&](int vertex) {
    int& n = vertex_number[vertex];
    if (n < 0) n = static_cast<int>(chosen.size()), chosen.push_back(vertex);
    return n;
  };
  for (const Edge& e : whole.edges) {
    const int left = facet_number[e.left], right = facet_number[e.right];
    if (left >= 0 && right >= 0) solid.own_edges.push_back({number(e.from), number(e.to), left, right});
  }
  solid.resize(static_cast<int>(chosen.size()), kept, beyond);
  for (int i = 0; i < solid.vertices; ++i) solid.set_vertex(i, whole.vertex(chosen[i]));
  for (int f = 0; f < whole.facets; ++f)
    if (facet_number[f] >= 0) solid.set_plane(facet_number[f], whole.normal(f), whole.offset[f]);
  std::fill(solid.owner.begin(), solid.owner.end(), owner);
  solid.edges = solid.own_edges;
  solid.whole = false;
  return true;
}

}  // namespace overlapper
