"""A sweep does the missing tasks, reports failures, and can be killed without a loss."""

import random
import signal
import time

import numpy as np
import psutil
import pytest
from sweeping import SLOW, begun, parts, rows, swept

pytestmark = pytest.mark.usefixtures("balls")

GRID = ["apart=0.05:0.25:5", "seed=0,1,2,3"]


def cap(apart, radius=0.1):
    """The volume that two balls share."""
    return np.pi * (2 * radius - apart) ** 2 * (apart**2 + 4 * apart * radius) / 12 / apart if apart < 2 * radius else 0


def test_every_point_is_a_row_with_what_its_run_came_to_and_is_done_once():
    reached = swept("runs", GRID)
    assert (reached.total, reached.done, reached.before, reached.failed, reached.missing) == (20, 20, 0, 0, 0)
    found = rows("runs")
    assert len(found) == 20 and len({row["task"] for row in found}) == 20
    for row in found:
        apart = row["apart"] + 1e-3 * row["seed"]
        assert row["largest_volume_m3"] == pytest.approx(cap(apart), rel=1e-9)
        assert row["mean_volume_m3"] == pytest.approx(cap(apart), rel=1e-9)
        assert row["largest_depth_m"] == pytest.approx(max(0.2 - apart, 0), abs=1e-12)
        assert row["contact_time_s"] == pytest.approx(3 / 240 if apart < 0.2 else 0)
        # One pascal on the disc of the lens, which pushes the first ball away from the second.
        disc = np.pi * (0.1**2 - apart**2 / 4) if apart < 0.2 else 0
        assert (row["mean_force_x_m2"] or 0) == pytest.approx(-disc, rel=1e-6)
        assert abs(row["mean_torque_z_m3"] or 0) < 1e-9
        names = ("box",) if not disc else (row["worstA"], row["worstB"])
        assert (row["worstA"] is None) == (disc == 0) and len(set(names)) == len(names)
        assert row["worst_step"] == (1 if disc else None) == row["deepest_step"]
    # More points are more tasks; none of those that are there is done again.
    more = swept("runs", [GRID[0], "seed=0,1,2,3,4"])
    assert (more.total, more.before, more.done) == (25, 20, 5)


def test_the_bits_are_the_same_however_many_processes_there_are():
    for workers in (1, 2):
        swept(f"by{workers}", GRID, workers, kept=1)
    assert parts("by1") == parts("by2") and len(parts("by1")) == 20
    assert parts("by1", "steps") == parts("by2", "steps")


def test_steps_are_kept_on_request():
    swept("runs", ["seed=3", "apart=0.1,0.3"], kept=2, steps=5)
    found = rows("runs", "steps")
    assert [(row["step"], row["apart"], row["seed"]) for row in found] == [(2, 0.1, 3), (4, 0.1, 3)]
    assert found[0]["volume_m3"] == pytest.approx(cap(0.103))
    assert {row["task"] for row in found} < {row["task"] for row in rows("runs")}


def test_each_reader_reads_the_sweep_as_one_table():
    duckdb = pytest.importorskip("duckdb")
    import pandas
    import polars

    swept("runs", ["apart=0.1,0.15"])
    assert len(pandas.read_parquet("runs/tasks.parquet")) == 2
    assert polars.scan_parquet("runs/tasks.parquet").collect()["apart"].sort().to_list() == [0.1, 0.15]
    assert duckdb.sql("SELECT max(apart) FROM 'runs/tasks.parquet/*.parquet'").fetchall() == [(0.15,)]


def test_a_task_that_raises_or_dies_is_a_row_of_failures_and_stops_nobody():
    fates = ["fate=good,raises,dies,dies once"]
    reached = swept("runs", fates)
    assert (reached.done, reached.failed, reached.missing) == (2, 2, 0)
    failures = {row["fate"]: row for row in rows("runs", "failures")}
    assert {fate: row["what"] for fate, row in failures.items()} == {"raises": "raised", "dies": "died"}
    assert failures["raises"]["sentence"].endswith("cannot be built at line 19: ValueError: apart must be more")
    assert failures["dies"]["sentence"] == "its process ended with signal SIGABRT"
    for row in failures.values():
        assert 'balls.py", line ' in row["traceback"] and " in build" in row["traceback"]
    # They are tried again only when that is asked for.
    again = swept("runs", fates)
    assert (again.before, again.done, again.failed, again.failed_before, again.missing) == (2, 0, 0, 2, 0)
    again = swept("runs", ["fate=good,raises"], retry=True)
    assert (again.before, again.done, again.failed, again.failed_before) == (1, 0, 1, 0)


def test_a_task_that_hangs_is_a_row_of_failures():
    reached = swept("runs", ["fate=hangs,hangs in C"], limit=1.0)
    assert (reached.done, reached.failed) == (0, 2)
    for row in rows("runs", "failures"):
        assert (row["what"], row["sentence"]) == ("hung", "it took longer than 1 s")
        assert 'balls.py", line ' in row["traceback"] and " in build" in row["traceback"]


def settled(folder):
    """Some moment after it has begun."""
    process = begun(folder)
    time.sleep(random.uniform(0, 0.3))
    return process


@pytest.mark.parametrize("again", range(2))
def test_a_sweep_that_is_killed_goes_on_with_the_same_bits(undisturbed, again):
    process = settled("runs")
    workers = psutil.Process(process.pid).children()
    process.kill()
    assert process.wait() == -signal.SIGKILL and len(workers) == 2
    there = parts("runs")
    assert 0 < len(there) < 60 and there.items() <= undisturbed.items()
    # Nobody works on behind the next sweep's back.
    assert not psutil.wait_procs(workers, timeout=20)[1]
    reached = swept("runs", SLOW)
    assert (reached.before, reached.done) == (len(there), 60 - len(there))
    assert parts("runs") == undisturbed


@pytest.mark.parametrize("again", range(2))
def test_a_sweep_finishes_with_the_same_bits_after_one_process_is_killed(undisturbed, again):
    process = settled("runs")
    random.choice(psutil.Process(process.pid).children()).kill()
    assert process.wait() == 0
    assert parts("runs") == undisturbed and rows("runs", "tasks")
