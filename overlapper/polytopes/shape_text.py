"""Shapes as one line of text, for files that record the shapes of a simulation as well as their poses."""

from __future__ import annotations

import base64
import binascii
import json
import zlib

import numpy as np
from numpy.typing import NDArray

from overlapper.printable import first_line
from overlapper.shapes import Shape
from overlapper.shapes.table import KINDS, facts

LARGEST = 24 * 1_000_000  # bytes of the vertices of a hull: a million vertices, for which Hull needs seconds


def text_of(shape: Shape) -> str:
    """The shape as JSON: its kind and its defining numbers, in SI units.

    The vertices of a hull are sorted, written as little-endian doubles, deflated and encoded in base 64. A vertex
    usually takes 20 characters.
    """
    return json.dumps([type(shape).__name__, *map(_text_of_parameter, facts(shape).parameters())])


def _text_of_parameter(value: float | NDArray[np.float64]) -> object:
    if np.ndim(value) < 2:
        return np.asarray(value).tolist()
    return base64.b64encode(zlib.compress(np.asarray(value, "<f8").tobytes(), level=9)).decode()


def shape_of(text: str) -> Shape:
    """The shape of a text from `text_of`. ValueError if the text is invalid."""
    try:
        name, *parameters = json.loads(text)
        kind = {each.__name__: each for each in KINDS}[name]
        shape: Shape = kind(*map(_parameter_of_text, parameters))
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError, zlib.error, binascii.Error) as error:
        raise ValueError(f"{text[:60]!r} is not a shape: {first_line(error)}") from error
    return shape


def _parameter_of_text(value: object) -> object:
    if isinstance(value, str):
        return np.frombuffer(_inflated(base64.b64decode(value)), "<f8").reshape(-1, 3)
    return value


def _inflated(data: bytes) -> bytes:
    """The inflated data. ValueError beyond LARGEST, because a few deflated bytes may inflate to very many."""
    unpacker = zlib.decompressobj()
    inflated = unpacker.decompress(data, LARGEST)
    if not unpacker.eof:
        raise ValueError(f"its vertices are cut off, or more than {LARGEST // 24:,}")
    return inflated


def alike(a: Shape, b: Shape) -> bool:
    """True if the shapes are equal to within 1e-9 of their size. Another compiler may change shapes by so much."""
    if type(a) is not type(b):
        return False
    ours, theirs = _figures(a), _figures(b)
    return bool(np.abs(ours - theirs).max() <= 1e-9 * np.abs(ours).max())


def _figures(shape: Shape) -> NDArray[np.float64]:
    """Numbers that distinguish a shape from others of its kind: lengths, or normal and offset of a half-space."""
    parameters = facts(shape).parameters()
    if any(np.ndim(value) == 2 for value in parameters):
        return np.hstack([np.cbrt(shape.volume), shape.centroid, shape.bounds.ravel()])
    return np.hstack(parameters)
