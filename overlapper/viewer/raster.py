"""Triangles painted from far to near at every pixel, so that bodies that go through each other are drawn correctly.

A ray leaves the camera through each pixel. Three planes contain the camera and a side of a triangle; the ray meets the
triangle if it is on the inner side of all three. This holds for corners behind the camera, too, so nothing is clipped.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from overlapper.viewer.look import Array

Indices = NDArray[np.intp]
FINER = 2  # rays per pixel, each way
BAND = 32  # rows of pixels that are painted at once: their rays are sorted in the processor's cache


def painted(triangles: Array, colors: Array, slope: float, width: int, height: int) -> NDArray[np.float32]:
    """The image (height, width, 4): red, green, blue and opacity in 0..1.

    `triangles` (k, 3, 3) are in the camera's frame: x points right, y up, and the camera looks along -z. `colors`
    (k, 4) have an opacity. `slope` is the tangent of half the angle between the image's bottom and top.
    """
    sides = np.cross(np.roll(triangles, -1, axis=1), np.roll(triangles, -2, axis=1))
    volume = (sides[:, 0] * triangles[:, 0]).sum(axis=1)
    drawn = np.flatnonzero((volume != 0) & (colors[:, 3] > 0))
    triangles, sides, volume = triangles[drawn], sides[drawn], volume[drawn, None]
    opaque = colors[drawn].astype(np.float32)
    opaque[:, :3] *= opaque[:, 3:]
    columns, rows = FINER * width, FINER * height
    unit = 2 * slope / rows
    to_ray = np.array([[unit, 0, unit * (1 - columns) / 2], [0, -unit, unit * (rows - 1) / 2], [0, 0, -1]])
    # Planes times (column, row, 1) is one over the distance; sides times it is positive within a triangle.
    planes = sides.sum(axis=1) @ to_ray / volume
    spans = _spans(triangles, np.sign(volume)[..., None] * (sides @ to_ray), unit, columns, rows)
    image = np.zeros((height, width, 4), np.float32)
    for top in range(0, height, BAND):
        part = image[top : top + BAND]
        start, end = np.searchsorted(spans[1], (FINER * top, FINER * (top + len(part))))
        if start < end:
            part[:] = _band(spans[:, start:end], planes, opaque, FINER * top, part.shape)
    image[..., :3] /= np.maximum(image[..., 3:], 1e-9)
    return np.clip(image, 0, 1)


def _spans(triangles: Array, sides: Array, unit: float, columns: int, rows: int) -> Indices:
    """Triangle, row, first column and number of columns (4, n) of every row of every triangle, in the order of rows."""
    ahead = triangles[..., 2].max(axis=1) < 0
    y = (rows - 1) / 2 + triangles[..., 1] / np.where(ahead[:, None], triangles[..., 2], -np.inf) / unit
    top = np.where(ahead, np.ceil(np.clip(y.min(axis=1), 0, rows)), 0).astype(np.intp)
    bottom = np.where(ahead, np.floor(np.clip(y.max(axis=1), -1, rows - 1)), rows - 1).astype(np.intp)
    triangle, row = _counted(top, np.maximum(bottom - top + 1, 0))
    across, rest = sides[triangle, :, 0], sides[triangle, :, 1] * row[:, None] + sides[triangle, :, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = -rest / across
    first = np.where(across > 0, ends, np.where((across == 0) & (rest < 0), np.inf, -np.inf)).max(axis=1)
    last = np.where(across < 0, ends, np.inf).min(axis=1)
    start = np.ceil(np.clip(first, 0, columns)).astype(np.intp)
    count = np.floor(np.clip(last, -1, columns - 1)).astype(np.intp) - start + 1
    met = np.flatnonzero(count > 0)
    met = met[np.argsort(row[met], kind="stable")]
    return np.stack([triangle[met], row[met], start[met], count[met]])


def _band(spans: Indices, planes: Array, colors: NDArray[np.float32], top: int, shape: tuple[int, ...]) -> Array:
    """Some rows of pixels, from that row of rays on; colours are multiplied by opacity."""
    columns = FINER * shape[1]
    span, column = _counted(spans[2], spans[3])
    triangle, row = spans[:2, span]
    a, b, c = planes[triangle].T
    nearness = (a * column + b * row + c).astype(np.float32)
    ray = (row - top) * columns + column
    # One sort by ray, by nearness and by triangle. The bits of nearness are in the order of its values. If two
    # triangles are equally near, the later triangle is in front.
    bits = np.uint64(len(colors).bit_length())
    near = (nearness.view(np.uint32) >> np.uint32(7)).astype(np.uint64)  # 24 bits: as fine as 1/65,536
    keys = np.sort((ray.astype(np.uint64) << np.uint64(24) | near) << bits | triangle.astype(np.uint64))
    ray = (keys >> (bits + np.uint64(24))).astype(np.intp)
    triangle = (keys & ((np.uint64(1) << bits) - np.uint64(1))).astype(np.intp)
    first = np.flatnonzero(np.diff(ray, prepend=-1))
    faces = np.diff(first, append=len(ray))
    met, paint = np.arange(len(first)), np.zeros((len(first), 4), np.float32)
    for number in range(faces.max(initial=0)):
        met = met[faces[met] > number]
        over = colors[triangle[first[met] + number]]
        paint[met] = over + (1 - over[:, 3:]) * paint[met]
    pixel = ray[first] // columns // FINER * shape[1] + ray[first] % columns // FINER
    sums = [np.bincount(pixel, part, minlength=shape[0] * shape[1]) for part in paint.T]
    return np.stack(sums, axis=-1).reshape(shape) / FINER**2


def _counted(start: Indices, count: Indices) -> tuple[Indices, Indices]:
    """The numbers of all ranges, one range after the other, each beside the index of its range."""
    which = np.repeat(np.arange(len(count)), count)
    return which, np.arange(len(which)) + (start - np.cumsum(count) + count)[which]
