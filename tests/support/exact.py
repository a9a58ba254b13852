"""The common part of convex polytopes in rational arithmetic: the truth that doubles are measured against.

A double is a rational number. Hulls of doubles, their intersections and the integrals over them are therefore rational
too, and are computed here without any rounding.

A point is a tuple of integers (x, y, z, w), w > 0, that stands for (x/w, y/w, z/w). A plane is a tuple of integers
(a, b, c, d) with a x + b y + c z + d w <= 0 inside. Both are divided by their greatest common divisor, so that equal
points and equal planes are equal tuples.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import combinations, pairwise
from math import gcd, lcm, sqrt

Point = tuple[int, int, int, int]
Plane = tuple[int, int, int, int]
Vector = tuple[Fraction, Fraction, Fraction]
Ring = tuple[Point, ...]

NAMES = {-1: "empty", 0: "point", 1: "segment", 2: "polygon", 3: "solid"}


def primitive(row: Sequence[int]) -> tuple[int, int, int, int]:
    divisor = gcd(*row)
    return (row[0] // divisor, row[1] // divisor, row[2] // divisor, row[3] // divisor)


def point(xyz: Iterable[float | Fraction | int]) -> Point:
    x, y, z = vector(xyz)
    w = lcm(x.denominator, y.denominator, z.denominator)
    return (int(x * w), int(y * w), int(z * w), w)


def coordinates(p: Point) -> Vector:
    return Fraction(p[0], p[3]), Fraction(p[1], p[3]), Fraction(p[2], p[3])


def side(plane: Plane, p: Point) -> int:
    """Negative inside, zero on the plane, positive outside."""
    return plane[0] * p[0] + plane[1] * p[1] + plane[2] * p[2] + plane[3] * p[3]


def plane_through(p: Point, q: Point, r: Point) -> Plane | None:
    """The plane of p, q, r, seen counter-clockwise from its positive side; None if they are collinear."""
    px, py, pz, pw = p
    ux, uy, uz = q[0] * pw - px * q[3], q[1] * pw - py * q[3], q[2] * pw - pz * q[3]
    vx, vy, vz = r[0] * pw - px * r[3], r[1] * pw - py * r[3], r[2] * pw - pz * r[3]
    a, b, c = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    if a == b == c == 0:
        return None
    return primitive((a * pw, b * pw, c * pw, -(a * px + b * py + c * pz)))


def halfspace(normal: Iterable[float | Fraction], offset: float | Fraction) -> Plane:
    """{ x : normal . x <= offset }, the normal of any length."""
    row = [Fraction(c) if isinstance(c, Fraction) else Fraction(float(c)) for c in (*normal, offset)]
    scale = lcm(*(c.denominator for c in row))
    return primitive([int(c * scale) for c in row[:3]] + [-int(row[3] * scale)])


def crossing(plane: Plane, inside: Point, outside: Point) -> Point:
    """Where the segment between two points on different sides meets the plane."""
    s, t = side(plane, outside), -side(plane, inside)
    return primitive([s * i + t * o for i, o in zip(inside, outside, strict=True)])


@dataclass(frozen=True)
class Facet:
    plane: Plane
    ring: Ring  # counter-clockwise from outside
    owners: tuple[int, ...] = (0,)  # every body that has this plane


@dataclass(frozen=True)
class Polytope:
    """A closed convex set: a solid by its facets, anything less by its vertices in order."""

    dimension: int  # -1 empty, 0 point, 1 segment, 2 polygon, 3 solid
    vertices: Ring
    facets: tuple[Facet, ...] = ()

    def __repr__(self) -> str:
        return f"<exact {NAMES[self.dimension]}, {len(self.vertices)} vertices, {len(self.facets)} facets>"

    @property
    def planes(self) -> list[Plane]:
        return [facet.plane for facet in self.facets]

    @property
    def tetrahedra(self) -> Iterator[tuple[Fraction, tuple[Vector, Vector, Vector]]]:
        """Six times the volume, and the edges from the first vertex, of tetrahedra that fill the solid."""
        arm = {v: subtract(coordinates(v), coordinates(self.vertices[0])) for v in self.vertices}
        for facet in self.facets:
            if self.vertices[0] not in facet.ring:
                for q, r in pairwise(facet.ring[1:]):
                    edges = (arm[facet.ring[0]], arm[q], arm[r])
                    yield dot(edges[0], cross(edges[1], edges[2])), edges

    @cached_property
    def volume(self) -> Fraction:
        return total(six for six, _ in self.tetrahedra) / 6

    @cached_property
    def centroid(self) -> Vector:
        """The centroid of a solid polytope; for a single point, the point itself."""
        if self.dimension == 0:
            return coordinates(self.vertices[0])
        origin = coordinates(self.vertices[0])
        parts = list(self.tetrahedra)
        moment = [total(six * (p[i] + q[i] + r[i]) for six, (p, q, r) in parts) for i in range(3)]
        x, y, z = (origin[i] + moment[i] / (24 * self.volume) for i in range(3))
        return x, y, z

    @cached_property
    def inertia(self) -> list[list[Fraction]]:
        """The inertia tensor about the centroid at unit density."""
        arm = subtract(self.centroid, coordinates(self.vertices[0]))
        parts = [(six, edges, add(add(edges[0], edges[1]), edges[2])) for six, edges in self.tetrahedra]

        def moment(i: int, j: int) -> Fraction:
            products = (six * (s[i] * s[j] + sum((e[i] * e[j] for e in edges), Fraction(0))) for six, edges, s in parts)
            return total(products) / 120 - self.volume * arm[i] * arm[j]

        upper = {(i, j): moment(i, j) for i in range(3) for j in range(i, 3)}
        second = [[upper[min(i, j), max(i, j)] for j in range(3)] for i in range(3)]
        trace = second[0][0] + second[1][1] + second[2][2]
        return [[(trace if i == j else 0) - second[i][j] for j in range(3)] for i in range(3)]

    @cached_property
    def area(self) -> float:
        """The surface area: a sum of square roots, each rounded once."""
        return sum(sqrt(dot(vector, vector)) for vector in map(area_vector, self.facets))

    def pull(self, body: int) -> Vector:
        """Sum of the area vectors of the facets of one body: d volume / d translation of that body."""
        return total_vector(area_vector(facet) for facet in self.facets if body in facet.owners)

    def moment(self, body: int, about: Vector) -> Vector:
        """Sum over the facets of one body of ∫ (x - about) × n dA: d volume / d rotation vector of it about there."""
        return total_vector(moment_of(facet, about) for facet in self.facets if body in facet.owners)

    def contains(self, xyz: Iterable[float | Fraction]) -> bool:
        p = point(xyz)
        return all(side(plane, p) <= 0 for plane in self.planes)


def vector(xyz: Iterable[float | Fraction]) -> Vector:
    x, y, z = (Fraction(c) if isinstance(c, (int, Fraction)) else Fraction(float(c)) for c in xyz)
    return x, y, z


def total(terms: Iterable[Fraction]) -> Fraction:
    """Their sum. Added in pairs, pairs of pairs and so on: the denominators, whose common multiple grows with every
    addition, stay short for all but the last few."""
    row = list(terms) or [Fraction(0)]
    while len(row) > 1:
        row = [u + v for u, v in zip(row[::2], row[1::2])] + row[len(row) & ~1 :]
    return row[0]


def total_vector(terms: Iterable[Vector]) -> Vector:
    x, y, z = zip(*terms, strict=True) if (terms := list(terms)) else ((), (), ())
    return total(x), total(y), total(z)


def add(u: Vector, v: Vector) -> Vector:
    return u[0] + v[0], u[1] + v[1], u[2] + v[2]


def subtract(u: Vector, v: Vector) -> Vector:
    return u[0] - v[0], u[1] - v[1], u[2] - v[2]


def dot(u: Vector, v: Vector) -> Fraction:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def cross(u: Vector, v: Vector) -> Vector:
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


def area_vector(facet: Facet) -> Vector:
    corners = [coordinates(p) for p in facet.ring]
    total = (Fraction(0), Fraction(0), Fraction(0))
    for q, r in pairwise(corners[1:]):
        total = add(total, cross(subtract(q, corners[0]), subtract(r, corners[0])))
    return total[0] / 2, total[1] / 2, total[2] / 2


def moment_of(facet: Facet, about: Vector) -> Vector:
    """∫ (x - about) × n dA over a facet, triangle by triangle of its fan."""
    corners = [subtract(coordinates(p), about) for p in facet.ring]
    total = (Fraction(0), Fraction(0), Fraction(0))
    for q, r in pairwise(corners[1:]):
        twice = cross(subtract(q, corners[0]), subtract(r, corners[0]))
        total = add(total, cross(add(add(corners[0], q), r), twice))
    return total[0] / 6, total[1] / 6, total[2] / 6


# The hull of points


def barycentric(ring: Ring, k: int, at: Vector) -> Fraction:
    """The coordinate of a point in the plane of a triangle: 1 at corner k, 0 at the other corners."""
    a, b, c = (coordinates(ring[(k + i) % 3]) for i in range(3))
    normal = cross(subtract(b, a), subtract(c, a))
    return dot(cross(subtract(c, b), subtract(at, b)), normal) / dot(normal, normal)


def triangles_of(whole: Polytope, part: Polytope, owner: int) -> Iterator[tuple[Ring, list[Vector]]]:
    """The corners of each triangle of `whole`, and those of the facet of `part` in it, if the owner has it alone."""
    ring_of = {facet.plane: facet.ring for facet in whole.facets}
    for facet in part.facets:
        if facet.owners == (owner,):
            yield ring_of[facet.plane], [coordinates(p) for p in facet.ring]


def hull(points: Iterable[Iterable[float | Fraction]]) -> Polytope:
    """The convex hull of points that are not all in one plane, grown by one point at a time."""
    cloud = list(dict.fromkeys(point(p) for p in points))
    triangles = first_simplex(cloud)
    for p in cloud:
        # Strict visibility is the visibility from p moved by an infinitesimal towards the inside: what is
        # seen is a disc, and a triangle that p only continues in its own plane stays.
        visible = [t for t, plane in triangles.items() if side(plane, p) > 0]
        edges = {edge for t in visible for edge in edges_of(t)}
        for t in visible:
            del triangles[t]
        for u, v in edges:
            if (v, u) not in edges:
                plane = plane_through(u, v, p)
                assert plane is not None
                triangles[u, v, p] = plane
    return merged(triangles)


def checked_hull(points: Iterable[Iterable[float]], suggestion: Iterable[Sequence[int]]) -> Polytope:
    """The convex hull of many points, from triangles (indices) that somebody suggests.

    A closed surface that has a point on the inner side of all its triangles, that a ray from there leaves once, and
    that is convex along every edge bounds a convex set. Here every point must be a vertex of it.
    """
    cloud = [point(p) for p in points]
    far = [coordinates(cloud[i]) for i in range(0, len(cloud), max(1, len(cloud) // 8))]
    x, y, z = (total(p[i] for p in far) / len(far) for i in range(3))
    middle, target = point((x, y, z)), point((x + 17, y + 19, z + 23))
    triangles: dict[Ring, Plane] = {}
    for a, b, c in suggestion:
        p, q, r = cloud[a], cloud[b], cloud[c]
        plane = plane_through(p, q, r)
        assert plane is not None and side(plane, middle) != 0
        if side(plane, middle) > 0:
            q, r, plane = r, q, (-plane[0], -plane[1], -plane[2], -plane[3])
        triangles[p, q, r] = plane
    beyond = {edge: plane for triangle, plane in triangles.items() for edge in edges_of(triangle)}
    assert len(beyond) == 3 * len(triangles) and {p for p, _ in beyond} == set(cloud)
    for triangle in triangles:
        for (u, v), apex in zip(edges_of(triangle), (triangle[2], triangle[0], triangle[1]), strict=True):
            assert side(beyond[v, u], apex) <= 0

    def met(u: Point, v: Point) -> bool:
        plane = plane_through(middle, u, v)
        return plane is not None and side(plane, target) >= 0

    assert sum(all(met(u, v) for u, v in edges_of(triangle)) for triangle in triangles) == 1
    return merged(triangles)


def edges_of(ring: Ring) -> Iterator[tuple[Point, Point]]:
    return zip(ring, ring[1:] + ring[:1], strict=True)


def first_simplex(cloud: list[Point]) -> dict[Ring, Plane]:
    p, q = (cloud + cloud)[:2]
    r = next((r for r in cloud if plane_through(p, q, r) is not None), p)
    base = plane_through(p, q, r)
    s = next((s for s in cloud if base is not None and side(base, s) != 0), None)
    if base is None or s is None:
        raise ValueError("points: all in one plane")
    if side(base, s) > 0:
        q, r = r, q
    faces = [(p, q, r), (p, s, q), (q, s, r), (r, s, p)]
    return {face: plane for face in faces if (plane := plane_through(*face)) is not None}


def merged(triangles: dict[Ring, Plane]) -> Polytope:
    """Facets from triangles: those of one plane joined, vertices inside a facet or an edge dropped."""
    patches: dict[Plane, set[tuple[Point, Point]]] = defaultdict(set)
    around: dict[Point, set[Plane]] = defaultdict(set)
    for triangle, plane in triangles.items():
        patches[plane].update(edges_of(triangle))
        for p in triangle:
            around[p].add(plane)
    facets = []
    for plane, edges in patches.items():
        ring = chained({u: v for u, v in edges if (v, u) not in edges})
        facets.append(Facet(plane, tuple(p for p in ring if len(around[p]) > 2)))
    return Polytope(3, tuple(p for p, planes in around.items() if len(planes) > 2), tuple(facets))


def chained(following: dict[Point, Point]) -> Ring:
    first = next(iter(following))
    ring = [first]
    while (p := following[ring[-1]]) != first:
        ring.append(p)
    assert len(ring) == len(following)
    return tuple(ring)


# The first way to intersect: one polytope clipped by the planes of the others


def clipped(body: Polytope, plane: Plane, owner: int) -> Polytope:
    """The part of a polytope on the inner side of a plane, that side closed."""
    at = {p: side(plane, p) for p in body.vertices}
    if all(s <= 0 for s in at.values()):
        owners = tuple(Facet(f.plane, f.ring, (*f.owners, owner)) if f.plane == plane else f for f in body.facets)
        return Polytope(body.dimension, body.vertices, owners)
    if all(s >= 0 for s in at.values()):
        return flat(touched_ring(body, at))
    if body.dimension < 3:
        return flat(clipped_ring(body.vertices, plane, at))
    facets = []
    for facet in body.facets:
        if any(at[p] < 0 for p in facet.ring):
            facets.append(Facet(facet.plane, clipped_ring(facet.ring, plane, at), facet.owners))
    facets.append(Facet(plane, cap(facets, plane), (owner,)))
    return Polytope(3, tuple(dict.fromkeys(p for f in facets for p in f.ring)), tuple(facets))


def clipped_ring(ring: Ring, plane: Plane, at: dict[Point, int]) -> Ring:
    kept = []
    for u, v in edges_of(ring):
        if at[u] <= 0:
            kept.append(u)
        if at[u] < 0 < at[v]:
            kept.append(crossing(plane, u, v))
        elif at[v] < 0 < at[u]:
            kept.append(crossing(plane, v, u))
    return tuple(dict.fromkeys(kept))


def touched_ring(body: Polytope, at: dict[Point, int]) -> Ring:
    """The face of a polytope that lies on a plane which has all the rest outside."""
    on = tuple(p for p in body.vertices if at[p] == 0)
    if len(on) < 3:
        return on
    return next(facet.ring for facet in body.facets if all(at[p] == 0 for p in facet.ring))


def cap(facets: list[Facet], plane: Plane) -> Ring:
    """The ring that closes clipped facets: their edges on the plane, run the other way."""
    on = {p for facet in facets for p in facet.ring if side(plane, p) == 0}
    return chained({v: u for facet in facets for u, v in edges_of(facet.ring) if u in on and v in on})


def flat(ring: Ring) -> Polytope:
    return Polytope(min(len(ring), 3) - 1, ring)


def common(*bodies: Polytope) -> Polytope:
    """The intersection of solids. Facets know their owners by the position of the body in the call."""
    part = bodies[0]
    for owner, body in enumerate(bodies[1:], start=1):
        for plane in body.planes:
            part = clipped(part, plane, owner)
    return part


# The second way: all points where three planes meet, kept if no plane has them outside


def common_by_enumeration(*bodies: Polytope) -> Polytope:
    """The intersection of small solids by nothing but the definition of a vertex."""
    owners: dict[Plane, list[int]] = defaultdict(list)
    for owner, body in enumerate(bodies):
        for plane in body.planes:
            owners[plane].append(owner)
    corners = {p for three in combinations(owners, 3) if (p := meeting_point(*three)) is not None}
    vertices = tuple(p for p in corners if all(side(plane, p) <= 0 for plane in owners))
    facets = []
    for plane, names in owners.items():
        on = [p for p in vertices if side(plane, p) == 0]
        if len(on) > 2:
            facets.append(Facet(plane, sorted_ring(plane, on), tuple(names)))
    if len(vertices) < 4 or any(set(f.ring) == set(vertices) for f in facets):
        return flat(facets[0].ring if len(vertices) > 2 else vertices)
    # A plane that touches the solid in an edge has two vertices, so every facet gathered above is a true one.
    return Polytope(3, vertices, tuple(facets))


def meeting_point(p: Plane, q: Plane, r: Plane) -> Point | None:
    def minor(i: int, j: int, k: int) -> int:
        return (
            p[i] * (q[j] * r[k] - q[k] * r[j]) - p[j] * (q[i] * r[k] - q[k] * r[i]) + p[k] * (q[i] * r[j] - q[j] * r[i])
        )

    w = minor(0, 1, 2)
    if w == 0:
        return None
    row = (-minor(1, 2, 3), minor(0, 2, 3), -minor(0, 1, 3), w)
    return primitive(row if w > 0 else [-c for c in row])


def sorted_ring(plane: Plane, on: list[Point]) -> Ring:
    """Vertices of a convex polygon in counter-clockwise order: each edge has all others on its left."""
    normal = (Fraction(plane[0]), Fraction(plane[1]), Fraction(plane[2]))
    at = {p: coordinates(p) for p in on}

    def leads(u: Point, v: Point) -> bool:
        inward = cross(normal, subtract(at[v], at[u]))
        return all(dot(inward, subtract(at[p], at[u])) > 0 for p in on if p not in (u, v))

    return chained({u: v for u in on for v in on if u != v and leads(u, v)})


# Poses, distance and depth


def placed(
    points: Iterable[Iterable[float | Fraction]],
    position: Sequence[float | Fraction] = (0, 0, 0),
    orientation: Sequence[float | Fraction] = (0, 0, 0, 1),
) -> list[Vector]:
    """Points turned by a quaternion (x, y, z, w) of any length, then moved. R |q|^2 is quadratic in q: rational."""
    x, y, z, w = map(Fraction, orientation)
    axis, square = (x, y, z), x * x + y * y + z * z + w * w
    shift = vector(position)
    moved = []
    for p in map(vector, points):
        once = cross(axis, p)
        twice = cross(axis, once)
        turned = [p[i] + 2 * (w * once[i] + twice[i]) / square for i in range(3)]
        moved.append((turned[0] + shift[0], turned[1] + shift[1], turned[2] + shift[2]))
    return moved


def difference(a: Polytope, b: Polytope) -> Polytope:
    """The hull of all p - q, p of a and q of b: it holds the origin exactly if the two have a point in common."""
    return hull(subtract(coordinates(p), coordinates(q)) for p in a.vertices for q in b.vertices)


def depth_squared(a: Polytope, b: Polytope) -> Fraction:
    """The square of the least translation after which two solids share no inner point; zero if they share none now."""
    planes = difference(a, b).planes
    if any(d >= 0 for *_, d in planes):
        return Fraction(0)
    return min(Fraction(d * d, a * a + b * b + c * c) for a, b, c, d in planes)


def distance_squared(a: Polytope, b: Polytope) -> Fraction:
    """The square of the distance of two solids; zero if they have a point in common."""
    gap = difference(a, b)
    if all(d <= 0 for *_, d in gap.planes):
        return Fraction(0)
    nearest = [dot(v, v) for v in map(coordinates, gap.vertices)]
    for facet in gap.facets:
        corners = [coordinates(p) for p in facet.ring]
        normal = vector(facet.plane[:3])
        overhead = True
        for u, v in zip(corners, corners[1:] + corners[:1], strict=True):
            along = subtract(v, u)
            length = dot(along, along)
            if 0 < -dot(u, along) < length:
                foot = cross(u, along)
                nearest.append(dot(foot, foot) / length)
            overhead = overhead and dot(cross(normal, along), u) <= 0
        if overhead:
            nearest.append(facet.plane[3] ** 2 / dot(normal, normal))
    return min(nearest)
