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

    Parameters
    ----------
    physicsClientId : int, default 0
        What pybullet.connect() returned.
    concave : {'decompose', 'enclose', 'skip'}, default 'decompose'
        'decompose': make convex parts of concave meshes with CoACD, and skip open meshes, which bound no volume.
        'enclose': also close open meshes by walls. 'skip': skip all concave meshes.
    concave_threshold : float, default 0.05
        Allowed concavity of the parts, from 0.01 (many parts) to 1 (the convex hull).
    surface : {'nominal', 'margin'}, default 'nominal'
        'margin': convex meshes have the collision margin of Bullet, 1 mm by default.
    recorder : Recorder, optional
        A recorder that was set up before the scene was built. It knows pair filters, the filter mode, self-collision,
        height fields and files, which pybullet cannot be asked for.
    names : dict of int to str, optional
        Names of bodies by their numbers. An UnknownBodyWarning names numbers that are not in the simulation.

    Raises
    ------
    TypeError
        If `physicsClientId` is not an integer.
    ValueError
        If the client is not connected, the recorder is of another client, or a name is invalid.
    RuntimeError
        If the physics server writes where this process cannot read.

    Notes
    -----
    Boxes, spheres, capsules, cylinders, planes and convex meshes are modelled. Compounds are modelled part by part.
    Soft bodies, flat hulls and height fields without a recorder are not modelled. They are in `skipped`, and each gives
    one SkippedShapeWarning. The same holds for mesh files that pybullet could not read, but only if a recorder has
    noted the model that names them.

    Each convex part of a concave mesh is a shape of the link. `decomposed` lists the meshes. The first decomposition of
    a mesh may take minutes and needs the extra `concave` (see overlapper.polytopes.decomposition).

    With surface="margin", depths agree with pybullet's contact distances. Boxes and cylinders are the same either way,
    as their margin lies inside. In most pairs Bullet rounds their edges by the margin, which takes up to 0.73 mm off a
    corner. Convex parts of concave meshes have no margin. `update()` notices a changed margin if `getDynamicsInfo` of
    the base reports it.

    Pairs are those that pybullet lets collide, by static bases, groups and masks. `pairs` and `overlaps` take other
    choices. Groups and masks are read again when there are new bodies, when a base becomes static or stops being
    static, and when a recorder hears of a change.

    Height fields that a recorder has noted are modelled as the prisms below their triangles. Only the prisms near other
    shapes are modelled, and they are released when the shapes move away. `report()` counts all triangles as shapes, and
    the modelled ones as read.

    Bodies without a name in `names` are called by the stem of their file, which a recorder hears, by the name of their
    robot, or by their mesh. The most informative name is taken. Other bodies of one shape are called by its kind, with
    colour and size if these tell them apart: "red box 0.1 m". If a recorder has heard an object that makes bodies and
    keeps their names in a dictionary `_bodies_idx`, as panda-gym does, these names come first.

    If a body collides with itself and no recorder has heard of it, pybullet's contact points show it. overlaps() then
    gives one SelfCollisionWarning.

    A body without a finite pose is left out and is in `skipped`, until it has a finite pose again.

    `update()` notices bodies that come, go or take over the id of another body. It marks every body with a user data
    entry. The marks are removed by `close()`, at the end of a `with`, and with the last `Bodies` of a client. New
    bodies are read from a temporary .bullet file. If two bodies stand at the same point, the friction of all bodies is
    set and restored to tell them apart. Bodies that another process adds to a shared simulation are noticed after
    `pybullet.syncBodyInfo()`. pybullet gives no ids to bodies that loadBullet brings; `skipped` counts them.
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
        if not (recorder is None or isinstance(recorder, Recorder)):
            raise TypeError(f"recorder must be a Recorder, not {recorder!r}")
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
