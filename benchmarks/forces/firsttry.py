"""Common scenes with `VolumetricContact(Bodies(client))` and no argument, beside Bullet's own contacts.

    python benchmarks firsttry          all scenes, some minutes
    python benchmarks firsttry --page   only the page, from the results there are

A scene ends as Bullet's does if all of these hold. The numbers were chosen before the whole list was run.

- Poses and velocities are finite, and no exception is raised.
- At least as many bodies rest as with Bullet. A body rests if its base moves by less than 5 mm in the last half second.
  This is a tenth of the smallest object, and a hundredth of what a body that is let go falls in this time.
- No body that rests with Bullet ends more than 5 cm lower. A robot that lies on its other side is less than this
  lower, and what falls through a table or stands no more is further down.
- A body that Bullet's scene lifts is lifted: by more than 0.1 m, which is half of the way of the hand.
- A body that is driven goes as far as Bullet's: within 20 % of the distance, as contact points and patches give a
  turning wheel different friction.

A scene whose Bullet run is not finite has no reference. Writes firsttry.csv to benchmarks/results, a line per scene
and law, and the page docs/forces.md.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
import warnings
from argparse import Namespace
from pathlib import Path
from typing import Any

import numpy as np

from forces.common_scenes import SCENES, Scene, new_world
from harness import results
from overlapper.simulation import Bodies, VolumetricContact

RESULTS = results.FOLDER / "firsttry.csv"
PAGE = "forces.page"
RATE = 240  # Hz
WINDOW = 0.5  # s at the end
RESTING = 0.005  # m in the window
BELOW = 0.05  # m
LIFTED = 0.1  # m
DRIVEN = 0.2
LIMIT = 150  # s for a scene with one law
SAME = "as Bullet"
PATHS = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}  # of the processes of scenes
MARK = "ends: "  # before what a process of a scene says
LAWS = ("bullet", "volumetric")
COLUMNS = ("scene", "law", "finite", "heights", "moved", "lifted", "driven", "substeps", "ms", "warnings")


def ends(scene: Scene, law: str) -> dict[str, Any]:
    """Runs a scene with one law and says how it ends."""
    world = new_world()
    script = scene.build(world)
    bodies = [world.getBodyUniqueId(index) for index in range(world.getNumBodies())]
    steps = round(scene.seconds * RATE)
    places: list[np.ndarray] = []

    def place() -> np.ndarray:
        return np.array([world.getBasePositionAndOrientation(body)[0] for body in bodies])

    start = place()
    substeps: list[int] = []

    def through(step: Any) -> None:
        for index in range(steps):
            if script.command:
                script.command(index / RATE)
            step()
            if index >= steps - round(WINDOW * RATE):
                places.append(place())

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        before = time.process_time()
        if law == "volumetric":
            with VolumetricContact(Bodies(world._client)) as contact:

                def step() -> None:
                    contact.step()
                    substeps.append(contact.substeps)

                through(step)
        else:
            through(world.stepSimulation)
        taken = time.process_time() - before
    return {
        **figures(bodies, script, start, np.array(places), world),
        "substeps": int(np.median(substeps or [1])),
        "ms": round(taken / steps * 1e3, 3),
        "warnings": " ".join(sorted({each.category.__name__ for each in caught})),
    }


def figures(bodies: list[int], script: Any, start: np.ndarray, places: np.ndarray, world: Any) -> dict[str, Any]:
    """What is judged: `start` (n, 3) and the last `places` (m, n, 3) of the bases."""
    velocities = np.array([np.concatenate(world.getBaseVelocity(body)) for body in bodies])
    if not (np.isfinite(places).all() and np.isfinite(velocities).all()):
        return {"finite": 0}
    moved = np.linalg.norm(places - places[0], axis=2).max(axis=0)
    way = places[-1] - start

    def of(body: int | None, value: np.ndarray) -> float | str:
        return "" if body is None else float(value[bodies.index(body)])

    return {
        "finite": 1,
        "heights": " ".join(f"{height:.4f}" for height in places[-1, :, 2]),
        "moved": " ".join(f"{length:.4f}" for length in moved),
        "lifted": of(script.lifted, way[:, 2]),
        "driven": of(script.driven, np.linalg.norm(way[:, :2], axis=1)),
    }


def resting(row: dict[str, Any]) -> np.ndarray:
    """(n,) whether each body rests."""
    rests: np.ndarray = np.array(row["moved"].split(), dtype=float) < RESTING
    return rests


def fault(bullet: dict[str, Any], ours: dict[str, Any]) -> str:
    """How a scene does not end as Bullet's does, in a few words; nothing if it does."""
    if not int(ours["finite"]):
        return ours.get("warnings") or "not finite"
    found = []
    rest, still = resting(bullet), resting(ours)
    if still.sum() < rest.sum():
        found.append(f"{still.sum()} of {rest.sum()} bodies rest")
    heights, ending = (np.array(row["heights"].split(), dtype=float) for row in (bullet, ours))
    if (below := float((heights - ending)[rest].max(initial=0))) > BELOW:
        found.append(f"a body is {below:.2g} m lower")
    if bullet["lifted"] != "" and float(bullet["lifted"]) > LIFTED >= float(ours["lifted"]):
        found.append(f"the body is lifted by {float(ours['lifted']):.2g} m")
    if bullet["driven"] != "" and abs(float(ours["driven"]) / float(bullet["driven"]) - 1) > DRIVEN:
        found.append(f"the body goes {float(ours['driven']):.2g} m, not {float(bullet['driven']):.2g} m")
    return ", ".join(found)


def in_a_process(name: str, law: str) -> dict[str, Any]:
    """How a scene ends, from a process of its own. A run that fails is not finite, and its warning is the reason."""
    command = [sys.executable, "-m", "forces.firsttry", name, law]
    try:
        said = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT, env=PATHS)
    except subprocess.TimeoutExpired:
        return {"finite": 0, "warnings": f"more than {LIMIT} s"}
    if said.returncode:
        return {"finite": 0, "warnings": said.stderr.strip().splitlines()[-1]}
    # pybullet writes its own messages before and after, at times without an end of line.
    line = next(line for line in said.stdout.splitlines() if line.startswith(MARK))
    found: dict[str, Any] = json.loads(line.removeprefix(MARK))
    return found


def verdict(bullet: dict[str, Any], ours: dict[str, Any]) -> str:
    """`SAME`, the fault, or that Bullet's run is no reference."""
    return (fault(bullet, ours) or SAME) if int(bullet["finite"]) else "no reference"


def measure(chosen: Namespace, path: Path) -> None:
    """Runs all scenes, and writes two lines for each."""
    with results.writing(path, COLUMNS, results.today()) as write:
        for name in SCENES:
            rows = [{"scene": name, "law": law, **in_a_process(name, law)} for law in LAWS]
            write([row.get(column, "") for column in COLUMNS] for row in rows)
            print(f"{name}: {verdict(*rows)}", flush=True)


if __name__ == "__main__":
    print(f"\n{MARK}{json.dumps(ends(SCENES[sys.argv[1]], sys.argv[2]))}", flush=True)
