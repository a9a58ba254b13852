"""The engine of a Ray cluster on real nodes: the same bits as on one machine, also if a node is killed.

Ray takes long to start, so `make test-slow` passes these tests, and `make test` leaves them out.
"""

import json
import os
import subprocess
import sys
from contextlib import closing

import psutil
import pytest
import ray_nodes
from busy import slowness
from misdeeds import sweep_of_misdeeds
from sweeping import begun, parts

from overlapper.jobs import cluster as cluster_module
from overlapper.jobs.cluster import Cluster
from overlapper.jobs.executor import outcomes
from overlapper.jobs.hand import Job
from overlapper.jobs.worker import NotStarted


@pytest.fixture(autouse=True)
def as_urgent_as_other_processes(monkeypatch):
    """Ray gives its workers a niceness of 15. On a busy machine they would wait longer than the tests allow."""
    monkeypatch.setenv("RAY_worker_niceness", "0")


@pytest.mark.usefixtures("balls")
def test_a_cluster_finds_the_same_bits_while_a_node_is_killed(undisturbed):
    pytest.importorskip("ray")
    nodes = [sys.executable, ray_nodes.__file__]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(nodes, text=True, **pipes) as cluster:
        address = cluster.stdout.readline().strip()
        process = begun("runs", address)
        # The processes of a killed node die with it, the workers too.
        hands = [each for each in psutil.Process(cluster.pid).children(True) if "serve" in " ".join(each.cmdline())]
        cluster.stdin.write("kill\n")
        cluster.stdin.flush()
        assert cluster.stdout.readline() == "killed\n"
        assert 0 < len(parts("runs")) < 60
        assert process.wait(60 * slowness()) == 0
        assert parts("runs") == undisturbed
        # The rest of the cluster reports the same failures of tasks as one machine.
        words = ["sweep", "balls.py", "--grid", "fate=good,raises,hangs in C,dies", "--out", "fates"]
        words += ["--limit", str(8 * slowness())]
        words += ["--engine", "ray", "--address", address, "--json"]
        done = subprocess.run([sys.executable, "-m", "overlapper", *words], capture_output=True, text=True, timeout=600)
        told = json.loads(done.stdout)
        assert (done.returncode, told["done"], told["missing"]) == (1, 1, 0)
        assert {row["fate"]: row["what"] for row in told["failed"]} == {
            "raises": "raised",
            "hangs in C": "hung",
            "dies": "died",
        }
        cluster.stdin.close()
    assert not psutil.wait_procs(hands, timeout=60)[1]


def test_three_nodes_do_thousands_of_items_by_few_references_and_a_broken_installation_is_refused(monkeypatch):
    ray = pytest.importorskip("ray")
    monkeypatch.setattr(cluster_module, "LOSSES", 3)
    most = []
    wait = ray.wait
    monkeypatch.setattr(ray, "wait", lambda references, **how: most.append(len(references)) or wait(references, **how))
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    environment = {**os.environ, "PYTHONPATH": os.path.dirname(ray_nodes.__file__)}  # of what the nodes start
    nodes = [sys.executable, ray_nodes.__file__, "3"]
    with subprocess.Popen(nodes, text=True, env=environment, **pipes) as started:
        with closing(Cluster(started.stdout.readline().strip())) as cluster:
            found = [*outcomes(cluster, Job("jobs", "doing", "x"), [("give", k) for k in range(9000)])]
            assert sorted(number for number, _ in found) == [*range(9000)]
            assert len({outcome.value[2] for _, outcome in found}) == 3 and max(most) <= 6
            broken = Job("jobs", "doing", "x", gather="breaking")
            with pytest.raises(NotStarted, match=r"^the Ray cluster loses objects: "):
                [*cluster.shares(broken, [("give", k) for k in range(9000)])]
        started.stdin.close()


def test_tasks_that_misbehave_are_a_row_each_and_stop_no_other(tmp_path, monkeypatch):
    pytest.importorskip("ray")
    monkeypatch.chdir(tmp_path)
    sweep_of_misdeeds("ray")
