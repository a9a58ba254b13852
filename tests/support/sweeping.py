"""A scene for sweeps, of milliseconds, and what there is to say of a sweep's folder.

python sweeping.py OUT [ADDRESS] sweeps balls.py with two processes, or on a Ray cluster, to be killed meanwhile.
"""

import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import pyarrow.parquet

# Two balls that are pushed into each other: how far, and what becomes of the process, are parameters.
BALLS = '''
"""Two balls, so far apart."""
import ctypes, os, pathlib, time
import pybullet as p

STEPS = 3
PAIRS = "all"  # a filter keeps them where they are


def build(client, *, apart=0.15, seed=0, fate="good", seconds=0.0):
    time.sleep(seconds)
    ball = p.createCollisionShape(p.GEOM_SPHERE, radius=0.1, physicsClientId=client)
    p.createMultiBody(0, ball, physicsClientId=client)
    p.createMultiBody(1, ball, basePosition=[apart + 1e-3 * seed, 0, 0], physicsClientId=client)
    p.setCollisionFilterPair(0, 1, -1, -1, 0, physicsClientId=client)
    p.setGravity(0, 0, 0, physicsClientId=client)
    print("a scene may talk")
    if fate == "raises":
        raise ValueError("apart must be more")
    if fate == "dies":
        os.abort()
    if fate == "hangs":
        time.sleep(600)
    if fate == "hangs in C":
        ctypes.PyDLL(None).sleep(600)  # which gives no other thread of Python a turn
    if fate == "dies once" and not pathlib.Path("died").exists():
        pathlib.Path("died").touch()
        os.kill(os.getpid(), 9)
'''

# Sixty tasks, slow enough that a kill comes in the middle of them.
SLOW = ["apart=0.05:0.25:20", "seed=0,1,2", "seconds=0.06"]


def sweep_of(grids, kept=0, steps=3):
    """The sweep of balls.py over some grids."""
    from overlapper.sweep.points import Space
    from overlapper.sweep.study import Study
    from overlapper.sweep.sweep import Sweep

    study = Study.of(Path("balls.py"), steps, kept=kept)
    space = Space("balls", study.loaded().parameters)
    return Sweep(study, space.crossed([space.grid(each) for each in grids]))


def swept(folder, grids, workers=2, kept=0, steps=3, limit=None, retry=False, engine=None):
    """The outcome of a sweep that runs in the folder."""
    from overlapper.jobs.processes import Processes

    sweep = sweep_of(grids, kept, steps)
    with sweep.opened(Path(folder)) as store:
        return sweep.run(store, engine or Processes(workers), limit, retry)


def begun(folder, *address):
    """A process that sweeps SLOW, and has done some tasks, and not yet half of them."""
    process = subprocess.Popen([sys.executable, __file__, folder, *address])
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and not (Path(folder, "tasks.parquet").is_dir() and parts(folder)):
        assert process.poll() is None
        time.sleep(0.005)
    return process


def parts(folder, table="tasks"):
    """The bytes of each part of a table, by its name."""
    return {part.stem: part.read_bytes() for part in sorted(Path(folder, f"{table}.parquet").glob("*.parquet"))}


def rows(folder, table="tasks"):
    """All rows of a table, as any reader of Parquet has them."""
    return pyarrow.parquet.read_table(Path(folder, f"{table}.parquet")).to_pylist()


def main(folder, address=None):
    engine = None
    if address:
        from overlapper.jobs.cluster import Cluster

        engine = Cluster(address)
        with closing(engine):
            swept(folder, SLOW, engine=engine)
        return
    swept(folder, SLOW)


if __name__ == "__main__":
    main(*sys.argv[1:])
