"""How much of a scene was modelled and measured."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Report:
    """How much of a scene was modelled and measured.

    `bodies` and `shapes` are the numbers in the scene, and `shapes_read` is the number of modelled shapes. The other
    numbers are those of the last `overlaps()`. `pairs_possible` counts the chosen pairs of modelled shapes, by default
    those that the simulator lets collide. `pairs_examined` counts the pairs whose boxes meet, and `pairs_overlapping`
    the pairs that overlap. `pairs_widened` were measured again in wider arithmetic (see `Overlap.widened`).
    `facets_touched` took part, and `planes_asked` were asked for (see `Overlaps.planes_asked`).

    `pairs_within_margins` counts the chosen pairs of links that have contact points in pybullet but no overlap. The
    margins that Bullet lays around hulls keep these links apart. With surface="margin" the number is 0: the margins are
    part of the shapes, so such pairs overlap.
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
