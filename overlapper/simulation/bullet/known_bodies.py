"""The bodies of a pybullet client that have been read. New and removed bodies are noticed."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import pybullet

from overlapper.printable import printable
from overlapper.simulation.bullet.body import read_body
from overlapper.simulation.bullet.body_marks import BodyMarks
from overlapper.simulation.bullet.bullet_file import BulletFile
from overlapper.simulation.bullet.lost_shapes import NOT_BUILT, lost_of
from overlapper.simulation.bullet.recorder import Recorder
from overlapper.simulation.bullet.saved_scene import body_ids, saved_bodies
from overlapper.simulation.model import BASE, ModelledBody, Skipped
from overlapper.simulation.naming import link_name
from overlapper.simulation.settings import Modelling


class KnownBodies:
    """The bodies `by_id`, sorted. A body is read once, and read again when its margin or its heights have changed.

    `unidentified` is the number of bodies without an id. `hidden` has the bodies whose poses only a .bullet file tells,
    with their places in the file. `filters` are group and mask by body and link. They were read with the last new body,
    or at the last `read_filters`.
    """

    def __init__(
        self, client: int, modelling: Modelling, recorder: Recorder | None, given_names: Mapping[int, str]
    ) -> None:
        self._client, self._modelling, self._recorder = client, modelling, recorder
        self._given_names = given_names
        self._marks = BodyMarks(client)
        self.unidentified = 0
        self._scenes_loaded = -1  # those that the recorder has noted
        self.by_id: dict[int, ModelledBody] = {}
        self._margins: dict[int, float] = {}  # of the outermost shape of each base
        self.hidden: dict[int, int] = {}
        self.filters: dict[tuple[int, int], tuple[int, int]] = {}

    def refresh(self) -> list[Skipped] | None:
        """Read new bodies. Returns None if no body has come or gone, otherwise the newly skipped shapes."""
        loaded = self._scene_loaded()
        changed = self._margins_changed() | self._ground_changed() | loaded
        if not changed and self._marks.are_as_remembered():
            return None
        # After a syncBodyInfo, pybullet would show the user data of a removed body on the one that inherits its id.
        pybullet.syncUserData(physicsClientId=self._client)
        ids = body_ids(self._client)
        fresh = changed or ids != self.by_id.keys() or not all(map(self._marks.is_on, ids))
        skipped = self._read(loaded) if fresh else None
        self._marks.remember(self.by_id)
        return skipped

    def close(self) -> None:
        """Take the marks off the bodies, unless another reader needs them."""
        self._marks.close()

    def read_filters(self) -> None:
        """Read the groups and masks of the same bodies again."""
        file, rows, _ = saved_bodies(self._client, sorted(self.by_id))
        self._take_filters(file, rows)

    @property
    def skipped(self) -> list[Skipped]:
        """The bodies without an id, as one entry; nothing if there are none."""
        if not self.unidentified:
            return []
        number = "1 body" if self.unidentified == 1 else f"{self.unidentified} bodies"
        reason = "pybullet gives no id to bodies from loadBullet, nor to links of robots in maximal coordinates"
        return [Skipped(-1, BASE, number, reason)]

    def _margins_changed(self) -> bool:
        """Whether a base has another margin than before, if margins are modelled. Its body is then read anew."""
        if self._modelling.surface == "nominal":
            return False
        shaped = {id for id, body in self.by_id.items() if body.shapes or body.grounds}
        watched = body_ids(self._client).intersection(shaped)
        changed = [id for id in watched if _margin(self._client, id) != self._margins[id]]
        for id in changed:
            del self.by_id[id]
        return bool(changed)

    def _ground_changed(self) -> bool:
        """Whether a height field has been given other heights. Its body is then read anew."""
        grounds = {id: ground for id, body in self.by_id.items() for ground in body.grounds}
        for id, ground in grounds.items():
            if self._recorder and self._recorder.height_field(id) is not ground.field:
                del self.by_id[id]
        return len(grounds) > sum(1 for id in grounds if id in self.by_id)

    def _scene_loaded(self) -> bool:
        """Whether there may be new bodies that pybullet does not list."""
        loaded = self._recorder.scenes_loaded if self._recorder else 0
        before, self._scenes_loaded = self._scenes_loaded, loaded
        return loaded != before

    def _read(self, loaded: bool) -> list[Skipped]:
        """Read the bodies that are not marked yet and forget removed bodies. Returns the newly skipped shapes.

        If a scene has been `loaded`, there may be more bodies, which pybullet does not list.
        """
        client = self._client
        ids, known = self._still_known()
        unidentified = self.unidentified
        if loaded or not ids or len(known) < len(ids) or self.hidden:
            file, rows, hidden = saved_bodies(client, ids)
            if len(rows) < len(file.bodies):
                # createMultiBody with batchPositions makes many bodies, and only a sync makes all but the last known.
                # Otherwise there is no sync, as it takes longer than all the rest.
                pybullet.syncBodyInfo(client)
                pybullet.syncUserData(physicsClientId=client)
                ids, known = self._still_known()
                file, rows, hidden = saved_bodies(client, ids)
            self._take_filters(file, rows)
            unidentified = len(file.bodies) - len(rows)
            self.hidden = {id: rows[id] for id in hidden if id in rows}
        fresh = [id for id in ids if id not in known]
        names = {**(self._recorder.body_names if self._recorder and fresh else {}), **self._given_names}
        for id in fresh:
            body = file.bodies[rows[id]] if id in rows else None
            field = self._recorder.height_field(id) if self._recorder else None
            loaded_from = self._recorder.loaded.get(id) if self._recorder else None
            known[id] = read_body(client, id, file, body, self._modelling, field, loaded_from, names.get(id))
            self._margins[id] = _margin(client, id)
            self._marks.put(id)
        if fresh:
            self._add_lost(fresh, known, file, rows)
        self.by_id = dict(sorted(known.items()))
        grown, self.unidentified = unidentified > self.unidentified, unidentified
        skipped = [each for id in fresh for each in self.by_id[id].skipped]
        return skipped + (self.skipped if grown else [])

    def _add_lost(
        self, fresh: Collection[int], known: dict[int, ModelledBody], file: BulletFile, rows: Mapping[int, int]
    ) -> None:
        """Add the shapes that are named in files, but that pybullet has not built, to `skipped` of their bodies."""
        loads = self._recorder.loaded if self._recorder else {}
        for loaded in dict.fromkeys(loads[id] for id in fresh if id in loads):
            lost, absent = lost_of(loaded, self._client, file, rows)
            for (id, link), reason in lost.items():
                links = known[id].link_names
                name = link_name(known[id].name, links, links[link])
                known[id] = with_lost(known[id], Skipped(id, link, name, reason))
            for missing in absent:
                first = known[loaded.bodies[0]]
                skipped = Skipped(loaded.bodies[0], BASE, f"{first.name}/{printable(missing)}", NOT_BUILT)
                known[loaded.bodies[0]] = with_lost(first, skipped)

    def _still_known(self) -> tuple[list[int], dict[int, ModelledBody]]:
        """The ids of all bodies, sorted, and the bodies among them that have been read."""
        ids = sorted(body_ids(self._client))
        return ids, {id: self.by_id[id] for id in ids if id in self.by_id and self._marks.is_on(id)}

    def _take_filters(self, file: BulletFile, rows: Mapping[int, int]) -> None:
        self.filters = {
            (id, link): (collider.group, collider.mask)
            for id, row in rows.items()
            for link, collider in file.bodies[row].colliders.items()
        }


def with_lost(body: ModelledBody, lost: Skipped) -> ModelledBody:
    """The body with lost shapes of a link added, in one entry with other skipped shapes of that link."""
    same = [each for each in body.skipped if each.name == lost.name]
    others = tuple(each for each in body.skipped if each.name != lost.name)
    reason = "; ".join([lost.reason, *(each.reason for each in same)])
    return replace(body, skipped=(*others, replace(lost, reason=reason)))


def _margin(client: int, id: int) -> float:
    """The margin of the outermost shape of a base in Bullet."""
    return float(pybullet.getDynamicsInfo(id, BASE, client)[11])
