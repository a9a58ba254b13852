"""Measures of a ball, a cylinder or a capsule cut by a polyhedron, to twenty digits, by another route than the core's.

Slices are orthogonal to the round body's own axis. Each slice is a polygon cut by a disc about the origin; its area,
moments and borders have closed forms. Gauss-Legendre rules integrate them in sixty digits between the heights of all
corners of the common part. Finer rules check the results.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np
from flint import arb
from round_truth import Solid, Vector, axes_of, cross, dot, number, plus, scaled, unit, vector

from overlapper import Capsule, Placed, Sphere

Point = tuple[arb, arb]
ZERO, HALF = arb(0), arb(1) / 2
NODES, FEWER = 24, 16  # of a rule, and of the one that it is compared with
AGREED = 1e-15  # of the volume and of the area, by rules of which the finer is then right to some 1e-22
SLIVER = 1e-35  # of the size: rounding in sixty digits makes less


@dataclass
class Cut:
    """{ x : normal · x <= offset } in the axes of a piece; owned by a body unless it parts a body in two."""

    normal: Vector
    offset: arb
    by_polyhedron: bool


@dataclass
class Sums:
    """Integrals about the centre of a piece; of surfaces, those of the round body, but for the area, which has all."""

    volume: arb = ZERO
    area: arb = ZERO
    first: list[arb] = field(default_factory=lambda: [ZERO] * 3)
    second: list[arb] = field(default_factory=lambda: [ZERO] * 6)  # xx, yy, zz, yz, zx, xy
    force: list[arb] = field(default_factory=lambda: [ZERO] * 3)
    moment: list[arb] = field(default_factory=lambda: [ZERO] * 3)

    def numbers(self) -> list[arb]:
        return [self.volume, self.area, *self.first, *self.second, *self.force, *self.moment]


def square(x: arb) -> arb:
    """Not x**2, which is not a number where x may be 0."""
    return x * x


class Piece:
    """A ball, or a cylinder between planes across its axis, about the origin and along z, cut by planes."""

    def __init__(self, ball: bool, radius: arb, low: arb, high: arb, cuts: list[Cut]) -> None:
        self.ball, self.radius, self.low, self.high, self.cuts = ball, radius, low, high, cuts
        self.ends = (False, False)  # whether they are faces of the body

    def rho(self, z: arb) -> arb:
        rest = square(self.radius) - square(z) if self.ball else square(self.radius)
        return rest.sqrt() if rest > 0 else ZERO

    def outline(self, z: arb) -> list[tuple[Point, Point, int]]:
        """The polygon that the planes leave of a square around the disc: edges and the number of their plane."""
        far = 4 * self.radius
        square: list[Point] = [(-far, -far), (far, -far), (far, far), (-far, far)]
        edges = [(p, q, -1) for p, q in zip(square, square[1:] + square[:1])]
        for number_of_plane, cut in enumerate(self.cuts):
            x, y, rate = cut.normal
            if x * x + y * y < SLIVER**2:
                if cut.offset - rate * z < 0:
                    return []
                continue
            slack = [cut.offset - rate * z - x * p[0] - y * p[1] for p, _, _ in edges]
            kept: list[tuple[Point, Point, int]] = []
            entry = exit_point = None
            for (p, q, which), here, there in zip(edges, slack, slack[1:] + slack[:1]):
                inside, next_inside = here > 0, there > 0
                if inside and next_inside:
                    kept.append((p, q, which))
                elif inside or next_inside:
                    share = here / (here - there)
                    middle = (p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1]))
                    if inside:
                        kept.append((p, middle, which))
                        exit_point = middle
                        mark = len(kept)
                    else:
                        kept.append((middle, q, which))
                        entry = middle
            if entry is not None and exit_point is not None:
                kept.insert(mark, (exit_point, entry, number_of_plane))
            edges = kept
            if not edges:
                return []
        return edges

    def slice(self, z: arb) -> Sums:
        """The sums that a slice at height z adds per unit of z."""
        sums, rho = Sums(), self.rho(z)
        edges = self.outline(z)
        if not edges or rho == 0:
            return sums
        parts: list[tuple[Point, Point, int]] = []  # of lines, within the disc
        for p, q, which in edges:
            d = (q[0] - p[0], q[1] - p[1])
            a, h = square(d[0]) + square(d[1]), p[0] * d[0] + p[1] * d[1]
            c = square(p[0]) + square(p[1]) - square(rho)
            discriminant = h * h - a * c
            if not discriminant > 0:
                continue
            root = discriminant.sqrt()
            low, high = (-h - root) / a, (-h + root) / a
            low, high = (low if low > 0 else ZERO), (high if high < 1 else arb(1))
            if not low < high:
                continue
            at = [(p[0] + s * d[0], p[1] + s * d[1]) for s in (low, high)]
            parts.append((at[0], at[1], which))
        arcs: list[tuple[Point, Point]] = []
        whole = False
        if parts:
            for (_, end, _), (start, _, _) in zip(parts, parts[1:] + parts[:1]):
                if square(end[0] - start[0]) + square(end[1] - start[1]) > square(SLIVER * self.radius):
                    arcs.append((end, start))
        else:
            whole = all(p[0] * q[1] - p[1] * q[0] > 0 for p, q, _ in edges)
            if not whole:
                return sums
        self.add_lines(parts, z, sums)
        for p, q in arcs:
            self.add_arc(p, q, rho, z, sums)
        if whole:
            self.add_turn(rho, z, sums)
        sums.first[2] = z * sums.volume
        sums.second[2] = z * z * sums.volume
        sums.second[3], sums.second[4] = z * sums.first[1], z * sums.first[0]
        return sums

    def add_lines(self, parts: list[tuple[Point, Point, int]], z: arb, sums: Sums) -> None:
        for p, q, which in parts:
            twice = p[0] * q[1] - p[1] * q[0]
            sums.volume += twice / 2
            sums.first[0] += twice * (p[0] + q[0]) / 6
            sums.first[1] += twice * (p[1] + q[1]) / 6
            sums.second[0] += twice * (square(p[0]) + p[0] * q[0] + square(q[0])) / 12
            sums.second[1] += twice * (square(p[1]) + p[1] * q[1] + square(q[1])) / 12
            sums.second[5] += twice * (2 * p[0] * p[1] + p[0] * q[1] + q[0] * p[1] + 2 * q[0] * q[1]) / 24
            if which >= 0 and self.cuts[which].by_polyhedron:
                normal = self.cuts[which].normal
                length = (square(q[0] - p[0]) + square(q[1] - p[1])).sqrt()
                sums.area += length / (square(normal[0]) + square(normal[1])).sqrt()

    def add_arc(self, p: Point, q: Point, rho: arb, z: arb, sums: Sums) -> None:
        start = arb.atan2(p[1], p[0])
        turn = arb.atan2(p[0] * q[1] - p[1] * q[0], p[0] * q[0] + p[1] * q[1])
        if turn < 0:
            turn += 2 * arb.pi()
        end = start + turn
        self.add_sector(start, end, rho, z, sums)

    def add_turn(self, rho: arb, z: arb, sums: Sums) -> None:
        self.add_sector(ZERO, 2 * arb.pi(), rho, z, sums)

    def add_sector(self, start: arb, end: arb, rho: arb, z: arb, sums: Sums) -> None:
        turn = end - start
        cosine, sine = end.sin() - start.sin(), start.cos() - end.cos()  # ∫ cos, ∫ sin
        double = ((2 * end).sin() - (2 * start).sin()) / 4
        sums.volume += square(rho) * turn / 2
        sums.first[0] += rho**3 * cosine / 3
        sums.first[1] += rho**3 * sine / 3
        sums.second[0] += rho**4 / 4 * (turn / 2 + double)
        sums.second[1] += rho**4 / 4 * (turn / 2 - double)
        sums.second[5] += rho**4 / 4 * (square(end.sin()) - square(start.sin())) / 2
        # On a ball, the width of a strip between two slices is its height times radius / rho.
        sums.area += self.radius * turn
        force = [rho * cosine, rho * sine, z * turn if self.ball else ZERO]
        for k in range(3):
            sums.force[k] += force[k]
        if not self.ball:
            sums.moment[0] += -z * force[1]
            sums.moment[1] += z * force[0]

    def marks(self) -> list[arb]:
        """All values of z at which a corner or an extremal point of the common part lies, and the ends."""
        points: list[Vector] = []
        for a, b in itertools.combinations(self.cuts, 2):
            along = cross(a.normal, b.normal)
            length2 = dot(along, along)
            if length2 < SLIVER**2:
                continue
            p = scaled(plus(scaled(cross(b.normal, along), a.offset), cross(along, a.normal), b.offset), 1 / length2)
            for c in self.cuts:
                rate = dot(c.normal, along)
                if c is a or c is b or abs(rate) < SLIVER:
                    continue
                points.append(plus(p, along, (c.offset - dot(c.normal, p)) / rate))
            flat = 3 if self.ball else 2
            f, g = p[:flat], along[:flat]
            points += [plus(p, along, s) for s in self.roots(f, g)]
            for end in () if self.ball else (self.low, self.high):
                if abs(along[2]) > SLIVER:
                    points.append(plus(p, along, (end - p[2]) / along[2]))
        for cut in self.cuts:
            x, y, rate = cut.normal
            flat2 = x * x + y * y
            if flat2 < SLIVER**2:
                if abs(rate) > SLIVER:
                    points.append((ZERO, ZERO, cut.offset / rate))
                continue
            across = (x / flat2.sqrt(), y / flat2.sqrt(), ZERO)
            if self.ball:
                # The highest and the lowest point of the circle that the plane cuts from the ball.
                centre = scaled(cut.normal, cut.offset)
                rest = square(self.radius) - square(cut.offset)
                if rest > 0:
                    up = unit((-rate * x, -rate * y, flat2))
                    points += [plus(centre, up, s * rest.sqrt()) for s in (-1, 1)]
            else:
                for s in (-1, 1):
                    foot = scaled(across, s * self.radius)
                    if abs(rate) > SLIVER:
                        points.append(plus(foot, (ZERO, ZERO, arb(1)), (cut.offset - dot(cut.normal, foot)) / rate))
        valid = [p[2] for p in points if self.holds(p)]
        values = [self.low, self.high, *valid]
        return sorted((v for v in values if not (v < self.low or v > self.high)), key=lambda v: v.mid())

    def roots(self, p, d) -> list[arb]:
        a, h = sum((u * u for u in d), ZERO), sum((u * v for u, v in zip(p, d)), ZERO)
        c = sum((u * u for u in p), ZERO) - square(self.radius)
        discriminant = h * h - a * c
        if not discriminant > 0 or not a > SLIVER**2:
            return []
        root = discriminant.sqrt()
        return [(-h - root) / a, (-h + root) / a]

    def holds(self, p: Vector) -> bool:
        size = SLIVER * (self.radius + abs(self.low) + abs(self.high)) * 1e3
        for cut in self.cuts:
            if dot(cut.normal, p) - cut.offset > size:
                return False
        flat = p if self.ball else p[:2]
        outside = sum((c * c for c in flat), ZERO).sqrt() - self.radius
        # The middle of a plane across stands for all of it.
        return not outside > size or (p[0] == 0 and p[1] == 0)

    def integrals(self) -> list[arb]:
        total = [ZERO] * len(Sums().numbers())
        marks = self.marks()
        for low, high in itertools.pairwise(marks):
            if not high - low > SLIVER * self.radius:
                continue
            middle = self.slice((low + high) / 2)
            if middle.volume == 0:
                continue
            total = [t + v for t, v in zip(total, self.over(low, high, total[:2]))]
            for cut in self.cuts:
                # A plane across the axis has a face where a slice lies in it.
                if square(cut.normal[0]) + square(cut.normal[1]) < SLIVER**2 and cut.by_polyhedron:
                    at = cut.offset / cut.normal[2]
                    for end, side in ((low, -1), (high, 1)):
                        if abs(end - at) < SLIVER * self.radius and side * cut.normal[2] > 0:
                            total[1] += self.slice(end).volume
        for end, face, side in zip((self.low, self.high), self.ends, (-1, 1)):
            if face:
                disc = self.slice(end)
                total[1] += disc.volume
                total[13] += side * disc.volume
                total[14] += side * disc.first[1]
                total[15] -= side * disc.first[0]
        return total

    def over(self, low: arb, high: arb, whole: list[arb], halvings: int = 0) -> list[arb]:
        fine, coarse = self.rule(low, high, NODES), self.rule(low, high, FEWER)
        whole = [max(w, f, key=lambda v: v.mid()) for w, f in zip(whole, fine[:2])]
        if halvings > 60 or all(abs(f - c) <= AGREED * w for f, c, w in zip(fine, coarse, whole)):
            return fine
        middle = (low + high) / 2
        left = self.over(low, middle, whole, halvings + 1)
        right = self.over(middle, high, whole, halvings + 1)
        return [p + q for p, q in zip(left, right)]

    def rule(self, low: arb, high: arb, count: int) -> list[arb]:
        total = [ZERO] * len(Sums().numbers())
        half, middle = (high - low) / 2, (high + low) / 2
        for node, weight in gauss(count):
            theta = arb.pi() / 2 * (1 + node)
            factor = half * arb.pi() / 2 * weight * theta.sin()
            values = self.slice(middle - half * theta.cos()).numbers()
            total = [t + factor * v for t, v in zip(total, values)]
        return total


RULES: dict[int, list[tuple[arb, arb]]] = {}


def gauss(count: int) -> list[tuple[arb, arb]]:
    if count not in RULES:
        RULES[count] = [arb.legendre_p_root(count, k, weight=True) for k in range(count)]
    return RULES[count]


@dataclass
class Exact:
    volume: float
    area: float
    centroid: np.ndarray
    inertia: np.ndarray
    gradient: np.ndarray  # (6,): of the round body, about its position


def exactly(round_body: Placed, polyhedron: Placed) -> Exact:
    """The measures of a sphere, capsule or cylinder and a box, hull or half-space."""
    axes, centre = axes_of(round_body), vector(round_body.position)
    shape = round_body.shape
    radius = number(float(shape.radius))
    if isinstance(shape, Sphere):
        # No axis of a ball is its own; slices should not be parallel to a face.
        axes = axes_of(Placed(shape, orientation=(0.31, -0.47, 0.59, 0.58)))
    planes = [Cut(n, offset, True) for n, offset, _ in Solid(polyhedron).pieces[0].planes]
    total = [ZERO] * len(Sums().numbers())
    half = ZERO if isinstance(shape, Sphere) else number(float(shape.length)) / 2
    # Whether it is a ball, where its centre is along the axis, and between which values it lies.
    parts = [(True, ZERO, -radius, radius)]
    if not isinstance(shape, Sphere):
        parts = [(False, ZERO, -half, half)]
    if isinstance(shape, Capsule):
        parts += [(True, half, ZERO, radius), (True, -half, -radius, ZERO)]
    for ball, along, low, high in parts:
        at = plus(centre, axes[2], along)
        cuts = []
        for cut in planes:
            normal = tuple(dot(cut.normal, axis) for axis in axes)
            cuts.append(Cut((normal[0], normal[1], normal[2]), cut.offset - dot(cut.normal, at), True))
        piece = Piece(ball, radius, low, high, cuts)
        if not ball and not isinstance(shape, Capsule):
            piece.ends = (True, True)
        total = [t + v for t, v in zip(total, about_body(piece.integrals(), along))]
    return in_world(total, axes, centre)


def about_body(sums: list[arb], along: arb) -> list[arb]:
    """Moments about the centre of the body, from moments about the axis point `along` away from it."""
    volume, area, x, y, z, xx, yy, zz, yz, zx, xy, fx, fy, fz, mx, my, mz = sums
    return [
        *(volume, area, x, y, z + along * volume, xx, yy, zz + 2 * along * z + square(along) * volume),
        *(yz + along * y, zx + along * x, xy, fx, fy, fz, mx - along * fy, my + along * fx, mz),
    ]


def in_world(sums: list[arb], axes: tuple[Vector, Vector, Vector], centre: Vector) -> Exact:
    volume, area = sums[0], sums[1]
    middle = [c / volume for c in sums[2:5]]
    xx, yy, zz, yz, zx, xy = sums[5:11]
    second = [[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]
    for i, j in itertools.product(range(3), repeat=2):
        second[i][j] -= volume * middle[i] * middle[j]
    turn = lambda v: plus(plus(scaled(axes[0], v[0]), axes[1], v[1]), axes[2], v[2])  # noqa: E731
    columns = [turn([second[i][j] for i in range(3)]) for j in range(3)]
    world = [turn([columns[j][i] for j in range(3)]) for i in range(3)]
    trace = xx + yy + zz - volume * sum((c * c for c in middle), ZERO)
    inertia = [[(trace if i == j else ZERO) - world[i][j] for j in range(3)] for i in range(3)]
    doubles = lambda row: [float(c.mid()) for c in row]  # noqa: E731
    return Exact(
        volume=float(volume.mid()),
        area=float(area.mid()),
        centroid=np.array(doubles(plus(centre, turn(middle)))),
        inertia=np.array([doubles(row) for row in inertia]),
        gradient=np.array(doubles(turn(sums[11:14])) + doubles(turn(sums[14:17]))),
    )
