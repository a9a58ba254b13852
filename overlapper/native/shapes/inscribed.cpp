#include "shapes/inscribed.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "shapes/hull_graph.h"
#include "shapes/limits.h"

namespace overlapper {

void append_circle(double radius, double z, int n, std::vector<Vec3>& points) {
  for (int i = 0; i < n; ++i) {
    const double angle = 2 * std::numbers::pi * i / n;
    points.push_back({radius * std::cos(angle), radius * std::sin(angle), z});
  }
}

int corners_of_circle(double tolerance, const char* shape) {
  // An inscribed n-gon lacks 2/3 (π/n)² of its disc.
  require(tolerance >= 1e-11,
          [&] { return std::string("tolerance must be 1e-11 or more where method 'paper' tessellates a ") + shape; });
  return std::max(8, static_cast<int>(std::ceil(std::numbers::pi * std::sqrt(2 / (3 * tolerance)))));
}

std::vector<Vec3> points_of_capsule(double radius, double half_length, double tolerance) {
  // A grid of latitudes and longitudes with the same step s lacks at most about s²/2 of the ball. Each band takes two
  // latitudes of points. A hull of more than about a million points is out of reach.
  require(tolerance >= 1e-5, "tolerance must be 1e-5 or more where method 'paper' tessellates a round shape");
  std::vector<Vec3> points;
  const int bands = std::max(4, static_cast<int>(std::ceil(std::numbers::pi / std::sqrt(2 * tolerance))));
  points.push_back({0, 0, radius + half_length});
  points.push_back({0, 0, -radius - half_length});
  for (int band = 1; band < bands; ++band) {
    const double latitude = std::numbers::pi * (static_cast<double>(band) / bands - 0.5);
    const double r = radius * std::cos(latitude), z = radius * std::sin(latitude);
    const int around = std::max(6, static_cast<int>(std::ceil(2 * bands * std::cos(latitude))));
    if (z <= 0) append_circle(r, z - half_length, around, points);
    if (z >= 0) append_circle(r, z + half_length, around, points);
  }
  return points;
}

Hull hull_within(std::span<const Vec3> points) {
  const std::shared_ptr<HullData> data = hull_of(points);
  if (data) data->graph = graph_of(*data);
  return Hull(data);
}

}  // namespace overlapper
