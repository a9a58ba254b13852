"""Contact models of a scene: contact points or volumetric contact."""

import re
from dataclasses import replace

import pytest

from overlapper.scenes.check import examined, record
from overlapper.scenes.run import run
from overlapper.scenes.scene import SceneError, load_scene
from overlapper.simulation import link_contacts
from overlapper.tables.outputs import outputs
from overlapper.tables.summary import Summary
from overlapper.tables.table import FORCES, link_rows, rows
from overlapper.tables.table_file import read_table
from overlapper.verdicts.comparison import compare_forces
from overlapper.verdicts.expected import FORCES as FORCE_BUDGETS
from overlapper.verdicts.expected import read_expected

SCENE = '''"""A cube on a plane."""
import pybullet as p
STEPS = 100
def build(client):
    p.setGravity(0, 0, -9.81, physicsClientId=client)
    p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE, physicsClientId=client), physicsClientId=client)
    box = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.05] * 3, physicsClientId=client)
    p.createMultiBody(1, box, -1, [0, 0, 0.05 - 3e-8], physicsClientId=client)
'''


@pytest.fixture
def scene(tmp_path):
    """The scene of a cube on a plane, with more lines."""

    def scene(more=""):
        (tmp_path / "cube.py").write_text(SCENE + more, encoding="utf-8")
        return load_scene(tmp_path / "cube.py")

    return scene


def test_with_volumetric_contact_a_frame_has_forces_of_its_bodies(scene):
    *_, frame = run(scene(), contact="volumetric")
    assert frame.forces.force[0] == pytest.approx([0, 0, -9.81], abs=1e-6)
    assert frame.forces.pairs.tolist() == frame.contacts.keys.tolist() == [[0, -1, 0, 1, -1, 0]]
    assert frame.forces.contacts[0].overlap.volume == frame.contacts[0].overlap.volume
    assert frame.kept().forces is frame.forces


def test_contact_points_have_no_volumetric_forces(scene):
    *_, frame = run(scene(), 3)
    assert frame.forces is None


def test_a_run_overrides_the_contact_model_of_a_scene(scene):
    *_, frame = run(scene("CONTACT = 'volumetric'"), 3)
    assert frame.forces is not None
    *_, frame = run(scene("CONTACT = 'volumetric'"), 3, contact="bullet")
    assert frame.forces is None


def test_an_unknown_contact_model_is_refused(scene):
    either = "which must be 'bullet', 'volumetric' or a dictionary of "
    either += "dissipation, friction, hardening, restitution, rolling, stiffness, substeps"
    for each in ("'soft'", "{'mass': 1}"):
        with pytest.raises(SceneError, match=rf"cube\.py has CONTACT = {each}, {either}"):
            scene(f"CONTACT = {each}")
    with pytest.raises(SceneError, match=r"cube\.py has an invalid CONTACT: stiffness must be a number in Pa/m"):
        next(run(scene("CONTACT = {'stiffness': 0}")))


def test_a_scene_says_how_stiff_its_bodies_are(scene):
    stiff = scene("CONTACT = {'stiffness': 2e7}")
    *_, frame = run(stiff, 1)
    assert frame.forces.stiffness == pytest.approx([2e7]) and stiff.contact == "volumetric"
    *_, frame = run(stiff, 1, contact="bullet")
    assert frame.forces is None


def test_a_run_refuses_an_unknown_contact_model(scene):
    with pytest.raises(ValueError, match="contact must be 'bullet' or 'volumetric', not 'soft'"):
        next(run(scene(), contact="soft"))


LYING = [0, 0, -9.81, 0, 0, 0, 9.81 * 3e-8 / 2, 0, 0, 0]  # the cube rests 3e-8 m deep, and has the energy k V²/2A
FORCED = [*FORCES]


def lying(rows):
    """The columns of forces in the last of some rows."""
    return [rows[-1][name] for name in FORCED]


@pytest.mark.parametrize("ending", ["csv", "parquet", "sqlite"])
@pytest.mark.parametrize("per", ["shape", "link"])
def test_forces_are_columns_of_a_table(scene, tmp_path, ending, per):
    path = tmp_path / f"cube.{ending}"
    found = []
    with outputs(summary := Summary("cube"), {}, [], path, per=per, forces=True) as take:
        for frame in run(scene(), 50, contact="volumetric"):
            take(frame)
            where = frame.step, frame.time, frame.bodies
            found += rows(*where, frame.contacts, forces=frame.forces)
    table = read_table(path)
    expected = [0.0 if per == "shape" or not name.startswith("slip") else None for name in FORCED]
    for name, value, there, blank in zip(FORCED, LYING, lying(table), expected):
        assert there is None if blank is None else there == pytest.approx(value, abs=1e-6), name
    if per == "shape":
        assert [each[name] for each in table for name in FORCED] == [each[name] for each in found for name in FORCED]
    (pair,) = summary.as_dict()["pairs"]
    assert pair["largest_force_n"] == pytest.approx(9.81, rel=1e-5) and 1 <= pair["force_step"] <= 50


def test_a_run_of_contact_points_has_no_such_columns(scene, tmp_path):
    with outputs(summary := Summary("cube"), {}, [], tmp_path / "cube.csv") as take:
        for frame in run(scene(), 50):
            take(frame)
    assert not any(name in row for row in read_table(tmp_path / "cube.csv") for name in FORCED)
    assert not any("force" in name for pair in summary.as_dict()["pairs"] for name in pair)


TEE = SCENE.replace(
    "box = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.05] * 3, physicsClientId=client)",
    "box = p.createCollisionShapeArray([p.GEOM_BOX] * 2, halfExtents=[[0.05] * 3] * 2,"
    " collisionFramePositions=[[-0.1, 0, 0], [0.1, 0, 0]], physicsClientId=client)",
)


def test_the_forces_of_two_links_are_the_sum_of_those_of_their_shapes(tmp_path):
    (tmp_path / "feet.py").write_text(TEE, encoding="utf-8")
    *_, frame = run(load_scene(tmp_path / "feet.py"), 5, contact="volumetric")
    where = frame.step, frame.time, frame.bodies
    left, right = rows(*where, frame.contacts, forces=frame.forces)
    (whole,) = link_rows(*where, link_contacts(frame.contacts), frame.forces)
    for name in ("force_z_n", "energy_j"):
        assert whole[name] == pytest.approx(left[name] + right[name]) and left[name] == pytest.approx(right[name])
    assert whole["force_z_n"] == pytest.approx(-9.81, abs=1e-5)
    # About the middle, what one foot bears turns against the other.
    assert whole["torque_y_nm"] == pytest.approx(0, abs=1e-8)
    # Without the right foot, what is left turns about the middle of both.
    only = replace(frame.forces, **{name: getattr(frame.forces, name) * [[1.0], [0.0]] for name in ("force", "torque")})
    (half,) = link_rows(*where, link_contacts(frame.contacts), only)
    assert half["torque_y_nm"] == pytest.approx(-0.1 * 9.81 / 2, rel=1e-5)
    assert [*only.to_pandas().columns] == [*frame.contacts.to_pandas().columns, *FORCED]


def test_a_pair_that_is_only_measured_has_no_force(scene):
    filtered = "    p.setCollisionFilterPair(0, 1, -1, -1, 0, physicsClientId=client)\nPAIRS = 'all'\n"
    *_, frame = run(scene(filtered), 3, contact="volumetric")
    (row,) = rows(frame.step, frame.time, frame.bodies, frame.contacts, forces=frame.forces)
    assert len(frame.forces) == 0 and row["volume_m3"] > 0 and "force_z_n" not in row
    assert link_rows(1, 0.0, frame.bodies, link_contacts(frame.contacts), frame.forces)[0]["status"] == "overlapping"


@pytest.fixture
def recorded(scene):
    known = scene("CONTACT = 'volumetric'")
    record(known)
    return known


def test_an_expected_file_has_forces_with_their_budgets(recorded):
    expected = read_expected(recorded.expected)
    assert {name: expected.budgets[name] for name in FORCE_BUDGETS} == FORCE_BUDGETS
    assert lying(expected.rows) == pytest.approx(LYING, abs=1e-6)
    verdict = examined(recorded, expected)
    assert verdict.moves == [] and "poses and forces of the simulation of today" in verdict.lines()[2]


def test_a_changed_force_has_moved(recorded):
    text = recorded.expected.read_text(encoding="utf-8")
    text = re.sub(r"^# rows: .*\n", "", text, flags=re.MULTILINE)
    heavier = re.sub(r"-9\.8[01]\d*", "-9.5", text)
    assert heavier != text
    recorded.expected.write_text(heavier, encoding="utf-8")
    verdict = examined(recorded, read_expected(recorded.expected))
    assert {move.quantity for move in verdict.moves} == {"force_n"} and len(verdict.dynamics) == 4
    assert "force_n is (" in str(verdict.moves[0]) and verdict.moves[0].difference == pytest.approx(0.31, abs=1e-3)
    assert "energy" in {*compare_forces(verdict.expected.rows, [], verdict.expected.budgets).spent}


def test_without_a_budget_forces_are_not_compared(recorded):
    expected = read_expected(recorded.expected)
    none = [row | {"force_z_n": 1e3, "energy_j": 1.0} for row in expected.rows]
    assert compare_forces(expected.rows, none, {}).moves == []
    moved = compare_forces(expected.rows, none, FORCE_BUDGETS).moves
    assert {move.quantity for move in moved} == {"force_n", "energy_j"}


def test_contact_points_are_recorded_without_forces(scene):
    known = scene()
    record(known)
    expected = read_expected(known.expected)
    assert not FORCE_BUDGETS.keys() & expected.budgets.keys() and "energy_j" not in expected.rows[0]
