#include "methods/tracing/seam.h"

#include <limits>

#include "geometry/cancellation.h"

namespace overlapper {

void Seam::begin(CloseBody& first, CloseBody& second) {
  bodies_ = {&first, &second};
  certain_ = true;
  reach_ = 0;
  corners_.clear();
  lines_.clear();
  if (++now_ == std::numeric_limits<int>::max()) {
    marks_ = {};
    now_ = 1;
  }
  for (int body : {0, 1}) {
    Marks& m = marks_[body];
    m.farthest = m.rounding = 0;
    const size_t edges = bodies_[body]->data().ring.size();
    if (m.entered.size() < edges) m.entered.resize(edges, 0), m.corner.resize(edges);
  }
}

/// The signed distance of a vertex outside the plane of the other body's facet.
double Seam::height(CloseBody& of, int vertex, CloseBody& over, int facet) {
  const CloseBody::PlacedCorner& v = of.corner(vertex);
  const CloseBody::Side& side = over.side(facet);
  const double s = dot(side.normal, v.at - side.through);
  certain_ &= std::abs(s) > CloseBody::kSign * (v.size + side.size) + over.mesh().flat();
  return s;
}

/// The half-edge of a body's facet over which the line leaves the facet. The search starts at one of its half-edges. On
/// the first body, this edge comes from outside the other plane; on the second, it goes there. -1 if the line misses
/// the facet.
int Seam::turning_edge(int body, int from, CrossingFacets at) {
  CloseBody &self = *bodies_[body], &other = *bodies_[1 - body];
  const int plane = other_facet(at, body);
  const auto outside = [&](int vertex) { return (height(self, vertex, other, plane) > 0) == (body == 0); };
  // The plane divides a convex polygon into two sides, and only one edge goes from one side to the other. Search
  // backwards if the start edge ends behind it, else forwards.
  const int edges = static_cast<int>(self.data().facet(self.facet(from)).size());
  int h = from;
  bool begins = outside(self.begin(h)), ends = outside(self.end(h));
  for (int i = 0; i < edges; ++i) {
    if (begins && !ends) return h;
    if (!begins) {
      h = self.previous(h);
      ends = begins;
      begins = outside(self.begin(h));
    } else {
      h = self.graph().next[h];
      begins = ends;
      ends = outside(self.end(h));
    }
  }
  return -1;
}

/// Positive if a half-edge of one body, coming from outside a facet of the other, passes on the inner side of that
/// facet's half-edge.
double Seam::order(int body, int entering, int other_edge) {
  CloseBody &self = *bodies_[body], &other = *bodies_[1 - body];
  const CloseBody::PlacedCorner &p = self.corner(self.begin(entering)), &q = self.corner(self.end(entering)),
                                &r = other.corner(other.begin(other_edge)), &s = other.corner(other.end(other_edge));
  const Vec3 along = q.at - p.at, side = s.at - r.at, between = r.at - p.at;
  const double a = std::sqrt(norm2(along)), b = std::sqrt(norm2(side)), c = std::sqrt(norm2(between));
  const double det = dot(cross(along, side), between);
  // Each corner moves the determinant by its own rounding times the product of two lengths. The products and sums lose
  // less than the rest of the bound.
  const double moved =
      16 * 0x1p-53 * (p.size + q.size + r.size + s.size) + 4 * (self.mesh().flat() + other.mesh().flat());
  certain_ &= std::abs(det) > moved * (a * b + b * c + c * a);
  return det;
}

/// True if the line's segments in both facets overlap.
bool Seam::crosses(CrossingFacets facets, std::array<int, 2> exit) {
  if (exit[0] < 0 || exit[1] < 0) return false;
  const auto entry_edge = [&](int body) {
    CloseBody &self = *bodies_[body], &other = *bodies_[1 - body];
    const int plane = other_facet(facets, body);
    int h = exit[body];
    do {
      h = self.graph().next[h];
    } while ((height(self, self.end(h), other, plane) > 0) != (body == 0));
    return h;
  };
  // The first body's two crossings, seen from the second body's facet: the exit is after the facet begins, and the
  // entry is before it ends.
  return order(0, exit[0], entry_edge(1)) > 0 && order(0, bodies_[0]->twin(entry_edge(0)), exit[1]) > 0 && certain_;
}

/// The point where a half-edge that comes from outside the other body's facet crosses its plane.
Vec3 Seam::meet(int body, int entering, int plane) {
  CloseBody &self = *bodies_[body], &other = *bodies_[1 - body];
  const int from = self.begin(entering), to = self.end(entering);
  const double above = height(self, from, other, plane), below = -height(self, to, other, plane);
  const CloseBody::PlacedCorner &p = self.corner(from), &q = self.corner(to);
  const Vec3 along = q.at - p.at, through = other.side(plane).through;
  const double share = above / (above + below), rest = below / (above + below);
  const Vec3 at = share < rest ? p.at + share * along : q.at - rest * along;
  // Interpolation from the nearer end rounds the difference, its product with the fraction, and the sum. The error of a
  // plane's distance from the ends is its normal's rounding plus four operations, relative to its corner. The error of
  // the fractions is at most four more operations.
  const double size = std::sqrt(norm2(at)), interpolated = 0x1p-53 * (std::sqrt(norm2(along)) + size);
  const double away = rest * std::sqrt(norm2(p.at - through)) + share * std::sqrt(norm2(q.at - through));
  marks_[body].rounding = std::max(marks_[body].rounding, interpolated);
  Marks& others = marks_[1 - body];
  others.rounding = std::max(others.rounding, interpolated + (other.normal_rounding() + 8 * 0x1p-53) * away);
  reach_ = std::max(reach_, size);
  return at;
}

/// Steps past the nearer of the two exits and adds a corner there.
bool Seam::step(CrossingFacets& at, std::array<int, 2>& exit) {
  const int body = order(0, exit[0], exit[1]) > 0 ? 0 : 1;
  const CloseBody& self = *bodies_[body];
  const int across = self.twin(exit[body]), entering = body == 0 ? exit[0] : across;
  Marks& m = marks_[body];
  if (m.entered[entering] == now_) return false;
  m.entered[entering] = now_;
  m.corner[entering] = static_cast<int>(corners_.size());
  const Vec3 corner = meet(body, entering, other_facet(at, body));
  (body == 0 ? at.first : at.second) = self.facet(across);
  corners_.push_back({corner, body, entering, 0, 0, at});
  exit[body] = turning_edge(body, across, at);
  exit[1 - body] = turning_edge(1 - body, exit[1 - body], at);
  return exit[0] >= 0 && exit[1] >= 0;
}

bool Seam::follow(CrossingFacets start) {
  CrossingFacets at = start;
  std::array<int, 2> exit{turning_edge(0, bodies_[0]->data().ring_start[at.first], at),
                          turning_edge(1, bodies_[1]->data().ring_start[at.second], at)};
  if (!crosses(at, exit)) return false;
  const int first = static_cast<int>(corners_.size());
  Line line{first, {false, false}};
  do {
    cancellation_point();
    for (int body : {0, 1}) {
      const int facet = body == 0 ? at.first : at.second;
      marks_[body].farthest = std::max(marks_[body].farthest, bodies_[body]->side(facet).farthest);
    }
    if (!step(at, exit) || !certain_) return false;
    line.crosses_edges_of[corners_.back().body] = true;
  } while (at.first != start.first || at.second != start.second);
  const int past = static_cast<int>(corners_.size());
  for (int i = first; i < past; ++i) {
    corners_[i].next = i + 1 < past ? i + 1 : first;
    corners_[i].previous = i > first ? i - 1 : past - 1;
  }
  lines_.push_back(line);
  return true;
}

}  // namespace overlapper
