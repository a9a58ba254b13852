"""Graded contacts of every pair of kinds on the page of round bodies, and the rules that an answer keeps.

A contact has a depth between 1e-1 and 1e-10 of the smallest size of the two bodies, or is deep. Half axes differ by a
factor of up to 100, are nearly equal, or are equal in pairs. Bodies meet from outside, from inside, parallel, or as
copies of one shape; every third pair is up to 1e6 m away from the origin.

The volume is compared with bounds proved in ball arithmetic or in rational arithmetic, and with the sum of both halves
that a plane cuts. Depths are compared with the supports of both bodies, in extended precision. Other measures are
compared with those of the dual hull.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations_with_replacement
from zlib import crc32

import numpy as np
from strategies import directions, rotation

from overlapper import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Overlap,
    Placed,
    RoundedHull,
    Shape,
    Sphere,
    overlap,
)
from overlapper.proof.certificate import certificate
from overlapper.proof.claims import Bracketed

Wide = np.longdouble
EXACT = 1e-12  # the largest error of a volume, of itself, and of a depth, of the size
STATED = 1e-11  # the largest stated error of a volume, of itself
WIDE_PROOF = 1e-12  # a proof whose bounds are further apart, of the volume, decides nothing

MARGIN = 1e-3
VARIETIES = ("plain", "up to 1:100", "of revolution", "nearly equal")
ARRANGEMENTS = ("outside", "deep", "parallel", "similar", "inside", "nested")


def half_axes(rng: np.random.Generator, variety: str) -> np.ndarray:
    if variety == "up to 1:100":
        return 0.5 * 100.0 ** rng.uniform(-0.5, 0.5, 3)
    made = rng.uniform(0.25, 0.5, 3)
    if variety == "of revolution":
        made[int(rng.integers(1, 3))] = made[0]
    elif variety == "nearly equal":
        made[1:] = made[0] * np.array([1 + 1e-12, 1 + 1e-9 * rng.normal()])
    return made


SHAPES = {
    "box": lambda rng, h: Box(h),
    "hull": lambda rng, h: Hull(directions(rng, 20) * h),
    "half-space": lambda rng, h: HalfSpace(rng.normal(size=3), 0),
    "ball": lambda rng, h: Sphere(h[0]),
    "capsule": lambda rng, h: Capsule(h[0], 2 * h[2]),
    "cylinder": lambda rng, h: Cylinder(h[0], 2 * h[2]),
    "ellipsoid": lambda rng, h: Ellipsoid(h),
    "rounded hull": lambda rng, h: RoundedHull(directions(rng, 20) * h, h.min() * 10 ** rng.uniform(-1.3, -0.3)),
    "mesh with margin": lambda rng, h: RoundedHull(directions(rng, 60) * h, MARGIN),
}
# Two half-spaces share an unbounded set.
CLASSES = [", ".join(pair) for pair in combinations_with_replacement(SHAPES, 2) if pair != ("half-space", "half-space")]


@dataclass
class Contact:
    kinds: str
    seed: int
    detail: str
    depth: float  # that was asked for, in sizes
    a: Placed
    b: Placed


def made(kinds: str, seed: int) -> Contact:
    rng = np.random.default_rng([seed, crc32(kinds.encode())])
    first, second = kinds.split(", ")
    arrangement = str(rng.choice(ARRANGEMENTS))
    varieties = [str(rng.choice(VARIETIES)) for _ in range(2)]
    shapes = [SHAPES[kind](rng, half_axes(rng, each)) for kind, each in zip((first, second), varieties, strict=True)]
    turns = rng.normal(size=(2, 4))
    if arrangement in ("parallel", "similar"):
        turns[1] = turns[0]
    if arrangement == "similar" and first == second:
        shapes[1] = grown(shapes[0], 2.0 ** int(rng.integers(-2, 3)))
    depth = 10.0 ** -rng.uniform(1, 10)
    away = np.zeros(3)
    if rng.random() < 1 / 3:
        away = directions(rng, 1)[0] * 10.0 ** rng.uniform(0, 6)
    bodies = [Placed(shape, (0, 0, 0), turn) for shape, turn in zip(shapes, turns, strict=True)]
    bodies = arranged(rng, arrangement, bodies, depth)
    a, b = (far(body, away) for body in bodies)
    if rng.random() < 0.5:
        a, b = b, a
    return Contact(kinds, seed, f"{arrangement}; {varieties[0]}, {varieties[1]}", depth, a, b)


def grown(shape: Shape, share: float) -> Shape:
    """The shape, scaled by a power of two."""
    match shape:
        case Box():
            return Box(share * shape.half_extents)
        case Hull():
            return Hull(share * shape.vertices)
        case RoundedHull():
            return RoundedHull(share * shape.core.vertices, share * shape.radius)
        case Ellipsoid():
            return Ellipsoid(share * shape.half_axes)
        case Sphere():
            return Sphere(share * shape.radius)
        case Capsule() | Cylinder():
            return type(shape)(share * shape.radius, share * shape.length)
    return shape


def moved(body: Placed, by: np.ndarray) -> Placed:
    return Placed(body.shape, body.position + by, body.given_orientation)


def far(body: Placed, away: np.ndarray) -> Placed:
    """The body that far away. A half-space is given by a plane there, and without a pose of its own."""
    if not isinstance(body.shape, HalfSpace):
        return moved(body, away)
    normal = rotation(body.given_orientation) @ body.shape.normal
    return Placed(HalfSpace(3 * normal, 3 * (normal @ (body.position + away))))


def arranged(rng, arrangement: str, bodies: list[Placed], depth: float) -> list[Placed]:
    if any(isinstance(body.shape, HalfSpace) for body in bodies):
        arrangement = "deep" if arrangement in ("deep", "nested") else "outside"
    if arrangement == "deep":
        return [moved(bodies[0], 0.5 * width(bodies[0]) * rng.normal(size=3)), bodies[1]]
    if arrangement in ("inside", "nested"):
        outer, inner = bodies if rng.random() < 0.5 else bodies[::-1]
        share = 2.0 ** np.floor(np.log2(0.4 * size(outer) / width(inner)))
        inner = Placed(grown(inner.shape, share), (0, 0, 0), inner.given_orientation)
        if arrangement == "nested":
            return [outer, moved(inner, 0.1 * size(outer) * rng.normal(size=3))]
        way = facing(rng, outer)
        between = tips(outer, way[None])[0] - tips(inner, way[None])[0]
        sign = 1 if rng.random() < 0.5 else -1
        return [outer, moved(inner, np.array(between, float) + sign * depth * size(inner) * way)]
    a, b = bodies
    if isinstance(a.shape, HalfSpace):
        a, b = b, a
    a = moved(a, width(b) * rng.normal(size=3) if arrangement == "outside" else rng.normal(size=3) * 0.3)
    deep = depth * min(size(body) for body in (a, b) if not isinstance(body.shape, HalfSpace))
    for _ in range(4):
        found = overlap(a, b)
        step = found.depth - deep if found else -found.distance - deep
        a = moved(a, step * np.array(found.normal))
    return [a, b]


def facing(rng, body: Placed) -> np.ndarray:
    """The normal of a facet of a polyhedron, or any direction."""
    if isinstance(body.shape, (Box, Hull)):
        planes = overlap(body, body).halfspaces
        return planes[int(rng.integers(len(planes))), :3]
    return directions(rng, 1)[0]


# Sizes and supports


def extents(body: Placed) -> np.ndarray:
    """Half the widths along the axes of the shape."""
    shape = body.shape
    match shape:
        case Box():
            return shape.half_extents
        case Ellipsoid():
            return shape.half_axes
        case Sphere():
            return np.full(3, shape.radius)
        case Capsule():
            return np.array([shape.radius, shape.radius, shape.radius + shape.length / 2])
        case Cylinder():
            return np.array([shape.radius, shape.radius, shape.length / 2])
        case Hull():
            return np.ptp(shape.vertices, axis=0) / 2
        case RoundedHull():
            return np.ptp(shape.core.vertices, axis=0) / 2 + shape.radius
    return np.ones(3)


def size(body: Placed) -> float:
    return float(extents(body).min())


def width(body: Placed) -> float:
    return float(extents(body).max())


def turned(body: Placed) -> np.ndarray:
    """The rotation matrix of the quaternion as given, in extended precision."""
    x, y, z, w = np.array(body.given_orientation, Wide)
    n = x * x + y * y + z * z + w * w
    rows = [
        [w * w + x * x - y * y - z * z, 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), w * w - x * x + y * y - z * z, 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), w * w - x * x - y * y + z * z],
    ]
    return np.array(rows, Wide) / n


def tips(body: Placed, ways: np.ndarray) -> np.ndarray:
    """The farthest points (k, 3) in some directions (k, 3), from the body's position, in extended precision."""
    turn = turned(body)
    own = np.array(ways, Wide) @ turn
    own /= np.sqrt((own * own).sum(1))[:, None]
    shape = body.shape
    match shape:
        case Box():
            found = np.sign(own) * shape.half_extents
        case Ellipsoid():
            stretched = own * shape.half_axes
            found = shape.half_axes * stretched / np.sqrt((stretched * stretched).sum(1))[:, None]
        case Sphere():
            found = Wide(shape.radius) * own
        case Capsule():
            found = Wide(shape.radius) * own
            found[:, 2] += np.sign(own[:, 2]) * Wide(shape.length) / 2
        case Cylinder():
            across = np.sqrt((own[:, :2] ** 2).sum(1))[:, None]
            found = Wide(shape.radius) * own / np.where(across > 0, across, 1)
            found[:, 2] = np.sign(own[:, 2]) * Wide(shape.length) / 2
        case Hull():
            found = np.array(shape.vertices, Wide)[(own @ np.array(shape.vertices, Wide).T).argmax(1)]
        case RoundedHull():
            core = np.array(shape.core.vertices, Wide)
            found = core[(own @ core.T).argmax(1)] + Wide(shape.radius) * own
        case _:
            raise TypeError(shape)
    return found @ turn.T


def moves(a: Placed, b: Placed, ways: np.ndarray) -> np.ndarray:
    """How far `a` moves along each direction (k, 3) until it is separated from `b`, in extended precision."""
    ways = np.array(ways, Wide)
    ways /= np.sqrt((ways * ways).sum(1))[:, None]
    between = np.array(b.position, Wide) - np.array(a.position, Wide)
    return ((tips(b, ways) - tips(a, -ways) + between) * ways).sum(1)


def from_half_space(body: Placed, other: Placed) -> tuple[Wide, np.ndarray]:
    """How far a body moves out of a half-space without a pose, and the direction."""
    shape = other.shape
    normal = np.array(shape.given_normal, Wide)
    length = np.sqrt((normal * normal).sum())
    low = tips(body, -normal[None])[0] + np.array(body.position, Wide)
    # The products are of doubles; their sum is taken exactly.
    low_exact = sum(Fraction(float(n)) * exactly(x) for n, x in zip(shape.given_normal, low, strict=True))
    deep = Fraction(float(shape.given_offset)) - low_exact
    high = float(deep)
    return (Wide(high) + Wide(float(deep - Fraction(high)))) / length, normal / length


def exactly(x: Wide) -> Fraction:
    high = float(x)
    return Fraction(high) + Fraction(float(x - Wide(high)))


# Rules


@dataclass
class Judged:
    found: Overlap
    seconds: float  # of the first call, for the volume
    off: float | None = None  # by what part of the volume it is off
    share: float | None = None  # by what part of the stated error it is off
    halves_off: float | None = None  # by what part of the volume the sum of two halves differs
    proof_seconds: float | None = None
    proof_ended: bool = False  # because it took longer than allowed
    proof_width: float | None = None
    depth_off: float | None = None  # in sizes
    complaints: tuple[str, ...] = ()


def judge(contact: Contact, proved: bool, proof_limit: float | None = None, only_volume: bool = False) -> Judged:
    """Asks for all measures, or for the volume alone, which takes a tenth of the time.

    A proof ends after `proof_limit` seconds of the processor, if that is given.
    """
    a, b = contact.a, contact.b
    least = None
    for _ in range(2):  # a second pair that is equal, because another process may have taken the processor
        begin = time.process_time()
        found = overlap(a, b)
        _ = found.volume
        taken = time.process_time() - begin
        least = taken if least is None else min(least, taken)
    result = Judged(found, least)
    wrong = [] if only_volume else [*depth_complaints(a, b, found, result)]
    if found:
        wrong += volume_complaints(found, result, proved, proof_limit)
        wrong += halves_complaints(a, b, found, result)
        wrong += order_complaints(found, overlap(b, a), () if only_volume else ("area", "depth"))
        if not only_volume:
            wrong += measure_complaints(a, b, found)
    result.complaints = tuple(wrong)
    return result


def depth_complaints(a: Placed, b: Placed, found: Overlap, result: Judged) -> Iterator[str]:
    """The depth is the least move that separates, and the normal is its direction."""
    bounded = [body for body in (a, b) if not isinstance(body.shape, HalfSpace)]
    scale = max(width(body) for body in bounded)
    # The places are doubles, so their difference is nearly exact. Supports are in extended precision.
    doubt = 1e-17 * scale + 1e-19 * max(float(np.abs(body.position).max()) for body in bounded)
    normal = np.array(found.normal)
    if len(bounded) < 2:
        flat = b if isinstance(b.shape, HalfSpace) else a
        least, way = from_half_space(bounded[0], flat)
        at_normal = least
        if np.abs(np.array(way * (1 if flat is b else -1), float) - normal).max() > 1e-15:
            yield "the normal is not that of the half-space"
    else:
        at_normal = moves(a, b, normal[None])[0]
        rng = np.random.default_rng(0)
        spread = (10.0 ** rng.uniform(-9, 0.5, 400))[:, None] * directions(rng, 400)
        least = min(at_normal, moves(a, b, normal + spread).min())
    error = found.errors.depth if found else found.errors.distance
    signed = found.depth if found else -found.distance
    if found.status == "touching":
        error, signed = max(error, EXACT * scale), 0.0
    over, under = float(signed - least), float(at_normal - signed)
    result.depth_off = max(over, under) / scale
    if over > error + doubt:
        yield f"a move of {float(least):.6g} along another direction separates, not {signed:.6g} ± {error:.1g}"
    if under > error + doubt + EXACT * scale:
        yield f"a move of {float(at_normal):.6g} along the normal separates, not {signed:.6g} ± {error:.1g}"
    # Depths below a half-space come from its offset in doubles, which loses digits far away.
    lost = 4e-16 * max(abs(body.shape.offset) for body in (a, b) if body not in bounded) if len(bounded) < 2 else 0.0
    if result.depth_off > EXACT + lost / scale:
        yield f"the depth is off by {result.depth_off:.1g} of the size"


def bounds(found: Overlap) -> tuple[Fraction, Fraction]:
    """Proved bounds of the volume. Bounds in ball arithmetic are computed once, not again to be checked."""
    proof = certificate(found)
    return (proof.lower, proof.upper) if isinstance(proof, Bracketed) else proof.verify()


@contextmanager
def ended_after(seconds: float | None) -> Iterator[None]:
    """Raises TimeoutError after so many seconds of the processor. For the main thread of a process."""
    if seconds is None:
        yield
        return
    late = []

    def end(*_: object) -> None:
        late.append(True)
        raise TimeoutError

    before = signal.signal(signal.SIGPROF, end)
    # Again and again: callbacks of compiled code may drop an exception.
    signal.setitimer(signal.ITIMER_PROF, seconds, 0.01)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)
    if late:
        raise TimeoutError


def volume_complaints(found: Overlap, result: Judged, proved: bool, proof_limit: float | None = None) -> Iterator[str]:
    stated = found.volume_error / found.volume
    if not stated <= STATED:
        yield f"the stated error is {stated:.1g} of the volume, by {found.way}"
    if "dual" in found.way and any(not isinstance(s.shape, (Box, Hull, HalfSpace)) for s in found.shapes):
        yield f"the way is {found.way}"
    if not proved:
        return
    begin = time.process_time()
    try:
        with ended_after(proof_limit):
            lower, upper = bounds(found)
    except TimeoutError:
        result.proof_ended = True
        return
    result.proof_seconds = time.process_time() - begin
    result.proof_width = float((upper - lower) / upper)
    volume, error = Fraction(found.volume), Fraction(found.volume_error)
    off = max(lower - volume, volume - upper, Fraction(0))
    result.off, result.share = float(off / upper), float(off / error)
    if off > error:
        yield f"the volume is off by {result.share:.3g} times the stated error, by {found.way}"
    if result.off > EXACT:
        yield f"the volume is off by {result.off:.1g} of itself, by {found.way}"
    if result.proof_width > WIDE_PROOF:
        yield f"the proved bounds are {result.proof_width:.1g} of the volume apart"


def halves_complaints(a: Placed, b: Placed, found: Overlap, result: Judged) -> Iterator[str]:
    """A plane through the centroid cuts the common set in two, and their volumes add up."""
    if any(isinstance(body.shape, Ellipsoid) for body in (a, b)):
        return  # groups with an ellipsoid are measured by the dual hull alone
    normal = directions(np.random.default_rng(1), 1)[0]
    offset = float(normal @ found.centroid)
    halves = [overlap(a, b, HalfSpace(side * normal, side * offset)) for side in (1, -1)]
    volume, error = sum(half.volume for half in halves), sum(half.volume_error for half in halves)
    off = abs(volume - found.volume)
    result.halves_off = off / found.volume
    if off > error + found.volume_error:
        yield f"two halves are off by {result.halves_off:.1g} of the volume, by {halves[0].way} and {halves[1].way}"


def order_complaints(found: Overlap, other: Overlap, names: Iterable[str]) -> Iterator[str]:
    if abs(found.volume - other.volume) > found.volume_error + other.volume_error:
        yield "the volume depends on the order"
    for name in names:
        if abs(getattr(found, name) - getattr(other, name)) > getattr(found.errors, name) + getattr(other.errors, name):
            yield f"the {name} depends on the order"


def measure_complaints(a: Placed, b: Placed, found: Overlap) -> Iterator[str]:
    """All measures are those of the dual hull, within the errors that both state, and forces are balanced."""
    errors, gradient = found.errors, np.array(found.gradient)
    if not (np.abs(gradient[0, :3] + gradient[1, :3]) <= errors.gradient[:, :3].sum(0) + 1e-15 * found.area).all():
        yield "the forces are not opposite"
    reach = max(width(body) for body in (a, b) if not isinstance(body.shape, HalfSpace))
    # Groups with an ellipsoid are measured by the dual hull alone.
    around = Placed(Ellipsoid([8 * reach, 9 * reach, 10 * reach]), found.centroid)
    other = overlap(a, b, around, tolerance=1e-2)
    if other and "dual hull" not in other.way:
        yield f"with a body around both, the way is {other.way}"
    if not other:
        yield f"with a body around both, the status is {other.status}"
        return
    if abs(found.volume - other.volume) > found.volume_error + other.volume_error:
        yield "the volume is not that of the dual hull"
    if abs(found.area - other.area) > errors.area + other.errors.area:
        yield "the area is not that of the dual hull"
    if np.linalg.norm(found.centroid - other.centroid) > errors.centroid + other.errors.centroid:
        yield "the centroid is not that of the dual hull"
    if np.abs(found.inertia - other.inertia).max() > errors.inertia + other.errors.inertia:
        yield "the inertia is not that of the dual hull"
    if (np.abs(gradient - other.gradient[:2]) > errors.gradient + other.errors.gradient[:2]).any():
        yield "the gradient is not that of the dual hull"
