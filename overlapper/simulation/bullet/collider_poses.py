"""The poses of the links of a pybullet client, read at every step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import repeat

import numpy as np
import pybullet

from overlapper.simulation.bullet.bullet_file import orientations
from overlapper.simulation.bullet.saved_scene import save
from overlapper.simulation.layout import Pose
from overlapper.simulation.model import BASE


class ColliderPoses:
    """The inertial frames of the bases and links that shapes are fixed to, and which bases are static.

    `colliders` are (body, link) of each frame. `static` is in the order of `bodies`.
    """

    def __init__(self, client: int, links: Mapping[int, Sequence[int]], hidden: Mapping[int, int]) -> None:
        """`links` by body are read in addition to its base. `hidden` has places of bodies in a .bullet file."""
        self._client = client
        self._hidden = [(hidden[id], links[id]) for id in links if id in hidden]
        self._seen = [id for id in links if id not in hidden]
        self._jointed = [(id, links[id]) for id in self._seen if links[id]]
        self.bodies = [*self._seen, *(id for id in links if id in hidden)]
        self.colliders = [(id, BASE) for id in self.bodies]
        self.colliders += [(id, link) for id in self.bodies for link in links[id]]
        self._latest: list[Pose] = []
        self.static = [True] * len(self.bodies)

    def read(self) -> list[Pose]:
        """Read the frames and which bases are static."""
        client, before = self._client, self._latest or [()] * len(self.bodies)
        saved = self._saved_frames() if self._hidden else {}
        frames: list[Pose] = list(map(pybullet.getBasePositionAndOrientation, self._seen, repeat(client)))
        frames += [saved[row, BASE] for row, _ in self._hidden]
        for id, links in self._jointed:
            # Without forward kinematics the poses of links lag one step behind.
            frames += pybullet.getLinkStates(id, links, computeForwardKinematics=1, physicsClientId=client)
        frames += [saved[row, link] for row, links in self._hidden for link in links]
        self._latest = frames
        # changeDynamics may make a static body dynamic, and back. A body that the simulation has moved is not static. A
        # body that a script has moved is asked when it rests.
        for k, id in enumerate(self.bodies):
            if self.static[k] or frames[k] == before[k]:
                self.static[k] = pybullet.getDynamicsInfo(id, BASE, client)[0] == 0
        return frames

    def _saved_frames(self) -> dict[tuple[int, int], Pose]:
        """The frames of the hidden bodies, by place in a .bullet file and link."""
        bodies = save(self._client).bodies
        keys = [(row, link) for row, links in self._hidden for link in (BASE, *links)]
        colliders = [bodies[row].colliders[link] for row, link in keys]
        positions = np.array([collider.position for collider in colliders]).tolist()
        return dict(zip(keys, zip(positions, orientations(colliders).tolist())))
