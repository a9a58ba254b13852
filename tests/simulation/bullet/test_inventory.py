"""`overlapper shapes` lists the modelled shapes of a file, also if pybullet crashes."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pybullet as p
import pybullet_data
import pytest
import trimesh

from overlapper.simulation.bullet.inventory import inventory
from overlapper.simulation.bullet.model_file import NotRead
from overlapper.simulation.settings import Modelling

DATA = Path(pybullet_data.getDataPath())
FLAT = """<robot name="plate"><link name="top"><collision><geometry><mesh filename="flat.obj"/></geometry></collision>
<collision><geometry><box size=".1 .2 .3"/></geometry></collision></link></robot>"""

# A part of a humanoid, of capsules from one point to another.
HUMANOID = """<mujoco><worldbody>
<geom name="floor" type="plane" size="5 5 0.1" pos="0 0 0"/>
<body name="torso" pos="0 0 1.4">
  <geom type="capsule" fromto="0 -.07 0 0 .07 0" size=".07"/><geom type="sphere" pos="0 0 .19" size=".09"/>
  <geom type="capsule" fromto="-.01 -.06 -.12 -.01 .06 -.12" size=".06"/>
  <body name="thigh" pos="0 0 -.2">
    <joint name="hip" type="hinge" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 .01 -.34" size=".06"/>
    <body name="shin" pos="0 .01 -.403">
      <joint name="knee" type="hinge" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -.3" size=".049"/>
    </body>
  </body>
</body>
</worldbody></mujoco>
"""


def command(*arguments):
    run = subprocess.run([sys.executable, "-m", "overlapper", "shapes", *arguments], capture_output=True, text=True)
    return run.returncode, run.stdout, run.stderr


def test_every_link_is_listed_with_its_shapes_and_the_links_it_can_meet(tmp_path):
    path = tmp_path / "humanoid.xml"
    path.write_text(HUMANOID)
    found = inventory(path)  # of which getCollisionShapeData would die
    assert (found.bodies, found.shapes, found.shapes_read, found.skipped) == (2, 6, 6, ())
    floor, torso, *limbs = found.links
    assert [shape.kind for shape in floor.shapes] == ["plane"] and floor.meets == 3
    assert [shape.kind for shape in torso.shapes] == ["capsule", "sphere", "capsule"]
    assert torso.shapes[1].size == "radius 0.09" and torso.meets == 1
    assert {limb.meets for limb in limbs} == {1}
    assert found.pairs == 5
    listed = json.loads(json.dumps(found.as_dict(), allow_nan=False))["links"]
    assert listed[0]["shapes"][0]["volume"] is None
    assert listed[1]["shapes"][1]["volume"] == pytest.approx(4.18879 * 0.09**3, rel=1e-5)


def test_self_collision_adds_the_links_that_a_link_can_meet():
    path = DATA / "TwoJointRobot_wo_fixedJoints.urdf"
    alone, together = inventory(path), inventory(path, self_collision=True, modelling=Modelling(surface="margin"))
    assert alone.pairs == 0 and {link.meets for link in alone.links} == {0}
    assert together.pairs == sum(link.meets for link in together.links) // 2 > 0
    sizes = [shape.size for link in together.links for shape in link.shapes if shape.kind == "hull"]
    assert sizes and all(size.endswith("rounded by 0.001") for size in sizes)


def test_skipped_shapes_are_named_with_their_reason_and_give_exit_code_1(tmp_path):
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n"
    (tmp_path / "flat.obj").write_text(f"o flat\n{corners}f 1 2 3\nf 2 3 4\n")
    (tmp_path / "plate.urdf").write_text(FLAT)
    code, said, complaints = command(str(tmp_path / "plate.urdf"))
    assert (code, complaints) == (1, "")
    assert "\nplate " in said and "box" in said and "0.1 × 0.2 × 0.3" in said and "6,000" in said
    assert "1 body, 1 of 2 shapes modelled, 0 pairs of shapes that pybullet lets collide." in said
    assert "Not modelled: plate, 1 of 2 shapes: vertices are flat" in said


def test_each_convex_part_of_a_saved_mesh_counts_as_a_shape(tmp_path):
    box = trimesh.creation.box((0.2, 0.2, 0.2))
    two = trimesh.util.concatenate([box, box.copy().apply_translation((1, 0, 0))])
    client = p.connect(p.DIRECT)
    mesh = {"vertices": two.vertices.tolist(), "indices": two.faces.ravel().tolist()}
    flags = p.GEOM_FORCE_CONCAVE_TRIMESH
    shape = p.createCollisionShape(p.GEOM_MESH, **mesh, flags=flags, physicsClientId=client)
    p.createMultiBody(0, shape, physicsClientId=client)
    p.saveBullet(str(tmp_path / "two.bullet"), physicsClientId=client)
    p.disconnect(client)
    found = inventory(tmp_path / "two.bullet")
    assert found.decomposed == (("body 0", 2),)
    assert (found.bodies, found.shapes, found.shapes_read) == (1, 2, 2)


def test_a_scene_that_was_saved_is_listed(tmp_path):
    client = p.connect(p.DIRECT)
    for x in range(3):
        shape = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.1, 0.2, 0.3], physicsClientId=client)
        p.createMultiBody(x % 2, shape, basePosition=[x, 0, 0], physicsClientId=client)
    p.saveBullet(str(tmp_path / "scene.bullet"), physicsClientId=client)
    p.disconnect(client)
    found = inventory(tmp_path / "scene.bullet")
    assert [link.name for link in found.links] == ["body 0", "body 1", "body 2"]
    assert [shape.size for link in found.links for shape in link.shapes] == ["0.2 × 0.4 × 0.6"] * 3
    assert (found.shapes, found.shapes_read, found.pairs, [link.meets for link in found.links]) == (3, 3, 2, [1, 2, 1])
    (tmp_path / "cut.bullet").write_bytes((tmp_path / "scene.bullet").read_bytes()[:1000])
    with pytest.raises(NotRead, match="cut short"):
        inventory(tmp_path / "cut.bullet")


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("gripper/wsg50_one_motor_gripper_free_base.sdf", "pybullet crashes on .*free_base.sdf with signal SIGSEGV"),
        ("kuka_iiwa/model_for_sdf.urdf", "model_for_sdf.urdf cannot be read: pybullet says 'Cannot load URDF file'"),
        ("no_such.urdf", "there is no file .*no_such.urdf"),
        ("plane.obj", r"must end in \.urdf, \.sdf, \.xml, \.bullet, not 'plane.obj'"),
    ],
)
def test_a_file_that_pybullet_does_not_load_is_reported_in_one_sentence(name, sentence, monkeypatch):
    monkeypatch.setenv("ASAN_OPTIONS", os.environ.get("ASAN_OPTIONS", "") + ":handle_segv=0")
    with pytest.raises(NotRead, match=sentence):
        inventory(DATA / name)


def test_a_file_that_is_not_loaded_is_exit_code_2():
    code, said, complaints = command("no_such.urdf")
    assert (code, said, complaints) == (2, "", "overlapper: there is no file no_such.urdf\n")
