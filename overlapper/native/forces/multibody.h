#pragma once

#include <array>
#include <span>
#include <vector>

#include "geometry/vec.h"

namespace overlapper {

enum class Joint { kHeld, kRevolute, kPrismatic, kSpherical };

/// A link and the joint that moves it in its parent. Frames are inertial frames: at the centre of mass, along the
/// principal axes.
struct TreeLink {
  int parent = -1;  ///< number of its parent, less than its own; -1 for a base, with which a body begins
  Joint joint = Joint::kHeld;
  Vec3 axis;   ///< unit, in the frame of the parent; a spherical joint turns about the axes of the link's own frame
  Vec3 pivot;  ///< m, in the frame of the parent: a point that the joint does not move
  double mass = 0;  ///< kg; 0 for a base that nothing moves
  Vec3 inertia;     ///< kg m², principal
};

/// Bodies of links, and their velocity coordinates. A body has six coordinates of its base, in the world: linear at the
/// centre of mass, and angular. The coordinates of its joints follow, in the order of their links. A fixed base also
/// has six coordinates, because it may be moved by hand.
class Multibodies {
 public:
  struct Body {
    int first_link, links, first_coordinate, coordinates;
    bool movable;  ///< by forces
  };

  /// Throws std::invalid_argument unless parents come before their children.
  explicit Multibodies(std::vector<TreeLink> links);

  std::span<const TreeLink> links() const { return links_; }
  std::span<const Body> bodies() const { return bodies_; }
  int body_of(int link) const { return body_[link]; }
  int coordinates() const { return coordinates_; }

  /// Takes the poses of the links, and finds the inverse mass matrices there.
  void place(std::span<const Pose> frames);

  Vec3 centre(int link) const { return frames_[link].translation; }

  /// Writes 6 rows: the linear velocity of a link's point, then its angular velocity, per coordinate of its body.
  void jacobian(int link, Vec3 point, std::span<double> rows) const;

  /// The linear velocity of a link's centre of mass, and its angular velocity, from the velocities of all coordinates.
  std::array<Vec3, 2> twist(int link, std::span<const double> velocity) const;

  /// The inverse mass matrix by rows; zeros for coordinates that forces do not move.
  std::span<const double> inverse_mass(int body) const { return inverse_mass_[body]; }

 private:
  /// A joint coordinate, in the world.
  struct Moving {
    bool turns;
    Vec3 axis, pivot;
  };

  void find_inverse_mass(int body);

  std::vector<TreeLink> links_;
  std::vector<Body> bodies_;
  std::vector<int> body_;                ///< per link
  std::vector<std::vector<int>> moved_;  ///< per link: the coordinates of the joints between it and its base
  int coordinates_ = 0;
  std::vector<Pose> frames_;
  std::vector<Moving> moving_;  ///< per coordinate of all bodies; not used for bases
  std::vector<std::vector<double>> inverse_mass_;
};

}  // namespace overlapper
