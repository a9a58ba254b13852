"""The energy that pressures store in what bodies share."""

from __future__ import annotations

import numpy as np

from overlapper import HalfSpace, Overlaps, overlaps
from overlapper.quaternion import rotated
from overlapper.simulation.extraction.model import Array

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
        normal = normals[row]
        way = np.ptp(overlap.vertices @ normal)
        positions = np.concatenate([a.position + way * NODES[:, None] * normal, [b.position]])
        orientations = np.concatenate([np.repeat([a.orientation], len(NODES), axis=0), [b.orientation]])
        pairs = [(k, len(NODES)) for k in range(len(NODES))]
        volumes = overlaps([a.shape] * len(NODES) + [b.shape], positions, orientations, pairs).volume
        result[row] = stiffness[row] * way * (WEIGHTS @ volumes)
    return result
