"""The energy that pressures store in what bodies share."""

from __future__ import annotations

import numpy as np

from overlapper import HalfSpace, Overlaps, Placed, overlaps
from overlapper.quaternion import rotated
from overlapper.simulation.model import Array

# Gauss and Legendre's, from 0 to 1.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)
NODES, WEIGHTS = (NODES + 1) / 2, WEIGHTS / 2


def energies(found: Overlaps, normals: Array, stiffness: Array) -> Array:
    """(p,) J: the work of pressures while each pair is drawn apart along its normal (p, 3).

    That is stiffness times the integral of the volume over the way. Where one of a pair is a half-space, it is
    stiffness times volume times the depth of the centroid.
    """
    result = np.zeros(len(found))
    for row in np.flatnonzero(found.status == Overlaps.OVERLAPPING).tolist():
        overlap = found[row]
        a, b = overlap.shapes
        plane = next((each for each in (a, b) if isinstance(each.shape, HalfSpace)), None)
        if plane is not None:
            assert isinstance(plane.shape, HalfSpace)
            outward = rotated(plane.orientation, plane.shape.normal)
            depth = plane.shape.offset - outward @ (overlap.centroid - plane.position)
            result[row] = stiffness[row] * overlap.volume * depth
            continue
        work = _work(a, b, normals[row], np.ptp(overlap.vertices @ normals[row]))
        result[row] = stiffness[row] * work
    return result


def _work(a: Placed, b: Placed, normal: Array, way: float) -> float:
    """The integral of the volume that the two share (m⁴) while the first is drawn away, over a way that parts them."""
    orientations = np.concatenate([np.repeat([a.orientation], len(NODES), axis=0), [b.orientation]])
    shapes, pairs = [a.shape] * len(NODES) + [b.shape], [(k, len(NODES)) for k in range(len(NODES))]
    while True:
        positions = np.concatenate([a.position + way * NODES[:, None] * normal, [b.position]])
        volumes = overlaps(shapes, positions, orientations, pairs).volume
        apart = np.flatnonzero(volumes == 0)
        # What is shared may be longer than deep: nodes where nothing is shared any more say less than they might.
        if not 0 < len(apart) < len(NODES):
            return float(way * (WEIGHTS @ volumes))
        way *= float(NODES[apart[0]])
