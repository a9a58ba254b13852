"""The common volume of two unions of convex shapes, every point counted once.

For unions ∪A and ∪B, inclusion–exclusion gives the volume as a sum over all sets S of A's shapes and T of B's shapes.
The terms are (−1)^(|S| + |T|) vol(∩S ∩ ∩T). Every term is an overlap of convex bodies with its own error bound. If an
overlap is empty, terms with more shapes are empty, too, and are not computed. If n shapes overlap each other, there
would be 2^n terms. The union is then divided into cells: its largest member, and, beyond each face of this member, the
parts of the other members. The cells are disjoint by construction, whatever rounding does to the planes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from overlapper._core import Box, HalfSpace, Overlap, Placed, overlap
from overlapper.shapes.table import KINDS

Array = NDArray[np.float64]
Method = Literal["auto", "paper"]

# The most terms per pair of inclusion–exclusion; beyond, cells are used. n shapes that overlap each other have
# (2^n − 1)/n terms per pair, so more than six are divided into cells. For boxes, cells are then faster. Cells of smooth
# shapes are inaccurate, so up to twelve of these stay in the sum.
TERMS = 16
SMOOTH_TERMS = 400

# The least tolerance of smooth shapes in cells, because every facet of a smooth member is the wall of a cell. Two
# spheres make 1281 cells at 0.001, which take minutes. Polyhedra are exact at any tolerance.
COARSE = 0.1


@dataclass(slots=True)
class UnionOverlap:
    """The overlap of two unions. True only if they overlap.

    `volume` (m³) is within `volume_error` of the true volume. It is a sum over `terms` convex parts.
    """

    volume: float = 0.0
    volume_error: float = 0.0
    # Each part with its sign and, for each of its bodies, the union to which the body belongs.
    _parts: list[tuple[int, Overlap, Sequence[int]]] = field(default_factory=list)

    def __bool__(self) -> bool:
        return self.volume > 0

    @property
    def terms(self) -> int:
        return len(self._parts)

    @property
    def about(self) -> Array | None:
        """(3,) the centre of rotation of `gradient`: the centroid of one part, in m; None unless the unions overlap."""
        return next(np.asarray(part.centroid) for _, part, _ in self._parts if part) if self else None

    @property
    def centroid(self) -> Array | None:
        """(3,) the centroid of the common part, in the world, in m; None unless the unions overlap."""
        if not self:
            return None
        about = np.asarray(self.about)
        moments = [sign * part.volume * (np.asarray(part.centroid) - about) for sign, part, _ in self._parts if part]
        return np.asarray(about + np.sum(moments, axis=0) / self.volume)

    @property
    def gradient(self) -> Array:
        """(2, 6) derivative of the volume by the motion of each whole union; zeros unless the unions overlap.

        Columns: translation (m²) and rotation vector about `about` (m³), in world axes.
        """
        gradient = np.zeros((2, 6))
        about = np.asarray(self.about)
        for sign, part, sides in self._parts if self else ():
            for side, body, slope in zip(sides, part.shapes, part.gradient):
                gradient[side, :3] += sign * slope[:3]
                gradient[side, 3:] += sign * (slope[3:] + np.cross(body.position - about, slope[:3]))
        return gradient

    def _add(self, sign: int, part: Overlap, sides: Sequence[int]) -> None:
        self._parts.append((sign, part, sides))
        self.volume_error += part.volume_error
        self.volume += sign * part.volume


def union_overlap(
    a: Sequence[Placed], b: Sequence[Placed], tolerance: float = 1e-3, method: Method = "auto"
) -> UnionOverlap:
    """The overlap of the union of the shapes `a` with the union of the shapes `b`.

    `tolerance` and `method` are passed to `overlapper.overlap` for every pair.
    """
    pairs = {
        (i, j): overlap(x, y, tolerance=tolerance, method=method) for i, x in enumerate(a) for j, y in enumerate(b)
    }
    return of_pairs(a, b, {pair: each for pair, each in pairs.items() if each.status != "separated"})


def of_pair(common: Overlap) -> UnionOverlap:
    """The result of `union_overlap` for two single shapes, from their overlap."""
    found = UnionOverlap()
    found._add(1, common, (0, 1))
    return found


def of_pairs(a: Sequence[Placed], b: Sequence[Placed], pairs: Mapping[tuple[int, int], Overlap]) -> UnionOverlap:
    """The result of `union_overlap`, from the overlaps of a[i] and b[j] by (i, j), of all pairs not separated."""
    solid = {pair: each for pair, each in pairs.items() if each}
    for method in (_inclusion_exclusion, _cells):
        found = UnionOverlap(volume_error=sum(each.volume_error for each in pairs.values() if not each))
        if method(found, a, b, solid):
            break
    return found


def union_volume(shapes: Sequence[Placed]) -> tuple[float, float]:
    """Volume (m³) of the union of bounded shapes, and a bound of its error. Raises ValueError for unbounded shapes."""
    if not shapes:
        return 0.0, 0.0
    if not all(KINDS[type(each.shape)].bounded for each in shapes):
        raise ValueError("shapes must be bounded, because the volume of a half-space is infinite")
    low, high = (end([shape.bounds[k] for shape in shapes], axis=0) for k, end in enumerate((np.min, np.max)))
    around = Placed(Box(0.75 * (high - low)), (low + high) / 2)
    found = union_overlap(shapes, [around])
    return found.volume, found.volume_error


def _inclusion_exclusion(
    found: UnionOverlap, a: Sequence[Placed], b: Sequence[Placed], pairs: Mapping[tuple[int, int], Overlap]
) -> bool:
    """Add up all terms. False if there are too many; the sum is then invalid."""
    tolerance = max((each.tolerance for each in pairs.values()), default=COARSE)
    smooth = any(KINDS[type(each.shape)].planes is None for each in (*a, *b))
    most = (SMOOTH_TERMS if smooth else TERMS) * len(pairs)
    boxes = {pair: np.asarray(each.bounds) for pair, each in pairs.items()}
    waiting: list[tuple[tuple[int, ...], tuple[int, ...], Array]] = []
    for (i, j), each in pairs.items():
        found._add(1, each, (0, 1))
        waiting.append(((i,), (j,), boxes[i, j]))
    while waiting:
        first, second, box = waiting.pop()
        for s, t, met in _one_more(first, second, boxes):
            low = np.max([box[0], *(boxes[pair][0] for pair in met)], axis=0)
            high = np.min([box[1], *(boxes[pair][1] for pair in met)], axis=0)
            if not (low < high).all():
                continue
            if found.terms >= most:
                return False
            part = overlap(*(a[i] for i in s), *(b[j] for j in t), tolerance=tolerance)
            found._add((-1) ** (len(s) + len(t)), part, (0,) * len(s) + (1,) * len(t))
            if part:
                waiting.append((s, t, np.array([low, high])))
    return True


def _one_more(
    first: tuple[int, ...], second: tuple[int, ...], boxes: Mapping[tuple[int, int], Array]
) -> Iterator[tuple[tuple[int, ...], tuple[int, ...], list[tuple[int, int]]]]:
    """The two sets with one more shape, and the new pairs. Every combination of two sets is reached in only one way.

    The first set grows while the second set has one shape. Then the second set grows. Both grow in increasing order.
    """
    if len(second) == 1:
        for i, j in boxes:
            if j == second[0] and i > first[-1]:
                yield (*first, i), second, [(i, j)]
    for i, j in boxes:
        if i == first[0] and j > second[-1]:
            met = [(other, j) for other in first]
            if all(pair in boxes for pair in met):
                yield first, (*second, j), met


def _cells(
    found: UnionOverlap, a: Sequence[Placed], b: Sequence[Placed], pairs: Mapping[tuple[int, int], Overlap]
) -> bool:
    """Add up disjoint cells: the largest member of a region, then the parts of the others beyond each of its faces."""
    tolerance = max([COARSE, *(each.tolerance for each in pairs.values())])
    # Regions still to be added: their members, and the half-spaces that bound them, each with the union of its body.
    waiting: list[tuple[dict[tuple[int, int], Overlap], list[tuple[Placed, int]]]] = [
        ({(i, j): overlap(a[i], b[j], tolerance=tolerance) for i, j in pairs}, [])
    ]
    while waiting and pairs:
        members, cuts = waiting.pop()
        largest = max(members, key=lambda pair: members[pair].volume)
        whole = members.pop(largest)
        sides = [0, 1, *(side for _, side in cuts)]
        found._add(1, whole, sides)
        # A smooth member is smaller than its polytope. The space between is in no cell.
        found.volume_error += 2 * whole.volume_error + max(0.0, _volume_within(whole) - whole.volume)
        planes = whole.halfspaces
        heights = {pair: planes[:, :3] @ each.vertices.T + planes[:, 3:] for pair, each in members.items()}
        walls = list(cuts)
        for k, (plane, owner) in enumerate(zip(planes, whole.owner)):
            beyond = [*walls, (Placed(HalfSpace(-plane[:3], plane[3])), sides[owner])]
            walls.append((Placed(HalfSpace(plane[:3], -plane[3])), sides[owner]))
            region: dict[tuple[int, int], Overlap] = {}
            for (i, j), above in heights.items():
                if above[k].max() <= 0 or (above[:k].min(axis=1) >= 0).any():
                    continue  # on the inner side of this face, or beyond an earlier face
                part = overlap(a[i], b[j], *(wall for wall, _ in beyond), tolerance=tolerance)
                if part:
                    region[i, j] = part
                else:
                    found.volume_error += part.volume_error
            if region:
                waiting.append((region, beyond))
    return True


def _volume_within(whole: Overlap) -> float:
    """The volume within the faces of an overlap, in m³."""
    a, b, c = np.moveaxis(whole.vertices[whole.faces] - np.asarray(whole.centroid), 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)
