#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "overlap/overlap.h"
#include "overlap/revolved_surface.h"

namespace overlapper {

/// The borders of the parts of both bodies of a pair that overlaps.
struct Borders {
  std::array<std::vector<BorderNode>, 2> seam, rims;
};
/// Places are about the centroid. No value if the seam has none.
std::optional<Borders> borders_of(const Overlap& overlap);

/// The sums for a rounded hull of a pair that overlaps. NaN if merging facets has left its core without edges. `rims`
/// are the arcs in which its cylinders end, within the other body. Steps go around the cylinders' parts.
///
/// Faces have closed forms. The part of a cylinder has its border in the seam, in two arcs, and in two lines along the
/// axis. The integral along the axis, times the angle about it, is a form as in revolved_surface(). It is zero along
/// the axis. On the ball of a vertex, the form has arcs from a point among the border's normals.
SurfaceSums rounded_surface(const Overlap& overlap, int body, Vec3 inside, std::span<const BorderNode> border,
                            std::span<const BorderNode> rims);

}  // namespace overlapper
