#pragma once

#include <cmath>
#include <limits>

/// \file
/// Words of error, each with one meaning throughout the core.
///
/// - *rounding*: what operations on doubles (or on double-doubles, where that is said) may lose, bounded from their
///   number and the size of their operands.
/// - *doubt*: the band about zero in which doubles cannot tell a sign; beyond it they are right, within it wider
///   arithmetic or exact signs decide.
/// - *error*: the bound that is stated to the user, such as `volume_error`.
/// - *flatness*: m; by how much the plane of a facet misses the corners it was made from. It belongs to the body, is no
///   rounding, and no more digits lessen it.
/// - *wide*: in double-doubles, where doubles are in doubt.
/// - *margin*: a distance from zero that is asked for beyond doubt, so that whoever asks again gets the same answer.
/// - *certain*, *sure*: of a sign or a status, beyond doubt.
/// - *certified*, *lower*, *upper*: bounds that hold whatever rounding did.
namespace overlapper {

/// The least double that is surely no smaller than a number rounded once, and the greatest that is no larger.
inline double up(double x) { return std::nextafter(x, std::numeric_limits<double>::infinity()); }
inline double down(double x) { return std::nextafter(x, -std::numeric_limits<double>::infinity()); }

/// Rounding to be expected in sums of coordinates of that size: a rotation, a translation and a dot product make about
/// 16 roundings of at most half an ulp.
inline double rounding(double magnitude) { return 16 * 0x1p-53 * magnitude; }

/// A sum beyond this has the sign that doubles give it: two rotations, a translation and a dot product, each of the
/// last bits of a quaternion's length included, may lose half as much. Within, wider arithmetic decides.
inline double doubt(double magnitude) { return 4 * rounding(magnitude); }

/// m: how far double-doubles may misplace a plane or a point of a placed body, for numbers that add up to `magnitude`.
///
/// With u = 2^-106, an addition loses 3 u of its result, a product 5 u, a quotient 10 u, the length of a vector 10 u
/// (Joldes, Muller and Popescu 2017). So the distance of a point p from a plane loses 35 u |p|. A turn adds 90 u |p|:
/// entries of a rotation lose 28 u, and three of them make each coordinate.
inline double wide_placing(double magnitude, bool turned) { return (turned ? 0x1p-98 : 0x1p-100) * magnitude; }

}  // namespace overlapper
