#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <utility>
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

/// The motion of links per unit of a coordinate, in the world: a velocity at a point, and an angular velocity.
struct Motion {
  Vec3 linear, angular, point;
};

/// A link after some time: its centre of mass, and its rotation since.
struct MovedOn {
  Vec3 centre;
  Mat3 turn;
};

/// A link whose motion a simulator knows: its tree, -1 for a link that stands still, and the coordinates that move it,
/// among those of the tree.
struct MovedLink {
  int tree = -1;
  std::vector<int> moved;
};

/// Inverts a symmetric mass matrix by rows in place by Cholesky's method. A coordinate without mass does not move.
void invert_mass(std::vector<double>& m, int n);

/// Bodies of links, and their velocity coordinates. A body has six coordinates of its base, in the world: linear at the
/// centre of mass, and angular. The coordinates of its joints follow, in the order of their links. A fixed base also
/// has six coordinates, because it may be moved by hand.
///
/// Bodies may also be trees of a simulator that knows masses and motions itself. They have the simulator's coordinates.
class Multibodies {
 public:
  struct Body {
    int first_link, links, first_coordinate, coordinates;  ///< a tree of a simulator has no `links`
    bool movable;                                          ///< by forces
  };

  /// Throws std::invalid_argument unless parents come before their children.
  explicit Multibodies(std::vector<TreeLink> links);

  /// Trees of a simulator, with their numbers of coordinates. The coordinates of a tree are successive. Throws
  /// std::invalid_argument if a link has a tree or a coordinate that does not exist.
  Multibodies(std::span<const std::int64_t> coordinates, std::vector<MovedLink> links);

  int links() const { return int(links_.size()); }
  bool has_links() const { return bodies_.empty() || bodies_[0].links > 0; }
  std::span<const Body> bodies() const { return bodies_; }
  int body_of(int link) const { return body_[link]; }
  int coordinates() const { return coordinates_; }
  int body_with(int coordinate) const;

  /// Takes the motions by all coordinates of trees, and the inverse mass matrices. These have a row of `width` numbers
  /// for each coordinate, which begins with the coordinates of its tree.
  void move(std::vector<Motion> motions, std::span<const double> inverse_mass, int width);

  /// Takes the poses of the links, and finds the inverse mass matrices there unless a simulator knows them.
  void place(std::span<const Pose> frames);

  const Pose& frame(int link) const { return frames_[link]; }
  Vec3 centre(int link) const { return frames_[link].translation; }

  /// Writes 6 rows: the linear velocity of a link's point, then its angular velocity, per coordinate of its body.
  void jacobian(int link, Vec3 point, std::span<double> rows) const;

  /// The linear velocity of a link's centre of mass, and its angular velocity, from the velocities of all coordinates.
  std::array<Vec3, 2> twist(int link, std::span<const double> velocity) const;

  /// The links after `duration` (s), if all coordinates keep their velocities. Only for bodies that have `links`.
  std::vector<MovedOn> ahead(double duration, std::span<const double> velocity) const;

  /// The inverse mass matrix by rows; zeros for coordinates that forces do not move.
  std::span<const double> inverse_mass(int body) const { return inverse_mass_[body]; }

  /// Replaces it until the next `place`, and returns the one before.
  std::vector<double> exchange_inverse_mass(int body, std::vector<double> other) {
    return std::exchange(inverse_mass_[body], std::move(other));
  }

  /// The mass matrix of a body with joints by rows, with zeros for a base that is held. It is empty for other bodies,
  /// and for trees of a simulator.
  std::span<const double> mass(int body) const { return mass_[body]; }

 private:
  void make_room();
  void find_inverse_mass(int body);

  std::vector<TreeLink> links_;
  std::vector<Body> bodies_;
  std::vector<int> body_;                ///< per link
  std::vector<std::vector<int>> moved_;  ///< per link: the coordinates of its body that move it, without the base
  int coordinates_ = 0;
  std::vector<Pose> frames_;
  std::vector<Motion> motions_;  ///< per coordinate of all bodies; not used for bases
  std::vector<std::vector<double>> inverse_mass_, mass_;
};

}  // namespace overlapper
