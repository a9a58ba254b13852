"""Scenes run, written down, and compared with what was written down before.

Three things may move, and are told apart. The geometry is ours: the shapes and poses recorded, measured again. The
shapes are the models', as they are read today. The dynamics are the simulator's: where it puts the shapes today.
"""

from __future__ import annotations

import math
from collections.abc import Container, Generator, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from overlapper import Batch, Hull, Placed, Shape
from overlapper.polytopes.shape_text import alike, shape_of, text_of
from overlapper.scenes.comparison import (
    Differences,
    Move,
    compare_measures,
    compare_poses,
    loose_budgets,
    poses,
    shape_label,
)
from overlapper.scenes.expected import DRIFT, MEASURES, ROUNDING, Budget, Expected, Key, read_expected
from overlapper.scenes.scene import Scene, SceneError, Step, broken, load_scene
from overlapper.scenes.table import Row, key, placements, rows
from overlapper.scenes.table_file import origin
from overlapper.simulation import Among, Bodies, Concave, Recorder, Surface
from overlapper.simulation.contacts import Contacts

try:
    import pybullet
except ImportError as error:
    raise ImportError("overlapper.scenes.verdict needs pybullet: pip install 'overlapper[sim]'") from error

__all__ = ["Frame", "Scene", "SceneError", "Still", "Verdict", "examine", "load_scene", "record", "replay", "run"]


@dataclass(frozen=True, slots=True)
class Frame:
    """The state after `step` steps, `time` seconds into the simulation; `bodies` is the same object in every frame."""

    step: int
    time: float
    bodies: Bodies
    contacts: Contacts


def run(
    scene: Scene,
    steps: int | None = None,
    tolerance: float = 1e-3,
    method: Literal["auto", "paper"] = "auto",
    only: Container[int] | None = None,
    concave: Concave = "decompose",
    concave_threshold: float = 0.05,
    surface: Surface = "nominal",
    pairs: Among | None = None,
) -> Generator[Frame, None, None]:
    """Build the scene in a client of its own and step it, `scene.steps` times by default.

    Every step is a frame, the first has number 1; or only those in `only`, if given. `tolerance` and `method` are those
    of `overlapper.overlap`, `concave`, `concave_threshold` and `surface` of `Bodies`, `pairs` of `Bodies.overlaps`, by
    default as the scene says; a recorder hears all that it tells pybullet. SceneError if the scene itself fails.
    """
    client = pybullet.connect(pybullet.DIRECT)
    recorder = Recorder(client)
    among = scene.pairs if pairs is None else pairs
    try:
        step = _built(scene, client)
        bodies = Bodies(
            client, concave=concave, concave_threshold=concave_threshold, surface=surface, recorder=recorder
        )
        seconds = pybullet.getPhysicsEngineParameters(client)["fixedTimeStep"]
        for i in range(steps or scene.steps):
            _controlled(scene, step, i)
            pybullet.stepSimulation(client)
            if only is None or i + 1 in only:
                bodies.update()
                yield Frame(i + 1, (i + 1) * seconds, bodies, bodies.overlaps(tolerance, method, pairs=among))
    finally:
        recorder.close()
        pybullet.disconnect(client)


def _built(scene: Scene, client: int) -> Step | None:
    try:
        step = scene.build(client)
    except Exception as error:
        raise broken(scene.path, "cannot be built", error) from error
    if step is not None and not callable(step):
        raise SceneError(f"build(client) of {scene.path} must return None or a function step(i), not {step!r}")
    return step


def _controlled(scene: Scene, step: Step | None, i: int) -> None:
    if step is None:
        return
    try:
        step(i)
    except Exception as error:
        raise broken(scene.path, f"fails before step {i + 1}", error) from error


# What is told of the overlaps when bodies are elsewhere, or are others: changes of a hundredth.
HUNDREDTHS = {"volume": Budget(0.01, 0.0), "depth": Budget(0.01, 0.0)}

# Where a scene is put to see what rounding alone does to its measures, in m.
ASIDES = ((0.3, 0.7, 0.1), (-0.2, 0.4, 0.9), (0.6, -0.5, -0.3))


def record(scene: Scene) -> None:
    """Run the scene and write its expected file anew.

    The steps, the tolerance and the budgets of an old file stay in force. A new file has four steps and budgets of five
    times what rounding does to its measures when all is moved by less than a metre.
    """
    try:
        old = read_expected(scene.expected)
        made = _observed(scene, old)
    except FileNotFoundError:
        steps = sorted({max(scene.steps * quarter // 4, 1) for quarter in (1, 2, 3, 4)})
        made = _observed(scene, Expected(steps, 1e-3, ROUNDING | DRIFT))
        made.budgets.update(_needed(made))
    made.write(scene.expected, origin())


def _observed(scene: Scene, wanted: Expected) -> Expected:
    """What the scene is today, in the steps wanted."""
    stills = _stills(scene, wanted.steps)
    table = [row for step, still in stills.items() for row in still.rows(step, wanted.tolerance)]
    shapes = {step: dict(zip(still.keys, still.shapes)) for step, still in stills.items()}
    return Expected(wanted.steps, wanted.tolerance, dict(wanted.budgets), table, shapes)


def _needed(made: Expected) -> dict[str, Budget]:
    """Budgets of five times what rounding needs, to one digit; where it needs nothing, those made."""
    return {
        name: Budget(*(float(f"{5 * part * each:.0e}") for each in (budget.relative, budget.absolute)))
        for name, part in _rounding(made).items()
        for budget in [made.budgets[name]]
        if part
    }


def _rounding(expected: Expected) -> dict[str, float]:
    """The largest part of each budget of a measure that rounding takes when all is moved by less than a metre."""
    spent = [compare_measures(expected.rows, replay(expected, aside), expected.budgets).spent for aside in ASIDES]
    return {name: max(each[name] for each in spent) for name in spent[0]}


def replay(expected: Expected, moved_by: Sequence[float] = (0.0, 0.0, 0.0)) -> list[Row]:
    """The rows that today's geometry makes of the shapes and poses of an expected file, without a simulator.

    With `moved_by`, in m, all is moved before it is measured, and the rows are moved back: what differs is rounding.
    """
    table: list[Row] = []
    for step, recorded in expected.rows_by_step():
        table += Still.recorded(recorded, expected.shapes[step]).moved(moved_by).rows(step, expected.tolerance)
    for row in table:
        for column, distance in zip(MEASURES["centroid"], moved_by):
            if row.get(column) is not None:
                row[column] = float(row[column] or 0.0) - distance
    return table


@dataclass(frozen=True, slots=True)
class Still:
    """The shapes of a scene in one step, apart from the simulator; the fields are those of `simulation.Bodies`."""

    keys: list[Key]
    shapes: list[Shape]
    positions: NDArray[np.float64]
    orientations: NDArray[np.float64]
    names: dict[tuple[int, int], str]
    colors: dict[tuple[int, int], tuple[float, float, float, float]]

    @classmethod
    def of(cls, bodies: Bodies) -> Still:
        """The bodies as they are now, with the shapes as they will be read from a file."""
        shapes = {id(shape): shape_of(text_of(shape)) for shape in bodies.shapes}
        return cls(
            list(bodies.keys),
            [shapes[id(shape)] for shape in bodies.shapes],
            bodies.positions.copy(),
            bodies.orientations.copy(),
            bodies.names,
            bodies.colors,
        )

    @classmethod
    def recorded(cls, recorded: Sequence[Row], shapes: dict[Key, Shape]) -> Still:
        """The shapes of a step of an expected file where its rows say; names are numbers and all is grey."""
        where = {each: pose for (_, each), pose in poses(recorded).items()}
        keys = sorted(where)
        ordered = np.array([where[each] for each in keys]).reshape(-1, 7)
        links = {each[:2] for each in keys}
        return cls(
            keys,
            [shapes[each] for each in keys],
            ordered[:, :3],
            ordered[:, 3:],
            {(body, link): f"body {body}/link {link}" for body, link in links},
            dict.fromkeys(links, (0.6, 0.6, 0.6, 1.0)),
        )

    def moved(self, by: Sequence[float]) -> Still:
        """All of it, moved by a vector in m."""
        return replace(self, positions=self.positions + by)

    @property
    def placed(self) -> list[Placed]:
        """The shapes where they are, parallel to `keys`."""
        return [Placed(*each) for each in zip(self.shapes, self.positions, self.orientations)]

    def rows(self, step: int, tolerance: float) -> list[Row]:
        """A row for each pair of shapes of different bodies that overlap or touch, and one for each shape alone."""
        pairs = rows(step, 0.0, self, self.contacts(tolerance))
        met = {shape for row in pairs for shape in (key(row)[:3], key(row)[3:])}
        return pairs + [row for row in self.placements(step) if key(row)[:3] not in met]

    def placements(self, step: int) -> list[Row]:
        """A row for each shape, as if it were alone."""
        return [{"step": step, **row, "status": "alone"} for row in placements(self, "A").values()]

    def contacts(self, tolerance: float) -> Contacts:
        """The pairs of shapes of different bodies that overlap or touch."""
        # Pairs of static bodies are in it, too: whether they may be left out is the simulator's business.
        batch, where = Batch(self.shapes), (self.positions, self.orientations)
        keys = np.array(self.keys, dtype=np.int64).reshape(-1, 3)
        bodies, pairs = keys[:, 0], batch.candidate_pairs(*where)
        among = pairs[bodies[pairs[:, 0]] != bodies[pairs[:, 1]]]
        return Contacts(keys, batch.overlaps(*where, among, tolerance, separated=False))


def _stills(scene: Scene, steps: Sequence[int]) -> dict[int, Still]:
    """Today's scene in some of its steps."""
    last = min(max(steps), scene.steps)
    return {frame.step: Still.of(frame.bodies) for frame in run(scene, last, only=steps)}


@dataclass(frozen=True, slots=True)
class Verdict:
    """What has moved in a scene since it was recorded, by cause.

    `geometry`: overlaps of the shapes and poses recorded, measured by today's package. `shapes`: shapes as today's
    simulation has them. `dynamics`: poses of today's simulation. `overlaps`: what has become of the overlaps because of
    the last two, and empty if both are as recorded. `notes`: sentences about budgets that do not fit. `before` and
    `after` are the steps as recorded and as they are today.
    """

    expected: Expected
    geometry: list[Move]
    shapes: list[Move]
    dynamics: list[Move]
    overlaps: list[Move]
    notes: list[str]
    before: dict[int, Still] = field(repr=False)
    after: dict[int, Still] = field(repr=False)

    @property
    def causes(self) -> dict[str, list[Move]]:
        """The moves by cause: a verdict on each of the three."""
        return {"geometry": self.geometry, "shapes": self.shapes, "dynamics": self.dynamics}

    @property
    def moves(self) -> list[Move]:
        """All that moved, the worst first; nothing, if all is as recorded."""
        return sorted((move for moves in self.causes.values() for move in moves), key=lambda move: -move.part)

    @property
    def worst_step(self) -> int:
        """The step of the worst move: of the largest one that can be measured, or else of the first."""
        measured = [move for move in self.moves if math.isfinite(move.part)]
        return (measured or self.moves)[0].step

    def lines(self, limit: int = 5) -> list[str]:
        """The verdict on each cause, with its `limit` worst moves."""
        sections = {
            "geometry": (self.geometry, "overlaps of the shapes and poses recorded, measured today"),
            "shapes": (self.shapes, "what today's models are read as"),
            "dynamics": (self.dynamics, "where today's simulation puts them"),
        }
        if self.overlaps:
            sections["overlaps"] = (self.overlaps, "what comes of it, where it is more than a hundredth")
        lines = []
        for cause, (moves, meaning) in sections.items():
            lines.append(f"{cause:9} {f'{len(moves):,} moved' if moves else 'as recorded'} ({meaning})")
            lines += [f"    {move}" for move in sorted(moves, key=lambda move: -move.part)[:limit]]
            if len(moves) > limit:
                lines.append(f"    and {len(moves) - limit:,} more")
        return lines + [f"note      {note}" for note in self.notes]


def examine(scene: Scene, expected: Expected) -> Verdict:
    """Run the scene and compare it with what was recorded. SceneError if it fails."""
    after = _stills(scene, expected.steps)
    names = {link: name for still in after.values() for link, name in still.names.items()}
    before = {step: Still.recorded(recorded, expected.shapes[step]) for step, recorded in expected.rows_by_step()}
    geometry = compare_measures(expected.rows, replay(expected), expected.budgets, names)
    today = [row for step, still in after.items() for row in still.placements(step)]
    dynamics = compare_poses(expected.rows, today, expected.budgets, names)
    shapes = _shape_moves(scene, before, after, names)
    overlaps: list[Move] = []
    if shapes or dynamics.moves:
        today = [row for step, still in after.items() for row in still.rows(step, expected.tolerance)]
        changes = compare_measures(expected.rows, today, HUNDREDTHS, names).moves
        overlaps = [replace(move, allowed=math.nan) for move in changes if move.quantity != "volume_error_m3"]
    return Verdict(
        expected,
        geometry.moves,
        shapes,
        dynamics.moves,
        overlaps,
        _notes(geometry, _rounding(expected), dynamics),
        before,
        after,
    )


def _shape_moves(
    scene: Scene, before: dict[int, Still], after: dict[int, Still], names: dict[tuple[int, int], str]
) -> list[Move]:
    """The shapes that are not those recorded, each in the first step where it is so."""
    moves: dict[str, Move] = {}
    for step, recorded in before.items():
        if step not in after:
            moves.setdefault("", Move(step, "the scene", "last step", str(step), str(scene.steps)))
            continue
        was, now = (dict(zip(still.keys, still.shapes)) for still in (recorded, after[step]))
        for k in sorted(was.keys() | now.keys()):
            if k not in was or k not in now or not alike(was[k], now[k]):
                who = shape_label(k, names)
                moves.setdefault(who, Move(step, who, "shape", _described(was.get(k)), _described(now.get(k))))
    return list(moves.values())


def _described(shape: Shape | None) -> str:
    if isinstance(shape, Hull):
        return f"{shape} of {shape.volume:.9g} m³"
    return "not there" if shape is None else str(shape)


def _notes(geometry: Differences, rounding: dict[str, float], dynamics: Differences) -> list[str]:
    """Which budgets do not fit: ten times too wide for what moves and for rounding, or too narrow for rounding."""
    needed = {name: max(part, rounding[name]) for name, part in geometry.spent.items()}
    if not dynamics.moves:
        needed |= dynamics.spent
    notes = [
        f"the budget of {name} is too narrow: rounding alone takes {part:.3g} times of it when all is moved by a metre"
        for name, part in rounding.items()
        if part > 1
    ]
    return notes + loose_budgets(Differences([], needed, geometry.error_gain))
