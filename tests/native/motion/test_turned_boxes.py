"""Times of impact of boxes that turn, proved in interval arithmetic without the core."""

import numpy as np
import pytest
from flint import arb, ctx, fmpq
from strategies import product as turned_by
from strategies import quaternion, turn

from overlapper import Box, Placed, overlap, time_of_impact


def number(value):
    return arb(fmpq(*float(value).as_integer_ratio()))


def numbers(values):
    return [number(value) for value in values]


def dot(a, b):
    return sum((x * y for x, y in zip(a, b)), arb(0))


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


class TurningBox:
    """A box that moves along a line and turns about its centre, at any time or in any interval of times."""

    def __init__(self, rng, position, linear, speed):
        self.body = Placed(Box(rng.uniform(0.1, 0.8, 3)), position, quaternion(rng))
        self.linear, self.angular = linear, speed * rng.normal(size=3)
        x, y, z, w = numbers(self.body.orientation)
        square = x * x + y * y + z * z + w * w
        rows = [
            [w * w + x * x - y * y - z * z, 2 * (x * y + w * z), 2 * (x * z - w * y)],
            [2 * (x * y - w * z), w * w - x * x + y * y - z * z, 2 * (y * z + w * x)],
            [2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z],
        ]
        self.axes = [[each / square for each in row] for row in rows]
        spin = numbers(self.angular)
        self.rate = dot(spin, spin).sqrt()
        self.spin = [each / self.rate for each in spin]
        self.half = numbers(self.body.shape.half_extents)

    def centre(self, t):
        return [number(p) + number(v) * t for p, v in zip(self.body.position, self.linear)]

    def axes_at(self, t):
        """The axes of the box, by Rodrigues' formula."""
        sine, cosine = (self.rate * t).sin(), (self.rate * t).cos()
        turned = []
        for axis in self.axes:
            along, across = dot(self.spin, axis) * (1 - cosine), cross(self.spin, axis)
            turned.append([cosine * a + sine * c + along * k for a, c, k in zip(axis, across, self.spin)])
        return turned

    def extent(self, direction, t):
        return sum((h * abs(dot(direction, axis)) for h, axis in zip(self.half, self.axes_at(t))), arb(0))

    def holds(self, point, t):
        away = [p - c for p, c in zip(point, self.centre(t))]
        return all(abs(dot(away, axis)) < half for axis, half in zip(self.axes_at(t), self.half))

    def placed(self, t):
        orientation = turned_by(turn(t * np.array(self.angular)), self.body.orientation)
        return Placed(self.body.shape, self.body.position + t * np.array(self.linear), orientation)


def gap(a, b, direction, t):
    between = [q - p for p, q in zip(a.centre(t), b.centre(t))]
    return dot(direction, between) - a.extent(direction, t) - b.extent(direction, t)


def widest(a, b, t):
    """The direction with the widest gap at a time: the normal of a face, or the direction across two edges."""
    ones, others = a.axes_at(number(t)), b.axes_at(number(t))
    normals = [*ones, *others, *(cross(one, other) for one in ones for other in others)]
    directions = [
        [sign * each / dot(n, n).sqrt() for each in n] for n in normals if dot(n, n) > 1e-12 for sign in (1, -1)
    ]
    return max(directions, key=lambda direction: float(gap(a, b, direction, number(t))))


def assert_separated(a, b, low, high):
    """Proves that the boxes have no common point between two times. Each cell of times has a separating direction."""
    cells = [(low, high)]
    while cells:
        low, high = cells.pop()
        middle = low + (high - low) / 2
        assert low < middle < high, f"no gap at {low}"
        if not gap(a, b, widest(a, b, middle), number(low).union(number(high))) > 0:
            cells += [(low, middle), (middle, high)]


@pytest.mark.parametrize("seed", range(12))
def test_boxes_that_turn_have_no_common_point_before_the_time_and_one_after(seed):
    rng = np.random.default_rng([33, seed])
    spin = (0.5, 3.0)[seed % 2]
    start = rng.normal(size=3)
    start *= 3 / np.linalg.norm(start)
    with ctx.workprec(160):
        a = TurningBox(rng, start, -start * rng.uniform(0.8, 1.2) + 0.2 * rng.normal(size=3), spin)
        b = TurningBox(rng, (0, 0, 0), 0.2 * rng.normal(size=3), spin)
        found = time_of_impact(a.body, b.body, (a.linear, a.angular), (b.linear, b.angular), duration=1.5)
        assert found.status in ("impact", "separated")
        if found.status == "separated":
            assert_separated(a, b, 0.0, 1.5)
        else:
            assert found.time_upper - found.time < 1.6e-9
            assert_separated(a, b, 0.0, found.time)
            shared = overlap(a.placed(found.time_upper), b.placed(found.time_upper))
            point = numbers(shared.centroid)
            assert a.holds(point, number(found.time_upper)) and b.holds(point, number(found.time_upper))
