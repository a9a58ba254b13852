#include "methods/clipping/sign_table.h"

#include <bit>
#include <cstring>
#include <tuple>

#include "geometry/constants.h"
#include "shapes/planes_asked.h"

namespace overlapper {
namespace {

/// Processes two or four planes at once, depending on the machine.
template <class Lanes>
constexpr int kLanes = sizeof(Lanes) / sizeof(double);
template <class Lanes>
inline void read(const double* p, Lanes& v) {
  std::memcpy(&v, p, sizeof v);
}

/// Calls `use(plane)` for each plane whose bit j % 64 is set, in order.
template <class Use>
inline void for_each_plane(std::uint64_t marked, int stride, Use use) {
  if (stride <= 64) {
    for (; marked != 0; marked &= marked - 1) use(std::countr_zero(marked));
    return;
  }
  for (int first = 0; first < stride; first += 64) {
    for (std::uint64_t rest = marked; rest != 0; rest &= rest - 1)
      if (const int j = first + std::countr_zero(rest); j < stride) use(j);
  }
}

/// The point where an edge meets a plane: `from + at * (to - from)`.
struct Crossing {
  int plane;
  double at;
};

/// How much of an edge is inside the other body.
enum class Kept { kNothing, kPart, kUncertain };

/// An edge and all planes of the other body: the signed distances of its ends. The edge enters and leaves through
/// planes that one of its ends is outside of; these are few.
struct EdgeSigns {
  const double *from, *to;
  std::uint64_t from_outside, to_outside;  ///< as in SignTable
  int stride;
  double rounding;

  /// Error of the point where an edge of that length crosses a plane: the rounding of the two signs, seen along the
  /// edge.
  double doubt(Crossing crossing, double length) const {
    return 2 * rounding * (1 + length / std::abs(to[crossing.plane] - from[crossing.plane]));
  }

  /// True if the point where the edge crosses a plane, with its error, is certainly inside all other planes.
  template <class Lanes>
  bool certain(Crossing crossing, double doubt) const {
    int hidden = 0;  // number of planes that it may be outside of
    for (int j = 0; j < stride; j += kLanes<Lanes>) {
      Lanes begin, end;
      read(from + j, begin);
      read(to + j, end);
      hidden += std::popcount(bits_of(begin + crossing.at * (end - begin) >= -doubt));
    }
    return hidden == 1;  // This is the crossed plane itself, by rounding.
  }

  /// The same, one plane at a time: the error is along the edge, so it counts less for planes that are nearly parallel
  /// to the edge.
  bool certain_by_plane(Crossing crossing) const {
    const double slope = std::abs(to[crossing.plane] - from[crossing.plane]);
    for (int j = 0; j < stride; ++j) {
      const double way = to[j] - from[j];
      if (j != crossing.plane && !(from[j] + crossing.at * way < -2 * rounding * (1 + std::abs(way) / slope)))
        return false;
    }
    return true;
  }

  Crossing at_plane(int g) const { return {g, from[g] / (from[g] - to[g])}; }

  /// The plane through which the edge leaves from an end that is inside.
  Crossing exit(bool from_inside) const {
    const std::uint64_t planes = from_inside ? to_outside : from_outside;
    if (stride <= 64 && std::has_single_bit(planes)) return at_plane(std::countr_zero(planes));
    const double *inner = from_inside ? from : to, *outer = from_inside ? to : from;
    double steepest = 0;
    int g = 0;
    for_each_plane(planes, stride, [&](int j) {
      const double ratio = outer[j] / -inner[j];
      if (ratio > steepest) steepest = ratio, g = j;
    });
    return at_plane(g);
  }

  /// True if both ends are certainly outside the same plane.
  bool outside() const {
    bool found = false;
    for_each_plane(from_outside & to_outside, stride, [&](int j) { found |= std::min(from[j], to[j]) > rounding; });
    return found;
  }

  /// The points where an edge enters and leaves, if both its ends are outside, of different planes.
  std::pair<Crossing, Crossing> passage() const {
    Crossing enter{-1, -kInfinity}, leave{-1, kInfinity};
    for_each_plane(from_outside, stride, [&](int j) {
      const double at = from[j] / (from[j] - to[j]);
      if (from[j] > 0 && from[j] > to[j] && at > enter.at) enter = {j, at};
    });
    for_each_plane(to_outside, stride, [&](int j) {
      const double at = from[j] / (from[j] - to[j]);
      if (to[j] > 0 && to[j] > from[j] && at < leave.at) leave = {j, at};
    });
    return {enter, leave};
  }

  /// True if each point of the edge is certainly outside one of two planes.
  bool misses(int g, int h) const {
    const double slope_g = to[g] - from[g], slope_h = to[h] - from[h];
    const double level = std::clamp((from[h] - from[g]) / (slope_g - slope_h), 0.0, 1.0);
    return std::max(from[g] + level * slope_g, from[h] + level * slope_h) > 2 * rounding;
  }

  /// Finds where an edge enters and leaves, if at most one end is inside.
  Kept cut(bool from_inside, bool to_inside, Crossing& enter, Crossing& leave) const {
    if (from_inside) {
      leave = exit(true);
    } else if (to_inside) {
      enter = exit(false);
    } else {
      if (outside()) return Kept::kNothing;
      std::tie(enter, leave) = passage();
      if (enter.plane < 0 || leave.plane < 0) return Kept::kUncertain;
      if (misses(enter.plane, leave.plane)) return Kept::kNothing;
    }
    return Kept::kPart;
  }
};

}  // namespace

template <class Lanes>
Signs SignTable::fill(const Solid& of, const Solid& by, double rounding) {
  stride = by.stride;
  rows.resize(static_cast<size_t>(of.vertices) * stride);
  outside.resize(of.vertices);
  beyond.resize(of.vertices);
  // Local copies: as far as the compiler knows, storing a sign might move the arrays.
  const double *nx = by.nx.data(), *ny = by.ny.data(), *nz = by.nz.data(), *offset = by.offset.data();
  const double *vx = of.x.data(), *vy = of.y.data(), *vz = of.z.data(), *doubt = of.doubt.data();
  double* signs = rows.data();
  const ptrdiff_t vertices = of.vertices, planes = stride;
  bool uncertain = false;
  double most_doubt = 0;
  std::uint64_t beyond_of_all = ~std::uint64_t{0};
  for (ptrdiff_t i = 0; i < vertices; ++i, signs += planes) {
    const double x = vx[i], y = vy[i], z = vz[i];
    Lanes farthest = -kInfinity - Lanes{};
    std::uint64_t marked = 0, sure = 0;
    for (ptrdiff_t j = 0; j < planes; j += kLanes<Lanes>) {
      Lanes normal_x, normal_y, normal_z, height;
      read(nx + j, normal_x);
      read(ny + j, normal_y);
      read(nz + j, normal_z);
      read(offset + j, height);
      const Lanes s = normal_x * x + normal_y * y + normal_z * z - height;
      store(signs + j, s);
      choose(farthest > s, farthest, s, farthest);
      marked |= std::uint64_t{bits_of(s > 0.0)} << j % 64;
      sure |= std::uint64_t{bits_of(s > rounding)} << j % 64;
    }
    double s = farthest[0];
    for (int k = 1; k < kLanes<Lanes>; ++k) s = std::max(s, farthest[k]);
    outside[i] = marked, beyond[i] = sure;
    beyond_of_all &= sure;
    uncertain |= std::abs(s) <= rounding + doubt[i];
    most_doubt = std::max(most_doubt, doubt[i]);
  }
  plain = planes <= 64 && most_doubt == 0;
  if (of.whole && (plain ? beyond_of_all != 0 : beyond_a_plane(rounding + most_doubt))) return Signs::kSeparated;
  return uncertain ? Signs::kUncertain : Signs::kCertain;
}

/// True if all vertices are farther than `margin` outside the same plane.
bool SignTable::beyond_a_plane(double margin) const {
  std::uint64_t shared = ~std::uint64_t{0};
  for (std::uint64_t marked : outside) shared &= marked;
  bool found = false;
  for_each_plane(shared, stride, [&](int j) {
    double nearest = kInfinity;
    for (size_t k = j; k < rows.size(); k += stride) nearest = std::min(nearest, rows[k]);
    found |= nearest > margin;
  });
  return found;
}

/// Finds the common polytope, once its two solids are set.
template <class Lanes>
class EdgeCutter {
 public:
  EdgeCutter(TableClipping& clipping, double rounding, bool may_be_shallow)
      : w_(clipping), rounding_(rounding), may_be_shallow_(may_be_shallow) {}

  Signs run() {
    const Signs one = w_.first_signs.template fill<Lanes>(w_.first, w_.second, rounding_);
    if (one == Signs::kSeparated) return one;
    const Signs other = w_.second_signs.template fill<Lanes>(w_.second, w_.first, rounding_);
    if (other == Signs::kSeparated) return other;
    if (one == Signs::kUncertain || other == Signs::kUncertain) return Signs::kUncertain;

    const size_t most_edges = w_.first.edges.size() + w_.second.edges.size();
    const size_t most_vertices = w_.first.vertices + w_.second.vertices + 2 * most_edges;
    w_.vertices.begin_with_room(most_vertices);
    w_.corners.begin_with_room(most_vertices);
    w_.doubt.begin_with_room(most_vertices);
    w_.edges.begin_with_room(most_edges);
    w_.seam.begin_with_room(2 * most_edges);
    w_.unpaired = 0;
    w_.open.resize(static_cast<size_t>(w_.first.facets) * w_.second.facets, 0);
    const bool certain = cut_edges(w_.first, w_.first_signs, w_.first_vertex, true) &&
                         cut_edges(w_.second, w_.second_signs, w_.second_vertex, false) && w_.unpaired == 0;
    if (!certain) {
      std::fill(w_.open.begin(), w_.open.end(), 0);
      return Signs::kUncertain;
    }
    return w_.vertices.empty() ? Signs::kSeparated : Signs::kCertain;
  }

 private:
  int add_vertex(Vec3 v, double doubt, const CornerSource& corner) {
    const int number = static_cast<int>(w_.vertices.size());
    w_.vertices.push_back(v);
    w_.doubt.push_back(doubt);
    w_.corners.push_back(corner);
    return number;
  }

  bool cut_edges(const Solid& body, const SignTable& signs, std::vector<int>& common_vertex, bool is_first) {
    common_vertex.resize(body.vertices);
    int* const common_vertices = common_vertex.data();
    const std::uint64_t *outside = signs.outside.data(), *beyond = signs.beyond.data();
    const double* doubts = body.doubt.data();
    for (int i = 0; i < body.vertices; ++i)
      common_vertices[i] = outside[i] == 0 ? add_vertex(body.vertex(i), doubts[i], {is_first ? 0 : 1, i, {}}) : -1;
    const int offset = is_first ? 0 : w_.first.facets, other_offset = w_.first.facets - offset;
    const double* rows = signs.rows.data();
    const ptrdiff_t stride = signs.stride;
    const bool plain = signs.plain;
    for (const Edge& e : body.edges) {
      if (plain && (beyond[e.from] & beyond[e.to]) != 0) continue;
      Edge common{common_vertices[e.from], common_vertices[e.to], e.left + offset, e.right + offset};
      const bool from_inside = common.from >= 0, to_inside = common.to >= 0;
      if (!(from_inside && to_inside)) {
        const EdgeSigns edge{rows + e.from * stride, rows + e.to * stride,
                             outside[e.from],        outside[e.to],
                             signs.stride,           rounding_ + std::max(doubts[e.from], doubts[e.to])};
        Crossing enter{-1, 0}, leave{-1, 0};
        const Kept kept = edge.cut(from_inside, to_inside, enter, leave);
        if (kept == Kept::kNothing) continue;
        if (kept == Kept::kUncertain) return false;
        const Vec3 from = body.vertex(e.from), along = body.vertex(e.to) - from;
        const double length = std::abs(along.x) + std::abs(along.y) + std::abs(along.z);
        const auto cross = [&](Crossing crossing, bool enters, int& vertex) {
          const double doubt = edge.doubt(crossing, length);
          if (!edge.template certain<Lanes>(crossing, doubt)) {
            if (!may_be_shallow_ || !edge.certain_by_plane(crossing)) return false;
            w_.shallow = true;
          }
          vertex = add_vertex(from + crossing.at * along, doubt,
                              {-1, -1, {common.left, common.right, crossing.plane + other_offset}});
          meet(e, crossing.plane, vertex, enters, is_first);
          return true;
        };
        if (!from_inside && !cross(enter, true, common.from)) return false;
        if (!to_inside && !cross(leave, false, common.to)) return false;
      }
      w_.edges.push_back(common);
    }
    return true;
  }

  /// An edge of one body meets a facet of the other in a common vertex, where two edges of the seam end. A walk around
  /// the facet on the edge's left follows the edge up to the exit, and turns onto the other body.
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

  TableClipping& w_;
  double rounding_;
  bool may_be_shallow_;
};

namespace {

using Run = Signs(TableClipping&, double rounding, bool may_be_shallow);

template <class Lanes>
Signs run_by(TableClipping& clipping, double rounding, bool may_be_shallow) {
  return EdgeCutter<Lanes>(clipping, rounding, may_be_shallow).run();
}

#ifdef OVERLAPPER_WIDER
OVERLAPPER_WIDER Signs run_by_wider(TableClipping& clipping, double rounding, bool may_be_shallow) {
  return run_by<Quad>(clipping, rounding, may_be_shallow);
}
Run* fastest_run() { return is_wider() ? run_by_wider : run_by<MostLanes>; }
#else
Run* fastest_run() { return run_by<MostLanes>; }
#endif

}  // namespace

Signs TableClipping::run(double rounding, bool may_be_shallow) {
  shallow = false;
  static Run* const run_fastest = fastest_run();
  planes_asked += first.facets + second.facets;
  return run_fastest(*this, rounding, may_be_shallow);
}

void TableClipping::take_common(double beyond) {
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
  next.doubt.assign(doubt.begin(), doubt.end());
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

void TableClipping::show_first() {
  vertices.begin_with_room(first.vertices);
  for (int i = 0; i < first.vertices; ++i) vertices.push_back(first.vertex(i));
  edges.begin_with_room(first.edges.size());
  for (const Edge& e : first.edges) edges.push_back(e);
  seam.begin_with_room(0);
  second.facets = 0;
}

}  // namespace overlapper
