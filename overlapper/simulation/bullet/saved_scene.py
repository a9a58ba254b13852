"""A pybullet client written to a temporary .bullet file, and the bodies of the file matched to those of the client."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import count

import pybullet

from overlapper.printable import first_line
from overlapper.simulation.bullet.bullet_file import BulletFile
from overlapper.simulation.model import BASE
from overlapper.simulation.source import Unreadable

MULTIBODY, SOFT_BODY = 2, 3  # of getDynamicsInfo; 1 is a rigid body in maximal coordinates


def body_ids(client: int) -> set[int]:
    return {pybullet.getBodyUniqueId(i, client) for i in range(pybullet.getNumBodies(client))}


def body_type(client: int, id: int) -> int:
    return int(pybullet.getDynamicsInfo(id, BASE, client)[10])


def saved_bodies(client: int, ids: Sequence[int]) -> tuple[BulletFile, dict[int, int], list[int]]:
    """The scene as a .bullet file, the place in it of each body in `ids` that is not soft, and the hidden bodies.

    The file has no ids. Position and number of links identify a body, unless another body shares them or the body is
    hidden: pybullet does not report the position of bodies with 128 links or more. In these cases each body gets a
    distinct friction while the file is written.
    """
    ids = [id for id in ids if body_type(client, id) != SOFT_BODY]
    file = save(client)
    saved = {(body.links, *body.position.tolist()): row for row, body in enumerate(file.bodies)}
    wanted = {id: (pybullet.getNumJoints(id, client), *_base_position(client, id)) for id in ids}
    hidden = [id for id, key in wanted.items() if len(key) == 1]
    if len(saved) == len(file.bodies) and len(set(wanted.values())) == len(ids) and saved.keys() >= {*wanted.values()}:
        return file, {id: saved[key] for id, key in wanted.items()}, hidden

    taken = {body.friction for body in file.bodies}
    frictions = dict(zip(ids, (float(value) for value in count(1) if value not in taken)))
    with _frictions(client, frictions):
        file = save(client)
    by_friction = {body.friction: row for row, body in enumerate(file.bodies)}
    rows = {id: by_friction[friction] for id, friction in frictions.items() if friction in by_friction}
    return file, rows, hidden


def _base_position(client: int, id: int) -> tuple[float, ...]:
    try:
        return tuple(pybullet.getBasePositionAndOrientation(id, client)[0])
    except pybullet.error:
        return ()


def save(client: int) -> BulletFile:
    """Write and read the file. Unreadable if it is missing or incomplete: pybullet does not report a full disk."""
    try:
        # A file without its own folder: removing a folder takes as long as all the rest.
        descriptor, name = tempfile.mkstemp(prefix="overlapper-", suffix=".bullet")
        os.close(descriptor)
    except OSError as error:
        raise Unreadable(
            f"the physics server of physicsClientId {client} cannot hand over its shapes, because no temporary "
            f"file can be made: {error.strerror}"
        ) from error
    try:
        pybullet.saveBullet(name, physicsClientId=client)
        if os.path.getsize(name):
            return BulletFile(name)
        reason: Exception | None = None
    except (pybullet.error, OSError, ValueError) as error:
        reason = error
    finally:
        os.unlink(name)
    raise Unreadable(
        f"the physics server of physicsClientId {client} could not write its shapes to {name}: "
        "it must run on this machine, have the right to write there and have room on the disk"
        + (f" ({first_line(reason)})" if isinstance(reason, ValueError) else "")
    ) from reason


@contextmanager
def _frictions(client: int, frictions: Mapping[int, float]) -> Iterator[None]:
    before = {id: pybullet.getDynamicsInfo(id, BASE, client)[1] for id in frictions}
    try:
        for id, friction in frictions.items():
            pybullet.changeDynamics(id, BASE, lateralFriction=friction, physicsClientId=client)
        yield
    finally:
        for id, friction in before.items():
            pybullet.changeDynamics(id, BASE, lateralFriction=friction, physicsClientId=client)
