#pragma once

#include <cmath>
#include <limits>

/// \file
/// Terms for errors, each with one meaning throughout the core.
///
/// - *rounding*: bound of the loss by operations on doubles (or on double-doubles, if stated), from their number and
///   the size of their operands.
/// - *doubt*: the interval about zero in which doubles cannot decide a sign. Outside it they are right. Inside it,
///   wider arithmetic or exact signs decide.
/// - *error*: the bound that is stated to the user, such as `volume_error`.
/// - *flatness*: m; the distance of a facet's plane from the corners it was made from. It is a property of the body,
///   not rounding, and more digits do not reduce it.
/// - *wide*: in double-doubles, if doubles are in doubt.
/// - *margin*: a required distance from zero beyond doubt, so that a second question gets the same answer.
/// - *certain*, *sure*: of a sign or a status, beyond doubt.
/// - *certified*, *lower*, *upper*: bounds that hold despite rounding.
namespace overlapper {

/// The least double that is certainly not smaller than a number rounded once, and the greatest that is not larger.
inline double up(double x) { return std::nextafter(x, std::numeric_limits<double>::infinity()); }
inline double down(double x) { return std::nextafter(x, -std::numeric_limits<double>::infinity()); }

/// Expected rounding in sums of coordinates of that size. A rotation, a translation and a dot product make about 16
/// roundings of at most half an ulp.
inline double rounding(double magnitude) { return 16 * 0x1p-53 * magnitude; }

/// Beyond this, a sum has the sign that doubles give. Two rotations, a translation and a dot product may lose half as
/// much, including the last bits of each quaternion's length. Below this, wider arithmetic decides.
inline double doubt(double magnitude) { return 4 * rounding(magnitude); }

/// m: error of a plane or a point of a placed body in double-doubles. `magnitude`, in m, is the sum of the sizes of all
/// numbers that are added. A body is `turned` if its rotation is not the identity.
///
/// With u = 2^-106, an addition loses 3 u of its result, a product 5 u, a quotient 10 u, the length of a vector 10 u
/// (Joldes, Muller and Popescu 2017). The distance of a point p from a plane therefore loses 35 u |p|. A rotation adds
/// 90 u |p|: its entries lose 28 u, and each coordinate needs three of them.
inline double wide_placing(double magnitude, bool turned) { return (turned ? 0x1p-98 : 0x1p-100) * magnitude; }

}  // namespace overlapper
