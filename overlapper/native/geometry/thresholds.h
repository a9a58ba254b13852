#pragma once

#include <cstddef>

/// \file
/// Thresholds between two ways to the same answer, each with the measurement that set it. Numbers are medians of
/// processor time over random hulls of corners on the unit sphere. Both ways ran in turn in the same run, on one core
/// with AVX2 unless stated otherwise. The required accuracy of a volume is not such a threshold: see kEnough.
namespace overlapper {

/// Pairs of facets, one of each body. Up to this number, filling a table of all signs is faster than finding a seam.
///
/// Centres half a radius apart, 50 / 120 / 200 / 300 facets each: table 5 / 20 / 47 / 100 µs, seam 13 / 38 / 61 / 88
/// µs. Centres 1.5 radii apart, 50 / 80 / 120 / 200 facets: table 4 / 14 / 22 / 67 µs, seam 7 / 13 / 23 / 45 µs, and
/// without AVX2 5 / 14 / 26 / 79 µs and 7 / 11 / 20 / 41 µs. Centres 1.9 radii apart, like bodies in contact, 40 / 50 /
/// 60 / 80 facets: table 1.1 / 1.4 / 3.2 / 7.1 µs, seam 1.0 / 1.1 / 2.2 / 4.0 µs.
inline constexpr double kLeastPairsTraced = 2500;

/// Facets of a hull. Beyond this number, comparing every corner of one body with every plane of the other takes longer
/// than the hull of the dual points.
///
/// Two hulls of 256 / 512 / 1024 / 2048 facets: table 0.10 / 0.41 / 2.4 / 12 ms, dual hull 0.30 / 0.54 / 1.0 / 2.0 ms;
/// a hull of as many and a box: table 10 / 21 / 42 / 75 µs, dual hull 136 / 226 / 385 / 712 µs.
inline constexpr size_t kMostFacetsClipped = 1024;

/// Error of a volume by a formula, relative to the volume. Up to this error, no other way is tried.
///
/// A ball in a cylinder, by as many planes as a region may have (2^20, 2.4 s): 3.6e-6. A polytope is more accurate than
/// a formula only if the formula's error is larger than this.
inline constexpr double kFinest = 1e-7;

/// Facets of two polytopes together. Up to this number, the depth is found faster among the normals of facets and the
/// products of edges. Beyond it, EPA is faster, because it climbs from vertex to vertex.
///
/// Centres half a radius apart, 512 / 1024 / 2048 facets together: normals and products 16 / 40 / 85 µs, EPA 33 / 54 /
/// 80 µs; centres 1.5 radii apart: 14 / 28 / 64 µs and 20 / 27 / 55 µs.
inline constexpr int kMostFacetsParted = 1024;

/// Relative error of a depth or distance by doubles. If the error is larger, double-doubles compute it again.
///
/// Boxes 1e-8 deep, corner to corner / side on side: doubles 0.2 µs, double-doubles 6 / 25 µs; hulls of 28 / 90 / 400
/// facets as deep: doubles 1 / 3 / 15 µs, double-doubles 14 / 24 / 70 µs; as far apart: 3 / 4 / 7 µs and 18 / 21 / 61
/// µs.
inline constexpr double kClear = 1e-9;

/// Pairs of ridges, one of each body. Up to this number, all pairs are compared to bound a depth. Beyond it, EPA bounds
/// the depth.
///
/// Two hulls of 300 / 670 corners on a sphere, 8e5 / 4e6 pairs: 9 / 38 ms, and the depth is known to its last bit. EPA
/// for 700 corners: 2 ms, and the depth is known to 2e-14.
inline constexpr double kMostRidgesCompared = 0x1p22;

/// Total number of corners asked along the products of ridges. The search ends at this number.
///
/// Two prisms of 50 / 100 / 200 sides, lid on lid, so that all products of the rims are across the lids: 0.05 / 0.3 /
/// 2.3 s without a limit. A million corners take about 2 ms.
inline constexpr double kMostCornersAsked = 0x1p23;

/// Vertices of the other body that one arc between the normals of two facets may pass. In doubt, doubles would go on;
/// EPA answers instead.
///
/// No arc of 1320 pairs of 32 to 2048 facets together passed more than 4.
inline constexpr int kMostTurns = 64;

/// Number of vertices examined before a check whether the way along a normal is already longer than the shortest known.
///
/// The depth of pairs of 300 facets together, by 1 / 4 / 8 / 16 / all vertices: 8.5 / 7.8 / 7.7 / 7.3 / 13 µs; of 1000
/// together: 39 / 36 / 33 / 34 / 120 µs.
inline constexpr int kGlance = 8;

/// Vertices or facets of a hull. Up to this number, examining all of them is no slower than finding the start of a
/// climb.
///
/// Among 32 / 48 / 64 / 96 / 128: a farthest vertex by looking at all 28 / 39 / 53 / 79 / 111 ns, by climbing 59 / 69 /
/// 76 / 84 / 83 ns; the facet in a direction 58 / 73 / 87 / 111 / 132 ns and 59 / 61 / 66 / 77 / 70 ns; the facet
/// through which a ray leaves 105 / 136 / 167 / 221 / 270 ns and 106 / 103 / 114 / 133 / 124 ns.
inline constexpr int kMostScanned = 48;

/// Facets of the cone from a new point of a hull. Up to this number, each point that waits outside asks every facet
/// whether it sees it. Beyond it, points bisect.
///
/// The hull of a prism of 64 / 128 / 256 / 512 sides by asking 0.21 / 0.42 / 1.1 / 2.3 ms, by bisecting cones beyond
/// 48 facets 0.21 / 0.41 / 0.92 / 2.2 ms, beyond 16 facets 0.25 / 0.42 / 1.1 / 2.2 ms; the overlap of two that are
/// stacked 1e-6 deep 2.0 / 6.6 / 25 / 97 ms, 1.5 / 3.0 / 6.5 / 15 ms and 1.4 / 3.1 / 6.5 / 14 ms.
inline constexpr size_t kMostConeScanned = 48;

/// Boxes. Up to this number, comparing each with each is faster than splitting them.
///
/// The pairs of 200 boxes that hardly move, for leaves of 1 / 2 / 4 / 8 / 16 / 32: 13.9 / 12.5 / 10.8 / 10.2 / 11.7 /
/// 14.9 µs; of 2000: 436 / 387 / 363 / 347 / 352 / 390 µs.
inline constexpr int kMostBoxesCompared = 4;

/// The sine between two sides of a triangle of dual points. If the sine is smaller, the triangle's vertex is placed in
/// double-double.
///
/// The largest error of 20000 vertices that doubles place, of sines 0.5 / 0.1 / 0.01 / 0.001: 160 / 480 / 7100 / 81000
/// half-ulps of the vertex. Doubles take 11 ns, double-doubles 47 ns.
inline constexpr double kWellShaped = 1e-2;

}  // namespace overlapper
