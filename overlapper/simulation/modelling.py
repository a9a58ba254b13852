"""The shapes of a link as convex shapes, or the reasons why they are not modelled."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from overlapper import Box, Capsule, Cylinder, HalfSpace, Hull, RoundedHull, Shape, Sphere
from overlapper.polytopes.decomposition import Decomposition, NotDecomposed, decompose
from overlapper.quaternion import composed, rotated
from overlapper.simulation.model import Leaf, ModelledShape
from overlapper.simulation.settings import Modelling


def modelled(
    link: int, leaves: tuple[Leaf, ...], modelling: Modelling
) -> tuple[list[ModelledShape], list[str], list[tuple[range, Decomposition]]]:
    """The leaves of a link as shapes, reasons for leaves without shapes, and the ranges of parts of concave meshes."""
    made: list[ModelledShape] = []
    reasons: list[str] = []
    meshes: list[tuple[range, Decomposition]] = []
    for saved in leaves:
        leaf = _capsule(saved) if saved.kind == "multisphere" else saved
        first = len(made) + len(reasons)
        try:
            shapes: Sequence[Shape]
            if leaf.kind == "concave mesh":
                mesh = _solid(leaf.figures.tobytes(), modelling)
                shapes = mesh.parts
                meshes.append((range(first, first + len(shapes)), mesh))
            else:
                margin = leaf.margin if modelling.surface == "margin" else 0.0
                shapes = [_shape(leaf.kind, leaf.figures.tobytes(), margin)]
        except ValueError as error:
            reasons.append(str(error))
        else:
            made += [
                ModelledShape(link, index, shape, leaf.position, leaf.orientation)
                for index, shape in enumerate(shapes, first)
            ]
    return made, reasons, meshes


def _solid(data: bytes, modelling: Modelling) -> Decomposition:
    """A concave mesh as convex parts. NotDecomposed gives the reason of a failure."""
    if modelling.concave == "skip":
        raise NotDecomposed("a concave mesh is left out, because concave is 'skip'")
    found = _decomposition(data, modelling.concave == "enclose", modelling.concave_threshold)
    if isinstance(found, NotDecomposed):
        raise NotDecomposed(str(found))
    return found


@lru_cache(maxsize=64)
def _decomposition(data: bytes, enclose: bool, threshold: float) -> Decomposition | NotDecomposed:
    """The cached decomposition of a mesh. A failure is cached, too, as it may have taken minutes."""
    try:
        return decompose(np.frombuffer(data).reshape(-1, 3, 3), threshold, enclose)
    except NotDecomposed as error:
        return error


def _capsule(leaf: Leaf) -> Leaf:
    """A multi-sphere of two equal spheres as a capsule. Any other multi-sphere is unchanged."""
    centres, radii = leaf.figures[:, :3], leaf.figures[:, 3]
    if len(radii) != 2 or radii[0] != radii[1]:
        return leaf
    axis = centres[1] - centres[0]
    length = float(np.linalg.norm(axis))
    if axis[2] < 0:
        axis = -axis
    # The shortest turn of z into the axis is (z × axis, length + z·axis).
    turn = np.array([-axis[1], axis[0], 0.0, length + axis[2]]) if length else np.array([0.0, 0.0, 0.0, 1.0])
    position = leaf.position + rotated(leaf.orientation, centres.mean(axis=0))
    orientation = composed(leaf.orientation, turn / np.linalg.norm(turn))
    return Leaf("capsule", position, orientation, np.array([radii[0], length]))


@lru_cache(maxsize=1024)
def _shape(kind: str, data: bytes, margin: float) -> Shape:
    """The shape with these figures of a leaf. Equal shapes are one object. ValueError gives the reason of a failure."""
    figures = np.frombuffer(data)
    match kind:
        case "box":
            return Box(figures)
        case "sphere":
            return Sphere(*figures)
        case "capsule":
            return Capsule(*figures)
        case "cylinder":
            return Cylinder(*figures)
        case "plane":
            return HalfSpace(figures[:3], figures[3])
        case "hull":
            points = figures.reshape(-1, 3)
            return RoundedHull(points, margin) if margin else Hull(points)
        case "multisphere":
            raise ValueError("the hull of unequal spheres is not modelled")
        case "height field":
            raise ValueError("a height field is modelled only if a Recorder noted its heightfieldData")
        case _:
            raise ValueError(f"a {kind} is not modelled")


def in_one_sentence(reasons: Sequence[str], shapes: int) -> str:
    if shapes == 1:
        return reasons[0]
    return "; ".join(f"{number} of {shapes} shapes: {reason}" for reason, number in Counter(reasons).items())
