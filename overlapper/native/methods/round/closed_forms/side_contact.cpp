#include "methods/round/closed_forms/side_contact.h"

#include <array>
#include <cmath>
#include <numbers>

#include "methods/round/quadric/segment.h"

namespace overlapper::closed_forms {
namespace {

constexpr double kPi = std::numbers::pi;

}  // namespace

double reach_of_ball(double s, double depth) { return std::sqrt(depth * (2 * s - depth)); }

// Slices across the cylinder's axis, z from the ball's centre, are lenses of two discs. Their depth is an analytic
// function of z times z0² − z², where z0 is how far they reach; and so, over half powers of that, are all measures of
// them. With z = z0 cos θ all that is integrated is an even function of θ with a period of half a turn. Of that, nodes
// in the middle of N equal parts are off by as little as a term of order 2 N. The nearest singularity is where slices
// of the ball shrink to a point: e^-0.97, for contacts as deep as are shallow.
SideContact ball_at_side(double r, double s, double distance, double depth) {
  constexpr int kNodes = 12;                     // of half of 24 parts
  const double d = distance, least = s - depth;  // the radius of the disc that is but touched
  const double reach = reach_of_ball(s, depth), reach2 = reach * reach;
  SideContact sum;
  double moment = 0;
  for (int k = 0; k < kNodes; ++k) {
    const double angle = (k + 0.5) * kPi / (2 * kNodes), sine = std::sin(angle);
    const double inside = reach2 * sine * sine, q = std::sqrt(least * least + inside), deep = inside / (q + least);
    const double half = std::sqrt(deep * (2 * d + deep) * (2 * r - deep) * (q + least)) / (2 * d);  // of the chord
    // From the cylinder's axis and from the ball's centre to the chord.
    const double from_axis = r - deep * (2 * q - deep) / (2 * d), from_ball = q - deep * (2 * r - deep) / (2 * d);
    const double of_axis = std::atan2(half, from_axis), of_ball = std::atan2(half, from_ball);
    const auto a = quadric::segment(of_axis, half / r, from_axis / r);
    const auto b = quadric::segment(of_ball, half / q, from_ball / q);
    const double area = r * r * a.area + q * q * b.area;
    sum.volume += sine * area;
    moment += sine * (from_axis * area + r * r * r * a.first_across - q * q * q * b.first_across);
    sum.area += sine * 2 * (r * of_axis + s * of_ball);
    sum.force += sine * 2 * half;
  }
  const double weight = reach * kPi / kNodes;
  return {weight * sum.volume, moment / sum.volume, weight * sum.area, weight * sum.force};
}

double reach_of_crossing(double r, double s, double depth, double sine, double cosine) {
  // The half-widths of each where the other but touches it.
  const double of_first = reach_of_ball(r, depth), of_second = reach_of_ball(s, depth);
  return (of_second + of_first * cosine) / sine;
}

// Slices along both axes are parallelograms as wide as the cylinders there. Heights are t = r − depth (1 + cos θ) / 2:
// widths are then half-angle sines and cosines times analytic functions, and what is integrated is as above. The
// nearest singularities are on the far sides of the cylinders: e^-3.4, for contacts as deep as are shallow.
SideContact sides_crossing(double r, double s, double depth, double sine) {
  constexpr int kNodes = 8;
  SideContact sum;
  double moment = 0;
  for (int k = 0; k < kNodes; ++k) {
    const double angle = (k + 0.5) * kPi / (2 * kNodes), half_sine = std::sin(angle), half_cosine = std::cos(angle);
    // Below the top of the first, and above the bottom of the second.
    const double below = depth * half_cosine * half_cosine, above = depth * half_sine * half_sine;
    const double t = r - below, u = s - above;
    const double first = std::sqrt(2 * r - below), second = std::sqrt(2 * s - above);
    // What is common to all is left out: 2 depth sin cos of dt, and of widths the root of depth and sin or cos.
    const double across = half_sine * half_cosine, area = across * across * first * second;
    sum.volume += area;
    moment += area * t;
    sum.area += r * half_sine * half_sine * second / first + s * half_cosine * half_cosine * first / second;
    sum.force += half_cosine * half_cosine * first / second * u;
  }
  const double weight = 4 * depth / sine * kPi / kNodes;
  return {weight * depth * sum.volume, moment / sum.volume, weight * sum.area, weight * sum.force};
}

}  // namespace overlapper::closed_forms
