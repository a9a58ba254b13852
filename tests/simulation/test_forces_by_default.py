"""Volumetric contact by default: stiffness from masses and sizes, restitution and rolling friction of the simulator."""

import warnings

import mujoco
import numpy as np
import pybullet as p
import pytest
from contact_experiments import World

import overlapper.mujoco
from overlapper.simulation import Bodies, VolumetricContact
from overlapper.simulation.cautions import DepthWarning, UnsettledWarning
from overlapper.simulation.forces.parameter import resting_stiffness

G = 9.81


def default(world, **given):
    return VolumetricContact(Bodies(world.client), **given)


def ball(world, radius, mass=1.0, height=0.0, **dynamics):
    body = world.body(mass, p.GEOM_SPHERE, [0, 0, radius + height], radius=radius)
    p.changeDynamics(body, -1, physicsClientId=world.client, **dynamics)
    return body


def test_the_stiffness_lets_a_ball_under_ten_times_its_weight_rest_at_a_thousandth_of_its_diameter():
    """The cap of a ball of radius R at the depth d has the volume π d² (R - d / 3)."""
    (stiffness,) = resting_stiffness(np.array([3.0]), np.array([0.2]))
    depth = 2e-4
    assert stiffness * np.pi * depth**2 * (0.1 - depth / 3) == pytest.approx(30, rel=1e-3)


@pytest.mark.parametrize("mass", [0.01, 100.0])
@pytest.mark.parametrize("size", [0.005, 1.0])
@pytest.mark.parametrize("kind", [p.GEOM_SPHERE, p.GEOM_BOX, p.GEOM_CYLINDER])
def test_bodies_of_any_mass_and_size_rest_less_than_a_thousandth_of_their_size_deep(kind, size, mass):
    shape = {p.GEOM_SPHERE: {"radius": size / 2}, p.GEOM_BOX: {"halfExtents": [size / 2] * 3}}
    figures = shape.get(kind, {"radius": size / 2, "height": size})
    with World() as world:
        body = world.body(mass, kind, [0, 0, size / 2 + 1e-3 * size], **figures)
        with default(world) as contact:
            for _ in range(120):
                contact.step()
                assert contact.substeps <= 2
        height = world.position(body)[2]
        assert 0 < size / 2 - height < 1e-3 * size
        assert contact.on(body)[0][2] == pytest.approx(mass * G, rel=1e-2)


def test_a_step_has_two_substeps_before_bodies_touch_and_one_where_they_rest():
    with World() as world:
        body = world.body(1.0, p.GEOM_BOX, [0, 0, 0.1], halfExtents=[0.05] * 3)
        with default(world) as contact:
            landing = []
            for _ in range(240):
                height = world.position(body)[2]
                contact.step()
                landing.append((height > 0.05, world.position(body)[2] < 0.05, contact.substeps))
        substeps = {
            (before, after): [n for b, a, n in landing if (b, a) == (before, after)] for before, after, _ in landing
        }
        assert set(substeps[True, False]) == {1} and substeps[True, True] == [2]
        assert substeps[False, True][0] == 2 and substeps[False, True][-60:] == [1] * 60


@pytest.mark.parametrize("share", [0.08, 0.12])
def test_a_step_has_two_substeps_if_a_body_slides_by_more_than_a_tenth_of_its_depth(share):
    with World() as world:
        body = world.body(1.0, p.GEOM_BOX, [0, 0, 0.05 - 1e-6], halfExtents=[0.05] * 3)
        with default(world, friction=0, stiffness=1e7) as contact:
            for _ in range(120):
                contact.step()
            depth = G / 1e7 / 0.1**2
            p.resetBaseVelocity(body, [share * depth * 240, 0, 0], physicsClientId=world.client)
            contact.step()
        assert contact.substeps == (1 if share < 0.1 else 2)


@pytest.mark.parametrize("turn", [0.019, 0.021])
def test_a_step_has_two_substeps_if_a_rolling_ball_turns_by_more_than_a_fiftieth(turn):
    with World() as world:
        body = ball(world, 0.05)
        with default(world) as contact:
            for _ in range(120):
                contact.step()
            p.resetBaseVelocity(body, [240 * turn * 0.05, 0, 0], [0, 240 * turn, 0], physicsClientId=world.client)
            contact.step()
        assert contact.substeps == (1 if turn < 0.02 else 2)


@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.9])
def test_a_ball_bounces_with_the_restitution_of_pybullet(restitution):
    with World() as world:
        body = ball(world, 0.05, height=0.2, restitution=restitution)
        p.changeDynamics(world.plane, -1, restitution=1.0, physicsClientId=world.client)
        fastest, up = 0.0, 0.0
        with default(world) as contact:
            for _ in range(120):
                contact.step()
                speed = world.velocity(body)[0][2]
                fastest = min(fastest, speed)
                up = max(up, speed)
    assert up / -fastest == pytest.approx(restitution, abs=0.05)


def test_a_given_restitution_replaces_that_of_the_simulator():
    with World() as world:
        body = ball(world, 0.05)
        world.push(body, [0, 0, -2])
        with default(world, restitution=0.7) as contact:
            contact.step()
            contact.step()
        assert world.velocity(body)[0][2] == pytest.approx(1.4, abs=0.1)


def rolling_speed(world, body, seconds, **given):
    p.changeDynamics(body, -1, linearDamping=0, angularDamping=0, physicsClientId=world.client)
    world.push(body, [1, 0, 0], [0, 1 / 0.05, 0])
    with default(world, **given) as contact:
        for _ in range(round(240 * seconds)):
            contact.step()
    return world.velocity(body)[0][0]


@pytest.mark.parametrize("given", [{}, {"rolling": 1e-3}])
def test_rolling_friction_slows_a_ball_down_by_its_length_over_the_radius(given):
    """Bullet's is that of each body times the lateral friction of the other body. dv/dt = -5/7 g length / radius."""
    speeds = []
    for own in (0.0, 1e-3):
        with World() as world:
            p.changeDynamics(world.plane, -1, lateralFriction=0.8, physicsClientId=world.client)
            more = {} if given else {"rollingFriction": own}
            body = ball(world, 0.05, lateralFriction=0.5, **more)
            speeds.append(rolling_speed(world, body, 0.5, **(given if own else {})))
    length = 1e-3 if given else 0.8e-3
    assert speeds[0] - speeds[1] == pytest.approx(5 / 7 * G * length / 0.05 * 0.5, rel=0.05)


def test_a_rolling_ball_is_slowed_down_by_less_than_a_fifth_of_a_percent_in_a_hundredth_of_a_second():
    with World() as world:
        body = ball(world, 0.05)
        assert 1 - 5 / 7 * 1e-3 * G / 0.05 * 0.5 * 1.2 < rolling_speed(world, body, 0.5) < 1


def test_bodies_that_stay_deep_in_each_other_are_reported_once():
    with World() as world:
        ball(world, 0.05)
        with default(world, stiffness=4e4) as contact, warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            for _ in range(120):
                contact.step()
    assert [each.category for each in told] == [DepthWarning]
    assert str(told[0].message).startswith("plane and sphere stay 0.0") and told[0].filename == __file__


MODEL = """<mujoco><option gravity="0 0 -9.81"/><worldbody><geom type="plane" size="5 5 1" friction="0.8 0.005 0.001"/>
<body pos="0 0 .05"><freejoint/><geom type="sphere" size=".05" mass="1" condim="{}" friction="0.8 0.005 0.001"/></body>
</worldbody></mujoco>"""


def test_rolling_friction_of_mujoco_acts_in_contacts_of_six_dimensions():
    speeds = []
    for dimensions in (3, 6):
        model = mujoco.MjModel.from_xml_string(MODEL.format(dimensions))
        data = mujoco.MjData(model)
        data.qvel[:] = [1, 0, 0, 0, 20, 0]
        mujoco.mj_forward(model, data)
        with VolumetricContact(overlapper.mujoco.Bodies(model, data)) as contact:
            for _ in range(250):
                contact.step()
        speeds.append(data.qvel[0])
    seconds = 250 * 0.002
    assert speeds[0] - speeds[1] == pytest.approx(5 / 7 * G * 1e-3 / 0.05 * seconds, rel=0.05)


STANDING = (0.0, 0.9, -1.8) * 4


@pytest.mark.parametrize(
    ("file", "height", "turn", "angles"),
    [
        ("laikago/laikago_toes.urdf", 0.48, (0, 0.5, 0.5, 0), (0.0,) * 12),
        ("a1/a1.urdf", 0.32, (0, 0, 0, 1), STANDING),
        ("mini_cheetah/mini_cheetah.urdf", 0.3, (0, 0, 0, 1), (0.0, -0.8, 1.6) * 4),
    ],
)
def test_forces_on_a_robot_that_lands_are_settled_in_every_substep(client, file, height, turn, angles):
    """Solved again at one pose twelve times, they are the same to 1e-7 of the largest."""
    p.setGravity(0, 0, -G, physicsClientId=client)
    p.loadURDF("plane.urdf", physicsClientId=client)
    robot = p.loadURDF(file, [0, 0, height], turn, physicsClientId=client)
    count = p.getNumJoints(robot, physicsClientId=client)
    kinds = [p.getJointInfo(robot, joint, physicsClientId=client)[2] for joint in range(count)]
    joints = [joint for joint, kind in enumerate(kinds) if kind == p.JOINT_REVOLUTE]
    for joint, angle in zip(joints, angles):
        p.resetJointState(robot, joint, angle, physicsClientId=client)
    with VolumetricContact(Bodies(client)) as contact, warnings.catch_warnings():
        warnings.simplefilter("error", UnsettledWarning)
        for _ in range(100):
            for joint, angle in zip(joints, angles):
                p.setJointMotorControl2(robot, joint, p.POSITION_CONTROL, angle, force=33, physicsClientId=client)
            contact.step()
            assert contact.residual <= 1e-8 and contact.sweeps <= 40
        first = contact.forces()
        assert len(first) >= 2
        for _ in range(12):
            again = contact.forces()
            assert again.force == pytest.approx(first.force, rel=0, abs=1e-7 * np.abs(first.force).max())
