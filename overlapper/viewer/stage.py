"""What bodies and overlaps are in meshcat: geometries, materials, lights and a camera. Lengths in metres, z is up."""

from __future__ import annotations

import pickle
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overlapper import Overlap, Placed
from overlapper.install import hint
from overlapper.shapes.drawing import polytope_edges, triangles
from overlapper.viewer.framing import Framing, View
from overlapper.viewer.look import (
    BOTTOM,
    FIELD_OF_VIEW,
    GRID,
    GRID_OPACITY,
    GROUND,
    GROUND_OPACITY,
    INK,
    LIGHT,
    LINE,
    OWNER_COLORS,
    TOP,
    Look,
    arrow_length,
    channels,
    to_draw,
)
from overlapper.viewer.pressure import FORCE, FRICTION, Arrow, Press, Scale, colors, pressures
from overlapper.viewer.tessellation import Ground, cone, ground, rotation_from_z, tessellation

try:
    from meshcat import geometry
    from meshcat.transformations import quaternion_matrix, rotation_matrix, translation_matrix
except ImportError as missing:
    raise ImportError(f"overlapper.viewer needs {hint('meshcat')}") from missing

Array = NDArray[np.float64]
FRONT, BACK, BOTH = 0, 1, 2  # three.js: the sides from which a face is seen


class Stage:
    """Background, lights, camera, and the sizes that follow the scene; fixed by the first bodies seen."""

    def __init__(self, framing: Framing, bodies: Look, overlaps: Look) -> None:
        self.center, self.size = framing.center, framing.size
        self._is_ground = framing.is_ground
        self._bodies, self._overlaps = bodies, overlaps
        self._known: dict[bytes, tuple[bool, _Mesh, geometry.PointsGeometry, geometry.PointsGeometry]] = {}
        fronts = [channels(overlaps.front)] if overlaps.front else [np.array(color) for color in OWNER_COLORS]
        # Mostly of their own light, so that an owner is known from the shaded side, too.
        fade = {"opacity": overlaps.opacity, "depthWrite": overlaps.opacity == 1}
        self._fronts = [_skin(rgb(0.7 * color), flat=True, emissive=rgb(0.4 * color), **fade) for color in fronts]
        backs = [channels(overlaps.back)] if overlaps.back else [0.5 * color for color in fronts]
        self._backs = [
            geometry.MeshBasicMaterial(color=rgb(each), transparent=True, side=BACK, **fade) for each in backs
        ]
        self._lines = geometry.LineBasicMaterial(color=rgb(LINE), transparent=True)
        self._corners = _DotMaterial(color=rgb(LINE), size=4, sizeAttenuation=False, transparent=True)
        through_everything = {"color": rgb(INK), "transparent": True, "depthTest": False}
        self._shining = geometry.LineBasicMaterial(**through_everything)
        self._dot = geometry.Points(
            _points(np.zeros((1, 3))), _DotMaterial(size=5, sizeAttenuation=False, **through_everything)
        )
        self._pressures = geometry.MeshBasicMaterial(vertexColors=True, transparent=True, **fade)
        self._pushes = [
            geometry.MeshBasicMaterial(**through_everything | {"color": rgb(color)}) for color in (FORCE, FRICTION)
        ]
        head = cone(radius=0.05, bottom=0.8, top=1.0)
        self._arrowhead = geometry.Mesh(
            _Mesh(head.vertices, head.faces), geometry.MeshBasicMaterial(**through_everything)
        )

    def ground(self, placed: Placed) -> Ground | None:
        """What is drawn, in its own frame, of a shape that is a ground; None of another."""
        if not self._is_ground(placed):
            return None
        center = np.linalg.inv(matrix(placed)) @ [*self.center, 1]
        return ground(placed.shape, center[:3], self.size)

    def body(self, placed: Placed, color: Sequence[float]) -> Group:
        """A shape in its own frame. What is not to be seen is there, too, so that a page can show it."""
        if seen := self.ground(placed):
            return self._plane(seen)
        look = self._bodies
        flat, mesh, edges, wires = self._geometries(placed)
        front = _skin(
            rgb(channels(look.front) if look.front else color), flat, opacity=look.opacity, depthWrite=look.opacity == 1
        )
        line = geometry.LineBasicMaterial(color=rgb(color), opacity=0.35, transparent=True, depthWrite=False)
        wire = geometry.LineBasicMaterial(color=rgb(color), transparent=True)
        dots = _DotMaterial(color=rgb(color), size=4, sizeAttenuation=False, transparent=True)
        return Group(
            (geometry.Mesh(mesh, front), {"name": "faces", "visible": look.faces}),
            *self._inside(mesh, look),
            (geometry.LineSegments(edges, line), {"name": "edges", "visible": look.edges and look.faces}),
            (
                geometry.LineSegments(wires, wire),
                {"name": "wires", "visible": look.edges and not look.faces},
            ),
            (geometry.Points(mesh, dots), {"name": "vertices", "visible": look.vertices}),
        )

    def _plane(self, seen: Ground) -> Group:
        """A ground, in colours of its own, before all that stands on it."""
        lines = seen.edges.reshape(-1, 3)
        faded = {"transparent": True, "depthWrite": False, "vertexColors": True}
        face = geometry.MeshBasicMaterial(color=rgb(GROUND), side=BOTH, opacity=GROUND_OPACITY, **faded)
        line = geometry.LineBasicMaterial(color=rgb(GRID), opacity=GRID_OPACITY, **faded)
        mesh = _Mesh(seen.vertices, seen.faces, strength=seen.strength(seen.vertices))
        return Group(
            (geometry.Mesh(mesh, face), {"name": "faces", "visible": self._bodies.faces, "renderOrder": -2}),
            (
                geometry.LineSegments(_points(lines, seen.strength(lines)), line),
                {"name": "edges", "visible": self._bodies.edges, "renderOrder": -1},
            ),
        )

    def _geometries(self, placed: Placed) -> tuple[bool, _Mesh, geometry.PointsGeometry, geometry.PointsGeometry]:
        """Whether faces are flat; faces, edges and wires, which are the same for the same shape."""
        shape = pickle.dumps(placed.shape)
        if shape not in self._known:
            drawn = tessellation(placed.shape)
            mesh = _Mesh(drawn.vertices, drawn.faces, drawn.normals)
            self._known[shape] = drawn.normals is None, mesh, _lines(drawn.edges), _lines(drawn.wires)
        return self._known[shape]

    def _inside(self, mesh: _Mesh, look: Look) -> list[tuple[geometry.Object, dict[str, Any]]]:
        if look.back is None:
            return []
        skin = _skin(rgb(channels(look.back)), True, side=BACK, opacity=look.opacity, depthWrite=look.opacity == 1)
        return [(geometry.Mesh(mesh, skin), {"name": "inside", "visible": look.faces})]

    def overlap(self, overlap: Overlap, press: Press | None = None, scale: Scale | None = None) -> Group:
        """Facets by owner, patch outline and normal; about the centroid, where float32 is fine enough.

        With what the two do to each other and a scale, facets are by pressure, and there is no normal.
        """
        overlap, look = to_draw(overlap, self.size), self._overlaps
        centroid = np.asarray(overlap.centroid)
        vertices = overlap.vertices - centroid
        parts: list[tuple[geometry.Object, dict[str, Any]]] = []
        if look.faces and press and scale:
            corners, found = (each.reshape(-1, *each.shape[2:]) for each in pressures(overlap, press, scale.top))
            faces = np.arange(len(corners)).reshape(-1, 3)
            mesh = _Mesh(corners - centroid, faces, paint=colors(found, scale.top))
            parts.append((geometry.Mesh(mesh, self._pressures), {"renderOrder": 1}))
        elif look.faces:
            parts = self._facets(overlap, vertices)
        if look.edges:
            segments = vertices[polytope_edges(overlap.facets)]
            parts.append((geometry.LineSegments(_lines(segments), self._lines), {"renderOrder": 1}))
        if look.vertices:
            parts.append((geometry.Points(_points(vertices), self._corners), {"renderOrder": 1}))
        if look.marks:
            parts += self._marks(overlap, centroid, arrow=press is None)
        if np.ptp(vertices, axis=0).max() < 0.015 * self.size:
            parts.append((self._dot, {"renderOrder": 3}))
        return Group((Group(*parts), {"position": centroid.tolist()}))

    def force(self, arrow: Arrow, scale: Scale) -> Group:
        """The force of a pair of links, and what of it is friction."""
        parts: list[tuple[geometry.Object, dict[str, Any]]] = []
        for vector, material, thick in zip((arrow.force, arrow.friction), self._pushes, (1.0, 1.2), strict=True):
            drawn = scale.arrow(vector)
            length = float(np.linalg.norm(drawn))
            if length < 0.002 * self.size:
                continue
            tip = min(0.02 * self.size, 0.6 * length)
            wide = min(0.005 * thick * self.size, 0.4 * tip)
            shaft, head = cone(wide / 3, 0.0, length - tip, wide / 3), cone(wide, length - tip, length)
            faces = np.concatenate([shaft.faces, head.faces + len(shaft.vertices)])
            vertices = np.concatenate([shaft.vertices, head.vertices]) @ rotation_from_z(drawn / length).T
            parts.append((geometry.Mesh(_Mesh(vertices, faces), material), {"renderOrder": 2.5}))
        return Group((Group(*parts), {"position": arrow.start.tolist()}))

    def _marks(self, overlap: Overlap, centroid: Array, arrow: bool) -> list[tuple[geometry.Object, dict[str, Any]]]:
        parts: list[tuple[geometry.Object, dict[str, Any]]] = []
        lines = [np.stack([ring, np.roll(ring, -1, axis=0)], axis=1) - centroid for ring in overlap.patch]
        if arrow and overlap.normal is not None:
            length = arrow_length(overlap.area, self.size)
            lines.append(np.array([[np.zeros(3), length * overlap.normal]]))
            pose = np.eye(4)
            pose[:3, :3] = length * rotation_from_z(overlap.normal)
            parts.append((self._arrowhead, {"renderOrder": 2, "matrix": pose.T.ravel().tolist()}))
        if lines:
            parts.append((geometry.LineSegments(_lines(np.concatenate(lines)), self._shining), {"renderOrder": 2}))
        return parts

    def _facets(self, overlap: Overlap, vertices: Array) -> list[tuple[geometry.Object, dict[str, Any]]]:
        """A mesh for each owner, and for what is seen of it from inside if faces are seen through."""
        faces = triangles(overlap.facets)
        owners = np.repeat(overlap.owner, [len(facet) - 2 for facet in overlap.facets])
        parts: list[tuple[geometry.Object, dict[str, Any]]] = []
        for owner in np.unique(owners):
            used, renumbered = np.unique(faces[owners == owner], return_inverse=True)
            mesh = _Mesh(vertices[used], renumbered.reshape(-1, 3))
            if self._overlaps.opacity < 1:
                parts.append((geometry.Mesh(mesh, self._backs[owner % len(self._backs)]), {"renderOrder": 0.5}))
            parts.append((geometry.Mesh(mesh, self._fronts[owner % len(self._fronts)]), {"renderOrder": 1}))
        return parts

    def set(self, visualizer: Any, view: View) -> None:
        """A dark room, plain light, and the camera of a view."""
        for name in ("Grid", "Axes", "Lights/PointLightNegativeX", "Lights/PointLightPositiveX"):
            visualizer[f"/{name}"].set_property("visible", False)
        visualizer["/Background"].set_property("top_color", list(TOP))
        visualizer["/Background"].set_property("bottom_color", list(BOTTOM))
        center, distance = view.at, view.distance()
        # meshcat's camera circles about the page's origin; so the scene is moved there, and the camera moved with it.
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
        light.set_property("intensity", 0.55)
        visualizer["/Lights/AmbientLight/<object>"].set_property("intensity", 0.45)


class Group(geometry.Object):  # type: ignore[misc]
    """Objects that make one node of the tree, each with more of its attributes in three.js's object format."""

    def __init__(self, *parts: tuple[geometry.Object, dict[str, Any]]) -> None:
        geometry.SceneElement.__init__(self)
        self.parts = parts

    def lower(self) -> dict[str, Any]:
        lowered = [part.lower() for part, _ in self.parts]
        return {
            "metadata": {"version": 4.5, "type": "Object"},
            "geometries": _once(each for part in lowered for each in part["geometries"]),
            "materials": _once(each for part in lowered for each in part["materials"]),
            "object": {
                "uuid": self.uuid,
                "type": "Group",
                "children": [
                    _placed(part["object"], more) for part, (_, more) in zip(lowered, self.parts, strict=True)
                ],
            },
        }


def _placed(child: dict[str, Any], more: dict[str, Any]) -> dict[str, Any]:
    """meshcat gives every object a matrix, the identity for these, that would win over a position."""
    return {key: value for key, value in child.items() if key != "matrix"} | more


def _once(elements: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    return list({each["uuid"]: each for each in elements}.values())


class _DotMaterial(geometry.GenericMaterial):  # type: ignore[misc]
    _type = "PointsMaterial"


class _Mesh(geometry.TriangularMeshGeometry):  # type: ignore[misc]
    """meshcat's triangles, with normals; with how much is seen of each vertex, from 0 to 1; or with their colours."""

    def __init__(
        self,
        vertices: Array,
        faces: NDArray[Any],
        normals: Array | None = None,
        strength: Array | None = None,
        paint: Array | None = None,
    ) -> None:
        super().__init__(vertices, faces)
        self.normals, self.strength, self.paint = normals, strength, paint

    def lower(self, object_data: dict[str, Any]) -> dict[str, Any]:
        lowered: dict[str, Any] = super().lower(object_data)
        if self.normals is not None:
            lowered["data"]["attributes"]["normal"] = geometry.pack_numpy_array(self.normals.T)
        if self.strength is not None:
            lowered["data"]["attributes"]["color"] = geometry.pack_numpy_array(_faded(self.strength))
        if self.paint is not None:
            lowered["data"]["attributes"]["color"] = geometry.pack_numpy_array(self.paint.T)
        return lowered


def _skin(paint: int, flat: bool, **properties: Any) -> geometry.MeshPhongMaterial:
    """Matt, and "transparent" even if opaque: three.js draws what is so called last, and in the order asked for."""
    properties = {"color": paint, "transparent": True, "flatShading": flat, "specular": 0, "side": FRONT} | properties
    return geometry.MeshPhongMaterial(**properties)


def _lines(segments: Array) -> geometry.PointsGeometry:
    """Segments (k, 2, 3), from and to."""
    return _points(segments.reshape(-1, 3))


def _points(points: Array, strength: Array | None = None) -> geometry.PointsGeometry:
    """`strength` (n,) says how much is seen of each."""
    faded = None if strength is None else _faded(strength)
    return geometry.PointsGeometry(np.ascontiguousarray(points.T, dtype=np.float32), faded)


def _faded(strength: Array) -> NDArray[np.float32]:
    """(4, n): the material's colour, and an opacity, which three.js takes from a colour of four parts."""
    return np.stack([*np.ones((3, len(strength))), strength]).astype(np.float32)


def matrix(placed: Placed) -> Array:
    """The pose as a 4 x 4 matrix."""
    x, y, z, w = placed.orientation
    pose: Array = quaternion_matrix([w, x, y, z])
    pose[:3, 3] = placed.position
    return pose


def rgb(color: Sequence[float] | Array) -> int:
    """Red, green and blue in 0..1 as three.js's one number."""
    red, green, blue = (round(255 * min(max(part, 0.0), 1.0)) for part in color[:3])
    return red << 16 | green << 8 | blue
