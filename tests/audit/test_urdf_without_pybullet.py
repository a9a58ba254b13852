"""URDF files that yourdfpy reads, as where pybullet is not installed, against pybullet."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
import trimesh
from robots import INERTIAL, ROBOTS, joint, limit, link, mimic, turntable, urdf, without

from overlapper.audit.assets import read_asset
from overlapper.audit.audit import audit
from overlapper.audit.findings import findings, remarks
from overlapper.audit.kinematics import Kinematics
from overlapper.audit.robot import not_modelled, read_robot
from overlapper.audit.sampling import Sampling
from overlapper.jobs.confined import Confined
from overlapper.simulation.bullet.model_file import NotRead
from overlapper.simulation.settings import Modelling

pytest.importorskip("yourdfpy")

NOMINAL = Modelling()
GRID = 6e-4  # relative: Bullet moves corners of its hulls to a grid
ANGLED = '<origin xyz=".1 -.2 .3" rpy=".4 -.5 .6"/>'
OFFSET = INERTIAL.replace("<inertial>", f"<inertial>{ANGLED}")
CORNERS = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 3 0 0\nv 4 0 0\nv 3 2 0\nv 3 0 3\n"
TWO = (
    f"{CORNERS}o same\nusemtl red\nf 1 3 2\nf 1 2 4\nusemtl blue\nf 2 3 4\nf 1 4 3\n"
    "o same\nf 5 7 6\nf 5 6 8\nf 6 7 8\nf 5 8 7\n"
)

# Without pybullet, as where it is not installed: find_spec answers None, and an import fails.
PROGRAM = """
import sys
for name in {missing!r}: sys.modules[name] = None
from overlapper.cli import main
sys.argv = ["overlapper", "audit", *sys.argv[1:]]
main()
"""


def read_twice(path, monkeypatch, modelling=NOMINAL):
    """The robot by pybullet and by yourdfpy."""
    by_pybullet = read_robot(path, modelling)
    with monkeypatch.context() as patched:
        patched.setattr("overlapper.audit.robot.find_spec", without("pybullet"))
        return by_pybullet, read_robot(path, modelling)


def must_agree(expected, robot):
    """Links, joints, shapes and their poses agree. Volumes agree as far as Bullet's grid allows."""
    assert (robot.name, robot.tree.bodies, robot.link_names) == (
        expected.name,
        expected.tree.bodies,
        expected.link_names,
    )
    assert (robot.degrees, robot.mimics, robot.unmoved) == (expected.degrees, expected.mimics, expected.unmoved)
    assert robot.notes == expected.notes and not_modelled(robot) == not_modelled(expected)
    assert [(link.parent, link.concave) for link in robot.tree.links] == [
        (link.parent, link.concave) for link in expected.tree.links
    ]
    shapes = [[(each.link, type(each.shape)) for each in of.tree.shapes] for of in (robot, expected)]
    assert shapes[0] == shapes[1]
    sampling = Sampling(expected, 300, 0)
    configurations = np.array([sampling.configuration(number) for number in range(300)])
    positions, turns = Kinematics(robot).poses(configurations)
    expected_positions, expected_turns = Kinematics(expected).poses(configurations)
    np.testing.assert_allclose(positions, expected_positions, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.abs((turns * expected_turns).sum(axis=-1)), 1, rtol=0, atol=1e-12)
    for a, b in zip(robot.tree.shapes, expected.tree.shapes):
        assert a.shape.volume == pytest.approx(b.shape.volume, rel=GRID)
        np.testing.assert_allclose(a.shape.bounds, b.shape.bounds, rtol=0, atol=2e-4 * np.abs(b.shape.bounds).max())


def shaped(name, *shapes, inertial=INERTIAL):
    text = "".join(f"<collision{flag}>{ANGLED}<geometry>{shape}</geometry></collision>" for shape, flag in shapes)
    return f'<link name="{name}">{inertial}{text}</link>'


@pytest.fixture
def everything(tmp_path):
    """A robot with every kind of joint and shape, inertial frames beside the links, and axes of any length."""
    (tmp_path / "two.obj").write_text(TWO)
    box = trimesh.creation.box((1, 2, 3)).export(file_type="dae").decode()
    (tmp_path / "inch.dae").write_text(box.replace("<asset>", '<asset><unit name="inch" meter="0.0254"/>'))
    trimesh.creation.annulus(0.5, 1, 1, sections=6).export(tmp_path / "ring.stl")
    kinds = ["revolute", "continuous", "prismatic", "planar", "floating", "fixed", "spherical", "continuous"]
    names = ["base", *(f"l{k}" for k in range(len(kinds)))]
    shapes = [
        [('<box size="1 2 3"/>', "")],
        [('<sphere radius=".4"/>', ""), ('<cylinder radius=".3" length="2"/>', "")],
        [('<capsule radius=".2" length=".7"/>', "")],
        [('<mesh filename="two.obj" scale=".5 -1 2"/>', "")],
        [('<mesh filename="package:///inch.dae" scale="2"/>', "")],
        [('<mesh filename="ring.stl"/>', ' concave="yes"'), ('<mesh filename="two.obj"/>', "")],
        [],
        [('<box size=".1 .1 .1"/>', "")],
        [('<box size=".1 .2 .1"/>', "")],
    ]
    # pybullet misplaces links of planar joints, and turns links of spherical joints, by their inertial frames.
    odd = ("l3", "l6")
    links = [shaped(name, *each, inertial=INERTIAL if name in odd else OFFSET) for name, each in zip(names, shapes)]
    more = ["<safety_controller/>" + limit(-1, 2), "", limit(-0.1, 0.4), "", "", "", "", limit(-2, 1)]
    axes = ["0 3 4", "1 0 0", "0 0 2", "0 0 1", "0 0 1", "0 0 1", "0 0 1", "1 1 1"]
    parents = [names[0], names[1], names[1], names[0], names[2], names[5], names[3], names[2]]
    joints = [
        joint(f"j{k}", kind, parent, name, text, axis=axis).replace('<origin xyz="0 0 0"/>', ANGLED)
        for k, (kind, parent, name, text, axis) in enumerate(zip(kinds, parents, names[1:], more, axes))
    ]
    joints[7] = joints[7].replace("</joint>", mimic("j0", 2, 0.1) + "</joint>")
    return urdf(tmp_path / "everything.urdf", *links, *joints)


@pytest.mark.parametrize("modelling", [Modelling(), Modelling(surface="margin", concave="skip")])
def test_every_joint_and_shape_is_as_pybullet_makes_it(modelling, everything, monkeypatch):
    expected, robot = read_twice(everything, monkeypatch, modelling)
    must_agree(expected, robot)
    kinds = {type(each.shape).__name__ for each in robot.tree.shapes}
    hull = "RoundedHull" if modelling.surface == "margin" else "Hull"
    assert kinds >= {"Box", "Sphere", "Capsule", hull}
    assert any("safety_controller" in line for line in remarks(robot))
    assert bool(not_modelled(robot)) == (modelling.concave == "skip")


@pytest.mark.parametrize("name", ["panda", "go1", "talos_full_v2", "ur5_gripper", "alex_nub_hands"])
def test_robots_are_as_pybullet_reads_them(name, monkeypatch):
    must_agree(*read_twice(next(ROBOTS.rglob(f"{name}.urdf")), monkeypatch))


@pytest.mark.parametrize("name", ["panda", "go1", "kinova"])
def test_audits_are_as_with_pybullet(name, monkeypatch):
    by_pybullet, by_yourdfpy = (
        audit(robot, 400).pairs for robot in read_twice(next(ROBOTS.rglob(f"{name}.urdf")), monkeypatch)
    )
    for expected, found in zip(by_pybullet, by_yourdfpy, strict=True):
        assert (found.names, found.pair.adjacent) == (expected.names, expected.pair.adjacent)
        # Bullet's hulls are smaller by the grid, so that some shallow overlaps are missed.
        assert expected.met <= found.met <= expected.met + 0.03 * 400
        if expected.largest:
            volume, depth = expected.largest.contact.volume, expected.deepest.contact.depth
            assert found.largest.contact.volume == pytest.approx(volume, rel=0.02, abs=2e-7)
            assert found.deepest.contact.depth == pytest.approx(depth, rel=1e-3, abs=1e-4)


def run(*arguments, missing=("pybullet", "pybullet_data")):
    command = [sys.executable, "-c", PROGRAM.format(missing=missing), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


def test_the_command_reads_a_urdf_without_pybullet(tmp_path):
    path = turntable(tmp_path / "turntable.urdf")
    files = [f"--{kind}={tmp_path / name}" for kind, name in [("srdf", "t.srdf"), ("out", "t.csv"), ("html", "t.html")]]
    done = run(path, "--configurations", "50", "--json", *files)
    assert (done.returncode, done.stderr) == (1, "")
    assert json.loads(done.stdout)["findings"] == [
        "arm and plate always overlap, and no joint connects them.",
        "wall and plate always overlap, and no joint connects them.",
    ]
    assert all((tmp_path / name).stat().st_size for name in ("t.srdf", "t.csv", "t.html"))
    folder = run(tmp_path, "--json")
    assert folder.returncode == 1 and "turntable.urdf" in folder.stdout and "pybullet" not in folder.stdout


def test_without_both_libraries_the_command_says_what_to_install(tmp_path):
    done = run(turntable(tmp_path / "turntable.urdf"), missing=("pybullet", "yourdfpy"))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(
        "overlapper: a URDF file needs yourdfpy: pip install yourdfpy, or pybullet: pip install"
    )


def test_shapes_that_cannot_be_read_are_told(by_yourdfpy, tmp_path):
    (tmp_path / "wreck.stl").write_bytes(bytes(range(256)) * 50)
    (tmp_path / "two.obj").write_text(TWO)
    meshes = ["wreck.stl", "none.stl", 'two.obj" scale="1 2']
    wrong = [(f'<mesh filename="{mesh}"/>', "") for mesh in meshes] + [("<mesh/>", ""), ("<plane/>", ""), ("", "")]
    wrong += [('<box size="1 2 -3"/>', ""), ('<box size="1 1 1"/>', "")]
    path = urdf(
        tmp_path / "arm.urdf", shaped("hip", *wrong), link("leg", ("1 1 1", "0 0 0")), joint("j", "fixed", "hip", "leg")
    )
    robot = read_robot(path)
    (reason,) = not_modelled(robot).values()
    for said in (
        "1 of 8 shapes: a <collision> with a <plane> is not read; ",
        "1 of 8 shapes: a <collision> with no shape is not read",
        "the mesh 'wreck.stl' cannot be read: it states",
        "the mesh 'none.stl' does not exist",
        "the mesh 'two.obj' has a scale of 2 numbers, not 1 or 3",
        "the mesh '' does not exist",
    ):
        assert said in reason
    assert len(robot.tree.shapes) == 2 and findings(audit(robot, 5), [], {})[0].startswith("Not modelled: hip, ")
    assert not read_asset(tmp_path, path, "m", 0.0, Modelling()).sound


def test_a_changed_mesh_is_read_anew(by_yourdfpy, tmp_path):
    path = urdf(tmp_path / "arm.urdf", shaped("hip", ('<mesh filename="two.obj"/>', "")))
    (tmp_path / "two.obj").write_text(TWO)
    assert len(read_robot(path).tree.shapes) == 2
    (tmp_path / "two.obj").write_text(TWO[: TWO.rindex("o same")])
    assert len(read_robot(path).tree.shapes) == 1


BAR = link("a", ("1 1 1", "0 0 0"))


@pytest.mark.parametrize(
    ("elements", "said"),
    [
        ([], "its 0 links and 0 joints are not one tree"),
        ([BAR, link("b")], "its 2 links and 0 joints are not one tree"),
        (
            [BAR, link("b"), link("c"), joint("j", "fixed", "b", "c"), joint("k", "fixed", "c", "b")],
            "a link of it is a parent of itself, through its joints",
        ),
        ([BAR, BAR], "it has two links named 'a'"),
        ([BAR, "<link/>"], "a link of it has no name"),
        ([BAR, link("b"), joint("j", "ball", "a", "b")], "the joint 'j' has the type 'ball', not one of revolute, "),
        ([BAR, link("b"), joint("j", "prismatic", "a", "b")], "the prismatic joint 'j' has no <limit>"),
        ([BAR, joint("j", "fixed", "a", "z")], "the joint 'j' has the child 'z', which is not a link of it"),
        ([BAR, '<joint name="j" type="fixed"/>'], "the joint 'j' has the parent None, which is not a link of it"),
        ([shaped("a", ("<box/>", ""))], "yourdfpy says KeyError: 'size'"),
        (
            [BAR, link("b"), joint("j", "revolute", "a", "b", limit(0, 1) + mimic("k"))],
            "the joint 'j' mimics 'k', ",
        ),
        ([BAR, link("b"), joint("j", "revolute", "a", "b", limit(0, 1), axis="0 0 0")], "the joint 'j' has the axis "),
        (["<link"], "it is not XML: "),
    ],
)
def test_a_file_that_is_no_robot_is_refused(elements, said, by_yourdfpy, tmp_path):
    path = urdf(tmp_path / "wrong.urdf", *elements)
    with pytest.raises(NotRead) as refused:
        read_robot(path)
    assert str(refused.value).startswith(f"{path} cannot be read: {said}")


def test_a_missing_file_is_refused(by_yourdfpy, tmp_path):
    with pytest.raises(NotRead, match="there is no file"):
        read_robot(tmp_path / "none.urdf")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no named pipes")
def test_a_pipe_as_a_mesh_is_refused(by_yourdfpy, tmp_path):
    os.mkfifo(tmp_path / "pipe.stl")
    path = urdf(tmp_path / "arm.urdf", shaped("hip", ('<mesh filename="pipe.stl"/>', "")))
    with pytest.raises(NotRead, match=r"it names 'pipe\.stl', which is a pipe"):
        read_robot(path)


def test_a_file_that_takes_too_long_is_refused(by_yourdfpy, tmp_path, monkeypatch):
    reading = Confined(0.5, 2000)
    monkeypatch.setattr("overlapper.audit.robot._reading", reading)
    (tmp_path / "many.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n" + "o x\nf 1 2 3\n" * 20_000)
    path = urdf(tmp_path / "arm.urdf", shaped("hip", ('<mesh filename="many.obj"/>', "")))
    try:
        with pytest.raises(NotRead, match=r"cannot be read: yourdfpy took longer than 0\.5 s"):
            read_robot(path)
    finally:
        reading.close()
