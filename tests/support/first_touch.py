"""The exact time at which a translated box first touches another box."""

from fractions import Fraction
from itertools import combinations, product


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def exact_box(body):
    """The centre of a box and its half edges as vectors, in fractions. The quaternion may have any length."""
    x, y, z, w = (Fraction(each) for each in body.orientation.tolist())
    n = x * x + y * y + z * z + w * w
    columns = (
        (w * w + x * x - y * y - z * z, 2 * (x * y + z * w), 2 * (x * z - y * w)),
        (2 * (x * y - z * w), w * w - x * x + y * y - z * z, 2 * (y * z + x * w)),
        (2 * (x * z + y * w), 2 * (y * z - x * w), w * w - x * x - y * y + z * z),
    )
    half = [Fraction(each) / n for each in body.shape.half_extents.tolist()]
    edges = [tuple(h * each for each in column) for h, column in zip(half, columns)]
    return [Fraction(each) for each in body.position.tolist()], edges


def exact_first_touch(a, b, velocity):
    """The first time in [0, infinity) at which two boxes have a common point, if a is translated; None if never.

    Two boxes are separated if they are along the normal of a facet or of two edges. Each axis gives an interval of
    times.
    """
    (at_a, edges_a), (at_b, edges_b) = exact_box(a), exact_box(b)
    between = [p - q for p, q in zip(at_a, at_b)]
    velocity = [Fraction(float(each)) for each in velocity]
    facets = [cross(u, v) for edges in (edges_a, edges_b) for u, v in combinations(edges, 2)]
    axes = facets + [cross(u, v) for u, v in product(edges_a, edges_b)]
    first, last = Fraction(0), None
    for axis in axes:
        reach = sum(abs(dot(axis, edge)) for edge in (*edges_a, *edges_b))
        gap, rate = dot(axis, between), dot(axis, velocity)
        if rate == 0:
            if abs(gap) > reach:
                return None
            continue
        enter, leave = sorted(((-reach - gap) / rate, (reach - gap) / rate))
        first, last = max(first, enter), leave if last is None else min(last, leave)
    return first if last is None or first <= last else None
