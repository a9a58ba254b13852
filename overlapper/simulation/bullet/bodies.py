"""The bodies of a pybullet client."""

from __future__ import annotations

import warnings
from collections.abc import Mapping

import numpy as np

from overlapper.simulation.bodies import AnyBodies
from overlapper.simulation.bullet.recorder import Recorder
from overlapper.simulation.bullet.source import BulletSource
from overlapper.simulation.cautions import UnknownBodyWarning
from overlapper.simulation.naming import named
from overlapper.simulation.settings import Concave, Modelling, Surface


class Bodies(AnyBodies):
    """The bodies of one pybullet client as convex shapes placed in the world.

        bodies = Bodies(physicsClientId)
        while ...:
            pybullet.stepSimulation(physicsClientId)
            bodies.update()
            for contact in bodies.overlaps():
                ...

    Boxes, spheres, capsules, cylinders, planes and convex meshes are modelled. Compounds are modelled part by part.
    Soft bodies, flat hulls and height fields without a recorder are not modelled. They are in `skipped`, and each gives
    one SkippedShapeWarning. The same holds for mesh files that pybullet could not read, but only if a recorder has
    noted the model that names them.

    Concave meshes are decomposed into convex parts. Each part is a shape of the link, and `decomposed` lists the
    meshes. `concave_threshold`, from 0.01 to 1, is the concavity that may be left (see
    overlapper.polytopes.decomposition). The first decomposition of a mesh may take minutes and needs the extra
    `concave`. A mesh with an open surface bounds no volume and is skipped. With concave="enclose" CoACD closes such
    meshes by walls. With concave="skip" all concave meshes are skipped.

    With surface="margin" convex meshes have the margin that Bullet lays around them, 1 mm by default. Depths then agree
    with pybullet's contact distances. Boxes and cylinders are the same either way, as their margin lies inside. In most
    pairs Bullet rounds their edges by the margin, which takes up to 0.73 mm off a corner. Convex parts of concave
    meshes have no margin. `update()` notices a changed margin if `getDynamicsInfo` of the base reports it.

    Pairs are those that pybullet lets collide, by static bases, groups and masks. pybullet cannot be asked for pair
    filters, the filter mode and self-collision. A `recorder` that is set up before the scene is built knows them.
    `pairs` and `overlaps` take other choices. Groups and masks are read again when there are new bodies, when a base
    becomes static or stops being static, and when a recorder hears of a change.

    Height fields that a recorder has noted are modelled as the prisms below their triangles. Only the prisms near other
    shapes are modelled, and they are released when the shapes move away. `report()` counts all triangles as shapes, and
    the modelled ones as read.

    `names` are names of bodies by their numbers. An UnknownBodyWarning names the numbers that are not there yet. Other
    bodies are called by the stem of their file, which a recorder hears, by the name of their robot, or by their mesh or
    kind of shape. The most informative name is taken.

    If a body collides with itself and no recorder has heard of it, pybullet's contact points show it. overlaps() then
    gives one SelfCollisionWarning.

    A body without a finite pose is left out and is in `skipped`, until it has a finite pose again.

    `update()` notices bodies that come, go or take over the id of another body. It marks every body with a user data
    entry. The marks are removed by `close()`, at the end of a `with`, and with the last `Bodies` of a client. New
    bodies are read from a temporary .bullet file. If two bodies stand at the same point, the friction of all bodies is
    set and restored to tell them apart. Bodies that another process adds to a shared simulation are noticed after
    `pybullet.syncBodyInfo()`. pybullet gives no ids to bodies that loadBullet brings; `skipped` counts them.

    TypeError if `physicsClientId` is not an integer. ValueError if it is not connected, the recorder is of another
    client, or a name is invalid.
    RuntimeError if the physics server writes where this process cannot read.
    """

    def __init__(
        self,
        physicsClientId: int = 0,
        *,
        concave: Concave = "decompose",
        concave_threshold: float = 0.05,
        surface: Surface = "nominal",
        recorder: Recorder | None = None,
        names: Mapping[int, str] | None = None,
    ) -> None:
        if not isinstance(physicsClientId, int | np.integer):
            raise TypeError(f"physicsClientId must be what pybullet.connect() returned, not {physicsClientId!r}")
        if recorder and recorder.physicsClientId != physicsClientId:
            raise ValueError(f"recorder is of client {recorder.physicsClientId}, not of {physicsClientId}")
        self.physicsClientId = physicsClientId
        self._recorder = recorder
        modelling = Modelling(concave, concave_threshold, surface)
        given = named(names)
        super().__init__(BulletSource(physicsClientId, modelling, recorder, given))
        if strange := sorted(given.keys() - self._source.bodies.keys()):
            told = ", ".join(f"{body}: {given[body]!r}" for body in strange)
            warnings.warn(f"names has bodies that are not in the simulation: {told}", UnknownBodyWarning, stacklevel=2)

    @property
    def recorder(self) -> Recorder | None:
        """The recorder that was given."""
        return self._recorder
