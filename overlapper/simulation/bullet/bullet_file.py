"""Collision shapes from the .bullet files that pybullet's `saveBullet` writes.

A .bullet file is a memory dump that describes itself. It has a header and then blocks. Each block is an array of one C
struct, with the address that the array had in the writing process. The last block, "DNA1", has the layout of every
struct. Pointers between blocks are those old addresses.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from os import PathLike
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from overlapper.printable import first_line
from overlapper.simulation.model import Leaf

# The BroadphaseNativeTypes of Bullet that pybullet creates.
KINDS = {
    0: "box",
    4: "hull",
    8: "sphere",
    9: "multisphere",
    10: "capsule",
    13: "cylinder",
    21: "concave mesh",
    22: "scaled concave mesh",
    24: "height field",
    28: "plane",
    31: "compound",
    32: "soft body",
    35: "signed distance field",
}

# The structs in the blocks of each code, as pybullet writes them.
NAMES = {
    "MBLC": "btMultiBodyLinkColliderDoubleData",
    "MBDY": "btMultiBodyDoubleData",
    "RBDY": "btRigidBodyDoubleData",
}

# The most bytes of figures for each byte of an undamaged file. Three corners in doubles take 72 bytes; in the file they
# are three indices of 4 bytes.
MOST_READ = 64

NUMBERS = {"char": "i1", "uchar": "u1", "short": "<i2", "ushort": "<u2", "int": "<i4", "float": "<f4", "double": "<f8"}


@dataclass(frozen=True, slots=True, eq=False)
class Collider:
    """The collider of a link: the address of its `shape`, the `group` and `mask` of its collision filter, and its pose.

    `position` (3,) and `rotation` (3, 3) are those of the inertial frame in the world, in double precision.
    """

    shape: int
    group: int
    mask: int
    position: NDArray[np.float64]
    rotation: NDArray[np.float64]

    @property
    def orientation(self) -> NDArray[np.float64]:
        """(4,) unit quaternion xyzw of `rotation`."""
        return _quaternion(self.rotation)


def orientations(colliders: Sequence[Collider]) -> NDArray[np.float64]:
    """(n, 4) the `Collider.orientation` of many colliders, computed together."""
    return _quaternion(np.array([collider.rotation for collider in colliders]).reshape(-1, 3, 3))


@dataclass(frozen=True, slots=True, eq=False)
class SavedBody:
    """A body of the file. The file has no body ids.

    `position` (3,) is the base's centre of mass in the world, bit-identical to pybullet's report. `friction` is the
    lateral friction of the base. `colliders` are by link index, -1 for the base.
    `links` is the number of links, 0 for a rigid body (maximal coordinates).
    """

    links: int
    position: NDArray[np.float64]
    friction: float
    colliders: dict[int, Collider]


class Block(NamedTuple):
    code: str
    size: int
    address: int
    layout: int
    length: int
    offset: int


class BulletFile:
    """The bodies of one .bullet file in the order of the file, and their shapes by address.

    ValueError if it is not a .bullet file with 64-bit pointers, doubles and little-endian numbers, or is damaged.
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        with open(path, "rb") as file:
            self._data = file.read()
        if not self._data.startswith(b"BULLETd-v"):
            raise ValueError(f"path {str(path)!r} is not a 64-bit little-endian .bullet file in double precision")
        self._leaves: dict[int, tuple[Leaf, ...]] = {}
        self._room = MOST_READ * len(self._data)
        with _damage():
            blocks = _blocks(self._data)
            dna = blocks.pop()
            self._layouts = _layouts(self._data[dna.offset :])
            self._by_address = {block.address: block for block in blocks}
            self.bodies = self._read_bodies(blocks)

    def leaves(self, address: int) -> tuple[Leaf, ...]:
        """Leaf shapes of the collider shape at `address`, in pybullet's order.

        ValueError if the file is damaged there.
        """
        if address not in self._leaves:
            with _damage():
                self._leaves[address] = tuple(self._flatten(address, np.zeros(3), np.eye(3)))
        return self._leaves[address]

    def pieces(self, address: int) -> list[int]:
        """The number of leaves of each child of the compound at `address`; [1] for any other shape.

        ValueError if the file is damaged there.
        """
        with _damage():
            number = int(self._base(address, "btCollisionShapeData")["m_shapeType"])
            if KINDS.get(number) != "compound":
                return [1]
            children = int(self._at(address)[0]["m_childShapePtr"])
            return [len(self.leaves(int(child["m_childShape"]))) for child in (self._at(children) if children else ())]

    def _read_bodies(self, blocks: list[Block]) -> tuple[SavedBody, ...]:
        colliders: dict[int, dict[int, Collider]] = {}  # of each multibody, by link
        frictions: dict[int, float] = {}  # of each multibody, of its base
        links = self._first_records(blocks, "MBLC")
        objects = links["m_colObjData"]
        for body, link, collider, friction in zip(
            links["m_multiBody"].tolist(), links["m_link"].tolist(), _colliders(objects), objects["m_friction"].tolist()
        ):
            colliders.setdefault(body, {})[link] = collider
            if link == -1:
                frictions[body] = friction
        multibodies = self._first_records(blocks, "MBDY")
        of_multibodies = zip(
            multibodies["m_numLinks"].tolist(), multibodies["m_baseWorldPosition"]["m_floats"][:, :3], strict=True
        )
        rigid = self._first_records(blocks, "RBDY")["m_collisionObjectData"]
        of_rigid = zip(_colliders(rigid), rigid["m_friction"].tolist(), strict=True)
        bodies: list[SavedBody] = []
        for block in blocks:
            if block.code == "MBDY":
                count, position = next(of_multibodies)
                bodies.append(SavedBody(count, position, frictions[block.address], colliders[block.address]))
            elif block.code == "RBDY":
                collider, friction = next(of_rigid)
                bodies.append(SavedBody(0, collider.position, friction, {-1: collider}))
        return tuple(bodies)

    def _first_records(self, blocks: list[Block], code: str) -> NDArray[np.void]:
        """The first struct of each block of this code, one after the other, as one array."""
        found = [block for block in blocks if block.code == code]
        name = self._layouts.names[found[0].layout] if found else NAMES[code]
        dtype = self._layouts.dtype(name)
        if any(block.size < dtype.itemsize for block in found):
            raise ValueError(f"path is a damaged .bullet file: a block {code} is smaller than its struct")
        return np.frombuffer(b"".join(self._data[at.offset : at.offset + dtype.itemsize] for at in found), dtype)

    def _flatten(self, address: int, position: NDArray[np.float64], rotation: NDArray[np.float64]) -> list[Leaf]:
        number = int(self._base(address, "btCollisionShapeData")["m_shapeType"])
        kind = KINDS.get(number, f"shape of Bullet's type {number}")
        if kind != "compound":
            kind, figures = self._figures(kind, address)
            self._room -= figures.nbytes + 1
            if self._room < 0:
                raise ValueError("path is a damaged .bullet file: a shape contains itself")
            convex = self._base(address, "btConvexInternalShapeData") if kind == "hull" else None
            # The shortest decimal of the single-precision number is the double that Bullet has rounded.
            margin = float(str(convex["m_collisionMargin"])) if convex is not None else 0.0
            return [Leaf(kind, position, _quaternion(rotation), figures, margin)]
        children = int(self._at(address)[0]["m_childShapePtr"])
        leaves: list[Leaf] = []
        for child in self._at(children) if children else ():
            origin = child["m_transform"]["m_origin"]["m_floats"][:3].astype(float)
            basis = child["m_transform"]["m_basis"]["m_el"]["m_floats"][:, :3].astype(float)
            leaves += self._flatten(int(child["m_childShape"]), position + rotation @ origin, rotation @ basis)
        return leaves

    def _figures(self, kind: str, address: int) -> tuple[str, NDArray[np.float64]]:
        shape = self._at(address)[0]
        if kind == "plane":
            return kind, np.append(shape["m_planeNormal"]["m_floats"][:3], shape["m_planeConstant"]).astype(float)
        if kind == "concave mesh":
            return kind, self._triangles(shape["m_meshInterface"])
        if kind not in ("box", "sphere", "capsule", "cylinder", "hull", "multisphere"):
            return kind, np.empty(0)
        convex = self._base(address, "btConvexInternalShapeData")
        size = convex["m_implicitShapeDimensions"]["m_floats"][:3].astype(float)
        if kind in ("box", "cylinder"):
            # The file has the half extents without the margin, which Bullet adds again.
            size += convex["m_collisionMargin"]
        if kind == "box":
            return kind, size
        if kind == "sphere":
            return kind, size[:1]
        if kind == "hull":
            scaling = convex["m_localScaling"]["m_floats"][:3].astype(float)
            return kind, self._at(int(shape["m_unscaledPointsDoublePtr"]))["m_floats"][:, :3] * scaling
        if kind == "multisphere":
            spheres = self._at(int(shape["m_localPositionArrayPtr"]))
            return kind, np.c_[spheres["m_pos"]["m_floats"][:, :3], spheres["m_radius"]].astype(float)
        axis = int(shape["m_upAxis"])
        if axis != 2:
            return f"{kind} along {'xyz'[axis]}", np.empty(0)
        return kind, np.array([size[0], 2 * size[2]])

    def _triangles(self, mesh: Any) -> NDArray[np.float64]:
        """The triangles (t, 3, 3) of a striding mesh. pybullet uses 32-bit indices."""
        scaling = mesh["m_scaling"]["m_floats"][:3].astype(float)
        parts = self._at(int(mesh["m_meshPartsPtr"])) if mesh["m_meshPartsPtr"] else ()
        corners = [
            self._at(int(part["m_vertices3d"]))["m_floats"][self._at(int(part["m_indices32"]))["m_value"], :3]
            for part in parts
            if part["m_numTriangles"]
        ]
        triangles: NDArray[np.float64] = np.concatenate([np.empty((0, 3)), *corners]).reshape(-1, 3, 3) * scaling
        return triangles

    def _base(self, address: int, name: str) -> Any:
        """The shape at `address` as its C++ base class. Every shape struct begins with the struct of its base class."""
        return np.frombuffer(self._data, self._layouts.dtype(name), 1, self._by_address[address].offset)[0]

    def _at(self, address: int) -> NDArray[np.void]:
        return self._records(self._by_address[address])

    def _records(self, block: Block) -> NDArray[np.void]:
        name = self._layouts.names[block.layout]
        return np.frombuffer(self._data, self._layouts.dtype(name), block.length, block.offset)


@contextmanager
def _damage() -> Iterator[None]:
    """Turn every error that damaged bytes cause into a ValueError."""
    causes = (KeyError, IndexError, StopIteration, struct.error, RecursionError, OverflowError, TypeError)
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            yield
    except MemoryError as error:
        raise ValueError("path is a damaged .bullet file, or needs more memory than there is") from error
    except (ValueError, *causes) as error:
        if str(error).startswith("path "):
            raise
        raise ValueError(f"path is a damaged .bullet file ({type(error).__name__}: {first_line(error)})") from error


def _colliders(records: NDArray[np.void]) -> list[Collider]:
    """Collision objects, many at once: reading structs one by one is slow."""
    transforms = records["m_worldTransform"]
    return list(
        map(
            Collider,
            records["m_collisionShape"].tolist(),
            records["m_collisionFilterGroup"].tolist(),
            records["m_collisionFilterMask"].tolist(),
            transforms["m_origin"]["m_floats"][:, :3],
            transforms["m_basis"]["m_el"]["m_floats"][:, :, :3],
        )
    )


def _blocks(data: bytes) -> list[Block]:
    """The blocks of the file. The last block is the DNA, whose length some writers do not set."""
    blocks: list[Block] = []
    start = 12
    while not blocks or blocks[-1].code != "DNA1":
        if start + 24 > len(data):
            raise ValueError("path is a .bullet file cut short: the block that describes its structs is missing")
        code, size, address, layout, length = struct.unpack_from("<4siQii", data, start)
        blocks.append(Block(code.rstrip(b"\0").decode(), size, address, layout, length, start + 24))
        if blocks[-1].code != "DNA1" and (size < 0 or length < 0 or layout < 0):
            raise ValueError("path is a damaged .bullet file: one of its blocks has a negative size")
        start += 24 + size
    return blocks


class Layouts:
    """The structs of a file as numpy dtypes. A dtype is made on first use."""

    def __init__(self, structs: dict[str, list[tuple[str, str]]], sizes: dict[str, int]) -> None:
        self.names = list(structs)
        self._structs = structs
        self._sizes = sizes
        self._made: dict[str, np.dtype[Any]] = {}

    def dtype(self, name: str) -> np.dtype[Any]:
        if name in NUMBERS:
            return np.dtype(NUMBERS[name])
        if name not in self._made:
            made = np.dtype([self._field(kind, declared) for kind, declared in self._structs[name]])
            if made.itemsize != self._sizes[name]:
                raise ValueError(f"path is a damaged .bullet file: {name} has holes")
            self._made[name] = made
        return self._made[name]

    def _field(self, kind: str, declared: str) -> tuple[str, Any, tuple[int, ...]]:
        name, *dimensions = declared.replace("]", "").split("[")
        dtype = "<u8" if name.startswith("*") else self.dtype(kind)
        return name.lstrip("*"), dtype, tuple(int(dimension) for dimension in dimensions)


@lru_cache(maxsize=4)
def _layouts(dna: bytes) -> Layouts:
    """Read the DNA block: field names, type names, type sizes, and structs as pairs of a type and a name.

    The DNA is compiled into Bullet, so all files of one build share it.
    """
    names, end = _strings(dna, 4)
    types, end = _strings(dna, end)
    sizes = np.frombuffer(dna, "<i2", len(types), end + 4)
    start = _aligned(end + 4 + 2 * len(types)) + 4
    (count,) = struct.unpack_from("<i", dna, start)
    words = iter(np.frombuffer(dna, "<i2", (len(dna) - start - 4) // 2, start + 4).tolist())
    structs: dict[str, list[tuple[str, str]]] = {}
    for _ in range(count):
        name, fields = types[next(words)], next(words)
        structs[name] = [(types[next(words)], names[next(words)]) for _ in range(fields)]
    return Layouts(structs, dict(zip(types, sizes.tolist(), strict=True)))


def _strings(dna: bytes, start: int) -> tuple[list[str], int]:
    """A tagged section of zero-terminated strings, and where the next section begins."""
    (count,) = struct.unpack_from("<i", dna, start + 4)
    *strings, rest = dna[start + 8 :].split(b"\0", count)
    return [string.decode() for string in strings], _aligned(len(dna) - len(rest))


def _aligned(offset: int) -> int:
    return (offset + 3) // 4 * 4


def _quaternion(rotations: NDArray[np.float64]) -> NDArray[np.float64]:
    """Nearest xyzw quaternions (..., 4) of matrices (..., 3, 3) that are orthogonal only to single precision.

    (Bar-Itzhack 2000)
    """
    a, b, c, d, e, f, g, h, i = np.moveaxis(rotations.reshape(*rotations.shape[:-2], 9), -1, 0)
    form = np.array(
        [
            [a - e - i, b + d, c + g, h - f],
            [b + d, e - a - i, f + h, c - g],
            [c + g, f + h, i - a - e, d - b],
            [h - f, c - g, d - b, a + e + i],
        ]
    )
    nearest: NDArray[np.float64] = np.linalg.eigh(np.moveaxis(form, (0, 1), (-2, -1)))[1][..., -1]
    return nearest
