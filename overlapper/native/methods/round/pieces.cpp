#include "methods/round/pieces.h"

#include <algorithm>
#include <limits>

namespace overlapper::slicing {
namespace {

/// How far a shape reaches from its own origin; of a half-space, how far its plane is.
double reach(const Shape& shape) {
  struct Visitor {
    double operator()(const Sphere& s) const { return s.radius; }
    double operator()(const Box& b) const { return norm(b.half_extents); }
    double operator()(const Capsule& c) const { return c.radius + c.length / 2; }
    double operator()(const Cylinder& c) const { return c.radius + c.length / 2; }
    double operator()(const Hull& h) const { return h.data->radius; }
    double operator()(const HalfSpace& h) const { return std::abs(h.plane.offset); }
    double operator()(const RoundedHull& h) const { return h.core.data->radius + h.radius; }
  };
  return std::visit(Visitor{}, shape);
}

/// A body in double-double, and the cutter of it.
class Cutter {
 public:
  Cutter(const Placed& body, const Placed& other, int owner, Vec3 reference, const WideVector& inside, Pieces& result)
      : other_(other),
        owner_(owner),
        inside_(rounded(inside)),
        rotation_(wide_rotation(body.orientation)),
        origin_(wide(body.position) - wide(reference) - inside),
        result_(result) {
    if (const HullData* hull = polytope_of(body.shape)) origin_ = origin_ + rotation_ * wide(hull->origin);
    margin_ = 1e-12 * (norm(body.pose.translation) + norm(other.pose.translation) + reach(body.shape));
  }

  void operator()(const Sphere& s) {
    begin();
    ball({}, s.radius);
    end();
  }

  void operator()(const Box& box) {
    begin();
    for (int f = 0; f < 6; ++f) {
      const Plane plane = side(box, f);
      wall(wide(plane.normal), {plane.offset}, owner_);
    }
    end();
  }

  void operator()(const HalfSpace& half) {
    begin();
    const DoubleDouble length = norm(wide(half.given_normal));
    const bool as_given = norm2(half.plane.normal - half.given_normal) == 0;
    const WideVector normal = unit(wide(half.given_normal));
    // A normal that is unit but for its last bits stands for its direction, and the offset is along that.
    wall(normal, DoubleDouble{as_given ? half.plane.offset : half.given_offset} / length, owner_);
    end();
  }

  void operator()(const Cylinder& c) {
    begin();
    cylinder({}, {{}, {}, {1}}, c.radius, c.length / 2);
    for (const double sign : {-1.0, 1.0}) wall({{}, {}, {sign}}, {c.length / 2}, owner_);
    end();
  }

  void operator()(const Capsule& c) {
    const double half = c.length / 2;
    if (half > 0) {
      begin();
      cylinder({}, {{}, {}, {1}}, c.radius, half);
      for (const double sign : {-1.0, 1.0}) wall({{}, {}, {sign}}, {half}, kCut);
      end();
    }
    for (const double sign : {-1.0, 1.0}) {
      begin();
      ball({{}, {}, {sign * half}}, c.radius);
      if (half > 0) wall({{}, {}, {-sign}}, {-half}, kCut);
      end();
      if (half == 0) break;
    }
  }

  void operator()(const Hull& hull) {
    begin();
    for (int f = 0; f < facets(*hull.data); ++f) facet_wall(*hull.data, f, 0, owner_);
    result_.flatness = std::max(result_.flatness, unexact(*hull.data));
    end();
  }

  void operator()(const RoundedHull& hull) {
    const HullData& core = *hull.core.data;
    result_.flatness = std::max(result_.flatness, unexact(core));
    begin();
    for (int f = 0; f < facets(core); ++f) facet_wall(core, f, 0, kCut);
    end();
    for (int f = 0; f < facets(core); ++f) prism(core, f, hull.radius);
    for (const Edge& edge : core.edges) edge_wedge(core, edge, hull.radius);
    for (int v = 0; v < static_cast<int>(core.vertices.size()); ++v) vertex_wedge(core, v, hull.radius);
  }

 private:
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
    if (bounded(other_.shape)) {
      if (dot(n, other_.support(n)) < here - margin_) return;
      if (dot(n, other_.support(-n)) > here + margin_) {
        empty_ = true;
        return;
      }
    }
    result_.walls.push_back({normal, slack, owner});
  }

  /// Of a facet from three corners, exactly; further corners may be off its plane by the flatness.
  WideVector facet_normal(const HullData& hull, int f) const {
    const auto [a, b, c] = hull.facet_corners[f];
    if (a < 0) return unit(wide(hull.planes[f].normal));
    return unit(wide_normal(hull.corners[a], hull.corners[b], hull.corners[c]));
  }
  DoubleDouble facet_offset(const HullData& hull, int f, const WideVector& normal) const {
    const auto [a, b, c] = hull.facet_corners[f];
    return a < 0 ? DoubleDouble{hull.planes[f].offset} : dot(normal, wide(hull.corners[a]));
  }
  void facet_wall(const HullData& hull, int f, double radius, int owner) {
    if (empty_) return;
    const Plane& plane = hull.planes[f];
    // A look in doubles first.
    const Vec3 n = rounded(rotation_) * plane.normal;
    const double here = plane.offset + radius + dot(n, inside_ + rounded(origin_)) + margin_;
    if (bounded(other_.shape) && dot(n, other_.support(n)) < here - 4 * margin_) return;
    const WideVector normal = facet_normal(hull, f);
    wall(normal, facet_offset(hull, f, normal) + DoubleDouble{radius}, owner);
  }
  static Mat3 rounded(const WideMatrix& m) {
    return {overlapper::rounded(m.row0), overlapper::rounded(m.row1), overlapper::rounded(m.row2)};
  }
  static Vec3 rounded(const WideVector& v) { return overlapper::rounded(v); }

  void wall_through(const WideVector& normal, Vec3 point) { wall(normal, dot(normal, wide(point)), kCut); }

  void prism(const HullData& hull, int f, double radius) {
    begin();
    const WideVector normal = facet_normal(hull, f);
    const DoubleDouble offset = facet_offset(hull, f, normal);
    wall(-normal, -offset, kCut);
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
    const WideVector between = wide_difference(b, a), along = unit(between);
    begin();
    cylinder(DoubleDouble{0.5} * (wide(a) + wide(b)), along, radius, overlapper::rounded(norm(between)) / 2);
    wall_through(-along, a);
    wall_through(along, b);
    // The left facet lies to the left of the edge seen from outside: beyond it, the other way.
    if (!empty_) wall_through(unit(cross(facet_normal(hull, edge.left), along)), a);
    if (!empty_) wall_through(unit(cross(along, facet_normal(hull, edge.right))), a);
    end();
  }

  void vertex_wedge(const HullData& hull, int v, double radius) {
    begin();
    ball(wide(hull.vertices[v]), radius);
    for (const Edge& edge : hull.edges) {
      if (edge.from != v && edge.to != v) continue;
      const int beside = edge.from == v ? edge.to : edge.from;
      wall_through(unit(wide_difference(hull.vertices[beside], hull.vertices[v])), hull.vertices[v]);
    }
    end();
  }

  const Placed& other_;
  int owner_;
  Vec3 inside_;
  WideMatrix rotation_;
  WideVector origin_;
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

void cut(const Placed& body, const Placed& other, int owner, Vec3 reference, const WideVector& inside, Pieces& result) {
  Cutter cutter(body, other, owner, reference, inside, result);
  std::visit([&](const auto& shape) { cutter(shape); }, body.shape);
}

}  // namespace overlapper::slicing
