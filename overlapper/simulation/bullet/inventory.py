"""The inventory of a file for pybullet: every modelled shape, and which links the simulator lets collide.

The file is read in a separate process (`overlapper.simulation.bullet.model_file`).
"""

from __future__ import annotations

import warnings
from collections.abc import Generator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from overlapper import Placed
from overlapper.quaternion import composed, rotated
from overlapper.shapes.table import facts
from overlapper.simulation.bullet.model_file import LOADED, NotRead, load, read_apart
from overlapper.simulation.bullet.model_text import must_be_sound, root_of
from overlapper.simulation.settings import Modelling, settings_of

Listed = dict[tuple[int, int], list[Placed]]


@dataclass(frozen=True, slots=True)
class ListedShape:
    """A modelled shape. `size` has its dimensions in m. `box` (3,) has the sides of its bounding box as loaded.

    `corners` is 0 except for hulls. `volume` (m³) and `box` are infinite for a plane.
    """

    kind: str
    size: str
    corners: int
    volume: float
    box: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class ListedLink:
    """A link (-1 is the base) that has shapes. The simulator lets it collide with `meets` other links of the file."""

    body: int
    link: int
    name: str
    shapes: tuple[ListedShape, ...]
    meets: int


@dataclass(frozen=True, slots=True)
class Inventory:
    """The bodies and shapes in a file. `pairs` counts the pairs of shapes that the simulator lets collide."""

    bodies: int
    shapes: int
    shapes_read: int
    pairs: int
    links: tuple[ListedLink, ...]
    skipped: tuple[tuple[str, str], ...]  # name and reason
    decomposed: tuple[tuple[str, int], ...]  # name and number of convex parts

    def as_dict(self) -> dict[str, Any]:
        """The inventory for JSON: infinite values become None."""
        made = asdict(self)
        for link in made["links"]:
            for shape in link["shapes"]:
                if not np.isfinite(shape["volume"]):
                    shape |= {"volume": None, "box": None}
        return made


def inventory(path: Path, self_collision: bool = False, modelling: Modelling = Modelling()) -> Inventory:  # noqa: B008
    """The inventory of a URDF, SDF, MJCF or .bullet file.

    With `self_collision` a URDF or MJCF model is loaded with pybullet's URDF_USE_SELF_COLLISION. NotRead if the file is
    missing, or if pybullet refuses it or crashes.
    """
    found: Inventory = read_apart(path, _answers, (path, self_collision, modelling))
    return found


def _answers(request: tuple[Path, bool, Modelling]) -> Generator[Inventory | str, None, None]:
    """The inventory, or the reason why the file cannot be read. This runs in the process that reads the file."""
    try:
        yield (yield from _read(*request))
    except (NotRead, ValueError) as error:
        yield str(error)


def _read(path: Path, self_collision: bool, modelling: Modelling) -> Generator[str, None, Inventory]:
    if path.suffix.lower() == ".bullet":
        return _of_bullet_file(path, modelling)
    import pybullet

    from overlapper.simulation import Bodies, Recorder

    root = root_of(path)
    must_be_sound(path, root)
    client = pybullet.connect(pybullet.DIRECT)
    with Recorder(client) as recorder:
        load(path, client, pybullet.URDF_USE_SELF_COLLISION if self_collision else 0)
        yield LOADED
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # the inventory names the skipped shapes
            bodies = Bodies(client, recorder=recorder, **settings_of(modelling))
    listed: Listed = {}
    for (body, link, _), placed in zip(bodies.keys, bodies.placed):
        listed.setdefault((body, link), []).append(placed)
    report, names = bodies.report(), bodies.names
    if not report.bodies:
        raise NotRead("it has no body")
    meets = {key: len(others) for key, others in bodies.partners().items()}
    return Inventory(
        report.bodies,
        report.shapes,
        report.shapes_read,
        report.pairs_possible,
        _links(listed, names, meets),
        tuple((each.name, each.reason) for each in bodies.skipped),
        tuple((each.name, len(each.shapes)) for each in bodies.decomposed),
    )


def _of_bullet_file(path: Path, modelling: Modelling) -> Inventory:
    """The inventory of a file of saveBullet, read directly, as loadBullet loads only part. Its bodies have no names."""
    from overlapper.simulation.bullet.bullet_file import BulletFile
    from overlapper.simulation.collision_rules import Colliders, MaskRules, partners
    from overlapper.simulation.modelling import in_one_sentence, modelled
    from overlapper.simulation.naming import link_name

    file = BulletFile(path)
    colliders = {
        (number, link): collider
        for number, body in enumerate(file.bodies)
        for link, collider in sorted(body.colliders.items())
    }
    names: dict[tuple[int, int], str] = {}
    for number, body in enumerate(file.bodies):
        links = {link: f"link {link}" if link >= 0 else "base" for link in body.colliders}
        names |= {(number, link): link_name(f"body {number}", links, name) for link, name in links.items()}
    listed: Listed = {}
    skipped, decomposed = [], []
    for key, collider in colliders.items():
        parts, reasons, meshes = modelled(key[1], file.leaves(collider.shape), modelling)
        for part in parts:
            position = collider.position + rotated(collider.orientation, part.position)
            orientation = composed(collider.orientation, part.orientation)
            listed.setdefault(key, []).append(Placed(part.shape, position, orientation))
        if reasons:
            skipped.append((names[key], in_one_sentence(reasons, len(parts) + len(reasons))))
        decomposed += [(names[key], len(mesh.parts)) for _, mesh in meshes]
    rows = {key: row for row, key in enumerate(colliders)}
    filters = {key: (each.group, each.mask) for key, each in colliders.items()}
    rules = MaskRules(Colliders.of(rows, filters))
    read = np.array([len(listed.get(key, ())) for key in colliders])
    meets = {key: len(others) for key, others in partners(rules, [*rows], np.flatnonzero(read)).items()}
    shapes = sum(len(file.leaves(each.shape)) for each in colliders.values())
    return Inventory(
        len(file.bodies),
        shapes + sum(parts - 1 for _, parts in decomposed),
        int(read.sum()),
        rules.count(read),
        _links(listed, names, meets),
        tuple(skipped),
        tuple(decomposed),
    )


def _links(
    listed: Listed, names: Mapping[tuple[int, int], str], meets: Mapping[tuple[int, int], int]
) -> tuple[ListedLink, ...]:
    return tuple(
        ListedLink(*key, names[key], tuple(map(_listed, shapes)), meets[key]) for key, shapes in listed.items()
    )


def _listed(placed: Placed) -> ListedShape:
    sides = tuple(float(side) for side in placed.bounds[1] - placed.bounds[0])
    kind, size, corners = facts(placed.shape).words()
    return ListedShape(kind, size, corners, placed.shape.volume, sides)
