#pragma once

#include <array>
#include <optional>

#include "methods/round/quadric/ball.h"
#include "shapes/wide_body.h"

namespace overlapper::quadric {

/// Up to this depth, relative to the radius, a common set is shallow.
inline constexpr double kShallow = 0.4;

/// Sums over the common part of a ball and some planes, relative to an apex. The apex is the point of the common set
/// nearest to the ball's centre. z leads away from the ball's centre.
///
/// Chords and arcs of each plane go around the common face of the plane and the ball, counter-clockwise from outside.
class ShallowBall {
 public:
  /// `depth`: m, the depth of the apex in the ball.
  ShallowBall(double radius, double depth) : radius_(radius), depth_(depth) {}

  /// A plane at this height above the apex, and the radius of the disc that it cuts from the ball.
  void begin_face(Vec3 normal, double height, double disc_radius);
  /// Adds a border along a line.
  void add_chord(Vec3 from, Vec3 to);
  /// Adds a border along the sphere; `back` is the unit vector from its begin to its end.
  void add_arc(Vec3 from, Vec3 to, Vec3 back);
  Vec3 disc() const { return disc_; }  ///< the disc's middle
  /// The area of the face.
  double end_face();
  Vec3 face_first() const { return face_first_; }  ///< ∫ x dA over the face

  double volume() const;
  double error() const;  ///< error of the volume by rounding
  Vec3 first() const;    ///< ∫ x dV
  Moments moments() const;
  double curved_area() const { return radius_ * radius_ * lost_[0]; }

 private:
  void integrate(Vec3 middle, Vec3 along, Vec3 out, double quarter);

  double radius_, depth_;
  // Sums of the present face.
  Vec3 normal_, disc_;
  double height_ = 0, disc_radius_ = 0, twice_ = 0, twice_sizes_ = 0, segments_ = 0;
  Vec3 face_first_, face_squares_, face_products_;
  // Sums of all faces.
  double cones_ = 0, cone_sizes_ = 0;
  Vec3 cone_firsts_, cone_squares_, cone_products_;
  // Over the curved part of a ball of radius 1, with w the lost height: integrals of the powers of w; of these times x
  // and y; and border terms for products with x², y² and xy. Then the sizes of the terms.
  std::array<double, 4> lost_{};
  std::array<Vec3, 3> across_{};
  std::array<Vec3, 2> border_{};
  double area_sizes_ = 0, lost_sizes_ = 0;
};

struct ShallowPart : BallPart {
  Vec3 apex;           ///< the polyhedron's point nearest to the ball's centre, relative to the centre
  Moments about_apex;  ///< about the apex, where second moments keep their digits
};

/// A plane, as a ball sees it.
struct PlaneAbout {
  WideVector normal;    ///< unit
  DoubleDouble offset;  ///< from the ball's centre along the normal
};

/// Where the corners and planes of a polyhedron are in double-double, about the centre of a ball.
class WidePlaces {
 public:
  virtual ~WidePlaces() = default;
  virtual WideVector corner(int i) const = 0;
  virtual WideVector between(int from, int to) const = 0;  ///< from one corner to another
  /// No value if the corners of a face miss its plane.
  virtual std::optional<PlaneAbout> plane(int f) const = 0;
};

/// Like measure_ball(), for a shallow contact: the error is rounding relative to the common part, however small it is.
/// Takes `places` as exact; the polyhedron and the centre need only be near. Second moments and the sections are about
/// the apex. No value if the contact is not shallow, if no edge reaches the ball, or if doubles leave the direction of
/// an arc uncertain.
std::optional<ShallowPart> measure_shallow_ball(const Polyhedron& polyhedron, const WidePlaces& places, Vec3 centre,
                                                double radius);

}  // namespace overlapper::quadric
