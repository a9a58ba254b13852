#include "batch/box_of_corners.h"

#include <algorithm>
#include <limits>

namespace overlapper {
namespace {

/// The rotation nearest to three unit directions that are nearly orthogonal: the polar factor, by Newton's method
/// (Higham 1986). Columns are the directions.
Mat3 nearest_rotation(std::array<Vec3, 3> columns) {
  constexpr int kMostSteps = 20;
  for (int step = 0; step < kMostSteps; ++step) {
    const auto& [x, y, z] = columns;
    const double determinant = dot(cross(x, y), z);
    if (!(determinant > 0)) break;
    const std::array<Vec3, 3> inverse{cross(y, z) / determinant, cross(z, x) / determinant, cross(x, y) / determinant};
    double moved = 0;
    std::array<Vec3, 3> next;
    for (int k = 0; k < 3; ++k) {
      next[k] = 0.5 * (columns[k] + inverse[k]);
      moved = std::max(moved, max_component(abs(next[k] - columns[k])));
    }
    columns = next;
    if (moved < 0x1p-50) break;
  }
  return transposed(Mat3{columns[0], columns[1], columns[2]});
}

FittedBox fitted(const BoxCorners& given, const std::array<int, 8>& order) {
  FittedBox box{{}, {}, {}, order, 0};
  // Differences to one corner lose no digits far from the origin.
  const Vec3 from = given[order[0]];
  BoxCorners corners;
  for (int i = 0; i < 8; ++i) corners[i] = given[order[i]] - from;
  Vec3 middle;
  std::array<Vec3, 3> edges{};
  for (int i = 0; i < 8; ++i) {
    middle += 0.125 * corners[i];
    for (int k = 0; k < 3; ++k) edges[k] += 0.5 * kUnitCorners[i][k] * corners[i];
  }
  box.centre = from + middle;
  if (dot(cross(edges[0], edges[1]), edges[2]) < 0) {
    // A mirror image: top and bottom change places.
    for (int i = 0; i < 4; ++i) std::swap(box.order[i], box.order[i + 4]), std::swap(corners[i], corners[i + 4]);
    edges[2] = -edges[2];
  }
  box.sizes = {norm(edges[0]), norm(edges[1]), norm(edges[2])};
  box.axes = nearest_rotation({unit(edges[0]), unit(edges[1]), unit(edges[2])});
  for (int i = 0; i < 8; ++i)
    box.off = std::max(box.off, norm(middle + box.axes * scaled(box.sizes, kUnitCorners[i]) - corners[i]));
  return box;
}

/// The order in which i, j and k are the neighbours of corner 0. Each other corner is the nearest one to the sum of its
/// edges.
std::array<int, 8> order_of_neighbours(const BoxCorners& given, int i, int j, int k) {
  const Vec3 from = given[0], x = given[i] - from, y = given[j] - from, z = given[k] - from;
  std::array<int, 8> order{0, i, -1, j, k, -1, -1, -1};
  std::array<bool, 8> used{};
  for (int own : {0, i, j, k}) used[own] = true;
  for (const auto& [place, at] : {std::pair{2, x + y}, {5, x + z}, {7, y + z}, {6, x + y + z}}) {
    double least = std::numeric_limits<double>::infinity();
    for (int c = 0; c < 8; ++c)
      if (const double distance = norm2(given[c] - from - at); !used[c] && distance < least)
        least = distance, order[place] = c;
    used[order[place]] = true;
  }
  return order;
}

}  // namespace

FittedBox box_of_corners(const BoxCorners& given, double within) {
  FittedBox best = fitted(given, {0, 1, 2, 3, 4, 5, 6, 7});
  if (best.off <= within) return best;
  for (int i = 1; i < 8; ++i)
    for (int j = i + 1; j < 8; ++j)
      for (int k = j + 1; k < 8; ++k)
        if (const FittedBox box = fitted(given, order_of_neighbours(given, i, j, k)); box.off < best.off) best = box;
  return best;
}

}  // namespace overlapper
