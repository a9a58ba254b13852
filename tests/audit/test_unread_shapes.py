"""Shapes that pybullet does not build are told; models that it changes are refused."""

import csv
import json
import os
import subprocess
import sys
import warnings

import pybullet
import pytest
from robots import joint, limit, link, mimic, turntable, urdf, without

from overlapper.audit.assets import read_asset
from overlapper.audit.audit import audit
from overlapper.audit.findings import findings, remarks
from overlapper.audit.robot import not_modelled, read_robot
from overlapper.audit.srdf import read_srdf, write_srdf
from overlapper.audit.table import facts, write_table
from overlapper.simulation import Bodies, Recorder, SkippedShapeWarning
from overlapper.simulation.bullet.inventory import inventory
from overlapper.simulation.bullet.mjcf import misread
from overlapper.simulation.bullet.model_file import NotRead
from overlapper.simulation.bullet.model_text import found, must_be_sound, root_of
from overlapper.simulation.settings import Modelling

WRECK = bytes(range(256)) * 50
CORNERS = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
TETRAHEDRON = CORNERS + "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
NO_PIPES = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no named pipes")


def of_mesh(name, *meshes, boxes=()):
    text = "".join(f'<collision><geometry><mesh filename="{mesh}"/></geometry></collision>' for mesh in meshes)
    return link(name, *boxes).replace("</link>", f"{text}</link>")


def arm(path, *meshes, boxes=()):
    """Three links in a row, the first of meshes."""
    return urdf(
        path,
        of_mesh("hip", *meshes, boxes=boxes),
        link("thigh", ("0.2 0.2 0.2", "3 0 0.2")),
        link("shin", ("0.2 0.2 0.2", "6 0 0.4")),
        joint("shoulder", "revolute", "hip", "thigh", limit(-1, 1)),
        joint("elbow", "revolute", "thigh", "shin", limit(-1, 1)),
    )


def refusal(path):
    with pytest.raises(NotRead) as refused:
        read_robot(path)
    said = str(refused.value)
    assert said.startswith(f"{path} cannot be read: ") and "\n" not in said
    return said.partition("read: ")[2]


@pytest.fixture
def wrecked(tmp_path):
    """A robot with a mesh of garbage."""
    (tmp_path / "wreck.obj").write_bytes(WRECK)
    return arm(tmp_path / "arm.urdf", "wreck.obj", boxes=[("0.1 0.1 0.1", "0 0 0")])


def test_a_mesh_that_pybullet_cannot_read_is_told_in_findings_rows_json_and_srdf(wrecked, tmp_path):
    robot = read_robot(wrecked)
    reason = "pybullet built 1 of the 2 shapes in the file, without wreck.obj"
    assert not_modelled(robot) == {"hip": reason}
    found = audit(robot, 20)
    assert findings(found, [], {}) == [f"Not modelled: hip, {reason}."]
    told = {(row["nameA"], row["nameB"]): row["not_modelled"] for row in facts(found, {})}
    assert told == {("hip", "thigh"): f"hip: {reason}", ("hip", "shin"): f"hip: {reason}", ("thigh", "shin"): None}
    write_table(found, tmp_path / "pairs.csv", {}, {})
    lines = [line for line in (tmp_path / "pairs.csv").read_text().splitlines() if not line.startswith("#")]
    assert [row["not_modelled"] for row in csv.DictReader(lines)] == [f"hip: {reason}", f"hip: {reason}", ""]
    write_srdf(found, tmp_path / "arm.srdf")
    assert sorted(read_srdf(tmp_path / "arm.srdf").values()) == ["Adjacent", "Adjacent"]  # and no pair of the hip Never


def test_a_folder_and_an_inventory_tell_of_a_mesh_that_is_not_there(wrecked, tmp_path):
    asset = read_asset(tmp_path, wrecked, "m", 0.0, Modelling())
    assert not asset.sound and "wreck.obj" in asset.skipped[0]
    ((name, reason),) = inventory(wrecked).skipped
    assert name.endswith("hip") and "wreck.obj" in reason


@pytest.mark.parametrize("name", ["wreck.stl", "wreck.dae", "empty.obj"])
def test_each_kind_of_mesh_that_gives_no_shape_is_told(name, tmp_path):
    (tmp_path / name).write_bytes(b"" if "empty" in name else WRECK)
    (tmp_path / "good.obj").write_text(f"o one\n{TETRAHEDRON}o two\n{CORNERS}f 5 7 6\nf 5 6 8\nf 6 7 8\nf 5 8 7\n")
    robot = read_robot(arm(tmp_path / "arm.urdf", name, "good.obj"))
    assert not_modelled(robot) == {"hip": f"pybullet built 1 of the 2 shapes in the file, without {name}"}
    assert not not_modelled(read_robot(arm(tmp_path / "whole.urdf", "good.obj")))


def test_shapes_of_sdf_are_counted_too(tmp_path):
    (tmp_path / "wreck.stl").write_bytes(WRECK)
    box = '<collision name="b"><geometry><box><size>1 1 1</size></box></geometry></collision>'
    mesh = '<collision name="m"><geometry><mesh><uri>wreck.stl</uri></mesh></geometry></collision>'
    links = f'<link name="a">{box}{mesh}</link><link name="b">{box}</link>'
    tie = '<joint name="j" type="fixed"><parent>a</parent><child>b</child></joint>'
    (tmp_path / "m.sdf").write_text(f'<sdf version="1.4"><model name="m">{links}{tie}</model></sdf>')
    (reason,) = not_modelled(read_robot(tmp_path / "m.sdf")).values()
    assert reason == "pybullet built 1 of the 2 shapes in the file, without wreck.stl"


def bodies_of(path, recorded=True, flags=0, **arguments):
    """The bodies of a client that has loaded a file."""
    client = pybullet.connect(pybullet.DIRECT)
    recorder = Recorder(client) if recorded else None
    load = {".urdf": pybullet.loadURDF, ".sdf": pybullet.loadSDF}[path.suffix]
    load(str(path), physicsClientId=client, **arguments, **({"flags": flags} if flags else {}))
    try:
        return Bodies(client, recorder=recorder)
    finally:
        if recorder:
            recorder.close()
        pybullet.disconnect(client)


def test_bodies_know_of_lost_meshes_by_a_recorder_and_warn_once(wrecked, tmp_path):
    with pytest.warns(SkippedShapeWarning) as warned:
        bodies = bodies_of(wrecked)
    ((id, link, name, reason),) = [(each.body, each.link, each.name, each.reason) for each in bodies.skipped]
    assert (id, link, name) == (0, -1, "arm/hip")
    assert reason == "pybullet built 1 of the 2 shapes in the file, without wreck.obj"
    assert len(warned) == 1 and str(warned[0].message).endswith(f"is left out: {reason}")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert bodies_of(wrecked, recorded=False).skipped == []  # nothing tells it
        for flags in (pybullet.URDF_MERGE_FIXED_LINKS, pybullet.URDF_IGNORE_COLLISION_SHAPES):
            assert bodies_of(wrecked, flags=flags).skipped == []
        (tmp_path / "good.obj").write_text(TETRAHEDRON)
        assert bodies_of(arm(tmp_path / "good.urdf", "good.obj")).skipped == []
    with pytest.warns(SkippedShapeWarning):
        assert all("wreck" not in each.reason for each in bodies_of(wrecked, useMaximalCoordinates=True).skipped)


def test_a_lost_mesh_and_a_flat_one_are_one_entry_of_their_link(tmp_path):
    (tmp_path / "wreck.obj").write_bytes(WRECK)
    (tmp_path / "flat.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 3 4\n")
    with pytest.warns(SkippedShapeWarning):
        (skipped,) = bodies_of(arm(tmp_path / "arm.urdf", "wreck.obj", "flat.obj")).skipped
    assert "without wreck.obj; " in skipped.reason and "flat" in skipped.reason


def test_a_model_found_on_the_search_path_is_counted(wrecked, monkeypatch, tmp_path):
    client = pybullet.connect(pybullet.DIRECT)
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    with Recorder(client) as recorder:
        pybullet.setAdditionalSearchPath(str(tmp_path), physicsClientId=client)
        pybullet.loadURDF(wrecked.name, physicsClientId=client)
        with pytest.warns(SkippedShapeWarning):
            (skipped,) = Bodies(client, recorder=recorder).skipped
    pybullet.disconnect(client)
    assert "wreck.obj" in skipped.reason


def test_a_scene_tells_of_a_lost_mesh(wrecked, tmp_path):
    scene = tmp_path / "scene.py"
    load = f"p.loadURDF({str(wrecked)!r}, physicsClientId=client)"
    scene.write_text(f'"""An arm."""\nimport pybullet as p\nSTEPS = 2\n\n\ndef build(client):\n    {load}\n')
    command = [sys.executable, "-m", "overlapper", "run", str(scene)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 1 and "Not modelled: arm/hip, pybullet built 1 of the 2 shapes" in done.stdout


def test_sdf_that_includes_others_is_refused(tmp_path):
    (tmp_path / "m.sdf").write_text(
        '<sdf version="1.4"><world name="w"><include><uri>model://table</uri></include></world></sdf>'
    )
    assert refusal(tmp_path / "m.sdf") == "it has <include> of model://table, which pybullet drops"
    with pytest.raises(NotRead, match=r"read: it has <include> of model://table, which pybullet drops$"):
        inventory(tmp_path / "m.sdf")


@NO_PIPES
def test_what_is_no_file_is_refused_before_pybullet_opens_it(tmp_path):
    os.mkfifo(tmp_path / "pipe.obj")
    (tmp_path / "folder.obj").mkdir()
    (tmp_path / "zero.stl").symlink_to("/dev/zero")
    for name in ("pipe.obj", "folder.obj", "zero.stl", "package://pipe.obj"):
        said = refusal(arm(tmp_path / "arm.urdf", name))
        assert said == f"it names {name!r}, which is a pipe, a device or a folder, not a file"
    os.mkfifo(tmp_path / "library")
    (tmp_path / "of_library.obj").write_text(f"mtllib library\n{TETRAHEDRON}")
    assert "names 'library'" in refusal(arm(tmp_path / "arm.urdf", "of_library.obj"))
    assert found(tmp_path / "arm.urdf", "none.obj") is None and found(tmp_path / "arm.urdf", "x" * 999) is None
    with pytest.raises(ValueError, match=r"^there is no SRDF file .*library$"):
        read_srdf(tmp_path / "library")


def test_corners_that_are_no_numbers_are_refused(tmp_path):
    (tmp_path / "nan.obj").write_text(TETRAHEDRON.replace("v 1 0", "v nan 0"))
    assert (
        refusal(arm(tmp_path / "arm.urdf", "nan.obj")) == "it names 'nan.obj', which has vertices that are not numbers"
    )


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (joint("j", "revolute", "a", "b", limit(0, 1), axis="0 0 0"), "the joint 'j' has the axis '0 0 0', which has"),
        (joint("j", "fixed", "a", "b", xyz="nan 0 0"), "the joint 'j' has <origin xyz='nan 0 0'>"),
        (joint("j", "revolute", "a", "b", limit("nan", "nan")), "the joint 'j' has <limit lower='nan'>"),
        (joint("j", "revolute", "a", "b", mimic("k", "nan")), "the joint 'j' has <mimic multiplier='nan'"),
        (joint("j", "fixed", "a", "b") + link("c", ("1 inf 1", "0 0 0")), "a collision shape of the link 'c' has <box"),
        ("<link>" * 130, "it is not XML: "),
        (" " * 7000 + link("c" * 3000), "pybullet breaks lines after 8,191 bytes, which would break a word or"),
    ],
)
def test_a_urdf_that_pybullet_would_misunderstand_is_refused_with_the_joint_or_link(text, sentence, tmp_path):
    path = urdf(tmp_path / "robot.urdf", link("a", ("1 1 1", "0 0 0")), link("b", ("1 1 1", "0 0 0")), text)
    with pytest.raises(NotRead) as refused:
        must_be_sound(path, root_of(path))
    assert str(refused.value).startswith(sentence)


def test_a_urdf_of_more_links_than_pybullet_places_is_read_by_yourdfpy(tmp_path, monkeypatch):
    joints = [joint(f"j{k}", "fixed", "l0", f"l{k}") for k in range(1, 132)]
    path = urdf(tmp_path / "robot.urdf", *(link(f"l{k}") for k in range(132)), *joints)
    robot = read_robot(path)
    said = "it has 132 links, but pybullet returns the poses of at most 128"
    assert len(robot.tree.links) == 132 and robot.notes == (f"yourdfpy has read the file: {said}.",)
    monkeypatch.setattr("overlapper.audit.robot.find_spec", without("yourdfpy"))
    assert refusal(path) == f"{said}. More links need yourdfpy: pip install yourdfpy"


def test_a_fixed_joint_may_have_no_axis_and_a_long_line_may_break_between_elements(tmp_path):
    tie = joint("j", "fixed", "a", "b", axis="0 0 0")
    path = urdf(tmp_path / "robot.urdf", link("a", ("1 1 1", "0 0 0")), " " * 9000, link("b", ("1 1 1", "0 0 0")), tie)
    assert len(read_robot(path).tree.shapes) == 2


def mjcf(path, compiler="", more='type="hinge" range="-20 20" limited="true"', geom='type="box" size=".02 .02 .2"'):
    tip = f'<body name="tip" pos="0 0 .3"><joint name="bend" axis="0 1 0" {more}/><geom name="end" {geom}/></body>'
    base = f'<body name="base"><geom type="box" size=".1 .1 .1"/>{tip}</body>'
    path.write_text(f"<mujoco>{compiler}<worldbody>{base}</worldbody></mujoco>")
    return path


@pytest.mark.usefixtures("by_pybullet")
def test_mjcf_that_pybullet_reads_as_it_is_meant_is_read(tmp_path):
    robot = read_robot(mjcf(tmp_path / "robot.xml", '<compiler angle="degree"/>'))
    assert remarks(robot) == []
    (degree,) = robot.degrees
    assert (degree.name, round(degree.upper, 6), not_modelled(robot)) == ("bend", 0.349066, {})


@pytest.mark.usefixtures("by_pybullet")
def test_what_mjcf_ties_by_equality_is_remarked_upon(tmp_path):
    tie = '<compiler/><equality><joint joint1="bend" joint2="other"/></equality>'
    robot = read_robot(mjcf(tmp_path / "robot.xml", tie))
    assert remarks(robot) == ["The <equality> of the file is not read: the joints that it couples move freely."]


DEFAULT = '<compiler/><default><default class="knee"><joint range="-20 20" limited="true"/></default></default>'


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({}, "the joint bend has the range '-20 20' in degrees, which are taken for radians"),
        ({"more": 'type="hinge" range="-1 1"'}, "the joint bend is limited to range '-1 1', which is dropped"),
        ({"more": 'type="hinge" class="knee"', "compiler": DEFAULT}, "the joint bend is limited to range '-20 20'"),
        ({"more": ""}, "the joint bend has no type, and is a hinge, which is dropped"),
        ({"more": 'type="ball"'}, "the joint bend is a ball, which is dropped"),
        ({"more": 'type="hinge" ref="10"'}, "the joint bend has a ref, which is dropped"),
        ({"more": 'type="hinge"', "geom": 'size=".2"'}, "the geom end of the body tip has no type, and is a sphere"),
        ({"more": 'type="hinge"', "geom": 'type="hfield"'}, "the geom end of the body tip is a hfield"),
        (
            {"more": 'type="hinge"', "geom": 'type="box" size="1 1 1" euler="90 0 0"'},
            "the geom end of the body tip is turned by euler",
        ),
        ({"more": 'type="hinge"', "compiler": '<include file="x.xml"/>'}, "it has <include>, which is dropped"),
        ({"more": 'type="hinge"', "geom": 'type="mesh" mesh="m"'}, "the geom end of the body tip is of the mesh 'm'"),
    ],
)
def test_what_pybullet_would_change_of_mjcf_is_named(changed, reason, tmp_path):
    assert misread(root_of(mjcf(tmp_path / "robot.xml", **changed))).startswith(reason)


@pytest.mark.usefixtures("by_pybullet")
def test_the_refusal_of_mjcf_has_three_reasons_and_counts_the_others(tmp_path):
    path = mjcf(tmp_path / "robot.xml", more='ref="1" range="0 1"', geom="")
    said = refusal(path)
    assert said.startswith("pybullet would read the MJCF file wrongly: the joint bend has no type, and is a")
    assert said.endswith("; and 1 more") and said.count("; ") == 3


@pytest.mark.usefixtures("by_pybullet")
def test_shapes_and_audits_refuse_mjcf_with_the_same_words(tmp_path):
    path = mjcf(tmp_path / "robot.xml")
    with pytest.raises(NotRead) as refused:
        inventory(path)
    assert str(refused.value) == f"{path} cannot be read: {refusal(path)}"


def test_joints_of_one_body_in_different_places_are_refused(tmp_path):
    """pybullet moves such a body by the distance of its joints: a foot of humanoid.xml by 4 cm."""
    two = 'type="hinge" pos="0 0 .1"/><joint name="twist" type="hinge" axis="1 0 0"'
    path = mjcf(tmp_path / "robot.xml", more=two)
    assert misread(root_of(path)) == "the joints of the body tip are in different places"


@pytest.mark.usefixtures("by_pybullet")
def test_a_model_without_a_body_is_refused_alone_and_in_a_folder(tmp_path):
    path = tmp_path / "empty.xml"
    path.write_text("<mujoco><worldbody/></mujoco>\n")
    assert refusal(path) == "it has no body"
    assert read_asset(tmp_path, path, "m", 0.0, Modelling()).failure == "cannot be read: it has no body"
    with pytest.raises(NotRead, match=r"empty.xml cannot be read: it has no body$"):
        inventory(path)


@pytest.mark.parametrize(
    ("reason", "told"),
    [
        ("Default", ["arm and wall are disabled by the SRDF file as 'Default', and overlap in "]),
        ("", ["arm and wall are disabled by the SRDF file without a reason, and overlap in "]),
        ("Adjacent", ["arm and wall are disabled by the SRDF file as 'Adjacent', and overlap in "]),
        ("Always", ["arm and wall are disabled by the SRDF file as 'Always', and overlap in "]),
        ("Never", ["arm and wall never overlap by the SRDF file, but overlap in "]),
    ],
)
def test_a_disabled_pair_that_overlaps_sometimes_is_a_finding_whatever_the_reason(reason, told, tmp_path):
    found = audit(read_robot(turntable(tmp_path / "table.urdf")), 100)
    disabled = {frozenset(("arm", "wall")): reason, frozenset(("post", "disc")): "Adjacent"}
    expected = [("arm", "plate"), ("wall", "plate")]
    said = findings(found, expected, disabled)
    assert [each[: len(start)] for each, start in zip(said, told, strict=True)] == told
    assert not findings(found, [*expected, ("arm", "wall")], disabled)


def test_json_of_an_audit_names_what_is_not_modelled(wrecked, capfd):
    from overlapper.cli.audit import audit as command

    with pytest.raises(Exception, match="1"):
        command(wrecked, configurations=5, as_json=True)
    assert [*json.loads(capfd.readouterr().out)["not_modelled"]] == ["hip"]
