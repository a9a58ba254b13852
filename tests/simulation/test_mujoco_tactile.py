"""Tactile images of geoms of MuJoCo."""

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco")

from overlapper.mujoco import Bodies, TactileImage, TaxelGrid, Taxels, VolumetricContact  # noqa: E402

# A gripper of two pads, which holds a box. One pad is turned against its body.
GRIPPER = """
<mujoco><option timestep="0.002"/><worldbody>
  <body pos="-.03 0 .2"><joint name="left" type="slide" axis="1 0 0"/>
    <geom name="left" type="box" size=".01 .02 .015" mass=".1"/></body>
  <body pos=".03 0 .2"><joint name="right" type="slide" axis="1 0 0"/>
    <geom name="right" type="box" size=".02 .01 .015" mass=".1" euler="0 0 90"/></body>
  <body pos="0 .005 .2"><freejoint/><geom name="box" type="box" size=".02 .03 .03" mass=".2"/></body>
</worldbody><actuator><motor joint="left"/><motor joint="right"/></actuator></mujoco>
"""
ACROSS = np.sqrt(0.5)


@pytest.fixture
def held(monkeypatch, tmp_path):
    """A box held by 10 N, with the numbers of the geoms."""
    monkeypatch.chdir(tmp_path)  # MuJoCo logs its warnings in the working folder
    model = mujoco.MjModel.from_xml_string(GRIPPER)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    data.ctrl[:] = 10, -10
    with VolumetricContact(Bodies(model, data)) as contact:
        for _ in range(100):
            contact.step()
        yield contact, {name: (model.geom(name).bodyid[0], model.geom(name).id) for name in ("left", "right", "box")}


def test_both_pads_of_a_gripper_feel_the_grip_and_half_of_the_weight(held):
    contact, geoms = held
    left = TaxelGrid((0.03, 0.04), (6, 8), (0.01, 0, 0), (0, ACROSS, 0, ACROSS))  # z along the geom's x
    # The right geom is turned by a quarter about z, so its inner side has the normal y.
    right = TaxelGrid((0.04, 0.03), (8, 6), (0, 0.01, 0), (-ACROSS, 0, 0, ACROSS))
    weight = 0.0
    for name, grid, push in (("left", left, -10), ("right", right, 10)):
        felt = contact.pressure(geoms[name], grid)
        assert isinstance(felt, TactileImage)
        total = felt.force.sum(axis=(0, 1))
        weight -= total[2]
        # How two pads that stick share the weight follows from how the box came between them.
        assert total == pytest.approx([push, 0, -0.5 * 0.2 * 9.81], abs=2e-3)
        assert np.abs(felt.outside).max() < 1e-12 * abs(push)
        assert felt.pressure.mean() == pytest.approx(10 / (0.03 * 0.04), rel=1e-3)
        assert np.linalg.norm(felt.shear.mean(axis=(0, 1))) == pytest.approx(-total[2] / (0.03 * 0.04), rel=1e-6)
    assert weight == pytest.approx(0.2 * 9.81, rel=1e-5)


def test_an_image_is_that_of_its_time(held):
    contact, geoms = held
    points = np.stack(np.meshgrid([0.01], np.linspace(-0.018, 0.018, 7), np.linspace(-0.013, 0.013, 5)), -1)
    taxels = Taxels(points.reshape(-1, 3), np.tile([1, 0, 0], (35, 1)), reach=0.01)
    before, felt = contact.last, contact.pressure(geoms["left"], taxels)
    assert np.abs(felt.outside).max() < 1e-12 * 10
    contact.bodies.data.ctrl[:] = 0
    for _ in range(30):
        contact.step()
    assert np.array_equal(before.pressure(geoms["left"], taxels).force, felt.force)


def test_a_body_has_no_pad_but_a_geom_has(held):
    contact, geoms = held
    with pytest.raises(ValueError, match=r"^link \(1, -1\) has no modelled shape$"):
        contact.pressure((1, -1), TaxelGrid((1, 1), (2, 2)))
    assert contact.pressure(geoms["box"], TaxelGrid((1, 1), (2, 2))).pressure.shape == (2, 2)
