"""Marks by which the bodies of a pybullet client are known again: pybullet gives the ids of removed ones to others."""

from __future__ import annotations

import uuid
from collections.abc import Iterable
from itertools import repeat

import pybullet


class BodyMarks:
    """A user data entry on every body that has been read. It goes when the body goes.

    What pybullet tells of user data is what this process has heard: another's changes, and those of bodies after a
    syncBodyInfo, only after a syncUserData, which takes as long as all the rest of an update.
    """

    def __init__(self, client: int) -> None:
        self._client = client
        self._key = f"overlapper {uuid.uuid4()}"
        self._ids: list[int] = []
        self._counts: list[int] = []  # of the entries of each body, ours and others'
        self._places: list[int] = []  # of ours among them
        self._entries: list[tuple[object, ...]] = []

    def put(self, id: int) -> None:
        pybullet.addUserData(id, self._key, "", physicsClientId=self._client)

    def is_on(self, id: int) -> bool:
        """Whether the body is marked. Needs a syncUserData before it."""
        return bool(pybullet.getUserDataId(id, self._key, physicsClientId=self._client) >= 0)

    def remember(self, ids: Iterable[int]) -> None:
        """These are all bodies, and each is marked."""
        client = self._client
        self._ids = list(ids)
        self._counts = self._count()
        entries = [
            [pybullet.getUserDataInfo(id, place, client) for place in range(count)]
            for id, count in zip(self._ids, self._counts)
        ]
        key = self._key.encode()
        self._places = [next(k for k, entry in enumerate(each) if entry[1] == key) for each in entries]
        self._entries = [each[place] for each, place in zip(entries, self._places)]

    def are_as_remembered(self) -> bool:
        """Whether there are the same bodies as then, as far as this process has heard."""
        client = self._client
        if pybullet.getNumBodies(client) != len(self._ids) or self._count() != self._counts:
            return False
        # With the counts as they were, since pybullet reads beyond the end of a list that is shorter. The entry has to
        # be in the list of the body: the key alone is found for a body long gone, too.
        return list(map(pybullet.getUserDataInfo, self._ids, self._places, repeat(client))) == self._entries

    def _count(self) -> list[int]:
        return list(map(pybullet.getNumUserData, self._ids, repeat(self._client)))
