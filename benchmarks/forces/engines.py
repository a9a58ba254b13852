"""One world in four engines, at several substeps: what textbooks predict, and the time of a simulated second.

    python benchmarks engines                 all again, then the page and its picture
    python benchmarks engines slide spin      only these, the others from the results there are
    python benchmarks engines --page          only the page, from the results there are

The engines are volumetric contact, Bullet, MuJoCo, and Drake if it is installed (pip install drake). Steps are 1/240 s
long, each divided into substeps. The time is that of the processor, for steps alone. Writes engines.csv to
benchmarks/results/MACHINE, and docs/engines.md.
"""

from __future__ import annotations

import math
import warnings
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pybullet as p
from contact_experiments import HALF, POSES, SQUARE, STEP, G
from shapely import Polygon

from forces.worlds import ENGINES, Body, Engine, Material
from harness import results
from harness.timing import on_one_processor
from overlapper.simulation import SubstepsWarning

RESULTS = results.of_machine("engines.csv")
PAGE = "forces.engines_page"
COLUMNS = ("experiment", "engine", "substeps", "error", "ms")
SUBSTEPS = (1, 4, 16, 64)
SETTLING = 0.25  # seconds
LONGEST = 20.0  # seconds; an engine that has taken longer is not run with more substeps

Start = Callable[..., Engine]  # bodies, material and gravity


def slope(angle: float) -> tuple[float, float, float]:
    """The gravity on a plane that is tilted by so much."""
    return G * math.sin(angle), 0.0, -G * math.cos(angle)


def sunk(half: float, material: Material) -> float:
    """The height of the centre of a flat body of 10 cm and 1 kg that rests on the plane."""
    return half - G / (material.stiffness * (2 * HALF) ** 2)


def bounce(pose: str) -> Callable[[Start], float]:
    """The energy that a cube gains or loses by a bounce, over that of its drop of 5 cm."""

    def of(start: Start) -> float:
        down = np.abs(p.getMatrixFromQuaternion(POSES[pose])[6:]).sum()
        drop, low = 0.05, HALF * down
        cube = Body("box", (HALF,) * 3, (0, 0, low + drop), POSES[pose])
        engine = start([cube], Material(friction=0, elastic=True, stiffness=1e7))
        inertia = 2 / 3 * HALF**2

        def energy() -> float:
            linear, angular = engine.velocity(0)
            linear = linear + engine.lag
            return G * engine.position(0)[2] + linear @ linear / 2 + inertia * angular @ angular / 2

        before = G * (low + drop)
        engine.run(44 * STEP)
        return abs(energy() - before) / (G * drop)

    return of


def slide(start: Start) -> float:
    """How far a flat box slides that starts with 1 m/s: v²/2µg."""
    material, speed = Material(), 1.0
    engine = start([Body("box", (HALF, HALF, 0.01), (0, 0, sunk(0.01, material)), velocity=(speed, 0, 0))], material)
    engine.run(0.5)
    way = engine.position(0)[0] + speed * STEP / engine.substeps / 2
    return abs(way / (speed**2 / (2 * material.friction * G)) - 1)


def spin(start: Start) -> float:
    """The angle by which a flat box turns that starts with 20 rad/s: Iω²/2µmgρ."""
    material, speed, angle = Material(spinning=True), 20.0, 0.0
    engine = start([Body("box", (HALF, HALF, 0.01), (0, 0, sunk(0.01, material)), spin=(0, 0, speed))], material)
    torque = material.friction * G * 2 * HALF * SQUARE
    stop = (2 * (2 * HALF) ** 2 / 12) * speed / torque
    for _ in range(round(1.5 * stop / STEP)):
        before = engine.velocity(0)[1][2]
        engine.run(STEP)
        angle += (before + engine.velocity(0)[1][2]) / 2 * STEP
    return abs(angle / (speed * stop / 2) - 1)


def roll(start: Start) -> float:
    """The acceleration of a ball that rolls down a slope of 10 degrees: 5/7 g sin."""
    angle = math.radians(10)
    level = start([Body("ball", HALF, (0, 0, HALF))], Material(stiffness=1e9), (0, 0, -G * math.cos(angle)))
    level.run(1)
    height = level.position(0)[2]  # at rest, which no engine would come to without dissipation
    engine = start([Body("ball", HALF, (0, 0, height))], Material(stiffness=1e9, dissipation=0), slope(angle))
    engine.run(0.5)
    return abs(engine.velocity(0)[0][0] / 0.5 / (5 / 7 * G * math.sin(angle)) - 1)


def on_slopes(start: Start, bodies: list[Body], material: Material, friction: float) -> float:
    """A body on slopes 1 % below and 1 % above its friction: it stays, or slides as the textbook says.

    The larger error of both accelerations along the slope, over g, after half a second to settle.
    """
    errors = []
    for share in (0.99, 1.01):
        angle = math.atan(share * friction)
        expected = max(0.0, G * (math.sin(angle) - friction * math.cos(angle)))
        engine = start(bodies, material, slope(angle))
        engine.run(0.5)
        before = engine.velocity(len(bodies) - 1)[0][0]
        engine.run(0.5)
        errors.append(abs((engine.velocity(len(bodies) - 1)[0][0] - before) / 0.5 - expected) / G)
    return max(errors)


def incline(start: Start) -> float:
    """The acceleration of a box on slopes of 0.99 and 1.01 of its friction, over g."""
    material = Material()
    box = Body("box", (HALF, HALF, HALF), (0, 0, sunk(HALF, material)))
    return on_slopes(start, [box], material, material.friction)


def groove(start: Start) -> float:
    """The same in a groove between two walls at 45 degrees, where the friction is √2 times as large."""
    half, thick = math.sqrt(0.5), 0.2
    turn = POSES["edge"]
    walls = [Body("box", (1, thick, thick), (0, side * half * thick, 1 - half * thick), turn, 0) for side in (1, -1)]
    cube = Body("box", (HALF,) * 3, (0, 0, 1 + HALF * math.sqrt(2)), turn)
    material = Material()
    return on_slopes(start, [*walls, cube], material, math.sqrt(2) * material.friction)


def at_rest(engine: Engine, seconds: float) -> float:
    """The largest way of a body in the second half of the time, m."""
    engine.run(seconds / 2)
    before = engine.positions()
    engine.run(seconds / 2)
    return float(np.linalg.norm(engine.positions() - before, axis=1).max())


def sinks(engine: Engine, body: int, settling: float) -> float:
    """How far a body sinks in 1.25 s, after so many seconds to settle, m."""
    engine.run(settling)
    height = engine.position(body)[2]
    engine.run(1.25)
    return abs(height - engine.position(body)[2])


def stack(count: int) -> Callable[[Start], float]:
    """The drift of cubes on each other, each second one set 2 mm aside, in the second half of two seconds, m."""

    def of(start: Start) -> float:
        cubes = [Body("box", (HALF,) * 3, (0.002 * (k % 2), 0, HALF * (2 * k + 1))) for k in range(count)]
        return at_rest(start(cubes, Material(default=True)), 2)

    return of


def pyramid(start: Start) -> float:
    """The drift of a wall of 21 bricks in six rows, in the second half of a second, m."""
    bricks = [
        Body("box", (0.1, HALF, HALF), (0.202 * (k - (5 - row) / 2), 0, HALF * (2 * row + 1)))
        for row in range(6)
        for k in range(6 - row)
    ]
    return at_rest(start(bricks, Material(default=True)), 1)


def arch(thickness: float, settling: float = SETTLING) -> Callable[[Start], float]:
    """How far the crown of a round arch of nine stones sinks, m. Heyman: it stands if t/R is above 0.1075."""

    def of(start: Start) -> float:
        count, stones = 9, []
        for k in range(count):
            low, high = math.pi * k / count, math.pi * (k + 1) / count
            inner, outer = 1 - thickness / 2, 1 + thickness / 2
            corners = [
                (radius * math.cos(at), radius * math.sin(at))
                for radius, at in ((inner, low), (outer, low), (outer, high), (inner, high))
            ]
            section = Polygon(corners)
            centre = section.centroid
            hull = [(x - centre.x, y, z - centre.y) for x, z in corners for y in (-0.15, 0.15)]
            stones.append(Body("hull", hull, (centre.x, 0, centre.y), mass=section.area * 0.3 * 100))
        return sinks(start(stones, Material(friction=0.7, default=True)), count // 2, settling)

    return of


def cards(share: float, settling: float = SETTLING) -> Callable[[Start], float]:
    """How far two cards sink that lean on each other, m. They stand if half the tangent of the lean is below µ."""

    def of(start: Start) -> float:
        friction, length, thin = 0.4, 0.1, 0.002
        lean = math.atan(2 * friction * share)
        leaning = []
        for side in (-1, 1):
            turn = -side * lean
            c, s = math.cos(turn), math.sin(turn)
            inner = min((x * c + length * s for x in (-thin, thin)), key=lambda x: side * x)
            low = min(-x * s - length * c for x in (-thin, thin))
            pose = p.getQuaternionFromEuler([0, turn, 0])
            leaning.append(Body("box", (thin, 0.05, length), (-inner, 0, -low), pose, 0.1))
        return sinks(start(leaning, Material(friction=friction, default=True)), 0, settling)

    return of


def cradle(start: Start) -> float:
    """Five elastic balls in a row, 1 mm apart. The first comes with 1 m/s. The largest error of a speed, m/s."""
    gap = 1e-3
    balls = [
        Body("ball", HALF, ((2 * HALF + gap) * k - HALF * (k == 0), 0, 1), velocity=(float(k == 0), 0, 0))
        for k in range(5)
    ]
    engine = start(balls, Material(friction=0, elastic=True, stiffness=1e7), (0, 0, 0))
    engine.run(0.25)
    return max(abs(engine.velocity(k)[0][0] - (k == 4)) for k in range(5))


def turntable(start: Start) -> float:
    """The drift outwards of a cube on a heavy table that turns at 3 rad/s, in the last of two seconds, m/s."""
    turn, radius, material = 3.0, 0.3, Material()
    table = Body("box", (0.6, 0.6, HALF), (0, 0, 1), mass=1e6, spin=(0, 0, turn), hinge=True)
    height = 1 + HALF + sunk(0.03, material)
    cube = Body("box", (0.03,) * 3, (radius, 0, height), velocity=(0, turn * radius, 0), spin=(0, 0, turn))
    engine = start([table, cube], material)
    engine.run(1)
    before = np.linalg.norm(engine.position(1)[:2])
    engine.run(1)
    return abs(float(np.linalg.norm(engine.position(1)[:2]) - before))


class Experiment(NamedTuple):
    title: str  # with the unit of the error
    make: Callable[[Start], float]


EXPERIMENTS = {
    **{f"bounce {pose}": Experiment(f"bounce on {'a' if pose != 'edge' else 'an'} {pose}: energy", bounce(pose))
       for pose in ("face", "edge", "corner")},
    "bounce skew": Experiment("skew bounce: energy", bounce("skew")),
    "slide": Experiment("slide: distance", slide),
    "spin": Experiment("spin: angle", spin),
    "roll": Experiment("ball on a slope: acceleration", roll),
    "incline": Experiment("box on a slope: acceleration, g", incline),
    "groove": Experiment("box in a groove: acceleration, g", groove),
    "stack 5": Experiment("stack of 5: drift, m", stack(5)),
    "stack 10": Experiment("stack of 10: drift, m", stack(10)),
    "stack 20": Experiment("stack of 20: drift, m", stack(20)),
    "pyramid": Experiment("wall of 21 bricks: drift, m", pyramid),
    "arch": Experiment("arch: sinks by, m", arch(0.18)),
    "cards": Experiment("leaning cards: sink by, m", cards(0.9)),
    "cradle": Experiment("five balls in a row: speed, m/s", cradle),
    "turntable": Experiment("turntable: drift, m/s", turntable),
}  # fmt: skip
# These must fall: an engine that glues bodies together would pass the arch and the cards above.
FALLING = {"thin arch": Experiment("", arch(0.09, 0)), "steep cards": Experiment("", cards(1.1, 0))}
ALL = EXPERIMENTS | FALLING


def installed() -> dict[str, type[Engine]]:
    return {name: kind for name, kind in ENGINES.items() if name != "Drake" or find_spec("pydrake")}


def run(name: str, kind: type[Engine], substeps: int) -> tuple[float, float, float]:
    """The error, the milliseconds of a simulated second, and the seconds of the processor."""
    started = []

    def start(bodies: list[Body], material: Material, gravity: Sequence[float] = (0, 0, -G)) -> Engine:
        started.append(kind(bodies, material, substeps, gravity))
        return stack.enter_context(started[-1])

    with warnings.catch_warnings(), ExitStack() as stack:
        warnings.simplefilter("ignore", SubstepsWarning)  # few are taken to see what is lost
        error = ALL[name].make(start)
    cost = sum(engine.cost for engine in started)
    return error, 1e3 * cost / sum(engine.seconds for engine in started), cost


def options(parser: ArgumentParser) -> None:
    parser.add_argument("experiments", nargs="*", metavar="EXPERIMENT", help="by default all")


def measure(chosen: Namespace, path: Path) -> None:
    if unknown := set(chosen.experiments) - set(ALL):
        raise SystemExit(f"overlapper: no experiment {', '.join(sorted(unknown))}; there are {', '.join(ALL)}")
    names = chosen.experiments or list(ALL)
    kept = [] if len(names) == len(ALL) or not path.exists() else results.read(path)[1]
    rows = {name: [[*row.values()] for row in kept if row["experiment"] == name] for name in ALL}
    on_one_processor()
    for name in names:
        rows[name] = list(measured(name))
        print(f"{name}: measured", flush=True)
    note = f"{results.today()}; {results.packages('mujoco', 'drake')}"
    with results.writing(path, COLUMNS, note) as write:
        for each in rows.values():
            write(each)


def measured(name: str) -> Iterator[tuple]:
    """The rows of one experiment."""
    for engine, kind in installed().items():
        for substeps in SUBSTEPS if name in EXPERIMENTS else SUBSTEPS[1:2]:
            try:
                error, ms, cost = run(name, kind, substeps)
            except RuntimeError as failure:  # Drake's solver did not converge
                print(f"{name}, {engine}, {substeps} substeps: {failure}".split(". ")[0], flush=True)
                yield name, engine, substeps, "nan", "nan"
                continue
            yield name, engine, substeps, f"{error:.3g}", f"{ms:.4g}"
            if cost > LONGEST:
                break
