"""How large a recording is, and what a frame of it costs: a hundred bodies, a thousand steps, every one recorded.

    python benchmarks recording [balls | boxes | mixed]

Times are of the processor, of the page's own thread and of the process that draws in software in place of a graphics
card; so they do not depend on what else the machine does.
"""

from __future__ import annotations

import os
import random
import subprocess
import tempfile
from argparse import ArgumentParser, Namespace
from pathlib import Path

import pybullet as p
from browser import Browser

from harness.timing import Stopwatch
from overlapper.simulation import Bodies
from overlapper.viewer import Recording

BODIES = 100
FRAMES = 20  # shown for the measurement


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
            page_thread, drawing = shown(page, Path(folder, "profile"))
        print(f"  shown, at 1280 x 800: {page_thread:.0f} ms a frame on the page's thread, {drawing:.0f} ms to draw it")


def shown(page: Path, profile: Path) -> tuple[float, float]:
    """ms of the processor for a frame: of the page's own thread, and of the software in place of a graphics card."""
    browser = Browser(profile, size=(1280, 800))
    try:
        browser.open(page.as_uri() + "#t=1", until="document.querySelector('#time output').textContent")
        browser.picture()
        browser("Performance.enable", timeDomain="threadTicks")
        before = thread_seconds(browser), drawing_seconds()
        for _ in range(FRAMES):
            browser.press("ArrowRight")
            browser.ask("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
        after = thread_seconds(browser), drawing_seconds()
    finally:
        browser.close()
    page_thread, drawing = (1e3 * (b - a) / FRAMES for a, b in zip(before, after))
    return page_thread, drawing


def thread_seconds(browser: Browser) -> float:
    return {each["name"]: each["value"] for each in browser("Performance.getMetrics")["metrics"]}["TaskDuration"]


def drawing_seconds() -> float:
    """Processor time of the graphics processes of all Chromiums that this process has started."""
    family, seconds = {os.getpid()}, 0.0
    processes = subprocess.run(["ps", "-eo", "pid=,ppid=,args="], capture_output=True, text=True, check=True).stdout
    rows = sorted((row.split(None, 2) for row in processes.splitlines()), key=lambda row: int(row[0]))
    for number, parent, arguments in rows:
        if int(parent) in family:
            family.add(int(number))
            if "--type=gpu-process" in arguments:
                fields = Path("/proc", number, "stat").read_text().rpartition(")")[2].split()
                seconds += (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return seconds
