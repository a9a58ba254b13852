"""How much of a scene was modelled and measured."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Report:
    """How much of a scene was modelled and measured. Numbers of pairs are those of the last `overlaps()`.

    Parameters
    ----------
    bodies : int
        Number of bodies in the scene.
    shapes : int
        Number of shapes in the scene.
    shapes_read : int
        Number of modelled shapes.
    pairs_possible : int
        Number of chosen pairs of modelled shapes, by default those that the simulator lets collide.
    pairs_examined : int
        Number of these pairs whose bounding boxes meet.
    pairs_overlapping : int
        Number of pairs that overlap.
    pairs_widened : int
        Number of pairs that were measured again in double-double arithmetic (see `Overlap.widened`).
    facets_touched : int
        Number of planes that took part in the measures.
    planes_asked : int
        Number of planes that were computed (see `Overlaps.planes_asked`).
    pairs_within_margins : int, default 0
        Number of chosen pairs of links that have contact points in pybullet but no overlap. The margins of Bullet keep
        these links apart. With surface="margin" it is 0: the margins are part of the shapes, so such pairs overlap.
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
                f"\n{self.pairs_within_margins:,} more pairs of links touch only with the collision margins of Bullet; "
                "surface='margin' measures them"
            )
        return lines
