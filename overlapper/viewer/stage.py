"""The drawing as objects of meshcat, and the room around them. Lengths are in metres, and z is up."""

from __future__ import annotations

import pickle
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overlapper import Overlap, Placed
from overlapper.install import hint
from overlapper.shapes.drawing import triangles
from overlapper.viewer.framing import Framing, View
from overlapper.viewer.look import (
    AMBIENT,
    BOTTOM,
    DIFFUSE,
    FIELD_OF_VIEW,
    LIGHT,
    TOP,
    Array,
    Look,
    hexadecimal,
    to_draw,
)
from overlapper.viewer.pressure import Arrow, Press, Scale
from overlapper.viewer.primitives import Dots, Drawing, Faces, Lines, Primitive

try:
    from meshcat import geometry
    from meshcat.transformations import quaternion_matrix, rotation_matrix, translation_matrix
except ImportError as missing:
    raise ImportError(f"overlapper.viewer needs {hint('meshcat')}") from missing


ORIGIN = np.zeros(3)


class Stage:
    """A drawing as objects of meshcat. Its centre and size are those of the first bodies seen."""

    def __init__(self, framing: Framing, bodies: Look, overlaps: Look) -> None:
        self.center, self.size = framing.center, framing.size
        self.drawing = Drawing(framing.center, framing.size, framing.is_ground, bodies, overlaps)
        self._known: dict[bytes, list[_Buffers]] = {}

    def body(self, placed: Placed, color: Sequence[float]) -> Group:
        """A shape in its own frame. Equal shapes share their geometries, which a page keeps once."""
        primitives = self.drawing.body(placed, color)
        if self.drawing.ground(placed):
            return Group(primitives)
        shape = pickle.dumps(placed.shape)
        if shape not in self._known:
            # Faces, their inside and the dots at their corners share one geometry.
            known: dict[int, _Buffers] = {}
            self._known[shape] = [known.setdefault(id(each.points), _Buffers(each)) for each in primitives]
        return Group(primitives, buffers=self._known[shape])

    def overlap(self, overlap: Overlap, press: Press | None = None, scale: Scale | None = None) -> Group:
        """An overlap, coloured by owners, or by pressures if the forces of the pair and a scale are given."""
        coarse = to_draw(overlap, self.size)
        return Group(self.drawing.overlap(coarse, press, scale), np.asarray(coarse.centroid))

    def force(self, arrow: Arrow, scale: Scale) -> Group:
        """The force of a pair of links."""
        return Group(self.drawing.force(arrow, scale, self.size), arrow.start)


def set_room(visualizer: Any, view: View) -> None:
    """A dark room, plain light, and the camera of a view."""
    for name in ("Grid", "Axes", "Lights/PointLightNegativeX", "Lights/PointLightPositiveX"):
        visualizer[f"/{name}"].set_property("visible", False)
    visualizer["/Background"].set_property("top_color", list(TOP))
    visualizer["/Background"].set_property("bottom_color", list(BOTTOM))
    center, distance = view.at, view.distance()
    # meshcat's camera turns about the page's origin, so the scene and the camera are moved there.
    z_up = rotation_matrix(-np.pi / 2, (1, 0, 0))
    visualizer["/"].set_transform(z_up @ translation_matrix(-center))
    visualizer["/Cameras/default"].set_transform(translation_matrix(center))
    lens = visualizer["/Cameras/default/rotated/<object>"]
    x, y, z = (distance * view.back).tolist()
    lens.set_property("position", [x, z, -y])
    lens.set_property("fov", FIELD_OF_VIEW)
    lens.set_property("near", distance / 500)
    lens.set_property("far", distance * 100)
    light = visualizer["/Lights/FillLight/<object>"]
    light.set_property("position", (center + LIGHT).tolist())
    light.set_property("intensity", DIFFUSE)
    visualizer["/Lights/AmbientLight/<object>"].set_property("intensity", AMBIENT)


class Group(geometry.Object):  # type: ignore[misc]
    """Primitives in one node of the tree, about a position, m. `buffers` are their known geometries."""

    def __init__(
        self, primitives: Sequence[Primitive], position: Array = ORIGIN, buffers: Sequence[_Buffers] = ()
    ) -> None:
        geometry.SceneElement.__init__(self)
        kinds = {Faces: geometry.Mesh, Lines: geometry.LineSegments, Dots: geometry.Points}
        shapes = buffers or list(map(_Buffers, primitives))
        self._objects = [kinds[type(each)](shape, _material(each)) for each, shape in zip(primitives, shapes)]
        self._more = [
            {"name": each.name, "visible": each.visible, "renderOrder": each.order, "position": position.tolist()}
            for each in primitives
        ]

    def lower(self) -> dict[str, Any]:
        lowered = [each.lower() for each in self._objects]
        for each, more in zip(lowered, self._more):
            del each["object"]["matrix"]  # the identity, which three.js would use instead of the position
            each["object"] |= more
        return {
            "metadata": {"version": 4.5, "type": "Object"},
            "geometries": _once(each for part in lowered for each in part["geometries"]),
            "materials": _once(each for part in lowered for each in part["materials"]),
            "object": {"uuid": self.uuid, "type": "Group", "children": [part["object"] for part in lowered]},
        }


def _once(elements: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    return list({each["uuid"]: each for each in elements}.values())


def _material(primitive: Primitive) -> geometry.Material:
    """The material is "transparent" even if opaque, as three.js draws transparent objects in the requested order."""
    painted = primitive.color.ndim > 1
    properties: dict[str, Any] = {
        "transparent": True,
        "opacity": primitive.opacity,
        "vertexColors": painted or primitive.strength is not None,
        "depthTest": not primitive.through,
        "depthWrite": primitive.opacity == 1,
    }
    color = np.ones(3) if painted else primitive.color
    if not isinstance(primitive, Faces):
        if isinstance(primitive, Dots):
            return _DotMaterial(color=rgb(color), size=primitive.size, sizeAttenuation=False, **properties)
        return geometry.LineBasicMaterial(color=rgb(color), **properties)
    properties["side"] = primitive.side
    if not primitive.lit:
        return geometry.MeshBasicMaterial(color=rgb(primitive.glow * color), **properties)
    properties |= {"flatShading": primitive.normals is None, "specular": 0, "emissive": rgb(primitive.glow * color)}
    return geometry.MeshPhongMaterial(color=rgb(primitive.lit * color), **properties)


class _DotMaterial(geometry.GenericMaterial):  # type: ignore[misc]
    _type = "PointsMaterial"


class _Buffers(geometry.Geometry):  # type: ignore[misc]
    """The points of a primitive with their colours and normals, and the triangles of faces."""

    def __init__(self, primitive: Primitive) -> None:
        super().__init__()
        points = primitive.points.reshape(-1, 3)
        self._of_points = {"position": points}
        self._triangles: NDArray[np.integer[Any]] | None = None
        if primitive.strength is not None:
            # three.js takes an opacity from a colour of four numbers.
            self._of_points["color"] = np.column_stack([np.ones((len(points), 3)), primitive.strength.ravel()])
        elif primitive.color.ndim > 1:
            self._of_points["color"] = primitive.color
        if isinstance(primitive, Faces):
            self._triangles = triangles(primitive.facets)
            if primitive.normals is not None:
                self._of_points["normal"] = primitive.normals

    def lower(self, object_data: dict[str, Any]) -> dict[str, Any]:
        packed = {name: _packed(array, np.float32) for name, array in self._of_points.items()}
        data: dict[str, Any] = {"attributes": packed}
        if self._triangles is not None:
            data["index"] = _packed(self._triangles, np.uint32)
        return {"uuid": self.uuid, "type": "BufferGeometry", "data": data}


def _packed(array: NDArray[Any], kind: type) -> dict[str, Any]:
    packed: dict[str, Any] = geometry.pack_numpy_array(np.ascontiguousarray(array.T, dtype=kind))
    return packed


def matrix(placed: Placed) -> Array:
    """The pose as a 4 x 4 matrix."""
    x, y, z, w = placed.orientation
    pose: Array = quaternion_matrix([w, x, y, z])
    pose[:3, 3] = placed.position
    return pose


def rgb(color: Sequence[float] | Array) -> int:
    """Red, green and blue in 0..1 as three.js's one number."""
    return int(hexadecimal(np.clip(color[:3], 0, 1))[1:], 16)
