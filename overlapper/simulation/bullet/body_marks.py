"""Marks by which the bodies of a pybullet client are known again: pybullet gives the ids of removed ones to others."""

from __future__ import annotations

import contextlib
import os
import uuid
import weakref
from collections import Counter
from collections.abc import Iterable
from itertools import repeat

import pybullet

_latest: dict[tuple[int, int], str] = {}
"""The key of the entry that was last put on a body, by client and body."""
_held: Counter[str] = Counter()
"""How many readers know a body by the entry with this key."""


class BodyMarks:
    """A user data entry on every body that has been read, shared by all that read the client in this process.

    Each has a key of its own, by which the body is told from a later one with its id. It goes when the body goes, or
    when the last reader that knows the body by it is closed or collected.

    pybullet tells of user data what this process has heard. It hears of another's changes, and of bodies after a
    syncBodyInfo, only by a syncUserData, which takes as long as all the rest of an update.
    """

    def __init__(self, client: int) -> None:
        self._client = client
        self._keys: dict[int, str] = {}
        self.close = weakref.finalize(self, _release, client, os.getpid(), self._keys)
        self._ids: list[int] = []
        self._counts: list[int] = []  # of the entries of each body, ours and others'
        self._places: list[int] = []  # of ours among them
        self._entries: list[tuple[object, ...]] = []

    def put(self, id: int) -> None:
        """Know the body by its mark, and give it one if it has none. Needs a syncUserData before it."""
        key = _latest.get((self._client, id))
        if not key or _entry(self._client, id, key) < 0:
            key = _latest[self._client, id] = f"overlapper {uuid.uuid4()}"
            pybullet.addUserData(id, key, "", physicsClientId=self._client)
        _held[key] += 1
        if before := self._keys.get(id):
            _held[before] -= 1
        self._keys[id] = key

    def is_on(self, id: int) -> bool:
        """Whether the body is the one that was marked. Needs a syncUserData before it."""
        return id in self._keys and _entry(self._client, id, self._keys[id]) >= 0

    def remember(self, ids: Iterable[int]) -> None:
        """These are all bodies, and each is marked."""
        before = dict(zip(self._ids, zip(self._counts, self._places, self._entries)))
        self._ids = list(ids)
        for id in self._keys.keys() - {*self._ids}:
            _held[self._keys.pop(id)] -= 1
        self._counts = self._count()
        self._places, self._entries = [], []
        for id, number in zip(self._ids, self._counts):
            known, place, entry = before.get(id, (-1, 0, ()))
            # Most bodies are as they were before.
            if known != number or pybullet.getUserDataInfo(id, place, self._client) != entry:
                key = self._keys[id].encode()
                entries = [pybullet.getUserDataInfo(id, each, self._client) for each in range(number)]
                place = next(each for each, entry in enumerate(entries) if entry[1] == key)
                entry = entries[place]
            self._places.append(place)
            self._entries.append(entry)

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


def _entry(client: int, id: int, key: str) -> int:
    """The id of the entry with this key on the body, -1 if there is none."""
    return int(pybullet.getUserDataId(id, key, physicsClientId=client))


def _release(client: int, process: int, keys: dict[int, str]) -> None:
    """Remove the entries by which no reader knows these bodies any more."""
    _held.subtract(keys.values())
    # A process that was forked off shares a physics server with its parent, whose marks these are.
    if os.getpid() != process or not pybullet.isConnected(client):
        return
    with contextlib.suppress(pybullet.error):  # of a server that has gone
        # Without it pybullet finds entries of bodies that are gone.
        pybullet.syncUserData(physicsClientId=client)
        for id, key in keys.items():
            if not _held[key] and (entry := _entry(client, id, key)) >= 0:
                pybullet.removeUserData(entry, client)
