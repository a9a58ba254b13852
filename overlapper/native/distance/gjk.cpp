#include "distance/gjk.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include "geometry/rounding.h"

namespace overlapper {
namespace {

/// `b` is a half-space. If `a` is also a half-space, its plane is parallel, and all of its points are equally near.
Distance distance_to_half_space(const Placed& a, const Placed& b) {
  const Plane plane = b.pose * *only_plane(b.shape);
  const Plane* parallel = only_plane(a.shape);
  const Vec3 lowest = parallel ? a.pose * (parallel->offset * parallel->normal) : a.support(-plane.normal);
  const double height = signed_distance(plane, lowest);
  return {height, height, plane.normal, lowest, lowest - height * plane.normal};
}

Distance mirrored(const Distance& d) { return {d.distance, d.gap, -d.normal, d.witness_b, d.witness_a}; }

DifferencePoint core_support(const Placed& a, const Placed& b, Vec3 direction) {
  return {a.core_support(direction), b.core_support(-direction)};
}

/// The distance of the origin from the nearest facet of a tetrahedron around it.
double depth_in(const Simplex& simplex) {
  if (simplex.size < 4) return 0;
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 4; ++i) {
    const auto corner = [&](int k) { return simplex.corner[(i + k) % 4].difference(); };
    const Vec3 normal = cross(corner(1) - corner(0), corner(2) - corner(0));
    least = std::min(least, std::abs(dot(normal, corner(0))) / std::sqrt(norm2(normal)));
  }
  return least;
}

/// The sine of an angle between an axis and a direction. At a rim GJK finds the direction to half of the digits.
constexpr double kAboutUpright = 0x1p-20;

/// A body's part in the nearest points: a fixed point, or a point of a rim or of a curved core that depends on the
/// direction. Along flats the point is free.
struct Contactor {
  const Placed& body;
  CoreKind kind;
  Vec3 point;  ///< of the body; the centre of a rim
  std::vector<Vec3> flats;
  double rim_radius = 0;
  Vec3 axis;

  Contactor(const Placed& placed, const Simplex& simplex, Vec3 DifferencePoint::* on, Vec3 witness)
      : body(placed), kind(core_kind(placed.shape)), point(witness) {
    switch (kind) {
      case CoreKind::kCurved: return;
      case CoreKind::kPolytope:
        for (int i = 1; i < simplex.size; ++i) add_flat(simplex.corner[i].*on - simplex.corner[0].*on);
        return;
      case CoreKind::kRims: break;
    }
    rim_radius = revolution(body.shape)->radius;
    axis = body.pose.rotation * Vec3{0, 0, 1};
    const auto height = [&](Vec3 p) { return dot(axis, p - body.pose.translation); };
    point = body.pose.translation + height(witness) * axis;
    for (int i = 1; i < simplex.size; ++i)
      if (height(simplex.corner[i].*on) * height(simplex.corner[0].*on) < 0) flats = {axis};
  }

  void add_flat(Vec3 along) {
    const double length = norm(along);
    for (Vec3 flat : flats) along -= dot(flat, along) * flat;
    if (norm(along) > 0x1p-40 * length) flats.push_back(unit(along));
  }

  /// The farthest point along a direction, without the flats.
  Vec3 farthest(Vec3 direction) const {
    switch (kind) {
      case CoreKind::kCurved: return body.core_support(direction);
      case CoreKind::kRims: return point + rim_radius * unit(direction - dot(axis, direction) * axis);
      case CoreKind::kPolytope: break;
    }
    return point;
  }
};

/// Accepts the points as the nearest ones if they are no farther apart than the planes across `x`, but for rounding.
bool accept(Separation& cores, const Placed& a, const Placed& b, Vec3 witness_a, Vec3 witness_b, Vec3 x) {
  const double length = norm(x), gap = dot(x / length, core_support(a, b, -x).difference());
  const double lost = rounding(norm(witness_a) + norm(witness_b));
  if (!(gap >= cores.gap - lost && length - gap <= lost && norm(x - (witness_a - witness_b)) <= lost)) return false;
  cores.simplex.corner[0] = {witness_a, witness_b};
  cores.simplex.weight[0] = 1;
  cores.simplex.size = 1;
  cores.simplex.nearest = x;
  cores.distance = length, cores.gap = gap, cores.normal = x / length;
  return true;
}

/// Above a cap, the nearest points are a lowest point of the other body and its foot, if the foot is on the cap.
bool above_cap(const Placed& a, const Placed& b, Separation& cores) {
  for (const Placed* body : {&a, &b}) {
    if (!has_rims(body->shape)) continue;
    const Revolution cylinder = *revolution(body->shape);
    const Vec3 axis = body->pose.rotation * Vec3{0, 0, 1}, x = cores.simplex.nearest;
    if (norm(cross(axis, x)) > kAboutUpright * norm(x)) continue;
    const Placed& other = body == &a ? b : a;
    // From the cap to the other body.
    const Vec3 up = dot(axis, x) * (body == &a ? -1 : 1) > 0 ? axis : -axis;
    const Vec3 lowest = other.core_support(-up),
               found = body == &a ? cores.simplex.witness_b() : cores.simplex.witness_a();
    // A level edge or cap has several lowest points, and only one has been found.
    for (Vec3 point : {lowest, found - dot(up, found - lowest) * up}) {
      const Vec3 arm = point - body->pose.translation;
      const double height = dot(up, arm) - cylinder.half_length;
      if (norm(arm - dot(up, arm) * up) > cylinder.radius || !(height > 0)) continue;
      const Vec3 foot = point - height * up;
      if (body == &a ? accept(cores, a, b, foot, point, -height * up) : accept(cores, a, b, point, foot, height * up))
        return true;
    }
  }
  return false;
}

/// The nearest points of two cores if one core has a rim or is curved. GJK finds a point there, and the direction, to
/// half of the digits only. At the nearest points, x = a - b is across every flat, and the points of rims and curved
/// cores are the farthest along x. Newton's method solves these equations; its matrix is the identity plus the
/// curvature terms. False where the equations do not hold.
bool sharpen(const Placed& a, const Placed& b, Separation& cores) {
  const Contactor on_a(a, cores.simplex, &DifferencePoint::on_a, cores.simplex.witness_a()),
      on_b(b, cores.simplex, &DifferencePoint::on_b, cores.simplex.witness_b());
  Contactor all = on_a;
  for (Vec3 flat : on_b.flats) all.add_flat(flat);
  const auto across_flats = [&](Vec3 v) {
    for (Vec3 flat : all.flats) v -= dot(flat, v) * flat;
    return v;
  };
  Vec3 x = across_flats(cores.simplex.nearest);
  for (int round = 0; round < 20; ++round) {
    Mat3 slope;
    for (const Contactor* on : {&on_a, &on_b}) {
      if (on->kind == CoreKind::kCurved) {
        const Mat3& turn = on->body.pose.rotation;
        const Mat3 curved = turn * core_slope(on->body.shape, apply_transposed(turn, x)) * transposed(turn);
        const auto across = [&](Vec3 row) { return across_flats(curved * across_flats(row)); };
        slope = {slope.row0 + across({1, 0, 0}), slope.row1 + across({0, 1, 0}), slope.row2 + across({0, 0, 1})};
      }
      if (on->kind != CoreKind::kRims) continue;
      const Vec3 tangent = cross(on->axis, x);
      const double across = norm(tangent);
      if (!(across > kAboutUpright * norm(x))) return false;
      const Vec3 t = across_flats(tangent / across);
      const double curved = on->rim_radius / across;
      slope = {slope.row0 + curved * t.x * t, slope.row1 + curved * t.y * t, slope.row2 + curved * t.z * t};
    }
    const Vec3 rest = across_flats(on_a.farthest(-x) - on_b.farthest(x)) - x;
    const double determinant_of_slope = determinant(slope);
    const auto part = [&](Vec3 u, Vec3 v) { return dot(rest, cross(u, v)) / determinant_of_slope; };
    const Vec3 step{part(slope.row1, slope.row2), part(slope.row2, slope.row0), part(slope.row0, slope.row1)};
    x += step;
    if (norm(step) <= 0x1p-51 * norm(x)) break;
  }
  Vec3 witness_a = on_a.farthest(-x), witness_b = on_b.farthest(x);
  // The rest lies along the flats; the flats of two bodies may be nearly parallel.
  for (int round = 0; round < 30; ++round) {
    for (Vec3 flat : on_a.flats) witness_a += dot(flat, x - (witness_a - witness_b)) * flat;
    for (Vec3 flat : on_b.flats) witness_b -= dot(flat, x - (witness_a - witness_b)) * flat;
  }
  return accept(cores, a, b, witness_a, witness_b, x);
}

// The best gap of all rounds: on a rim, the gaps of single rounds scatter by more than this.
bool settled(double length, double, double best) { return length - best <= 4 * 0x1p-53 * length; }

/// Gives the nearest points of curved cores the digits that GJK does not find.
Separation sharpened(const Placed& a, const Placed& b, Separation cores) {
  const bool curved = has_curved_core(a.shape) || has_curved_core(b.shape);
  if (curved && !cores.origin_inside && cores.gap > 0 && !above_cap(a, b, cores)) sharpen(a, b, cores);
  return cores;
}

/// The farthest point of a core in the coordinates of its body, along a direction of the world.
Vec3 local_support(const Placed& body, Vec3 direction) {
  const Vec3 own = apply_transposed(body.pose.rotation, direction);
  return ask(body.shape, [&](const auto& s) { return s.core_support(Pose{}, own); });
}

/// GJK from the simplex of earlier poses.
class WarmSearch {
 public:
  WarmSearch(const Placed& a, const Placed& b) : a_(a), b_(b) {}

  Separation run(LastSimplex& last) {
    Simplex start;
    for (int i = 0; i < last.size; ++i) start.corner[start.size++] = place(last.corner[i]);
    if (start.size == 0) {
      const Vec3 towards = a_.pose.translation - b_.pose.translation;
      start.corner[start.size++] = support(norm2(towards) == 0 ? Vec3{-1, 0, 0} : -towards);
    }
    reduce(start);
    const Separation found = separate(start, [&](Vec3 direction) { return support(direction); }, settled);
    last.size = 0;
    for (int i = 0; i < found.simplex.size; ++i) {
      const DifferencePoint& corner = found.simplex.corner[i];
      const auto end = known_.begin() + static_cast<std::ptrdiff_t>(std::min(next_, known_.size()));
      const auto same = std::find_if(known_.begin(), end, [&](const Pair& pair) {
        return pair.placed.on_a == corner.on_a && pair.placed.on_b == corner.on_b;
      });
      if (same != end) last.corner[last.size++] = same->local;
    }
    return found;
  }

 private:
  struct Pair {
    DifferencePoint placed, local;
  };

  DifferencePoint place(const DifferencePoint& local) {
    const DifferencePoint placed{a_.pose * local.on_a, b_.pose * local.on_b};
    // A search among curved cores has many points, and only the last ones matter.
    known_[next_++ % known_.size()] = {placed, local};
    return placed;
  }
  DifferencePoint support(Vec3 direction) {
    return place({local_support(a_, direction), local_support(b_, -direction)});
  }

  const Placed &a_, &b_;
  std::array<Pair, 16> known_{};
  size_t next_ = 0;
};

Distance between_cores(const Placed& a, const Placed& b, const Separation& cores) {
  const double radius_a = core_radius(a.shape), radius_b = core_radius(b.shape);
  Distance result;
  result.distance = cores.distance - radius_a - radius_b;
  result.gap = cores.gap - radius_a - radius_b;
  // Along the line of the witness points, distance * normal is their difference. On a curved rim this direction is
  // known to half of the digits only. Where the gap is so small that this matters, the normal is the direction that
  // proves the gap.
  const Vec3 along = unit(cores.simplex.nearest);
  const double gap_along = dot(along, core_support(a, b, -along).difference());
  result.normal = cores.origin_inside || gap_along <= 0 ? cores.normal : along;
  if (cores.origin_inside) result.overlap = depth_in(cores.simplex);
  result.witness_a = cores.simplex.witness_a() - radius_a * result.normal;
  result.witness_b = cores.simplex.witness_b() + radius_b * result.normal;
  return result;
}

std::optional<Distance> distance_to_plane(const Placed& a, const Placed& b) {
  if (!bounded(b.shape)) return distance_to_half_space(a, b);
  if (!bounded(a.shape)) return mirrored(distance_to_half_space(b, a));
  return std::nullopt;
}

}  // namespace

Separation separate_cores(const Placed& a, const Placed& b) {
  Vec3 towards = a.pose.translation - b.pose.translation;
  if (norm2(towards) == 0) towards = {1, 0, 0};
  const auto support = [&](Vec3 direction) { return core_support(a, b, direction); };
  return sharpened(a, b, separate(support(-towards), support, settled));
}

Distance distance(const Placed& a, const Placed& b) {
  if (const auto to_plane = distance_to_plane(a, b)) return *to_plane;
  return between_cores(a, b, separate_cores(a, b));
}

Distance distance(const Placed& a, const Placed& b, LastSimplex& last) {
  if (const auto to_plane = distance_to_plane(a, b)) return *to_plane;
  return between_cores(a, b, sharpened(a, b, WarmSearch(a, b).run(last)));
}

}  // namespace overlapper
