"""The energy that pressures store in overlaps."""

from __future__ import annotations

import numpy as np

from overlapper import Overlaps, Placed, overlaps
from overlapper.quaternion import rotated
from overlapper.shapes.table import facts
from overlapper.simulation.model import Array

# Gauss and Legendre's, from 0 to 1.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)
NODES, WEIGHTS = (NODES + 1) / 2, WEIGHTS / 2


def energies(found: Overlaps, normals: Array, stiffness: Array, hardening: Array) -> Array:
    """(p,) J: the work of pressures while each pair is drawn apart along its normal (p, 3).

    This work is stiffness times the integral of the volume over the way. If one of a pair is a half-space, the work is
    stiffness times the integral of z (1 + hardening z) over the volume. Here z is the depth below the plane.
    """
    result = np.zeros(len(found))
    for row in np.flatnonzero(found.status == Overlaps.OVERLAPPING).tolist():
        overlap = found[row]
        a, b = overlap.shapes
        plane = next((each for each in (a, b) if not facts(each.shape).bounded), None)
        if plane is None:
            result[row] = stiffness[row] * _work(a, b, normals[row], np.ptp(overlap.vertices @ normals[row]))
        else:
            depth, normal = _below(plane, overlap.centroid)
            result[row] = stiffness[row] * overlap.volume * depth
            if hardening[row] > 0:
                square = np.trace(overlap.inertia) / 2 - normal @ overlap.inertia @ normal + overlap.volume * depth**2
                result[row] += stiffness[row] * hardening[row] * square
    return result


def _below(plane: Placed, point: Array) -> tuple[float, Array]:
    """Return how far a point is below the plane of a half-space, in m, and the normal (3,) of the plane."""
    side = facts(plane.shape).side(point)
    assert side is not None
    normal, offset, _ = side
    normal = rotated(plane.orientation, normal)
    return float(offset - normal @ (point - plane.position)), normal


def _work(a: Placed, b: Placed, normal: Array, way: float) -> float:
    """Return the integral of the common volume (m⁴) while the first shape is drawn away.

    `way` is a length that separates the two.
    """
    orientations = np.concatenate([np.repeat([a.orientation], len(NODES), axis=0), [b.orientation]])
    shapes, pairs = [a.shape] * len(NODES) + [b.shape], [(k, len(NODES)) for k in range(len(NODES))]
    while True:
        positions = np.concatenate([a.position + way * NODES[:, None] * normal, [b.position]])
        volumes = overlaps(shapes, positions, orientations, pairs).volume
        apart = np.flatnonzero(volumes == 0)
        # The overlap may end before the last node. Nodes without an overlap add nothing to the accuracy.
        if not 0 < len(apart) < len(NODES):
            return float(way * (WEIGHTS @ volumes))
        way *= float(NODES[apart[0]])
