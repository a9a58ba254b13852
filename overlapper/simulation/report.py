"""How little of a scene had to be modelled."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Report:
    """How little of a scene had to be modelled.

    `shapes` counts those of the scene, `shapes_read` those modelled. The rest is of the last `overlaps()`:
    `pairs_possible` are the pairs of modelled shapes it was asked about, by default those that the simulator lets
    collide, then follow pairs whose boxes meet, pairs that overlap, those of them that were measured again in wider
    arithmetic (see `Overlap.widened`), facets that took part, and planes asked for (see `Overlaps.planes_asked`).
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

    def __str__(self) -> str:
        widened = f"{self.pairs_widened:,} of them" if self.pairs_widened else "none of them"
        return (
            f"{self.bodies:,} bodies, {self.shapes_read:,} of {self.shapes:,} shapes read\n"
            f"{self.pairs_examined:,} of {self.pairs_possible:,} pairs examined, "
            f"{self.planes_asked:,} planes asked, {self.facets_touched:,} facets touched\n"
            f"{self.pairs_overlapping:,} overlap, {widened} measured again in wider arithmetic"
        )
