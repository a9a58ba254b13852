"""An audit of pairs of links agrees with the answers of its single configurations."""

from collections import Counter
from contextlib import closing
from math import comb

import numpy as np
import pytest
from robots import DATA, moved, turntable

from overlapper import (
    Box,
    Placed,
    overlap,
)
from overlapper.audit import audit as auditing
from overlapper.audit.audit import audit, wilson
from overlapper.audit.examiner import Examiner, prepared
from overlapper.audit.robot import read_robot
from overlapper.audit.sampling import BLOCK, Sampling
from overlapper.jobs.cluster import Cluster
from overlapper.jobs.hand import Failed
from overlapper.jobs.processes import Processes
from overlapper.simulation import Bodies
from overlapper.simulation.bullet.model_file import load


def by_names(found):
    return {each.names: each for each in found.pairs}


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    return read_robot(turntable(tmp_path_factory.mktemp("robots") / "table.urdf"))


def edge(lower, upper):
    """The angle between the two at which the arm begins to touch the wall, or ceases to."""

    def touches(angle):
        turn = np.array([0, 0, np.sin(angle / 2), np.cos(angle / 2)])
        arm = Placed(Box((0.1, 0.1, 0.1)), (np.cos(angle), np.sin(angle), 0.2), turn)
        return bool(overlap(arm, Placed(Box((0.1, 0.1, 0.1)), (0, 1, 0.2))))

    assert touches(lower) != touches(upper)
    for _ in range(60):
        middle = (lower + upper) / 2
        lower, upper = (middle, upper) if touches(middle) == touches(lower) else (lower, middle)
    return lower


def test_an_arm_runs_into_a_wall_as_often_as_its_angle_says(table):
    found = audit(table, 3 * BLOCK)
    pair = by_names(found)["arm", "wall"]
    begins, ends = edge(1.0, np.pi / 2), edge(np.pi / 2, 2.2)
    angles = np.concatenate([found.sampling.block(k) for k in range(len(found.sampling.blocks))])[:, 0]
    assert (pair.status, pair.asked) == ("sometimes", 3 * BLOCK)
    assert pair.met == ((angles > begins) & (angles < ends)).sum()
    fraction, low, high = pair.fraction
    assert low < (ends - begins) / 6 < high and low < fraction < high
    # The largest volume, where the angle is nearest to a right one, is nearly all of the wall.
    assert angles[pair.largest.number] == pair.largest.values[0] == angles[np.abs(angles - np.pi / 2).argmin()]
    assert pair.largest.contact.volume == pytest.approx(0.008, rel=0.01)
    assert pair.deepest.contact.depth == pytest.approx(0.2, rel=0.01)


def test_links_are_adjacent_if_a_joint_or_a_link_without_a_shape_connects_them(table):
    found = by_names(audit(table, 2 * BLOCK))
    adjacent = {names for names, each in found.items() if each.pair.adjacent}
    assert adjacent == {("post", "disc"), ("disc", "arm"), ("post", "wall"), ("post", "plate")}
    assert {names for names, each in found.items() if each.status == "always"} == {("arm", "plate"), ("wall", "plate")}
    assert found["arm", "plate"].largest.contact.volume == pytest.approx(0.2 * 0.2 * 0.02)
    assert found["arm", "plate"].deepest.contact.depth == pytest.approx(0.04)
    # Pairs that no joint moves are asked at rest only. Adjacent pairs are asked in few configurations.
    assert {names for names, each in found.items() if each.asked == 1} == {
        ("disc", "arm"), ("post", "wall"), ("post", "plate"), ("wall", "plate"),
    }  # fmt: skip
    assert found["wall", "plate"].fraction is None
    assert found["post", "disc"].asked == 3 + 512 and found["post", "arm"].asked == 2 * BLOCK


def test_overlaps_below_the_depth_limit_are_not_counted(table):
    assert by_names(audit(table, 100, least_depth=0.039))["arm", "plate"].status == "always"
    assert by_names(audit(table, 100, least_depth=0.041))["arm", "plate"].status == "never"


def test_processes_do_not_change_a_bit(table, monkeypatch):
    monkeypatch.setattr(auditing, "FEW", 0)
    one, two = (audit(table, 2 * BLOCK + 100, seed=3, engine=engine) for engine in (None, Processes(2)))
    for a, b in zip(one.pairs, two.pairs, strict=True):
        assert (a.names, a.met, a.asked, a.fraction) == (b.names, b.met, b.asked, b.fraction)
        if a.largest:
            assert (a.largest.number, a.deepest.number) == (b.largest.number, b.deepest.number)
            assert a.largest.contact.volume == b.largest.contact.volume


def test_a_cluster_finds_the_same_audit(table, monkeypatch):
    pytest.importorskip("ray")
    monkeypatch.setattr(auditing, "FEW", 0)
    with closing(Cluster()) as cluster:
        far = audit(table, BLOCK + 100, seed=3, engine=cluster)
    here = audit(table, BLOCK + 100, seed=3)
    assert [(each.names, each.met) for each in far.pairs] == [(each.names, each.met) for each in here.pairs]


def test_a_failed_block_is_reported(table, monkeypatch):
    class Broken:
        workers = 1

        def shares(self, job, items, limit=None, late=None):
            yield [7], [Failed("died", "its process ended with signal SIGKILL", "words")]

    monkeypatch.setattr(auditing, "FEW", 0)
    with pytest.raises(
        RuntimeError, match=r"^block 7 of configurations failed: its process ended with signal SIGKILL\nwords$"
    ):
        audit(table, 10, engine=Broken())


@pytest.mark.parametrize(
    "path",
    [DATA / "kuka_iiwa" / "model.urdf", DATA / "humanoid" / "humanoid.urdf", DATA / "laikago" / "laikago.urdf"],
    ids=lambda path: path.name,
)
def test_pairs_are_those_that_pybullet_and_bodies_find_one_configuration_at_a_time(path, client):
    robot = read_robot(path)
    found = audit(robot, 150)
    load(path, client)
    bodies = Bodies(client)
    met, largest = Counter(), Counter()
    for number in range(150):
        moved(robot, client, found.sampling.configuration(number))
        bodies.update()
        contacts = [each for each in bodies.overlaps(pairs=[(0, 0)]) if each.overlap]
        volumes = Counter()
        for each in contacts:
            volumes[each.linkA + 1, each.linkB + 1] += each.overlap.volume
        met.update(volumes.keys())
        largest |= volumes
    for each in found.pairs:
        if each.asked == 150:
            assert each.met == met[each.pair.links]
            if each.met and len(each.largest.contact.contacts) == 1:
                assert each.largest.contact.volume == pytest.approx(largest[each.pair.links], rel=1e-9)
    assert sum(each.status == "sometimes" for each in found.pairs) > 3


def test_intervals_are_those_of_wilson():
    # The bounds are where the observed fraction is 1.96 standard deviations of theirs away.
    for met, asked in ((3, 20), (50, 100), (1, 100_000)):
        fraction, low, high = wilson(met, asked)
        assert fraction == met / asked
        for bound in (low, high):
            deviation = np.sqrt(bound * (1 - bound) / asked)
            assert abs(fraction - bound) / deviation == pytest.approx(1.959964, rel=1e-6)
    assert wilson(0, 10)[:2] == (0, 0) and wilson(10, 10)[2] == 1
    # As Clopper and Pearson have it, 0 of 10 is seen in less than 2.5 % of what is more likely than that.
    assert comb(10, 0) * (1 - wilson(0, 10)[2]) ** 10 < 0.05


def test_an_examiner_gives_the_same_answers_twice(table):
    examiner = Examiner(table, Sampling(table, BLOCK, 0))
    first, second, again = examiner(1), examiner(1), prepared(examiner.setup)(1)
    for tally in (second, again):
        assert (tally.met == first.met).all() and (tally.volume.value == first.volume.value).all()


def test_an_examiner_of_few_pairs_counts_the_same_for_these():
    robot = read_robot(DATA / "franka_panda/panda.urdf")
    sampling = Sampling(robot, 2000, 0)
    every = Examiner(robot, sampling)
    few = Examiner(robot, sampling, pairs=every.pairs[20:45:2])
    met, of_few = every(1).met[20:45:2], few(1).met
    assert of_few.any() and (of_few == met).all() and (prepared(few.setup)(1).met == met).all()
