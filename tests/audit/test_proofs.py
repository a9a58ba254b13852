"""Proofs over all joint positions: robots whose truth is known by hand, and covers that are wrong."""

import math
import sys
from dataclasses import replace

import numpy as np
import pytest
from robots import DATA, INERTIAL, joint, limit, link, mimic, urdf

from overlapper import HalfSpace
from overlapper.audit.audit import audit
from overlapper.audit.cover_file import verify, write_covers
from overlapper.audit.findings import findings
from overlapper.audit.prove import Prover, chain_between, prove
from overlapper.audit.robot import read_robot
from overlapper.audit.srdf import read_srdf, write_srdf
from overlapper.audit.table import facts
from overlapper.jobs.hand import Failed
from overlapper.jobs.processes import Processes

REACH = 2 * math.cos(1.0)  # of the two-link arm with an elbow of 2 rad: from the base to the tip


def ball(name, radius, centre):
    shape = f'<collision><origin xyz="{centre}"/><geometry><sphere radius="{radius}"/></geometry></collision>'
    return f'<link name="{name}">{INERTIAL}{shape}</link>'


def arm(path, radius, elbow=2.0):
    """Two links of 1 m with a ball at the base and at the tip. The tip is 2 cos(q / 2) from the base."""
    return read_robot(
        urdf(
            path / "arm.urdf",
            ball("base", radius, "0 0 0"),
            ball("upper", 0.05, "0.5 0 0"),
            ball("lower", radius, "1 0 0"),
            joint("shoulder", "continuous", "base", "upper"),
            joint("elbow", "revolute", "upper", "lower", limit(-elbow, elbow), "1 0 0"),
        )
    )


def slider(path, axis, gap, more=""):
    """A box that slides beside a box of the base along an axis, `gap` metres from it at 0."""
    return read_robot(
        urdf(
            path / "slider.urdf",
            link("base", ("1 1 1", "0 0 0")),
            link("post", ("0.1 0.1 0.1", "0 0 5")),
            link("sledge", ("1 1 1", f"{1 + gap} 0 0")),
            joint("bolts", "fixed", "base", "post"),
            joint("rail", "prismatic", "post", "sledge", limit(0, 1) + more, axis=axis),
        )
    )


def answer(robot, names, limit=20_000, configurations=40):
    return {each.names: each for each in prove(audit(robot, configurations), limit)}[names]


@pytest.fixture
def proved(tmp_path):
    """The robot, its audit, the proof of base and lower, and the file of its covers."""
    robot = arm(tmp_path, 0.5)
    found = audit(robot, 40)
    proofs = prove(found, 20_000)
    write_covers(robot, proofs, tmp_path / "covers.npz")
    return robot, replace(found, proofs={each.pair.links: each for each in proofs}), proofs, tmp_path / "covers.npz"


@pytest.mark.parametrize("share", [0.5, 0.99, 0.9999])
def test_a_two_link_arm_never_reaches_its_base_below_the_reach_of_its_tip(tmp_path, share):
    proof = answer(arm(tmp_path, share * REACH / 2), ("base", "lower"))
    assert (proof.verdict, proof.open_share, proof.why) == ("never", 0.0, "")
    assert (1 - share) * REACH <= proof.least + 1e-12


def test_a_two_link_arm_reaches_its_base_above_the_reach_of_its_tip(tmp_path):
    robot = arm(tmp_path, 1.001 * REACH / 2)
    proof = answer(robot, ("base", "lower"))
    assert proof.verdict == "overlaps"
    assert 2 * math.cos(proof.values[robot.columns.index("elbow")] / 2) < 1.001 * REACH


def test_the_search_finds_an_overlap_that_no_sample_had(tmp_path):
    # Only an elbow within 4 mrad of half a turn brings the tip to the base, and no corner of the limits is there.
    robot = arm(tmp_path, 0.001, elbow=4.0)
    found = audit(robot, 5)
    (sampled,) = (each for each in found.pairs if not each.pair.adjacent)
    assert sampled.status == "never"
    (proof,) = prove(found, 20_000)
    assert proof.verdict == "overlaps" and abs(abs(proof.values[1]) - math.pi) < 0.0021
    found = replace(found, proofs={sampled.pair.links: proof})
    assert "base are" in " ".join(findings(found, [], {frozenset(sampled.names): "User"})).replace(" and lower", "")
    assert findings(found, [], {}) == []
    write_srdf(found, tmp_path / "arm.srdf")
    assert frozenset(("base", "lower")) not in read_srdf(tmp_path / "arm.srdf")


def test_boxes_that_touch_at_the_end_of_a_rail_are_open_there_only(tmp_path):
    proof = answer(slider(tmp_path, "1 0 0", 0), ("base", "sledge"), limit=60)
    assert proof.verdict == "open" and 0 < proof.open_share < 1e-6 and 0 < proof.least < 1e-6


def test_boxes_that_touch_along_a_rail_are_open_everywhere(tmp_path):
    proof = answer(slider(tmp_path, "0 1 0", 0), ("base", "sledge"), limit=300)
    assert (proof.verdict, proof.open_share, proof.least) == ("open", 1.0, 0.0)


def test_boxes_a_micrometre_apart_along_a_rail_never_overlap(tmp_path):
    proof = answer(slider(tmp_path, "0 1 0", 1e-6), ("base", "sledge"))
    assert (proof.verdict, proof.boxes) == ("never", 1)


def test_a_limit_leaves_pairs_open_and_the_finding_says_so(tmp_path):
    found = audit(arm(tmp_path, 0.5), 40)
    (proof,) = prove(found, 1)
    assert (proof.verdict, proof.open_share, proof.boxes) == ("open", 1.0, 1)
    found = replace(found, proofs={proof.pair.links: proof})
    (said,) = findings(found, [], {})
    assert said.startswith("Open: base and lower, 100 % of the joint positions; the least distance seen is")
    (row,) = (each for each in facts(found, {}) if each["proof"])
    assert (row["proof"], row["proof_open"], row["proof_boxes"]) == ("open", 1.0, 1)
    assert set(row["proof_joints"]) == {"shoulder", "elbow"}


def test_mimic_joints_move_with_their_leader(tmp_path):
    # The slide follows the elbow: at an elbow of 1 rad it has brought the sledge to the base.
    def robot(gap):
        return read_robot(
            urdf(
                tmp_path / "mimic.urdf",
                link("base", ("1 1 1", "0 0 0")),
                link("far", ("0.1 0.1 0.1", "0 0 5")),
                link("sledge", ("1 1 1", f"{2 + gap} 0 0")),
                joint("turn", "revolute", "base", "far", limit(0, 1), axis="1 0 0", xyz="0 0 9"),
                joint("bolts", "fixed", "base", "far2"),
                link("far2", ("0.1 0.1 0.1", "0 0 7")),
                joint("slide", "prismatic", "far2", "sledge", limit(-9, 9) + mimic("turn", -1), axis="1 0 0"),
            )
        )

    assert answer(robot(1e-6), ("base", "sledge")).verdict == "never"
    assert answer(robot(-1e-3), ("base", "sledge")).verdict == "overlaps"


def test_processes_give_the_same_proofs():
    robot = read_robot(DATA / "franka_panda/panda.urdf")
    found = audit(robot, 600)
    few = replace(found, pairs=[each for each in found.pairs if not each.met][:8])
    here, there = prove(few, 300), prove(few, 300, 0.0, Processes(2))
    assert [each.names for each in here] == [each.names for each in there]
    for one, other in zip(here, there):
        for name in ("verdict", "open_share", "boxes"):
            assert getattr(one, name) == getattr(other, name)
        assert one.least == pytest.approx(other.least, rel=1e-12)
        assert all((p.axes == q.axes).all() for p, q in zip(one.covers, other.covers))


class Failing:
    """An engine whose items all fail."""

    def shares(self, job, items, limit=None):
        yield [0], [Failed("raised", "no luck", "traceback")]


def test_a_failed_item_is_an_error(tmp_path):
    found = audit(read_robot(DATA / "franka_panda/panda.urdf"), 1)
    found = replace(found, pairs=[each for each in found.pairs if not each.pair.adjacent and not each.met])
    with pytest.raises(RuntimeError, match=r"the proof of links \(.*\) failed: no luck"):
        prove(found, 1, 0.0, Failing())


def test_proved_pairs_have_their_own_reason_in_srdf(proved, tmp_path):
    write_srdf(proved[1], tmp_path / "arm.srdf")
    assert read_srdf(tmp_path / "arm.srdf")[frozenset(("base", "lower"))] == "Never, proved"
    write_srdf(replace(proved[1], proofs={}), tmp_path / "arm.srdf")  # the reason of the proof is replaced
    assert read_srdf(tmp_path / "arm.srdf")[frozenset(("base", "lower"))] == "Never"


def test_a_cover_is_verified(proved):
    (checked,) = verify(proved[0], proved[3])
    assert (checked.names, checked.open_share, checked.wrong) == (("base", "lower"), 0.0, "")


def test_the_check_uses_neither_the_bound_of_the_search_nor_the_core(proved, monkeypatch):
    def used(*_):
        raise AssertionError

    for name in ("margins", "placed"):
        monkeypatch.setattr(f"overlapper.proof.chain.Chain.{name}", used)
    monkeypatch.setattr("overlapper.audit.prove.overlap", used)
    with pytest.raises(AssertionError):
        Prover(proved[0], 1)(proved[2][0].pair)
    (checked,) = verify(proved[0], proved[3])
    assert not checked.wrong


def altered(proved, **changes):
    """What the check says of the cover after changes of its arrays, each a function."""
    robot, _, (proof,), path = proved
    (cover,) = proof.covers
    changed = replace(cover, **{name: change(getattr(cover, name)) for name, change in changes.items()})
    write_covers(robot, [replace(proof, covers=(changed,))], path)
    (checked,) = verify(robot, path)
    assert checked.open_share == 1.0 or not checked.wrong
    return checked.wrong


def put(place, value):
    def change(array):
        array = array.copy()
        array[place] = value
        return array

    return change


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"splits": lambda each: each[:-1]}, "hole"),
        ({"splits": lambda each: np.append(each, np.int8(-1))}, "left over"),
        ({"splits": put(0, 2)}, "a joint that is not between the links"),
        ({"splits": put(0, -3)}, "a joint that is not between the links"),
        ({"splits": lambda each: each[:, None]}, "not a tree"),
        ({"splits": lambda each: each.astype(float)}, "no cover"),
        ({"axes": lambda each: each[:-1]}, "without an axis"),
        ({"axes": lambda each: -each}, "too small"),
        ({"axes": put(0, 0)}, "too small"),
        ({"axes": put(0, np.nan)}, "too small"),
        ({"axes": lambda each: np.vstack([each, each[:1]])}, "left over"),
        ({"shapes": lambda each: each[::-1]}, "no cover"),
    ],
)
def test_a_wrong_cover_is_refused(proved, changes, words):
    assert words in altered(proved, **changes)


def test_a_cover_that_halves_the_wrong_joint_is_refused(tmp_path):
    robot = read_robot(DATA / "franka_panda/panda.urdf")
    pair = next(each.pair for each in audit(robot, 1).pairs if each.names == ("panda_link0", "panda_link3"))
    proof = Prover(robot, 2000)(pair)
    (cover,) = proof.covers
    split = np.where(cover.splits == 1, 2, np.where(cover.splits == 2, 1, cover.splits)).astype(np.int8)
    for splits, right in ((cover.splits, True), (split, False)):
        write_covers(robot, [replace(proof, covers=(replace(cover, splits=splits),))], tmp_path / "covers.npz")
        (checked,) = verify(robot, tmp_path / "covers.npz")
        assert ("too small" not in checked.wrong) == right


def test_one_proved_box_for_all_positions_is_refused(proved):
    words = altered(proved, splits=lambda each: np.array([-1], np.int8), axes=lambda each: each[:1])
    assert "too small" in words


def test_a_cover_of_narrower_limits_or_smaller_shapes_is_refused(proved, tmp_path):
    for robot in (arm(tmp_path, 0.5, elbow=2.2), arm(tmp_path, 0.6)):
        (checked,) = verify(robot, proved[3])
        assert "too small" in checked.wrong


def test_an_open_cover_says_what_is_left(tmp_path):
    robot = arm(tmp_path, 0.5399)
    (proof,) = prove(audit(robot, 40), 15)
    write_covers(robot, [proof], tmp_path / "covers.npz")
    (checked,) = verify(robot, tmp_path / "covers.npz")
    assert checked.open_share == proof.open_share and 0 < proof.open_share < 1 and not checked.wrong


def test_files_that_are_no_covers_are_refused(proved, tmp_path):
    other = read_robot(urdf(tmp_path / "other.urdf", link("base", ("1 1 1", "0 0 0"))))
    with pytest.raises(ValueError, match="has the covers of robot 'made', not of 'else'"):
        verify(replace(other, name="else"), proved[3])
    (checked,) = verify(other, proved[3])
    assert "no such pair" in checked.wrong
    (tmp_path / "text.npz").write_text("no")
    with pytest.raises(ValueError, match="not a file of covers"):
        verify(proved[0], tmp_path / "text.npz")
    np.savez(tmp_path / "else.npz", about=np.zeros(3))
    with pytest.raises(ValueError, match="not a file of covers"):
        verify(proved[0], tmp_path / "else.npz")


def test_links_that_are_not_modelled_whole_are_open(proved):
    robot, _, (proof,), path = proved
    links = tuple(replace(each, skipped="a mesh") if each.name == "lower" else each for each in robot.tree.links)
    partial = replace(robot, tree=replace(robot.tree, links=links))
    again = Prover(partial, 20_000)(proof.pair)
    assert (again.verdict, again.why, again.open_share) == ("open", "lower is not modelled whole", 0.0)
    (checked,) = verify(partial, path)
    assert checked.wrong == "lower is not modelled whole"


def test_half_spaces_and_spherical_joints_are_open_with_the_reason(proved):
    robot, _, (proof,), path = proved
    shapes = tuple(
        replace(each, shape=HalfSpace((0, 0, 1), -9.0)) if each.link == 0 else each for each in robot.tree.shapes
    )
    flat = replace(robot, tree=replace(robot.tree, shapes=shapes))
    assert chain_between(flat, 0, 2) == "a half-space has no bounds"
    links = tuple(
        replace(each, joint=replace(each.joint, kind="spherical")) if each.name == "lower" else each
        for each in robot.tree.links
    )
    loose = replace(robot, tree=replace(robot.tree, links=links))
    for other, why in ((flat, "a half-space has no bounds"), (loose, "the spherical joint elbow is between the links")):
        again = Prover(other, 20_000)(proof.pair)
        assert (again.verdict, again.why, again.open_share, again.least) == ("open", why, 1.0, None)
        (checked,) = verify(other, path)
        assert checked.wrong == why


def test_a_proof_without_python_flint_says_what_to_install(monkeypatch):
    for name in ("overlapper.audit.prove", "overlapper.proof.chain", "overlapper.proof.cover"):
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "flint", None)
    with pytest.raises(ImportError, match=r"a proof over all configurations needs .*flint"):
        import overlapper.audit.prove  # noqa: F401
