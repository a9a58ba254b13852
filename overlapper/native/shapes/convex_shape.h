#pragma once

#include <concepts>

#include "shapes/choices.h"
#include "shapes/cutter.h"
#include "shapes/wide_triangles.h"

namespace overlapper {

class Mesh;
struct Hull;
struct Solid;

/// A closed convex solid, known only by its answers. Directions need not be unit length.
template <class T>
concept ConvexOracle = requires(const T& shape, Vec3 point, Vec3 direction) {
  { shape.support(direction) } -> std::same_as<Vec3>;  // any farthest point
  {
    shape.ray_exit(point, direction)
  } -> std::same_as<Plane>;  // supporting plane through which the ray leaves; point strictly inside
  {
    shape.tightest(point)
  } -> std::same_as<Plane>;  // supporting plane with the least slack at the point, inside or out
};

/// The shape's name, and the order of two shapes of a kind.
template <class S>
concept Named = requires(const S& s) {
  { S::kName } -> std::convertible_to<const char*>;
  { S::kAbout } -> std::convertible_to<const char*>;  // the docstring of its class in Python
  { s.order(s) } -> std::same_as<std::partial_ordering>;
};

/// Its size. Lengths in m, about its own origin.
template <class S>
concept Measurable = requires(const S& s, const Pose& pose, std::vector<Plane>& planes) {
  { s.volume() } -> std::same_as<double>;  // m³, infinite unless bounded
  { s.centroid() } -> std::same_as<Vec3>;  // if unbounded: the boundary point nearest to the origin
  // How far it reaches; if unbounded, the distance of its plane.
  { s.bounding_radius() } -> std::same_as<double>;
  { s.loose_radius() } -> std::same_as<double>;       // at least bounding_radius(), but faster
  { s.reach() } -> std::same_as<double>;              // upper bound of how far it reaches, a sum of its parameters
  { s.bounds(pose) } -> std::same_as<Bounds>;         // the box around it, infinite in unbounded directions
  { s.enclosing_box(pose) } -> std::same_as<Bounds>;  // like bounds() but for rounding, and faster
  // All facet planes of a polytope; for a smooth shape a few tangent planes that already bound it.
  { s.append_planes(planes) };
};

/// Questions for depths and distances: a shape is its core grown by a radius.
template <class S>
concept Cored =
    requires(const S& s, const Pose& pose, Vec3 direction, const std::vector<char>& kept, CoreSurface& surface) {
      { s.core_kind() } -> std::same_as<CoreKind>;
      { s.core_radius() } -> std::same_as<double>;
      { s.core_support(pose, direction) } -> std::same_as<Vec3>;  // in the world
      { s.core_slope(direction) } -> std::same_as<Mat3>;        // the derivative of the core's support by the direction
      { s.core_corners() } -> std::same_as<std::vector<Vec3>>;  // empty unless the core is a polytope
      { s.append_core_surface(kept, surface) };                 // the facets and ridges of the core with a kept corner
    };

/// The shape in double-double arithmetic, in its own coordinates. `triangles` are those of polytope(), prepared.
template <class S>
concept Widened = requires(const S& s, const WideVector& v, const WideTriangles& triangles, const WideBody& body,
                           std::vector<WidePlane>& planes) {
  { s.wide_core_support(v) } -> std::same_as<WideVector>;
  { s.wide_tightest(v, triangles) } -> std::same_as<WidePlane>;
  { s.append_wide_planes(body, planes) };  // as append_planes(), in the coordinates of the body
};

/// The properties that the choice of a way of measuring depends on.
template <class S>
concept Classified = requires(const S& s, Cutter& cutter) {
  { S::kBounded } -> std::convertible_to<bool>;
  { S::kSmooth } -> std::convertible_to<bool>;
  { s.revolution() } -> std::same_as<std::optional<Revolution>>;  // no value unless a ball, a capsule or a cylinder
  { s.stretched() } -> std::convertible_to<const Ellipsoid*>;     // the shape, if it is an ellipsoid and not a ball
  // The polytope of a hull, or the core of a rounded hull; null for other shapes.
  { s.polytope() } -> std::convertible_to<const HullData*>;
  // Parts of balls and cylinders within planes. A stretched ball gives the ball of radius 1.
  { s.give_pieces(cutter) };
  // The polytope within its facets, or within facets moved out by the margin. Then for each edge and each vertex, the
  // part of this polytope over it, and the cylinder or the ball that rounds it off. False for other shapes.
  { s.give_mitred(cutter) } -> std::same_as<bool>;
};

template <class S>
concept SmoothShape = S::kSmooth && requires(const S& s, const WideVector& v) {
  { s.wide_ray_exit(v, v) } -> std::same_as<WidePlane>;
};

/// A polytope or a half-space: vertices and facets by number.
template <class S>
concept FlatShape = !S::kSmooth && requires(const S& s, int number, Solid& solid, const Pose* pose, Mesh& mesh) {
  { s.vertex_count() } -> std::same_as<int>;
  { s.facet_count() } -> std::same_as<int>;
  { s.vertex(number) } -> std::same_as<Vec3>;
  { s.facet(number) } -> std::same_as<Plane>;
  { s.ring(number) } -> std::same_as<std::span<const int>>;  // the vertices around a facet, seen from outside
  { s.edges() } -> std::same_as<std::span<const Edge>>;
  { s.edges_known() } -> std::same_as<bool>;  // false if rounding has left a ridge with one side only
  // A facet from exact numbers, with its normal of any length and of length 1. No value if rounding has merged several
  // facets.
  { s.wide_facet(number) } -> std::same_as<std::optional<WidePlane>>;
  { s.unit_facet(number) } -> std::same_as<std::optional<WidePlane>>;
  { s.has_graph() } -> std::same_as<bool>;  // true if it has a Mesh
  { s.place(solid, pose, 0.0) };            // writes its columns, in the coordinates of the pose
  { s.give(mesh) };                         // only if it has a graph
};

/// All questions about a kind of shape. A kind that lacks an answer cannot be an alternative of Shape.
template <class S>
concept ConvexShape = ConvexOracle<S> && Named<S> && Measurable<S> && Cored<S> && Widened<S> && Classified<S> &&
                      (SmoothShape<S> || FlatShape<S>) && (!S::kBounded || requires(const S& s) {
                        // The hull of points of the shape that lacks at most that fraction of its volume, for method
                        // "paper". It has no data if the shape is thinner than the rounding of its points. Throws
                        // std::invalid_argument if that method does not take the shape.
                        { s.inscribed(1e-3) } -> std::same_as<Hull>;
                      }) && (S::kBounded || requires(const S& s) {
                        { s.plane } -> std::convertible_to<Plane>;  // the plane that defines an unbounded shape
                      });

}  // namespace overlapper
