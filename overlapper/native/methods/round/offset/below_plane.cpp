#include "methods/round/offset/below_plane.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "geometry/constants.h"
#include "geometry/rounding.h"
#include "geometry/scratch.h"
#include "geometry/wide_pose.h"
#include "methods/round/slicing/rules.h"

namespace overlapper::offset {
namespace {

/// Rounding of unit vectors: normals, directions of edges, and the plane's normal in the hull's coordinates.
constexpr double kTilt = 16 * kUnit;
/// Rounding of a term, relative to its size. No term takes more than 60 operations that each may round.
constexpr double kOfTerms = 64 * kUnit;

/// The plane in the coordinates of the core, in double-double.
class ExactPlane {
 public:
  ExactPlane(const WidePlane& given, const Placed& flat, const Placed& hull) {
    const Vec3 origin = data_origin(hull.shape), origin_of_flat = data_origin(flat.shape);
    WideVector normal = given.normal;
    if (!unturned(flat.orientation)) normal = wide_rotation(flat.orientation) * normal;
    const WideVector apart = wide(flat.position) - wide(hull.position);
    offset_ = given.offset + dot(given.normal, wide(origin_of_flat)) + dot(normal, apart);
    const bool turned = !unturned(hull.orientation);
    if (turned) normal = apply_transposed(wide_rotation(hull.orientation), normal);
    normal_ = normal;
    offset_ = offset_ - dot(normal, wide(origin));
    const double size = std::abs(given.offset.head) + norm(flat.position) + norm(hull.position) + norm(origin) +
                        norm(origin_of_flat) + reach(hull.shape);
    rounding = wide_placing(size, turned || !unturned(flat.orientation));
  }
  DoubleDouble height(Vec3 point) const { return dot(normal_, wide(point)) - offset_; }
  Vec3 normal() const { return rounded(normal_); }

  double rounding;  ///< m

 private:
  WideVector normal_;
  DoubleDouble offset_;
};

/// The part of a vertex in the sums over its edges.
struct Corner {
  double height = 0;   ///< m, above the plane
  double depth = 0;    ///< m, of the ball around the vertex
  bool exact = false;  ///< these come from double-doubles
  // Of the arcs between the normals of its facets, as far as they are below the plane.
  double arcs = 0, size = 0;
  double turned = 0;      ///< angle about the plane's normal
  double whole_turn = 0;  ///< the same of whole arcs
  double cut = 0;         ///< number of arcs that the plane cuts
  double products = 0;    ///< of the directions and the normals of whole arcs, for the whole part of a sphere
};

struct Work {
  std::vector<Corner> corners;
  std::vector<Vec3> flat;  ///< for each facet, its normal seen along the plane's normal
};

/// ∫ f(1 - cos ψ) dψ, by a rule of Gauss and Legendre.
template <class F>
double integral(double low, double high, F f) {
  const double half = (high - low) / 2;
  if (!(half > 0)) return 0;
  const double middle = (high + low) / 4, sine = std::sin(middle), cosine = std::cos(middle);
  // The functions are trigonometric polynomials up to cos 3ψ, or have poles at least π/2 away from the range. For a
  // range of this width, the rule of 8 nodes has an error of 2e-15. That of 16 has less, up to the width π.
  constexpr double kNarrow = 0.75;
  const auto by = [&](const auto& nodes) {
    double sum = 0;
    for (const slicing::Node& node : nodes) {
      const double quarter = (1 - 2 * node.fraction) * half / 2;
      const double s = std::sin(quarter), c = std::cos(quarter);
      const double low_sine = sine * c - cosine * s, high_sine = sine * c + cosine * s;
      // The weights of these nodes are for an integral over cos θ.
      sum += node.weight / node.sine * (f(2 * low_sine * low_sine) + f(2 * high_sine * high_sine));
    }
    return sum;
  };
  return 4 * half / kPi * (2 * half <= kNarrow ? by(slicing::kNodes8) : by(slicing::kNodes16));
}

/// The angle from a to b, as seen in the plane.
double angle_between(Vec3 a, Vec3 b) { return std::atan2(a.x * b.y - a.y * b.x, a.x * b.x + a.y * b.y); }

class BelowPlane {
 public:
  BelowPlane(const OffsetSurface& surface, const HullData& hull, double radius, Vec3 normal, Work& work)
      : surface_(surface), hull_(hull), r_(radius), n_(normal), work_(work) {}

  /// Adds all features. The corners have their heights and depths.
  bool add_all() {
    x_ = any_orthogonal(n_), y_ = cross(x_, n_);
    work_.flat.resize(surface_.facets.size());
    for (const Corner& corner : work_.corners) deepest_ = std::max(deepest_, corner.depth);
    for (int f = 0; f < static_cast<int>(surface_.facets.size()); ++f) add_facet(f);
    for (const OffsetSurface::Edge& edge : surface_.edges) add_edge(edge);
    for (size_t v = 0; v < work_.corners.size(); ++v)
      if (!add_vertex(work_.corners[v], surface_.vertices[v])) return false;
    return true;
  }

  double volume() const { return volume_; }
  /// If heights of vertices may be off by `rounding`.
  double error(double rounding) const {
    const double steepest = std::min(2.0, deepest_ / r_);
    const double off = rounding + r_ * kTilt * (std::sqrt(2 * steepest) + kTilt) + kOfTerms * deepest_;
    return off * area_ + kTilt * tilted_ + kOfTerms * size_;
  }

 private:
  void add(double term) { volume_ += term, size_ += std::abs(term); }

  void add_facet(int f) {
    const OffsetSurface::Facet& facet = surface_.facets[f];
    work_.flat[f] = {dot(facet.normal, x_), dot(facet.normal, y_), 0};
    // The normal of a facet along that of the plane has no direction there. Any direction will do for all its arcs.
    if (work_.flat[f] == Vec3{}) work_.flat[f].x = 1e-100;
    const auto ring = hull_.facet(f);
    double most = -kInfinity, least = kInfinity;
    size_t lowest = 0;
    for (size_t i = 0; i < ring.size(); ++i) {
      const double height = work_.corners[ring[i]].height;
      if (height < least) least = height, lowest = i;
      most = std::max(most, height);
    }
    if (!(least < r_)) return;
    const double steep = norm2(n_ + facet.normal) / 2;  // 1 + n·u
    const double moved = r_ * (steep - 1);
    if (!(least + moved < 0)) return;
    double twice_area = 0, heights = 0, crossed = 0;
    if (ring.size() == 3 && !(most + moved > 0)) {
      twice_area = 2 * facet.area;
      for (const int v : ring) heights += depth_below(v, steep);
      heights *= twice_area;
    } else {
      // A fan of triangles from the lowest corner.
      const Vec3 apex = hull_.vertices[ring[lowest]];
      const double apex_depth = depth_below(ring[lowest], steep);
      Vec3 last, here{};
      double last_depth = 0, depth = apex_depth;
      bool first = true;
      const auto put = [&](Vec3 at, double at_depth) {
        if (!first) {
          const double twice = norm(cross(last, at));
          twice_area += twice, heights += twice * (apex_depth + last_depth + at_depth);
          crossed += std::sqrt(norm2(last) * norm2(at));
        }
        first = false, last = at, last_depth = at_depth;
      };
      for (size_t i = 1; i <= ring.size(); ++i) {
        const int v = ring[(lowest + i) % ring.size()];
        const bool closing = i == ring.size();
        const Vec3 next = closing ? Vec3{} : hull_.vertices[v] - apex;
        const double next_depth = closing ? apex_depth : depth_below(v, steep);
        if ((depth > 0) != (next_depth > 0)) {
          // From the lower end, so that a small corner has all digits.
          const bool falls = next_depth > 0;
          const Vec3 low = falls ? next : here, high = falls ? here : next;
          const double low_depth = falls ? next_depth : depth, high_depth = falls ? depth : next_depth;
          put(low + low_depth / (low_depth - high_depth) * (high - low), 0);
        }
        if (next_depth > 0 && !closing) put(next, next_depth);
        here = next, depth = next_depth;
      }
    }
    add((1 - steep) * heights / 6);
    area_ += std::abs(1 - steep) * twice_area / 2;
    tilted_ += heights / 6 + crossed * deepest_;
  }

  /// How deep a vertex of a facet that is moved out is below the plane.
  double depth_below(int v, double steep) const { return work_.corners[v].depth - r_ * steep; }

  void add_edge(const OffsetSurface::Edge& edge) {
    Corner &from = work_.corners[edge.from], &to = work_.corners[edge.to];
    if (!(from.depth > 0 || to.depth > 0)) return;
    const double s = dot(n_, edge.along), to_middle = dot(n_, edge.middle);
    const double product = s * edge.chord * to_middle;
    from.products += product, to.products -= product;
    if (from.depth >= 2 * r_ && to.depth >= 2 * r_) {
      const double to_across = dot(n_, edge.across), height = (from.height + to.height) / 2;
      const double first = height * edge.chord * to_middle;
      const double second = r_ * (edge.of_middle * to_middle * to_middle + edge.of_across * to_across * to_across);
      const double scale = r_ * edge.length;
      volume_ += scale * (first + second), size_ += scale * (std::abs(first) + second);
      area_ += scale * edge.angle, tilted_ += 2 * scale * std::abs(height);
      return;
    }
    // u = -cos ψ m + sin ψ k, and n = s e + c m, for the direction e of the edge.
    Vec3 k = cross(n_, edge.along);
    k -= dot(k, edge.along) * edge.along;
    k = norm2(k) > 1e-30 ? unit(k) : any_orthogonal(edge.along);
    const Vec3 m = cross(edge.along, k);
    const double c = dot(n_, m), flat = s * s / (1 + c);  // 1 - c
    const bool down = from.depth >= to.depth;
    const Corner &low = down ? from : to, &high = down ? to : from;
    const Vec3 left = surface_.facets[edge.left].normal, right = surface_.facets[edge.right].normal;
    const double rc = r_ * c;
    if (low.height <= -2 * rc && high.height >= 2 * rc) {
      // Along each line of the band, the depth falls from low to high and through zero.
      const double a = low.height, sine0 = dot(left, k), sine1 = dot(right, k);
      const double cosine0 = -dot(left, m), cosine1 = -dot(right, m), sine = sine1 - sine0;
      const double square = (edge.angle + sine1 * cosine1 - sine0 * cosine0) / 2;
      const double cube = sine - (sine1 * sine1 * sine1 - sine0 * sine0 * sine0) / 3;
      const double scale = rc * edge.length / (2 * (high.height - low.height));
      volume_ += scale * (a * a * sine - 2 * a * rc * square + rc * rc * cube);
      const double most = a * a + 2 * std::abs(a) * rc + rc * rc, length = edge.length * 2 * -a / (high.height - a);
      size_ += scale * most * (std::abs(sine) + edge.angle);
      area_ += rc * edge.angle * length, tilted_ += 4 * scale * most + r_ * length * deepest_;
    } else if (low.depth > r_ * flat) {
      const double start = std::atan2(dot(left, k), -dot(left, m));
      add_band(edge, low, high, c, flat, start);
    }
    if (between(from) || between(to)) {
      const double start = std::atan2(dot(left, k), -dot(left, m));
      if (between(from)) add_arc(from, edge, -1, s, c, flat, start, m, k);
      if (between(to)) add_arc(to, edge, 1, s, c, flat, start, m, k);
    }
  }

  bool between(const Corner& corner) const { return corner.depth > 0 && corner.depth < 2 * r_; }

  /// ψ up to which the band or the arc is below the plane; negative if all is above.
  static double widest(double steepest, double c, double flat) {
    if (!(steepest > flat)) return -1;
    const double square = (steepest - flat) / (2 * c);
    return square < 1 ? 2 * std::asin(std::sqrt(square)) : kPi;
  }

  /// Calls f(low, high) for the parts of a range that are within `width` of 0 or of a full turn.
  template <class F>
  static void within(double start, double end, double width, F f) {
    for (const double turn : {0.0, 2 * kPi}) {
      const double low = std::max(start - turn, -width), high = std::min(end - turn, width);
      if (low < high) f(low, high);
    }
  }

  /// Adds the band of a cylinder where only its lower end, or both ends are below the plane.
  void add_band(const OffsetSurface::Edge& edge, const Corner& low, const Corner& high, double c, double flat,
                double start) {
    const double to_low = widest(low.depth / r_, c, flat), to_high = widest(high.depth / r_, c, flat);
    const double rc = r_ * c, fall = low.depth - high.depth;
    const double partly = fall > 0 ? rc * edge.length / (2 * fall) : 0, fully = rc * edge.length / 2;
    const auto depth = [&](const Corner& corner, double versine) { return corner.depth - r_ * (flat + c * versine); };
    // With 1 - cos ψ = v.
    const auto of_part = [&](double v) {
      const double deep = depth(low, v);
      return partly * deep * deep * (1 - v);
    };
    const auto of_whole = [&](double v) { return fully * (depth(low, v) + depth(high, v)) * (1 - v); };
    const auto add_range = [&](double from, double to, const auto& f) {
      const double term = integral(from, to, f);
      volume_ += term, size_ += std::abs(term);
    };
    const double deep = low.depth - r_ * flat;
    const double length = edge.length * (high.depth > 0 || !(fall > 0) ? 1 : std::min(1.0, deep / fall));
    within(start, start + edge.angle, to_low, [&](double from, double to) {
      const double inner_from = std::max(from, -to_high), inner_to = std::min(to, to_high);
      if (inner_from < inner_to) {
        add_range(from, inner_from, of_part), add_range(inner_from, inner_to, of_whole);
        add_range(inner_to, to, of_part);
      } else {
        add_range(from, to, of_part);
      }
      area_ += rc * (to - from) * length;
      if (std::max(std::abs(from), std::abs(to)) > kPi / 2) size_ += rc * (to - from) * length * deep;
      // An end at a facet may be off, but not an end in the plane.
      for (const double end : {from, to})
        if (std::abs(end) < to_low) {
          const double sine = std::sin(end / 2), at = depth(low, 2 * sine * sine);
          tilted_ += r_ * length * at;
        }
    });
  }

  /// Adds an arc between the normals of two facets at a vertex. `side` is 1 if the arc from left to right is
  /// counter-clockwise around the normals of the vertex, and -1 if not.
  void add_arc(Corner& corner, const OffsetSurface::Edge& edge, double side, double s, double c, double flat,
               double start, Vec3 m, Vec3 k) {
    double depth = corner.depth, out = -side * s, turns = side;
    if (depth > r_) {
      // The part above the plane is the smaller one. Seen from there, everything is turned by half.
      depth = 2 * r_ - depth, out = -out, turns = -turns;
      start += start > 0 ? -kPi : kPi;
      m = -m, k = -k;
    }
    const double whole = angle_between(work_.flat[edge.left], work_.flat[edge.right]);
    corner.whole_turn += turns * whole;
    const double width = widest(depth / r_, c, flat);
    const double squared = r_ * r_;
    const auto f = [&](double versine) {
      const double q = flat + c * versine;
      return (depth - (r_ + depth) * q / 2 + r_ * q * q / 3) / (2 - q);
    };
    const auto at = [&](double psi) {
      const double cosine = std::cos(psi), sine = std::sin(psi);
      return Vec3{-cosine * dot(m, x_) + sine * dot(k, x_), -cosine * dot(m, y_) + sine * dot(k, y_), 0};
    };
    within(start, start + edge.angle, width, [&](double from, double to) {
      const double term = squared * out * integral(from, to, f);
      corner.arcs += term, corner.size += std::abs(term);
      const bool cut_from = from <= -width, cut_to = to >= width;
      double part =
          angle_between(cut_from ? at(from) : work_.flat[edge.left], cut_to ? at(to) : work_.flat[edge.right]);
      // An arc past the pole of the plane turns by half, one way or the other: always as the whole arc does.
      if (part * whole < 0 && std::abs(part) > kPi / 2) part += std::copysign(2 * kPi, whole);
      corner.turned += turns * part;
      corner.cut += 1;
      tilted_ += squared * depth * (to - from);
    });
  }

  bool add_vertex(const Corner& corner, const OffsetSurface::Vertex& vertex) {
    if (!(corner.depth > 0)) return true;
    if (corner.depth > r_) {
      const double first = r_ * r_ * corner.height * dot(n_, vertex.normals);
      const double second = r_ * r_ * r_ / 3 * (vertex.solid_angle - corner.products);
      volume_ += first + second, size_ += std::abs(first) + std::abs(second) + r_ * r_ * r_ * kUnit;
      area_ += r_ * r_ * vertex.solid_angle, tilted_ += r_ * r_ * deepest_;
      if (!between(corner)) return true;
    }
    const bool above = corner.depth > r_;
    const double depth = above ? 2 * r_ - corner.depth : corner.depth;
    const double cap = depth * depth * (3 * r_ - depth) / 6;  // for each radian
    // One turn if the lowest point of the sphere is over the vertex, or none; the other way if its highest point is.
    const double turns = corner.whole_turn / (2 * kPi);
    constexpr double kClosed = 1e-6;
    if (std::abs(turns - std::round(turns)) > kClosed || std::abs(turns) > 1.5) return false;
    const double angle = (turns > 0.5 ? 2 * kPi : 0) - corner.turned;
    const double part = corner.arcs + cap * angle;
    volume_ += above ? -part : part;
    const double reached = corner.cut > 0 || turns > 0.5 ? 1 : 0;
    size_ += corner.size + reached * cap * (2 * kPi + corner.cut);
    area_ += reached * 2 * kPi * r_ * depth;
    tilted_ += corner.cut * cap / std::sqrt(depth / r_);
    return true;
  }

  const OffsetSurface& surface_;
  const HullData& hull_;
  double r_;
  Vec3 n_, x_, y_;
  Work& work_;
  double volume_ = 0;
  double size_ = 0;     ///< m³: sum of the sizes of all terms
  double area_ = 0;     ///< m²: bound of the area below the plane, seen along the plane's normal
  double tilted_ = 0;   ///< m³: what a tilt of unit vectors by 1 rad would add
  double deepest_ = 0;  ///< m
};

}  // namespace

std::optional<VolumeAlone> volume_below_plane(const Placed& rounded_hull, const Placed& flat, int facet) {
  const HullData& hull = *polytope_of(rounded_hull.shape);
  const OffsetSurface& surface = offset_surface(hull);
  const std::optional<WidePlane> exact = unit_facet(flat.shape, facet);
  if (!surface.exact || !exact) return std::nullopt;
  const double r = core_radius(rounded_hull.shape);
  const Plane plane = flat.pose * overlapper::facet(flat.shape, facet);
  Vec3 normal = apply_transposed(rounded_hull.pose.rotation, plane.normal);
  const double offset = -signed_distance(plane, rounded_hull.pose.translation);
  const double size = std::abs(plane.offset) + norm(flat.pose.translation) + reach(flat.shape) +
                      norm(rounded_hull.pose.translation) + reach(rounded_hull.shape);
  double off = rounding(reach(rounded_hull, reach(flat, size)));
  const Scratch<Work> work;
  work->corners.assign(hull.vertices.size(), {});
  double lowest = kInfinity;
  int below = 0;
  for (size_t v = 0; v < hull.vertices.size(); ++v) {
    const double height = dot(normal, hull.vertices[v]) - offset;
    work->corners[v].height = height;
    lowest = std::min(lowest, height), below += height < 0;
  }
  // The smaller part is measured: below the plane, or above it.
  const bool mostly = 2 * below > static_cast<int>(hull.vertices.size());
  const double side = mostly ? -1 : 1;
  // Up to this rounding of heights, the error of the volume is some 2e-13 of it.
  constexpr double kSure = 0x1p-44;
  if (off < kSure * (r - lowest)) {
    for (Corner& corner : work->corners) corner.height *= side, corner.depth = r - corner.height;
  } else {
    const ExactPlane exactly(*exact, flat, rounded_hull);
    normal = exactly.normal();
    for (Corner& corner : work->corners) corner.height *= side, corner.depth = r - corner.height;
    const auto place = [&](int v) {
      Corner& corner = work->corners[v];
      if (std::exchange(corner.exact, true)) return;
      const DoubleDouble height = DoubleDouble{side} * exactly.height(hull.vertices[v]);
      corner.height = height.head, corner.depth = (DoubleDouble{r} - height).head;
    };
    for (const OffsetSurface::Edge& edge : surface.edges)
      if (std::max(work->corners[edge.from].depth, work->corners[edge.to].depth) >= -off)
        place(edge.from), place(edge.to);
    off = exactly.rounding;
  }
  BelowPlane part(surface, hull, r, side * normal, *work);
  if (!part.add_all()) return std::nullopt;
  VolumeAlone found{part.volume(), part.error(off)};
  if (mostly) {
    const double whole = surface.volume(r);
    found = {whole - found.volume, found.error + kOfTerms * whole};
  }
  if (!(found.volume > 0 && found.error <= kEnough * found.volume)) return std::nullopt;
  return found;
}

}  // namespace overlapper::offset
