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
#include "geometry/wide_pose.h"
#include "methods/round/offset/below_plane.h"

namespace overlapper::offset {
namespace {

/// Rounding of a term, relative to the product of the sizes of its factors.
constexpr double kRoundingOfTerms = 16 * kUnit;
/// Rounding of the place where a line meets a plane, relative to the same.
constexpr double kShareOfPlaces = 0.25;
/// Rounding of a unit vector: normals, directions of edges.
constexpr double kTiltOfPlanes = 2 * kUnit;
/// rad: rounding of the angle between a normal and the direction of the apex.
constexpr double kTurn = 8 * kUnit;
/// Rounding of the equation of a place where two borders cross, relative to the sum of its terms.
constexpr double kOfRoots = 2 * kUnit;
constexpr int kNone = -1;

/// A plane of the polytope, about the apex. Its area in the rounded hull is an integral along its border.
struct Face {
  Vec3 normal;
  double offset = 0;
  double twice_area = 0;
  Vec3 open;         ///< m: the sum of all steps along the border, zero if it is closed
  double loose = 0;  ///< m: sum of the uncertainties of its places
};

/// The part of an edge of the polytope in the rounded hull.
struct Ridge {
  Vec3 from, to;
  bool enters = false, leaves = false;
};

/// Planes of the polytope that all points of a sphere are below, or above: bit j for plane j.
struct Sides {
  std::uint64_t below = 0, above = 0;
};
constexpr int kMostFaces = 64;

/// The sphere about a vertex, or the cylinder about an edge, as seen from the apex. `pole` is a unit normal. Near the
/// apex it leads from the core to the apex, as the normals there do. The normal u = pole + v belongs to the point
/// base · pole + r v. The tangent plane there is base + slope |v|² / 2 away from the apex.
struct Sight {
  Vec3 pole;
  double base = 0, slope = 0;  ///< m
};

/// An angle φ, with sin φ and 1 - cos φ.
struct Turn {
  double angle = 0, sine = 0, versine = 0;
  double doubt = 0;  ///< rad: its error, large where two borders nearly touch

  Turn() = default;
  explicit Turn(double at) : angle(at) {
    const double half = std::sin(at / 2);
    sine = 2 * half * std::cos(at / 2), versine = 2 * half * half;
  }
  Turn(double at, double sine_of, double versine_of, double doubt_of = 0)
      : angle(at), sine(sine_of), versine(versine_of), doubt(doubt_of) {}
};

/// The band along an edge. Angles φ are from the pole to `side`. The normal at φ belongs to a line along the edge
/// through the point `start` + r (sin φ side - (1 - cos φ) pole). Its points are t from there. The tangent plane along
/// it is base + tilt sin φ + slope (1 - cos φ) away from the apex.
struct SeenBand : Sight {
  Vec3 start;                   ///< m
  double tilt = 0;              ///< m
  double first = 0, last = 0;   ///< m: t of the ends
  Vec3 side;                    ///< along × pole
  double middle = 0, half = 0;  ///< rad: the normals are at `middle` ± `half`
  bool known = false;

  double reach(const Turn& at) const { return base + tilt * at.sine + slope * at.versine; }
};

/// A plane that cuts a band, at height + r (across sin φ + ahead (1 - cos φ)) + slope t = 0.
struct BandCut {
  int plane;
  double height, across, ahead, slope;
  double first, last;  ///< bounds of t
};

/// A straight border in the plane of a moved facet, at dot(normal, y) = offset for y from the foot of the apex.
struct Line {
  Vec3 normal;
  double offset = 0;
  int plane = kNone;  ///< of the polytope; kNone for the facet's own border
};

struct PolytopeWork {
  std::vector<Plane> planes;  ///< of the polytope, in the coordinates of the core
  std::vector<Face> faces;
  std::vector<Edge> edges;      ///< of the polytope, between faces that cut
  std::vector<Ridge> ridges;    ///< of these edges
  std::vector<Vec3> corners;    ///< of the polytope, about the apex
  std::vector<char> inside;     ///< for each corner: 1 in the rounded hull, 0 outside, 2 not yet known
  std::vector<double> heights;  ///< of each vertex of the core above each plane
  std::vector<Sides> sides;     ///< of the sphere at each vertex of the core
  std::vector<SeenBand> bands;
  std::vector<int> active;
  std::vector<BandCut> cuts;
  std::vector<Turn> breaks;
  struct Corner {
    Vec3 at;           ///< from the foot of the apex
    int line;          ///< on which the border goes on, or kNone
    double above = 0;  ///< m: above the line that cuts
  };
  std::vector<Corner> polygon, clipped;
  std::vector<Line> lines;
  // A capsule's core.
  std::array<Vec3, 2> ends;
  std::array<OffsetSurface::Edge, 1> axis;
};

/// The nodes and weights of a rule of Gauss and Legendre on [-1, 1], for x > 0.
constexpr std::array<double, 4> kNode{0.18343464249564980, 0.52553240991632899, 0.79666647741362674,
                                      0.96028985649753623};
constexpr std::array<double, 4> kWeight{0.36268378337836198, 0.31370664587788729, 0.22238103445337447,
                                        0.10122853629037626};

/// Calls f(weight, sin φ, 1 - cos φ) for the nodes of parts of a range of φ, each at most `widest` <= 1.5.
template <class F>
void integrate(double from, double to, double widest, F f) {
  const double whole = to - from;
  const int parts = whole > widest ? static_cast<int>(std::ceil(whole / widest)) : 1;
  const double half = whole / parts / 2;
  for (int i = 0; i < parts; ++i) {
    const double middle = (from + (2 * i + 1) * half) / 2, s = std::sin(middle), c = std::cos(middle);
    for (size_t k = 0; k < kNode.size(); ++k) {
      const double z = half / 2 * kNode[k], q = z * z;
      const double sine =
          z * (1 + q * (-1. / 6 + q * (1. / 120 + q * (-1. / 5040 + q * (1. / 362880 + q * (-1. / 39916800))))));
      const double cosine =
          1 + q * (-1. / 2 + q * (1. / 24 + q * (-1. / 720 + q * (1. / 40320 + q * (-1. / 3628800 + q / 479001600)))));
      for (const double turn : {-sine, sine}) {
        const double s2 = s * cosine + c * turn, c2 = c * cosine - s * turn;
        f(half * kWeight[k], 2 * s2 * c2, 2 * s2 * s2);
      }
    }
  }
}
constexpr double kWidest = 1.5;

/// The core of a rounded hull or a capsule: its features, about the core's coordinates.
struct Core {
  std::span<const Vec3> vertices;
  std::span<const OffsetSurface::Edge> edges;
  const OffsetSurface* surface = nullptr;  ///< null for a capsule
  const HullData* hull = nullptr;          ///< null for a capsule
  double r = 0;

  std::span<const int> edges_at(int v) const {
    static constexpr int kOnly = 0;
    return surface ? surface->edges_at(v) : std::span(&kOnly, 1);
  }
};

class InPolytope {
 public:
  /// `off`: m, the error of places by rounding. With `wide`, places are computed in double-doubles.
  InPolytope(const Placed& rounded, const Core& core, Vec3 apex, bool wide, double off, double tie, double size,
             std::uint64_t cutting, PolytopeWork& work)
      : rounded_(rounded),
        core_(core),
        r_(core.r),
        apex_(apex),
        wide_(wide),
        off_(off),
        tie_(tie),
        cutting_(cutting),
        work_(work),
        faces_(static_cast<int>(work.faces.size())),
        farthest_(wide ? 0 : norm(apex) + reach(rounded.shape)),
        extent2_(wide ? 0 : size * size) {}

  bool add_all() {
    work_.ridges.assign(work_.edges.size(), {});
    work_.bands.assign(core_.edges.size(), {});
    const int facets = core_.surface ? static_cast<int>(core_.surface->facets.size()) : 0;
    for (int f = 0; f < facets; ++f)
      if (!add_facet(f)) return false;
    for (int e = 0; e < static_cast<int>(core_.edges.size()); ++e)
      if (!add_edge(e)) return false;
    for (int v = 0; v < static_cast<int>(core_.vertices.size()); ++v)
      if (!add_vertex(v)) return false;
    return add_faces() && closes();
  }

  double volume() const { return thrice_ / 3; }
  double error() const {
    const double extent = std::sqrt(extent2_);
    double open = 0;
    for (const Face& face : work_.faces) open += (norm(face.open) + face.loose) * std::abs(face.offset);
    return (off_ + kTiltOfPlanes * extent) * area_ + kTurn * r_ * tilted_ + kRoundingOfTerms * size_ + open * extent +
           loose_ + norm(unbalanced_) * farthest_;
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
    for (std::uint64_t rest = ~below & cutting_; rest != 0; rest &= rest - 1) {
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
    if (edge.angle > kPi) return {-std::sqrt(m * m + a * a), std::sqrt(m * m + a * a)};
    const double sine = edge.chord / 2, cosine = std::sqrt(std::max(0.0, (1 - sine) * (1 + sine)));
    const double left = m * cosine - a * sine, right = m * cosine + a * sine;
    // The direction of the plane's normal across the edge is between the normals of the facets.
    const bool between = std::abs(a) * cosine <= std::abs(m) * sine;
    const double size = between ? std::sqrt(m * m + a * a) : 0;
    return {between && m < 0 ? -size : std::min(left, right), between && m > 0 ? size : std::max(left, right)};
  }

  /// `reach` is the largest distance from the apex of the planes along the part.
  void add_cone(double cone, double size, double reach) {
    thrice_ += cone, size_ += size;
    if (cone != 0) farthest_ = std::max(farthest_, std::abs(reach));
  }
  /// Adds to the border of a face: its step, and twice the area that it spans with the foot of the apex.
  void add_border(int j, Vec3 step, double twice, double size) {
    Face& face = work_.faces[j];
    face.open += step, border_ += std::sqrt(norm2(step));
    face.twice_area += twice, size_ += size * std::abs(face.offset);
  }
  void reaches(Vec3 x) { extent2_ = std::max(extent2_, norm2(x)); }

  /// An edge of the polytope passes through the surface at a point with this outward direction.
  bool pierce(int j, int k, Vec3 at, Vec3 outward) {
    for (size_t e = 0; e < work_.edges.size(); ++e) {
      const Edge& edge = work_.edges[e];
      if (!((edge.left == j && edge.right == k) || (edge.left == k && edge.right == j))) continue;
      const Vec3 from = work_.corners[edge.from], way = work_.corners[edge.to] - from;
      const double length = std::sqrt(norm2(way)), fraction = dot(at - from, way) / (length * length);
      const double slope = dot(outward, way);
      // Near a corner of the polytope, or along its edge, other edges may pass on the other side of it.
      constexpr double kAlong = 1e-9;
      if (!(std::min(fraction, 1 - fraction) * length > tie_of(at) && std::abs(slope) > kAlong * length)) return false;
      Ridge& ridge = work_.ridges[e];
      if (slope > 0) {
        if (ridge.leaves) return false;
        ridge.leaves = true, ridge.to = at;
      } else {
        if (ridge.enters) return false;
        ridge.enters = true, ridge.from = at;
      }
      return true;
    }
    return false;
  }
  /// m: nothing is certain about a point nearer to a plane.
  double tie_of(Vec3 x) const { return 4 * off_ + kRoundingOfTerms * std::sqrt(wide_ ? norm2(x) : extent2_); }

  // ------------------------------------------------------------------------------------------- as seen from the apex

  /// `toward` leads from the feature to the apex, `distance` away. `less` is r - distance.
  Sight sight(Vec3 toward, double distance, double less, Vec3 mean) const {
    if (!(distance > 0)) return {mean, r_, 0};
    if (dot(toward, mean) >= 0) return {toward, less, distance};
    return {-toward, r_ + distance, -distance};
  }

  Sight sight_of_vertex(int v, Vec3 mean) const {
    if (wide_) {
      const WideVector from = wide_difference(apex_, core_.vertices[v]);
      const DoubleDouble distance = norm(from);
      return sight(rounded(from) / distance.head, distance.head, (DoubleDouble{r_} - distance).head, mean);
    }
    const Vec3 from = apex_ - core_.vertices[v];
    const double distance = std::sqrt(norm2(from));
    return sight(from / distance, distance, r_ - distance, mean);
  }

  /// In doubles, the pole is the normal in the middle of the band, and t begins at the first end. In double-doubles, it
  /// leads to the apex, or away from it, and t begins at the point nearest to the apex.
  const SeenBand& band(int e) {
    SeenBand& band = work_.bands[e];
    if (band.known) return band;
    band.known = true;
    const OffsetSurface::Edge& edge = core_.edges[e];
    band.half = edge.angle / 2;
    if (!wide_) {
      const Vec3 from = core_.vertices[edge.from] - apex_;
      band.pole = edge.middle, band.side = edge.across;
      band.start = from + r_ * band.pole;
      band.tilt = dot(from, band.side), band.slope = -dot(from, band.pole), band.base = r_ - band.slope;
      band.first = 0, band.last = edge.length;
      return band;
    }
    const WideVector from = wide_difference(core_.vertices[edge.from], apex_);
    const WideVector way = wide_difference(core_.vertices[edge.to], core_.vertices[edge.from]);
    const DoubleDouble length = norm(way), t = dot(from, way) / length;
    const WideVector foot = from - (t / length) * way;
    const DoubleDouble distance = norm(foot);
    band.first = t.head, band.last = (t + length).head;
    const bool around = edge.angle > kPi;
    Vec3 toward = rounded(foot) / -distance.head;
    toward = distance.head > 0 ? unit(toward - dot(toward, edge.along) * edge.along) : edge.middle;
    static_cast<Sight&>(band) =
        sight(toward, distance.head, (DoubleDouble{r_} - distance).head, around ? toward : edge.middle);
    band.start = band.base * band.pole, band.side = cross(edge.along, band.pole);
    band.middle = around ? 0 : std::atan2(dot(edge.middle, band.side), dot(edge.middle, band.pole));
    return band;
  }

  /// How far the plane of a moved facet is from the apex.
  double reach_of_facet(int f) const {
    const Vec3 n = core_.surface->facets[f].normal;
    if (!wide_) return dot(n, core_.vertices[core_.hull->facet(f)[0]] - apex_) + r_;
    const auto [a, b, c] = core_.hull->facet_corners[f];
    const std::vector<Vec3>& corners = core_.hull->corners;
    const WideVector normal = unit(wide_normal(corners[a], corners[b], corners[c]));
    return (dot(normal, wide_difference(corners[a], apex_)) + DoubleDouble{r_}).head;
  }

  // ---------------------------------------------------------------------------------------------------------- facets

  bool add_facet(int f) {
    const OffsetSurface::Facet& facet = core_.surface->facets[f];
    const auto ring = core_.hull->facet(f);
    const Vec3 n = facet.normal;
    const auto range = [&](int j) {
      double least = kInfinity, most = -kInfinity;
      for (const int v : ring) least = std::min(least, height(v, j)), most = std::max(most, height(v, j));
      const double moved = r_ * dot(n, work_.planes[j].normal);
      return std::pair(least + moved, most + moved);
    };
    if (const Reach reached = find_active(ring, range); reached != Reach::kNear) return reached == Reach::kBeyond;
    const double reach = reach_of_facet(f);
    if (work_.active.empty()) {
      if (wide_)
        for (const int v : ring) reaches(core_.vertices[v] - apex_ + r_ * n);
      area_ += facet.area, unbalanced_ += facet.area * n, sizes_ += facet.area;
      add_cone(facet.area * reach, facet.area * std::abs(reach), reach);
      return true;
    }
    auto &polygon = work_.polygon, &clipped = work_.clipped;
    polygon.clear(), work_.lines.clear();
    for (size_t i = 0; i < ring.size(); ++i) {
      const Vec3 at = core_.vertices[ring[i]] - apex_;
      polygon.push_back({at - dot(at, n) * n, kNone});
      if (!wide_) continue;
      const int side = core_.surface->sides[core_.hull->ring_start[f] + i];
      const SeenBand& beside = band(side / 2);
      const Vec3 out = (side % 2 == 1 ? -1.0 : 1.0) * cross(core_.edges[side / 2].along, n);
      polygon.back().line = static_cast<int>(work_.lines.size());
      work_.lines.push_back({out, -beside.slope * dot(out, beside.pole), kNone});
    }
    for (const int j : work_.active) {
      const Face& face = work_.faces[j];
      const double cosine = dot(face.normal, n);
      const Line line{face.normal - cosine * n, face.offset - reach * cosine, j};
      const int cutter = static_cast<int>(work_.lines.size());
      work_.lines.push_back(line);
      clipped.clear();
      const size_t count = polygon.size();
      for (PolytopeWork::Corner& corner : polygon) {
        corner.above = dot(line.normal, corner.at) - line.offset;
        if (std::abs(corner.above) < tie_of(corner.at)) return false;
      }
      for (size_t i = 0; i < count; ++i) {
        const PolytopeWork::Corner &here = polygon[i], &next = polygon[i + 1 == count ? 0 : i + 1];
        const double above = here.above, then = next.above;
        const auto crossing = [&] { return crossing_of(here.line, line, n, here.at, next.at, above, then); };
        if (above < 0) {
          clipped.push_back(here);
          if (!(then < 0)) clipped.push_back({crossing(), cutter});
        } else if (then < 0) {
          clipped.push_back({crossing(), here.line});
        }
      }
      polygon.swap(clipped);
      if (polygon.size() < 3) return true;
    }
    const auto plane_of = [&](const PolytopeWork::Corner& corner) {
      return corner.line == kNone ? kNone : work_.lines[corner.line].plane;
    };
    const Vec3 first = polygon[0].at, foot = reach * n;
    double twice = 0, size = 0;
    for (size_t i = 0; i < polygon.size(); ++i) {
      const PolytopeWork::Corner &before = polygon[i == 0 ? polygon.size() - 1 : i - 1], &here = polygon[i],
                                 &next = polygon[i + 1 == polygon.size() ? 0 : i + 1];
      twice += dot(n, cross(here.at - first, next.at - first));
      size += std::sqrt(norm2(here.at) * norm2(next.at - here.at));
      const Vec3 x = foot + here.at, y = foot + next.at;
      reaches(x);
      const int j = plane_of(here);
      if (j == kNone) continue;
      add_border(j, x - y, dot(work_.faces[j].normal, cross(y, x - y)), std::sqrt(norm2(y) * norm2(x - y)));
      if (const int k = plane_of(before); k != kNone && !pierce(k, j, x, n)) return false;
    }
    const double area = twice / 2;
    area_ += std::abs(area), unbalanced_ += area * n, sizes_ += size;
    add_cone(area * reach, size / 2 * std::abs(reach), reach);
    return true;
  }

  /// Where two borders cross. Between nearly parallel ones, or if doubles are enough, it is the place between two
  /// corners.
  Vec3 crossing_of(int border, const Line& other, Vec3 n, Vec3 here, Vec3 next, double above, double then) const {
    if (!wide_) return here + above / (above - then) * (next - here);
    const Line& one = work_.lines[border];
    constexpr double kParallel = 1e-6;
    const double sine = dot(cross(one.normal, other.normal), n);
    if (!(std::abs(sine) > kParallel * std::sqrt(norm2(one.normal) * norm2(other.normal))))
      return here + above / (above - then) * (next - here);
    return (one.offset * cross(other.normal, n) + other.offset * cross(n, one.normal)) / sine;
  }

  // ----------------------------------------------------------------------------------------------------------- edges

  /// Adds to the breaks the angles within middle ± half at which height + across sin φ - back (1 - cos φ) = 0.
  void add_roots(double height, double across, double back, double middle, double half) {
    const double square = across * across - height * (height - 2 * back);
    if (!(square > 0)) return;
    const double slope = std::sqrt(square), sum = -(across + std::copysign(slope, across));
    const double doubt = kOfRoots * (std::abs(height) + std::abs(across) + std::abs(back)) / slope;
    for (const double tangent : {sum / (height - 2 * back), height / sum}) {
      const double root = 2 * std::atan(tangent), share = 2 / (1 + tangent * tangent);
      for (const double turn : {-2 * kPi, 0.0, 2 * kPi})
        if (std::abs(root + turn - middle) < half)
          work_.breaks.emplace_back(root + turn, tangent * share,
                                    std::isfinite(tangent) ? tangent * tangent * share : 2, doubt);
    }
  }
  void begin_breaks(double middle, double half) { work_.breaks.assign({Turn(middle - half), Turn(middle + half)}); }
  void sort_breaks() { std::ranges::sort(work_.breaks, {}, &Turn::angle); }

  /// Collects the active planes that may be the first to end some line of a band, of all lines along its edge. False if
  /// no line has a part below all planes.
  bool find_cuts(const OffsetSurface::Edge& edge, const SeenBand& band) {
    work_.cuts.clear();
    double low = band.first, high = band.last;
    for (const int j : work_.active) {
      const Face& face = work_.faces[j];
      const double slope = dot(face.normal, edge.along), ahead = dot(face.normal, band.pole);
      const auto [least, most] = range_over(edge, face.normal);
      const double height = dot(face.normal, band.start) - face.offset, from = height - r_ * ahead;
      const double near = (tie_ + kRoundingOfTerms * r_) / std::abs(slope);
      const double one = -(from + r_ * least) / slope, other = -(from + r_ * most) / slope;
      work_.cuts.push_back({j, height, dot(face.normal, band.side), -ahead, slope, std::min(one, other) - near,
                            std::max(one, other) + near});
      if (slope > 0) high = std::min(high, one + near);
      if (slope < 0) low = std::max(low, one - near);
    }
    std::erase_if(work_.cuts, [&](const BandCut& cut) {
      return (cut.slope > 0 && cut.first > high) || (cut.slope < 0 && cut.last < low);
    });
    return low < high;
  }

  bool add_edge(int e) {
    const OffsetSurface::Edge& edge = core_.edges[e];
    const auto range = [&](int j) {
      const double from = height(edge.from, j), to = height(edge.to, j);
      const auto [least, most] = range_over(edge, work_.planes[j].normal);
      return std::pair(std::min(from, to) + r_ * least, std::max(from, to) + r_ * most);
    };
    const Reach reached = find_active(std::array{edge.from, edge.to}, range);
    if (reached != Reach::kNear) return reached == Reach::kBeyond;
    if (work_.active.empty() && !wide_) {
      const Vec3 from_apex = core_.vertices[edge.from] - apex_;
      const double area = r_ * edge.length;
      area_ += area * edge.angle, sizes_ += area * edge.angle;
      unbalanced_ += area * edge.chord * edge.middle;
      const double first = dot(from_apex, edge.middle) * edge.chord, second = r_ * edge.angle;
      add_cone(area * (first + second), area * (std::abs(first) + second), 0);
      return true;
    }
    const SeenBand& band = this->band(e);
    if (!find_cuts(edge, band)) return true;
    if (wide_ || edge.angle > kPi) {
      begin_breaks(band.middle, band.half);
    } else {
      const double sine = edge.chord / 2, versine = sine * sine / (1 + std::sqrt((1 - sine) * (1 + sine)));
      work_.breaks.assign({{-band.half, -sine, versine}, {band.half, sine, versine}});
    }
    const std::span<const BandCut> all = work_.cuts;
    const size_t count = all.size();
    for (const BandCut& cut : all) {
      constexpr double kAlong = 1e-9;
      if (std::abs(cut.slope) < kAlong) return false;
      for (const double end : {band.first, band.last})
        add_roots(cut.height + cut.slope * end, r_ * cut.across, -r_ * cut.ahead, band.middle, band.half);
    }
    const auto above_edge = [&](const BandCut& cut, double sine, double versine) {
      return cut.height + r_ * (cut.across * sine + cut.ahead * versine);
    };
    const auto at = [&](const BandCut& cut, double sine, double versine) {
      return -above_edge(cut, sine, versine) / cut.slope;
    };
    const auto place = [&](double sine, double versine, double t) {
      return band.start + r_ * (sine * band.side - versine * band.pole) + t * edge.along;
    };
    for (size_t i = 0; i < count; ++i)
      for (size_t k = 0; k < i; ++k) {
        const BandCut &one = all[i], &other = all[k];
        const size_t before = work_.breaks.size();
        add_roots(one.height * other.slope - other.height * one.slope,
                  r_ * (one.across * other.slope - other.across * one.slope),
                  r_ * (other.ahead * one.slope - one.ahead * other.slope), band.middle, band.half);
        for (size_t b = before; b < work_.breaks.size(); ++b) {
          const double sine = work_.breaks[b].sine, versine = work_.breaks[b].versine;
          const double t = at(one, sine, versine);
          if (!(t > band.first && t < band.last)) continue;
          const auto keeps = [&](const BandCut& cut) {
            return &cut == &one || &cut == &other || above_edge(cut, sine, versine) + cut.slope * t < 0;
          };
          const Vec3 outward = (1 - versine) * band.pole + sine * band.side;
          if (std::ranges::all_of(all, keeps) && !pierce(one.plane, other.plane, place(sine, versine, t), outward))
            return false;
        }
      }
    sort_breaks();
    for (size_t i = 0; i + 1 < work_.breaks.size(); ++i) {
      const Turn &begin = work_.breaks[i], &end = work_.breaks[i + 1];
      if (!(begin.angle < end.angle)) continue;
      const auto [between, sine, versine, none] = Turn((begin.angle + end.angle) / 2);
      double low = band.first, high = band.last;
      const BandCut *lowest = nullptr, *highest = nullptr;
      for (const BandCut& cut : all) {
        const double t = at(cut, sine, versine);
        if (cut.slope < 0 && t > low) low = t, lowest = &cut;
        if (cut.slope > 0 && t < high) high = t, highest = &cut;
      }
      if (low < high) add_part(edge, band, begin, end, lowest, highest);
    }
    return true;
  }

  /// An end of the lines of a band, at t = place + across sin φ + ahead (1 - cos φ).
  struct End {
    double place, across = 0, ahead = 0;

    double at(const Turn& turn) const { return place + across * turn.sine + ahead * turn.versine; }
  };
  End end_of(const BandCut* cut, double own) const {
    if (!cut) return {own};
    return {-cut->height / cut->slope, -r_ * cut->across / cut->slope, -r_ * cut->ahead / cut->slope};
  }

  /// The same as add_part, by closed sums. They lose digits where the band is small beside its distance from the apex.
  /// False if terms are far larger than the band, so that the sums lose digits.
  bool add_sums(const OffsetSurface::Edge& edge, const SeenBand& band, const Turn& begin, const Turn& end,
                const BandCut* lowest, const BandCut* highest) {
    const End high = end_of(highest, band.last), low = end_of(lowest, band.first);
    // No angle is above π/2, so no sine or 1 - cosine is larger than this, and no integral's rounding than that of
    // `whole`.
    const double most = std::min(band.half, 1.0), whole = 2 * band.half;
    const double places =
        std::abs(high.place) + std::abs(low.place) +
        most * (std::abs(high.across) + std::abs(low.across) + std::abs(high.ahead) + std::abs(low.ahead));
    constexpr double kFar = 4;
    if (places > kFar * edge.length) return false;
    // The integrals of 1, sin φ, 1 - cos φ and of their products.
    const double one = end.angle - begin.angle, sine = end.versine - begin.versine, cosine = end.sine - begin.sine;
    const double versine = one - cosine;
    const double twice = end.sine * (1 - end.versine) - begin.sine * (1 - begin.versine);
    const double sine_sine = (one - twice) / 2;
    const double sine_versine = sine - (end.sine - begin.sine) * (end.sine + begin.sine) / 2;
    const double versine_versine = versine - cosine + (one + twice) / 2;
    const double place = high.place - low.place, across = high.across - low.across, ahead = high.ahead - low.ahead;
    const double plain = r_ * (place * one + across * sine + ahead * versine);
    const double of_sine = r_ * (place * sine + across * sine_sine + ahead * sine_versine);
    const double of_versine = r_ * (place * versine + across * sine_versine + ahead * versine_versine);
    const double farthest = std::abs(band.base) + most * (std::abs(band.tilt) + std::abs(band.slope));
    area_ += std::abs(plain), sizes_ += r_ * whole * places;
    unbalanced_ += (plain - of_versine) * band.pole + of_sine * band.side;
    add_cone(band.base * plain + band.tilt * of_sine + band.slope * of_versine, r_ * whole * places * farthest,
             farthest);
    for (const Turn& at : {begin, end}) {
      if (std::abs(at.angle) != band.half) continue;
      const double length = high.at(at) - low.at(at);
      tilted_ += std::abs(length * band.reach(at)), seams_ += std::abs(length);
    }
    const auto add_end = [&](const BandCut* cut, const End& ends, double sign) {
      if (!cut) return;
      // The border is start + by_sine sin φ + by_versine (1 - cos φ).
      const Vec3 start = band.start + ends.place * edge.along;
      const Vec3 by_sine = r_ * band.side + ends.across * edge.along;
      const Vec3 by_versine = ends.ahead * edge.along - r_ * band.pole;
      const Vec3 step = cosine * by_sine + sine * by_versine;
      const Vec3 spanned = cross(start, step) + versine * cross(by_sine, by_versine);
      const double first = r_ + std::abs(ends.across), second = r_ + std::abs(ends.ahead);
      add_border(cut->plane, sign * step, sign * dot(work_.faces[cut->plane].normal, spanned),
                 whole * (std::sqrt(norm2(start)) * (first + second) + first * second));
      work_.faces[cut->plane].loose += 2 * r_ / std::abs(cut->slope) * (begin.doubt + end.doubt);
    };
    add_end(highest, high, 1), add_end(lowest, low, -1);
    return true;
  }

  /// Adds the part of a band between two angles and two planes; its own end if a plane is null.
  void add_part(const OffsetSurface::Edge& edge, const SeenBand& band, const Turn& begin, const Turn& end,
                const BandCut* lowest, const BandCut* highest) {
    if (!wide_ && add_sums(edge, band, begin, end, lowest, highest)) return;
    double cones = 0, size = 0, area = 0, cosines = 0, sines = 0, most_reach = 0;
    struct Side {
      const BandCut* cut;
      double sign, twice = 0, size = 0;
    };
    std::array<Side, 2> sides{{{highest, 1}, {lowest, -1}}};
    const auto end_of = [&](const BandCut* cut, double own, double sine, double versine) {
      return cut ? -(cut->height + r_ * (cut->across * sine + cut->ahead * versine)) / cut->slope : own;
    };
    integrate(begin.angle, end.angle, kWidest, [&](double weight, double sine, double versine) {
      const double high = end_of(highest, band.last, sine, versine), low = end_of(lowest, band.first, sine, versine);
      const double reach = band.base + band.tilt * sine + band.slope * versine, element = weight * r_,
                   cosine = 1 - versine;
      const double part = element * (high - low);
      const double places = std::abs(high) + std::abs(low);
      cones += part * reach, size += std::abs(reach) * (std::abs(part) + kShareOfPlaces * element * places);
      area += part, cosines += part * cosine, sines += part * sine;
      most_reach = std::max(most_reach, std::abs(reach));
      const Vec3 across = band.start + r_ * (sine * band.side - versine * band.pole);
      const Vec3 turn = r_ * cosine * band.side - r_ * sine * band.pole;
      for (Side& side : sides) {
        if (!side.cut) continue;
        const BandCut& cut = *side.cut;
        const double t = side.sign > 0 ? high : low;
        const Vec3 x = across + t * edge.along;
        const Vec3 step = turn - r_ / cut.slope * (cut.across * cosine + cut.ahead * sine) * edge.along;
        side.twice += weight * dot(work_.faces[cut.plane].normal, cross(x, step));
        side.size += weight * std::sqrt(norm2(x) * norm2(step));
      }
      if (wide_) extent2_ = std::max(extent2_, norm2(across) + std::max(high * high, low * low));
    });
    area_ += std::abs(area), sizes_ += std::abs(area);
    unbalanced_ += cosines * band.pole + sines * band.side;
    add_cone(cones, size, most_reach);
    // Where the band meets a facet, its border is off by the rounding of angles.
    for (const Turn& at : {begin, end}) {
      if (std::abs(std::abs(at.angle - band.middle) - band.half) > 1e-12) continue;
      const double length =
          end_of(highest, band.last, at.sine, at.versine) - end_of(lowest, band.first, at.sine, at.versine);
      tilted_ += std::abs(length * band.reach(at)), seams_ += std::abs(length);
    }
    for (const Side& side : sides) {
      if (!side.cut) continue;
      const auto along = [&](const Turn& at) { return end_of(side.cut, 0, at.sine, at.versine); };
      const Vec3 step = r_ * ((end.sine - begin.sine) * band.side - (end.versine - begin.versine) * band.pole) +
                        (along(end) - along(begin)) * edge.along;
      add_border(side.cut->plane, side.sign * step, side.sign * side.twice, side.size);
      work_.faces[side.cut->plane].loose += 2 * r_ / std::abs(side.cut->slope) * (begin.doubt + end.doubt);
    }
  }

  // -------------------------------------------------------------------------------------------------------- vertices

  /// A circle of normals: pole + nearest + radius (sin φ y - (1 - cos φ) x).
  struct Circle {
    Vec3 nearest, x, y;
    double radius;
    Vec3 at(double sine, double versine) const { return nearest + radius * (sine * y - versine * x); }
    Vec3 at(const Turn& turn) const { return at(turn.sine, turn.versine); }
    Vec3 between(const Turn& a, const Turn& b) const { return at(Turn((a.angle + b.angle) / 2)); }
  };

  /// Makes `x`, which is orthogonal to an axis but for rounding, a unit vector. Returns its length; 0 if that is only
  /// rounding, with no direction.
  static double direct(Vec3& x, Vec3 axis) {
    const double length = std::sqrt(norm2(x));
    x = length > kTurn ? x / length : any_orthogonal(axis);
    return length > kTurn ? length : 0;
  }

  bool add_vertex(int v) {
    const std::span<const int> edges = core_.edges_at(v);
    const auto out_of = [&](int e) { return core_.edges[e].from == v ? core_.edges[e].along : -core_.edges[e].along; };
    const auto range = [&](int j) {
      const Vec3 n = work_.planes[j].normal;
      double least = kInfinity, most = -kInfinity;
      bool highest = true, lowest = true;
      for (const int e : edges) {
        const auto [down, up] = range_over(core_.edges[e], n);
        least = std::min(least, down), most = std::max(most, up);
        const double slope = dot(n, out_of(e));
        highest = highest && slope <= 0, lowest = lowest && slope >= 0;
      }
      return std::pair(height(v, j) + r_ * (lowest ? -1 : least), height(v, j) + r_ * (highest ? 1 : most));
    };
    if (const Reach reached = find_active(std::array{v}, range); reached != Reach::kNear)
      return reached == Reach::kBeyond;
    const double square = r_ * r_;
    const Vec3 mean = core_.surface ? core_.surface->vertices[v].normals : -out_of(0);
    if (work_.active.empty() && !wide_) {
      const double angle = core_.surface ? core_.surface->vertices[v].solid_angle : 2 * kPi;
      const Vec3 normals = core_.surface ? mean : kPi * mean, from_apex = core_.vertices[v] - apex_;
      area_ += square * angle, sizes_ += square * angle, unbalanced_ += square * normals;
      const double first = dot(from_apex, normals), second = r_ * angle;
      add_cone(square * (first + second), square * (std::abs(first) + second), 0);
      return true;
    }
    const Sight seen = sight_of_vertex(v, unit(mean));
    const Vec3 pole = seen.pole;
    // A direction is given by its difference from the pole.
    const auto level_of = [&](int j) {
      return (work_.faces[j].offset - seen.base * dot(pole, work_.faces[j].normal)) / r_;
    };
    const auto sine_of = [&](int e) {
      if (!wide_ || seen.slope == 0) return std::clamp(dot(pole, out_of(e)), -1.0, 1.0);
      const double along = core_.edges[e].from == v ? band(e).first : -band(e).last;
      return std::clamp(-along / seen.slope, -1.0, 1.0);
    };
    const auto below = [&](Vec3 u, int but, int and_but) {
      return std::ranges::all_of(
          work_.active, [&](int j) { return j == but || j == and_but || dot(work_.faces[j].normal, u) < level_of(j); });
    };
    const auto among_normals = [&](Vec3 u) {
      return std::ranges::all_of(edges, [&](int e) { return dot(out_of(e), u) < -sine_of(e); });
    };
    // The integrals have no value at the direction opposite to the pole.
    if (below(-2 * pole, kNone, kNone) && among_normals(-2 * pole)) return false;
    double cones = 0, size = 0, angle = 0;
    double loose = 0;  // rad: uncertainty of the solid angle, as ends of arcs may not meet
    Vec3 twice_normals, open;
    double most_lost = 0;
    // Adds an arc. Over it, dot(pole, u × du) is even + odd (1 - cos φ), and 1 - dot(pole, u) is q + more (1 - cos φ).
    const auto add_arc = [&](const Circle& circle, const Turn& begin, const Turn& end, double sign, double even,
                             double odd, double q, double more, auto with) {
      constexpr double kFar = 1;
      const double most = q + more * (begin.angle <= -kPi / 2 || end.angle >= kPi / 2 ? 2 : 1);
      const double widest = most > kFar ? 0.375 : 0.75;
      integrate(begin.angle, end.angle, widest, [&](double weight, double sine, double versine) {
        const double lost = q + more * versine, turn = sign * weight * (even + odd * versine) / (2 - lost);
        const Vec3 u = circle.at(sine, versine);
        const Vec3 step = circle.radius * ((1 - versine) * circle.y - sine * circle.x);
        const double reach = seen.base + seen.slope * lost / 2;
        most_lost = std::max(most_lost, lost);
        angle += turn, cones += turn * reach;
        size += weight * std::abs(reach) * std::sqrt(norm2(u) * norm2(step));
        twice_normals += sign * weight * cross(u, step);
        extent2_ = std::max(extent2_, norm2(seen.base * pole + r_ * u));
        with(weight, u, step);
      });
      open += sign * (circle.at(end) - circle.at(begin));
      for (const Turn& at : {begin, end}) {
        const double lost = q + more * at.versine;
        loose += circle.radius * at.doubt * std::sqrt(lost / std::max(2 - lost, kUnit));
      }
    };
    // Great circles between the normals of facets.
    for (const int e : edges) {
      const OffsetSurface::Edge& edge = core_.edges[e];
      const Vec3 out = out_of(e);
      const double sine = sine_of(e);
      Vec3 x = pole - sine * out;
      x -= dot(x, out) * out;
      const double aside = direct(x, out), cosine = aside < 0.5 ? aside : std::sqrt((1 - sine) * (1 + sine));
      const double lost = sine * sine / (1 + cosine);
      const Circle circle{lost * x - sine * out, x, cross(edge.along, x), 1};
      const double half = edge.angle / 2;
      const double middle = half > kPi / 2 ? 0 : std::atan2(dot(edge.middle, circle.y), dot(edge.middle, x));
      begin_breaks(middle, half);
      for (const int j : work_.active) {
        const Vec3 n = work_.faces[j].normal;
        add_roots(dot(n, circle.nearest) - level_of(j), dot(n, circle.y), dot(n, x), middle, half);
      }
      sort_breaks();
      for (size_t i = 0; i + 1 < work_.breaks.size(); ++i) {
        const Turn &begin = work_.breaks[i], &end = work_.breaks[i + 1];
        if (!(begin.angle < end.angle) || !below(circle.between(begin, end), kNone, kNone)) continue;
        // Counter-clockwise around the normals is clockwise about the direction out of the vertex.
        const double sign = edge.from == v ? -1 : 1;
        add_arc(circle, begin, end, sign, -sign * sine, 0, lost, cosine, [](double, Vec3, Vec3) {});
      }
    }
    // Circles in the planes of the polytope.
    for (const int j : work_.active) {
      const Vec3 n = work_.faces[j].normal;
      const double above = level_of(j), ahead = dot(n, pole), level = above + ahead;
      const double under = norm2(n - pole) / 2 - above, over = norm2(n + pole) / 2 + above;  // 1 ∓ level
      if (!(under > 0 && over > 0)) continue;
      const double radius = std::sqrt(under * over);
      Vec3 x = ahead > 0 ? pole - n : pole + n;
      x -= dot(x, n) * n;
      const double aside = direct(x, n);
      const double wider = -above * (level + ahead) / (radius + aside);
      const Circle circle{above * n + wider * x, x, cross(n, x), radius};
      begin_breaks(0, kPi);
      bool same = false;
      const auto cut_by = [&](Vec3 normal, double at) {
        const size_t before = work_.breaks.size();
        const double apart = dot(normal, circle.nearest) - at;
        same = same || (norm2(cross(normal, n)) < 1e-18 && std::abs(apart) < 1e-9);
        add_roots(apart, radius * dot(normal, circle.y), radius * dot(normal, x), 0, kPi);
        return before;
      };
      for (const int e : edges) cut_by(out_of(e), -sine_of(e));
      for (const int k : work_.active) {
        if (k == j) continue;
        for (size_t b = cut_by(work_.faces[k].normal, level_of(k)); b < work_.breaks.size(); ++b) {
          if (k < j) continue;
          const Vec3 u = circle.at(work_.breaks[b]);
          if (below(u, j, k) && among_normals(u) && !pierce(j, k, seen.base * pole + r_ * u, pole + u)) return false;
        }
      }
      if (same) return false;
      sort_breaks();
      for (size_t i = 0; i + 1 < work_.breaks.size(); ++i) {
        const Turn &begin = work_.breaks[i], &end = work_.breaks[i + 1];
        const Vec3 between = circle.between(begin, end);
        if (!(begin.angle < end.angle) || !below(between, j, kNone) || !among_normals(between)) continue;
        double twice = 0, border_size = 0;
        // Clockwise about the plane's normal.
        add_arc(circle, begin, end, -1, radius * (wider * ahead - above * aside), radius * level * aside,
                norm2(circle.nearest) / 2, radius * aside, [&](double weight, Vec3 u, Vec3 step) {
                  const Vec3 point = seen.base * pole + r_ * u;
                  twice += weight * r_ * dot(n, cross(point, step));
                  border_size += weight * r_ * std::sqrt(norm2(point) * norm2(step));
                });
        add_border(j, r_ * (circle.at(end) - circle.at(begin)), twice, border_size);
        work_.faces[j].loose += r_ * radius * (begin.doubt + end.doubt);
      }
    }
    // Near the direction opposite to the pole, the rule loses digits.
    constexpr double kTooFar = 1.7;
    if (most_lost > kTooFar || !(norm(open) <= 64 * kTurn)) return false;
    area_ += square * std::abs(angle), sizes_ += square * std::abs(angle);
    unbalanced_ += square / 2 * twice_normals;
    const double reach = std::abs(seen.base) + std::abs(seen.slope) * most_lost;
    add_cone(square * cones, square * size, reach);
    loose_ += square / 3 * loose * reach;
    return true;
  }

  // ----------------------------------------------------------------------------------------------------------- faces

  bool add_faces() {
    if (!find_corners()) return false;
    for (size_t e = 0; e < work_.edges.size(); ++e) {
      const Edge& edge = work_.edges[e];
      const Ridge& ridge = work_.ridges[e];
      const bool from = work_.inside[edge.from] == 1, to = work_.inside[edge.to] == 1;
      // A convex body holds an interval of the edge.
      const bool fits = from == to ? ridge.enters == ridge.leaves && !(from && ridge.enters)
                                   : ridge.enters == to && ridge.leaves == from;
      if (!fits) return false;
      if (!(from || ridge.enters)) continue;
      const Vec3 begin = ridge.enters ? ridge.from : work_.corners[edge.from];
      const Vec3 end = ridge.leaves ? ridge.to : work_.corners[edge.to], step = end - begin;
      reaches(begin), reaches(end);
      for (const auto& [j, side] : {std::pair(edge.left, 1.0), std::pair(edge.right, -1.0)})
        add_border(j, side * step, side * dot(work_.faces[j].normal, cross(begin, step)),
                   std::sqrt(norm2(begin) * norm2(step)));
    }
    for (std::uint64_t rest = cutting_; rest != 0; rest &= rest - 1) {
      const Face& face = work_.faces[std::countr_zero(rest)];
      const double area = face.twice_area / 2;
      area_ += std::abs(area), unbalanced_ += area * face.normal;
      add_cone(area * face.offset, 0, area != 0 ? face.offset : 0);
    }
    return true;
  }

  /// Finds which corners of the polytope are in the rounded hull, from where the surface crosses its edges.
  bool find_corners() {
    constexpr char kUnknown = 2;
    work_.inside.assign(work_.corners.size(), kUnknown);
    for (size_t e = 0; e < work_.edges.size(); ++e) {
      const Edge& edge = work_.edges[e];
      const Ridge& ridge = work_.ridges[e];
      const auto set = [&](int corner, char inside) {
        char& known = work_.inside[corner];
        const bool agrees = known == kUnknown || known == inside;
        known = inside;
        return agrees;
      };
      if (ridge.enters && !(set(edge.from, 0) && (ridge.leaves || set(edge.to, 1)))) return false;
      if (ridge.leaves && !(set(edge.to, 0) && (ridge.enters || set(edge.from, 1)))) return false;
    }
    // Corners at the ends of an edge that is not crossed are on the same side.
    const auto spread = [&] {
      for (bool changed = true; changed;) {
        changed = false;
        for (size_t e = 0; e < work_.edges.size(); ++e) {
          char &from = work_.inside[work_.edges[e].from], &to = work_.inside[work_.edges[e].to];
          if (from == to || work_.ridges[e].enters || work_.ridges[e].leaves) continue;
          if (from == kUnknown) from = to, changed = true;
          else if (to == kUnknown) to = from, changed = true;
        }
      }
    };
    spread();
    for (const Edge& edge : work_.edges)
      for (const int c : {edge.from, edge.to}) {
        if (work_.inside[c] != kUnknown) continue;
        const Vec3 corner = work_.corners[c];
        const double above = height_of(apex_ + corner);
        if (!(std::abs(above) > tie_)) return false;
        work_.inside[c] = above < 0;
        spread();
      }
    return true;
  }

  double height_of(Vec3 point) const {
    return ask(rounded_.shape, [&](const auto& shape) { return signed_distance(shape.tightest(point), point); });
  }

  /// Whether the sum of all area vectors and of all steps along borders are zero, but for rounding.
  bool closes() const {
    double open = 0;
    for (const Face& face : work_.faces) open += norm(face.open);
    const double extent = std::sqrt(extent2_), moved = 4 * off_ + kTurn * 8 * (r_ + extent);
    const double far = 16 * (moved + kRoundingOfTerms * extent);
    return open <= 16 * far && norm(unbalanced_) <= far * (seams_ + border_ + extent) + kRoundingOfTerms * sizes_;
  }

  const Placed& rounded_;
  const Core& core_;
  double r_;
  Vec3 apex_;
  bool wide_;
  double off_;
  double tie_;  ///< m: nearer to a plane, doubles are not certain of anything
  std::uint64_t cutting_;
  PolytopeWork& work_;
  int faces_;
  double thrice_ = 0;
  double size_ = 0;    ///< m³: sum of the sizes of all terms
  double area_ = 0;    ///< m²
  double sizes_ = 0;   ///< m²: sum of the sizes of all areas
  double tilted_ = 0;  ///< m²: sum over the borders of facets, of their lengths times their distances
  double farthest_;    ///< m: largest distance of a tangent plane, or of a plane of the polytope, from the apex
  double seams_ = 0;   ///< m: sum of these lengths
  double border_ = 0;  ///< m: sum of the sizes of all steps along borders of faces
  double loose_ = 0;   ///< m³: what patches may lack or have too much, as their arcs may not meet
  double extent2_;     ///< m²: largest square of a distance from the apex
  Vec3 unbalanced_;    ///< m²
};

/// The polytope's planes in the coordinates of the core. False if it has too many facets, or no edges.
bool become(const Placed& rounded, const Placed& polytope, PolytopeWork& work) {
  const int facets = overlapper::facets(polytope.shape);
  if (facets > kMostFaces) return false;
  const Pose pose = relative_pose(rounded.pose, polytope.pose);
  work.planes.clear(), work.corners.clear();
  ask_flat(polytope.shape, [&](const auto& shape) {
    for (int c = 0; c < shape.vertex_count(); ++c) work.corners.push_back(pose * shape.vertex(c));
    for (int f = 0; f < facets; ++f) work.planes.push_back(pose * shape.facet(f));
    return true;
  });
  return true;
}

/// The polytope about the apex, in the coordinates of the core, in double-doubles.
class WidePlaces {
 public:
  WidePlaces(const Placed& rounded_body, const Placed& polytope, Vec3 apex)
      : turned_(!unturned(polytope.orientation)),
        core_turned_(!unturned(rounded_body.orientation)),
        origin_(wide(data_origin(polytope.shape))),
        apart_(wide(polytope.position) - wide(rounded_body.position)),
        about_(wide(data_origin(rounded_body.shape)) + wide(apex)) {
    if (turned_) rotation_ = wide_rotation(polytope.orientation);
    if (core_turned_) core_rotation_ = wide_rotation(rounded_body.orientation);
  }
  WideVector point(Vec3 own) const {
    const WideVector about_origin = wide(own) + origin_;
    return into_core((turned_ ? rotation_ * about_origin : about_origin) + apart_) - about_;
  }
  WidePlane plane(const WidePlane& own) const {
    const WideVector normal = turned_ ? rotation_ * own.normal : own.normal;
    const WideVector in_core = into_core(normal);
    return {in_core, own.offset + dot(own.normal, origin_) + dot(normal, apart_) - dot(in_core, about_)};
  }

 private:
  WideVector into_core(const WideVector& v) const { return core_turned_ ? apply_transposed(core_rotation_, v) : v; }

  bool turned_, core_turned_;
  WideMatrix rotation_, core_rotation_;
  WideVector origin_, apart_, about_;
};

/// The planes that cut the rounded hull. If the contact is shallow, or if there is only one, they are those that also
/// cut what is below the plane that leaves least.
struct Cutting {
  std::uint64_t planes = 0;
  int deepest = kNone;
  bool shallow = false;  ///< places need double-doubles
};

/// `depth` is an upper bound of the depth. Heights may be off by `rounding`.
Cutting planes_that_cut(const Core& core, double depth, double rounding, const PolytopeWork& work) {
  // Up to this rounding of places, the error of the volume is some 1e-13 of it.
  constexpr double kSure = 0x1p-44;
  const int faces = static_cast<int>(work.planes.size()), vertices = static_cast<int>(core.vertices.size());
  const double r = core.r;
  const auto height = [&](int v, int j) { return work.heights[v * faces + j]; };
  double least_depth = kInfinity;
  Cutting cutting;
  for (int j = 0; j < faces; ++j) {
    double least = kInfinity, most = -kInfinity;
    for (int v = 0; v < vertices; ++v) least = std::min(least, height(v, j)), most = std::max(most, height(v, j));
    if (most + r < -rounding) continue;
    cutting.planes |= std::uint64_t{1} << j;
    if (r - least < least_depth) least_depth = r - least, cutting.deepest = j;
  }
  if (cutting.planes == 0) return cutting;
  cutting.shallow = !(rounding < kSure * std::min(depth, least_depth));
  const int deepest = cutting.deepest;
  // A point below the plane is in a ball about a point y of the core that is at most r above the plane. Seen from y, it
  // is in a cap of the ball.
  const Vec3 n = work.planes[deepest].normal;
  const double level = std::clamp((least_depth - r) / r, -1.0, 1.0);
  std::uint64_t left = cutting.planes & ~(std::uint64_t{1} << deepest);
  for (std::uint64_t rest = left; rest != 0; rest &= rest - 1) {
    const int j = std::countr_zero(rest);
    const double cosine = dot(n, work.planes[j].normal);
    double cap = 1;
    if (cosine > level)
      cap = level * cosine + std::sqrt(std::max(0.0, (1 - level) * (1 + level) * (1 - cosine) * (1 + cosine)));
    double most = -kInfinity;
    for (int v = 0; v < vertices; ++v)
      if (height(v, deepest) < r) most = std::max(most, height(v, j));
    for (const OffsetSurface::Edge& edge : core.edges) {
      if (most + r * cap >= -rounding) break;
      const double a = height(edge.from, deepest) - r, b = height(edge.to, deepest) - r;
      if ((a < 0) == (b < 0)) continue;
      most = std::max(most, height(edge.from, j) + a / (a - b) * (height(edge.to, j) - height(edge.from, j)));
    }
    if (most + r * cap < -rounding) left &= ~(std::uint64_t{1} << j);
    else if (!cutting.shallow) return cutting;
  }
  cutting.planes = left | std::uint64_t{1} << deepest;
  return cutting;
}

Core core_of(const Shape& shape, PolytopeWork& work) {
  const double r = core_radius(shape);
  if (const HullData* hull = polytope_of(shape)) {
    const OffsetSurface& surface = offset_surface(*hull);
    return {hull->vertices, surface.edges, &surface, hull, r};
  }
  const double h = revolution(shape)->half_length;
  work.ends = {Vec3{0, 0, -h}, Vec3{0, 0, h}};
  OffsetSurface::Edge& axis = work.axis[0];
  axis = {.from = 0, .to = 1, .length = 2 * h, .along = {0, 0, 1}, .middle = {1, 0, 0}, .across = {0, 1, 0}};
  axis.angle = 2 * kPi;
  return {work.ends, work.axis, nullptr, nullptr, r};
}

/// By places in doubles, or in double-doubles.
std::optional<VolumeAlone> measure(const Placed& rounded_body, const Placed& polytope, const Core& core, Vec3 apex,
                                   bool wide, double off, std::uint64_t cutting, PolytopeWork& work) {
  const auto cuts = [&](int j) { return (cutting >> j & 1) != 0; };
  work.edges.clear();
  for (const Edge& edge : edges(polytope.shape))
    if (cuts(edge.left) && cuts(edge.right)) work.edges.push_back(edge);
  work.faces.assign(work.planes.size(), {});
  const double tie = 4 * off;
  if (wide) {
    const WidePlaces places(rounded_body, polytope, apex);
    for (std::uint64_t rest = cutting; rest != 0; rest &= rest - 1) {
      const int j = std::countr_zero(rest);
      const std::optional<WidePlane> own = unit_facet(polytope.shape, j);
      if (!own) return std::nullopt;
      const WidePlane plane = places.plane(*own);
      work.faces[j].normal = rounded(plane.normal), work.faces[j].offset = plane.offset.head;
    }
    ask_flat(polytope.shape, [&](const auto& shape) {
      for (const Edge& edge : work.edges)
        for (const int c : {edge.from, edge.to}) work.corners[c] = rounded(places.point(shape.vertex(c)));
      return true;
    });
    const double size = norm(polytope.position) + norm(rounded_body.position) + norm(data_origin(polytope.shape)) +
                        norm(data_origin(rounded_body.shape)) + reach(polytope.shape) + reach(rounded_body.shape);
    const bool turned = !unturned(polytope.orientation) || !unturned(rounded_body.orientation);
    off = wide_placing(size, turned);
  } else {
    for (std::uint64_t rest = cutting; rest != 0; rest &= rest - 1) {
      const int j = std::countr_zero(rest);
      work.faces[j].normal = work.planes[j].normal, work.faces[j].offset = -signed_distance(work.planes[j], apex);
    }
    for (Vec3& corner : work.corners) corner -= apex;
  }
  const double all = reach(polytope.shape) + reach(rounded_body.shape);
  InPolytope part(rounded_body, core, apex, wide, off, tie, all, cutting, work);
  if (!part.add_all()) return std::nullopt;
  const VolumeAlone found{part.volume(), part.error()};
  if (!(found.volume > 0 && found.error <= (core.hull ? kEnough : kEnoughOfRound) * found.volume)) return std::nullopt;
  return found;
}

}  // namespace

std::optional<VolumeAlone> volume_in_polytope(const Placed& rounded_body, const Placed& polytope,
                                              const std::optional<Vec3>& near, double depth) {
  const HullData* hull = polytope_of(rounded_body.shape);
  if (!bounded(polytope.shape)) return hull ? volume_below_plane(rounded_body, polytope, 0) : std::nullopt;
  const Scratch<PolytopeWork> work;
  if (hull && !offset_surface(*hull).exact) return std::nullopt;
  if (!become(rounded_body, polytope, *work)) return std::nullopt;
  const Core core = core_of(rounded_body.shape, *work);
  const double r = core.r;
  const double size = norm(rounded_body.pose.translation - polytope.pose.translation) + reach(rounded_body.shape) +
                      reach(polytope.shape);
  const double off = rounding(reach(rounded_body, reach(polytope, size))) + flatness(polytope.shape);
  // Other capsules have a closed form for all measures.
  constexpr double kShallowCapsule = 0x1p-43;
  if (!hull && !(near && off > kShallowCapsule * depth)) return std::nullopt;
  const double tie = 4 * off;
  const std::span<const Vec3> vertices = core.vertices;
  Bounds own{{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}}, other = own;
  work->heights.resize(vertices.size() * work->planes.size()), work->sides.assign(vertices.size(), {});
  double* height = work->heights.data();
  for (size_t v = 0; v < vertices.size(); ++v) {
    own = {min(own.lower, vertices[v]), max(own.upper, vertices[v])};
    std::uint64_t below = 0, above = 0, bit = 1;
    for (const Plane& plane : work->planes) {
      *height = signed_distance(plane, vertices[v]);
      below |= *height < -r - tie ? bit : 0, above |= *height > r + tie ? bit : 0;
      ++height, bit <<= 1;
    }
    work->sides[v] = {below, above};
  }
  const Cutting cutting = planes_that_cut(core, near ? depth : kInfinity, 2 * off, *work);
  if (!hull && std::popcount(cutting.planes) < 2) return std::nullopt;
  if (cutting.planes == 0) {
    const double whole = offset_surface(*hull).volume(r);
    return VolumeAlone{whole, kRoundingOfTerms * whole};
  }
  if (hull && std::has_single_bit(cutting.planes))
    if (const auto found = volume_below_plane(rounded_body, polytope, cutting.deepest)) return found;
  Vec3 apex;
  if (near) {
    apex = apply_transposed(rounded_body.pose.rotation, *near - rounded_body.pose.translation);
  } else {
    for (const Vec3 corner : work->corners) other = {min(other.lower, corner), max(other.upper, corner)};
    const Vec3 margin = r * Vec3{1, 1, 1};
    apex = 0.5 * (max(own.lower - margin, other.lower) + min(own.upper + margin, other.upper));
  }
  if (!cutting.shallow)
    if (const auto found = measure(rounded_body, polytope, core, apex, false, off, cutting.planes, *work)) return found;
  return measure(rounded_body, polytope, core, apex, true, off, cutting.planes, *work);
}

}  // namespace overlapper::offset
