"""The page about volumetric contact, docs/forces.md: its tables and pictures, from what was measured."""

from __future__ import annotations

import math
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from forces import cost, physics
from forces.cost import PARTS, PILE
from forces.physics import LAWS
from harness import figures, results
from harness.figures import INK, OURS, plt
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
            "speed after a bounce, of that before, *τ* = 0.5 ms",
            f"{of['rebound', 'volumetric', 'foretold']['0.0005']:.3f}",
            f"{of['rebound', 'volumetric', 'measured']['0.0005']:.3f}",
            "no *τ*",
        ],
        ["way until a box stops, over *v²/2µg*, 1 substep", "1", *both("slide", "", "1")],
        ["the same, 20 substeps", "1", *both("slide", "", "20")],
        ["way in 1 s on an incline of 0.999 *µ*", "0", *most("incline", "way", "0.999", " m")],
        [
            "acceleration there, at 1.001 *µ*, over *g*", f"{expected_incline(1.001):.2e}",
            *(f"{of['incline', law, 'acceleration']['1.001']:.2e}" for law in LAWS),
        ],
        ["time of a spinning box, over *Iω/µmgρ*, 4 substeps", "1", *both("spin", "box", "4")],
        ["time of a spinning disc, 4 substeps", "1", *both("spin", "disc", "4")],
        [
            "slip and spin at once, way over that of a rigid base", "1",
            f"{ratio('slide and spin', 'volumetric', 'box ellipsoid', 'way')}, distributed "
            f"{ratio('slide and spin', 'volumetric', 'box distributed', 'way')}",
            ratio("slide and spin", "bullet", "box", "way"),
        ],
        ["kinetic energy that a rolling cylinder loses in 1 s, *τ* = 0", "0", *most("roll", "cylinder", "energy", "")],
        ["that of a rolling ball", "0", *most("roll", "ball", "energy", "")],
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
            "gripped by 0.99 *mg/2F*: acceleration, over *g*", "0.0100",
            *(f"{of['grip', law, 'acceleration']['0.99']:.4f}" for law in LAWS),
        ],
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


THEIRS, BOOK = INK, "#1f5fbf"
BY_LAW = {"volumetric": (OURS, "volumetric"), "bullet": (THEIRS, "Bullet")}  # colour and name


def panels(count: int) -> Any:
    return plt.subplots(1, count, figsize=(10.8, 4.0 if count == 2 else 3.6))


def finish(figure: Any, axes: tuple[Axes, ...], path: Path) -> None:
    figures.tidy(*axes)
    for ax in axes:
        ax.legend(frameon=False, fontsize=7.5)
    figure.tight_layout()
    figures.save(figure, path)


def draw_energy(of: Figures, path: Path) -> None:
    figure, (bounce, rattle) = panels(2)
    words = {"face": "on a face", "edge": "on an edge", "corner": "on a corner", "skew": "askew"}
    for pose, colour in (("face", "#d1001f"), ("skew", "#f58518"), ("edge", "#8c6bb1"), ("corner", "#4292c6")):
        bounce.plot(*of.series("bounce", "volumetric", pose), "o-", color=colour, ms=4, label=words[pose])
    for pose, dashes in (("face", "s:"), ("edge", "^:")):
        label = f"Bullet, {words[pose]}"
        bounce.plot(*of.series("bounce", "bullet", pose), dashes, color=THEIRS, ms=4, label=label)
    bounce.set(
        xscale="log", yscale="log", xlabel="substeps of 1/240 s", title="A bounce: energy lost or gained, of the drop's"
    )
    bounce.set_xticks([1, 2, 4, 8, 16, 32, 64], ["1", "2", "4", "8", "16", "32", "64"])
    bounce.minorticks_off()
    for case, colour in (("1e+07 Pa/m", "#f4a582"), ("1e+08 Pa/m", "#e0533d"), ("1e+09 Pa/m", "#a50026")):
        x, y = of.series("rattle", "volumetric", case)
        rattle.plot(x, np.maximum(y, 1e-17), color=colour, label=case.replace("e+0", "e"))
    for case, dashes in (("1 substeps", "-"), ("4 substeps", ":")):
        label = "Bullet" if case[0] == "1" else "Bullet, 4 substeps"
        rattle.plot(*of.series("rattle", "bullet", case), dashes, color=THEIRS, label=label)
    rattle.set(yscale="log", xlabel="s", ylabel="m/s", title="A cube that is set down tilted: its speed")
    finish(figure, (bounce, rattle), path)


def draw_friction(of: Figures, path: Path) -> None:
    figure, (slide, incline, spin) = panels(3)
    for law, (colour, words) in BY_LAW.items():
        x, y = of.series("slide", law, "")
        slide.plot(x, np.abs(np.array(y) - 1), "o-", color=colour, label=words)
        incline.plot(
            *of.series("incline", law, "acceleration"), "o" if law == "volumetric" else "x", color=colour, label=words
        )
        for shape, dashes in (("box", "-"), ("disc", ":")):
            spin.plot(*of.series("spin", law, shape), f"o{dashes}", color=colour, ms=4, label=f"{words}, {shape}")
    slopes = np.linspace(0.988, 1.012, 241)
    incline.plot(slopes, [expected_incline(slope) for slope in slopes], color=BOOK, lw=1, zorder=1, label="textbook")
    slide.set(xscale="log", yscale="log", xlabel="substeps", title="Way of a sliding box:\nerror of v²/2µg")
    incline.set(xlabel="slope, of µ", ylabel="acceleration, of g", title="On an incline")
    spin.axhline(1, color=BOOK, lw=1)
    spin.set(xscale="log", xlabel="substeps", title="Time of a spin,\nof Iω/µmgρ", ylim=(0, 1.3))
    for ax in (slide, spin):
        ax.set_xticks([1, 4, 20], ["1", "4", "20"])
        ax.minorticks_off()
    finish(figure, (slide, incline, spin), path)


def draw_bodies(of: Figures, path: Path) -> None:
    figure, (roll, stack, grip) = panels(3)
    times = np.linspace(0, 4e-3, 50)
    for shape, factor, marker in (("cylinder", 2 / 3, "o"), ("ball", 5 / 7, "^")):
        x, y = of.series("roll", "volumetric", shape)
        roll.plot(np.array(x) * 1e3, y, marker, color=OURS, label=f"{shape}")
        roll.plot(
            times * 1e3, np.exp(-factor * times * 9.81 / 0.05), color=BOOK, lw=1, ls="-" if marker == "o" else ":"
        )
        x, y = of.series("roll", "bullet", shape)
        roll.plot(x, y, marker, color=THEIRS, mfc="none", ms=9, label=f"Bullet, {shape}")
    roll.plot([], [], color=BOOK, lw=1, label="textbook")
    roll.set(xlabel="dissipation, ms", title="Rolling from 1 m/s:\nspeed after 1 s, of that before")
    cases = [("volumetric", "1e8 Pa/m"), ("volumetric", "1e7 Pa/m"), ("bullet", "1 substeps"), ("bullet", "4 substeps")]
    for k, (law, case) in enumerate(cases):
        colour, words = BY_LAW[law]
        stack.bar(k, of["stack", law, case]["drift"], 0.6, color=colour, label=words if k % 2 == 0 else None)
    stack.set(yscale="log", title="A stack of five: drift\nfrom 5 to 10 s, m")
    stack.set_xticks(range(4), ["1e8\nPa/m", "1e7\nPa/m", "1 sub-\nstep", "4 sub-\nsteps"])
    for law, (colour, words) in BY_LAW.items():
        x, y = of.series("grip", law, "fallen")
        grip.plot(
            x, np.maximum(np.abs(np.array(y)), 1e-18), "o-" if law == "volumetric" else "x-", color=colour, label=words
        )
    parts = np.linspace(0.968, 0.9999, 100)
    grip.plot(parts, (1 - parts) * 9.81 * 0.5**2 / 2, color=BOOK, lw=1, label="textbook")
    grip.set(
        yscale="log", xlabel="coefficient of friction, of mg/2F", title="A gripped box:\nfallen in half a second, m"
    )
    finish(figure, (roll, stack, grip), path)


def cost_table(path: Path) -> str:
    """The results of `python benchmarks forces`, if there are any."""
    if not path.exists():
        return "They were not measured yet."
    (note,), rows = results.read(path)
    found: dict[str, dict[str, float]] = {}
    for row in rows:
        found.setdefault(row["scene"], {})[row["part"]] = float(row["us"])
    lines = {part: part for part in PARTS} | {"rest": "else", "substep": "**all**"}
    said = table(
        ["µs of a substep", *found],
        ([words, *(f"{of_scene[part]:,.0f}" for of_scene in found.values())] for part, words in lines.items()),
    )
    pile = found[PILE]
    told = (
        f"The {PILE}, {pile['contacts']:,.0f} contacts, at 240 Hz: a step in {pile['substeps']:.0f} substeps takes "
        f"{pile['step'] / 1e3:.1f} ms, Bullet's own step of the same pile {pile['bullet'] / 1e3:.1f} ms: "
        f"**{pile['step'] / pile['bullet']:.1f} times** as long. Its boxes of 1 kg are {pile['deepest'] * 1e3:.0f} mm "
        f"deep in each other at the most, where corners meet."
    )
    return f"{said}\n\n{fill(told, 130)}\n\n    {note}"


def write_page(path: Path, folder: Path) -> Path:
    """forces.md, with its pictures, from the figures or times in `path` and the others of the checkout."""
    laws, times = (path if path.name == each.name else each for each in (physics.RESULTS, cost.RESULTS))
    of = Figures.read(laws)
    for draw in (draw_energy, draw_friction, draw_bodies):
        figures.style(**{"font.size": 9})
        draw(of, folder / f"forces_{draw.__name__.removeprefix('draw_')}.png")
    face, mixed, spread = (
        of["bounce", "volumetric", "face"],
        *(of["slide and spin", "volumetric", f"box {friction}"] for friction in ("ellipsoid", "distributed")),
    )
    soft, stiff = (of["stack", "volumetric", f"{stiffness} Pa/m"] for stiffness in ("1e7", "1e8"))
    return write(
        Path(__file__).with_name("page.md"),
        folder / "forces.md",
        results=named(laws),
        table=physics_table(of),
        cost=cost_table(times),
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
        loop=small(of["loop", "volumetric", "over a rim"]["work"]),
    )
