"""Marks that identify the bodies of a pybullet client. pybullet gives the id of a removed body to another body."""

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
    """A user data entry on every body that has been read. All readers of the client in this process share the entries.

    Each entry has its own key, which tells the body from a later body with the same id. An entry is removed with its
    body, or when the last reader that uses the entry is closed or collected.

    pybullet reports only the user data known to this process. Changes by another process, and bodies found by
    syncBodyInfo, need a syncUserData, which takes as long as all the rest of an update.
    """

    def __init__(self, client: int) -> None:
        self._client = client
        self._keys: dict[int, str] = {}
        self.close = weakref.finalize(self, _release, client, os.getpid(), self._keys)
        self._ids: list[int] = []
        self._counts: list[int] = []  # of all entries of each body
        self._places: list[int] = []  # of our entry among them
        self._entries: list[tuple[object, ...]] = []

    def put(self, id: int) -> None:
        """Identify the body by its mark; a body without a mark gets one. Call syncUserData first."""
        key = _latest.get((self._client, id))
        if not key or _entry(self._client, id, key) < 0:
            key = _latest[self._client, id] = f"overlapper {uuid.uuid4()}"
            pybullet.addUserData(id, key, "", physicsClientId=self._client)
        _held[key] += 1
        if before := self._keys.get(id):
            _held[before] -= 1
        self._keys[id] = key

    def is_on(self, id: int) -> bool:
        """Whether the body is the one that was marked. Call syncUserData first."""
        return id in self._keys and _entry(self._client, id, self._keys[id]) >= 0

    def remember(self, ids: Iterable[int]) -> None:
        """Remember the entries of these bodies. They are all bodies, and each is marked."""
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
        """Whether the bodies are the remembered ones, as far as this process knows."""
        client = self._client
        if pybullet.getNumBodies(client) != len(self._ids) or self._count() != self._counts:
            return False
        # The counts are compared first, as pybullet reads beyond the end of a shorter list. The entry must be in the
        # list of the body, because pybullet finds the key of a removed body, too.
        return list(map(pybullet.getUserDataInfo, self._ids, self._places, repeat(client))) == self._entries

    def _count(self) -> list[int]:
        return list(map(pybullet.getNumUserData, self._ids, repeat(self._client)))


def _entry(client: int, id: int, key: str) -> int:
    """The id of the entry with this key on the body, -1 if there is none."""
    return int(pybullet.getUserDataId(id, key, physicsClientId=client))


def _release(client: int, process: int, keys: dict[int, str]) -> None:
    """Remove the entries of these bodies that no reader uses any more."""
    _held.subtract(keys.values())
    # A forked process may share a physics server with its parent, and the marks belong to the parent.
    if os.getpid() != process or not pybullet.isConnected(client):
        return
    with contextlib.suppress(pybullet.error):  # of a server that has gone
        # Without a sync, pybullet finds entries of removed bodies.
        pybullet.syncUserData(physicsClientId=client)
        for id, key in keys.items():
            if not _held[key] and (entry := _entry(client, id, key)) >= 0:
                pybullet.removeUserData(entry, client)
