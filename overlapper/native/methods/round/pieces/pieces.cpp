#include "methods/round/pieces/pieces.h"

#include <algorithm>
#include <limits>

#include "geometry/cancellation.h"
#include "methods/round/slicing/slice.h"

namespace overlapper::pieces {
namespace {

/// The number of planes, those of the box included, that the polytope around the common set is cut with. The polytope
/// need not be tight, and every piece of a body is cut out of it.
constexpr size_t kMostFaces = 64;

/// If facets of a hull hold their corners but for rounding, the planes of so many triangles are looked at instead. So
/// many of these may matter: slices have lines for as many, and as many again for the other body.
constexpr size_t kMostTriangles = 256;
constexpr size_t kMostOfTriangles = slicing::kMostLines / 2;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A body in double-double, and the cutter of it.
class Cutter {
 public:
  Cutter(const Placed& body, const Placed& other, const EnclosingPolytope* common, int owner, Vec3 reference,
         const WideVector& inside, Pieces& result)
      : other_(other),
        common_(common),
        owner_(owner),
        inside_(rounded(inside)),
        rotation_(wide_rotation(body.orientation)),
        origin_(wide(body.position) - wide(reference) - inside),
        result_(result) {
    if (const HullData* hull = polytope_of(body.shape)) origin_ = origin_ + rotation_ * wide(hull->origin);
    plain_rotation_ = rounded(rotation_), plain_origin_ = rounded(origin_);
    margin_ = 1e-12 * (norm(body.pose.translation) + norm(other.pose.translation) + reach(body.shape));
  }

  /// The shape is one that Traits::other does not tell of.
  void cut(const Shape& shape) {
    const HullData* hull = polytope_of(shape);
    if (smooth(shape) && hull) rounded_hull(*hull, core_radius(shape));
    else if (hull) polytope(*hull);
    else if (!smooth(shape)) facet_walls(shape);
    else if (stretched(shape)) whole_ball(1);
    else revolved(*revolution(shape));
  }

 private:
  void whole_ball(double radius) {
    begin();
    ball({}, radius);
    end();
  }

  void facet_walls(const Shape& shape) {
    begin();
    for (int f = 0; f < overlapper::facets(shape); ++f) {
      const auto [normal, offset] = *unit_facet(shape, f);
      wall(normal, offset, owner_);
    }
    end();
  }

  void revolved(const Revolution& r) {
    const double half = r.half_length;
    if (half == 0) return whole_ball(r.radius);
    begin();
    cylinder({}, {{}, {}, {1}}, r.radius, half);
    for (const double sign : {-1.0, 1.0}) wall({{}, {}, {sign}}, {half}, r.round_ends ? slicing::kCut : owner_);
    end();
    if (!r.round_ends) return;
    for (const double sign : {-1.0, 1.0}) {
      begin();
      ball({{}, {}, {sign * half}}, r.radius);
      wall({{}, {}, {-sign}}, {-half}, slicing::kCut);
      end();
    }
  }

  void polytope(const HullData& data) {
    const double flatness = unexact(data);
    begin();
    if (flatness == 0 || !triangle_walls(data)) {
      for (int f = 0; f < facets(data); ++f) facet_wall(data, f, 0, owner_);
      result_.flatness = std::max(result_.flatness, flatness);
    }
    end();
  }

  void rounded_hull(const HullData& core, double radius) {
    result_.flatness = std::max(result_.flatness, unexact(core));
    begin();
    for (int f = 0; f < facets(core); ++f) facet_wall(core, f, 0, slicing::kCut);
    end();
    const Bounds near = local_bounds(radius);
    for (int f = 0; f < facets(core); ++f)
      if (meets(near, core.vertices, core.facet(f))) prism(core, f, radius);
    std::vector<std::pair<int, int>> beside;
    for (const Edge& edge : core.edges) {
      cancellation_point();
      const std::array<int, 2> ends{edge.from, edge.to};
      if (!meets(near, core.vertices, ends)) continue;
      edge_wedge(core, edge, radius);
      for (const int i : {0, 1})
        if (meets(near, core.vertices, std::span(ends).subspan(i, 1))) beside.push_back({ends[i], ends[1 - i]});
    }
    std::ranges::sort(beside);
    for (size_t i = 0, end; i < beside.size(); i = end) {
      for (end = i + 1; end < beside.size() && beside[end].first == beside[i].first;) ++end;
      vertex_wedge(core, std::span(beside).subspan(i, end - i), radius);
    }
  }

  /// In the body's own coordinates, what encloses the common set, and so much more.
  Bounds local_bounds(double more) const {
    if (!common_) return {{-kInfinity, -kInfinity, -kInfinity}, {kInfinity, kInfinity, kInfinity}};
    Bounds box{{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}};
    const Vec3 wider = (more + margin_) * Vec3{1, 1, 1};
    for (const EnclosingPolytope::Corner& corner : common_->corners) {
      const Vec3 at = apply_transposed(plain_rotation_, corner.at - plain_origin_);
      box = {min(box.lower, at), max(box.upper, at)};
    }
    return {box.lower - wider, box.upper + wider};
  }

  static bool meets(const Bounds& box, const std::vector<Vec3>& vertices, std::span<const int> some) {
    Vec3 lower = vertices[some[0]], upper = lower;
    for (const int v : some.subspan(1)) lower = min(lower, vertices[v]), upper = max(upper, vertices[v]);
    return lower.x <= box.upper.x && lower.y <= box.upper.y && lower.z <= box.upper.z && upper.x >= box.lower.x &&
           upper.y >= box.lower.y && upper.z >= box.lower.z;
  }

  static int facets(const HullData& hull) { return static_cast<int>(hull.planes.size()); }

  static double unexact(const HullData& hull) {
    const bool exact = std::ranges::none_of(hull.facet_corners, [](const auto& c) { return c[0] < 0; });
    return exact ? 0 : std::max(hull.flatness, 0x1p-52 * hull.radius);
  }

  void begin() {
    piece_ = {-1, static_cast<int>(result_.walls.size()), 0};
    empty_ = false;
  }
  void end() {
    const int walls = static_cast<int>(result_.walls.size());
    piece_.walls = walls - piece_.first_wall;
    if (!empty_) {
      result_.pieces.push_back(piece_);
      return;
    }
    result_.walls.resize(piece_.first_wall);
    if (piece_.round >= 0) result_.rounds.pop_back();
  }

  WideVector in_world(const WideVector& local) const { return origin_ + rotation_ * local; }

  void ball(const WideVector& centre, double radius) { round({true, in_world(centre), {}, radius, 0, owner_}); }
  void cylinder(const WideVector& centre, const WideVector& axis, double radius, double half_length) {
    round({false, in_world(centre), rotation_ * axis, radius, half_length, owner_});
  }
  void round(const Round& r) {
    piece_.round = static_cast<int>(result_.rounds.size());
    result_.rounds.push_back(r);
  }

  /// In the body's own coordinates. The other body's supports tell whether it matters.
  void wall(const WideVector& local_normal, DoubleDouble local_offset, int owner) {
    if (empty_) return;
    const WideVector normal = rotation_ * local_normal;
    const DoubleDouble slack = local_offset + dot(normal, origin_);
    const Vec3 n = rounded(normal);
    const double here = dot(n, inside_) + slack.head;
    if (common_) {
      cancellation_point(common_->corners.size());
      const auto [least, most] = common_->range(n);
      if (most < slack.head - margin_) return;
      if (least > slack.head + margin_) {
        empty_ = true;
        return;
      }
    } else if (bounded(other_.shape)) {
      if (dot(n, other_.support(n)) < here - margin_) return;
      if (dot(n, other_.support(-n)) > here + margin_) {
        empty_ = true;
        return;
      }
    }
    result_.walls.push_back({normal, slack, owner});
  }

  /// Whether what encloses the common set is surely beyond a plane, or surely nowhere beyond it, by doubles.
  enum class Side { kBeyond, kInside, kBoth };
  Side side_of(Vec3 local_normal, double local_offset) const {
    const Vec3 n = plain_rotation_ * local_normal;
    const double slack = local_offset + dot(n, plain_origin_), margin = 4 * margin_;
    if (common_) {
      cancellation_point(common_->corners.size());
      const auto [least, most] = common_->range(n);
      return least > slack + margin ? Side::kBeyond : most < slack - margin ? Side::kInside : Side::kBoth;
    }
    const bool below = bounded(other_.shape) && dot(n, other_.support(n)) < slack + dot(n, inside_) - margin;
    return below ? Side::kInside : Side::kBoth;
  }
  bool beyond(Vec3 local_normal, double local_offset) const {
    return common_ && side_of(local_normal, local_offset) == Side::kBeyond;
  }
  bool beyond(Vec3 local_normal, Vec3 point) const { return beyond(local_normal, dot(local_normal, point)); }

  struct WidePlane {
    WideVector normal;
    DoubleDouble offset;
  };
  /// The plane of a facet through three of its corners, exactly. Other corners may be off it by the flatness.
  static WidePlane plane_of(const HullData& hull, int f) {
    const auto [a, b, c] = hull.facet_corners[f];
    if (a < 0) return {unit(wide(hull.planes[f].normal)), {hull.planes[f].offset}};
    const WideVector normal = unit(wide_normal(hull.corners[a], hull.corners[b], hull.corners[c]));
    return {normal, dot(normal, wide(hull.corners[a]))};
  }
  void facet_wall(const HullData& hull, int f, double radius, int owner) {
    if (empty_) return;
    cancellation_point();
    if (side_of(hull.planes[f].normal, hull.planes[f].offset + radius) == Side::kInside) return;
    const auto [normal, offset] = plane_of(hull, f);
    wall(normal, offset + DoubleDouble{radius}, owner);
  }
  /// The planes of all triangles, of which those that make a facet are one but for rounding. False, and there are none,
  /// if they are too many.
  bool triangle_walls(const HullData& hull) {
    if (hull.triangles.size() > kMostTriangles) return false;
    for (const auto& [a, b, c] : hull.triangles) {
      const WideVector normal = unit(wide_normal(hull.corners[a], hull.corners[b], hull.corners[c]));
      wall(normal, dot(normal, wide(hull.corners[a])), owner_);
    }
    if (result_.walls.size() <= piece_.first_wall + kMostOfTriangles) return true;
    result_.walls.resize(piece_.first_wall);
    return false;
  }
  static Mat3 rounded(const WideMatrix& m) {
    return {overlapper::rounded(m.row0), overlapper::rounded(m.row1), overlapper::rounded(m.row2)};
  }
  static Vec3 rounded(const WideVector& v) { return overlapper::rounded(v); }

  void wall_through(const WideVector& normal, Vec3 point) { wall(normal, dot(normal, wide(point)), slicing::kCut); }

  void prism(const HullData& hull, int f, double radius) {
    const Plane& plane = hull.planes[f];
    if (beyond(plane.normal, plane.offset + radius) || beyond(-plane.normal, -plane.offset)) return;
    begin();
    const auto [normal, offset] = plane_of(hull, f);
    wall(-normal, -offset, slicing::kCut);
    wall(normal, offset + DoubleDouble{radius}, owner_);
    const auto ring = hull.facet(f);
    for (size_t i = 0; i < ring.size() && !empty_; ++i) {
      const Vec3 a = hull.vertices[ring[i]], b = hull.vertices[ring[(i + 1) % ring.size()]];
      wall_through(unit(cross(wide_difference(b, a), normal)), a);
    }
    end();
  }

  void edge_wedge(const HullData& hull, const Edge& edge, double radius) {
    const Vec3 a = hull.vertices[edge.from], b = hull.vertices[edge.to];
    const Vec3 way = overlapper::unit(b - a), out_left = hull.planes[edge.left].normal;
    const Vec3 out_right = hull.planes[edge.right].normal;
    if (beyond(way, b) || beyond(-way, a) || beyond(cross(out_left, way), a) || beyond(cross(way, out_right), a))
      return;
    const WideVector between = wide_difference(b, a), along = unit(between);
    begin();
    cylinder(DoubleDouble{0.5} * (wide(a) + wide(b)), along, radius, overlapper::rounded(norm(between)) / 2);
    wall_through(-along, a);
    wall_through(along, b);
    // The left facet lies to the left of the edge seen from outside: beyond it, the other way.
    if (!empty_) wall_through(unit(cross(plane_of(hull, edge.left).normal, along)), a);
    if (!empty_) wall_through(unit(cross(along, plane_of(hull, edge.right).normal)), a);
    end();
  }

  /// `beside` has the vertex with each vertex that it shares an edge with.
  void vertex_wedge(const HullData& hull, std::span<const std::pair<int, int>> beside, double radius) {
    const Vec3 vertex = hull.vertices[beside[0].first];
    for (const auto& [_, other] : beside)
      if (beyond(overlapper::unit(hull.vertices[other] - vertex), vertex)) return;
    begin();
    ball(wide(vertex), radius);
    for (const auto& [_, other] : beside) wall_through(unit(wide_difference(hull.vertices[other], vertex)), vertex);
    end();
  }

  const Placed& other_;
  const EnclosingPolytope* common_;
  int owner_;
  Vec3 inside_;
  WideMatrix rotation_;
  WideVector origin_;
  Mat3 plain_rotation_;
  Vec3 plain_origin_;
  Pieces& result_;
  double margin_ = 0;
  Piece piece_;
  bool empty_ = false;
};

}  // namespace

double extent(const Placed& body, Vec3 point) {
  if (!bounded(body.shape)) return std::numeric_limits<double>::infinity();
  return norm(body.pose.translation - point) + reach(body.shape);
}

void enclose(const Placed& a, const Placed& b, Vec3 inside, EnclosingPolytope& result) {
  const Bounds p = bounds(a), q = bounds(b);
  const Vec3 lower = max(p.lower, q.lower) - inside, upper = min(p.upper, q.upper) - inside;
  const Vec3 size = max(abs(lower), abs(upper));
  const double margin = 1e-12 * (norm(size) + norm(inside) + norm(a.pose.translation) + norm(b.pose.translation));
  const Vec3 wider = margin * Vec3{1, 1, 1};
  result.become({lower - wider, upper + wider});
  thread_local std::vector<EnclosingPolytope::Face> planes;
  planes.clear();
  for (const Placed* body : {&a, &b}) {
    const Vec3 origin = body->pose.translation - inside;
    const auto add = [&](const Plane& plane, double more) {
      cancellation_point();
      const Vec3 normal = body->pose.rotation * plane.normal;
      planes.push_back({normal, plane.offset + dot(normal, origin) + more + margin, kNoWall});
    };
    if (const HullData* hull = polytope_of(body->shape)) {
      const double more = core_radius(body->shape) + hull->flatness;
      for (const Plane& plane : hull->planes) add(plane, more);
    } else {
      for (int f = 0; f < overlapper::facets(body->shape); ++f) add(facet(body->shape, f), 0);
    }
  }
  std::ranges::sort(planes, {}, &EnclosingPolytope::Face::slack);
  for (const EnclosingPolytope::Face& plane : planes) {
    if (result.faces.size() >= kMostFaces) break;
    cancellation_point(result.corners.size());
    result.cut(plane);
  }
  result.drop_faces();
}

void cut(const Placed& body, const Placed& other, const EnclosingPolytope* common, int owner, Vec3 reference,
         const WideVector& inside, Pieces& result) {
  Cutter cutter(body, other, common, owner, reference, inside, result);
  cutter.cut(body.shape);
}

bool grow(Pieces& pieces, double outwards) {
  for (Wall& wall : pieces.walls)
    if (wall.owner != slicing::kCut) wall.slack = wall.slack + DoubleDouble{outwards};
  for (Round& r : pieces.rounds) r.radius += outwards;
  return std::ranges::all_of(pieces.rounds, [](const Round& r) { return r.radius > 0; });
}

}  // namespace overlapper::pieces
