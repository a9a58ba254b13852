"""The claims of a certificate about the common part of bodies, and their check in rational arithmetic.

A check trusts the numbers that define the bodies (see `overlapper.proof.rational_body`), the exact functions of
`overlapper.shapes`, and this module. It trusts neither the core nor the search that found the certificate. It raises
`CertificateError` with the first claim that fails, and returns (lower, upper) bounds of the common volume, in m³, as
fractions. All coordinates are in m in the world.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, is_dataclass
from decimal import Decimal
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from overlapper import Placed
from overlapper.install import hint
from overlapper.proof.rational_body import RationalBody
from overlapper.proof.refusal import Bounds as Bounds
from overlapper.proof.refusal import CertificateError as CertificateError
from overlapper.rational import Exact, fans, integers, is_closed, root, triple
from overlapper.shapes.planes import AXES

# Bits below 1 to which shares of single cones are rounded up. This keeps their sum short.
ROUNDED = 128


def require(claim: bool | np.bool_, sentence: str) -> None:
    if not claim:
        raise CertificateError(sentence)


def require_number(number: object) -> None:
    """Refuses doubles, which would be rounded, NaN, for which no claim fails, and subclasses with other comparisons."""
    whole = type(number) is int
    if type(number) is Fraction:
        over, under = number.numerator, number.denominator
        whole = type(over) is int and type(under) is int and under > 0
    require(whole, f"numbers must be integers or fractions, not {number!r}")


def require_array(name: str, value: object, *shape: int) -> None:
    """Refuses subclasses of arrays, which may redefine addition and multiplication."""
    is_array = type(value) is np.ndarray and value.shape == shape
    require(is_array, f"{name} must be an array of shape {shape}")
    for number in np.asarray(value, object).flat:
        require_number(number)


def require_indices(name: str, value: object, below: int) -> None:
    in_range = type(value) is np.ndarray and value.ndim == 1 and value.dtype.kind == "i"
    in_range = in_range and bool(((np.asarray(value) >= 0) & (np.asarray(value) < below)).all())
    require(in_range, f"{name} must be an array of indices below {below}")


def require_bodies(shapes: object) -> None:
    """Refuses subclasses of Placed, which may describe another body than the body in the core."""
    require(type(shapes) is tuple and len(shapes) > 1, "shapes must be a tuple of two bodies or more")
    assert isinstance(shapes, tuple)
    require(all(type(shape) is Placed for shape in shapes), "shapes must be Placed")


class Short:
    """A claim whose text states only the count of its numbers, because there may be thousands."""

    def __repr__(self) -> str:
        assert is_dataclass(self)
        held = (_in_short(field.name, getattr(self, field.name)) for field in fields(self))
        return f"{type(self).__name__}({', '.join(held)})"


def _in_short(name: str, value: object) -> str:
    match value:
        case Fraction():
            return f"{name}={_rounded(value)}"
        case np.ndarray() if value.ndim == 1 and len(value) == 3 and value.dtype == object:
            return f"{name}=[{', '.join(map(_rounded, value))}]"
        case np.ndarray() | tuple():
            return f"{len(value)} {name}"
        case _:
            return f"{name}={value!r}"


def _rounded(number: Fraction) -> str:
    """A number with any exponent as text, to twelve digits."""
    return f"{Decimal(number.numerator) / Decimal(number.denominator):.12g}"


@dataclass(frozen=True, eq=False, repr=False)
class OwnedPlane(Short):
    """Body number `owner` lies in { x : normal . x <= offset }; the normal (3,) is of any length."""

    normal: Exact
    offset: Fraction
    owner: int


def check_planes(shapes: tuple[Placed, ...], planes: tuple[OwnedPlane, ...]) -> None:
    require_bodies(shapes)
    is_tuple = type(planes) is tuple and all(type(plane) is OwnedPlane for plane in planes)
    require(is_tuple and bool(planes), "planes must be a tuple of OwnedPlane, one or more")
    bodies = [RationalBody(shape) for shape in shapes]
    for number, plane in enumerate(planes):
        require_array("a normal", plane.normal, 3)
        require_number(plane.offset)
        require(any(plane.normal), f"plane {number} must have a normal that is not zero")
        belongs = type(plane.owner) is int and 0 <= plane.owner < len(bodies)
        require(belongs, f"plane {number} must belong to one of the bodies")
        below = bodies[plane.owner].is_below(plane.normal, plane.offset)
        require(below, f"plane {number} must have all of body {plane.owner} below it")


def check_balance(planes: tuple[OwnedPlane, ...]) -> None:
    total = sum(plane.normal for plane in planes)
    require(not np.any(total), "normals must add up to zero")


@dataclass(frozen=True, eq=False, repr=False)
class Separated(Short):
    """A certificate that no point is below all planes, so that the bodies have no common point.

    The normals of the planes add up to zero, and the offsets to less than zero. The lengths of the normals contain the
    weights of Farkas' lemma. For a pair, the planes are the two sides of a gap.

    Parameters
    ----------
    shapes : tuple of Placed
        The bodies.
    planes : tuple of OwnedPlane
        At most four planes. Each has all of one body below it.
    """

    shapes: tuple[Placed, ...]
    planes: tuple[OwnedPlane, ...]

    def verify(self) -> Bounds:
        """Check the certificate from the shapes alone, in rational arithmetic.

        Returns
        -------
        tuple of (Fraction, Fraction)
            Lower and upper bound of the common volume in m³.

        Raises
        ------
        CertificateError
            If a condition does not hold. The message names the condition.
        """
        check_planes(self.shapes, self.planes)
        check_balance(self.planes)
        require(sum(plane.offset for plane in self.planes) < 0, "offsets must add up to less than zero")
        return Fraction(0), Fraction(0)


@dataclass(frozen=True, eq=False, repr=False)
class Touching(Short):
    """A certificate that the bodies nearly have a gap, and nearly have a common point.

    Parameters
    ----------
    shapes : tuple of Placed
        The bodies.
    planes : tuple of OwnedPlane
        At most four planes, whose normals add up to zero. They leave no room for a ball larger than `inradius`.
    inradius : Fraction
        Upper bound of the radius of a ball in the common set, m.
    point : (3,) ndarray of Fraction
        A point near all bodies, m.
    nearest : (m, 3) ndarray of Fraction
        A point in each body, m.
    miss : Fraction
        Upper bound of the distance of `point` from each of `nearest`, m.
    """

    shapes: tuple[Placed, ...]
    planes: tuple[OwnedPlane, ...]
    inradius: Fraction
    point: Exact
    nearest: Exact
    miss: Fraction

    def verify(self) -> Bounds:
        """Check the certificate from the shapes alone, in rational arithmetic.

        Returns
        -------
        tuple of (Fraction, Fraction)
            Lower and upper bound of the common volume in m³.

        Raises
        ------
        CertificateError
            If a condition does not hold. The message names the condition.
        """
        check_planes(self.shapes, self.planes)
        check_balance(self.planes)
        require_number(self.inradius)
        require_array("point", self.point, 3)
        require_array("nearest", self.nearest, len(self.shapes), 3)
        require_number(self.miss)
        require(self.miss >= 0, "miss must not be negative")
        lengths = sum(root(plane.normal @ plane.normal)[self.inradius < 0] for plane in self.planes)
        room = sum(plane.offset for plane in self.planes)
        require(room <= self.inradius * lengths, "planes must leave no room for a ball larger than the inradius")
        for number, (shape, point) in enumerate(zip(self.shapes, self.nearest, strict=True)):
            inside = RationalBody(shape).contains(point[None])[0]
            require(inside, f"nearest point {number} must lie in body {number}")
            off = point - self.point
            require(off @ off <= self.miss**2, f"nearest point {number} must be no farther off than the miss")
        return Fraction(0), self.volume_bound()

    def volume_bound(self) -> Fraction:
        """Upper bound of the common volume: the inradius times the surface of a box around the common part.

        The inner parallel bodies of a convex set have less surface than the set. The set has less surface than a box
        around it. The volume is the integral of the surfaces of the inner parallel bodies over depths from 0 to the
        inradius.

        Returns
        -------
        Fraction
            The bound in m³.
        """
        bounded = [body for body in map(RationalBody, self.shapes) if body.facts.bounded]
        require(bool(bounded), "one of the bodies must be bounded")
        upper, lower = ([min(support_above(body, way) for body in bounded) for way in ways] for ways in (AXES, -AXES))
        x, y, z = (max(a + b, Fraction(0)) for a, b in zip(upper, lower))
        return max(self.inradius, Fraction(0)) * 2 * (x * y + y * z + z * x)


def support_above(body: RationalBody, direction: Exact) -> Fraction:
    """An upper bound of direction . x on the body, to 1e-19; exact without round parts."""
    support = body.support(direction)
    require(support is not None, "a half-space must be asked along its normal")
    assert support is not None
    return support[0] + root(support[1])[1]


@dataclass(frozen=True, eq=False, repr=False)
class Overlapping(Short):
    """A certificate of planes around the common part, and of a star-shaped polytope inside it.

    The polytope of the vertices, shrunk by the least `pull` about `point`, lies in all bodies.

    Parameters
    ----------
    shapes : tuple of Placed
        The bodies.
    planes : tuple of OwnedPlane
        Planes around the common part. Each bounds one of the bodies.
    vertices : (n, 3) ndarray of Fraction
        Vertices of the polygons, m.
    rings : tuple of ndarray of int32
        Polygons around `point`: indices into `vertices`, counter-clockwise from outside.
    facet : (k,) ndarray of int32
        The plane of each polygon, up to rounding errors.
    point : (3,) ndarray of Fraction
        Centre of a ball that lies in all bodies, m.
    margin : Fraction
        Radius of this ball, m.
    pull : (n,) ndarray of Fraction
        In (0, 1]: the point at this share of the way from `point` to the vertex lies in all bodies.
    """

    shapes: tuple[Placed, ...]
    planes: tuple[OwnedPlane, ...]
    vertices: Exact
    rings: tuple[NDArray[np.int32], ...]
    facet: NDArray[np.int32]
    point: Exact
    margin: Fraction
    pull: Exact

    def verify(self) -> Bounds:
        """Check the certificate from the shapes alone, in rational arithmetic.

        Returns
        -------
        tuple of (Fraction, Fraction)
            Lower and upper bound of the common volume in m³.

        Raises
        ------
        CertificateError
            If a condition does not hold. The message names the condition.
        """
        check_planes(self.shapes, self.planes)
        count = len(self.pull) if type(self.pull) is np.ndarray and self.pull.ndim == 1 else 0
        require_array("pull", self.pull, count)
        require_array("vertices", self.vertices, count, 3)
        require_array("point", self.point, 3)
        require_number(self.margin)
        require(type(self.rings) is tuple and len(self.rings) > 3, "rings must be a tuple of four polygons or more")
        for ring in self.rings:
            require_indices("a ring", ring, count)
            require(len(ring) > 2, "a ring must have three corners or more")
        require_indices("facet", self.facet, len(self.planes))
        triangles = fans(self.rings)
        numbers, unit = integers(np.vstack([self.vertices, self.point]))
        arms, centre = numbers[:-1] - numbers[-1], numbers[-1]
        shares, whole = integers(self.pull)
        self._check_inside(whole * centre + shares[:, None] * arms, whole * unit)
        corners = arms[triangles]
        six = triple(*np.moveaxis(corners, 1, 0))
        self._check_star(triangles, corners, six)
        lower = Fraction((six * shares[triangles].prod(axis=1)).sum(), 6 * (unit * whole) ** 3)
        return lower, Fraction((six * self._reach(corners, unit)).sum(), 6 * unit**3 << ROUNDED)

    def _check_inside(self, pulled: Exact, scale: int) -> None:
        """`pulled / scale` are the vertices after their pull."""
        require(self.margin > 0, "margin must be greater than 0")
        require((self.pull > 0).all() and (self.pull <= 1).all(), "pull must be in (0, 1]")
        for number, body in enumerate(RationalBody(shape) for shape in self.shapes):
            ball = body.contains(self.point[None], self.margin)[0]
            require(ball, f"the ball about the point must lie in body {number}")
            inside = body.contains(pulled, scale=scale)
            require(inside.all(), f"vertex {inside.argmin()} must lie in body {number} after its pull")

    def _check_star(self, triangles: NDArray[np.intp], corners: Exact, six: Exact) -> None:
        """Checks that the cones from the point over the triangles fill space once.

        The winding number of a closed surface about the point is the number of times that a ray in general position
        leaves through it. Every crossing goes outwards if no triangle is seen from behind. A ray through an edge gives
        a zero.
        """
        require(len(self.rings) == len(self.facet), "every polygon must have a plane")
        require(is_closed(triangles), "polygons must form a closed surface")
        require((six >= 0).all(), "no triangle may be seen from behind by the point")
        ray = corners[six.argmax()].T @ [17, 19, 23]
        a, b, c = np.moveaxis(corners, 1, 0)
        sides = np.array([triple(ray[None], u, v) for u, v in ((a, b), (b, c), (c, a))])
        met = (sides >= 0).all(axis=0) & (six > 0)
        require(met.sum() == 1, "the surface must wind about the point once")

    def _reach(self, corners: Exact, unit: int) -> Exact:
        """For each triangle, the volume of the cone over it below its plane, as a share of the cone to the triangle.

        The shares are in units of 2^-ROUNDED and are rounded up.
        """
        facets = [facet for facet, ring in zip(self.facet, self.rings) for _ in ring[2:]]
        slack = [plane.offset - plane.normal @ self.point for plane in self.planes]
        require(min(slack) > 0, "every plane must have the point below it")
        rows = np.array([integers([*plane.normal, s])[0] for plane, s in zip(self.planes, slack)], object)[facets]
        along = (rows[:, None, :3] * corners).sum(axis=2)
        require((along > 0).all(), "every plane must cut all edges of the cones over its polygon")
        ratio: Exact = -(-((rows[:, 3] * unit) ** 3 << ROUNDED) // along.prod(axis=1))
        return ratio


@dataclass(frozen=True, eq=False, repr=False)
class Bracketed(Short):
    """A certificate of a lower and an upper bound of the common volume of bodies, which may be round.

    The check computes the volume again from the numbers of the shapes, in ball arithmetic with as many bits as
    necessary (see `overlapper.proof.volume`). It needs python-flint. All threads share python-flint's number of bits,
    so only one check may run at a time.

    Parameters
    ----------
    shapes : tuple of Placed
        The bodies.
    lower : Fraction
        Lower bound, m³.
    upper : Fraction
        Upper bound, m³.
    """

    shapes: tuple[Placed, ...]
    lower: Fraction
    upper: Fraction

    def verify(self) -> Bounds:
        """Check the certificate from the shapes alone, in ball arithmetic.

        Returns
        -------
        tuple of (Fraction, Fraction)
            Lower and upper bound of the common volume in m³.

        Raises
        ------
        CertificateError
            If a condition does not hold. The message names the condition.
        """
        require_bodies(self.shapes)
        require_number(self.lower)
        require_number(self.upper)
        lower, upper = Fraction(self.lower), Fraction(self.upper)
        require(0 < lower <= upper, "lower must be greater than 0 and not above upper")

        def is_decided(proved: Bounds) -> bool:
            within = lower <= proved[0] and proved[1] <= upper
            return within or proved[1] < lower or upper < proved[0]

        proved = volume_bounds(self.shapes, is_decided)
        require(lower <= proved[0] and proved[1] <= upper, "the common volume must lie between lower and upper")
        return lower, upper


def volume_bounds(shapes: Sequence[Placed], is_narrow: Callable[[Bounds], bool]) -> Bounds:
    """Bounds of the volume that bodies share, narrow enough for `is_narrow`."""
    try:
        from overlapper.proof.volume import proved_bounds
    except ImportError as error:
        raise ImportError(f"a certificate of round bodies needs {hint('python-flint')}") from error
    return proved_bounds(shapes, is_narrow)


Certificate = Separated | Touching | Overlapping | Bracketed
