#pragma once

#include <utility>

#include "geometry/bounds.h"
#include "geometry/wide.h"

namespace overlapper {

/// Takes pieces of a shape with disjoint interiors. A piece is the part of at most one ball or cylinder inside planes.
/// All numbers are in the shape's own coordinates. A region around all measured parts may be known. Pieces and planes
/// that do not matter in this region are left out.
class Cutter {
 public:
  virtual void begin() = 0;        ///< a piece
  virtual void begin_again() = 0;  ///< without the planes that the piece has so far
  virtual void end() = 0;
  virtual void ball(const WideVector& centre, double radius) = 0;
  /// An infinite cylinder. The piece reaches at most `half_length` along the axis from the centre.
  virtual void cylinder(const WideVector& centre, const WideVector& axis, double radius, double half_length) = 0;
  virtual void face(const WidePlane& plane) = 0;  ///< a plane with part of the shape's surface
  virtual void cut(const WidePlane& plane) = 0;   ///< a plane between two pieces

  /// Several pieces share a plane. It is placed once, and the pieces name its number.
  virtual int place(const WidePlane& plane) = 0;
  virtual void face_beyond(int plane, double distance) = 0;  ///< a parallel plane outside of it
  virtual void cut_inside(int plane) = 0;
  virtual void cut_outside(int plane) = 0;
  virtual void off(double flatness) = 0;  ///< m: the surface may be that far from the faces
  /// m³ and m²: the pieces may miss, or share, that much volume and surface.
  virtual void gap(double volume, double area) = 0;

  virtual bool empty() const = 0;  ///< nothing of the piece is in the region
  virtual bool few() const = 0;    ///< slices have room for as many planes of another body
  /// m: bounds of the signed distances of the region's points from the plane.
  virtual std::pair<double, double> heights(const Plane& plane) const = 0;
  virtual Bounds region(double wider_by) const = 0;  ///< a box around it, infinite if the region is not known

  void whole_ball(double radius) { begin(), ball({}, radius), end(); }

 protected:
  ~Cutter() = default;
};

}  // namespace overlapper
