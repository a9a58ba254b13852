"""Convex shapes and the polytopes they share."""

from collections.abc import Callable, Iterable, Sequence
from typing import Annotated, Any, Literal, SupportsIndex, overload

import numpy
import numpy.typing
from numpy.typing import NDArray
import trimesh


class Sphere:
    """
    A ball about the origin.

    Parameters
    ----------
    radius : float
        Radius, m.

    Examples
    --------
    >>> from overlapper import Sphere
    >>> round(Sphere(0.5).volume, 6)
    0.523599
    """

    def __init__(self, radius: float) -> None: ...

    def __reduce__(self) -> tuple[type, tuple[object, ...]]: ...

    @property
    def radius(self) -> float:
        """Radius, m."""

    @property
    def volume(self) -> float:
        """Volume in m³; infinite for a half-space."""

    @property
    def centroid(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """
        (3,) centre of volume in the shape's frame, m. For a half-space: the boundary point nearest to the origin.
        """

    @property
    def bounds(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (2, 3) lower and upper corner of the bounding box in the shape's frame, m; infinite for a half-space.
        """

    def __repr__(self) -> str: ...

    def __copy__(self) -> object: ...

    def __deepcopy__(self, memo: object) -> object: ...

class Box:
    """
    A box about the origin.

    Parameters
    ----------
    half_extents : (3,) array_like
        Half of the side lengths along x, y, z, m.

    Examples
    --------
    >>> from overlapper import Box
    >>> Box([0.5, 0.5, 1.0]).volume
    2.0
    """

    def __init__(self, half_extents: numpy.typing.ArrayLike) -> None: ...

    def __reduce__(self) -> tuple[type, tuple[object, ...]]: ...

    @property
    def half_extents(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """(3,) half of the side lengths, m."""

    @property
    def volume(self) -> float:
        """Volume in m³; infinite for a half-space."""

    @property
    def centroid(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """
        (3,) centre of volume in the shape's frame, m. For a half-space: the boundary point nearest to the origin.
        """

    @property
    def bounds(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (2, 3) lower and upper corner of the bounding box in the shape's frame, m; infinite for a half-space.
        """

    def __repr__(self) -> str: ...

    def __copy__(self) -> object: ...

    def __deepcopy__(self, memo: object) -> object: ...

class Capsule:
    """
    All points within a distance of a segment on the z axis: a cylinder with half balls as ends.

    Parameters
    ----------
    radius : float
        Radius, m.
    length : float
        Length between the centres of the half balls as in pybullet, m. It may be 0.

    Examples
    --------
    >>> from overlapper import Capsule
    >>> Capsule(0.1, 0.4).bounds.round(6).tolist()
    [[-0.1, -0.1, -0.3], [0.1, 0.1, 0.3]]
    """

    def __init__(self, radius: float, length: float) -> None: ...

    def __reduce__(self) -> tuple[type, tuple[object, ...]]: ...

    @property
    def radius(self) -> float:
        """Radius, m."""

    @property
    def length(self) -> float:
        """Length between the centres of the half balls, m."""

    @property
    def volume(self) -> float:
        """Volume in m³; infinite for a half-space."""

    @property
    def centroid(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """
        (3,) centre of volume in the shape's frame, m. For a half-space: the boundary point nearest to the origin.
        """

    @property
    def bounds(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (2, 3) lower and upper corner of the bounding box in the shape's frame, m; infinite for a half-space.
        """

    def __repr__(self) -> str: ...

    def __copy__(self) -> object: ...

    def __deepcopy__(self, memo: object) -> object: ...

class Cylinder:
    """
    A cylinder about the origin, along the z axis.

    Parameters
    ----------
    radius : float
        Radius, m.
    length : float
        Length along z, m.

    Examples
    --------
    >>> from overlapper import Cylinder
    >>> round(Cylinder(0.1, 0.4).volume, 6)
    0.012566
    """

    def __init__(self, radius: float, length: float) -> None: ...

    def __reduce__(self) -> tuple[type, tuple[object, ...]]: ...

    @property
    def radius(self) -> float:
        """Radius, m."""

    @property
    def length(self) -> float:
        """Length along z, m."""

    @property
    def volume(self) -> float:
        """Volume in m³; infinite for a half-space."""

    @property
    def centroid(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """
        (3,) centre of volume in the shape's frame, m. For a half-space: the boundary point nearest to the origin.
        """

    @property
    def bounds(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (2, 3) lower and upper corner of the bounding box in the shape's frame, m; infinite for a half-space.
        """

    def __repr__(self) -> str: ...

    def __copy__(self) -> object: ...

    def __deepcopy__(self, memo: object) -> object: ...

class Hull:
    """
    The convex hull of points.

    Points may lie inside the hull, occur twice or be coplanar. Coplanar triangles become one facet.

    Parameters
    ----------
    vertices : (n, 3) array_like
        Four points or more, m.

    Raises
    ------
    ValueError
        If there are fewer than four points, a point is not finite, or all points lie in one plane.

    Examples
    --------
    >>> from overlapper import Hull
    >>> round(Hull([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]).volume, 6)
    0.166667
    """

    def __init__(self, vertices: numpy.typing.ArrayLike) -> None: ...

    @property
    def vertices(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (n, 3) vertices of the hull, m, without those that only rounding errors lift off a facet.
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
        """(n, 3) all vertices of the exact hull of the given points, m."""

    @property
    def triangles(self) -> Annotated[NDArray[numpy.int32], dict(shape=(None, None), writable=False)]:
        """
        (k, 3) triangles of the surface before coplanar triangles are merged: indices into corners, counter-clockwise from outside.
        """

    @property
    def volume(self) -> float:
        """Volume in m³; infinite for a half-space."""

    @property
    def centroid(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """
        (3,) centre of volume in the shape's frame, m. For a half-space: the boundary point nearest to the origin.
        """

    @property
    def bounds(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (2, 3) lower and upper corner of the bounding box in the shape's frame, m; infinite for a half-space.
        """

    def __repr__(self) -> str: ...

    def __copy__(self) -> object: ...

    def __deepcopy__(self, memo: object) -> object: ...

    def __getstate__(self) -> tuple[object, ...]: ...

    def __setstate__(self, state: tuple[object, ...]) -> None: ...

class HalfSpace:
    """
    The closed half-space of all points x with normal · x <= offset.

    The half-space is exactly that of the given numbers. The attributes `normal` and `offset` are divided by the length of
    the normal, which rounds.

    Parameters
    ----------
    normal : (3,) array_like
        Normal out of the solid, of any length but 0.
    offset : float
        Offset along the normal as given, m if the normal has length 1.

    Examples
    --------
    >>> from overlapper import HalfSpace, Placed, Sphere, distance
    >>> distance(Placed(Sphere(0.1), (0, 0, 1)), HalfSpace([0, 0, 1], 0))
    0.9
    """

    def __init__(self, normal: numpy.typing.ArrayLike, offset: float) -> None: ...

    def __reduce__(self) -> tuple[type, tuple[object, ...]]: ...

    @property
    def normal(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """(3,) unit vector out of the solid."""

    @property
    def offset(self) -> float:
        """Offset along the unit normal, m."""

    @property
    def given_normal(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """(3,) normal as given, of any length."""

    @property
    def given_offset(self) -> float:
        """Offset as given, for the normal as given."""

    @property
    def volume(self) -> float:
        """Volume in m³; infinite for a half-space."""

    @property
    def centroid(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """
        (3,) centre of volume in the shape's frame, m. For a half-space: the boundary point nearest to the origin.
        """

    @property
    def bounds(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (2, 3) lower and upper corner of the bounding box in the shape's frame, m; infinite for a half-space.
        """

    def __repr__(self) -> str: ...

    def __copy__(self) -> object: ...

    def __deepcopy__(self, memo: object) -> object: ...

class RoundedHull:
    """
    All points within a distance of the convex hull of points.

    It is the Minkowski sum of the hull and a ball. Bullet collides with such shapes where a convex mesh has a margin. The
    method 'paper' does not accept it. It has no certificate with an ellipsoid that it overlaps, nor among three or more
    bodies that overlap.

    Parameters
    ----------
    vertices : (n, 3) array_like
        Four points or more, m.
    radius : float
        Radius of the ball, m.

    Raises
    ------
    ValueError
        If `Hull` refuses the points, or `Sphere` refuses the radius.

    Examples
    --------
    >>> from overlapper import RoundedHull
    >>> RoundedHull([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], 0.5).bounds.tolist()
    [[-0.5, -0.5, -0.5], [1.5, 1.5, 1.5]]
    """

    def __init__(self, vertices: numpy.typing.ArrayLike, radius: float) -> None: ...

    @property
    def core(self) -> Hull:
        """The hull inside, before rounding."""

    @property
    def radius(self) -> float:
        """Radius of the rounding, m."""

    @property
    def volume(self) -> float:
        """Volume in m³; infinite for a half-space."""

    @property
    def centroid(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """
        (3,) centre of volume in the shape's frame, m. For a half-space: the boundary point nearest to the origin.
        """

    @property
    def bounds(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (2, 3) lower and upper corner of the bounding box in the shape's frame, m; infinite for a half-space.
        """

    def __repr__(self) -> str: ...

    def __copy__(self) -> object: ...

    def __deepcopy__(self, memo: object) -> object: ...

    def __getstate__(self) -> tuple[object, ...]: ...

    def __setstate__(self, state: tuple[object, ...]) -> None: ...

class Ellipsoid:
    """
    An ellipsoid about the origin: all points with (x / a)² + (y / b)² + (z / c)² <= 1.

    An ellipsoid with equal half axes gives the results of the sphere. With a box, a hull or a half-space, an ellipsoid is
    measured as the affine image of a ball. With other round bodies, it is measured between polytopes, as closely as
    `tolerance` demands.

    Parameters
    ----------
    half_axes : (3,) array_like
        Half axes a, b, c along x, y, z, m.

    Examples
    --------
    >>> from overlapper import Ellipsoid
    >>> round(Ellipsoid([0.1, 0.1, 0.2]).volume, 6)
    0.008378
    """

    def __init__(self, half_axes: numpy.typing.ArrayLike) -> None: ...

    def __reduce__(self) -> tuple[type, tuple[object, ...]]: ...

    @property
    def half_axes(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """(3,) half axes, m."""

    @property
    def volume(self) -> float:
        """Volume in m³; infinite for a half-space."""

    @property
    def centroid(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """
        (3,) centre of volume in the shape's frame, m. For a half-space: the boundary point nearest to the origin.
        """

    @property
    def bounds(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (2, 3) lower and upper corner of the bounding box in the shape's frame, m; infinite for a half-space.
        """

    def __repr__(self) -> str: ...

    def __copy__(self) -> object: ...

    def __deepcopy__(self, memo: object) -> object: ...

class Placed:
    """
    A shape and where it is in the world.

    Parameters
    ----------
    shape : shape, (n, 3) array_like or trimesh.Trimesh
        A shape without a pose, or points in m, which stand for their convex hull. Or a closed convex mesh in m.
    position : (3,) or (4, 4) array_like, default (0, 0, 0)
        Position of the shape's origin, m. Or a homogeneous matrix, as in trimesh: a rotation, and a position in m.
    orientation : (4,) array_like or scipy.spatial.transform.Rotation, default (0, 0, 0, 1)
        Quaternion x, y, z, w as in pybullet, of any length but 0. The exact rotation is M(q) / |q|² for the quaternion as
        given. The attribute `orientation` is divided by the length, which rounds. A matrix takes no orientation.

    Raises
    ------
    ValueError
        If an argument has the wrong shape, a pose is not finite, or a matrix scales, shears or reflects by more than 1e-6.
        If a mesh is not closed or not convex.

    Examples
    --------
    >>> from overlapper import Placed, Sphere
    >>> Placed(Sphere(0.5), position=(0, 0, 1)).bounds.tolist()
    [[-0.5, -0.5, 0.5], [0.5, 0.5, 1.5]]
    >>> Placed(Sphere(0.5), [[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 2], [0, 0, 0, 1]]).position.tolist()
    [0.0, 0.0, 2.0]
    """

    def __init__(self, shape: Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | numpy.typing.ArrayLike | trimesh.Trimesh, position: numpy.typing.ArrayLike = (0, 0, 0), orientation: numpy.typing.ArrayLike = (0, 0, 0, 1)) -> None: ...

    @property
    def shape(self) -> Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid: ...

    @property
    def position(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """(3,) position in the world, m."""

    @property
    def orientation(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """(4,) unit quaternion x, y, z, w."""

    @property
    def given_orientation(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """(4,) quaternion x, y, z, w as given, of any length."""

    @property
    def volume(self) -> float:
        """Volume in m³; infinite for a half-space."""

    @property
    def centroid(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """(3,) centre of volume in the world, m."""

    @property
    def bounds(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """(2, 3) lower and upper corner of the bounding box in the world, m."""

    def __repr__(self) -> str: ...

    def __reduce__(self) -> tuple[type, tuple[object, ...]]: ...

    def __copy__(self) -> object: ...

    def __deepcopy__(self, memo: object) -> object: ...

class Errors:
    """
    Error bounds of the quantities of an Overlap, in the same units. They are certified.

    Each quantity is computed in a second way, with bounds of its rounding errors. The error bound is the difference of the
    two results, plus the bound of the second way.
    """

    @property
    def volume(self) -> float:
        """m³, the same as `volume_error`."""

    @property
    def area(self) -> float:
        """m²."""

    @property
    def centroid(self) -> float | None:
        """m, largest distance of the true centroid. None unless overlapping."""

    @property
    def inertia(self) -> float:
        """m⁵, for each entry."""

    @property
    def vertices(self) -> float | None:
        """
        m, largest distance between the hull of the vertices and the common set (Hausdorff distance). None unless
        overlapping. Computed on the first access, which draws the common polytope.
        """

    @property
    def gradient(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (m, 6) m² and m³. Each bounds the length of the error of three entries, and so the error of each entry.

        Where facets of two bodies lie in one plane, the volume has two one-sided derivatives, and the gradient may be either.
        The error bound is then as large as the facet. Where surfaces are nearly tangent, rounding errors move the border between
        them much farther than their own size.
        """

    @property
    def shape_gradient(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (m, 3) m², for each entry. NaN where there is no derivative. Computed on each access.
        """

    @property
    def centroid_gradient(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None, None), writable=False)]:
        """
        (m, 3, 6) 1 and m, for each entry. NaN where there is no derivative. Infinite for bodies that touch,
        and where the error of the volume is as large as the volume. Computed on each access.

        Where facets of two bodies lie in one plane, derivatives are one-sided, and the bound is as large as both sides are apart.
        """

    @property
    def centroid_shape_gradient(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None, None), writable=False)]:
        """
        (m, 3, 3) without unit, for each entry, as `centroid_gradient`. Computed on each access.
        """

    @property
    def vertex_gradients(self) -> list[numpy.typing.NDArray[numpy.float64] | None]:
        """
        For each body, (k,) m²: bounds of the lengths of the errors of the rows; None for other bodies than hulls and rounded
        hulls. Computed on each access.
        """

    @property
    def centroid_vertex_gradients(self) -> list[numpy.typing.NDArray[numpy.float64] | None]:
        """
        For each body, (k,) without unit: bounds of the errors of all nine entries of a vertex; None for other bodies than
        hulls and rounded hulls. NaN where there is no derivative. Infinite for bodies that touch, and where the error of the volume is as large as the
        volume. Computed on each access.
        """

    @property
    def depth(self) -> float | None:
        """
        m. None for three or more bodies. The same holds for `distance` and `witnesses`.
        """

    @property
    def distance(self) -> float | None:
        """m."""

    @property
    def witnesses(self) -> float | None:
        """
        m, sum of the distances of the witness points from their bodies and of the error of their distance. 0 if
        overlapping.
        """

    def __repr__(self) -> str: ...

class Overlap:
    """
    The common set of two or more convex shapes. True only if they overlap.

    An Overlap is immutable. Each quantity is computed at its first use. Units are SI. Coordinates are world coordinates. For
    curved shapes, the polytope contains the common set, and is as close to it as `tolerance` demands.
    """

    @property
    def status(self) -> Literal['separated', 'touching', 'overlapping']:
        """
        'touching' if rounding errors leave open whether the common set has a volume.
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
        Whether the relative error of the volume is at most `tolerance`. It may be larger by rounding errors, or by the
        limit on the number of planes of a curved shape. True for bodies that do not overlap.
        """

    @property
    def method(self) -> Literal['auto', 'paper']: ...

    @property
    def way(self) -> Literal['separation', 'clipping', 'tracing', 'closed form', 'slicing', 'dual hull', 'wide separation', 'wide clipping', 'wide dual hull', 'doubt', 'paper']:
        """
        How the result was computed: the way that found the volume, or the status of bodies that do not overlap.

        'separation': doubles prove a gap. 'clipping': the vertices of each body are compared with the planes of the other.
        'tracing': the curve where two surfaces meet is followed from facet to facet. 'closed form': a formula. 'slicing':
        integrated slices of round bodies. 'dual hull': the convex hull of dual points. 'wide ...': the same in double-double
        arithmetic, where doubles are not accurate enough. 'doubt': double-doubles leave open whether there is a common volume,
        so the status is 'touching'. 'paper': the method `paper`.
        """

    @property
    def facets_touched(self) -> int:
        """Number of planes of the shapes that took part in the measures."""

    @property
    def errors(self) -> Errors:
        """
        Error bound of each quantity, as `volume_error` is that of the volume. They take about as long as all
        quantities together; `errors.vertices` takes as long as `vertices`.
        """

    @property
    def volume(self) -> float:
        """m³, the best estimate; 0 unless overlapping."""

    @property
    def volume_error(self) -> float:
        """
        m³, certified: the true volume is within volume ± volume_error.

        For polyhedra and formulas it bounds the rounding errors: every plane is moved by 16 half-ulps of the coordinates'
        magnitude, times the area. For slices it is the remainder of the series, the rounding errors of their lines, and the sum
        of the area vectors, which is zero for a closed surface. For other curved shapes it is the volume between an outer and an
        inner polytope, plus rounding errors. A pair that touches may have a volume of the size of rounding errors. For method
        'paper' it is the difference from the volume of 'auto', plus the error bound of 'auto'. 0 if separated.
        """

    @property
    def widened(self) -> bool:
        """
        True if double arithmetic could not bound the relative error of the volume by 1e-12. Volume, centroid, area,
        inertia and gradient were then computed again in double-double arithmetic, from the shapes as given.
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
    def shape_gradient(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (m, 3) d volume / d (half extents) of each box, m². For a half-space, d volume / d (offset along its unit normal), then
        zeros. For round bodies: d volume / d radius of a sphere or a rounded hull, then zeros; d volume / d (radius, length) of a
        capsule or a cylinder, then zero; d volume / d (half axes) of an ellipsoid. It is the integral over the common surface of
        the speed at which the surface moves out. Where faces of two bodies lie in one plane, the volume has two one-sided
        derivatives, and the area counts for either body. For groups with a round body, it is that of an enclosing polytope. NaN for
        hulls, which have `vertex_gradients`, and for the length 0 of a capsule. NaN also for the few pairs with an ellipsoid that
        cannot be sliced. Zeros unless overlapping. `errors.shape_gradient` bounds the errors.
        """

    @property
    def vertex_gradients(self) -> list[numpy.typing.NDArray[numpy.float64] | None]:
        """
        For each body, the (k, 3) d volume / d (position of a vertex), world axes, m², of the rows of `Hull.vertices`, or of
        `RoundedHull.core.vertices`; None for other bodies. The vertices of a body have the sum gradient[i, :3]. A facet of more than
        three corners counts as a fan of triangles from its first corner. The volume has other one-sided derivatives there, as a
        vertex that leaves the facet may fold it in another way. For groups with a round body, it is that of an enclosing polytope, and
        NaN for rounded hulls. NaN also for the few rounded hulls that cannot be sliced. Zeros unless overlapping.
        `errors.vertex_gradients` bounds the errors.
        """

    @property
    def hessian(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """
        (6 m, 6 m) second derivatives of the volume by the numbers of `gradient`, in its order: a translation, and a rotation
        vector about the body's own position, of each body. The matrix is symmetric. The volume after a small motion x of all bodies is
        volume + gradient.ravel() @ x + x @ hessian @ x / 2. NaN where a face of one body lies in the plane of a face of another body,
        where round surfaces coincide, and where surfaces touch along a line. Where surfaces touch at a point, or an edge lies in the
        plane of a face, it is one of two one-sided values. m, m² and m³; zeros unless overlapping.

        Raises
        ------
        ValueError
            If there are three or more bodies, and one of them is round.
        """

    @property
    def centroid_gradient(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None, None), writable=False)]:
        """
        (m, 3, 6) d centroid / d (translation, rotation vector about the body's own position) of each body, world axes. Row j of
        a body has the derivatives of coordinate j. 1 and m. The translations of all bodies add up to the identity. Where faces of
        boxes, hulls and half-spaces lie in one plane, derivatives are one-sided, as those of `gradient`. NaN for a pair with a round
        body if surfaces coincide, or touch along a line, and for contacts so shallow that rounding hides where surfaces cross. NaN also
        for three or more bodies with a round body. Zeros unless overlapping. `errors.centroid_gradient` bounds the errors.
        """

    @property
    def centroid_shape_gradient(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None, None), writable=False)]:
        """
        (m, 3, 3) d centroid / d (size) of each body, by the numbers of `shape_gradient`: half extents, radius and length, half
        axes, or the offset of a half-space, then zeros. Row j of a body has the derivatives of coordinate j. Without unit. NaN for
        hulls, for the length 0 of a capsule, and where `centroid_gradient` is NaN. Hulls have `centroid_vertex_gradients`. Zeros unless
        overlapping. `errors.centroid_shape_gradient` bounds the errors.
        """

    @property
    def centroid_vertex_gradients(self) -> list[numpy.typing.NDArray[numpy.float64] | None]:
        """
        For each body, the (k, 3, 3) d centroid / d (position of a vertex), world axes, without unit, of the rows of
        `Hull.vertices`, or of `RoundedHull.core.vertices`; None for other bodies. Row j of a vertex has the derivatives of coordinate j.
        The vertices of a body have the sum centroid_gradient[i, :, :3]. Facets of more than three corners count as in
        `vertex_gradients`. NaN for three or more bodies with a round body, and for rounded hulls where `centroid_gradient` is NaN. Zeros
        unless overlapping. `errors.centroid_vertex_gradients` bounds the errors.
        """

    @property
    def vertices(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """(n, 3) vertices of the common polytope, m; empty unless overlapping."""

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
        """(f,) index of the shape that each facet belongs to."""

    @property
    def patch(self) -> list[numpy.typing.NDArray[numpy.float64]]:
        """
        Closed polygons (k, 3) along the edges where the owner changes, m. The first point is not repeated. For a pair,
        they go counter-clockwise around a's part of the surface. For more bodies, they go around the part of each.
        """

    @property
    def patch_area(self) -> numpy.typing.NDArray[numpy.float64] | None:
        """
        (3,) m², the area vector of b's part of the surface. It points to a, as `normal` does. Its length is the area within
        `patch`, projected along it. For small overlaps it is the derivative of the volume by the depth. It equals
        gradient[1, :3] and -gradient[0, :3]. Zeros unless overlapping. None for three or more bodies. The same holds for
        `patch_centre`, `patch_moments` and `patch_distance`.
        """

    @property
    def patch_centre(self) -> numpy.typing.NDArray[numpy.float64] | None:
        """
        (3,) m, the centre of that area, in the plane through the centroid of the volume. None also without an area: if the
        bodies do not overlap, or one body is inside the other.
        """

    @property
    def patch_moments(self) -> numpy.typing.NDArray[numpy.float64] | None:
        """
        (3, 3) m⁴, ∫ x xᵀ dA of that area about its centre, world axes; zero along the area vector. Its eigenvectors are the
        axes of the patch. The square roots of its eigenvalues divided by the area are the radii of gyration. Where formulas or
        slices measure round bodies, it is that of the round patch, not of polygons.
        """

    @property
    def patch_distance(self) -> float | None:
        """
        m, mean distance of the points of that area from the centroid of the volume, in the plane through it. With friction
        mu and a normal force N, the torque that resists spinning is at most mu * N * patch_distance. It is exact for polyhedra,
        discs and ellipses. Where formulas or slices measure round bodies, other patches count as the ellipse with the same
        centre and moments. That is 2 % too small for a long rectangle, within 1 % for a stadium, within 2 % for a half disc,
        2 % too large for a triangle, and 6 % too small for a thin ring. None without an area.
        """

    @property
    def bounds(self) -> numpy.typing.NDArray[numpy.float64] | None:
        """
        (2, 3) lower and upper corner of the box around the common polytope; None unless overlapping.
        """

    @property
    def normal(self) -> numpy.typing.NDArray[numpy.float64] | None:
        """
        (3,) unit vector from b to a, as pybullet's contactNormalOnB. Moving a by depth * normal separates an overlapping
        pair. Pairs that touch or are separated have a normal, too. None for three or more bodies.
        """

    @property
    def depth(self) -> float | None:
        """
        m, length of the shortest translation that separates the pair; 0 unless overlapping. None for three or more bodies.
        """

    @property
    def depth_gradient(self) -> numpy.typing.NDArray[numpy.float64] | None:
        """
        (2, 6) d depth / d (translation, rotation vector about the body's own position) of a and of b: the unit vector out of
        each body, and its moment at the point where the bodies touch once a is moved by depth * normal. 1 and m; zeros unless
        overlapping, None for three or more bodies. Where the bodies touch with a face or along an edge, rotations have one-sided
        derivatives, and one of the points that touch counts. Where two normals have the same depth, the one of `normal` counts.
        """

    @property
    def depth_shape_gradient(self) -> numpy.typing.NDArray[numpy.float64] | None:
        """
        (2, 3) d depth / d (size) of a and of b, by the numbers of `shape_gradient`: half extents, radius and length, half axes, or
        the offset of a half-space. Without unit; zeros unless overlapping, None for three or more bodies. NaN for hulls.
        """

    @property
    def distance(self) -> float | None:
        """
        m, between the nearest points; 0 unless separated. None for three or more bodies.
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
        A certificate that proves the status and bounds of the volume.

        Its `verify()` checks everything in rational arithmetic, without the core.

        Returns
        -------
        overlapper.proof.claims.Certificate
            `verify()` returns (lower, upper) bounds of the common volume in m³.

        Raises
        ------
        overlapper.proof.claims.CertificateError
            If there is no certificate.
        """

    def __copy__(self) -> object: ...

    def __deepcopy__(self, memo: object) -> object: ...

    def __getstate__(self) -> tuple[object, ...]: ...

    def __setstate__(self, state: tuple[object, ...]) -> None: ...

@overload
def overlap(a: Placed, b: Placed, /) -> Overlap: ...

@overload
def overlap(*shapes: Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | numpy.typing.ArrayLike | trimesh.Trimesh | Placed, tolerance: float = 0.001, method: Literal['auto', 'paper'] = 'auto') -> Overlap:
    """
    The common set of two or more convex shapes.

    >>> from overlapper import Placed, Sphere, overlap
    >>> lens = overlap(Sphere(0.5), Placed(Sphere(0.5), position=(0.6, 0, 0)))
    >>> round(lens.volume, 6), round(lens.depth, 6), lens.normal.tolist()
    (0.108909, 0.4, [-1.0, 0.0, 0.0])

    Parameters
    ----------
    *shapes : shape, Placed, (n, 3) array_like or trimesh.Trimesh
        Two or more bodies. A bare shape lies at the origin. Points in m stand for their convex hull. A mesh in m must be
        closed and convex.
    tolerance : float, default 0.001
        Allowed relative error of the volume for curved shapes, between 0 and 1. Polyhedra are exact and ignore it.
    method : {'auto', 'paper'}, default 'auto'
        'auto' tries the ways of `Overlaps.WAYS`. 'paper' follows the article of Tereshchenko, Chevokin and Fisunenko,
        'Algorithm for finding the domain intersection of a set of polytopes' (ICCS 2013). docs/how.md has its steps.

    Returns
    -------
    Overlap
        SI units, world coordinates. No overlap is a result, not an error: `bool(result)` is False.

    Raises
    ------
    ValueError
        If there are fewer than two shapes, if the common set is unbounded, or if a mesh is not closed or not convex.
    """

def distance(a: Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | numpy.typing.ArrayLike | trimesh.Trimesh | Placed, b: Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | numpy.typing.ArrayLike | trimesh.Trimesh | Placed) -> float:
    """
    Distance between the nearest points of two shapes.

    Parameters
    ----------
    a, b : shape, Placed, (n, 3) array_like or trimesh.Trimesh
        The two bodies, as `overlap` takes them.

    Returns
    -------
    float
        Distance in m. 0 if the bodies touch or overlap.

    Examples
    --------
    >>> from overlapper import Box, Placed, distance
    >>> distance(Box([0.5, 0.5, 0.5]), Placed(Box([0.5, 0.5, 0.5]), (1.25, 0, 0)))
    0.25
    """

def penetration_depth(a: Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | numpy.typing.ArrayLike | trimesh.Trimesh | Placed, b: Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | numpy.typing.ArrayLike | trimesh.Trimesh | Placed) -> float:
    """
    Length of the shortest translation that separates two shapes.

    Parameters
    ----------
    a, b : shape, Placed, (n, 3) array_like or trimesh.Trimesh
        The two bodies, as `overlap` takes them.

    Returns
    -------
    float
        Depth in m. It is positive where pybullet's contact distance is negative. 0 if the bodies do not overlap.

    Raises
    ------
    ValueError
        If both bodies are half-spaces.

    Examples
    --------
    >>> from overlapper import Box, Placed, penetration_depth
    >>> penetration_depth(Box([0.5, 0.5, 0.5]), Placed(Box([0.5, 0.5, 0.5]), (0.75, 0, 0)))
    0.25
    """

def iou(a: Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | numpy.typing.ArrayLike | trimesh.Trimesh | Placed, b: Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | numpy.typing.ArrayLike | trimesh.Trimesh | Placed, tolerance: float = 0.001) -> float:
    """
    Intersection over union of two shapes: the common volume divided by the volume of the union.

    Parameters
    ----------
    a, b : shape, Placed, (n, 3) array_like or trimesh.Trimesh
        The two bodies, as `overlap` takes them.
    tolerance : float, default 0.001
        Allowed relative error of the common volume for curved shapes, between 0 and 1.

    Returns
    -------
    float
        The ratio, from 0 to 1.

    Examples
    --------
    >>> from overlapper import Box, Placed, iou
    >>> round(iou(Box([0.5, 0.5, 0.5]), Placed(Box([0.5, 0.5, 0.5]), (0.5, 0, 0))), 12)
    0.333333333333
    """

class Overlaps:
    """
    Overlaps of many pairs of shapes: an array for each quantity, with a row for each pair.

    Units are SI. Coordinates are world coordinates. The arrays are read-only views. `overlaps[i]` is the Overlap of row i,
    with all its quantities. It is computed again, unless that took long and its Batch was not called since.
    `overlaps[mask]`, a slice or an array of indices selects rows. A pickle has the shapes and poses. The rows are computed
    again from them, bit-identically.
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
        (p,) how the result was computed: an index into Overlaps.WAYS, which has the names of Overlap.way.
        """

    @property
    def volume(self) -> numpy.typing.NDArray[numpy.float64]:
        """(p,) m³; 0 unless overlapping."""

    @property
    def volume_error(self) -> numpy.typing.NDArray[numpy.float64]:
        """(p,) m³, certified: the true volume is within volume ± volume_error."""

    @property
    def centroid(self) -> numpy.typing.NDArray[numpy.float64]:
        """(p, 3) centre of the common volume, m; NaN unless overlapping."""

    @property
    def area_bound(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p,) m², upper bound of `area`. It is the area itself in pairs without an ellipsoid.
        """

    @property
    def normal(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p, 3) unit, from b to a as pybullet's contactNormalOnB; 0 for pairs that are separated.
        """

    @property
    def depth(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p,) m, length of the shortest translation that separates the pair; 0 unless overlapping.
        """

    @property
    def gradient(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p, 2, 6) d volume / d (translation, rotation vector about the body's own position) of a and of b, m² and m³;
        0 unless overlapping.
        """

    @property
    def facets_touched(self) -> numpy.typing.NDArray[numpy.int32]:
        """(p,) number of planes of the shapes that took part in the measures."""

    @property
    def widened(self) -> numpy.typing.NDArray[numpy.bool_]:
        """
        (p,) True where the volume was computed again in double-double arithmetic.
        """

    @property
    def area(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p,) m², of the surface of the common set. Computed on the first use for pairs with an ellipsoid, which takes tens or
        hundreds of microseconds for each.
        """

    @property
    def patch_area(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p, 3) m², the area vector of the patch, from b to a; zeros unless overlapping.
        """

    @property
    def shape_gradient(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p, 2, 3) derivatives of the volume by the sizes of a and of b, m², as Overlap.shape_gradient; zeros unless
        overlapping. The first use takes some microseconds for each pair of polyhedra.
        """

    @property
    def depth_gradient(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p, 2, 6) derivatives of the depth by the poses of a and of b, as Overlap.depth_gradient; zeros unless
        overlapping. The first use takes some microseconds for each pair.
        """

    @property
    def depth_shape_gradient(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p, 2, 3) derivatives of the depth by the sizes of a and of b, as Overlap.depth_shape_gradient; zeros unless
        overlapping.
        """

    @property
    def gradient_error(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p, 2, 6) error bounds of `gradient`, m² and m³, as Overlap.errors.gradient. The first use takes some hundreds of
        microseconds for each pair of polyhedra, and longer for round bodies.
        """

    @property
    def shape_gradient_error(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p, 2, 3) error bounds of `shape_gradient`, m², as Overlap.errors.shape_gradient.
        """

    @property
    def centroid_gradient_error(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p, 2, 3, 6) error bounds of `centroid_gradient`, 1 and m, as Overlap.errors.centroid_gradient. The first use takes
        some hundreds of microseconds for each pair of polyhedra, and longer for round bodies.
        """

    @property
    def centroid_shape_gradient_error(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p, 2, 3, 3) error bounds of `centroid_shape_gradient`, as Overlap.errors.centroid_shape_gradient.
        """

    @property
    def centroid_gradient(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p, 2, 3, 6) derivatives of the centroid by the poses of a and of b, as Overlap.centroid_gradient; zeros unless
        overlapping. The first use takes some tens of microseconds for each pair of polyhedra, and longer for round bodies.
        """

    @property
    def centroid_shape_gradient(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p, 2, 3, 3) derivatives of the centroid by the sizes of a and of b, as Overlap.centroid_shape_gradient; zeros
        unless overlapping.
        """

    @property
    def hessian(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p, 12, 12) second derivatives of the volume by the twelve numbers of `gradient`, as Overlap.hessian; zeros
        unless overlapping. The first use takes some tens of microseconds for each pair of polyhedra, and longer for round bodies.
        """

    @property
    def patch_centre(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p, 3) m, the centre of that area in the plane through the centroid; NaN without an area. The
        first use of the centre, the moments or the distance takes some microseconds for each pair.
        """

    @property
    def patch_moments(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p, 3, 3) m⁴, ∫ x xᵀ dA of that area about its centre; zeros without an area.
        """

    @property
    def patch_distance(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p,) m, mean distance of the points of that area from the centroid, seen along the area vector; NaN
        without an area.
        """

    SEPARATED: int = 0

    TOUCHING: int = 1

    OVERLAPPING: int = 2

    WAYS: tuple = ...

    @property
    def examined(self) -> int:
        """
        Number of pairs that were examined: the given pairs, or those whose bounding boxes meet.
        """

    @property
    def planes_asked(self) -> int:
        """
        Number of planes of the shapes that the call computed: to compare with vertices, to find where a ray leaves a
        shape, or to find the plane nearest to a point.
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
    Shapes whose overlaps are measured again and again while they move.

    Results are reused in the next call. A pair whose poses are bit-identical costs no time. A pair that is still separated
    along the same axis costs little time. All results are bit-identical to those of a first call. Several threads may call
    at the same time. A pickle has only the shapes.

    Parameters
    ----------
    shapes : sequence of shapes
        The k shapes, without poses.

    Examples
    --------
    >>> from overlapper import Batch, Sphere
    >>> batch = Batch([Sphere(0.5), Sphere(0.5)])
    >>> found = batch.overlaps([[0, 0, 0], [0.5, 0, 0]], [[0, 0, 0, 1], [0, 0, 0, 1]])
    >>> found.pairs.tolist(), found.volume.round(6).tolist()
    ([[0, 1]], [0.163625])
    """

    def __init__(self, shapes: Sequence[Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | numpy.typing.ArrayLike | trimesh.Trimesh]) -> None: ...

    def __repr__(self) -> str: ...

    def __getstate__(self) -> tuple[object, ...]: ...

    def __setstate__(self, state: tuple[object, ...]) -> None: ...

    def overlaps(self, positions: numpy.typing.ArrayLike, orientations: numpy.typing.ArrayLike | None = None, pairs: numpy.typing.ArrayLike | None = None, tolerance: float = 0.001, threads: int | None = 1, method: Literal['auto', 'paper'] = 'auto', separated: bool = True) -> Overlaps:
        """
        Overlaps of many pairs of placed shapes in one call, as arrays. Other Python threads run meanwhile.

        Parameters
        ----------
        positions : (k, 3) or (k, 4, 4) array_like
            Positions of the shapes, m. Or homogeneous matrices, as in `Placed`.
        orientations : (k, 4) array_like, optional
            Quaternions x, y, z, w of the shapes, of any length but 0. Matrices take no orientations.
        pairs : (p, 2) array_like of int, optional
            Indices of the shapes of each pair. Default: all pairs that overlap or touch, sorted.
        tolerance : float, default 0.001
            Allowed relative error of the volume for curved shapes, between 0 and 1. Polyhedra are exact and ignore it.
        threads : int or None, default 1
            Number of threads. None: one on each core. The number does not change a bit of the results.
        method : {'auto', 'paper'}, default 'auto'
            Method of computation, as in `overlap`.
        separated : bool, default True
            Whether `pairs` that are separated have rows, too.

        Returns
        -------
        Overlaps
            A row for each pair, bit-identical to what `overlap` returns for the pair.

        Raises
        ------
        ValueError
            If an argument has the wrong shape, a pose is not finite, a matrix scales, shears or reflects by more than 1e-6,
            or half-spaces have an unbounded common set.
        KeyboardInterrupt
            After Ctrl-C. Its attribute `overlaps` has the rows that were finished.
        """

    def candidate_pairs(self, positions: numpy.typing.ArrayLike, orientations: numpy.typing.ArrayLike | None = None) -> numpy.typing.NDArray[numpy.int32]:
        """
        Pairs of shapes whose bounding boxes in the world meet.

        A half-space meets a box that reaches into it. Two half-spaces are not a pair.

        Parameters
        ----------
        positions : (k, 3) or (k, 4, 4) array_like
            Positions of the shapes, m. Or homogeneous matrices, as in `Placed`.
        orientations : (k, 4) array_like, optional
            Quaternions x, y, z, w of the shapes, of any length but 0. Matrices take no orientations.

        Returns
        -------
        (p, 2) ndarray of int32
            Indices i < j of the two shapes, sorted.
        """

class WeldRule:
    """
    MuJoCo's rule of which geoms may collide.

    Parameters
    ----------
    geoms : (n, 7) array_like of int
        Of each geom: contype, conaffinity, its body, the first body of the welded group, the parent of that body, whether no
        joint moves the group, and whether the geom is a plane or a height field.
    excluded : (e,) array_like of int
        Pairs of bodies: 65536 times the lesser number plus the greater.
    listed : (p, 2) array_like of int
        Pairs of rows of `geoms` that may collide in any case.
    by_parent : bool
        Whether parent and child may not collide.
    none : bool
        Whether no geoms may collide.
    """

    def __init__(self, geoms: numpy.typing.ArrayLike, excluded: numpy.typing.ArrayLike, listed: numpy.typing.ArrayLike, by_parent: bool, none: bool) -> None: ...

    def allow(self, first: numpy.typing.ArrayLike, second: numpy.typing.ArrayLike, listed: bool = True) -> numpy.typing.NDArray[numpy.bool_]:
        """
        (p,) whether the geoms in these rows may collide, pair by pair; without `listed`, by the other rules alone.
        """

    def lists(self, first: int, second: int) -> bool:
        """Whether the pair of geoms in these rows is listed, and may collide."""

    def count(self, weights: numpy.typing.ArrayLike) -> int:
        """
        The number of pairs of shapes that may collide; `weights` (n,) is the number of shapes of each geom.
        """

class PairMask:
    """
    Which pairs of shapes may be measured.

    Parameters
    ----------
    groups : (k,) array_like of int
        The group of each shape: a row of the table.
    table : (g, g) ndarray of bool
        Whether shapes of a group may be measured with shapes of another group. It is symmetric.
    """

    def __init__(self, groups: numpy.typing.ArrayLike, table: numpy.typing.NDArray[numpy.bool_]) -> None: ...

    @staticmethod
    def of_rule(groups: numpy.typing.ArrayLike, rule: WeldRule) -> PairMask:
        """
        The pairs that a rule lets collide; `groups` (k,) are the geoms of the shapes, by row of the rule.
        """

def masked_overlaps(batch: Batch, positions: numpy.typing.ArrayLike, orientations: numpy.typing.ArrayLike, mask: PairMask, tolerance: float = 0.001, threads: int | None = 1, method: Literal['auto', 'paper'] = 'auto') -> Overlaps:
    """
    The overlaps of the pairs of a Batch whose boxes meet and that `mask` admits. Separated pairs have no row.
    """

def overlaps(shapes: Sequence[Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | numpy.typing.ArrayLike | trimesh.Trimesh], positions: numpy.typing.ArrayLike, orientations: numpy.typing.ArrayLike | None = None, pairs: numpy.typing.ArrayLike | None = None, tolerance: float = 0.001, threads: int | None = 1, method: Literal['auto', 'paper'] = 'auto', separated: bool = True) -> Overlaps:
    """
    Overlaps of many pairs of placed shapes in one call, as arrays. Other Python threads run meanwhile.

    Parameters
    ----------
    shapes : sequence of shapes
        The k shapes, without poses.
    positions : (k, 3) or (k, 4, 4) array_like
        Positions of the shapes, m. Or homogeneous matrices, as in `Placed`.
    orientations : (k, 4) array_like, optional
        Quaternions x, y, z, w of the shapes, of any length but 0. Matrices take no orientations.
    pairs : (p, 2) array_like of int, optional
        Indices of the shapes of each pair. Default: all pairs that overlap or touch, sorted.
    tolerance : float, default 0.001
        Allowed relative error of the volume for curved shapes, between 0 and 1. Polyhedra are exact and ignore it.
    threads : int or None, default 1
        Number of threads. None: one on each core. The number does not change a bit of the results.
    method : {'auto', 'paper'}, default 'auto'
        Method of computation, as in `overlap`.
    separated : bool, default True
        Whether `pairs` that are separated have rows, too.

    Returns
    -------
    Overlaps
        A row for each pair, bit-identical to what `overlap` returns for the pair.

    Raises
    ------
    ValueError
        If an argument has the wrong shape, a pose is not finite, a matrix scales, shears or reflects by more than 1e-6,
        or half-spaces have an unbounded common set.
    KeyboardInterrupt
        After Ctrl-C. Its attribute `overlaps` has the rows that were finished.
    """

def candidate_pairs(shapes: Sequence[Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | numpy.typing.ArrayLike | trimesh.Trimesh], positions: numpy.typing.ArrayLike, orientations: numpy.typing.ArrayLike | None = None) -> numpy.typing.NDArray[numpy.int32]:
    """
    Pairs of shapes whose bounding boxes in the world meet.

    A half-space meets a box that reaches into it. Two half-spaces are not a pair.

    Parameters
    ----------
    shapes : sequence of shapes
        The k shapes, without poses.
    positions : (k, 3) or (k, 4, 4) array_like
        Positions of the shapes, m. Or homogeneous matrices, as in `Placed`.
    orientations : (k, 4) array_like, optional
        Quaternions x, y, z, w of the shapes, of any length but 0. Matrices take no orientations.

    Returns
    -------
    (p, 2) ndarray of int32
        Indices i < j of the two shapes, sorted.
    """

def world_poses(frames: Sequence[Any] | numpy.typing.NDArray[numpy.float64], which: numpy.typing.NDArray[numpy.int64], positions: numpy.typing.ArrayLike, orientations: numpy.typing.ArrayLike) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
    """
    (k, 3) positions in m and (k, 4) quaternions xyzw in the world of what is fixed to moving frames.

    `frames` begin with position and quaternion, as pybullet's answers do, or they are rows (n, 7) of an array. Thing i is
    fixed to frame `which[i]` at `positions[i]` and `orientations[i]` of it. Quaternions are of any length but 0. Those in
    the world are as long as `orientations`. They are not finite where a frame is not.
    """

class FixedShapes:
    """
    Shapes that are fixed to moving frames.

    Parameters
    ----------
    which : (k,) array_like of int
        The row of each shape's frame.
    positions : (k, 3) array_like
        In the frames, m.
    orientations : (k, 4) array_like
        Quaternions xyzw in the frames.
    """

    def __init__(self, which: numpy.typing.ArrayLike, positions: numpy.typing.ArrayLike, orientations: numpy.typing.ArrayLike) -> None: ...

    def world(self, frames: Sequence[Any] | numpy.typing.NDArray[numpy.float64], farthest: float) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], bool]:
        """
        Positions and quaternions as of `world_poses`, and whether all of them are usable.

        Usable poses are finite, and their coordinates are less than `farthest` in size.
        """

class ChosenFrames:
    """
    Rows of arrays of poses that a simulator owns and changes.

    Parameters
    ----------
    positions : (n, 3) ndarray
        In m.
    quaternions : (n, 4) ndarray
        In the order wxyz.
    which : (k,) array_like of int
        The rows.
    """

    def __init__(self, positions: numpy.typing.NDArray[numpy.float64], quaternions: numpy.typing.NDArray[numpy.float64], which: numpy.typing.ArrayLike) -> None: ...

    def read(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (k, 7) positions and quaternions xyzw of these rows now, for `FixedShapes.world`.
        """

def any_moved(positions: numpy.typing.ArrayLike, origin: numpy.typing.ArrayLike, turn: numpy.typing.ArrayLike, before: numpy.typing.ArrayLike, slack: numpy.typing.ArrayLike, meets: numpy.typing.NDArray[numpy.bool_]) -> bool:
    """
    Whether one of the points in `meets` (n,) has moved by more than its `slack` (n,) along an axis.

    Coordinates are turn @ (position - origin). `before` (n, 3) are the earlier coordinates.
    """

class Snapshot:
    """
    Copies of arrays of numpy, to notice edits.

    Parameters
    ----------
    arrays : iterable of ndarray
        Contiguous arrays of any type.
    """

    def __init__(self, arrays: Iterable[numpy.typing.NDArray[Any]]) -> None: ...

    def renew(self) -> bool:
        """
        Copy the arrays again. True if any bit has changed since the last copy.
        """

class ShapeArray:
    """
    Placed shapes of one kind, a row each. The functions of `overlapper.arrays` make them.
    """

    def __len__(self) -> int: ...

    def __getitem__(self, row: int) -> Placed: ...

    def __repr__(self) -> str: ...

    @property
    def kind(self) -> str:
        """
        'boxes', 'rectangles', 'spheres', 'capsules', 'cylinders' or 'ellipsoids'.
        """

    @property
    def volume(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]:
        """(n,) m³ of each row; m² of rectangles."""

    @property
    def positions(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]:
        """(n, 3) positions of the centres, m."""

    @property
    def rotations(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n, 3, 3) rotation matrices, from the coordinates of each shape to the world.
        """

    @property
    def bounds(self) -> numpy.typing.NDArray[numpy.float64]:
        """(n, 2, 3) lower and upper corner of the bounding box of each row, m."""

def boxes(sizes: numpy.typing.ArrayLike, positions: numpy.typing.ArrayLike | None = None, orientations: numpy.typing.ArrayLike | None = None) -> ShapeArray:
    """Documented in overlapper.arrays."""

def spheres(radii: numpy.typing.ArrayLike, positions: numpy.typing.ArrayLike | None = None) -> ShapeArray:
    """Documented in overlapper.arrays."""

def capsules(radii: numpy.typing.ArrayLike, lengths: numpy.typing.ArrayLike, positions: numpy.typing.ArrayLike | None = None, orientations: numpy.typing.ArrayLike | None = None) -> ShapeArray:
    """Documented in overlapper.arrays."""

def cylinders(radii: numpy.typing.ArrayLike, lengths: numpy.typing.ArrayLike, positions: numpy.typing.ArrayLike | None = None, orientations: numpy.typing.ArrayLike | None = None) -> ShapeArray:
    """Documented in overlapper.arrays."""

def ellipsoids(half_axes: numpy.typing.ArrayLike, positions: numpy.typing.ArrayLike | None = None, orientations: numpy.typing.ArrayLike | None = None) -> ShapeArray:
    """Documented in overlapper.arrays."""

def rectangles(rectangles: numpy.typing.ArrayLike, name: str) -> ShapeArray:
    """Documented in overlapper.arrays."""

def fit_boxes(corners: numpy.typing.ArrayLike, name: str) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.int32]]:
    """
    The boxes of (n, 8, 3) corners: (n, 3) sizes and (n, 3) positions in m, (n, 4) quaternions xyzw, and (n, 8) the index
    of the given corner at each place of pytorch3d's order. `name` is the argument in messages.
    """

def common_volumes(a: ShapeArray, b: ShapeArray, aligned: bool, tolerance: float, threads: int | None) -> numpy.typing.NDArray[numpy.float64]:
    """
    Common volumes in m³: (n,) of row i of both, or (n, m) of every row of `a` with every row of `b`.
    """

def volumes_around(a: ShapeArray, b: ShapeArray, aligned: bool, threads: int | None) -> numpy.typing.NDArray[numpy.float64]:
    """
    Volumes in m³ of the convex hull of each pair of boxes, as `common_volumes` arranges them.
    """

def volume_gradients(a: ShapeArray, b: ShapeArray, weights: numpy.typing.ArrayLike, aligned: bool, tolerance: float, threads: int | None) -> tuple[tuple[numpy.typing.NDArray[numpy.float64], ...], tuple[numpy.typing.NDArray[numpy.float64], ...]]:
    """
    The derivatives of the weighted sum of common volumes, for the rows of `a` and of `b`: (n, 3) by the numbers of the
    shape as in Overlap.shape_gradient, (n, 3) by the position, and (n, 3) by a rotation vector about the position.
    """

def volume_second_derivatives(a: ShapeArray, b: ShapeArray, weights: numpy.typing.ArrayLike, along_a: numpy.typing.ArrayLike, along_b: numpy.typing.ArrayLike, aligned: bool, tolerance: float, threads: int | None) -> tuple[numpy.typing.NDArray[numpy.float64], tuple[numpy.typing.NDArray[numpy.float64], ...], tuple[numpy.typing.NDArray[numpy.float64], ...]]:
    """
    The second derivatives of the weighted sum of common volumes of polyhedra, times a direction, as `volume_gradients`
    arranges them. Before them, flat, the derivative of each pair's volume along the direction. A row of `along_a` (n, 9) and
    `along_b` (m, 9) has the numbers of the shape, the position and the rotation vector.
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

    @staticmethod
    def of_trees(coordinates: numpy.typing.ArrayLike, trees: numpy.typing.ArrayLike, moved: numpy.typing.ArrayLike) -> ContactSolver:
        """
        A solver for trees of a simulator that knows masses and motions itself and gives them to `move`.

        `coordinates` (t,) are the numbers of coordinates of the trees. `trees` (n,) is the tree of each link, -1 of a link that
        stands still. `moved` (m, 2) has a row for each coordinate that moves a link: the place of the link, and the place of
        the coordinate in the tree.
        """

    def move(self, linear: numpy.typing.ArrayLike, angular: numpy.typing.ArrayLike, points: numpy.typing.ArrayLike, inverse_mass: numpy.typing.ArrayLike) -> None:
        """
        Take the motions and the masses of trees, before `place`.

        A unit of a coordinate moves its links by a row of each of three (c, 3) arrays: the velocity at a point, the angular
        velocity, and that point, in the world. `inverse_mass` (c, w) has a row for each coordinate. The row begins with the
        numbers for the coordinates of its tree; w is the size of the largest tree.
        """

    def copy(self) -> ContactSolver:
        """
        Another one that knows the same of the last step: what it solves changes nothing here.
        """

    def place(self, frames: Sequence[Any], overlaps: Overlaps, links: numpy.typing.NDArray[numpy.int64], stiffness: numpy.typing.ArrayLike, dissipation: numpy.typing.ArrayLike, friction: numpy.typing.ArrayLike, recovery: numpy.typing.ArrayLike | None = None, restitution: numpy.typing.ArrayLike | None = None, rolling: numpy.typing.ArrayLike | None = None, spinning: numpy.typing.ArrayLike | None = None, tops: numpy.typing.ArrayLike | None = None, hardening: numpy.typing.ArrayLike | None = None) -> numpy.typing.NDArray[numpy.float64]:
        """
        Put the links where they are, and take what their shapes share; `links` (k,) is the place of each shape's link.

        `frames` begin with position and quaternion of the inertial frame, as pybullet's answers do. By row of `overlaps` (p,):
        stiffness in Pa/m, dissipation in s, and the coefficient of friction. The others are 0 if they are not given: `recovery`
        in s, by which pressures follow the mean motion of the two links along the normal besides the dissipation; `restitution`,
        the speed after an impact over the speed before, which needs a recovery; `rolling` and `spinning` in m, the torques
        against rolling and against spinning over the force. Friction on the area resists spinning besides. `tops` (k, 3) has the normal of the top of each prism of a height field, in the frame of the prism,
        and zeros for other shapes. A prism presses with its top alone, because its vertical walls are inside the field.
        `hardening` in 1/m is c of the pressure k d (1 + c d) at the depth d. It must be 0 for pairs without a half-space. The
        answer (p,) is the square of a frequency,
        (rad/s)², that no way of swinging of the two bodies on all of their patches exceeds.
        """

    @property
    def depths(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p,) the mean depth of each patch in m: its volume over its area, 0 without a patch.
        """

    @property
    def before(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (p, 6) what the last `solve` took from the step before for each patch: its centroid then in m, the duration of that
        step in s, and to which part the patch kept its place then and now. All are 0 for patches that were not known then.
        """

    def travel(self, duration: float, velocity: numpy.typing.ArrayLike) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """
        How far bodies move within `duration` (s) at this `velocity` of all coordinates.

        (p, 2): how far the two surfaces of each patch move over each other at its centroid, in m, and how far they turn, in
        rad. (n, 2): the same for the centre of mass of each link in the world.
        """

    def ahead(self, duration: float, velocity: numpy.typing.ArrayLike, links: numpy.typing.NDArray[numpy.int64], positions: numpy.typing.ArrayLike, orientations: numpy.typing.ArrayLike) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """
        (k, 3) positions in m and (k, 4) quaternions xyzw where shapes on these `links`, (k,) as for `place`, come to after
        `duration` (s), from where they are now, if links go on with the `velocity` of all coordinates.
        """

    def solve(self, duration: float, velocity: numpy.typing.ArrayLike, acceleration: numpy.typing.ArrayLike, damped: numpy.typing.ArrayLike | None, distributed: bool, ahead: Sequence[Any] | None = None, motors: numpy.typing.ArrayLike | None = None, constraints: numpy.typing.ArrayLike | None = None, settled: float = 1e-08) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.bool_], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], int, float]:
        """
        The forces within a step of that `duration` (s), from `velocity` and `acceleration` of all coordinates, the latter
        without the patches, the motors and the constraints. Rows that are `damped` choose stability over energy; without the argument, no row
        does. `ahead` has a pair for each link: the position of its centre of mass after the step, in m, if the coordinates keep
        their velocity, and the quaternion xyzw of its rotation until then. The trees of a simulator need it if there are
        patches. `motors` (m, 4) are rows of a coordinate, a target, a gain from 0 to 1 and the largest force. A motor alone
        changes the velocity v that its coordinate would have without it to (1 - gain) v + target. Motors of the trees of a
        simulator do nothing.

        `constraints` (k, 23) are constraints between two links, which hold as Bullet's do. A row has a key, which is the same in
        every step; the kind, 0 for a point, 1 fixed, 2 for a slider; the places of the links, -1 for the world; position and
        quaternion xyzw of the constraint in the inertial frame of each link; the axis of a slider in the frame of the first
        link; the velocity that corrects an error of position over the error, in 1/s; and the largest force in each direction.

        (p, 3) force, torque about the centroid and slip of a over b, (p, 3) normal, (p,) whether that is one of now and not the
        last known, (n, 6) force and torque of patches on the links about their centres of mass, (k, 6) the forces of
        constraints on their first links, three forces and three torques along their directions, the part of patches, motors and constraints in the acceleration, how often the patches were gone through, and the largest
        change of a slip in the last time, as a fraction of the largest slip.
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

class TimeOfImpact:
    """The answer of `time_of_impact`. It is true unless `separated`."""

    @property
    def status(self) -> Literal['separated', 'impact', 'touching', 'overlapping', 'open']:
        """
        'separated': the bodies have no common point during the motion.
        'impact': they are separated before `time` and overlap at `time_upper`.
        'touching': they come so close that rounding decides whether they meet, or they overlap for a shorter time than the
        tolerance, or they touch at the start.
        'overlapping': they overlap at the start.
        'open': the limit of steps was reached. They are separated before `time`; nothing is known after it.
        """

    @property
    def time(self) -> float | None:
        """s, not later than the first common point. None if separated."""

    @property
    def time_upper(self) -> float | None:
        """
        s, not earlier than the first common point of an impact. If touching, the time after which the pair is
        certainly separated again, or the end of the motion. None if separated.
        """

    @property
    def normal(self) -> numpy.typing.NDArray[numpy.float64] | None:
        """(3,) unit vector from b to a at `time`. None if separated."""

    @property
    def point(self) -> numpy.typing.NDArray[numpy.float64] | None:
        """
        (3,) m, half-way between the nearest points at a time from `time` to `time_upper`; the centroid of the common set if
        overlapping. None if separated.
        """

    @property
    def distance(self) -> float:
        """
        m, the least distance of the computed poses: an upper bound of the least distance of the motion.
        """

    @property
    def distance_time(self) -> float:
        """s, when `distance` was seen."""

    @property
    def converged(self) -> bool:
        """False if `time_upper - time` is longer than the tolerance."""

    @property
    def steps(self) -> int:
        """Number of distances computed."""

    def __bool__(self) -> bool: ...

    def __repr__(self) -> str: ...

    def __copy__(self) -> object: ...

    def __deepcopy__(self, memo: object) -> object: ...

    def __getstate__(self) -> tuple[object, ...]: ...

    def __setstate__(self, state: tuple[object, ...]) -> None: ...

def time_of_impact(a: Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | numpy.typing.ArrayLike | trimesh.Trimesh | Placed, b: Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | numpy.typing.ArrayLike | trimesh.Trimesh | Placed, motion_a: tuple[numpy.typing.ArrayLike, numpy.typing.ArrayLike] | Placed | None = None, motion_b: tuple[numpy.typing.ArrayLike, numpy.typing.ArrayLike] | Placed | None = None, duration: float = 1.0, tolerance: float = 1e-09) -> TimeOfImpact:
    """
    The time of the first common point of two moving shapes.

    The position of each body moves along a line, and the body turns about its position. Both velocities are constant.

    Parameters
    ----------
    a, b : shape, Placed, (n, 3) array_like or trimesh.Trimesh
        The two bodies at time 0, as `distance` takes them.
    motion_a, motion_b : tuple of two (3,) array_like, or Placed, optional
        Linear velocity in m/s and angular velocity in rad/s, both in the world; or the body at the end of the motion. From
        a Placed only the pose is read, and the body turns the shorter way. Its velocities are rounded, so the end is
        reached up to rounding. None: at rest.
    duration : float, default 1.0
        Length of the motion in s.
    tolerance : float, default 1e-9
        Wanted width of the interval of times, as a fraction of `duration`.

    Returns
    -------
    TimeOfImpact
        `time` is never later than the first common point. Rounding is included in this bound. No common point is a result,
        not an error: `bool(result)` is False.

    Raises
    ------
    ValueError
        If both bodies are half-spaces, if `duration` is not positive, or if a motion is not finite.

    Examples
    --------
    >>> from overlapper import Box, Placed, Sphere, time_of_impact
    >>> bullet, sheet = Placed(Sphere(0.01), (0, 0, 1)), Box([1, 1, 0.0005])
    >>> hit = time_of_impact(bullet, sheet, ((0, 0, -300), (0, 0, 0)), duration=0.01)
    >>> hit.status, round(hit.time, 9)
    ('impact', 0.003298333)
    """

class TimesOfImpact:
    """
    The answers of `times_of_impact`: an array for each quantity, with a row for each pair.

    `found[i]` is the TimeOfImpact of row i.
    """

    STATUSES: tuple = ...

    @property
    def pairs(self) -> numpy.typing.NDArray[numpy.int32]:
        """(p, 2) indices of the shapes a and b of each row."""

    @property
    def status(self) -> numpy.typing.NDArray[numpy.int32]:
        """
        (p,) an index into TimesOfImpact.STATUSES, which has the names of TimeOfImpact.status.
        """

    @property
    def time(self) -> numpy.typing.NDArray[numpy.float64]:
        """(p,) s, not later than the first common point; NaN if separated."""

    @property
    def time_upper(self) -> numpy.typing.NDArray[numpy.float64]:
        """(p,) s, as in TimeOfImpact; NaN if separated."""

    @property
    def normal(self) -> numpy.typing.NDArray[numpy.float64]:
        """(p, 3) unit, from b to a at `time`; NaN if separated."""

    @property
    def point(self) -> numpy.typing.NDArray[numpy.float64]:
        """(p, 3) m, as in TimeOfImpact; NaN if separated."""

    @property
    def distance(self) -> numpy.typing.NDArray[numpy.float64]:
        """(p,) m, the least distance of the computed poses."""

    @property
    def distance_time(self) -> numpy.typing.NDArray[numpy.float64]:
        """(p,) s, when `distance` was seen."""

    def __len__(self) -> int: ...

    def __getitem__(self, row: SupportsIndex) -> TimeOfImpact: ...

    def __repr__(self) -> str: ...

    def __getstate__(self) -> tuple[object, ...]: ...

    def __setstate__(self, state: tuple[object, ...]) -> None: ...

def times_of_impact(shapes: Sequence[Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | numpy.typing.ArrayLike | trimesh.Trimesh] | Batch, positions: numpy.typing.ArrayLike, orientations: numpy.typing.ArrayLike | None, end_positions: numpy.typing.ArrayLike, end_orientations: numpy.typing.ArrayLike | None, pairs: numpy.typing.ArrayLike | None = None, duration: float = 1.0, tolerance: float = 1e-09, threads: int | None = 1) -> TimesOfImpact:
    """
    The times of the first common points of many pairs of moving shapes.

    The position of each shape moves along a line at a constant velocity. The shape turns at a constant rate the shorter
    way.

    Parameters
    ----------
    shapes : sequence of shapes, or Batch
        The k shapes, without poses.
    positions, orientations : (k, 3) and (k, 4) array_like, or (k, 4, 4) array_like and None
        Poses at time 0, as `overlaps` takes them.
    end_positions, end_orientations : (k, 3) and (k, 4) array_like, or (k, 4, 4) array_like and None
        Poses at the end of the motion.
    pairs : (p, 2) array_like of int, optional
        Indices of the shapes of each pair. Default: all pairs that are not separated during the whole motion, sorted. Boxes
        around the whole motion of each shape tell which pairs are examined.
    duration : float, default 1.0
        Length of the motion in s.
    tolerance : float, default 1e-9
        Wanted width of the intervals of times, as a fraction of `duration`.
    threads : int or None, default 1
        Number of threads. None: one on each core. The number does not change a bit of the results.

    Returns
    -------
    TimesOfImpact
        A row for each pair, as from `time_of_impact`.

    Raises
    ------
    ValueError
        If an argument has the wrong shape, a pose is not finite, or `pairs` has a pair of two half-spaces.

    Examples
    --------
    >>> from overlapper import Box, Sphere, times_of_impact
    >>> still = [[0, 0, 0, 1]] * 2
    >>> found = times_of_impact([Sphere(0.01), Box([1, 1, 0.001])], [[0, 0, 1], [0, 0, 0]], still,
    ...                         [[0, 0, -2], [0, 0, 0]], still)
    >>> found.pairs.tolist(), found.time.round(6).tolist()
    ([[0, 1]], [0.329667])
    """

def swept_pairs(shapes: Sequence[Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | numpy.typing.ArrayLike | trimesh.Trimesh] | Batch, positions: numpy.typing.ArrayLike, orientations: numpy.typing.ArrayLike | None, end_positions: numpy.typing.ArrayLike, end_orientations: numpy.typing.ArrayLike | None) -> numpy.typing.NDArray[numpy.int32]:
    """
    The pairs of shapes whose boxes around the whole motion meet: (p, 2) indices i < j, sorted.
    """

class MovingPair:
    """Two moving bodies, in coordinates about the position of b."""

    def __init__(self, a: Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | numpy.typing.ArrayLike | trimesh.Trimesh | Placed, b: Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | numpy.typing.ArrayLike | trimesh.Trimesh | Placed, motion_a: tuple[numpy.typing.ArrayLike, numpy.typing.ArrayLike] | Placed | None, motion_b: tuple[numpy.typing.ArrayLike, numpy.typing.ArrayLike] | Placed | None, duration: float) -> None: ...

    def at(self, time: float) -> tuple[Placed, Placed]:
        """Both bodies at a time in s."""

    def drift(self, time: float, half: float, of_a: bool) -> tuple[numpy.typing.NDArray[numpy.float64], float]:
        """
        (3,) m/s, a velocity of a in the frame of b within `half` seconds of a time, or of b in the frame of a.

        Then a bound in m: how far the common points are beside a translation at this velocity.
        """

    def most_depth(self, start: float, normal_start: numpy.typing.ArrayLike, end: float, normal_end: numpy.typing.ArrayLike) -> float:
        """
        An upper bound of the depth in m between two times, from the normals of `Overlap` there.
        """

    @property
    def lost(self) -> float:
        """m: rounding of a depth."""

def swept_supports(body: Sphere | Box | Capsule | Cylinder | Hull | HalfSpace | RoundedHull | Ellipsoid | numpy.typing.ArrayLike | trimesh.Trimesh | Placed, motion: tuple[numpy.typing.ArrayLike, numpy.typing.ArrayLike] | Placed | None, duration: float, directions: numpy.typing.ArrayLike, within: float) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
    """
    How far a moving body reaches along each of n directions, from its position at the start.

    (n,) upper bounds in m, and (n, 3) points of the body at some time that are less far by `within` m at most.
    """
