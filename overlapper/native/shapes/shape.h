#pragma once

#include <span>
#include <type_traits>
#include <variant>
#include <vector>

#include "shapes/box.h"
#include "shapes/capsule.h"
#include "shapes/convex_shape.h"
#include "shapes/cylinder.h"
#include "shapes/ellipsoid.h"
#include "shapes/half_space.h"
#include "shapes/hull.h"
#include "shapes/rounded_hull.h"
#include "shapes/sphere.h"
#ifdef OVERLAPPER_MORE_SHAPES
#include OVERLAPPER_MORE_SHAPES  // defines OVERLAPPER_MORE_KINDS, a comma and the kinds
#else
#define OVERLAPPER_MORE_KINDS
#endif

namespace overlapper {

template <ConvexShape... Kinds>
using OneOf = std::variant<Kinds...>;

/// All kinds of shapes, in canonical order.
using Shape = OneOf<Sphere, Box, Capsule, Cylinder, Hull, HalfSpace, RoundedHull, Ellipsoid OVERLAPPER_MORE_KINDS>;

/// The answer to a question about the shape, whatever its kind.
template <class Question>
decltype(auto) ask(const Shape& shape, Question question) {
  return std::visit(question, shape);
}

/// The answer to a question about a shape that is not smooth; a default value for a smooth shape.
template <class Question>
auto ask_flat(const Shape& shape, Question question) {
  using Answer = decltype(question(std::declval<const Box&>()));
  return ask(shape, [&](const auto& s) -> Answer {
    if constexpr (!std::decay_t<decltype(s)>::kSmooth) return question(s);
    else return Answer();
  });
}

/// m³; infinite for a half-space.
inline double volume(const Shape& shape) {
  return ask(shape, [](const auto& s) { return s.volume(); });
}
inline Vec3 centroid(const Shape& shape) {
  return ask(shape, [](const auto& s) { return s.centroid(); });
}
inline bool bounded(const Shape& shape) {
  return ask(shape, [](const auto& s) { return s.kBounded; });
}

/// True for shapes with infinitely many supporting planes along their boundary: sphere, capsule, cylinder,
/// rounded hull, ellipsoid.
inline bool smooth(const Shape& shape) {
  return ask(shape, [](const auto& s) { return s.kSmooth; });
}

/// The plane of a half-space; null for a bounded shape.
inline const Plane* only_plane(const Shape& shape) {
  return ask(shape, [](const auto& s) -> const Plane* {
    if constexpr (std::decay_t<decltype(s)>::kBounded) return nullptr;
    else return &s.plane;
  });
}

inline CoreKind core_kind(const Shape& shape) {
  return ask(shape, [](const auto& s) { return s.core_kind(); });
}
/// True for a cylinder, whose caps have round borders.
inline bool has_rims(const Shape& shape) { return core_kind(shape) == CoreKind::kRims; }
/// True for cylinders and stretched ellipsoids. GJK and EPA only approach a curved core, and find the direction there
/// to half of the digits.
inline bool has_curved_core(const Shape& shape) { return core_kind(shape) != CoreKind::kPolytope; }
/// A smooth shape is its core (a point, a segment, a polytope) grown by a radius. Every other shape is its own core,
/// with radius 0.
inline double core_radius(const Shape& shape) {
  return ask(shape, [](const auto& s) { return s.core_radius(); });
}
inline Mat3 core_slope(const Shape& shape, Vec3 direction) {
  return ask(shape, [&](const auto& s) { return s.core_slope(direction); });
}

/// No value unless the shape is a ball, a capsule or a cylinder.
inline std::optional<Revolution> revolution(const Shape& shape) {
  return ask(shape, [](const auto& s) { return s.revolution(); });
}
/// The shape, if it is an ellipsoid and not a ball.
inline const Ellipsoid* stretched(const Shape& shape) {
  return ask(shape, [](const auto& s) -> const Ellipsoid* { return s.stretched(); });
}
/// The polytope of a hull, or the core of a rounded hull; null for other shapes.
inline const HullData* polytope_of(const Shape& shape) {
  return ask(shape, [](const auto& s) -> const HullData* { return s.polytope(); });
}

/// All facet planes of a polytope. For a smooth shape, a few tangent planes that already bound it. About the shape's
/// origin.
inline void append_planes(const Shape& shape, std::vector<Plane>& planes) {
  ask(shape, [&](const auto& s) { s.append_planes(planes); });
}

/// Distance of the farthest point of a shape from its own origin; for a half-space, the distance of its plane. For
/// balls, capsules, cylinders, rounded hulls and ellipsoids, the distance of the corner of the box around them.
inline double radius(const Shape& shape) {
  return ask(shape, [](const auto& s) { return s.bounding_radius(); });
}

/// True for a rounded hull: smooth, with a polytope as its core.
inline bool rounded_hull(const Shape& shape) { return smooth(shape) && polytope_of(shape); }

/// Facets of a box or a hull; 1 for a half-space, 0 for a smooth shape.
inline int facets(const Shape& shape) {
  return ask_flat(shape, [](const auto& s) { return s.facet_count(); });
}
/// The ridges of a box or a hull; empty for other shapes.
inline std::span<const Edge> edges(const Shape& shape) {
  return ask_flat(shape, [](const auto& s) { return s.edges(); });
}
inline Plane facet(const Shape& shape, int number) {
  return ask_flat(shape, [&](const auto& s) { return s.facet(number); });
}
inline Vec3 vertex(const Shape& shape, int number) {
  return ask_flat(shape, [&](const auto& s) { return s.vertex(number); });
}
/// A facet from exact numbers, with its normal of any length and of length 1. No value if rounding has merged several
/// facets.
inline std::optional<WidePlane> wide_facet(const Shape& shape, int number) {
  return ask_flat(shape, [&](const auto& s) { return s.wide_facet(number); });
}
inline std::optional<WidePlane> unit_facet(const Shape& shape, int number) {
  return ask_flat(shape, [&](const auto& s) { return s.unit_facet(number); });
}
/// True if the shape has a Mesh: a box, or a hull with a graph.
inline bool has_graph(const Shape& shape) {
  return ask_flat(shape, [](const auto& s) { return s.has_graph(); });
}

/// A hull of points of a bounded shape. The hull lacks at most the fraction `tolerance` of the volume. It has no data
/// if the shape is thinner than the rounding of the points. Throws std::invalid_argument for shapes that method "paper"
/// does not take.
Hull inscribed(const Shape& shape, double tolerance);

/// Upper bound of the distance of a shape's points from its own origin; for a half-space, of the distance of its plane.
inline double reach(const Shape& shape) {
  return ask(shape, [](const auto& s) { return s.reach(); });
}

/// m: largest distance of a corner from the plane of its facet, for facets that are not quite flat.
double flatness(const Shape& shape);

/// The origin of the coordinates of a hull's or a rounded hull's data.
inline Vec3 data_origin(const Shape& shape) {
  const HullData* hull = polytope_of(shape);
  return hull ? hull->origin : Vec3{};
}

/// A shape and its pose. `pose` maps the shape's own coordinates (for a hull, about HullData::origin) to the world.
struct Placed {
  Shape shape;
  Vec3 position;
  Quaternion orientation;  ///< as given, of any length, for wider arithmetic: normalizing rounds
  Pose pose;

  Vec3 support(Vec3 direction) const;
  Vec3 core_support(Vec3 direction) const;
  Plane ray_exit(Vec3 origin, Vec3 direction) const;
  Plane tightest(Vec3 point) const;

  /// Throws std::invalid_argument and keeps the old pose unless the numbers are finite and the quaternion is not zero.
  void move_to(Vec3 new_position, Quaternion new_orientation);

  /// The same body in coordinates about `reference`: relative poses keep digits that world poses lose.
  Placed seen_from(Vec3 reference) const;
};
static_assert(ConvexOracle<Placed>);

Placed make_placed(Shape shape, Vec3 position, Quaternion orientation);

/// Size of the numbers behind a body's points, if no point is farther than `extent` from the origin of coordinates. It
/// is `extent`, or larger for a hull far from its own origin: rotating and adding that origin rounds, too.
double reach(const Placed& body, double extent);

/// The box around a placed shape; infinite for a half-space.
Bounds bounds(const Placed& placed);

/// True if none of the bodies is smooth.
bool polyhedral(std::span<const Placed> bodies);

}  // namespace overlapper
