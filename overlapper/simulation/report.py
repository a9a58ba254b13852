"""How little of a scene had to be modelled."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Report:
    """How little of a scene had to be modelled.

    `bodies` and `shapes` count those of the scene, `shapes_read` those modelled. The rest is of the last `overlaps()`.
    `pairs_possible` are the pairs of modelled shapes that it was asked about, by default those that the simulator lets
    collide. `pairs_examined` are those whose boxes meet, and `pairs_overlapping` those that overlap. `pairs_widened`
    were measured again in wider arithmetic (see `Overlap.widened`). `facets_touched` took part, and `planes_asked` were
    asked for (see `Overlaps.planes_asked`).

    `pairs_within_margins` are the pairs of links asked about that have contact points in pybullet and no overlap. The
    margins that Bullet lays around hulls hold them apart. With surface="margin" there are none: the margins are then
    part of the shapes, and such pairs overlap.
    """

    bodies: int
    shapes: int
    shapes_read: int
    pairs_possible: int
    pairs_examined: int
    pairs_overlapping: int
    pairs_widened: int
    facets_touched: int
    planes_asked: int
    pairs_within_margins: int = 0

    def __str__(self) -> str:
        widened = f"{self.pairs_widened:,} of them" if self.pairs_widened else "none of them"
        lines = (
            f"{self.bodies:,} bodies, {self.shapes_read:,} of {self.shapes:,} shapes read\n"
            f"{self.pairs_examined:,} of {self.pairs_possible:,} pairs examined, "
            f"{self.planes_asked:,} planes asked, {self.facets_touched:,} facets touched\n"
            f"{self.pairs_overlapping:,} overlap, {widened} measured again in wider arithmetic"
        )
        if self.pairs_within_margins:
            lines += (
                f"\n{self.pairs_within_margins:,} more pairs of links touch only within the margins that Bullet lays "
                "around hulls; surface 'margin' shows them"
            )
        return lines
