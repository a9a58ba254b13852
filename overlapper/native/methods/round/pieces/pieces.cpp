#include "methods/round/pieces/pieces.h"

#include <algorithm>
#include <limits>

#include "geometry/cancellation.h"
#include "geometry/constants.h"
#include "geometry/rounding.h"
#include "geometry/scratch.h"
#include "methods/round/slicing/slice.h"

namespace overlapper::pieces {
namespace {

/// The number of planes, including those of the box, that cut the polytope around the common set. This polytope need
/// not be tight, and each piece of a body is cut from it.
constexpr size_t kMostRegionFaces = 64;

Mat3 rounded(const WideMatrix& m) { return {rounded(m.row0), rounded(m.row1), rounded(m.row2)}; }

/// A margin of 1e-12 times this covers the rounding of a place in the world, too. Pieces are placed exactly, and must
/// not be beyond planes that are.
double size_of_place(const Placed& body) {
  return norm(body.pose.translation) + 1e-3 * (norm(body.position) + reach(body.shape));
}

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
    planes_->clear();
    extent_ = common_ ? common_->extent() : kInfinity;
    margin_ = 1e-12 * (size_of_place(body) + size_of_place(other) + reach(body.shape));
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
  void face(const WidePlane& plane) override {
    if (!empty_) wall(placed(plane), owner_);
  }
  void cut(const WidePlane& plane) override {
    if (!empty_) wall(placed(plane), slicing::kCut);
  }
  int place(const WidePlane& plane) override {
    planes_->push_back(placed(plane));
    return static_cast<int>(planes_->size()) - 1;
  }
  void face_beyond(int plane, double distance) override {
    PlacedPlane moved = (*planes_)[plane];
    moved.slack = moved.slack + DoubleDouble{distance};
    wall(moved, owner_);
  }
  void cut_inside(int plane) override { wall((*planes_)[plane], slicing::kCut); }
  void cut_outside(int plane) override {
    const PlacedPlane& p = (*planes_)[plane];
    wall({-p.normal, -p.slack, -p.most, -p.least}, slicing::kCut);
  }
  void off(double flatness) override { result_.flatness = std::max(result_.flatness, flatness); }
  void gap(double volume, double area) override { result_.gaps += volume, result_.gap_area += area; }

  bool empty() const override { return empty_; }
  bool few() const override { return walls() - piece_.first_wall <= slicing::kMostLines / 2; }
  std::pair<double, double> heights(const Plane& local) const override {
    const Vec3 n = plain_rotation_ * local.normal;
    const double slack = local.offset + dot(n, plain_origin_), margin = 4 * margin_;
    if (!(std::abs(slack) <= extent_)) return {-extent_ - slack - margin, extent_ - slack + margin};
    const auto [least, most] = range(n);
    return {least - slack - margin, most - slack + margin};
  }

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

  /// A plane in the world, and the least and the largest dot(normal, X) over the region.
  struct PlacedPlane {
    WideVector normal;
    DoubleDouble slack;
    double least, most;
  };
  PlacedPlane placed(const WidePlane& local) const {
    const WideVector normal = rotation_ * local.normal;
    const auto [least, most] = range(rounded(normal));
    return {normal, local.offset + dot(normal, origin_), least, most};
  }

  void wall(const PlacedPlane& plane, int owner) {
    if (empty_ || plane.most < plane.slack.head - margin_) return;
    empty_ = plane.least > plane.slack.head + margin_;
    if (!empty_) result_.walls.push_back({plane.normal, plane.slack, owner});
  }

  /// The least and the largest dot(n, X) over the region.
  std::pair<double, double> range(Vec3 n) const {
    if (common_) {
      cancellation_point(common_->corners.size());
      return common_->range(n);
    }
    if (!bounded(other_.shape)) return {-kInfinity, kInfinity};
    const double here = dot(n, inside_);
    return {dot(n, other_.support(-n)) - here, dot(n, other_.support(n)) - here};
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
  Scratch<std::vector<PlacedPlane>> planes_;
  double margin_ = 0;
  double extent_;  ///< m: of the region from the inner point
  Piece piece_;
  bool empty_ = false;
};

}  // namespace

double extent(const Placed& body, Vec3 point) {
  if (!bounded(body.shape)) return std::numeric_limits<double>::infinity();
  return norm(body.pose.translation - point) + reach(body.shape);
}

namespace {

double with_places(double size, std::span<const Placed* const> bodies) {
  for (const Placed* body : bodies) size += size_of_place(*body);
  return size;
}

}  // namespace

void enclose(std::span<const Placed* const> bodies, Vec3 inside, EnclosingPolytope& result) {
  Bounds box = bounds(*bodies[0]);
  for (const Placed* body : bodies.subspan(1)) {
    const Bounds other = bounds(*body);
    box = {max(box.lower, other.lower), min(box.upper, other.upper)};
  }
  const Vec3 lower = box.lower - inside, upper = box.upper - inside;
  const Vec3 size = max(abs(lower), abs(upper));
  const double margin = 1e-12 * with_places(norm(size) + norm(inside), bodies);
  const Vec3 wider = margin * Vec3{1, 1, 1};
  result.become({lower - wider, upper + wider});
  const double farthest = result.extent();
  thread_local std::vector<EnclosingPolytope::Face> planes;
  planes.clear();
  for (const Placed* body : bodies) {
    const Vec3 origin = body->pose.translation - inside;
    const auto add = [&](const Plane& plane, double more) {
      cancellation_point();
      const Vec3 normal = body->pose.rotation * plane.normal;
      const double slack = plane.offset + dot(normal, origin) + more + margin;
      if (slack < farthest) planes.push_back({normal, slack, kNoWall});
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
    if (result.faces.size() >= kMostRegionFaces) break;
    cancellation_point(result.corners.size());
    result.cut(plane);
  }
  result.drop_faces();
}

void enclose_closely(std::span<const Placed* const> bodies, Vec3 inside, EnclosingPolytope& result) {
  enclose(bodies, inside, result);
  const double margin = 1e-12 * (with_places(norm(inside), bodies) + result.extent());
  for (const Placed* body : bodies) {
    if (!smooth(body->shape)) continue;
    const Plane plane = body->tightest(inside);
    result.cut({plane.normal, margin - signed_distance(plane, inside), kNoWall});
  }
}

void cut(const Placed& body, const Placed& other, const EnclosingPolytope* common, int owner, Vec3 reference,
         const WideVector& inside, Pieces& result) {
  PlacingCutter cutter(body, other, common, owner, reference, inside, result);
  ask(body.shape, [&](const auto& shape) { shape.give_pieces(cutter); });
}

bool cut_mitred(const Placed& body, const Placed& other, const EnclosingPolytope& common, int owner, Vec3 reference,
                const WideVector& inside, Pieces& result) {
  PlacingCutter cutter(body, other, &common, owner, reference, inside, result);
  return ask(body.shape, [&](const auto& shape) { return shape.give_mitred(cutter); });
}

bool grow(Pieces& pieces, double outwards) {
  for (Wall& wall : pieces.walls)
    if (wall.owner != slicing::kCut) wall.slack = wall.slack + DoubleDouble{outwards};
  for (Round& r : pieces.rounds) r.radius += outwards;
  return std::ranges::all_of(pieces.rounds, [](const Round& r) { return r.radius > 0; });
}

}  // namespace overlapper::pieces
