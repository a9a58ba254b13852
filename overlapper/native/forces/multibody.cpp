#include "forces/multibody.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <stdexcept>

namespace overlapper {
namespace {

constexpr int kOfBase = 6;

constexpr int kMostCoordinates = 1 << 20;

constexpr std::array<Vec3, 3> kAxes{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};

int coordinates_of(Joint joint) {
  switch (joint) {
    case Joint::kHeld: return 0;
    case Joint::kRevolute:
    case Joint::kPrismatic: return 1;
    case Joint::kSpherical: return 3;
  }
  return 0;
}

/// The rotation by a vector: about its direction, by its length in rad.
Mat3 rotation_by(Vec3 vector) {
  const double angle = norm(vector);
  if (!(angle > 0)) return {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const Vec3 a = vector / angle;
  const double half = std::sin(angle / 2), versine = 2 * half * half;
  const Vec3 s = std::sin(angle) * a, v = versine * a;
  return {{1 - v.y * a.y - v.z * a.z, v.x * a.y - s.z, v.x * a.z + s.y},
          {v.y * a.x + s.z, 1 - v.x * a.x - v.z * a.z, v.y * a.z - s.x},
          {v.z * a.x - s.y, v.z * a.y + s.x, 1 - v.x * a.x - v.y * a.y}};
}

}  // namespace

void invert_mass(std::vector<double>& m, int n) {
  const auto at = [&](int i, int j) -> double& { return m[size_t(i) * n + j]; };
  double largest = 0;
  for (int i = 0; i < n; ++i) largest = std::max(largest, at(i, i));
  std::vector<char> held(n);
  for (int j = 0; j < n; ++j) {
    double pivot = at(j, j);
    for (int k = 0; k < j; ++k) pivot -= at(j, k) * at(j, k);
    held[j] = !(pivot > 1e-14 * largest);
    at(j, j) = held[j] ? 1 : std::sqrt(pivot);
    for (int i = j + 1; i < n; ++i) {
      double sum = at(i, j);
      for (int k = 0; k < j; ++k) sum -= at(i, k) * at(j, k);
      at(i, j) = held[j] ? 0 : sum / at(j, j);
    }
  }
  std::vector<double> inverse(size_t(n) * n);
  std::vector<double> column(n);
  for (int c = 0; c < n; ++c) {
    if (held[c]) continue;
    std::fill(column.begin(), column.begin() + c, 0.0);
    for (int i = c; i < n; ++i) {
      double sum = i == c ? 1 : 0;
      for (int k = c; k < i; ++k) sum -= at(i, k) * column[k];
      column[i] = held[i] ? 0 : sum / at(i, i);
    }
    for (int i = n - 1; i >= 0; --i) {
      double sum = column[i];
      for (int k = i + 1; k < n; ++k) sum -= at(k, i) * column[k];
      column[i] = held[i] ? 0 : sum / at(i, i);
      inverse[size_t(i) * n + c] = column[i];
    }
  }
  m = std::move(inverse);
}

Multibodies::Multibodies(std::vector<TreeLink> links) : links_(std::move(links)) {
  for (int i = 0; i < int(links_.size()); ++i) {
    const TreeLink& link = links_[i];
    if (link.parent < 0) bodies_.push_back({i, 0, coordinates_, 0, link.mass > 0});
    if (bodies_.empty() || link.parent >= i || (link.parent >= 0 && link.parent < bodies_.back().first_link))
      throw std::invalid_argument("links must begin with a base, and come after their parents");
    Body& body = bodies_.back();
    body_.push_back(int(bodies_.size()) - 1);
    moved_.push_back(link.parent < 0 ? std::vector<int>{} : moved_[link.parent]);
    const int own = link.parent < 0 ? kOfBase : coordinates_of(link.joint);
    for (int k = 0; link.parent >= 0 && k < own; ++k) moved_.back().push_back(body.coordinates + k);
    body.movable = body.movable || (link.parent >= 0 && own > 0);
    ++body.links;
    body.coordinates += own;
    coordinates_ += own;
  }
  make_room();
}

Multibodies::Multibodies(std::span<const std::int64_t> coordinates, std::vector<MovedLink> links)
    : links_(links.size()) {
  for (const std::int64_t own : coordinates) {
    if (own < 0 || own > kMostCoordinates) throw std::invalid_argument("coordinates must be numbers from 0");
    bodies_.push_back({0, 0, coordinates_, int(own), own > 0});
    coordinates_ += int(own);
  }
  const int still = int(bodies_.size());
  bodies_.push_back({0, 0, coordinates_, 0, false});
  for (MovedLink& link : links) {
    if (link.tree < -1 || link.tree >= still) throw std::invalid_argument("trees must be numbers of trees, or -1");
    body_.push_back(link.tree < 0 ? still : link.tree);
    const int own = bodies_[body_.back()].coordinates;
    for (int each : link.moved)
      if (each < 0 || each >= own) throw std::invalid_argument("moved must be coordinates of the link's tree");
    moved_.push_back(std::move(link.moved));
  }
  make_room();
}

int Multibodies::body_with(int coordinate) const {
  return int(std::ranges::upper_bound(bodies_, coordinate, {}, &Body::first_coordinate) - bodies_.begin()) - 1;
}

void Multibodies::make_room() {
  frames_.resize(links_.size());
  motions_.resize(coordinates_);
  for (const Body& body : bodies_) inverse_mass_.emplace_back(size_t(body.coordinates) * body.coordinates);
  mass_.resize(bodies_.size());
}

void Multibodies::move(std::vector<Motion> motions, std::span<const double> inverse_mass, int width) {
  motions_ = std::move(motions);
  for (size_t i = 0; i < bodies_.size(); ++i) {
    const Body& body = bodies_[i];
    for (int row = 0; row < body.coordinates; ++row) {
      const double* from = &inverse_mass[size_t(body.first_coordinate + row) * width];
      std::copy_n(from, body.coordinates, &inverse_mass_[i][size_t(row) * body.coordinates]);
    }
  }
}

void Multibodies::place(std::span<const Pose> frames) {
  frames_.assign(frames.begin(), frames.end());
  for (int i = 0; i < int(links_.size()); ++i) {
    const TreeLink& link = links_[i];
    const int own = link.parent < 0 ? 0 : coordinates_of(link.joint);
    for (int k = 0; k < own; ++k) {
      const int coordinate = moved_[i][moved_[i].size() - own + k];
      const Pose& parent = frames_[link.parent];
      const bool spherical = link.joint == Joint::kSpherical, slides = link.joint == Joint::kPrismatic;
      const Vec3 axis = spherical ? frames_[i].rotation * kAxes[k] : parent.rotation * link.axis;
      motions_[bodies_[body_[i]].first_coordinate + coordinate] = {slides ? axis : Vec3{}, slides ? Vec3{} : axis,
                                                                   parent * link.pivot};
    }
  }
  for (int body = 0; body < int(bodies_.size()); ++body)
    if (bodies_[body].movable && bodies_[body].links > 0) find_inverse_mass(body);
}

void Multibodies::jacobian(int link, Vec3 point, std::span<double> rows) const {
  const Body& body = bodies_[body_[link]];
  const int n = body.coordinates;
  std::fill(rows.begin(), rows.end(), 0.0);
  const auto put = [&](int column, Vec3 linear, Vec3 angular) {
    for (int axis = 0; axis < 3; ++axis) {
      rows[size_t(axis) * n + column] = linear[axis];
      rows[size_t(axis + 3) * n + column] = angular[axis];
    }
  };
  for (int k = 0; body.links > 0 && k < 3; ++k) {
    put(k, kAxes[k], {});
    put(3 + k, cross(kAxes[k], point - frames_[body.first_link].translation), kAxes[k]);
  }
  for (int column : moved_[link]) {
    const Motion& by = motions_[body.first_coordinate + column];
    put(column, by.linear + cross(by.angular, point - by.point), by.angular);
  }
}

std::array<Vec3, 2> Multibodies::twist(int link, std::span<const double> velocity) const {
  const Body& body = bodies_[body_[link]];
  const double* v = velocity.data() + body.first_coordinate;
  const Vec3 centre = frames_[link].translation;
  Vec3 linear, angular;
  if (body.links > 0) {
    angular = {v[3], v[4], v[5]};
    linear = Vec3{v[0], v[1], v[2]} + cross(angular, centre - frames_[body.first_link].translation);
  }
  for (int column : moved_[link]) {
    const Motion& by = motions_[body.first_coordinate + column];
    linear += v[column] * (by.linear + cross(by.angular, centre - by.point));
    angular += v[column] * by.angular;
  }
  return {linear, angular};
}

std::vector<MovedOn> Multibodies::ahead(double duration, std::span<const double> velocity) const {
  std::vector<MovedOn> moved(links_.size());
  for (int i = 0; i < links(); ++i) {
    const TreeLink& link = links_[i];
    const Body& body = bodies_[body_[i]];
    const double* v = velocity.data() + body.first_coordinate;
    const Vec3 centre = frames_[i].translation;
    if (link.parent < 0) {
      moved[i] = {centre + duration * Vec3{v[0], v[1], v[2]}, rotation_by(duration * Vec3{v[3], v[4], v[5]})};
      continue;
    }
    const MovedOn& parent = moved[link.parent];
    const Vec3 from = frames_[link.parent].translation;
    const int own = coordinates_of(link.joint);
    Vec3 slide, turn, pivot = centre;
    for (size_t k = moved_[i].size() - own; k < moved_[i].size(); ++k) {
      const Motion& by = motions_[body.first_coordinate + moved_[i][k]];
      slide += duration * v[moved_[i][k]] * by.linear, turn += duration * v[moved_[i][k]] * by.angular;
      pivot = by.point;
    }
    const Mat3 joint = rotation_by(turn);
    moved[i] = {parent.centre + parent.turn * ((pivot - from) + joint * (centre - pivot) + slide), parent.turn * joint};
  }
  return moved;
}

void Multibodies::find_inverse_mass(int number) {
  const Body& body = bodies_[number];
  const int n = body.coordinates;
  std::vector<double>& m = inverse_mass_[number];
  std::fill(m.begin(), m.end(), 0.0);
  if (body.links == 1) {
    const TreeLink& link = links_[body.first_link];
    const Mat3& turn = frames_[body.first_link].rotation;
    const auto inverse = [](double x) { return x > 0 ? 1 / x : 0; };
    const Vec3 mobility{inverse(link.inertia.x), inverse(link.inertia.y), inverse(link.inertia.z)};
    for (int i = 0; i < 3; ++i) {
      const Vec3 column = turn * scaled(mobility, apply_transposed(turn, kAxes[i]));
      m[size_t(i) * n + i] = inverse(link.mass);
      for (int j = 0; j < 3; ++j) m[size_t(j + 3) * n + i + 3] = column[j];
    }
    return;
  }
  std::vector<double> rows(size_t(6) * n);
  std::vector<int> columns(kOfBase);  // that move a link
  std::iota(columns.begin(), columns.end(), 0);
  for (int i = body.first_link; i < body.first_link + body.links; ++i) {
    const TreeLink& link = links_[i];
    if (!(link.mass > 0)) continue;
    jacobian(i, frames_[i].translation, rows);
    columns.resize(kOfBase);
    columns.insert(columns.end(), moved_[i].begin(), moved_[i].end());
    const Mat3& turn = frames_[i].rotation;
    // Maps angular rows to components along the principal axes, times the roots of the moments.
    for (int c : columns) {
      const Vec3 spin{rows[size_t(3) * n + c], rows[size_t(4) * n + c], rows[size_t(5) * n + c]};
      const Vec3 own = apply_transposed(turn, spin);
      for (int axis = 0; axis < 3; ++axis) {
        rows[size_t(3 + axis) * n + c] = std::sqrt(std::max(link.inertia[axis], 0.0)) * own[axis];
        rows[size_t(axis) * n + c] *= std::sqrt(link.mass);
      }
    }
    for (int r = 0; r < 6; ++r)
      for (int a : columns) {
        const double left = rows[size_t(r) * n + a];
        if (left == 0) continue;
        for (int b : columns) m[size_t(a) * n + b] += left * rows[size_t(r) * n + b];
      }
  }
  if (!(links_[body.first_link].mass > 0))  // the base is held
    for (int i = 0; i < kOfBase; ++i)
      for (int j = 0; j < n; ++j) m[size_t(i) * n + j] = m[size_t(j) * n + i] = 0;
  mass_[number] = m;
  invert_mass(m, n);
}

}  // namespace overlapper
