"""The engine of a Ray cluster, on an imitation of Ray that loses what it is told to lose."""

import sys
import types
from contextlib import closing

import pytest

from overlapper.jobs import cluster as cluster_module
from overlapper.jobs import patience
from overlapper.jobs.cluster import LOSSES, Cluster
from overlapper.jobs.executor import outcomes
from overlapper.jobs.hand import Done, Job
from overlapper.jobs.worker import NotStarted


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
