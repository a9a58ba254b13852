#include "methods/round/offset/in_polytope.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/cancellation.h"
#include "geometry/constants.h"
#include "geometry/rounding.h"
#include "geometry/scratch.h"
#include "methods/round/offset/below_plane.h"
#include "methods/round/offset/solid_angle.h"

namespace overlapper::offset {
namespace {

constexpr double kRoundingOfTerms = 64 * kUnit;
constexpr int kNone = -1;

/// A plane of the polytope. Its area in the rounded hull is an integral along its border, about a point of it.
struct Face {
  Plane plane;
  Vec3 origin;
  double twice_area = 0;
  Vec3 open;  ///< m: the sum of all steps along the border, zero if it is closed
};

/// What of an edge of the polytope is in the rounded hull, as a fraction of the edge.
struct Ridge {
  double from = 0, to = 1;
  bool enters = false, leaves = false;
};

/// Planes of the polytope that all points of a sphere are below, or above: bit j for plane j.
struct Sides {
  std::uint64_t below = 0, above = 0;
};
constexpr int kMostFaces = 64;

/// A plane that cuts the band of a cylinder, at height + r (middle cos φ + across sin φ) + slope t = 0.
struct Cut {
  int plane;
  double height, middle, across, slope;
  double first, last;  ///< bounds of t
};

struct PolytopeWork {
  std::vector<Vec3> corners;  ///< of the polytope, in the coordinates of the core
  std::vector<Face> faces;
  std::vector<Ridge> ridges;
  std::vector<char> inside;     ///< for each corner of the polytope: 1 in the rounded hull, 0 outside, 2 not yet known
  std::vector<double> heights;  ///< of each vertex of the core above each plane
  std::vector<Sides> sides;     ///< of the sphere at each vertex of the core
  std::vector<int> active;
  std::vector<Cut> cuts;
  std::vector<double> breaks;
  struct Labelled {
    Vec3 at;
    int plane;  ///< of the segment that begins here; kNone for the facet's own border
  };
  std::vector<Labelled> polygon, clipped;
};

/// ∫ 1, cos, sin, cos², sin², cos sin over an interval.
struct Trigonometric {
  double one, c, s, cc, ss, cs;
  Trigonometric(double from, double to) {
    const double c0 = std::cos(from), s0 = std::sin(from), c1 = std::cos(to), s1 = std::sin(to);
    one = to - from, c = s1 - s0, s = c0 - c1;
    cc = (one + (s1 * c1 - s0 * c0)) / 2, ss = (one - (s1 * c1 - s0 * c0)) / 2, cs = (s1 * s1 - s0 * s0) / 2;
  }
};

class InPolytope {
 public:
  InPolytope(const Shape& rounded, std::span<const Edge> edges, Vec3 apex, double tie, PolytopeWork& work)
      : rounded_(rounded),
        surface_(offset_surface(*polytope_of(rounded))),
        hull_(*polytope_of(rounded)),
        r_(core_radius(rounded)),
        edges_(edges),
        apex_(apex),
        tie_(tie),
        work_(work),
        faces_(static_cast<int>(work.faces.size())),
        all_(~std::uint64_t{0} >> (kMostFaces - faces_)) {}

  bool add_all() {
    work_.ridges.assign(edges_.size(), {});
    for (int f = 0; f < static_cast<int>(surface_.facets.size()); ++f)
      if (!add_facet(f)) return false;
    for (const OffsetSurface::Edge& edge : surface_.edges)
      if (!add_edge(edge)) return false;
    for (int v = 0; v < static_cast<int>(surface_.vertices.size()); ++v)
      if (!add_vertex(v)) return false;
    return add_faces();
  }

  double volume() const { return thrice_ / 3; }
  /// If surfaces may be off by `rounding`. `extent` is the size of the common set.
  double error(double rounding, double extent) const {
    double open = 0;
    for (const Face& face : work_.faces) open += norm(face.open);
    return rounding * area_ + kRoundingOfTerms * (size_ + coarse_ * extent) +
           (norm(unbalanced_) + std::max(0.0, open - kRoundingOfTerms * border_) * extent) * extent;
  }

 private:
  double height(int v, int j) const { return work_.heights[v * faces_ + j]; }

  enum class Reach { kBeyond, kNear, kUnsure };
  /// Collects the planes that cut a feature around some vertices. `range(j)` is the least and the largest height above
  /// plane j. Beyond if the feature is above a plane. Unsure if it may touch one.
  template <class Range>
  Reach find_active(std::span<const int> vertices, Range range) {
    work_.active.clear();
    std::uint64_t below = ~std::uint64_t{0}, above = below;
    for (const int v : vertices) below &= work_.sides[v].below, above &= work_.sides[v].above;
    if (above != 0) return Reach::kBeyond;
    bool unsure = false;
    for (std::uint64_t rest = ~below & all_; rest != 0; rest &= rest - 1) {
      const int j = std::countr_zero(rest);
      const auto [least, most] = range(j);
      if (least > tie_) return Reach::kBeyond;
      unsure = unsure || least > -tie_ || std::abs(most) < tie_;
      if (most > 0) work_.active.push_back(j);
    }
    return unsure ? Reach::kUnsure : Reach::kNear;
  }
  /// The least and the largest dot(normal, u) over the normals u of an edge.
  static std::pair<double, double> range_over(const OffsetSurface::Edge& edge, Vec3 normal) {
    const double m = dot(normal, edge.middle), a = dot(normal, edge.across);
    const double sine = edge.chord / 2, cosine = std::sqrt(std::max(0.0, (1 - sine) * (1 + sine)));
    const double left = m * cosine - a * sine, right = m * cosine + a * sine;
    // The direction of the plane's normal across the edge is between the normals of the facets.
    const bool between = std::abs(a) * cosine <= std::abs(m) * sine;
    const double size = between ? std::sqrt(m * m + a * a) : 0;
    return {between && m < 0 ? -size : std::min(left, right), between && m > 0 ? size : std::max(left, right)};
  }

  void add_area(Vec3 vector, double cone) {
    unbalanced_ += vector, thrice_ += cone;
    size_ += std::abs(cone);
  }
  /// Adds to the border of a face: its step, and twice the area vector that it spans with the face's origin.
  void add_border(int j, Vec3 step, Vec3 twice) {
    Face& face = work_.faces[j];
    face.open += step, border_ += std::sqrt(norm2(step));
    const double term = dot(face.plane.normal, twice);
    face.twice_area += term, size_ += std::abs(term) * std::abs(signed_distance(face.plane, apex_));
  }

  /// An edge of the polytope passes through the surface at a point with this outward direction.
  bool pierce(int j, int k, Vec3 at, Vec3 outward) {
    for (size_t e = 0; e < edges_.size(); ++e) {
      const Edge& edge = edges_[e];
      if (!((edge.left == j && edge.right == k) || (edge.left == k && edge.right == j))) continue;
      const Vec3 from = work_.corners[edge.from], way = work_.corners[edge.to] - from;
      const double length = std::sqrt(norm2(way)), fraction = dot(at - from, way) / (length * length);
      const double slope = dot(outward, way);
      // Near a corner of the polytope, or along its edge, other edges may pass on the other side of it.
      constexpr double kAlong = 1e-9;
      if (!(std::min(fraction, 1 - fraction) * length > tie_ && std::abs(slope) > kAlong * length)) return false;
      Ridge& ridge = work_.ridges[e];
      if (slope > 0) {
        if (ridge.leaves) return false;
        ridge.leaves = true, ridge.to = fraction;
      } else {
        if (ridge.enters) return false;
        ridge.enters = true, ridge.from = fraction;
      }
      return true;
    }
    return false;
  }

  // ---------------------------------------------------------------------------------------------------------- facets

  bool add_facet(int f) {
    const OffsetSurface::Facet& facet = surface_.facets[f];
    const auto ring = hull_.facet(f);
    const auto range = [&](int j) {
      double least = kInfinity, most = -kInfinity;
      for (const int v : ring) least = std::min(least, height(v, j)), most = std::max(most, height(v, j));
      const double moved = r_ * dot(facet.normal, work_.faces[j].plane.normal);
      return std::pair(least + moved, most + moved);
    };
    if (const Reach reached = find_active(ring, range); reached != Reach::kNear) return reached == Reach::kBeyond;
    const double reach = dot(facet.normal, hull_.vertices[ring[0]] - apex_) + r_;
    if (work_.active.empty()) {
      area_ += facet.area;
      add_area(facet.area * facet.normal, facet.area * reach);
      return true;
    }
    auto &polygon = work_.polygon, &clipped = work_.clipped;
    polygon.clear();
    for (const int v : ring) polygon.push_back({hull_.vertices[v] + r_ * facet.normal, kNone});
    for (const int j : work_.active) {
      const Plane& plane = work_.faces[j].plane;
      clipped.clear();
      const size_t n = polygon.size();
      const auto touches = [&](const PolytopeWork::Labelled& corner) {
        return std::abs(signed_distance(plane, corner.at)) < tie_;
      };
      if (std::ranges::any_of(polygon, touches)) return false;
      for (size_t i = 0; i < n; ++i) {
        const PolytopeWork::Labelled here = polygon[i], next = polygon[(i + 1) % n];
        const double above = signed_distance(plane, here.at), then = signed_distance(plane, next.at);
        const auto crossing = [&] { return here.at + above / (above - then) * (next.at - here.at); };
        if (above < 0) {
          clipped.push_back(here);
          if (!(then < 0)) clipped.push_back({crossing(), j});
        } else if (then < 0) {
          clipped.push_back({crossing(), here.plane});
        }
      }
      polygon.swap(clipped);
      if (polygon.size() < 3) return true;
    }
    const Vec3 first = polygon[0].at;
    Vec3 twice;
    for (size_t i = 0; i < polygon.size(); ++i) {
      const PolytopeWork::Labelled &before = polygon[(i + polygon.size() - 1) % polygon.size()], &here = polygon[i],
                                   &next = polygon[(i + 1) % polygon.size()];
      if (i > 0) twice += cross(here.at - first, next.at - first);
      if (here.plane == kNone) continue;
      const Vec3 origin = work_.faces[here.plane].origin;
      add_border(here.plane, here.at - next.at, cross(next.at - origin, here.at - origin));
      if (before.plane != kNone && !pierce(before.plane, here.plane, here.at, facet.normal)) return false;
    }
    const double area = dot(twice, facet.normal) / 2;
    area_ += area;
    add_area(area * facet.normal, area * reach);
    return true;
  }

  // ----------------------------------------------------------------------------------------------------------- edges

  /// Adds to the breaks the angles within ±`half` at which a cosine + b sine = c.
  void add_roots(double a, double b, double c, double half) {
    const double size = std::sqrt(a * a + b * b);
    if (!(std::abs(c) < size)) return;
    const double middle = std::atan2(b, a), off = std::acos(c / size);
    for (const double root : {middle - off, middle + off})
      for (const double turn : {-2 * kPi, 0.0, 2 * kPi})
        if (std::abs(root + turn) < half) work_.breaks.push_back(root + turn);
  }

  /// Collects the active planes that may be the first to end some line of a band, of all lines along its edge. False if
  /// no line has a part below all planes.
  bool find_cuts(const OffsetSurface::Edge& edge) {
    work_.cuts.clear();
    double low = 0, high = edge.length;
    for (const int j : work_.active) {
      const Vec3 n = work_.faces[j].plane.normal;
      const double slope = dot(n, edge.along), from = height(edge.from, j);
      const auto [least, most] = range_over(edge, n);
      const double one = -(from + r_ * least) / slope, other = -(from + r_ * most) / slope;
      work_.cuts.push_back(
          {j, from, dot(n, edge.middle), dot(n, edge.across), slope, std::min(one, other), std::max(one, other)});
      if (slope > 0) high = std::min(high, one);
      if (slope < 0) low = std::max(low, one);
    }
    std::erase_if(work_.cuts, [&](const Cut& cut) {
      return (cut.slope > 0 && cut.first > high) || (cut.slope < 0 && cut.last < low);
    });
    return low < high;
  }

  bool add_edge(const OffsetSurface::Edge& edge) {
    const auto range = [&](int j) {
      const double from = height(edge.from, j), to = height(edge.to, j);
      const auto [least, most] = range_over(edge, work_.faces[j].plane.normal);
      return std::pair(std::min(from, to) + r_ * least, std::max(from, to) + r_ * most);
    };
    const Reach reached = find_active(std::array{edge.from, edge.to}, range);
    if (reached != Reach::kNear) return reached == Reach::kBeyond;
    const Vec3 a = hull_.vertices[edge.from];
    const Vec3 from_apex = a - apex_;
    if (work_.active.empty()) {
      const double area = r_ * edge.length;
      area_ += area * edge.angle;
      add_area(area * edge.chord * edge.middle, area * (dot(from_apex, edge.middle) * edge.chord + r_ * edge.angle));
      return true;
    }
    if (!find_cuts(edge)) return true;
    const double half = edge.angle / 2;
    work_.breaks.assign(1, -half);
    const std::span<const Cut> all = work_.cuts;
    const size_t count = all.size();
    for (const Cut& cut : all) {
      constexpr double kAlong = 1e-9;
      if (std::abs(cut.slope) < kAlong) return false;
      add_roots(cut.middle, cut.across, -cut.height / r_, half);
      add_roots(cut.middle, cut.across, -(cut.height + cut.slope * edge.length) / r_, half);
    }
    const auto at = [&](const Cut& cut, double cosine, double sine) {
      return -(cut.height + r_ * (cut.middle * cosine + cut.across * sine)) / cut.slope;
    };
    for (size_t i = 0; i < count; ++i)
      for (size_t k = 0; k < i; ++k) {
        const Cut &one = all[i], &other = all[k];
        const size_t before = work_.breaks.size();
        add_roots(one.middle * other.slope - other.middle * one.slope,
                  one.across * other.slope - other.across * one.slope,
                  -(one.height * other.slope - other.height * one.slope) / r_, half);
        for (size_t b = before; b < work_.breaks.size(); ++b) {
          const double cosine = std::cos(work_.breaks[b]), sine = std::sin(work_.breaks[b]), t = at(one, cosine, sine);
          if (!(t > 0 && t < edge.length)) continue;
          const auto keeps = [&](const Cut& cut) {
            return &cut == &one || &cut == &other ||
                   cut.height + r_ * (cut.middle * cosine + cut.across * sine) + cut.slope * t < 0;
          };
          const Vec3 outward = cosine * edge.middle + sine * edge.across;
          if (std::ranges::all_of(all, keeps) &&
              !pierce(one.plane, other.plane, a + t * edge.along + r_ * outward, outward))
            return false;
        }
      }
    work_.breaks.push_back(half);
    std::ranges::sort(work_.breaks);
    const double reach_middle = dot(from_apex, edge.middle), reach_across = dot(from_apex, edge.across);
    for (size_t i = 0; i + 1 < work_.breaks.size(); ++i) {
      const double begin = work_.breaks[i], end = work_.breaks[i + 1], between = (begin + end) / 2;
      if (!(begin < end)) continue;
      const double cosine = std::cos(between), sine = std::sin(between);
      double low = 0, high = edge.length;
      const Cut *lowest = nullptr, *highest = nullptr;
      for (const Cut& cut : all) {
        const double t = at(cut, cosine, sine);
        if (cut.slope < 0 && t > low) low = t, lowest = &cut;
        if (cut.slope > 0 && t < high) high = t, highest = &cut;
      }
      if (!(low < high)) continue;
      const Trigonometric w(begin, end);
      // The length is one + c cos + s sin.
      double one = edge.length, c = 0, s = 0;
      if (highest) {
        one = -highest->height / highest->slope;
        c = -r_ * highest->middle / highest->slope, s = -r_ * highest->across / highest->slope;
      }
      if (lowest) {
        one += lowest->height / lowest->slope;
        c += r_ * lowest->middle / lowest->slope, s += r_ * lowest->across / lowest->slope;
      }
      const double of_cosine = one * w.c + c * w.cc + s * w.cs, of_sine = one * w.s + c * w.cs + s * w.ss;
      const double plain = one * w.one + c * w.c + s * w.s;
      coarse_ += r_ * w.one * (std::abs(one) + std::abs(c) + std::abs(s));
      area_ += r_ * std::abs(plain);
      add_area(r_ * (of_cosine * edge.middle + of_sine * edge.across),
               r_ * (reach_middle * of_cosine + reach_across * of_sine + r_ * plain));
      for (const auto& [cut, side] : {std::pair(highest, 1.0), std::pair(lowest, -1.0)}) {
        if (!cut) continue;
        const Vec3 centre = a - work_.faces[cut->plane].origin - cut->height / cut->slope * edge.along;
        const Vec3 along_cosine = r_ * (edge.middle - cut->middle / cut->slope * edge.along);
        const Vec3 along_sine = r_ * (edge.across - cut->across / cut->slope * edge.along);
        coarse_ += w.one * norm(centre) * (norm(along_cosine) + norm(along_sine));
        // x' = -sin · along_cosine + cos · along_sine.
        const Vec3 step = w.c * along_sine - w.s * along_cosine;
        add_border(cut->plane, side * step, side * (cross(centre, step) + w.one * cross(along_cosine, along_sine)));
      }
    }
    return true;
  }

  // -------------------------------------------------------------------------------------------------------- vertices

  /// An arc on the unit sphere about `axis`, from the angle `begin` to `end`, with the axes x and y.
  struct Circle {
    Vec3 axis, x, y;
    double level, radius;
    Vec3 at(double angle) const { return level * axis + radius * (std::cos(angle) * x + std::sin(angle) * y); }
  };

  bool add_vertex(int v) {
    const OffsetSurface::Vertex& vertex = surface_.vertices[v];
    const std::span<const int> edges = surface_.edges_at(v);
    const auto range = [&](int j) {
      const Vec3 n = work_.faces[j].plane.normal;
      double least = kInfinity, most = -kInfinity;
      bool highest = true, lowest = true;
      for (const int e : edges) {
        const auto [down, up] = range_over(surface_.edges[e], n);
        least = std::min(least, down), most = std::max(most, up);
        const double slope = (surface_.edges[e].from == v ? 1 : -1) * dot(n, surface_.edges[e].along);
        highest = highest && slope <= 0, lowest = lowest && slope >= 0;
      }
      return std::pair(height(v, j) + r_ * (lowest ? -1 : least), height(v, j) + r_ * (highest ? 1 : most));
    };
    if (const Reach reached = find_active(std::array{v}, range); reached != Reach::kNear)
      return reached == Reach::kBeyond;
    const Vec3 from_apex = hull_.vertices[v] - apex_;
    const double square = r_ * r_;
    if (work_.active.empty()) {
      area_ += square * vertex.solid_angle;
      add_area(square * vertex.normals, square * (dot(from_apex, vertex.normals) + r_ * vertex.solid_angle));
      return true;
    }
    const Vec3 pole = unit(vertex.normals);
    // Triangles with a corner opposite to the pole have no certain sign.
    constexpr double kOpposite = -0.99;
    for (const int e : edges)
      if (range_over(surface_.edges[e], pole).first < kOpposite) return false;
    Vec3 normals;
    double angle = 0;
    const auto out_of = [&](int e) {
      return surface_.edges[e].from == v ? surface_.edges[e].along : -surface_.edges[e].along;
    };
    const auto level_of = [&](int j) { return -height(v, j) / r_; };
    // Whether a direction is below all planes but those given.
    const auto below = [&](Vec3 u, int but, int and_but) {
      return std::ranges::all_of(work_.active, [&](int j) {
        return j == but || j == and_but || dot(work_.faces[j].plane.normal, u) < level_of(j);
      });
    };
    const auto among_normals = [&](Vec3 u) {
      return std::ranges::all_of(edges, [&](int e) { return dot(out_of(e), u) < 0; });
    };
    // Great circles between the normals of facets.
    for (const int e : edges) {
      const OffsetSurface::Edge& edge = surface_.edges[e];
      const Circle circle{out_of(e), edge.middle, edge.across, 0, 1};
      const double half = edge.angle / 2;
      work_.breaks.assign(1, -half);
      for (const int j : work_.active) {
        const Vec3 n = work_.faces[j].plane.normal;
        add_roots(dot(n, edge.middle), dot(n, edge.across), level_of(j), half);
      }
      work_.breaks.push_back(half);
      std::ranges::sort(work_.breaks);
      for (size_t i = 0; i + 1 < work_.breaks.size(); ++i) {
        const double begin = work_.breaks[i], end = work_.breaks[i + 1];
        if (!(begin < end) || !below(circle.at((begin + end) / 2), kNone, kNone)) continue;
        // Counter-clockwise around the normals is clockwise about the direction out of the vertex.
        normals -= (end - begin) / 2 * circle.axis;
        const double turn = edge.from == v ? -1 : 1;
        const Vec3 middle = circle.at((begin + end) / 2);
        angle += turn * solid_angle(pole, circle.at(begin), middle, circle.at(end), end - begin);
      }
    }
    // Circles in the planes of the polytope.
    for (const int j : work_.active) {
      const Vec3 n = work_.faces[j].plane.normal;
      const double level = level_of(j);
      if (!(std::abs(level) < 1)) continue;
      const Vec3 x = any_orthogonal(n);
      const Circle circle{n, x, cross(n, x), level, std::sqrt((1 - level) * (1 + level))};
      work_.breaks.assign({-kPi, -kPi / 3, kPi / 3});
      bool same = false;
      const auto cut_by = [&](Vec3 normal, double at) {
        const size_t before = work_.breaks.size();
        const double across = norm2(cross(normal, n)), apart = at - level * dot(normal, n);
        same = same || (across < 1e-18 && std::abs(apart) < 1e-9);
        add_roots(circle.radius * dot(normal, circle.x), circle.radius * dot(normal, circle.y),
                  at - level * dot(normal, n), kPi);
        return before;
      };
      for (const int e : edges) cut_by(out_of(e), 0);
      for (const int k : work_.active) {
        if (k == j) continue;
        for (size_t b = cut_by(work_.faces[k].plane.normal, level_of(k)); b < work_.breaks.size(); ++b) {
          if (k < j) continue;
          const Vec3 u = circle.at(work_.breaks[b]);
          if (below(u, j, k) && among_normals(u) && !pierce(j, k, hull_.vertices[v] + r_ * u, u)) return false;
        }
      }
      if (same) return false;
      work_.breaks.push_back(kPi);
      std::ranges::sort(work_.breaks);
      for (size_t i = 0; i + 1 < work_.breaks.size(); ++i) {
        const double begin = work_.breaks[i], end = work_.breaks[i + 1];
        const Vec3 between = circle.at((begin + end) / 2);
        if (!(begin < end) || !below(between, j, kNone) || !among_normals(between)) continue;
        // Clockwise about the plane's normal.
        const Vec3 u0 = circle.at(end), u1 = circle.at(begin);
        const double turned = end - begin;
        const Vec3 swept = level * cross(n, u1 - u0) - circle.radius * circle.radius * turned * n;  // ∫ u × du
        normals += swept / 2;
        // The sector between the arc and the pole of the plane that is nearer, instead of their triangle.
        const double nearer = level > 0 ? 1 : -1;
        angle += solid_angle(pole, u0, u1) - nearer * (1 - std::abs(level)) * turned - solid_angle(nearer * n, u0, u1);
        const Vec3 centre = hull_.vertices[v] - work_.faces[j].origin;
        add_border(j, -r_ * (u1 - u0), -r_ * (cross(centre, u1 - u0) + r_ * swept));
        coarse_ += r_ * turned * (norm(centre) + r_);
      }
    }
    area_ += square * std::abs(angle), coarse_ += square * 4 * kPi;
    add_area(square * normals, square * (dot(from_apex, normals) + r_ * angle));
    return true;
  }

  // ----------------------------------------------------------------------------------------------------------- faces

  bool add_faces() {
    if (!find_corners()) return false;
    for (size_t e = 0; e < edges_.size(); ++e) {
      const Edge& edge = edges_[e];
      const Ridge& ridge = work_.ridges[e];
      const bool from = work_.inside[edge.from] == 1, to = work_.inside[edge.to] == 1;
      // A convex body holds an interval of the edge.
      const bool fits = from == to ? ridge.enters == ridge.leaves && !(from && ridge.enters)
                                   : ridge.enters == to && ridge.leaves == from;
      if (!fits) return false;
      if (!(from || ridge.enters)) continue;
      const Vec3 start = work_.corners[edge.from], way = work_.corners[edge.to] - start;
      const Vec3 begin = start + ridge.from * way, end = start + ridge.to * way;
      for (const auto& [j, side] : {std::pair(edge.left, 1.0), std::pair(edge.right, -1.0)}) {
        const Vec3 origin = work_.faces[j].origin;
        add_border(j, side * (end - begin), side * cross(begin - origin, end - origin));
      }
    }
    for (const Face& face : work_.faces) {
      area_ += std::abs(face.twice_area) / 2;
      add_area(face.twice_area / 2 * face.plane.normal, -face.twice_area / 2 * signed_distance(face.plane, apex_));
    }
    return true;
  }

  /// Finds which corners of the polytope are in the rounded hull, from where the surface crosses its edges.
  bool find_corners() {
    constexpr char kUnknown = 2;
    work_.inside.assign(work_.corners.size(), kUnknown);
    for (size_t e = 0; e < edges_.size(); ++e) {
      const Ridge& ridge = work_.ridges[e];
      const auto set = [&](int corner, char inside) {
        char& known = work_.inside[corner];
        const bool agrees = known == kUnknown || known == inside;
        known = inside;
        return agrees;
      };
      if (ridge.enters && !(set(edges_[e].from, 0) && (ridge.leaves || set(edges_[e].to, 1)))) return false;
      if (ridge.leaves && !(set(edges_[e].to, 0) && (ridge.enters || set(edges_[e].from, 1)))) return false;
    }
    for (size_t c = 0; c < work_.corners.size(); ++c) {
      // Corners at the ends of an edge that is not crossed are on the same side.
      for (bool changed = true; changed;) {
        changed = false;
        for (size_t e = 0; e < edges_.size(); ++e) {
          char &from = work_.inside[edges_[e].from], &to = work_.inside[edges_[e].to];
          if (from == to || work_.ridges[e].enters || work_.ridges[e].leaves) continue;
          if (from == kUnknown) from = to, changed = true;
          else if (to == kUnknown) to = from, changed = true;
        }
      }
      if (work_.inside[c] == kUnknown) work_.inside[c] = holds(work_.corners[c]);
    }
    return true;
  }

  bool holds(Vec3 point) const {
    return ask(rounded_, [&](const auto& shape) { return signed_distance(shape.tightest(point), point) < 0; });
  }

  const Shape& rounded_;
  const OffsetSurface& surface_;
  const HullData& hull_;
  double r_;
  std::span<const Edge> edges_;
  Vec3 apex_;
  double tie_;  ///< m: nearer to a plane, nothing is certain
  PolytopeWork& work_;
  int faces_;
  std::uint64_t all_;
  double thrice_ = 0;
  double size_ = 0;    ///< m³: sum of the sizes of all terms
  double coarse_ = 0;  ///< m²: the same of terms that cancel, before they are multiplied by a distance
  double area_ = 0;    ///< m²
  double border_ = 0;  ///< m: sum of the sizes of all steps along borders
  Vec3 unbalanced_;    ///< m²
};

/// The polytope in the coordinates of the core. False if it has too many facets, or no edges.
bool become(const Placed& rounded_hull, const Placed& polytope, PolytopeWork& work) {
  const int facets = overlapper::facets(polytope.shape);
  if (facets > kMostFaces) return false;
  const Pose pose = relative_pose(rounded_hull.pose, polytope.pose);
  work.corners.clear(), work.faces.clear();
  ask_flat(polytope.shape, [&](const auto& shape) {
    for (int c = 0; c < shape.vertex_count(); ++c) work.corners.push_back(pose * shape.vertex(c));
    for (int f = 0; f < facets; ++f) work.faces.push_back({pose * shape.facet(f), {}, 0, {}});
    return true;
  });
  return true;
}

/// The number of the plane that alone cuts the rounded hull; kNone if several do, and the number of planes if none
/// does. Heights may be off by `rounding`.
int only_cut(const HullData& hull, double r, double rounding, const PolytopeWork& work) {
  const int faces = static_cast<int>(work.faces.size()), vertices = static_cast<int>(hull.vertices.size());
  const auto height = [&](int v, int j) { return work.heights[v * faces + j]; };
  double least_depth = kInfinity;
  int deepest = faces;
  std::uint64_t cutting = 0;
  for (int j = 0; j < faces; ++j) {
    double least = kInfinity, most = -kInfinity;
    for (int v = 0; v < vertices; ++v) least = std::min(least, height(v, j)), most = std::max(most, height(v, j));
    if (most + r < -rounding) continue;
    cutting |= std::uint64_t{1} << j;
    if (r - least < least_depth) least_depth = r - least, deepest = j;
  }
  if (deepest == faces) return faces;
  cutting &= ~(std::uint64_t{1} << deepest);
  // A point below the plane is in a ball about a point y of the core that is at most r above the plane. Seen from y, it
  // is in a cap of the ball.
  const Vec3 n = work.faces[deepest].plane.normal;
  const double level = std::clamp((least_depth - r) / r, -1.0, 1.0);
  for (; cutting != 0; cutting &= cutting - 1) {
    const int j = std::countr_zero(cutting);
    const double cosine = dot(n, work.faces[j].plane.normal);
    double cap = 1;
    if (cosine > level)
      cap = level * cosine + std::sqrt(std::max(0.0, (1 - level) * (1 + level) * (1 - cosine) * (1 + cosine)));
    double most = -kInfinity;
    for (int v = 0; v < vertices; ++v)
      if (height(v, deepest) < r) most = std::max(most, height(v, j));
    for (const Edge& edge : hull.edges) {
      const double a = height(edge.from, deepest) - r, b = height(edge.to, deepest) - r;
      if ((a < 0) == (b < 0)) continue;
      most = std::max(most, height(edge.from, j) + a / (a - b) * (height(edge.to, j) - height(edge.from, j)));
    }
    if (!(most + r * cap < -rounding)) return kNone;
  }
  return deepest;
}

}  // namespace

std::optional<VolumeAlone> volume_in_polytope(const Placed& rounded_hull, const Placed& polytope) {
  if (!bounded(polytope.shape)) return volume_below_plane(rounded_hull, polytope, 0);
  const HullData& hull = *polytope_of(rounded_hull.shape);
  const OffsetSurface& surface = offset_surface(hull);
  const Scratch<PolytopeWork> work;
  if (!surface.exact || !become(rounded_hull, polytope, *work)) return std::nullopt;
  const double r = core_radius(rounded_hull.shape);
  const double size = norm(rounded_hull.pose.translation - polytope.pose.translation) + reach(rounded_hull.shape) +
                      reach(polytope.shape);
  const double off = rounding(reach(rounded_hull, reach(polytope, size))) + flatness(polytope.shape);
  const double tie = 4 * off;
  const std::vector<Vec3>& vertices = hull.vertices;
  Bounds own{{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}}, other = own;
  work->heights.resize(vertices.size() * work->faces.size()), work->sides.assign(vertices.size(), {});
  double* height = work->heights.data();
  for (size_t v = 0; v < vertices.size(); ++v) {
    own = {min(own.lower, vertices[v]), max(own.upper, vertices[v])};
    std::uint64_t below = 0, above = 0, bit = 1;
    for (const Face& face : work->faces) {
      *height = signed_distance(face.plane, vertices[v]);
      below |= *height < -r - tie ? bit : 0, above |= *height > r + tie ? bit : 0;
      ++height, bit <<= 1;
    }
    work->sides[v] = {below, above};
  }
  const int cut = only_cut(hull, r, 2 * off, *work);
  if (cut == static_cast<int>(work->faces.size())) {
    const double whole = surface.volume(r);
    return VolumeAlone{whole, kRoundingOfTerms * whole};
  }
  if (cut != kNone) return volume_below_plane(rounded_hull, polytope, cut);
  for (const Vec3 corner : work->corners) other = {min(other.lower, corner), max(other.upper, corner)};
  const Vec3 margin = r * Vec3{1, 1, 1};
  const Vec3 lower = max(own.lower - margin, other.lower), upper = min(own.upper + margin, other.upper);
  const Vec3 apex = 0.5 * (lower + upper);
  for (Face& face : work->faces) {
    face.origin = apex - signed_distance(face.plane, apex) * face.plane.normal;
  }
  InPolytope part(rounded_hull.shape, edges(polytope.shape), apex, tie, *work);
  if (!part.add_all()) return std::nullopt;
  const VolumeAlone found{part.volume(), part.error(off, norm(upper - lower))};
  if (!(found.volume > 0 && found.error <= kEnough * found.volume)) return std::nullopt;
  return found;
}

}  // namespace overlapper::offset
