"""The bodies of a simulation: their shapes, read once, and their poses, read at every step."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable
from dataclasses import replace
from difflib import get_close_matches
from functools import partial
from typing import Generic, Literal, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from overlapper import Overlaps, Placed, Shape, TimesOfImpact, _core, overlap, overlaps, times_of_impact
from overlapper.simulation.asked_pairs import Among, AskedPairs, Numbered, Who, listed
from overlapper.simulation.cautions import SkippedShapeWarning
from overlapper.simulation.collision_rules import Mask, Rules, partners
from overlapper.simulation.contacts import Contacts, Kind
from overlapper.simulation.first_overlaps import FirstOverlap, FirstOverlaps, Moment
from overlapper.simulation.ground import Grounds
from overlapper.simulation.layout import Layout, Pose
from overlapper.simulation.mechanics import Mechanics
from overlapper.simulation.model import BASE, Array, Color, Decomposed, LinkKey, ModelledBody, Skipped
from overlapper.simulation.naming import Labels, link_names
from overlapper.simulation.report import Report
from overlapper.simulation.source import Source

NOWHERE = "it has no finite pose within 1e25 m: the simulation has diverged"

_NO_PAIRS = np.empty((0, 2), np.int32)

Which = TypeVar("Which", bound="AnyBodies")
Named = TypeVar("Named", Skipped, Decomposed)


class AnyBodies(Generic[Kind]):
    """The bodies of a simulation as convex shapes placed in the world, for any simulator.

    A `Source` answers for the simulator. `Bodies` of a simulator inherits from this class and makes its source.
    """

    def __init__(self, source: Source) -> None:
        """Call this from the constructor of a subclass: warnings then name the line that calls that constructor."""
        self._source = source
        self._grounds = Grounds()
        self._labelling = Labels()
        self._nowhere: set[int] = set()  # bodies without a finite pose
        # The choice of pairs of the last overlaps(), or the number of pairs if it was a list; then the result.
        self._asked: Literal["simulated", "all"] | int = "simulated"
        self._found = overlaps([], np.empty((0, 3)), np.empty((0, 4)))
        self._last: tuple[Contacts[Kind], Layout, partial[Mask]] | None = None
        self._arrange()
        self._refresh(stacklevel=4)
        self._source.step_ended()
        self._now = Moment.of(self._layout, self._grounds.links)
        self._motion: tuple[Moment, Moment] | None = None  # between the last two updates
        # The beginning or the end of the next motion, if something but a step has moved bodies.
        self._begun: Moment | None = None
        self._ended: Moment | None = None
        # Pairs of shapes that overlap or touch at these two moments, as far as the last overlaps() there has found.
        self._met_before, self._met_now = _NO_PAIRS, _NO_PAIRS

    def update(self) -> None:
        """Read the shapes of new bodies and changed filters, then all poses. Call it once per step.

        A base that has not moved since the last update is asked whether it has become static (mass 0).
        """
        self._refresh(stacklevel=3)
        self._source.step_ended()
        now = Moment.of(self._layout, self._grounds.links)
        self._motion = self._begun or self._now, self._ended or now
        self._met_before = _NO_PAIRS if self._begun else self._met_now
        self._now, self._met_now, self._begun, self._ended = now, _NO_PAIRS, None, None

    def step_begins(self) -> None:
        """Leave out of `first_overlaps()` what was moved since the last update, as by a reset. Call it before a step.

        Without this call, everything between two updates is a motion.
        """
        if self._source.poses_lag:
            ended = self._source.end_of_step(self._now.layout)
            self._ended = replace(self._now, positions=ended[0], orientations=ended[1]) if ended else None
            return
        self._refresh(stacklevel=3)
        moment = Moment.of(self._layout, self._grounds.links)
        self._begun = None if moment.same_as(self._now) else moment

    def follow(self) -> None:
        """Read all poses of the bodies known at the last `update()`. Bodies that come or go are not noticed."""
        if self._pose() != self._nowhere:
            self._refresh(stacklevel=3)

    def overlaps(
        self,
        tolerance: float = 1e-3,
        method: Literal["auto", "paper"] = "auto",
        threads: int | None = 1,
        pairs: Among = "simulated",
    ) -> Contacts[Kind]:
        """Pairs of shapes that overlap or touch.

        A result is reused in the next call if the poses of both shapes are bit-identical.

        Parameters
        ----------
        tolerance : float, default 0.001
            Allowed relative error of the volume for curved shapes, between 0 and 1.
        method : {'auto', 'paper'}, default 'auto'
            Method of computation, as in `overlapper.overlap`.
        threads : int or None, default 1
            Number of threads. None: one on each core.
        pairs : {'simulated', 'all'} or list of pairs, default 'simulated'
            The pairs to measure, as in `pairs`.

        Returns
        -------
        Contacts
            Sorted by (bodyA, linkA, shapeA, bodyB, linkB, shapeB).

        Raises
        ------
        ValueError
            If `pairs` names a body or a link that is not in the simulation.
        """
        among: Numbered = pairs if isinstance(pairs, str) else self._asked_for(pairs)
        if among == "simulated":
            for caution in self._source.cautions(self._layout):
                warnings.warn(caution, stacklevel=2)
        layout = self._layout
        self._asked = among if isinstance(among, str) else self._pairs.possible(among, self._rules)
        mask = self._pairs.mask(self._rules) if among == "simulated" else None
        if mask:
            self._found = _core.masked_overlaps(
                layout.batch, layout.positions, layout.orientations, mask, tolerance, threads, method
            )
        else:
            self._found = layout.batch.overlaps(
                layout.positions, layout.orientations, self.pairs(among), tolerance, threads, method, separated=False
            )
        if layout.positions is self._now.positions:
            self._met_now = self._found.pairs
        kind = cast("type[Kind]", self._source.contact)
        contacts = Contacts(layout.key_rows, self._found, self._names, kind)
        self._last = contacts, layout, partial(self._pairs.chosen, among=among, rules=self._rules)
        return contacts

    def first_overlaps(
        self, pairs: Among = "simulated", threads: int | None = 1, tolerance: float = 1e-9
    ) -> FirstOverlaps:
        """Pairs of shapes that met, or passed through each other, between the poses of the last two updates.

        This is continuous collision detection: it finds a bullet that is in front of a sheet at one update and behind
        the sheet at the next. Between the two poses, the position of each shape moves along a line at a constant
        velocity, and the shape turns at a constant rate the shorter way. Call `update()` once per step: the motion of
        several steps is not along lines. A reset of a pose between two updates counts as a motion, unless
        `step_begins()` is called between the reset and the step.

        Pairs that overlap or touch at the first of the two poses are left out, as `overlaps()` there has them. Bodies
        that came between the two updates are left out, too. Prisms of height fields are those near shapes at the end.

        Parameters
        ----------
        pairs : {'simulated', 'all'} or list of pairs, default 'simulated'
            The pairs to examine, as in `pairs`.
        threads : int or None, default 1
            Number of threads. None: one on each core.
        tolerance : float, default 1e-9
            Wanted width of the interval of times, as a fraction of the motion.

        Returns
        -------
        FirstOverlaps
            Sorted by (bodyA, linkA, shapeA, bodyB, linkB, shapeB). `tunnelled` are those that are separated again at
            the end.

        Raises
        ------
        ValueError
            If `update()` was not called yet, or `pairs` names a body or a link that is not in the simulation.
        """
        if self._motion is None:
            raise ValueError("first_overlaps() needs the poses of two updates: call update() after a step first")
        asked: Numbered = pairs if isinstance(pairs, str) else self._asked_for(pairs)
        before, now = self._motion
        layout = now.layout
        start, turned, known = now.begun(before)
        end = now.positions, now.orientations
        moves = (start != end[0]).any(axis=1) | (turned != end[1]).any(axis=1)
        examined = _core.swept_pairs(layout.batch, start, turned, *end)
        first, second = examined.T
        examined = examined[known[first] & known[second] & (moves[first] | moves[second])]
        examined = examined[self._pairs.chosen(examined, asked, self._rules)]
        if before.layout is layout:
            examined = examined[~np.isin(_codes(examined), _codes(self._met_before))]
        found = times_of_impact(layout.batch, start, turned, *end, examined, tolerance=tolerance, threads=threads)
        met: list[FirstOverlap] = []
        for row in np.flatnonzero(found.status != TimesOfImpact.STATUSES.index("separated")).tolist():
            (a, b), impact = examined[row].tolist(), found[row]
            status, time, point, normal = impact.status, impact.time, impact.point, impact.normal
            if status == "separated" or status == "overlapping" or impact.time_upper == 0:
                continue
            assert time is not None and point is not None and normal is not None
            both = (Placed(layout.shapes[i], end[0][i], end[1][i]) for i in (a, b))
            apart = overlap(*both).status == "separated"
            (bodyA, linkA, shapeA), (bodyB, linkB, shapeB) = layout.keys[a], layout.keys[b]
            met.append(FirstOverlap(bodyA, linkA, shapeA, bodyB, linkB, shapeB, status, time, point, normal, apart))
        return FirstOverlaps(met, self._names)

    def pairs(self, among: Among = "simulated") -> NDArray[np.int32]:
        """Pairs of shapes whose bounding boxes meet.

        Parameters
        ----------
        among : {'simulated', 'all'} or list of pairs, default 'simulated'
            'simulated': the pairs that the simulator lets collide. 'all': all pairs of different bodies. A list has
            pairs of bodies, links (body, link) or shapes (body, link, shape), as in [(robot, table), ((robot, 8),
            (robot, 3))]. It may pair two links of one body, and it ignores collision filters. Bodies and links may be
            given by their `names`: [("table", "panda/panda_hand")]. A single pair of bodies or names needs no list
            around it. A body paired with itself means all pairs of its links.

        Returns
        -------
        (n, 2) ndarray of int32
            Indices into `keys`. Each pair occurs once, with the lesser index first. The rows are sorted.

        Raises
        ------
        ValueError
            If `among` names a body or a link that is not in the simulation.
        """
        return self.pairs_at(self.positions, self.orientations, among)

    def pairs_at(self, positions: Array, orientations: Array, among: Among = "simulated") -> NDArray[np.int32]:
        """Pairs of shapes whose bounding boxes meet at given poses.

        Parameters
        ----------
        positions : (k, 3) ndarray
            Positions of the shapes in the world, m; parallel to `keys`.
        orientations : (k, 4) ndarray
            Quaternions x, y, z, w of the shapes; parallel to `keys`.
        among : {'simulated', 'all'} or list of pairs, default 'simulated'
            The choice of pairs, as in `pairs`.

        Returns
        -------
        (n, 2) ndarray of int32
            Indices into `keys`, as from `pairs`.
        """
        asked: Numbered = among if isinstance(among, str) else self._asked_for(among)
        pairs: NDArray[np.int32] = self._layout.batch.candidate_pairs(positions, orientations)
        return np.asarray(pairs[self._pairs.chosen(pairs, asked, self._rules)])

    def partners(self) -> dict[tuple[int, int], list[tuple[int, int]]]:
        """The links that the simulator lets each link collide with.

        Returns
        -------
        dict
            For each link with shapes, by (body, link): a list of such links.
        """
        return partners(self._rules, [*self._layout.collider_rows], np.unique(self._layout.colliders))

    def report(self) -> Report:
        """How much of the scene was read, and how much of it the last `overlaps()` examined.

        It asks pybullet for its contact points, which takes about 3 µs for each point.

        Returns
        -------
        Report
            Numbers of bodies, shapes and pairs.
        """
        found, asked, bodies = self._found, self._asked, self._source.bodies
        return Report(
            bodies=len(bodies),
            shapes=sum(body.shape_count for body in bodies.values()) + self._source.unidentified,
            shapes_read=len(self._layout.keys),
            pairs_possible=asked if isinstance(asked, int) else self._pairs.possible(asked, self._rules),
            pairs_examined=found.examined,
            pairs_overlapping=int((found.status == Overlaps.OVERLAPPING).sum()),
            pairs_widened=int(found.widened.sum()),
            facets_touched=int(found.facets_touched.sum()),
            planes_asked=found.planes_asked,
            pairs_within_margins=self._source.within_margins(*self._last) if self._last else 0,
        )

    def link_pairs(self, among: Among = "simulated") -> list[tuple[LinkKey, LinkKey]]:
        """The pairs of links that a choice of pairs has, at any poses.

        Parameters
        ----------
        among : {'simulated', 'all'} or list of pairs, default 'simulated'
            The choice of pairs, as in `pairs`.

        Returns
        -------
        list of ((body, link), (body, link))
            The pairs, sorted.
        """
        asked: Numbered = among if isinstance(among, str) else self._asked_for(among)
        links = [*self._layout.collider_rows]
        return [(links[a], links[b]) for a, b in self._pairs.colliders(asked, self._rules).tolist()]

    def mechanics(self) -> Mechanics:
        """The interface that applies forces to the bodies.

        Returns
        -------
        Mechanics
            The interface of the simulator.

        Raises
        ------
        ValueError
            If the simulator accepts no forces.
        """
        return self._source.mechanics()

    def close(self) -> None:
        """Restore the simulation to its earlier state. The bodies read so far stay, but cannot be updated any more."""
        self._source.close()

    def __repr__(self) -> str:
        of = f"{len(self._source.bodies)} bodies, {len(self._layout.keys)} shapes"
        return f"Bodies({of}{f', {len(self.skipped)} left out' if self.skipped else ''})"

    def __enter__(self: Which) -> Which:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def keys(self) -> list[tuple[int, int, int]]:
        """(body, link, shape) of every modelled shape, sorted; link -1 is the base."""
        return self._layout.keys

    @property
    def shapes(self) -> list[Shape]:
        """The modelled shapes, parallel to `keys`; the same objects from step to step."""
        return self._layout.shapes

    @property
    def positions(self) -> Array:
        """(k, 3) positions of the shapes (not of their links) at the last update, m; parallel to `keys`."""
        return self._layout.positions

    @property
    def orientations(self) -> Array:
        """(k, 4) unit quaternions xyzw of the shapes (not of their links) at the last update; parallel to `keys`."""
        return self._layout.orientations

    @property
    def placed(self) -> list[Placed]:
        """The shapes where they were at the last update, parallel to `keys`."""
        return [Placed(*each) for each in zip(self.shapes, self.positions, self.orientations)]

    @property
    def colors(self) -> dict[tuple[int, int], Color]:
        """Red, green, blue and alpha in 0..1 by (body, link): of the visual shape when the body was read.

        A link without a visual shape has the colour of its body. A body without visual shapes gets its own colour.
        """
        return {(id, link): color for id, body in self._source.bodies.items() for link, color in body.colors.items()}

    @property
    def names(self) -> dict[tuple[int, int], str]:
        """Names like "panda/panda_hand" by (body, link); a body of one link has the name of the body, as in `labels`.

        Tables and views have these names.
        """
        return dict(self._names)

    @property
    def labels(self) -> dict[int, str]:
        """Names like "panda" by body. A body keeps its name when other bodies come or go.

        Bodies named after the same kind of shape are told apart by colour or size, such as "red box" or "box 0.1 m".
        Names that are still not unique end in "#" and the id.
        """
        return dict(self._labels)

    @property
    def decomposed(self) -> list[Decomposed]:
        """The concave meshes that are modelled as unions of convex parts."""
        return [self._labelled(each) for body in self._source.bodies.values() for each in body.decomposed]

    @property
    def settings(self) -> dict[str, str | float]:
        """The given values of `concave`, `concave_threshold` and `surface`."""
        return dict(self._source.settings)

    @property
    def engine(self) -> str:
        """The name of the engine that simulates the bodies, as in ENGINE of a scene."""
        return self._source.engine

    @property
    def skipped(self) -> list[Skipped]:
        """The shapes that are not modelled, one entry per body and link."""
        skipped = [self._labelled(each) for body in self._source.bodies.values() for each in body.skipped]
        return [*skipped, *self._source.skipped, *(self._lost(id) for id in sorted(self._nowhere))]

    @property
    def tops(self) -> Array | None:
        """(k, 3) normals of the only faces that others can press, in the frames of the shapes; 0 without such a face.

        Prisms of height fields have such a face, except at the border. None if no shape has one.
        """
        return self._layout.tops

    @property
    def frames(self) -> Callable[[LinkKey], Pose]:
        """A function of (body, link) that returns the frame of the link at the last update, also after later ones.

        A frame begins with a position in m and a quaternion xyzw. Links without modelled shapes have none.
        """
        return self._layout.frames()

    @property
    def rules(self) -> Rules:
        """Which links the simulator lets collide. The object is replaced when the rules may have changed."""
        return self._rules

    @property
    def time_step(self) -> float:
        """The time step of the simulator, s."""
        return self._source.time_step

    def _refresh(self, stacklevel: int) -> None:
        skipped = self._source.refresh()
        if skipped is not None:
            self._arrange()
        before, self._nowhere = self._nowhere, self._pose()
        if self._nowhere != before:
            self._arrange()
            self._pose()
        self._rules = self._source.rules(self._layout)
        if changed := self._grounds.changed(self._layout, self._rules, self._source.bodies):
            self._source.bodies.update(changed)
            self._arrange()
            self._pose()
            self._rules = self._source.rules(self._layout)
        if not skipped and not self._nowhere:
            return
        for each in (*map(self._labelled, skipped or ()), *(self._lost(id) for id in sorted(self._nowhere - before))):
            message = f"{each.name} (body {each.body}, link {each.link}) is left out: {each.reason}"
            warnings.warn(message, SkippedShapeWarning, stacklevel=stacklevel)

    def _asked_for(self, pairs: Iterable[tuple[Who | str, Who | str]]) -> list[tuple[Who, Who]]:
        """The pairs of a list, with names replaced by numbers."""
        return [(self._who(a), self._who(b)) for a, b in listed(pairs)]

    def _who(self, named: Who | str) -> Who:
        if not isinstance(named, str):
            return named
        known: dict[str, Who] = {name: link for link, name in self._names.items()}
        known |= {label: id for id, label in self._labels.items()}
        if named not in known:
            alike = get_close_matches(named, known, 1)
            hint = f"; {alike[0]!r} is" if alike else ""
            raise ValueError(f"pairs names {named!r}, which is not a body or link in the simulation{hint}")
        return known[named]

    def _labelled(self, named: Named) -> Named:
        """The same with the label of its body instead of the body's name."""
        body = self._source.bodies.get(named.body)
        return replace(named, name=self._labels[named.body] + named.name[len(body.name) :]) if body else named

    def _lost(self, id: int) -> Skipped:
        return Skipped(id, BASE, self._labels[id], NOWHERE, diverged=True)

    def _arrange(self) -> None:
        bodies = self._source.bodies
        self._nowhere &= bodies.keys()
        placed: dict[int, ModelledBody] = {}
        left_out: dict[int, ModelledBody] = {}
        for id, body in bodies.items():
            (left_out if id in self._nowhere else placed)[id] = body
        self._layout = Layout(placed, self._source.poses)
        self._left_out = Layout(left_out, self._source.poses)
        self._labels = self._labelling.of(bodies)
        self._names = link_names(bodies, self._labels)
        self._pairs = AskedPairs(self._layout, {id: body.link_names.keys() for id, body in bodies.items()})
        self._grounds.follow(self._layout, placed)

    def _pose(self) -> set[int]:
        """Place all bodies. Returns the bodies without a usable pose."""
        nowhere = self._layout.pose()
        return nowhere | self._left_out.pose() if self._nowhere else nowhere


def _codes(pairs: NDArray[np.int32]) -> NDArray[np.int64]:
    """A number for each pair."""
    return np.asarray(pairs[:, 0] * np.int64(2**32) + pairs[:, 1])
