"""Convex shapes and the polytopes they share."""

from collections.abc import Callable, Sequence
from typing import Annotated, Any, Literal, overload

import numpy
import numpy.typing
from numpy.typing import NDArray


class Sphere:
    """A ball of the given radius (m) about the origin."""

    def __init__(self, radius: float) -> None: ...

    def __reduce__(self) -> tuple[type, tuple[object, ...]]: ...

    @property
    def radius(self) -> float:
        """m"""

    @property
    def volume(self) -> float:
        """Volume in m³; infinite for a half-space."""

    @property
    def centroid(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """
        (3,) centre of volume in the shape's frame; the nearest boundary point to the origin for a half-space.
        """

    @property
    def bounds(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (2, 3) lower and upper corner of the box around the bare shape; infinite where a half-space is.
        """

    def __repr__(self) -> str: ...

    def __copy__(self) -> object: ...

    def __deepcopy__(self, memo: object) -> object: ...

class Box:
    """A box about the origin with half extents (m) along x, y, z."""

    def __init__(self, half_extents: numpy.typing.ArrayLike) -> None: ...

    def __reduce__(self) -> tuple[type, tuple[object, ...]]: ...

    @property
    def half_extents(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """(3,) m"""

    @property
    def volume(self) -> float:
        """Volume in m³; infinite for a half-space."""

    @property
    def centroid(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """
        (3,) centre of volume in the shape's frame; the nearest boundary point to the origin for a half-space.
        """

    @property
    def bounds(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (2, 3) lower and upper corner of the box around the bare shape; infinite where a half-space is.
        """

    def __repr__(self) -> str: ...

    def __copy__(self) -> object: ...

    def __deepcopy__(self, memo: object) -> object: ...

class Capsule:
    """
    All points within `radius` (m) of a segment of `length` (m) along local z, about the origin.

    As in pybullet, `length` lies between the centres of the caps; it may be 0.
    """

    def __init__(self, radius: float, length: float) -> None: ...

    def __reduce__(self) -> tuple[type, tuple[object, ...]]: ...

    @property
    def radius(self) -> float:
        """m"""

    @property
    def length(self) -> float:
        """m, between the centres of the caps"""

    @property
    def volume(self) -> float:
        """Volume in m³; infinite for a half-space."""

    @property
    def centroid(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """
        (3,) centre of volume in the shape's frame; the nearest boundary point to the origin for a half-space.
        """

    @property
    def bounds(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (2, 3) lower and upper corner of the box around the bare shape; infinite where a half-space is.
        """

    def __repr__(self) -> str: ...

    def __copy__(self) -> object: ...

    def __deepcopy__(self, memo: object) -> object: ...

class Cylinder:
    """
    A cylinder of `radius` (m) and `length` (m) along local z, about the origin.
    """

    def __init__(self, radius: float, length: float) -> None: ...

    def __reduce__(self) -> tuple[type, tuple[object, ...]]: ...

    @property
    def radius(self) -> float:
        """m"""

    @property
    def length(self) -> float:
        """m"""

    @property
    def volume(self) -> float:
        """Volume in m³; infinite for a half-space."""

    @property
    def centroid(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """
        (3,) centre of volume in the shape's frame; the nearest boundary point to the origin for a half-space.
        """

    @property
    def bounds(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (2, 3) lower and upper corner of the box around the bare shape; infinite where a half-space is.
        """

    def __repr__(self) -> str: ...

    def __copy__(self) -> object: ...

    def __deepcopy__(self, memo: object) -> object: ...

class Hull:
    """
    The convex hull of (n, 3) points (m).

    Interior, duplicate and coplanar points are welcome; coplanar triangles become one facet. Raises
    ValueError for fewer than four points, for points that are not finite and for points in one plane.
    """

    def __init__(self, vertices: numpy.typing.ArrayLike) -> None: ...

    @property
    def vertices(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (n, 3) the corners only, m; without those that mere rounding lifts off a facet
        """

    @property
    def facets(self) -> list[numpy.typing.NDArray[numpy.int32]]:
        """
        Indices of the vertices around each facet, counter-clockwise from outside.
        """

    @property
    def halfspaces(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (k, 4) rows [n, b], one per facet: n · x + b <= 0 inside, n unit (scipy's form).
        """

    @property
    def corners(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (n, 3) all corners of the hull of the points as given, without rounding, m
        """

    @property
    def triangles(self) -> Annotated[NDArray[numpy.int32], dict(shape=(None, None), writable=False)]:
        """
        (k, 3) indices of the corners of its surface before coplanar triangles are merged, counter-clockwise from outside.
        """

    @property
    def volume(self) -> float:
        """Volume in m³; infinite for a half-space."""

    @property
    def centroid(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """
        (3,) centre of volume in the shape's frame; the nearest boundary point to the origin for a half-space.
        """

    @property
    def bounds(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (2, 3) lower and upper corner of the box around the bare shape; infinite where a half-space is.
        """

    def __repr__(self) -> str: ...

    def __copy__(self) -> object: ...

    def __deepcopy__(self, memo: object) -> object: ...

    def __getstate__(self) -> tuple[object, ...]: ...

    def __setstate__(self, state: tuple[object, ...]) -> None: ...

class HalfSpace:
    """
    The closed half-space { x : normal · x <= offset }.

    `normal` may have any length but 0. The half-space is what the two say as given, without rounding; the attributes
    `normal` and `offset` are both divided by the length, which rounds.
    """

    def __init__(self, normal: numpy.typing.ArrayLike, offset: float) -> None: ...

    def __reduce__(self) -> tuple[type, tuple[object, ...]]: ...

    @property
    def normal(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """(3,) unit, out of the solid"""

    @property
    def offset(self) -> float:
        """m along the unit normal"""

    @property
    def given_normal(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """(3,) as given, of any length"""

    @property
    def given_offset(self) -> float:
        """As given, along the normal as given."""

    @property
    def volume(self) -> float:
        """Volume in m³; infinite for a half-space."""

    @property
    def centroid(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """
        (3,) centre of volume in the shape's frame; the nearest boundary point to the origin for a half-space.
        """

    @property
    def bounds(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (2, 3) lower and upper corner of the box around the bare shape; infinite where a half-space is.
        """

    def __repr__(self) -> str: ...

    def __copy__(self) -> object: ...

    def __deepcopy__(self, memo: object) -> object: ...

class RoundedHull:
    """
    All points within `radius` (m) of the convex hull of (n, 3) points (m).

    The Minkowski sum of the hull and a ball: what Bullet collides with where a convex mesh has a margin. ValueError as
    for Hull and Sphere. Method "paper" does not take it; more than two bodies that overlap, it among them, have
    no certificate, and neither does it with an ellipsoid that it overlaps.
    """

    def __init__(self, vertices: numpy.typing.ArrayLike, radius: float) -> None: ...

    @property
    def core(self) -> Hull:
        """The hull that is rounded."""

    @property
    def radius(self) -> float:
        """m"""

    @property
    def volume(self) -> float:
        """Volume in m³; infinite for a half-space."""

    @property
    def centroid(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """
        (3,) centre of volume in the shape's frame; the nearest boundary point to the origin for a half-space.
        """

    @property
    def bounds(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (2, 3) lower and upper corner of the box around the bare shape; infinite where a half-space is.
        """

    def __repr__(self) -> str: ...

    def __copy__(self) -> object: ...

    def __deepcopy__(self, memo: object) -> object: ...

    def __getstate__(self) -> tuple[object, ...]: ...

    def __setstate__(self, state: tuple[object, ...]) -> None: ...

class Ellipsoid:
    """
    An ellipsoid about the origin with half axes (m) along x, y, z.

    All points with (x / a)² + (y / b)² + (z / c)² <= 1. With equal half axes it answers as the sphere does. With a box, a
    hull or a half-space, it is measured as a ball is, of which it is the image; with other round bodies, between polytopes,
    as closely as `tolerance` asks.
    """

    def __init__(self, half_axes: numpy.typing.ArrayLike) -> None: ...

    def __reduce__(self) -> tuple[type, tuple[object, ...]]: ...

    @property
    def half_axes(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """(3,) m"""

    @property
    def volume(self) -> float:
        """Volume in m³; infinite for a half-space."""

    @property
    def centroid(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """
        (3,) centre of volume in the shape's frame; the nearest boundary point to the origin for a half-space.
        """

    @property
    def bounds(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (2, 3) lower and upper corner of the box around the bare shape; infinite where a half-space is.
        """

    def __repr__(self) -> str: ...

    def __copy__(self) -> object: ...

    def __deepcopy__(self, memo: object) -> object: ...

class Placed:
    """
    A shape and where it is in the world.

    position is (3,) in m. orientation is a quaternion (x, y, z, w) as in pybullet, of any length but 0, or a
    scipy.spatial.transform.Rotation. The body is turned by M(q) / |q|² for the quaternion as given, without rounding. The
    attribute `orientation` is divided by the length, which rounds.
    """

    def __init__(self, shape: Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | numpy.typing.ArrayLike, position: numpy.typing.ArrayLike = (0, 0, 0), orientation: numpy.typing.ArrayLike = (0, 0, 0, 1)) -> None: ...

    @staticmethod
    def from_matrix(shape: Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | numpy.typing.ArrayLike, matrix: numpy.typing.ArrayLike) -> Placed:
        """
        A shape placed by a homogeneous matrix (4, 4), as of trimesh: a rotation, and a position in m.

        ValueError if the matrix scales, shears or mirrors by more than 1e-6, or if its last row is not (0, 0, 0, 1).
        """

    @property
    def shape(self) -> Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid: ...

    @property
    def position(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """(3,) m"""

    @property
    def orientation(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """(4,) unit quaternion x, y, z, w"""

    @property
    def given_orientation(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """(4,) x, y, z, w as given, of any length"""

    @property
    def volume(self) -> float:
        """m³; infinite for a half-space"""

    @property
    def centroid(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """(3,) in the world, m"""

    @property
    def bounds(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """(2, 3) lower and upper corner of the box around it in the world, m"""

    def __repr__(self) -> str: ...

    def __reduce__(self) -> tuple[type, tuple[object, ...]]: ...

    def __copy__(self) -> object: ...

    def __deepcopy__(self, memo: object) -> object: ...

class Errors:
    """
    How far the figures of an Overlap may be off: bounds that hold, in the same units.

    They rest on another way to the same figures, whose rounding is bounded from its operations, and on how far that and the
    figures are apart.
    """

    @property
    def volume(self) -> float:
        """m³, the same as `volume_error`."""

    @property
    def area(self) -> float:
        """m²."""

    @property
    def centroid(self) -> float | None:
        """m: the true centroid is no farther away. None unless overlapping."""

    @property
    def inertia(self) -> float:
        """m⁵, of each entry."""

    @property
    def vertices(self) -> float | None:
        """
        m: no point of the hull of the vertices is farther from the common set, and none of that from the hull. None unless
        overlapping.
        """

    @property
    def gradient(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (m, 6) m² and m³: of the length of the three numbers that they stand for, and so of each.

        Where facets of two bodies lie in one plane the volume has a slope to one side and another to the other, and what is
        stated may be either: the error is then as large as the facet. Where surfaces are tangent, or nearly, rounding moves the
        border between them by far more than itself.
        """

    @property
    def depth(self) -> float | None:
        """m. None for three or more bodies, as are the next two."""

    @property
    def distance(self) -> float | None:
        """m."""

    @property
    def witnesses(self) -> float | None:
        """
        m: by how much, both together, the witnesses are outside of their bodies and farther apart than the bodies are. 0 if
        overlapping.
        """

    def __repr__(self) -> str: ...

class Overlap:
    """
    What two or more convex shapes share. True only if they overlap.

    Immutable; each quantity is computed when first asked for. SI units, world coordinates. For smooth shapes the
    polytope contains the common set, as closely as `tolerance` asks.
    """

    @property
    def status(self) -> Literal['separated', 'touching', 'overlapping']:
        """
        'touching' if rounding cannot tell whether the common set has an inside.
        """

    def __bool__(self) -> bool: ...

    @property
    def shapes(self) -> tuple[Placed, ...]:
        """The bodies in the order given."""

    @property
    def tolerance(self) -> float:
        """Allowed relative error of the volume for curved shapes."""

    @property
    def converged(self) -> bool:
        """
        False if the volume may be off by more than the fraction `tolerance`: where rounding, or the most planes that a
        smooth shape is given, leave more in doubt. True of bodies that do not overlap.
        """

    @property
    def method(self) -> Literal['auto', 'paper']: ...

    @property
    def way(self) -> Literal['separation', 'clipping', 'tracing', 'closed form', 'slicing', 'dual hull', 'wide separation', 'wide clipping', 'wide dual hull', 'doubt', 'paper']:
        """
        How the answer came: by which way the volume was measured, or the status found of bodies that do not overlap.

        'separation': doubles prove a gap. 'clipping': corners of each body held against the planes of the other. 'tracing': the
        seam of two surfaces followed from facet to facet. 'closed form': a formula. 'slicing': slices of
        round bodies, integrated. 'dual hull': the convex hull of dual points. 'wide ...': the same in double-doubles, where doubles are not
        enough. 'doubt': not even these tell whether there is an inside, so that the bodies are said to touch. 'paper': the
        method asked for.
        """

    @property
    def facets_touched(self) -> int:
        """How many planes of the shapes took part in the measures."""

    @property
    def errors(self) -> Errors:
        """
        How far each figure may be off, as `volume_error` is that of the volume. It costs about as much as all figures
        together.
        """

    @property
    def volume(self) -> float:
        """m³, the best estimate; 0 unless overlapping."""

    @property
    def volume_error(self) -> float:
        """
        m³, certified: the true volume is within volume ± volume_error.

        For polyhedra it bounds the rounding: every plane moved by 16 half-ulps of the coordinates' magnitude, times the
        area. Where a formula gives the measures of a pair with a round body, it is that, too; where slices do, what is left of
        the series over them, the rounding of their lines, and what area vectors, which sum to zero over a closed surface, leave
        open. For others with smooth shapes it is the share of the volume between an outer and an inner polytope, plus that. A
        pair that touches may hide a volume of rounding size. For method 'paper', which bounds nothing itself, it is the
        difference from what 'auto' finds, plus the error of that. 0 if separated.
        """

    @property
    def widened(self) -> bool:
        """
        True if double arithmetic could not place the volume within 1e-12 of itself, and it was computed again in wider
        arithmetic from the shapes' own numbers, as were centroid, area, inertia and gradient.
        """

    @property
    def area(self) -> float:
        """m², of the surface of the common set; 0 unless overlapping."""

    @property
    def centroid(self) -> numpy.typing.NDArray[numpy.float64] | None:
        """(3,) centre of the common volume, m; None unless overlapping."""

    @property
    def inertia(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (3, 3) inertia tensor about the centroid at unit density, world axes, m⁵ (trimesh's moment_inertia); zeros unless overlapping.
        """

    @property
    def gradient(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (m, 6) d volume / d (translation, rotation vector about the body's own position) of each body, world axes: the area vector
        of the facets that the body owns, and its moment. m² and m³; zeros unless overlapping.
        """

    @property
    def vertices(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """(n, 3) corners of the common polytope, m; empty unless overlapping."""

    @property
    def faces(self) -> Annotated[NDArray[numpy.int32], dict(shape=(None, None), writable=False)]:
        """
        (k, 3) the facets as triangles, counter-clockwise from outside: indices into vertices.
        """

    @property
    def facets(self) -> list[numpy.typing.NDArray[numpy.int32]]:
        """
        Indices of the vertices around each facet, counter-clockwise from outside.
        """

    @property
    def halfspaces(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (f, 4) rows [n, b], one per facet: n · x + b <= 0 inside, n unit (scipy's form).
        """

    @property
    def owner(self) -> Annotated[NDArray[numpy.int32], dict(shape=(None,), writable=False)]:
        """(f,) which of the shapes each facet belongs to."""

    @property
    def patch(self) -> list[numpy.typing.NDArray[numpy.float64]]:
        """
        Closed polygons (k, 3) along the ridges where the owner changes, the first point not repeated. For a pair they go
        counter-clockwise around a's part of the surface; for more bodies, around the part of each.
        """

    @property
    def patch_area(self) -> numpy.typing.NDArray[numpy.float64] | None:
        """
        (3,) m², the area vector of b's part of the surface, which points to a as `normal` does: its length is the area within
        `patch`, seen along it, and for small overlaps what the volume grows by per metre of depth. The same as gradient[1, :3],
        and opposite to gradient[0, :3]; zeros unless overlapping. None for three or more bodies, as are the next three.
        """

    @property
    def patch_centre(self) -> numpy.typing.NDArray[numpy.float64] | None:
        """
        (3,) m, the centre of that area, in the plane through the centroid of the volume. None, too, without an area: unless
        the bodies overlap, and of a body inside the other.
        """

    @property
    def patch_moments(self) -> numpy.typing.NDArray[numpy.float64] | None:
        """
        (3, 3) m⁴, ∫ x xᵀ dA of that area about its centre, world axes; nothing along the area vector. Its eigenvectors and the
        roots of its eigenvalues over the area are the axes of the patch and its radii of gyration. Where formulas or slices
        measure round bodies it is that of the round patch, not of polygons.
        """

    @property
    def patch_distance(self) -> float | None:
        """
        m, how far the points of that area are on the average from the centroid of the volume, in the plane through it:
        with friction mu and a normal force N, the torque that resists spinning is at most mu * N * patch_distance. Exact of
        polyhedra, discs and ellipses. Where formulas or slices measure round bodies, other patches count as the ellipse that
        has the same centre and moments: of a long rectangle that is 2 % less than the truth, of a stadium within 1 %, of a half
        disc within 2 %, of a triangle 2 % more, and of a thin ring 6 % less. None without an area, as the centre.
        """

    @property
    def bounds(self) -> numpy.typing.NDArray[numpy.float64] | None:
        """
        (2, 3) lower and upper corner of the box around the common polytope; None unless overlapping.
        """

    @property
    def normal(self) -> numpy.typing.NDArray[numpy.float64] | None:
        """
        (3,) unit, from b to a as pybullet's contactNormalOnB: moving a by depth * normal separates an overlapping
        pair. Also given for pairs that touch or are apart. None for three or more bodies.
        """

    @property
    def depth(self) -> float | None:
        """
        m, the least translation that separates the pair; 0 unless overlapping. None for three or more bodies.
        """

    @property
    def distance(self) -> float | None:
        """
        m between the nearest points; 0 unless separated. None for three or more bodies.
        """

    @property
    def witness_a(self) -> numpy.typing.NDArray[numpy.float64] | None:
        """
        (3,) the point of a nearest to b, with witness_a - witness_b = distance * normal. None if overlapping.
        """

    @property
    def witness_b(self) -> numpy.typing.NDArray[numpy.float64] | None:
        """(3,) the point of b nearest to a. None if overlapping."""

    @property
    def separating_plane(self) -> numpy.typing.NDArray[numpy.float64] | None:
        """
        (4,) [n, b] with n · x + b >= 0 on a and <= 0 on b, n the unit normal. None if overlapping.
        """

    def __repr__(self) -> str: ...

    def certificate(self) -> Any:
        """
        What proves the status, and bounds of the volume, to somebody who does not trust us: an overlapper.proof.claims.Certificate.

        `verify()` of it checks everything in rational arithmetic without the core, and returns (lower, upper) bounds of the common
        volume in m³. Raises CertificateError where there is none.
        """

    def __copy__(self) -> object: ...

    def __deepcopy__(self, memo: object) -> object: ...

    def __getstate__(self) -> tuple[object, ...]: ...

    def __setstate__(self, state: tuple[object, ...]) -> None: ...

@overload
def overlap(a: Placed, b: Placed, /) -> Overlap: ...

@overload
def overlap(*shapes: Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | Placed | numpy.typing.ArrayLike, tolerance: float = 0.001, method: Literal['auto', 'paper'] = 'auto') -> Overlap:
    """
    The common set of two or more convex shapes.

        lens = overlap(Sphere(0.5), Placed(Sphere(0.5), position=(0.6, 0, 0)))
        lens.volume, lens.volume_error, lens.depth, lens.normal

    Each of `shapes` is a shape, a Placed, or an (n, 3) array of points, which stands for their convex hull. `tolerance`, between
    0 and 1, is the allowed relative error of the volume for curved shapes. `converged` is False if it was not reached.
    Polyhedra are exact and ignore it. No overlap is an answer, not an error. Raises ValueError if the common set is unbounded.

    `method` 'auto' tries the ways of `Overlaps.WAYS` and always returns an answer. `method` 'paper' follows the article of
    Tereshchenko, Chevokin and Fisunenko, 'Algorithm for finding the domain intersection of a set of polytopes' (ICCS 2013). GJK
    finds a common point. A point on a boundary is shifted by 2^-26 of the smaller polytope in one of 26 directions. If no
    shifted point is inside both bodies, the status is 'touching'. The convex hull of the dual points of all face planes follows,
    then its dual. More than two bodies are intersected in pairs, by divide and conquer. Three things differ from the article:
    curved shapes are replaced by inscribed polytopes, half-spaces by large boxes, and hulls use exact predicates.
    """

def distance(a: Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | Placed | numpy.typing.ArrayLike, b: Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | Placed | numpy.typing.ArrayLike) -> float:
    """
    Distance (m) between the nearest points of two shapes. 0 if they touch or overlap.
    """

def penetration_depth(a: Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | Placed | numpy.typing.ArrayLike, b: Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | Placed | numpy.typing.ArrayLike) -> float:
    """
    Length (m) of the shortest translation that separates two shapes. 0 if they do not overlap. Positive where pybullet's
    contact distance is negative. Raises ValueError for two half-spaces.
    """

def iou(a: Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | Placed | numpy.typing.ArrayLike, b: Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | Placed | numpy.typing.ArrayLike, tolerance: float = 0.001) -> float:
    """
    Intersection over union of two shapes: the common volume divided by the volume of the union, from 0 to 1.
    """

class Overlaps:
    """
    What many pairs of shapes share: an array per quantity, a row per pair. SI units, world coordinates.

    The arrays are read-only views. `overlaps[i]` is the Overlap of row i with all that can be asked of it, computed again
    unless it took long and its Batch has not been asked since; `overlaps[mask]`, a slice or an array of indices picks rows.
    A pickle has the shapes and their poses, of which the rows are computed again, to the same bits.
    """

    @property
    def pairs(self) -> numpy.typing.NDArray[numpy.int32]:
        """(p, 2) indices of the shapes a and b of each row."""

    @property
    def status(self) -> numpy.typing.NDArray[numpy.int8]:
        """(p,) Overlaps.SEPARATED (0), TOUCHING (1) or OVERLAPPING (2)."""

    @property
    def way(self) -> numpy.typing.NDArray[numpy.int8]:
        """
        (p,) how the answer came: a place in Overlaps.WAYS, which has the names of Overlap.way.
        """

    @property
    def volume(self) -> numpy.typing.NDArray[numpy.float64]:
        """(p,) m³; 0 unless overlapping."""

    @property
    def volume_error(self) -> numpy.typing.NDArray[numpy.float64]:
        """(p,) m³, certified: the true volume is within volume ± volume_error."""

    @property
    def centroid(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p, 3) centre of the common volume, m; not a number unless overlapping.
        """

    @property
    def area(self) -> numpy.typing.NDArray[numpy.float64]:
        """(p,) m², of the surface of the common polytope."""

    @property
    def normal(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p, 3) unit, from b to a as pybullet's contactNormalOnB; 0 for pairs that are separated.
        """

    @property
    def depth(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p,) m, the least translation that separates the pair, of a along normal; 0 unless overlapping.
        """

    @property
    def gradient(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p, 2, 6) d volume / d (translation, rotation vector about the body's own position) of a and of b, m² and m³;
        0 unless overlapping.
        """

    @property
    def facets_touched(self) -> numpy.typing.NDArray[numpy.int32]:
        """(p,) how many planes of the shapes took part in building the polytope."""

    @property
    def widened(self) -> numpy.typing.NDArray[numpy.bool_]:
        """(p,) True where the volume was computed again in wider arithmetic."""

    @property
    def patch_area(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p, 3) m², the area vector of the patch, from b to a; zeros unless overlapping.
        """

    @property
    def patch_centre(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p, 3) m, the centre of that area in the plane through the centroid; not a number without an area. It, the
        moments and the distance take some microseconds a pair when one of them is first asked for.
        """

    @property
    def patch_moments(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p, 3, 3) m⁴, ∫ x xᵀ dA of that area about its centre; zeros without an area.
        """

    @property
    def patch_distance(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p,) m, how far points of that area are on the average from the centroid, seen along the area vector; not a number
        without an area.
        """

    SEPARATED: int = 0

    TOUCHING: int = 1

    OVERLAPPING: int = 2

    WAYS: tuple = ...

    @property
    def examined(self) -> int:
        """How many pairs were looked at: those given, or those whose boxes meet."""

    @property
    def planes_asked(self) -> int:
        """
        How many planes of the shapes were asked for in that call: placed to be held against corners, or given by a shape
        as an answer to where a ray leaves it or which of its planes is tightest about a point.
        """

    @property
    def tolerance(self) -> float: ...

    @property
    def method(self) -> Literal['auto', 'paper']: ...

    def __len__(self) -> int: ...

    def __getitem__(self, row: Any) -> Any: ...

    def __repr__(self) -> str: ...

    def __getstate__(self) -> tuple[object, ...]: ...

    def __setstate__(self, state: tuple[object, ...]) -> None: ...

class Batch:
    """
    Shapes that are asked for their overlaps again and again as they move.

    `overlaps` is the function of that name for these shapes. What it finds is kept for its next call: pairs of which
    neither has moved by a bit cost nothing, and pairs that are still apart along the same axis next to nothing. The
    answers are those of a first call to the last bit. Threads that ask at the same time get their answers without waiting.
    A pickle has the shapes alone.
    """

    def __init__(self, shapes: Sequence[Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid]) -> None: ...

    def __repr__(self) -> str: ...

    def __getstate__(self) -> tuple[object, ...]: ...

    def __setstate__(self, state: tuple[object, ...]) -> None: ...

    def overlaps(self, positions: numpy.typing.ArrayLike, orientations: numpy.typing.ArrayLike, pairs: numpy.typing.ArrayLike | None = None, tolerance: float = 0.001, threads: int | None = 1, method: Literal['auto', 'paper'] = 'auto', separated: bool = True) -> Overlaps:
        """
        What pairs of placed shapes share, in one call that lets other Python threads run: volume, centroid, normal, depth,
        gradient as arrays.

        `positions` (k, 3) in m and `orientations` (k, 4), quaternions xyzw of any length but 0, place the k `shapes`. `pairs`
        (p, 2) indexes them and has a row each in the answer, or with separated=False only those that overlap or touch; without
        it there is a row for each pair that overlaps or touches, found by a tree of boxes and sorted. `tolerance` and `method`
        are those of `overlap`, whose answers these are to the last bit. The work is spread over `threads`, None being all that
        there are; their number does not change a bit of the answer.

        Ctrl-C ends the call early. The KeyboardInterrupt then has the rows that were finished, in an attribute `overlaps`.
        Raises ValueError naming an argument of the wrong shape, a pose that is not finite, or half-spaces whose common set is
        unbounded.
        """

    def candidate_pairs(self, positions: numpy.typing.ArrayLike, orientations: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.int32]:
        """
        (p, 2) indices i < j, sorted, of the shapes whose boxes in the world meet. A half-space meets a box that reaches into it;
        two half-spaces are no pair.
        """

def overlaps(shapes: Sequence[Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid], positions: numpy.typing.ArrayLike, orientations: numpy.typing.ArrayLike, pairs: numpy.typing.ArrayLike | None = None, tolerance: float = 0.001, threads: int | None = 1, method: Literal['auto', 'paper'] = 'auto', separated: bool = True) -> Overlaps:
    """
    What pairs of placed shapes share, in one call that lets other Python threads run: volume, centroid, normal, depth,
    gradient as arrays.

    `positions` (k, 3) in m and `orientations` (k, 4), quaternions xyzw of any length but 0, place the k `shapes`. `pairs`
    (p, 2) indexes them and has a row each in the answer, or with separated=False only those that overlap or touch; without
    it there is a row for each pair that overlaps or touches, found by a tree of boxes and sorted. `tolerance` and `method`
    are those of `overlap`, whose answers these are to the last bit. The work is spread over `threads`, None being all that
    there are; their number does not change a bit of the answer.

    Ctrl-C ends the call early. The KeyboardInterrupt then has the rows that were finished, in an attribute `overlaps`.
    Raises ValueError naming an argument of the wrong shape, a pose that is not finite, or half-spaces whose common set is
    unbounded.
    """

def candidate_pairs(shapes: Sequence[Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid], positions: numpy.typing.ArrayLike, orientations: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.int32]:
    """
    (p, 2) indices i < j, sorted, of the shapes whose boxes in the world meet. A half-space meets a box that reaches into it;
    two half-spaces are no pair.
    """

def world_poses(frames: Sequence[Any], which: numpy.typing.NDArray[numpy.int64], positions: numpy.typing.ArrayLike, orientations: numpy.typing.ArrayLike) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
    """
    (k, 3) positions in m and (k, 4) quaternions xyzw in the world of what is fixed to moving frames.

    `frames` begin with position and quaternion, as pybullet's answers do; thing i is fixed to frame `which[i]` at
    `positions[i]` and `orientations[i]` of it. Quaternions are of any length but 0; those in the world are as long as
    `orientations`. Of a frame that is not a number, neither are they.
    """

class ContactSolver:
    """
    The forces of patches on bodies of links; `simulation.VolumetricContact` is made of it.

    A link is a row of each array: the place of its parent, before it, or -1 of a base, with which a body begins; its joint,
    0 held, 1 revolute, 2 prismatic, 3 spherical; axis and pivot of the joint in the parent's inertial frame; mass, 0 of a
    base that is held; principal moments of inertia. Coordinates are those of each body: of its base, linear and angular, in
    the world, then of its joints.
    """

    def __init__(self, parents: numpy.typing.ArrayLike, joints: numpy.typing.ArrayLike, axes: numpy.typing.ArrayLike, pivots: numpy.typing.ArrayLike, masses: numpy.typing.ArrayLike, inertias: numpy.typing.ArrayLike) -> None: ...

    @property
    def coordinates(self) -> int: ...

    def copy(self) -> ContactSolver:
        """
        Another one that knows the same of the last step: what it solves changes nothing here.
        """

    def place(self, frames: Sequence[Any], overlaps: Overlaps, links: numpy.typing.NDArray[numpy.int64], stiffness: numpy.typing.ArrayLike, dissipation: numpy.typing.ArrayLike, friction: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        Put the links where they are, and take what their shapes share; `links` (k,) is the place of each shape's link.

        `frames` begin with position and quaternion of the inertial frame, as pybullet's answers do. By row of `overlaps` (p,):
        stiffness in Pa/m, dissipation in s, and the coefficient of friction. The answer (p,) is the square of a frequency,
        (rad/s)², that no way of swinging of the two bodies on all of their patches exceeds.
        """

    def ahead(self, duration: float, velocity: numpy.typing.ArrayLike, links: numpy.typing.NDArray[numpy.int64], positions: numpy.typing.ArrayLike, orientations: numpy.typing.ArrayLike) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """
        (k, 3) positions in m and (k, 4) quaternions xyzw where shapes on these `links`, (k,) as for `place`, come to after
        `duration` (s), from where they are now, if links go on with the `velocity` of all coordinates.
        """

    def solve(self, duration: float, velocity: numpy.typing.ArrayLike, acceleration: numpy.typing.ArrayLike, damped: numpy.typing.ArrayLike, distributed: bool) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.bool_], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], int]:
        """
        The forces within a step of that `duration` (s), from `velocity` and `acceleration` of all coordinates, the latter
        without the patches; rows that are `damped` choose stability over energy.

        (p, 3) force, torque about the centroid and slip of a over b, (p, 3) normal, (p,) whether that is one of now and not the
        last known, (n, 6) force and torque on the links about their centres of mass, the patches' part of the acceleration, and
        how often the patches were gone through.
        """

def function(core: Any) -> Any:
    """
    Calls the core. Attributes can be set, and refused arguments are explained.
    """

def method(core: Any) -> Any:
    """
    Calls the core. Attributes can be set, and refused arguments are explained.
    """

def explain_constructor(type: type) -> None:
    """Refused arguments of the class are explained."""

def explain_with(said_by: Callable[[Any, list[Any], dict[str, Any]], str]) -> None:
    """
    Sets the function that says which argument is wrong, from what was called and its arguments.
    """
