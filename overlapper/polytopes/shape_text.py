"""Shapes as one line of text, so that a file can say what was simulated as well as where it was."""

from __future__ import annotations

import base64
import binascii
import json
import zlib

import numpy as np
from numpy.typing import NDArray

from overlapper._core import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, RoundedHull, Sphere
from overlapper.printable import first_line
from overlapper.shape import Shape

PARAMETERS: dict[type, tuple[str, ...]] = {
    Box: ("half_extents",),
    Sphere: ("radius",),
    Capsule: ("radius", "length"),
    Cylinder: ("radius", "length"),
    Ellipsoid: ("half_axes",),
    HalfSpace: ("normal", "offset"),
}
LARGEST = 24 * 1_000_000  # bytes of the vertices of a hull: a million, of which Hull itself needs seconds
KINDS = {kind.__name__: kind for kind in (*PARAMETERS, Hull, RoundedHull)}


def text_of(shape: Shape) -> str:
    """The shape as JSON: its kind and what it is built from, in SI units.

    The vertices of a hull are sorted, as little-endian doubles, deflated and in base 64: 20 characters each, mostly.
    """
    if isinstance(shape, Hull | RoundedHull):
        hull, radius = (shape, []) if isinstance(shape, Hull) else (shape.core, [shape.radius])
        vertices = hull.vertices[np.lexsort(hull.vertices.T[::-1])]
        packed = base64.b64encode(zlib.compress(vertices.astype("<f8").tobytes(), level=9)).decode()
        return json.dumps([type(shape).__name__, packed, *radius])
    parameters = [np.asarray(getattr(shape, name)).tolist() for name in PARAMETERS[type(shape)]]
    return json.dumps([type(shape).__name__, *parameters])


def shape_of(text: str) -> Shape:
    """The shape of such a text. ValueError if it is none."""
    try:
        kind, *parameters = json.loads(text)
        if kind in ("Hull", "RoundedHull"):
            packed, *radius = parameters
            parameters = [np.frombuffer(_inflated(base64.b64decode(packed)), "<f8").reshape(-1, 3), *radius]
        shape: Shape = KINDS[kind](*parameters)
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError, zlib.error, binascii.Error) as error:
        raise ValueError(f"{text[:60]!r} is no shape: {first_line(error)}") from error
    return shape


def _inflated(data: bytes) -> bytes:
    """A little that is deflated may be very much."""
    unpacker = zlib.decompressobj()
    inflated = unpacker.decompress(data, LARGEST)
    if not unpacker.eof:
        raise ValueError(f"its vertices are cut, or more than {LARGEST // 24:,}")
    return inflated


def alike(a: Shape, b: Shape) -> bool:
    """True if the shapes are the same to within 1e-9 of their size: as far as another compiler may move them."""
    if type(a) is not type(b):
        return False
    ours, theirs = _figures(a), _figures(b)
    return bool(np.abs(ours - theirs).max() <= 1e-9 * np.abs(ours).max())


def _figures(shape: Shape) -> NDArray[np.float64]:
    """What a shape of its kind is known by, lengths all of them; of a half-space, the normal and the offset."""
    if isinstance(shape, Hull | RoundedHull):
        return np.hstack([np.cbrt(shape.volume), shape.centroid, shape.bounds.ravel()])
    return np.hstack([getattr(shape, name) for name in PARAMETERS[type(shape)]])
