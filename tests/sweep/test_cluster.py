"""The engine of a Ray cluster: the same bits as on one machine, also if a node is killed."""

import json
import os
import subprocess
import sys
import types
from contextlib import closing

import psutil
import pytest
import ray_nodes
from busy import slowness
from sweeping import begun, parts

from overlapper.jobs import cluster as cluster_module
from overlapper.jobs import patience
from overlapper.jobs.cluster import LOSSES, Cluster
from overlapper.jobs.executor import outcomes
from overlapper.jobs.hand import Done, Job
from overlapper.jobs.worker import NotStarted


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


class Ray(types.ModuleType):
    """A cluster of one machine that loses the first so many shares."""

    def __init__(self, lost=0):
        super().__init__("ray")
        self.lost, self.cancelled, self.cpus, self.most = lost, [], 2.0, 0
        self.exceptions = types.SimpleNamespace(RayError=ConnectionError, RayTaskError=KeyError)

    def init(self, address, **_):
        if address == "nowhere:1":
            raise ConnectionError("nobody is there.\nAt all")

    def cluster_resources(self):
        return {"CPU": self.cpus}

    def nodes(self):
        return [{"Alive": True, "Resources": {"CPU": self.cpus / 2}}, {"Alive": True, "Resources": {}}] * 2

    def put(self, value):
        return value

    def remote(self, **_):
        return lambda function: types.SimpleNamespace(remote=lambda *arguments: Share(function, arguments))

    def wait(self, shares, num_returns, timeout):
        self.most = max(self.most, len(shares))
        return shares[:num_returns], shares[num_returns:]

    def get(self, share):
        if self.lost:
            self.lost -= 1
            raise ConnectionError("the node died.")
        try:
            return share.function(*share.arguments)
        except NotStarted as error:
            failed = KeyError()
            failed.cause = error
            raise failed from error

    def cancel(self, share, force):
        self.cancelled.append(share)

    def shutdown(self):
        pass


class Share:
    def __init__(self, function, arguments):
        self.function, self.arguments = function, arguments


@pytest.fixture
def ray(monkeypatch):
    module = Ray()
    monkeypatch.setitem(sys.modules, "ray", module)
    return module


def test_a_share_that_takes_very_long_is_told_once(ray, monkeypatch):
    monkeypatch.setattr(patience, "LATE", -1.0)
    told = []
    with (
        closing(Cluster()) as cluster,
        closing(
            cluster.shares(
                Job("jobs", "doing", "x"), [("give", k) for k in range(3)], late=lambda *late: told.append(late)
            )
        ) as shares,
    ):
        assert sorted(number for numbers, _ in shares for number in numbers) == [0, 1, 2]
    assert sorted(number for numbers, _ in told for number in numbers) == [0, 1, 2]
    assert all(seconds >= 0 for _, seconds in told)


def test_shares_that_are_lost_are_sent_once_more(ray):
    ray.lost = 3
    with closing(Cluster()) as cluster:
        assert cluster.workers == 2
        found = [*outcomes(cluster, Job("jobs", "doing", "x"), [("give", k) for k in range(30)])]
    assert sorted((number, outcome.value[1]) for number, outcome in found) == [(k, k) for k in range(30)]
    assert all(isinstance(outcome, Done) for _, outcome in found)


def test_a_cluster_that_loses_every_task_is_refused(ray):
    ray.lost, ray.cpus = LOSSES + 1, 64_000.0
    with (
        closing(Cluster()) as cluster,
        pytest.raises(NotStarted, match=r"^the Ray cluster loses objects: "),
    ):
        [*outcomes(cluster, Job("jobs", "doing", "x"), [("give", k) for k in range(5000)])]
    assert ray.cancelled and not ray.lost


def test_a_large_cluster_is_sent_shares_for_several_cpus_each(ray, monkeypatch):
    monkeypatch.setattr(cluster_module, "CREWS", 4)
    ray.cpus, ray.lost = 16.0, LOSSES
    with closing(Cluster()) as cluster:
        found = [*outcomes(cluster, Job("jobs", "doing", "x"), [("give", k) for k in range(60)])]
    assert sorted((number, outcome.value[1]) for number, outcome in found) == [(k, k) for k in range(60)]
    assert ray.most == 2 * 4
    assert len({outcome.value[2] for _, outcome in found}) == 4  # processes, of the one node that there is


def test_a_job_that_cannot_be_prepared_is_refused(ray):
    words = r"^a worker process could not be prepared: there is no such thing$"
    with closing(Cluster()) as cluster, pytest.raises(NotStarted, match=words):
        [*outcomes(cluster, Job("jobs", "doing", "never"), [("give", 1)])]


def test_a_missing_cluster_is_refused(ray):
    with pytest.raises(NotStarted, match=r"^there is no Ray cluster at nowhere:1: nobody is there$"):
        Cluster("nowhere:1")


def test_the_engine_names_what_is_to_be_installed(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ImportError, match=r"^the engine 'ray' needs ray: pip install ray$"):
        Cluster()
