#pragma once

#include <array>
#include <functional>
#include <optional>

#include "methods/round/quadric/ball.h"
#include "shapes/wide_body.h"

namespace overlapper::quadric {

/// The depth, over the radius, up to which a common set is shallow.
inline constexpr double kShallow = 0.4;

/// Sums over what a ball and some planes share, seen from an apex: the point of the common set that is nearest to the
/// ball's centre. Coordinates count from the apex; z leads away from the ball's centre.
///
/// Chords and arcs of each plane go around the face that it shares with the ball, counter-clockwise from outside.
class ShallowBall {
 public:
  /// m; the apex is so deep in the ball.
  ShallowBall(double radius, double depth) : radius_(radius), depth_(depth) {}

  /// A plane so high over the apex, and the radius of the disc that it cuts from the ball.
  void begin_face(Vec3 normal, double height, double disc_radius);
  /// Along a line.
  void add_chord(Vec3 from, Vec3 to);
  /// Along the sphere; `back` is the unit vector from its begin to its end.
  void add_arc(Vec3 from, Vec3 to, Vec3 back);
  Vec3 disc() const { return disc_; }  ///< its middle
  /// The area of the face.
  double end_face();
  Vec3 face_first() const { return face_first_; }  ///< ∫ x dA over it

  double volume() const;
  double error() const;  ///< of the volume: what rounding may have done to it
  Vec3 first() const;    ///< ∫ x dV
  Moments moments() const;
  double curved_area() const { return radius_ * radius_ * lost_[0]; }

 private:
  void integrate(Vec3 middle, Vec3 along, Vec3 out, double quarter);

  double radius_, depth_;
  // The face under way.
  Vec3 normal_, disc_;
  double height_ = 0, disc_radius_ = 0, twice_ = 0, twice_sizes_ = 0, segments_ = 0;
  Vec3 face_first_, face_squares_, face_products_;
  // Over all faces.
  double cones_ = 0, cone_sizes_ = 0;
  Vec3 cone_firsts_, cone_squares_, cone_products_;
  // Over the curved part of a ball of radius 1, of the height w lost: of its powers; of them times x and y; and along
  // the border, what their products with x², y² and xy come of. And the sizes of terms.
  std::array<double, 4> lost_{};
  std::array<Vec3, 3> across_{};
  std::array<Vec3, 2> border_{};
  double area_sizes_ = 0, lost_sizes_ = 0;
};

struct ShallowPart : BallPart {
  Vec3 apex;           ///< the polyhedron's point that is nearest to the ball's centre, from there
  Moments about_apex;  ///< where second moments keep their digits
};

/// As measure_ball(), of a shallow contact: right to rounding relative to what is shared, however little that is. The
/// polyhedron's corners and what `plane` says of its planes are exact, and so is the centre. Second moments are about
/// the apex only. Nothing if the contact is not shallow, or no edge reaches the ball, or doubles leave open which way
/// round an arc goes.
std::optional<ShallowPart> measure_shallow_ball(const Polyhedron& polyhedron,
                                                const std::function<std::optional<WidePlane>(int)>& plane,
                                                const WideVector& centre, double radius);

}  // namespace overlapper::quadric
