#pragma once

#include <concepts>

#include "shapes/choices.h"
#include "shapes/wide_triangles.h"

namespace overlapper {

class Mesh;
struct Hull;
struct Solid;

/// A closed convex solid, known only by asking. Directions need not be unit length.
template <class T>
concept ConvexOracle = requires(const T& shape, Vec3 point, Vec3 direction) {
  { shape.support(direction) } -> std::same_as<Vec3>;  // a farthest point, any of them
  {
    shape.ray_exit(point, direction)
  } -> std::same_as<Plane>;  // supporting plane through which the ray leaves; point strictly inside
  {
    shape.tightest(point)
  } -> std::same_as<Plane>;  // supporting plane with the least slack at the point, inside or out
};

/// What a shape is called, in what order two of a kind come.
template <class S>
concept Named = requires(const S& s) {
  { S::kName } -> std::convertible_to<const char*>;
  { S::kAbout } -> std::convertible_to<const char*>;  // the docstring of its class in Python
  { s.order(s) } -> std::same_as<std::partial_ordering>;
};

/// How large it is. Lengths in m, about its own origin.
template <class S>
concept Measurable = requires(const S& s, const Pose& pose, std::vector<Plane>& planes) {
  { s.volume() } -> std::same_as<double>;  // m³, infinite unless bounded
  { s.centroid() } -> std::same_as<Vec3>;  // unless bounded, the point of its border that is nearest to the origin
  // How far it reaches; unless bounded, how far its plane is.
  { s.bounding_radius() } -> std::same_as<double>;
  { s.loose_radius() } -> std::same_as<double>;       // no less than bounding_radius(), sooner
  { s.reach() } -> std::same_as<double>;              // how far it reaches at most, as a sum of its numbers
  { s.bounds(pose) } -> std::same_as<Bounds>;         // the box around it; infinite where it is
  { s.enclosing_box(pose) } -> std::same_as<Bounds>;  // the same but for rounding, the sooner the better
  // All facet planes of a polytope; of a smooth shape a few of its tangent planes that already bound it.
  { s.append_planes(planes) };
};

/// What depths and distances ask: a shape is its core grown by a radius.
template <class S>
concept Cored =
    requires(const S& s, const Pose& pose, Vec3 direction, const std::vector<char>& kept, CoreSurface& surface) {
      { s.core_kind() } -> std::same_as<CoreKind>;
      { s.core_radius() } -> std::same_as<double>;
      { s.core_support(pose, direction) } -> std::same_as<Vec3>;  // in the world
      { s.core_slope(direction) } -> std::same_as<Mat3>;        // the derivative of the core's support by the direction
      { s.core_corners() } -> std::same_as<std::vector<Vec3>>;  // none unless the core is a polytope
      { s.append_core_surface(kept, surface) };  // the facets and ridges of it with a corner that is kept
    };

/// How double-double arithmetic sees it, in its own coordinates. `triangles` are those of polytope(), made ready.
template <class S>
concept Widened = requires(const S& s, const WideVector& v, const WideTriangles& triangles, const WideBody& body,
                           std::vector<WidePlane>& planes) {
  { s.wide_core_support(v) } -> std::same_as<WideVector>;
  { s.wide_tightest(v, triangles) } -> std::same_as<WidePlane>;
  { s.append_wide_planes(body, planes) };  // as append_planes(), in the coordinates of the body
};

/// What it is made from, which the ways of measuring choose by.
template <class S>
concept Classified = requires(const S& s) {
  { S::kBounded } -> std::convertible_to<bool>;
  { S::kSmooth } -> std::convertible_to<bool>;
  { s.revolution() } -> std::same_as<std::optional<Revolution>>;  // nothing unless a ball, a capsule or a cylinder
  { s.stretched() } -> std::convertible_to<const Ellipsoid*>;     // the shape, if it is an ellipsoid and no ball
  // The polytope that a hull is, or that a rounded hull is grown from; null for other shapes.
  { s.polytope() } -> std::convertible_to<const HullData*>;
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
  { s.edges_known() } -> std::same_as<bool>;  // false where rounding has left a ridge without its other side
  // A facet by exact numbers, its normal of any length, and of length 1; nothing where rounding has merged several.
  { s.wide_facet(number) } -> std::same_as<std::optional<WidePlane>>;
  { s.unit_facet(number) } -> std::same_as<std::optional<WidePlane>>;
  { s.has_graph() } -> std::same_as<bool>;  // true if it has a Mesh
  { s.place(solid, pose, 0.0) };            // writes its columns, in the coordinates of the pose
  { s.give(mesh) };                         // only if it has a graph
};

/// Everything that is asked of a kind of shape. One that lacks an answer cannot be an alternative of Shape.
template <class S>
concept ConvexShape = ConvexOracle<S> && Named<S> && Measurable<S> && Cored<S> && Widened<S> && Classified<S> &&
                      (SmoothShape<S> || FlatShape<S>) && (!S::kBounded || requires(const S& s) {
                        // The hull of points of it that lacks no more than that fraction of its volume, for method
                        // "paper". Throws std::invalid_argument for what that method does not take.
                        { s.inscribed(1e-3) } -> std::same_as<Hull>;
                      }) && (S::kBounded || requires(const S& s) {
                        { s.plane } -> std::convertible_to<Plane>;  // all there is of an unbounded shape
                      });

}  // namespace overlapper
