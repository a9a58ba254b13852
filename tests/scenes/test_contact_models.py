"""What pushes the bodies of a scene apart: contact points, or what they share."""

import pytest

from overlapper.scenes.run import run
from overlapper.scenes.scene import SceneError, load_scene

SCENE = '''"""A cube on a plane."""
import pybullet as p
STEPS = 100
def build(client):
    p.setGravity(0, 0, -9.81, physicsClientId=client)
    p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE, physicsClientId=client), physicsClientId=client)
    box = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.05] * 3, physicsClientId=client)
    p.createMultiBody(1, box, -1, [0, 0, 0.05 - 9.81e-5], physicsClientId=client)
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


def test_contact_points_have_no_forces_of_ours(scene):
    *_, frame = run(scene(), 3)
    assert frame.forces is None


def test_a_scene_says_what_its_contact_is_and_a_run_says_otherwise(scene):
    *_, frame = run(scene("CONTACT = 'volumetric'"), 3)
    assert frame.forces is not None
    *_, frame = run(scene("CONTACT = 'volumetric'"), 3, contact="bullet")
    assert frame.forces is None


def test_a_contact_that_is_none_is_refused(scene):
    with pytest.raises(SceneError, match=r"cube\.py has CONTACT = 'soft', which must be 'bullet' or 'volumetric'"):
        scene("CONTACT = 'soft'")
