"""The page about volumetric contact, docs/forces.md: its tables and pictures, from what was measured."""

from __future__ import annotations

import math
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np

from forces import cost, firsttry, physics
from forces.cost import PARTS, PILE, SMALL_PILE
from forces.physics import LAWS
from harness import charts, results
from harness.charts import BOOK, INK, OURS, Panel, Series
from harness.page import named, table, write


class Figures(dict[tuple[str, str, str], dict[str, float]]):
    """Values by experiment, law and case, and there by what they are at."""

    @classmethod
    def read(cls, path: Path) -> Figures:
        found = cls()
        for row in results.read(path)[1]:
            found.setdefault((row["experiment"], row["law"], row["case"]), {})[row["at"]] = float(row["value"])
        return found

    def series(self, experiment: str, law: str, case: str) -> tuple[list[float], list[float]]:
        """The values at numbers, to be drawn over them."""
        of = {float(at): value for at, value in self[experiment, law, case].items() if at[:1].isdigit()}
        return [*of], [*of.values()]


def small(value: float) -> str:
    return "0" if value == 0 else f"{value:.0e}" if abs(value) < 1e-3 else f"{value:.2g}"


def physics_table(of: Figures) -> str:
    """One line per experiment: the textbook's figure, ours and Bullet's."""

    def ratio(experiment: str, law: str, case: str, at: str) -> str:
        return f"{of[experiment, law, case][at]:.4f}"

    def both(experiment: str, case: str, at: str) -> list[str]:
        return [ratio(experiment, law, case, at) for law in LAWS]

    def most(experiment: str, case: str, at: str, unit: str) -> list[str]:
        return [f"{small(abs(of[experiment, law, case][at]))}{unit}" for law in LAWS]

    rest = {case: of["rest", "volumetric", f"{case} Pa/m"] for case in ("1e+07", "1e+08", "1e+09")}
    depth = max(abs(each["depth"]) for each in rest.values())
    speed = max(each["speed"] for each in rest.values())
    bullet = [of["rest", "bullet", f"{n} substeps"]["speed"] for n in (1, 4)]
    rows = [
        ["rest depth over *mg/kA*, *k* = 1e7 to 1e9 Pa/m", "1", f"1 ± {small(depth)}", "no stiffness"],
        [
            "speed 3 s after a cube is set down tilted by 1e-3", "0",
            f"{small(speed)} m/s", f"{small(bullet[0])}, in 4 substeps {small(bullet[1])} m/s",
        ],
        ["bounce on a face, energy lost or gained, 16 substeps", "0", *most("bounce", "face", "16", "")],
        ["bounce on an edge, 16 substeps", "0", *most("bounce", "edge", "16", "")],
        ["the same, 32 substeps", "0", *most("bounce", "edge", "32", "")],
        ["bounce on a corner, 16 substeps", "0", f"{small(of['bounce', 'volumetric', 'corner']['16'])}", ""],
        [
            "speed after a bounce, over the speed before, *τ* = 0.5 ms",
            f"{of['rebound', 'volumetric', 'foretold']['0.0005']:.3f}",
            f"{of['rebound', 'volumetric', 'measured']['0.0005']:.3f}",
            "no *τ*",
        ],
        ["distance until a box stops, over *v²/2µg*, 1 substep", "1", *both("slide", "", "1")],
        ["the same, 20 substeps", "1", *both("slide", "", "20")],
        ["distance in 1 s on an incline of slope 0.999 *µ*", "0", *most("incline", "way", "0.999", " m")],
        [
            "acceleration on an incline of slope 1.001 *µ*, over *g*", f"{expected_incline(1.001):.2e}",
            *(f"{of['incline', law, 'acceleration']['1.001']:.2e}" for law in LAWS),
        ],
        ["time of a spinning box, over *Iω/µmgρ*, 4 substeps", "1", *both("spin", "box", "4")],
        ["time of a spinning disc, 4 substeps", "1", *both("spin", "disc", "4")],
        [
            "slip and spin at once, distance over that of a rigid base", "1",
            f"{ratio('slide and spin', 'volumetric', 'box ellipsoid', 'way')}, distributed "
            f"{ratio('slide and spin', 'volumetric', 'box distributed', 'way')}",
            ratio("slide and spin", "bullet", "box", "way"),
        ],
        ["kinetic energy that a rolling cylinder loses in 1 s, *τ* = 0", "0", *most("roll", "cylinder", "energy", "")],
        ["the same for a rolling ball", "0", *most("roll", "ball", "energy", "")],
        [
            "decay of a rolling cylinder, over ⅔ *τg/r*, *τ* = 1 ms", "1",
            f"{-math.log(of['roll', 'volumetric', 'cylinder']['0.001']) / (2 / 3 * 1e-3 * 9.81 / 0.05):.4f}", "no *τ*",
        ],
        [
            "decay of a rolling ball, over 5/7 *τg/r*", "1",
            f"{-math.log(of['roll', 'volumetric', 'ball']['0.001']) / (5 / 7 * 1e-3 * 9.81 / 0.05):.4f}", "no *τ*",
        ],
        ["SimBenchmark: speed of the box pushed at 45°", "1", *both("push", "box", "45")],
        ["SimBenchmark: speed of the 25 balls on it", "1", *both("push", "balls", "45")],
        ["a box gripped by 1.01 *mg/2F*: its speed", "0", *most("grip", "speed", "1.01", " m/s")],
        [
            "a box gripped by 0.99 *mg/2F*: its acceleration, over *g*", "0.0100",
            *(f"{of['grip', law, 'acceleration']['0.99']:.4f}" for law in LAWS),
        ],
        ["a cube on a turntable, 3 rad/s: its drift outwards", "0", *most("turntable", "drift", "3", " m/s")],
        [
            "stack of five, drift from 5 to 10 s", "0",
            f"{small(of['stack', 'volumetric', '1e8 Pa/m']['drift'])} m at 1e8, "
            f"{small(of['stack', 'volumetric', '1e7 Pa/m']['drift'])} m at 1e7 Pa/m",
            f"{small(of['stack', 'bullet', '1 substeps']['drift'])} m",
        ],
    ]  # fmt: skip
    return table(["experiment", "textbook", "volumetric", "Bullet"], rows)


def expected_incline(slope: float, friction: float = 0.5) -> float:
    """Over g."""
    angle = math.atan(slope * friction)
    return max(0.0, math.sin(angle) - friction * math.cos(angle))


BY_LAW = {"volumetric": (OURS, "volumetric", "o"), "bullet": (INK, "Bullet", "x")}  # colour, name and marker
BY_BULLET = (("face", "s:"), ("edge", "^:"))
ROLLING = {"cylinder": "s", "ball": "^"}


def curve(of: Figures, name: tuple[str, str, str], label: str, form: str, colour: str, least: float = 0) -> Series:
    """The values of a law over what they are at."""
    x, y = of.series(*name)
    return Series(x, np.maximum(np.abs(y), least), label, form, style={"color": colour, "ms": 5})


def book(x: Any, y: Any, label: str | None = "textbook", form: str = "-") -> Series:
    return Series(x, y, label, form, style={"color": BOOK, "lw": 1, "zorder": 1})


def energy_panels(of: Figures) -> list[Panel]:
    bounces = {"face": "#d1001f", "skew": "#f58518", "edge": "#8c6bb1", "corner": "#4292c6"}
    bounce = [curve(of, ("bounce", "volumetric", pose), pose, "o-", colour) for pose, colour in bounces.items()]
    bounce += [curve(of, ("bounce", "bullet", pose), f"{pose}, Bullet", form, INK) for pose, form in BY_BULLET]
    rattles = {"1e+07 Pa/m": "#f4a582", "1e+08 Pa/m": "#e0533d", "1e+09 Pa/m": "#a50026"}
    rattle = [curve(of, ("rattle", "volumetric", case), case, "-", colour, 1e-17) for case, colour in rattles.items()]
    for substeps, form in ((1, "-"), (4, ":")):
        case = f"{substeps} substeps"
        rattle.append(curve(of, ("rattle", "bullet", case), f"Bullet, {case}", form, INK))
    substeps = {"xscale": "log", "yscale": "log", "xlabel": "substeps of 1/240 s"}
    lost, speed = "A bounce: energy lost or gained, of the drop's", "A cube that is set down tilted: its speed"
    time = {"yscale": "log", "xlabel": "s", "ylabel": "m/s"}
    ticks = {2**k: str(2**k) for k in range(7)}
    return [Panel(lost, bounce, substeps, xticks=ticks, legend={}), Panel(speed, rattle, time, legend={})]


def friction_panels(of: Figures) -> list[Panel]:
    incline, spin, roll = [], [], []
    times = np.linspace(0, 4e-3, 50)
    for law, (colour, words, marker) in BY_LAW.items():
        incline.append(curve(of, ("incline", law, "acceleration"), words, marker, colour))
        for shape, form in (("box", "-"), ("disc", ":")):
            spin.append(curve(of, ("spin", law, shape), f"{words}, {shape}", marker + form, colour))
        roll += [curve(of, ("roll", law, shape), f"{words}, {shape}", m, colour) for shape, m in ROLLING.items()]
    for factor, form in ((2 / 3, "-"), (5 / 7, ":")):
        roll.append(book(times, np.exp(-factor * times * 9.81 / 0.05), "textbook" if form == "-" else None, form))
    slopes = np.linspace(0.988, 1.012, 241)
    incline.append(book(slopes, [expected_incline(slope) for slope in slopes]))
    spin.append(book([1, 20], [1, 1], None))
    few = {"xlabel": "substeps", "xscale": "log", "ylim": (0, 1.3)}
    return [
        Panel("On an incline", incline, {"xlabel": "slope, of µ", "ylabel": "acceleration, of g"}, legend={}),
        Panel("Time of a spin, of Iω/µmgρ", spin, few, xticks={1: "1", 4: "4", 20: "20"}, legend={}),
        Panel("Rolling: speed after 1 s, of that before", roll, {"xlabel": "dissipation, s"}, legend={}),
    ]


def cost_table(path: Path) -> str:
    """The results of `python benchmarks forces`, if there are any."""
    if not path.exists():
        return "They were not measured yet."
    (note,), rows = results.read(path)
    found: dict[str, dict[str, float]] = {}
    for row in rows:
        found.setdefault(row["scene"], {})[row["part"]] = float(row["us"])
    lines = {part: part for part in PARTS} | {"rest": "else", "substep": "**all**"}
    by_parts = {name: of_scene for name, of_scene in found.items() if "substep" in of_scene and name != SMALL_PILE}
    said = table(
        ["µs of a substep", *by_parts],
        ([words, *(f"{of_scene[part]:,.0f}" for of_scene in by_parts.values())] for part, words in lines.items()),
    )
    beside = table(
        ["scene", "substeps", "ms of a step, Bullet", "volumetric", "times"],
        (
            [name, f"{each['substeps']:.0f}", f"{each['bullet'] / 1e3:.2g}", f"{each['step'] / 1e3:.2g}",
             f"{each['step'] / each['bullet']:.1f}"]
            for name, each in found.items() if "bullet" in each
        ),
    )  # fmt: skip
    pile = found[PILE]
    told = (
        f"The {PILE} has {pile['contacts']:,.0f} contacts. At the end, the boxes of 1 kg are at most "
        f"{pile['deepest'] * 1e3:.0f} mm deep in each other, where corners meet. Bullet steps a twin of "
        "each scene in turn:"
    )
    return f"{said}\n\n{fill(told, 130)}\n\n{beside}\n\n    {note}"


def firsttry_parts(path: Path) -> dict[str, str]:
    """The table of common scenes, and how many of them end as Bullet's do."""
    (note,), rows = results.read(path)
    lines, verdicts = [], []
    for bullet, ours in zip(rows[::2], rows[1::2]):
        verdicts.append(firsttry.verdict(bullet, ours))
        resting = [str(firsttry.resting(row).sum()) if int(row["finite"]) else "" for row in (bullet, ours)]
        ms = [f"{float(row['ms']):.2g}" if row["ms"] else "" for row in (bullet, ours)]
        lines.append([bullet["scene"].replace("_", " "), verdicts[-1], *resting, ours["substeps"], *ms])
    told = (
        f"**{verdicts.count(firsttry.SAME)} of {len(verdicts)}** scenes end as Bullet's do. The others are named with "
        "what differs. *Resting* counts the bodies at rest, with the floor. *ms* is the processor's time for a step of "
        "1/240 s, which volumetric contact divides into the given number of substeps."
    )
    heading = ["scene", "end", "resting, Bullet", "ours", "substeps", "ms, Bullet", "ours"]
    return {
        "firsttry": f"{table(heading, lines, left=2)}\n\n    {note}",
        "firsttry_told": fill(told, 130),
    }


def write_page(path: Path, folder: Path) -> Path:
    """forces.md, with its pictures, from the figures or times in `path` and the others of the checkout."""
    measured = (physics.RESULTS, cost.RESULTS, firsttry.RESULTS)
    laws, times, tries = (path if path.name == each.name else each for each in measured)
    of = Figures.read(laws)
    for name, panels_of in (("energy", energy_panels), ("friction", friction_panels)):
        panels = panels_of(of)
        charts.draw(folder / f"forces_{name}.png", panels, (10.8, 4.0 if len(panels) == 2 else 3.6), font=9)
    face, mixed, spread = (
        of["bounce", "volumetric", "face"],
        *(of["slide and spin", "volumetric", f"box {friction}"] for friction in ("ellipsoid", "distributed")),
    )
    cubes, more_cubes, balls, more_balls = (
        [abs(change) for change in of["collide", "volumetric", f"{kind} in {substeps} substeps"].values()]
        for kind in ("cubes", "balls")
        for substeps in (16, 64)
    )
    soft, stiff = (of["stack", "volumetric", f"{stiffness} Pa/m"] for stiffness in ("1e7", "1e8"))
    return write(
        Path(__file__).with_name("page.md"),
        folder / "forces.md",
        results=named(laws),
        table=physics_table(of),
        cost=cost_table(times),
        **firsttry_parts(tries),
        face_1=f"{100 * face['1']:.0f}",
        face_4=f"{100 * face['4']:.1f}",
        face_16=f"{100 * face['16']:.2f}",
        mixed=f"{100 * (1 - mixed['way']):.1f}",
        mixed_angle=f"{100 * (1 - mixed['angle']):.1f}",
        spread=f"{100 * abs(1 - spread['way']):.1f}",
        spread_angle=f"{100 * abs(1 - spread['angle']):.1f}",
        soft=small(soft["drift"]),
        soft_speed=small(soft["speed"]),
        stiff=small(stiff["drift"]),
        shove=f"{1e6 * of['shove', 'volumetric', 'box']['way']:.0f}",
        cubes=f"{100 * max(cubes):.1f} %",
        cubes_by=small(max(abs(a - b) for a, b in zip(cubes, more_cubes))),
        balls=small(max(balls)),
        balls_64=small(max(more_balls)),
        loop=small(of["loop", "volumetric", "over a rim"]["work"]),
    )
