#pragma once

#include <cstddef>

/// \file
/// Thresholds between two ways to the same answer, each with the measurement that set it.
namespace overlapper {

/// Pairs of facets, one of each body, up to which a table of all signs is sooner filled than a seam is found.
inline constexpr double kLeastPairsTraced = 2500;

/// Facets of a hull beyond which asking every corner of one body about every plane of the other takes longer than the
/// hull of the dual points.
inline constexpr size_t kMostFacetsClipped = 1024;

/// The error of a volume, relative to it, that a region of as many planes as it may have reaches on a round body: a
/// smaller tolerance is not worth another way.
inline constexpr double kFinest = 1e-7;

/// Facets of two polytopes together up to which their depth is sooner found among the normals of facets and the
/// products of edges; beyond, by EPA, which climbs from vertex to vertex.
inline constexpr int kMostFacetsParted = 1024;

/// Vertices that one arc may pass on the other body; doubles that stay in doubt would go on, and EPA answers.
inline constexpr int kMostTurns = 64;

/// Vertices looked at before asking whether a way is known to be longer than the shortest so far.
inline constexpr int kGlance = 8;

/// Vertices or facets of a hull up to which looking at all of them takes no longer than finding out where to climb.
inline constexpr int kMostScanned = 48;

/// Boxes up to which each is compared with each sooner than they are split.
inline constexpr int kMostBoxesCompared = 4;

/// The sine between two sides of a triangle of dual points below which doubles place the vertex it stands for badly.
inline constexpr double kWellShaped = 1e-2;

}  // namespace overlapper
