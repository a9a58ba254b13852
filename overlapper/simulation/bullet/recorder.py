"""A recorder of the settings that pybullet is told and cannot be asked for later."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pybullet
import pybullet_data
from numpy.typing import ArrayLike

from overlapper.printable import printable
from overlapper.simulation.bullet.calls import BEGINS, Arguments, listen, unlisten
from overlapper.simulation.bullet.commands import Commands
from overlapper.simulation.height_field import HeightField
from overlapper.simulation.model import LinkKey

# Calls that are heard and do not change who collides.
UNNOTED = frozenset(
    {
        *("connect", "stepSimulation", "setRealTimeSimulation", "changeConstraint", "applyExternalForce"),
        *(
            "applyExternalTorque",
            BEGINS,
            "setJointMotorControl2",
            "setJointMotorControlArray",
            "setJointMotorControlMultiDof",
        ),
        *("setJointMotorControlMultiDofArray", "restoreState", "setAdditionalSearchPath"),
    }
)

# The parameters of the functions that make bodies from a file.
FILE_NAMES = ("fileName", "sdfFileName", "mjcfFileName")


class Loaded(NamedTuple):
    """The file that bodies were loaded from. `place` is its path, None if unknown."""

    file: str
    place: Path | None
    bodies: tuple[int, ...]
    flags: int

    @property
    def alone(self) -> bool:
        """Whether only one body was loaded from the file."""
        return len(self.bodies) == 1


class Recorder:
    """Notes the settings that pybullet is told and cannot be asked for later.

    These are pair filters, the filter mode, self-collision, the data of height fields, and the files of bodies. If a
    wrapper of pybullet has names for the bodies that it makes, as panda-gym has, these are noted, too.

        client = pybullet.connect(pybullet.DIRECT)
        recorder = Recorder(client)
        ...  # build the scene
        bodies = Bodies(client, recorder=recorder)

    Set it up before the scene is built, and before any `from pybullet import ...` of the functions that it listens to.
    Until `close()`, or the end of a `with`, these functions are replaced in the module `pybullet`, for all clients. The
    replacements call the original functions and note the calls for this client. Calls of another process to a shared
    simulation are not noticed.

    Parameters
    ----------
    physicsClientId : int, default 0
        What pybullet.connect() returned.
    """

    def __init__(self, physicsClientId: int = 0) -> None:
        if not isinstance(physicsClientId, int | np.integer):
            raise TypeError(f"physicsClientId must be what pybullet.connect() returned, not {physicsClientId!r}")
        self.physicsClientId = physicsClientId
        self.changes = 0
        """How often anything was noted."""
        self.masks_set = 0
        """How often groups and masks were set."""
        self.scenes_loaded = 0
        """How often bodies may have come or gone unreported by pybullet, as with loadBullet."""
        self.commands = Commands(physicsClientId)
        """The commands to motors, constraints and bodies."""
        self._forget()
        listen(self._hear)

    def _forget(self) -> None:
        self.pair_filters: dict[tuple[LinkKey, LinkKey], bool] = {}
        """Whether setCollisionFilterPair lets two links collide; the lesser link first."""
        self.both_masks_must_agree = False
        """True for collisionFilterMode 0. By default one mask that admits the other's group is enough."""
        self.self_collision: dict[int, int] = {}
        """The load flags of each body that was loaded with URDF_USE_SELF_COLLISION."""
        self.loaded: dict[int, Loaded] = {}
        """The files of the bodies that loadURDF, loadSDF or loadMJCF made."""
        self._named: list[dict[object, object]] = []  # ids by name, as wrappers of pybullet keep them
        self._search_path = ""
        self._fields: dict[int, HeightField] = {}  # by shape
        self._shapes: dict[int, int] = {}  # by body that is a height field

    def height_field(self, body: int) -> HeightField | None:
        """The height field of a body, if it was given as heightfieldData.

        Parameters
        ----------
        body : int
            The number of the body.

        Returns
        -------
        HeightField or None
            The noted height field.
        """
        return self._fields.get(self._shapes.get(body, -1))

    @property
    def body_names(self) -> dict[int, str]:
        """The names of bodies by number in the wrapper of pybullet that made them."""
        pairs = [pair for named in self._named for pair in named.items()]
        return {body: printable(name) for name, body in pairs if isinstance(name, str) and isinstance(body, int)}

    def close(self) -> None:
        """Stop noting and keep the notes. After all recorders are closed, pybullet has its own functions again."""
        unlisten(self._hear)

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _hear(self, name: str, arguments: Arguments, result: Any) -> None:
        self.commands.hear(name, arguments, result)
        if arguments.get("physicsClientId", 0) != self.physicsClientId:
            return
        if name == "setAdditionalSearchPath":
            self._search_path = os.fspath(arguments["path"])
        if name not in UNNOTED:
            self._note(name, arguments, result)

    def _note(self, name: str, arguments: Arguments, result: Any) -> None:
        self.changes += 1
        match name:
            case "setCollisionFilterPair":
                links = [(arguments[f"bodyUniqueId{side}"], arguments[f"linkIndex{side}"]) for side in "AB"]
                first, second = sorted(links)
                self.pair_filters[first, second] = bool(arguments["enableCollision"])
            case "setCollisionFilterGroupMask":
                self.masks_set += 1
            case "setPhysicsEngineParameter":
                if (mode := arguments.get("collisionFilterMode", -1)) >= 0:
                    self.both_masks_must_agree = mode == 0
            case "loadURDF" | "loadSDF" | "loadMJCF" | "createMultiBody":
                flags = arguments.get("flags", 0)
                made = result if isinstance(result, tuple) else (result,)
                file = next((os.fspath(arguments[each]) for each in FILE_NAMES if each in arguments), None)
                loaded = Loaded(file, self._found(file), made, flags) if file else None
                for body in made:
                    self._drop(body)
                    if loaded:
                        self.loaded[body] = loaded
                    if arguments.get("baseCollisionShapeIndex", -1) in self._fields:
                        self._shapes[body] = arguments["baseCollisionShapeIndex"]
                    if flags & pybullet.URDF_USE_SELF_COLLISION:
                        self.self_collision[body] = flags
                self._note_names()
            case "removeBody":
                # Pair filters outlive the body, and apply to the next one with its id.
                self._drop(arguments["bodyUniqueId"])
            case "createCollisionShape":
                if arguments["shapeType"] == pybullet.GEOM_HEIGHTFIELD and arguments.get("heightfieldData") is not None:
                    self._note_field(arguments, result)
                else:
                    self._fields.pop(result, None)
            case "loadBullet":
                self.scenes_loaded += 1
            case "resetSimulation" | "disconnect":
                self.scenes_loaded += 1
                self._forget()

    def _note_names(self) -> None:
        """Keep the dictionary `_bodies_idx` of the object whose method has made a body. It gets the id afterwards."""
        caller = sys._getframe(4)  # past _note, _hear and the replacement of pybullet's function
        named = getattr(caller.f_locals.get("self"), "__dict__", {}).get("_bodies_idx")
        if isinstance(named, dict) and not any(named is each for each in self._named):
            self._named.append(named)

    def _found(self, file: str) -> Path | None:
        """The path at which pybullet has found a file, by the folders that it searches first."""
        places = (Path(folder, file) for folder in ("", self._search_path, pybullet_data.getDataPath()))
        return next((place.absolute() for place in places if place.is_file()), None)

    def _note_field(self, arguments: Arguments, shape: int) -> None:
        replaced = self._fields.get(arguments.get("replaceHeightfieldIndex", -1))
        self._fields[shape] = height_field(
            arguments["heightfieldData"],
            arguments["numHeightfieldRows"],
            arguments["numHeightfieldColumns"],
            arguments.get("meshScale", (1.0, 1.0, 1.0)),
            replaced,
        )

    def _drop(self, body: int) -> None:
        self.self_collision.pop(body, None)
        self._shapes.pop(body, None)
        self.loaded.pop(body, None)


def height_field(
    data: ArrayLike, rows: int, columns: int, scale: ArrayLike, before: HeightField | None = None
) -> HeightField:
    """The field that createCollisionShape makes of these heights, with `rows` heights along x.

    Bullet puts the middle height at z = 0. A field that replaces the field `before` keeps the middle of that field. The
    solid ground ends as far below the lowest point as the field is wide.
    """
    x, y, z = np.asarray(scale, dtype=float)
    # Bullet keeps the heights in single precision.
    plain = z * np.asarray(data, dtype=np.float32).astype(float).reshape(columns, rows)
    middle = before.middle if before else float(plain.min() + plain.max()) / 2
    heights, spacing = plain - middle, (float(x), float(y))
    depth = max((rows - 1) * spacing[0], (columns - 1) * spacing[1])
    return HeightField(heights, spacing, float(heights.min()) - depth, middle=middle)
