"""Measures of overlaps of round bodies to about thirteen digits, by integration over rays instead of the core's slices.

The doubles that describe a body are taken as exact. A quaternion of any length stands for its rotation.

Every ray from a point inside leaves the common part through one plane, cylinder or ball. The length of the ray is a
root of an equation of degree two at most. The volume is the integral of a third of its cube over all directions. The
coordinates are chosen so that the common part is nearly round. The coefficients of the equations have sixty digits, so
the roots in doubles keep their relative accuracy however thin the common part is.

The root is an analytic function of the direction as long as the ray leaves through one surface. Bisection finds the
borders between surfaces, and Gauss-Legendre rules integrate between the borders.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction

import exact
import numpy as np
from flint import arb, ctx, fmpq

from overlapper import Box, Capsule, HalfSpace, Hull, Overlap, Placed, RoundedHull, Sphere

ctx.dps = 60
Vector = tuple[arb, arb, arb]
NODES, WEIGHTS = np.polynomial.legendre.leggauss(20)
FINE, COARSE = np.polynomial.legendre.leggauss(24), np.polynomial.legendre.leggauss(16)
STEPS = 48  # of a bisection; many at once are done by four of them at a time
AGREED = 2e-14
SAMPLES = 720  # of a circle: an arc between two of them is lost, of which the fifth power counts


def number(x: float | Fraction) -> arb:
    f = Fraction(x)
    return arb(fmpq(f.numerator, f.denominator))


def vector(v: Iterable[float | Fraction]) -> Vector:
    x, y, z = (number(c if isinstance(c, Fraction) else float(c)) for c in v)
    return x, y, z


def dot(u: Vector, v: Vector) -> arb:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def cross(u: Vector, v: Vector) -> Vector:
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


def plus(u: Vector, v: Vector, share: arb | int = 1) -> Vector:
    return u[0] + share * v[0], u[1] + share * v[1], u[2] + share * v[2]


def scaled(v: Vector, s: arb) -> Vector:
    return s * v[0], s * v[1], s * v[2]


def unit(v: Vector) -> Vector:
    return scaled(v, 1 / dot(v, v).sqrt())


def axes_of(body: Placed) -> tuple[Vector, Vector, Vector]:
    x, y, z, w = (number(float(c)) for c in body.orientation)
    n = x * x + y * y + z * z + w * w
    return (
        ((w * w + x * x - y * y - z * z) / n, 2 * (x * y + z * w) / n, 2 * (x * z - y * w) / n),
        (2 * (x * y - z * w) / n, (w * w - x * x + y * y - z * z) / n, 2 * (y * z + x * w) / n),
        (2 * (x * z + y * w) / n, 2 * (y * z - x * w) / n, (w * w - x * x - y * y + z * z) / n),
    )


@dataclass
class Piece:
    """A ball or a cylinder (centre, axis, radius), if any, within planes (normal, offset, whether it is a face)."""

    quadric: tuple[Vector, Vector | None, arb] | None
    planes: list[tuple[Vector, arb, bool]]


class Solid:
    """A body in the world as pieces: a ray leaves it where it leaves the last of them."""

    def __init__(self, body: Placed) -> None:
        self.axes, self.position = axes_of(body), vector(body.position)
        shape = body.shape
        if isinstance(shape, Sphere):
            self.pieces = [Piece((self.position, None, number(shape.radius)), [])]
        elif isinstance(shape, Box):
            half = [number(float(h)) for h in shape.half_extents]
            sides = [(k, s) for k in range(3) for s in (-1, 1)]
            self.pieces = [
                Piece(None, [self.plane(tuple(arb(s * (i == k)) for i in range(3)), half[k]) for k, s in sides])
            ]
        elif isinstance(shape, HalfSpace):
            normal = vector(shape.given_normal)
            length = dot(normal, normal).sqrt()
            offset = number(float(shape.given_offset)) / length
            self.pieces = [Piece(None, [self.plane(scaled(normal, 1 / length), offset)])]
        elif isinstance(shape, Hull):
            self.pieces = [Piece(None, [self.plane(n, offset) for n, offset, _ in facets(shape.vertices)])]
        elif isinstance(shape, RoundedHull):
            self.pieces = self.rounded(shape)
        else:
            radius, half = number(float(shape.radius)), number(float(shape.length)) / 2
            up, down = (arb(0), arb(0), arb(1)), (arb(0), arb(0), arb(-1))
            face = not isinstance(shape, Capsule)
            ends = [self.plane(up, half, face), self.plane(down, half, face)]
            self.pieces = [Piece((self.position, self.axes[2], radius), ends)]
            if isinstance(shape, Capsule):
                for s in (-1, 1):
                    self.pieces.append(Piece((plus(self.position, self.axes[2], s * half), None, radius), []))

    def turned(self, v: Vector) -> Vector:
        x, y, z = self.axes
        return plus(plus(scaled(x, v[0]), y, v[1]), z, v[2])

    def plane(self, normal: Vector, offset: arb, face: bool = True) -> tuple[Vector, arb, bool]:
        n = self.turned(normal)
        return n, offset + dot(n, self.position), face

    def rounded(self, shape: RoundedHull) -> list[Piece]:
        radius = number(float(shape.radius))
        faces = facets(shape.core.vertices)
        pieces = [Piece(None, [self.plane(n, offset, False) for n, offset, _ in faces])]
        edges: dict[frozenset, list] = {}
        for n, offset, ring in faces:
            planes = [self.plane(n, offset + radius), self.plane(scaled(n, arb(-1)), -offset, False)]
            for p, q in zip(ring, ring[1:] + ring[:1]):
                a, b = vector(exact.coordinates(p)), vector(exact.coordinates(q))
                side = unit(cross(plus(b, a, -1), n))
                planes.append(self.plane(side, dot(side, a), False))
                edges.setdefault(frozenset((p, q)), []).append((a, b))
            pieces.append(Piece(None, planes))
        corners = {}
        for (a, b), _ in edges.values():
            along = unit(plus(b, a, -1))
            ends = [
                self.plane(along, dot(along, b), False),
                self.plane(scaled(along, arb(-1)), -dot(along, a), False),
            ]
            pieces.append(Piece((plus(self.position, self.turned(a)), self.turned(along), radius), ends))
            corners[str(a)] = a
            corners[str(b)] = b
        for corner in corners.values():
            pieces.append(Piece((plus(self.position, self.turned(corner)), None, radius), []))
        return pieces


def facets(vertices: np.ndarray) -> list[tuple[Vector, arb, list]]:
    """Unit normals, offsets and rings of the convex hull."""
    found = []
    for facet in exact.hull(np.asarray(vertices).tolist()).facets:
        *normal, d = facet.plane
        n = vector(map(Fraction, normal))
        length = dot(n, n).sqrt()
        found.append((scaled(n, 1 / length), number(Fraction(-d)) / length, list(facet.ring)))
    return found


def doubles(v: Iterable[arb]) -> np.ndarray:
    return np.array([float(c.mid()) for c in v])


class Surfaces:
    """The surfaces of a solid as a ray from the point inside, x = inside + s * frame @ u, meets them."""

    def __init__(self, solid: Solid, inside: Vector, frame: np.ndarray) -> None:
        columns = [vector(frame[:, k]) for k in range(3)]
        self.pieces = []
        for piece in solid.pieces:
            quadric = None
            if piece.quadric:
                centre, axis, radius = piece.quadric
                from_centre = plus(inside, centre, -1)
                across = columns
                if axis is not None:
                    from_centre = plus(from_centre, axis, -dot(from_centre, axis))
                    across = [plus(c, axis, -dot(c, axis)) for c in columns]
                distance = dot(from_centre, from_centre).sqrt()
                # One of the orthogonal axes is the direction from the centre, so that no product cancels.
                basis = orthogonal(from_centre)
                quadric = (
                    np.array([doubles(dot(e, c) for c in across) for e in basis]),
                    doubles([distance])[0],
                    doubles([(distance - radius) * (distance + radius)])[0],
                )
            rates = np.array([doubles(dot(n, c) for c in columns) for n, _, _ in piece.planes]).reshape(-1, 3)
            slacks = doubles(offset - dot(n, inside) for n, offset, _ in piece.planes)
            self.pieces.append((quadric, rates, slacks))

    def exits(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """How far each ray goes, through which surface, and the gradient of that in the coordinates of u."""
        count = len(u)
        last, which, gradient = np.zeros(count), np.full(count, -1), np.zeros((count, 3))
        for i, (quadric, rates, slacks) in enumerate(self.pieces):
            low, high = np.full(count, -np.inf), np.full(count, np.inf)
            by, slope = np.full(count, -1), np.zeros((count, 3))
            if quadric:
                matrix, distance, constant = quadric
                d = u @ matrix.T
                a, h = np.einsum("ij,ij->i", d, d), distance * d[:, 0]
                discriminant = h * h - a * constant
                with np.errstate(invalid="ignore", divide="ignore"):
                    root = np.sqrt(discriminant)
                    far = -(h + np.copysign(root, h))
                    roots = constant / far, far / a
                    low, high = np.minimum(*roots), np.maximum(*roots)
                missed = ~(discriminant > 0)
                by[:] = 100 * i
                where = np.where(missed, 0, high)[:, None] * d
                where[:, 0] += distance
                slope = where @ matrix
                low[missed], high[missed] = np.inf, -np.inf
            if len(slacks):
                rate = u @ rates.T
                with np.errstate(divide="ignore", invalid="ignore"):
                    s = slacks / rate
                leaving = np.where(rate > 0, s, np.inf)
                entering = np.where(rate < 0, s, -np.inf)
                k = leaving.argmin(1)
                first = leaving[np.arange(count), k]
                sooner = first < high
                high = np.where(sooner, first, high)
                by = np.where(sooner, 100 * i + 1 + k, by)
                slope = np.where(sooner[:, None], rates[k], slope)
                low = np.maximum(low, entering.max(1))
            better = (high > np.maximum(low, last)) & (high > 0)
            last = np.where(better, high, last)
            which = np.where(better, by, which)
            gradient = np.where(better[:, None], slope, gradient)
        return last, which, gradient


def orthogonal(v: Vector) -> list[Vector]:
    """Orthonormal axes, the first of them along v."""
    if max(abs(float(c.mid())) for c in v) == 0:
        v = (arb(1), arb(0), arb(0))
    first = unit(v)
    least = int(np.argmin([abs(float(c.mid())) for c in first]))
    other = [arb(0), arb(0), arb(0)]
    other[least] = arb(1)
    second = unit(cross(first, (other[0], other[1], other[2])))
    return [first, second, cross(first, second)]


@dataclass
class Truth:
    volume: float
    error: float  # an estimate of the relative error of the quadrature
    centroid: np.ndarray
    inertia: np.ndarray
    pull: np.ndarray  # (2, 6): of either body, about its position
    area: float


class Rays:
    def __init__(self, a: Placed, b: Placed, inside: np.ndarray, frame: np.ndarray) -> None:
        point = vector(inside)
        self.bodies = [Surfaces(Solid(body), point, frame) for body in (a, b)]
        self.inverse = np.linalg.inv(frame)
        # Directions are counted from axes that are those of no body.
        self.tilt = np.linalg.qr(np.array([[3.0, 1, 2], [-1, 4, 1], [1, -2, 5]]))[0]

    def exits(self, phi: np.ndarray, z: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        r = np.sqrt((1 - z) * (1 + z))
        u = np.column_stack([r * np.cos(phi), r * np.sin(phi), np.full(len(phi), z)]) @ self.tilt
        (s, k, g), (t, m, h) = (body.exits(u) for body in self.bodies)
        first = s <= t
        return (
            u,
            np.where(first, s, t),
            np.where(first, k, 100000 + m),
            np.where(first[:, None], g, h),
        )

    def ring(self, z: float) -> tuple[tuple, np.ndarray]:
        """The surfaces along a circle of directions, and the integrals over it."""
        phi = 2 * np.pi * (np.arange(SAMPLES + 1) / SAMPLES + 0.37)
        ids = self.exits(phi, z)[2]
        cuts = list(self.changes(phi, ids, z))
        marks = np.sort(np.concatenate([cuts, phi[:1] + np.linspace(0, 2 * np.pi, 7)]))
        low, high = marks[:-1], marks[1:]
        keep = high - low > 1e-15
        low, high = low[keep], high[keep]
        nodes = (low[:, None] + (high - low)[:, None] * (1 + NODES) / 2).ravel()
        weights = ((high - low)[:, None] / 2 * WEIGHTS).ravel()
        signature = self.exits(np.array(sorted(cuts)) + 1e-9, z)[2] if cuts else ids[:1]
        shift = int(np.argmin(signature))
        return tuple(np.roll(signature, -shift).tolist()), weights @ self.terms(nodes, z)

    def changes(self, phi: np.ndarray, ids: np.ndarray, z: float):
        at = np.nonzero(ids[1:] != ids[:-1])[0]
        before, after, here = phi[at], phi[at + 1], ids[at]
        for _ in range(8):
            if not len(at):
                return
            p, q, then = before, after, self.exits(after, z)[2]
            for _ in range(STEPS // 4):
                tried = np.column_stack([p[:, None] + (q - p)[:, None] * np.arange(16) / 16, q])
                found = np.column_stack([self.exits(tried[:, 1:-1].ravel(), z)[2].reshape(-1, 15), then])
                rows, first = np.arange(len(at)), (found != here[:, None]).argmax(1)
                p, q, then = tried[rows, first], tried[rows, first + 1], found[rows, first]
            yield from q
            end = self.exits(after, z)[2]
            more = then != end
            at, before, after, here = at[more], q[more], after[more], then[more]

    def terms(self, phi: np.ndarray, z: float) -> np.ndarray:
        u, s, ids, g = self.exits(phi, z)
        second = u[:, [0, 1, 2, 1, 2, 0]] * u[:, [0, 1, 2, 2, 0, 1]]
        # The area vector in these coordinates: s² du g / (g · u).
        vector_area = (s * s / np.einsum("ij,ij->i", g, u))[:, None] * g
        place = s[:, None] * u
        first = (ids < 100000)[:, None]
        # Moments about the point inside, as the matrix place × area vector.
        outer = (place[:, :, None] * vector_area[:, None, :]).reshape(len(u), 9)
        in_world = np.linalg.norm(vector_area @ self.inverse, axis=1)
        return np.column_stack(
            [
                s**3 / 3,
                s[:, None] ** 4 / 4 * u,
                s[:, None] ** 5 / 5 * second,
                vector_area * first,
                outer * first,
                in_world,
            ]
        )


def over(f: Callable[[float], tuple[tuple, np.ndarray]], low: float, high: float, whole: float, depth: int = 0):
    """The integral of what is analytic but for roots at the ends, and its error."""
    half, middle = (high - low) / 2, (high + low) / 2

    def rule(nodes: np.ndarray, weights: np.ndarray) -> np.ndarray:
        theta = np.pi / 2 * (1 + nodes)
        values = [f(middle - half * np.cos(t))[1] for t in theta]
        return half * np.pi / 2 * (weights * np.sin(theta)) @ np.array(values)

    fine, coarse = rule(*FINE), rule(*COARSE)
    error = abs(fine[0] - coarse[0])
    if error <= AGREED * whole or depth >= 12:
        return fine, error
    left, right = over(f, low, middle, whole, depth + 1), over(f, middle, high, whole, depth + 1)
    return left[0] + right[0], left[1] + right[1]


def truth(a: Placed, b: Placed, found: Overlap) -> Truth:
    """The measures of the overlap of two bodies. `found` gives the approximate place and shape of the common part."""
    inside = np.array(found.centroid)
    second = np.trace(found.inertia) / 2 * np.eye(3) - found.inertia
    values, turn = np.linalg.eigh(second / found.volume)
    frame = turn * np.sqrt(np.maximum(values, values[-1] * 1e-13))
    rays = Rays(a, b, inside, frame)
    places = -np.cos(np.pi * np.arange(1, 40) / 40)
    seen = [rays.ring(z)[0] for z in places]
    marks = [-1.0]
    for p, q, here, there in zip(places, places[1:], seen, seen[1:]):
        while here != there:
            before, after, then = p, q, there
            for _ in range(STEPS):
                middle = (before + after) / 2
                now = rays.ring(middle)[0]
                if now == here:
                    before = middle
                else:
                    after, then = middle, now
            marks.append(after)
            p, here = after, then
    marks.append(1.0)
    whole = 4 * np.pi / 3 * 5**1.5 / 4  # about that of an ellipsoid with these moments
    parts = [over(rays.ring, p, q, whole) for p, q in itertools.pairwise(marks) if q > p]
    total = np.sum([part for part, _ in parts], axis=0)
    scale = abs(np.linalg.det(frame))
    volume = scale * total[0]
    middle = frame @ (total[1:4] / total[0])
    xx, yy, zz, yz, zx, xy = total[4:10] * scale
    second = frame @ np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]) @ frame.T - volume * np.outer(middle, middle)
    cofactor = scale * np.linalg.inv(frame).T
    pull = cofactor @ total[10:13]
    # ∫ x nᵀ dA about the point inside; its antisymmetric part is the moment.
    matrix = frame @ total[13:22].reshape(3, 3) @ cofactor.T
    moment = np.array([matrix[1, 2] - matrix[2, 1], matrix[2, 0] - matrix[0, 2], matrix[0, 1] - matrix[1, 0]])
    rows = []
    for body, side in ((a, 1), (b, -1)):
        arm = inside - np.array(body.position)
        rows.append(np.concatenate([side * pull, side * (moment + np.cross(arm, pull))]))
    return Truth(
        volume=float(volume),
        error=sum(float(e) for _, e in parts) / float(total[0]),
        centroid=inside + middle,
        inertia=np.trace(second) * np.eye(3) - second,
        pull=np.array(rows),
        area=float(scale * total[22]),
    )
