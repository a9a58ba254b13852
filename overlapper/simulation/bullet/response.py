"""The simulator's own response to contacts between some links, turned off and on again."""

from __future__ import annotations

from collections.abc import Iterable

from overlapper.simulation.bullet.calls import unheard
from overlapper.simulation.bullet.recorder import Link, Recorder


class Response:
    """Which pairs of links of a client Bullet pushes apart no more.

    A pair filter takes a pair from Bullet's collision detection, so that it costs nothing there and has no contact
    points. No recorder hears of it: to `Bodies` the pair is as before.
    """

    def __init__(self, client: int) -> None:
        self._client = client
        self._off: set[tuple[Link, Link]] = set()

    def turn_off(self, pairs: Iterable[tuple[Link, Link]]) -> None:
        """Of those pairs, too."""
        for pair in pairs:
            self._set(pair, 0)
            self._off.add(pair)

    def turn_on(self, recorder: Recorder | None) -> None:
        """Of all pairs of which it is off, but for those that a script has filtered itself, as a recorder has heard."""
        filters = recorder.pair_filters if recorder else {}
        for pair in sorted(self._off):
            if filters.get(pair, True):
                self._set(pair, 1)
        self._off.clear()

    def _set(self, pair: tuple[Link, Link], enabled: int) -> None:
        (a, link_a), (b, link_b) = pair
        unheard("setCollisionFilterPair")(a, b, link_a, link_b, enabled, self._client)
