#include "forces/three.h"

#include <algorithm>
#include <cmath>

namespace overlapper {
namespace {

Three cross(const Three& a, const Three& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

}  // namespace

ThreeByThree inverse(const ThreeByThree& m) {
  const ThreeByThree columns{cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])};
  const double determinant = dot(m[0], columns[0]);
  ThreeByThree rows;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) rows[i][j] = columns[j][i] / determinant;
  return rows;
}

double largest_eigenvalue(const ThreeByThree& a, const ThreeByThree& b) {
  ThreeByThree product = a * b;
  // The eigenvalues of such a product are real: roots of a cubic by Viète's formula.
  const double mean = (product[0][0] + product[1][1] + product[2][2]) / 3;
  if (!(mean > 0)) return 0;
  double square = 0;
  for (int i = 0; i < 3; ++i) product[i][i] -= mean;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) square += product[i][j] * product[j][i];
  const double spread = std::sqrt(std::max(square / 6, 0.0));
  if (!(spread > 1e-12 * mean)) return mean;
  const double determinant = dot(product[0], cross(product[1], product[2]));
  const double third = std::acos(std::clamp(determinant / (2 * spread * spread * spread), -1.0, 1.0)) / 3;
  return mean + 2 * spread * std::cos(third);
}

}  // namespace overlapper
