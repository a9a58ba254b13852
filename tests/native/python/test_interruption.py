"""Ctrl-C ends any long computation within a second, and the next answer is right."""

import multiprocessing
import os
import pickle
import signal
import threading
import time
from copy import copy
from functools import partial
from operator import attrgetter

import numpy as np
import pytest

from overlapper import Batch, Box, Capsule, Cylinder, Hull, Placed, RoundedHull, Sphere, overlap

HANG = 240  # s

TURNED = (0.1, 0.2, 0.3, 0.9)


def ball(count):
    points = np.random.default_rng(0).normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1)[:, None]


def clump(count):
    rng = np.random.default_rng(1)
    return [Placed(ROUND[0], rng.normal(size=3) * 1e-3, rng.normal(size=4)) for _ in range(count)]


# The hulls of balls of many points, in the process that is interrupted.
ROUND, LARGE = [], []


def hull(count=300_000):
    points = ball(count)
    return lambda: Hull(points)


def rounded_hull():
    points = ball(300_000)
    return lambda: RoundedHull(points, 0.1)


def points_for_a_hull():
    points = ball(300_000)
    return lambda: overlap(points, Sphere(1))


def unpickled_hull():
    text = pickle.dumps(ROUND[0])
    return lambda: pickle.loads(text)


def shared(count, method="auto"):
    bodies = clump(count)
    return lambda: overlap(*bodies, method=method).volume


def of_a_pair(ask):
    common = overlap(*clump(2))
    assert common.volume > 0
    return lambda: ask(common)


def proof(common):
    return common.certificate().verify()


def traced_pair():
    a = Placed(LARGE[0], (0.01, 0.02, 0.005), TURNED)
    return lambda: overlap(LARGE[0], a).volume


def errors_beside_a_ball():
    common = overlap(ROUND[0], Placed(Sphere(1), (0.01, 0.02, 0.005)))
    assert common.volume > 0
    return lambda: common.errors


def finely_rounded(other):
    """A rounded hull and a shape across a good part of it, or what a function makes of the hull."""
    a = RoundedHull(ball(20_000), 0.05)
    b = Placed(other(a) if callable(other) else other, (0.7, 0.1, 0.05), TURNED)
    return lambda: overlap(a, b).volume


def errors_of_rounded_hulls():
    a = RoundedHull(ball(20_000), 0.05)
    common = overlap(a, Placed(a, (0.7, 0.1, 0.05), TURNED))
    return lambda: common.errors


def round_bodies_to_a_fine_tolerance():
    bodies = Capsule(1, 1), Placed(Cylinder(1, 1), (0.3, 0.2, 0.1), TURNED)
    return lambda: overlap(*bodies, tolerance=1e-7).vertices


def one_long_row(threads=1):
    batch, bodies = Batch(ROUND * 4), clump(4)
    poses = [body.position for body in bodies], [body.orientation for body in bodies]
    return lambda: batch.overlaps(*poses, threads=threads)


def many_boxes(ask):
    batch, places = Batch([Box([1, 1, 1])] * 20_000), np.random.default_rng(2).uniform(0, 1, (20_000, 3))
    return lambda: ask(batch)(places, [TURNED] * len(places))


JOBS = {
    "hull": hull,
    "rounded hull": rounded_hull,
    "points for a hull": points_for_a_hull,
    "unpickled hull": unpickled_hull,
    "pair": partial(shared, 2),
    "traced pair": traced_pair,
    "group": partial(shared, 4),
    "group by the article": partial(shared, 5, "paper"),
    "polytope": partial(of_a_pair, attrgetter("vertices")),
    "errors": partial(of_a_pair, attrgetter("errors")),
    "errors beside a ball": errors_beside_a_ball,
    "certificate": partial(of_a_pair, proof),
    "rounded hull and ball": partial(finely_rounded, Sphere(1)),
    "rounded hull and cylinder": partial(finely_rounded, Cylinder(0.5, 1)),
    "rounded hull and its core": partial(finely_rounded, attrgetter("core")),
    "rounded hulls": partial(finely_rounded, copy),
    "errors of rounded hulls": errors_of_rounded_hulls,
    "round bodies to a fine tolerance": round_bodies_to_a_fine_tolerance,
    "one long row": one_long_row,
    "long rows of many threads": partial(one_long_row, 8),
    "pairs of boxes": partial(many_boxes, attrgetter("candidate_pairs")),
    "overlaps before the first pair": partial(many_boxes, attrgetter("overlaps")),
}


def prepare():
    ROUND.append(Hull(ball(50_000)))
    LARGE.append(Hull(ball(300_000)))


@pytest.fixture(scope="module")
def another_process():
    """One for all tests: what they start with takes longer than what they ask."""
    with multiprocessing.get_context("spawn").Pool(1, prepare) as pool:
        yield lambda function, *arguments: pool.apply_async(function, arguments).get(timeout=HANG)


def presses(job):
    """Seconds of the processor from Ctrl-C to the exception at several moments, and whether another answer is right."""
    late = []
    for moment in (0.02, 0.3):
        work = job()
        pressed = []

        def press(pressed=pressed):
            pressed.append(time.process_time())
            os.kill(os.getpid(), signal.SIGINT)

        timer = threading.Timer(moment, press)
        try:
            timer.start()
            work()
            timer.cancel()
            timer.join()
        except KeyboardInterrupt:
            late.append(time.process_time() - pressed[0])
    right = overlap(Placed(ROUND[0]), Box([2, 2, 2])).volume == pytest.approx(ROUND[0].volume, rel=1e-12)
    return late, right


@pytest.mark.parametrize("job", JOBS.values(), ids=JOBS)
def test_ctrl_c_is_answered_within_a_second(another_process, job):
    late, right = another_process(presses, job)
    assert late
    assert max(late) < 1
    assert right


def coarsely_rounded_hulls():
    a, b = RoundedHull(ball(300), 0.05), RoundedHull(ball(200), 0.1)
    pairs = [(a, Placed(b, (x, 0.1, 0.05), TURNED)) for x in np.linspace(1.2, 1.3, 20)]
    # The volume has a closed form. Slices measure the area, which takes tens of times as long.
    return lambda: [(found.volume, found.area) for found in (overlap(*pair) for pair in pairs)]


def handled(long, short):
    """Answers of a long computation and of a signal handler that interrupts it, and the answers of both alone."""
    found, compute, meanwhile = [], long(), short()
    alone = meanwhile()
    signal.signal(signal.SIGALRM, lambda *_: found.append(meanwhile()))
    signal.setitimer(signal.ITIMER_REAL, 0.05)
    return compute(), long()(), found, alone


@pytest.mark.parametrize(
    ("long", "short"),
    [
        (partial(shared, 3), partial(shared, 2)),
        (traced_pair, partial(shared, 2)),
        (coarsely_rounded_hulls, coarsely_rounded_hulls),
    ],
)
def test_a_signal_handler_may_compute_while_something_else_is_computed(another_process, long, short):
    volume, again, found, alone = another_process(handled, long, short)
    assert volume == again
    assert found == [alone]


def beats(job):
    """How often another thread gets its turn while one computes, per second."""
    work, count, stop = job(), [0], threading.Event()

    def beat():
        while not stop.wait(0.01):
            count[0] += 1

    other = threading.Thread(target=beat)
    other.start()
    start = time.perf_counter()
    work()
    spent = time.perf_counter() - start
    stop.set()
    other.join()
    return count[0] / spent


def test_other_threads_run_while_a_hull_is_made(another_process):
    assert another_process(beats, partial(hull, 80_000)) > 10
