#include "meeting.h"

#include <cstring>
#include <limits>

namespace overlapper {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

inline void store(double* p, Pair v) { std::memcpy(p, &v, sizeof v); }
inline Pair both(double x) { return Pair{x, x}; }
inline Pair larger(Pair a, Pair b) { return a > b ? a : b; }
inline Pair smaller(Pair a, Pair b) { return a < b ? a : b; }
inline double larger(Pair a) { return a[0] > a[1] ? a[0] : a[1]; }

/// Where an edge meets a plane: at `from + at * (to - from)`.
struct Crossing {
  int plane;
  double at;
};

/// One edge against all planes of the other body: the signed distances of its ends.
struct EdgeSigns {
  const double *from, *to;
  int stride;
  double length, rounding;

  /// How far off the point may be where the edge crosses a plane: the rounding of two signs as seen along the edge.
  double doubt(Crossing crossing) const {
    return 2 * rounding * (1 + length / std::abs(to[crossing.plane] - from[crossing.plane]));
  }

  /// True if the point where the edge crosses a plane is certainly inside all others.
  bool certain(Crossing crossing) const {
    const int g = crossing.plane, pair = g & ~1, partner = g ^ 1;
    const Pair at = both(crossing.at);
    const auto height = [&](int j) { return load(from + j) + at * (load(to + j) - load(from + j)); };
    Pair highest = both(from[partner] + crossing.at * (to[partner] - from[partner]));
    for (int j = 0; j < pair; j += 2) highest = larger(highest, height(j));
    for (int j = pair + 2; j < stride; j += 2) highest = larger(highest, height(j));
    return larger(highest) < -doubt(crossing);
  }

  Crossing at_plane(int g) const { return {g, from[g] / (from[g] - to[g])}; }

  /// The plane through which it leaves from an end that is inside.
  Crossing exit(bool from_inside, std::vector<double>& ratio) const {
    const double *inner = from_inside ? from : to, *outer = from_inside ? to : from;
    Pair steepest = both(0);
    for (int j = 0; j < stride; j += 2) {
      const Pair r = load(outer + j) / -load(inner + j);
      store(&ratio[j], r);
      steepest = larger(steepest, r);
    }
    const double most = larger(steepest);
    int g = 0;
    while (ratio[g] != most) ++g;
    return at_plane(g);
  }

  /// True if both ends are certainly outside of the same plane.
  bool outside() const {
    Pair highest = both(-kInfinity);
    for (int j = 0; j < stride; j += 2) highest = larger(highest, smaller(load(from + j), load(to + j)));
    return larger(highest) > rounding;
  }

  /// For an edge whose ends are both outside, of different planes: where it enters and leaves.
  std::array<Crossing, 2> passage() const {
    Crossing enter{-1, -kInfinity}, leave{-1, kInfinity};
    for (int j = 0; j < stride; ++j) {
      const double at = from[j] / (from[j] - to[j]);
      if (from[j] > to[j] && from[j] > 0 && at > enter.at) enter = {j, at};
      if (to[j] > from[j] && to[j] > 0 && at < leave.at) leave = {j, at};
    }
    return {enter, leave};
  }

  /// True if the edge is certainly outside of one of two planes all along.
  bool misses(int g, int h) const {
    const double slope_g = to[g] - from[g], slope_h = to[h] - from[h];
    const double level = std::clamp((from[h] - from[g]) / (slope_g - slope_h), 0.0, 1.0);
    return std::max(from[g] + level * slope_g, from[h] + level * slope_h) > 2 * rounding;
  }
};

}  // namespace

Signs SignTable::fill(const Solid& of, const Solid& by, double rounding) {
  stride = by.stride;
  rows.resize(static_cast<size_t>(of.vertices) * stride);
  inside.resize(of.vertices);
  nearest.assign(stride, kInfinity);
  bool uncertain = false;
  double most_doubt = 0;
  for (int i = 0; i < of.vertices; ++i) {
    const Pair x = both(of.x[i]), y = both(of.y[i]), z = both(of.z[i]);
    double* signs = row(i);
    Pair farthest = both(-kInfinity);
    for (int j = 0; j < stride; j += 2) {
      const Pair s = load(&by.nx[j]) * x + load(&by.ny[j]) * y + load(&by.nz[j]) * z - load(&by.offset[j]);
      store(signs + j, s);
      farthest = larger(farthest, s);
      store(&nearest[j], smaller(load(&nearest[j]), s));
    }
    const double s = larger(farthest);
    inside[i] = s < 0;
    uncertain |= std::abs(s) <= rounding + of.doubt[i];
    most_doubt = std::max(most_doubt, of.doubt[i]);
  }
  if (of.whole && *std::max_element(nearest.begin(), nearest.end()) > rounding + most_doubt) return Signs::kSeparated;
  return uncertain ? Signs::kUncertain : Signs::kCertain;
}

/// Finds the common polytope of a meeting whose solids are in place.
class Tracer {
 public:
  Tracer(Meeting& meeting, double rounding) : w_(meeting), rounding_(rounding) {}

  Signs trace() {
    const Signs one = w_.first_signs.fill(w_.first, w_.second, rounding_);
    if (one == Signs::kSeparated) return one;
    const Signs other = w_.second_signs.fill(w_.second, w_.first, rounding_);
    if (other == Signs::kSeparated) return other;
    if (one == Signs::kUncertain || other == Signs::kUncertain) return Signs::kUncertain;

    w_.vertices.clear();
    w_.corners.clear();
    w_.doubt.clear();
    w_.edges.clear();
    w_.seam.clear();
    w_.unpaired = 0;
    w_.open.resize(static_cast<size_t>(w_.first.facets) * w_.second.facets, 0);
    w_.ratio.resize(std::max(w_.first.stride, w_.second.stride));
    const bool certain = trace(w_.first, w_.first_signs, w_.first_vertex, true) &&
                         trace(w_.second, w_.second_signs, w_.second_vertex, false) && w_.unpaired == 0;
    if (!certain) {
      std::fill(w_.open.begin(), w_.open.end(), 0);
      return Signs::kUncertain;
    }
    return w_.vertices.empty() ? Signs::kSeparated : Signs::kCertain;
  }

 private:
  int add_vertex(Vec3 v, double doubt, const Corner& corner) {
    w_.vertices.push_back(v);
    w_.doubt.push_back(doubt);
    w_.corners.push_back(corner);
    return static_cast<int>(w_.vertices.size()) - 1;
  }

  bool trace(const Solid& body, SignTable& signs, std::vector<int>& common_vertex, bool is_first) {
    common_vertex.assign(body.vertices, -1);
    for (int i = 0; i < body.vertices; ++i)
      if (signs.inside[i]) common_vertex[i] = add_vertex(body.vertex(i), body.doubt[i], {is_first ? 0 : 1, i, {}});
    const int offset = is_first ? 0 : w_.first.facets;
    for (const Edge& e : body.edges) {
      const bool from_inside = signs.inside[e.from], to_inside = signs.inside[e.to];
      Edge common{common_vertex[e.from], common_vertex[e.to], e.left + offset, e.right + offset};
      if (!(from_inside && to_inside)) {
        const Vec3 from = body.vertex(e.from), along = body.vertex(e.to) - from;
        const EdgeSigns edge{signs.row(e.from), signs.row(e.to), signs.stride,
                             std::abs(along.x) + std::abs(along.y) + std::abs(along.z),
                             rounding_ + std::max(body.doubt[e.from], body.doubt[e.to])};
        const auto cross = [&](Crossing crossing, bool enters) {
          const int facet = crossing.plane + (is_first ? w_.first.facets : 0);
          const int v = add_vertex(from + crossing.at * along, edge.doubt(crossing),
                                   {-1, -1, {common.left, common.right, facet}});
          meet(e, crossing.plane, v, enters, is_first);
          return v;
        };
        if (from_inside || to_inside) {
          const Crossing exit = edge.exit(from_inside, w_.ratio);
          if (!edge.certain(exit)) return false;
          (from_inside ? common.to : common.from) = cross(exit, to_inside);
        } else {
          if (edge.outside()) continue;
          const auto [enter, leave] = edge.passage();
          if (enter.plane < 0 || leave.plane < 0) return false;
          if (edge.misses(enter.plane, leave.plane)) continue;
          if (!edge.certain(enter) || !edge.certain(leave)) return false;
          common.from = cross(enter, true);
          common.to = cross(leave, false);
        }
      }
      w_.edges.push_back(common);
    }
    return true;
  }

  /// An edge of one body meets a facet of the other in a common vertex, where two edges of the seam end: walking around
  /// the facet on its left, one follows the edge up to the exit and turns onto the other body.
  void meet(const Edge& e, int facet, int vertex, bool enters, bool is_first) {
    if (is_first) {
      join(e.left, facet, vertex, !enters);
      join(e.right, facet, vertex, enters);
    } else {
      join(facet, e.left, vertex, enters);
      join(facet, e.right, vertex, !enters);
    }
  }

  void join(int first_facet, int second_facet, int vertex, bool begins) {
    int& other = w_.open[static_cast<size_t>(first_facet) * w_.second.facets + second_facet];
    const int mine = begins ? vertex + 1 : -vertex - 1;
    if (other == 0) {
      other = mine;
      ++w_.unpaired;
    } else if ((other > 0) != begins) {
      const int begin = begins ? vertex : other - 1, end = begins ? -other - 1 : vertex;
      w_.seam.push_back({begin, end, first_facet, w_.first.facets + second_facet});
      other = 0;
      --w_.unpaired;
    }
  }

  Meeting& w_;
  double rounding_;
};

Signs Meeting::trace(double rounding) { return Tracer(*this, rounding).trace(); }

void Meeting::take_common(double beyond) {
  facet_number.assign(first.facets + second.facets, -1);
  next.own_edges.clear();
  int kept = 0;
  const auto number = [&](int facet) {
    return facet_number[facet] < 0 ? facet_number[facet] = kept++ : facet_number[facet];
  };
  for (const auto* list : {&edges, &seam})
    for (const Edge& e : *list) next.own_edges.push_back({e.from, e.to, number(e.left), number(e.right)});
  next.resize(static_cast<int>(vertices.size()), kept, beyond);
  for (int i = 0; i < next.vertices; ++i) next.set_vertex(i, vertices[i]);
  next.doubt = doubt;
  for (int f = 0; f < first.facets + second.facets; ++f) {
    const int n = facet_number[f];
    if (n < 0) continue;
    const Solid& body = f < first.facets ? first : second;
    const int plane = f < first.facets ? f : f - first.facets;
    next.set_plane(n, body.normal(plane), body.offset[plane]);
    next.owner[n] = body.owner[plane];
  }
  next.whole = true;
  std::swap(first, next);
  first.edges = first.own_edges;
}

void Meeting::show_first() {
  vertices.clear();
  for (int i = 0; i < first.vertices; ++i) vertices.push_back(first.vertex(i));
  edges.assign(first.edges.begin(), first.edges.end());
  seam.clear();
  second.facets = 0;
}

}  // namespace overlapper
