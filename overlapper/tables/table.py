"""A run as a table: one row for each step and each pair of shapes or links that overlaps or touches."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from overlapper.columns import FORCE_COLUMNS, IMPACT_COLUMNS, MEASURE_COLUMNS, measures_of

if TYPE_CHECKING:
    from overlapper.reference import Comparison
    from overlapper.simulation.contacts import Contact
    from overlapper.simulation.first_overlaps import FirstOverlap, FirstOverlaps
    from overlapper.simulation.forces.forces import Forces
    from overlapper.simulation.links import LinkContact

Value = int | float | str | None
Row = dict[str, Value]
Key = tuple[int, int, int]  # (body, link, shape)

POSE = [f"position{{}}_{axis}_m" for axis in "xyz"] + [f"orientation{{}}_{part}" for part in "xyzw"]
# Every column of a run, in order, with its type; the unit is in the name. `link` is -1 for the base, `shape` counts the
# shapes of that link, the poses are those of the two shapes in the world, `normal` points from B to A. The columns of
# the centroid are empty for a pair that only touches.
COLUMNS: dict[str, type] = {
    "step": int,
    "time_s": float,
    **{
        f"{word}{side}": kind
        for side in "AB"
        for word, kind in (("body", int), ("link", int), ("shape", int), ("name", str))
    },
    **{part.format(side): float for side in "AB" for part in POSE},
    "status": str,
    **dict.fromkeys(MEASURE_COLUMNS, float),
    "fcl": str,
    "fcl_explanation": str,
}

# The further columns of a run that is compared with MuJoCo.
MUJOCO: dict[str, type] = {"mujoco": str, "mujoco_explanation": str}

# The further columns of a run with volumetric contact. They are empty for a pair that it does not push apart.
FORCES: dict[str, type] = dict.fromkeys(FORCE_COLUMNS, float)

# The further columns of a run with first overlaps. They are empty for a pair that has met in an earlier step.
IMPACTS: dict[str, type] = dict.fromkeys(IMPACT_COLUMNS, float)

# The status of a row whose shapes met within the step, but are separated at both ends of the step.
TUNNELLED = "tunnelled"


class PosedBodies(Protocol):
    """The bodies of a table.

    They have shapes by (body, link, shape), their poses in the order of the shapes, and names of links.
    """

    @property
    def keys(self) -> list[tuple[int, int, int]]: ...
    @property
    def positions(self) -> NDArray[np.float64]: ...
    @property
    def orientations(self) -> NDArray[np.float64]: ...
    @property
    def names(self) -> dict[tuple[int, int], str]: ...


def key(row: Row) -> tuple[Value, ...]:
    """Return (bodyA, linkA, shapeA, bodyB, linkB, shapeB), with None for a missing B."""
    return tuple(row.get(f"{word}{side}") for side in "AB" for word in ("body", "link", "shape"))


def poses(rows: Sequence[Row]) -> dict[tuple[int, Key], NDArray[np.float64]]:
    """Return position and orientation (7,) of every shape, by step and (body, link, shape)."""
    where = {}
    for row in rows:
        for side in "A" if row["status"] == "alone" else "AB":
            body, link, shape = (int(row[f"{word}{side}"] or 0) for word in ("body", "link", "shape"))
            where[int(row["step"] or 0), (body, link, shape)] = np.array(
                [row[part.format(side)] for part in POSE], dtype=float
            )
    return where


def placements(bodies: PosedBodies, side: str) -> dict[tuple[int, int, int], Row]:
    """Return the columns of side "A" or "B" for every shape, by (body, link, shape).

    They say which shape it is, and where it is.
    """
    names = bodies.names
    poses = np.hstack([bodies.positions, bodies.orientations]).tolist()
    return {
        (body, link, shape): {
            f"body{side}": body,
            f"link{side}": link,
            f"shape{side}": shape,
            f"name{side}": names[body, link],
            **{part.format(side): value for part, value in zip(POSE, pose)},
        }
        for (body, link, shape), pose in zip(bodies.keys, poses)
    }


def rows(
    step: int,
    time: float,
    bodies: PosedBodies,
    contacts: Sequence[Contact],
    opinions: Sequence[Comparison] = (),
    forces: Forces | None = None,
    first: FirstOverlaps | None = None,
) -> list[Row]:
    """Return the rows of one step.

    `opinions` are those of FCL or MuJoCo on the same contacts, if it was asked. `forces` are the forces between them.
    `first` are the first overlaps since the step before. Pairs that have tunnelled have rows behind the others.
    """
    pushed = _pushed(forces)
    met = {each.key: each for each in first or ()}
    a, b = placements(bodies, "A"), placements(bodies, "B")
    table: list[Row] = []
    for k, contact in enumerate(contacts):
        table.append(
            {
                "step": step,
                "time_s": float(time),
                **a[contact.bodyA, contact.linkA, contact.shapeA],
                **b[contact.bodyB, contact.linkB, contact.shapeB],
                "status": contact.overlap.status,
                **measures_of(contact.overlap),
                "fcl": None,
                "fcl_explanation": None,
                **(_opinion(opinions[k]) if opinions else {}),
                **pushed.get(_key(contact), {}),
                **_impact(met.get(_key(contact))),
            }
        )
    for each in first.tunnelled if first else ():
        where = {**a[each.key[:3]], **b[each.key[3:]]}
        table.append({"step": step, "time_s": float(time), **where, **_through(each)})
    return table


def _impact(first: FirstOverlap | None) -> Row:
    """Return the columns of IMPACTS."""
    return dict(zip(IMPACTS, [first.fraction, *map(float, first.point)])) if first else {}


def _through(first: FirstOverlap) -> Row:
    """Return the status and the measures of a pair that has tunnelled. It shares nothing at the step's own poses."""
    measures: Row = {name: None if name.startswith("centroid") else 0.0 for name in MEASURE_COLUMNS}
    normal = {f"normal_{axis}": float(part) + 0.0 for axis, part in zip("xyz", first.normal)}
    return {"status": TUNNELLED, **measures, **normal, **_impact(first)}


def _opinion(opinion: Comparison) -> Row:
    return {opinion.by: opinion.verdict, f"{opinion.by}_explanation": opinion.explanation}


def _key(contact: Contact) -> tuple[int, int, int, int, int, int]:
    return contact.bodyA, contact.linkA, contact.shapeA, contact.bodyB, contact.linkB, contact.shapeB


def _pushed(forces: Forces | None) -> dict[tuple[int, ...], Row]:
    """Return the columns of FORCES by pair of shapes."""
    if forces is None:
        return {}
    keys = map(tuple, forces.pairs.tolist())
    return {pair: dict(zip(FORCES, values)) for pair, values in zip(keys, forces.measures.tolist())}


def link_rows(
    step: int,
    time: float,
    bodies: PosedBodies,
    pairs: Sequence[LinkContact],
    forces: Forces | None = None,
    first: FirstOverlaps | None = None,
) -> list[Row]:
    """Return the rows of one step for links as a whole.

    The columns of single shapes, their poses, area, slip, FCL and MuJoCo, are empty. Forces and energies are sums over
    the pairs of their shapes. Torques are sums about the centroid of the links. The first overlap of two links is the
    earliest one of their shapes.
    """
    names = bodies.names
    met: dict[tuple[int, int, int, int], FirstOverlap] = {}
    for each in sorted(first or (), key=lambda each: each.fraction):
        met.setdefault((each.bodyA, each.linkA, each.bodyB, each.linkB), each)
    at = {} if forces is None else {pair: k for k, pair in enumerate(map(tuple, forces.pairs.tolist()))}
    table: list[Row] = []

    def add(pair: LinkContact | FirstOverlap, values: Row) -> None:
        who: Row = {
            "bodyA": pair.bodyA,
            "linkA": pair.linkA,
            "nameA": names[pair.bodyA, pair.linkA],
            "bodyB": pair.bodyB,
            "linkB": pair.linkB,
            "nameB": names[pair.bodyB, pair.linkB],
        }
        table.append({"step": step, "time_s": float(time), **who, **values})

    for pair in pairs:
        pushed = _sum_of(pair, forces, [at[_key(each)] for each in pair.contacts if _key(each) in at])
        impact = _impact(met.pop((pair.bodyA, pair.linkA, pair.bodyB, pair.linkB), None))
        add(pair, {"status": pair.status, **measures_of(pair), **pushed, **impact})
    for _, through in sorted(met.items()):
        if through.tunnelled:
            add(through, _through(through))
    return table


def _sum_of(pair: LinkContact, forces: Forces | None, which: Sequence[int]) -> Row:
    """Return the columns of FORCES of two links, summed over these rows of `forces`."""
    if forces is None or pair.centroid is None or not which:
        return {}
    arms = np.nan_to_num(forces.centre[which]) - pair.centroid
    torque = forces.torque[which] + np.cross(arms, forces.force[which])
    sums = [*forces.force[which].sum(axis=0), *torque.sum(axis=0), forces.energy[which].sum()]
    return {name: float(each) for name, each in zip(FORCES, sums)}
