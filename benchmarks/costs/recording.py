"""How large a recording is, and what a frame of it costs: a hundred bodies, a thousand steps, every one recorded.

    python benchmarks recording [balls | boxes | mixed]

Times are of the processor, so that other processes do not count.
"""

from __future__ import annotations

import random
import tempfile
from argparse import ArgumentParser, Namespace
from pathlib import Path

import pybullet as p

from harness.timing import Stopwatch
from overlapper.simulation import Bodies
from overlapper.viewer import Recording

BODIES = 100


def build(kind: str) -> int:
    chance = random.Random(1)
    client = p.connect(p.DIRECT)
    p.setGravity(0, 0, -9.81)
    p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE))
    for x, y in ((0.6, 0), (-0.6, 0), (0, 0.6), (0, -0.6)):
        wall = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.02 if x else 0.6, 0.02 if y else 0.6, 0.3])
        p.createMultiBody(0, wall, basePosition=[x, y, 0.3])
    for k in range(BODIES - 5):
        if kind == "balls" or (kind == "mixed" and k % 2):
            shape = p.createCollisionShape(p.GEOM_SPHERE, radius=0.08)
        else:
            shape = p.createCollisionShape(p.GEOM_BOX, halfExtents=[chance.uniform(0.04, 0.12) for _ in range(3)])
        place = [chance.uniform(-0.45, 0.45), chance.uniform(-0.45, 0.45), 0.2 + 0.02 * k]
        turn = p.getQuaternionFromEuler([chance.uniform(-3, 3) for _ in range(3)])
        body = p.createMultiBody(0.5, shape, -1, place, turn)
        p.changeDynamics(body, -1, contactStiffness=5e3, contactDamping=20)  # soft, so that much is shared
    return client


def options(parser: ArgumentParser) -> None:
    parser.add_argument("kinds", nargs="*", default=["boxes", "mixed", "balls"], metavar="balls | boxes | mixed")
    parser.add_argument("--steps", type=int, default=1000, help="that are made and recorded")


def main(chosen: Namespace) -> None:
    for kind in chosen.kinds:
        client, watch = build(kind), Stopwatch()
        bodies, recording, shared = Bodies(client), Recording(), 0
        for step in range(chosen.steps):
            p.stepSimulation(client)
            bodies.update()
            contacts = [contact for contact in bodies.overlaps() if contact.overlap]
            shared += len(contacts)
            watch("a frame", recording.add, bodies, contacts, step / 240)
        p.disconnect(client)
        with tempfile.TemporaryDirectory() as folder:
            page = watch("saving", recording.save, Path(folder, "recording.html"))
            us, size = watch.take(), page.stat().st_size / 1e6
            print(f"{kind}: {BODIES} bodies, {chosen.steps} frames, {shared:,} overlaps: {size:.1f} MB", flush=True)
            frame = us["a frame"] / 1e3 / chosen.steps
            print(f"  recorded: {frame:.0f} ms a frame, and {us['saving'] / 1e6:.0f} s to save", flush=True)
