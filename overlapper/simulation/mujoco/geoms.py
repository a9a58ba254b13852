"""The geoms of a MuJoCo model as shapes."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from overlapper import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, Shape, Sphere
from overlapper.printable import printable
from overlapper.simulation.height_field import HeightField
from overlapper.simulation.model import BASE, Color, Ground, ModelledBody, ModelledShape, Skipped

Numbers = NDArray[np.int64]

TYPES = {
    int(getattr(mujoco.mjtGeom, name)): name[len("mjGEOM_") :].lower()
    for name in dir(mujoco.mjtGeom)
    if name.startswith("mjGEOM_")
}
"""The MJCF names of the types of geoms, by number."""

PLANE, HFIELD = int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD)
NOT_MODELLED = {"sdf": "its surface comes from an SDF plugin, which Python cannot read"}
ORIGIN, UNTURNED = np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])


def collidable(model: Any) -> Numbers:
    """The geoms that may be in a contact: geoms with a mask, and geoms of explicit pairs."""
    on = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    on[model.pair_geom1] = on[model.pair_geom2] = True
    return np.flatnonzero(on)


def drawn_from(model: Any) -> list[NDArray[Any]]:
    """All numbers of the model that define shapes. They may be edited at any time."""
    return [model.geom_size, model.geom_type, model.geom_dataid, model.hfield_size, model.hfield_data]


def modelled_bodies(model: Any, geoms: Numbers, names: dict[int, str]) -> dict[int, ModelledBody]:
    """The bodies of these geoms by number. Each geom has one shape, a height field, or a reason why it has neither.

    `names` are given names of bodies by number. The other bodies have MuJoCo's names.
    """
    owner = model.geom_bodyid
    return {
        int(body): _modelled_body(model, int(body), geoms[owner[geoms] == body].tolist(), names.get(int(body)))
        for body in np.unique(owner[geoms])
    }


def _modelled_body(model: Any, body: int, geoms: Iterable[int], given: str | None) -> ModelledBody:
    name = given or printable(model.body(body).name) or f"body {body}"
    geom_names = {geom: printable(model.geom(geom).name) or f"geom {geom}" for geom in geoms}
    shapes: list[ModelledShape] = []
    skipped: list[Skipped] = []
    grounds: list[Ground] = []
    for geom in geoms:
        try:
            if model.geom_type[geom] == HFIELD:
                grounds.append(Ground(geom, height_field(model, int(model.geom_dataid[geom])), ORIGIN, UNTURNED))
                continue
            shapes.append(ModelledShape(geom, 0, shape_of(model, geom), ORIGIN, UNTURNED))
        except ValueError as error:
            skipped.append(Skipped(body, geom, f"{name}/{geom_names[geom]}", str(error)))
    colors = {geom: color_of(model, geom) for geom in geoms}
    count = len(shapes) + len(skipped) + sum(ground.field.count for ground in grounds)
    links = {BASE: "", **geom_names}
    return ModelledBody(name, links, colors, {}, count, tuple(shapes), tuple(skipped), grounds=tuple(grounds))


def color_of(model: Any, geom: int) -> Color:
    """The colour of the geom's material, or else its own colour."""
    material = int(model.geom_matid[geom])
    red, green, blue, alpha = (model.geom_rgba[geom] if material < 0 else model.mat_rgba[material]).tolist()
    return red, green, blue, alpha


def shape_of(model: Any, geom: int) -> Shape:
    """The shape that MuJoCo collides, in the geom's own frame. ValueError gives the reason if there is none."""
    kind = TYPES.get(int(model.geom_type[geom]), "unknown")
    size = model.geom_size[geom].astype(float)
    match kind:
        case "plane":
            return _plane()  # infinite, whatever its size
        case "sphere":
            return Sphere(size[0])
        case "capsule":
            return Capsule(size[0], 2 * size[1])
        case "ellipsoid":
            return Ellipsoid(size)
        case "cylinder":
            return Cylinder(size[0], 2 * size[1])
        case "box":
            return Box(size)
        case "mesh":
            return _hull(hull_points(model, int(model.geom_dataid[geom])).tobytes())
        case _:
            raise ValueError(NOT_MODELLED.get(kind, f"geoms of type {kind} are not modelled"))


def height_field(model: Any, number: int) -> HeightField:
    """The height field with this number, as MuJoCo collides it. ValueError if its heights are not above its base.

    `hfield_size` has half the widths along x and y, the height of data 1, and the depth of the base. See
    mjc_ConvexHField in engine_collision_convex.c.
    """
    rows, columns = int(model.hfield_nrow[number]), int(model.hfield_ncol[number])
    x, y, top, depth = model.hfield_size[number].tolist()
    first = int(model.hfield_adr[number])
    heights = top * model.hfield_data[first : first + rows * columns].reshape(rows, columns).astype(float)
    if not (np.isfinite(heights).all() and heights.min() > -depth and min(x, y) > 0):
        raise ValueError("its heights must be finite and above its base, and its widths positive")
    return HeightField(heights, (2 * x / (columns - 1), 2 * y / (rows - 1)), -depth, rising=True)


def hull_points(model: Any, mesh: int) -> NDArray[np.float64]:
    """(n, 3) the vertices of the hull that MuJoCo collides.

    `mesh_graph` has the numbers of its vertices. `maxhullvert` may make it coarser than the hull of the mesh. A mesh
    that could not collide when the model was compiled has no graph. It collides as the hull of all its vertices.
    """
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    vertices = np.asarray(model.mesh_vert[first : first + count], dtype=np.float64)
    graph = int(model.mesh_graphadr[mesh])
    if graph < 0:
        return vertices
    of_hull = int(model.mesh_graph[graph])
    begin = graph + 2 + of_hull  # after both counts and the addresses of edges
    return np.asarray(vertices[model.mesh_graph[begin : begin + of_hull]])


@lru_cache(maxsize=1)
def _plane() -> HalfSpace:
    return HalfSpace([0, 0, 1], 0)


@lru_cache(maxsize=1024)
def _hull(points: bytes) -> Hull:
    """The hull of these points. Geoms with the same mesh share one object."""
    return Hull(np.frombuffer(points).reshape(-1, 3))
