#include "methods/round/pieces/pieces.h"

#include <algorithm>
#include <limits>

#include "geometry/cancellation.h"
#include "geometry/rounding.h"
#include "methods/round/slicing/slice.h"

namespace overlapper::pieces {
namespace {

/// The number of planes, including those of the box, that cut the polytope around the common set. This polytope need
/// not be tight, and each piece of a body is cut from it.
constexpr size_t kMostFaces = 64;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

Mat3 rounded(const WideMatrix& m) { return {rounded(m.row0), rounded(m.row1), rounded(m.row2)}; }

/// Places the pieces of a body in the world, in double-double. Leaves out parts far from the polytope around the common
/// set. If that polytope is not known, leaves out parts far from the other body.
class PlacingCutter final : public Cutter {
 public:
  PlacingCutter(const Placed& body, const Placed& other, const EnclosingPolytope* common, int owner, Vec3 reference,
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
    const double size = overlapper::reach(body, norm(plain_origin_) + norm(inside_) + reach(body.shape));
    result_.rounding = std::max(result_.rounding, wide_placing(size, !unturned(body.orientation)));
    margin_ = 1e-12 * (norm(body.pose.translation) + norm(other.pose.translation) + reach(body.shape));
  }

  void begin() override {
    piece_ = {-1, walls(), 0};
    empty_ = false;
  }
  void begin_again() override { result_.walls.resize(piece_.first_wall); }
  void end() override {
    piece_.walls = walls() - piece_.first_wall;
    if (!empty_) {
      result_.pieces.push_back(piece_);
      return;
    }
    result_.walls.resize(piece_.first_wall);
    if (piece_.round >= 0) result_.rounds.pop_back();
  }

  void ball(const WideVector& centre, double radius) override {
    round({true, in_world(centre), {}, radius, 0, owner_});
  }
  void cylinder(const WideVector& centre, const WideVector& axis, double radius, double half_length) override {
    round({false, in_world(centre), rotation_ * axis, radius, half_length, owner_});
  }
  void face(const WidePlane& plane) override { wall(plane, owner_); }
  void cut(const WidePlane& plane) override { wall(plane, slicing::kCut); }
  void off(double flatness) override { result_.flatness = std::max(result_.flatness, flatness); }
  void gap(double volume, double area) override { result_.gaps += volume, result_.gap_area += area; }

  bool empty() const override { return empty_; }
  bool few() const override { return walls() - piece_.first_wall <= slicing::kMostLines / 2; }
  bool beyond(const Plane& plane) const override { return common_ && side_of(plane) == Side::kBeyond; }
  bool within(const Plane& plane) const override { return side_of(plane) == Side::kInside; }

  Bounds region(double wider_by) const override {
    if (!common_) return {{-kInfinity, -kInfinity, -kInfinity}, {kInfinity, kInfinity, kInfinity}};
    Bounds box{{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}};
    const Vec3 wider = (wider_by + margin_) * Vec3{1, 1, 1};
    for (const EnclosingPolytope::Corner& corner : common_->corners) {
      const Vec3 at = apply_transposed(plain_rotation_, corner.at - plain_origin_);
      box = {min(box.lower, at), max(box.upper, at)};
    }
    return {box.lower - wider, box.upper + wider};
  }

 private:
  int walls() const { return static_cast<int>(result_.walls.size()); }
  WideVector in_world(const WideVector& local) const { return origin_ + rotation_ * local; }

  void round(const Round& r) {
    piece_.round = static_cast<int>(result_.rounds.size());
    result_.rounds.push_back(r);
  }

  void wall(const WidePlane& local, int owner) {
    if (empty_) return;
    const WideVector normal = rotation_ * local.normal;
    const DoubleDouble slack = local.offset + dot(normal, origin_);
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

  /// The certain position of the region, by doubles.
  enum class Side { kBeyond, kInside, kBoth };
  Side side_of(const Plane& local) const {
    const Vec3 n = plain_rotation_ * local.normal;
    const double slack = local.offset + dot(n, plain_origin_), margin = 4 * margin_;
    if (common_) {
      cancellation_point(common_->corners.size());
      const auto [least, most] = common_->range(n);
      return least > slack + margin ? Side::kBeyond : most < slack - margin ? Side::kInside : Side::kBoth;
    }
    const bool below = bounded(other_.shape) && dot(n, other_.support(n)) < slack + dot(n, inside_) - margin;
    return below ? Side::kInside : Side::kBoth;
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

/// Whether two unit normals are the same.
bool same(const WideVector& a, const WideVector& b) { return norm2(overlapper::rounded(a - b)) < 1e-30; }

/// Whether a piece is part of the prism on a facet. Such a piece lies beyond the facet of the core and below the face,
/// within some lateral cuts.
bool on_facet(std::span<const Wall> prism, const Wall& of_core, size_t sides) {
  return prism.size() == 2 + sides && prism[0].owner == slicing::kCut && same(prism[0].normal, -of_core.normal) &&
         prism[1].owner != slicing::kCut && same(prism[1].normal, of_core.normal);
}

/// Replaces all pieces by a flat one with the walls `first` and, if there are walls `second`, by one of the round. The
/// lists hold copies, so they may come from the pieces.
void become(Pieces& result, std::initializer_list<Wall> first, std::initializer_list<Wall> second) {
  result.walls.assign(first), result.walls.insert(result.walls.end(), second);
  result.pieces = {{-1, 0, static_cast<int>(first.size())}};
  if (second.size() > 0) result.pieces.push_back({0, static_cast<int>(first.size()), static_cast<int>(second.size())});
}

void join_facet(Pieces& pieces) {
  const std::span<const Wall> core = pieces.of(0), prism = pieces.of(1);
  if (!pieces.rounds.empty() || core.size() != 1 || core[0].owner != slicing::kCut || !on_facet(prism, core[0], 0))
    return;
  become(pieces, {prism[1]}, {});
}

void join_edge(Pieces& pieces) {
  constexpr double kLeastTurn = 1e-3, kMostTurn = 1.98;  // lengths of the difference of the two normals
  const std::span<const Wall> core = pieces.of(0), first = pieces.of(1), second = pieces.of(2), wedge = pieces.of(3);
  if (pieces.rounds.size() != 1 || pieces.rounds[0].ball || pieces.pieces[3].round != 0) return;
  if (core.size() != 2 || wedge.size() != 2 || !on_facet(first, core[0], 1) || !on_facet(second, core[1], 1)) return;
  const WideVector &of_first = first[2].normal, &of_second = second[2].normal;
  const bool in_order = same(wedge[0].normal, -of_first) && same(wedge[1].normal, -of_second);
  if (!in_order && !(same(wedge[1].normal, -of_first) && same(wedge[0].normal, -of_second))) return;
  const Wall &one = first[1], &other = second[1];
  const double turn = norm(overlapper::rounded(one.normal - other.normal));
  if (!(turn > kLeastTurn && turn < kMostTurn)) return;
  const Round& round = pieces.rounds[0];
  const WideVector normal = unit(one.normal + other.normal);
  const DoubleDouble slack = dot(normal, round.centre) + DoubleDouble{round.radius} * dot(normal, one.normal);
  become(pieces, {one, other, {normal, slack, slicing::kCut}}, {{-normal, -slack, slicing::kCut}});
}

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
  PlacingCutter cutter(body, other, common, owner, reference, inside, result);
  ask(body.shape, [&](const auto& shape) { shape.give_pieces(cutter); });
}

void join(Pieces& pieces) {
  if (pieces.pieces.size() == 2) join_facet(pieces);
  if (pieces.pieces.size() == 4) join_edge(pieces);
}

bool grow(Pieces& pieces, double outwards) {
  for (Wall& wall : pieces.walls)
    if (wall.owner != slicing::kCut) wall.slack = wall.slack + DoubleDouble{outwards};
  for (Round& r : pieces.rounds) r.radius += outwards;
  return std::ranges::all_of(pieces.rounds, [](const Round& r) { return r.radius > 0; });
}

}  // namespace overlapper::pieces
