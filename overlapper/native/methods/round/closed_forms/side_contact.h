#pragma once

namespace overlapper::closed_forms {

/// The depth, over the smaller radius, up to which a contact at sides is shallow.
inline constexpr double kShallowSides = 0.25;

/// What a cylinder shares with a ball or with another cylinder in a shallow contact far from all ends. Heights count
/// from the cylinder's axis towards the other's centre or axis.
struct SideContact {
  double volume = 0;
  double height = 0;  ///< m: of the centroid
  double area = 0;    ///< m²
  double force = 0;   ///< m²: what a body's volume grows by as it moves towards the other
};

/// A cylinder of radius r and a ball of radius s whose centre is `distance` from the axis: `depth` less than both radii
/// together, which is given for its digits.
SideContact ball_at_side(double r, double s, double distance, double depth);
/// How far that reaches along the axis, to either side.
double reach_of_ball(double s, double depth);

/// Two cylinders that are so deep in each other, the directions of their axes of that sine and cosine.
SideContact sides_crossing(double r, double s, double depth, double sine);
/// How far that reaches along the first axis, to either side.
double reach_of_crossing(double r, double s, double depth, double sine, double cosine);

}  // namespace overlapper::closed_forms
