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

    Boxes, spheres, capsules, cylinders, planes and convex meshes are modelled, compounds part by part. What cannot be
    (soft bodies, flat hulls, height fields without a recorder) is in `skipped`, with one SkippedShapeWarning each. So
    are meshes of a file that pybullet could not read, if a recorder has heard of the file: nothing else tells of them.

    Concave meshes are decomposed into convex parts, which count as so many shapes of their link and are listed in
    `decomposed`. `concave_threshold`, from 0.01 to 1, is the concavity that may be left (see
    overlapper.polytopes.decomposition). It takes up to minutes the first time, and needs the extra `concave`. A mesh
    whose surface is open bounds no volume and is skipped; with concave="enclose" CoACD lays walls around it. With
    concave="skip" all concave meshes are.

    With surface="margin" convex meshes have the margin that Bullet lays around them, 1 mm by default, so that depths
    are those of pybullet's contact distances. Boxes and cylinders are the same either way, as their margin lies inside.
    Bullet rounds their edges by it in most pairs, which takes up to 0.73 mm off a corner. Convex parts of concave
    meshes have none. A margin that changes is noticed by `update()` where `getDynamicsInfo` of the base tells.

    Pairs are those that pybullet lets collide, by static bases, groups and masks. A `recorder`, set up before the scene
    is built, adds what pybullet cannot be asked for: pair filters, the filter mode and self-collision. `pairs` and
    `overlaps` take other choices. Groups and masks are read again with new bodies, when a base becomes static or ceases
    to be, and when a recorder hears of a change.

    Height fields that a recorder has noted are modelled as the prisms below their triangles, near what may meet them;
    behind what moves away they are released. `report()` counts all triangles, and as read those modelled.

    A body is called by the `names` given, by its number; an UnknownBodyWarning names those that are not there yet.
    Other bodies are called by the stem of their file, which a recorder hears, by the name of their robot, or by their
    mesh or kind of shape, whichever says most.

    That a body collides with itself, and no recorder has heard of it, is seen in pybullet's contact points. overlaps()
    says so with one SelfCollisionWarning.

    A body without a finite pose is left out, and in `skipped`, until it has one again.

    Bodies that come, go or take over the id of another are noticed by `update()`, which marks every body with a user
    data entry. `close()`, the end of a `with` or of the last `Bodies` of a client takes the marks off. New bodies are
    read from a temporary .bullet file; if two stand at the same point, the friction of all is set and restored to tell
    them apart. Bodies that another process adds to a shared simulation are noticed after `pybullet.syncBodyInfo()`. To
    those that loadBullet brings pybullet gives no ids; they are counted in `skipped`.

    TypeError if `physicsClientId` is no whole number. ValueError if it is not connected, the recorder is of another
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
        """As it was given."""
        return self._recorder
