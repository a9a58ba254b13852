"""Derivatives of a step with volumetric contact, against central differences of the core's solver and of pybullet."""

import math
import re

import mujoco
import numpy as np
import pybullet as p
import pybullet_data
import pytest
from contact_experiments import HALF, POSES, STEP, G, World
from scipy.spatial.transform import Rotation
from step_differences import CAUSES, Resolved

from overlapper import Box, HalfSpace, Hull, Placed, Sphere, overlap
from overlapper.mujoco import Bodies as MujocoBodies
from overlapper.simulation import Bodies, VolumetricContact
from overlapper.simulation.forces.moving_patch import following

LAWS = {"given": {"stiffness": 1e6, "dissipation": 1e-3}, "default": {"stiffness": 1e6}}
TURN = p.getQuaternionFromEuler([0.2, 0.3, 0.4])


def stepping(world, steps=None, pairs=None, then=0, **laws):
    """A contact after so many steps, or as soon as bodies touch and some steps later."""
    contact = VolumetricContact(Bodies(world.client), substeps=1, pairs=pairs, **laws)
    with contact:
        for _ in range(steps or 200):
            contact.step()
            if steps is None and len(contact):
                break
        for _ in range(then):
            contact.step()
    assert len(contact)
    return contact


def resting(world, **laws):
    world.box(*[HALF] * 3, position=[0, 0, HALF])
    return stepping(world, 100, **laws)


def leaning(world, **laws):
    """Friction holds a cube on an incline."""
    world.pull(0.3 * G, 0, -G)
    return resting(world, **laws)


def sliding(world, **laws):
    cube = world.box(HALF, 0.04, 0.03, position=[0, 0, 0.0295])
    world.push(cube, [1, 0.3, 0], [0.2, 0.1, 3])
    return stepping(world, 4, **laws)


def tumbling(world, then=0, **laws):
    """A box that falls on a corner, turning."""
    box = world.box(HALF, 0.04, 0.03, position=[0, 0, HALF], orientation=[0.1, 0.2, 0.3, 0.9])
    world.push(box, [1, 0.3, -0.3], [2, -3, 0.4])
    return stepping(world, then=then, **laws)


def bouncing(world, **laws):
    """Pressures at the edge of the patch, as the cube turns fast."""
    cube = world.box(*[HALF] * 3, position=[0, 0, 0.09], orientation=POSES["skew"])
    world.push(cube, [0.2, 0.1, -1], [1, 0.3, 0.2])
    return stepping(world, then=1, **laws)


def stacked(world, **laws):
    for k in range(3):
        box = world.box(HALF, HALF * (1 - 0.1 * k), HALF, position=[0.003 * k, 0, HALF * (2 * k + 1)])
    world.push(box, [0.1, 0.05, 0], [0, 0, 0.1])
    return stepping(world, 3, **laws)


def in_parts(world, **laws):
    """Two boxes on one link: their patches share their damping."""
    shape = p.createCollisionShapeArray(
        [p.GEOM_BOX] * 2,
        halfExtents=[[HALF / 2, HALF, HALF]] * 2,
        collisionFramePositions=[[x, 0, 0] for x in (-HALF / 2, HALF / 2)],
        physicsClientId=world.client,
    )
    turn = p.getQuaternionFromEuler([0.05, 0.03, 0.2])
    cube = p.createMultiBody(1, shape, -1, [0, 0, HALF + 4e-3], turn, physicsClientId=world.client)
    world.undamped(cube, 0.5)
    world.push(cube, [0.4, 0.1, -0.5], [0.5, 1, 0.2])
    return stepping(world, 3, **laws)


def capsule(world, **laws):
    body = world.body(
        1, p.GEOM_CAPSULE, [0, 0, 0.0499], [0, math.sqrt(0.5), 0, math.sqrt(0.5)], radius=0.05, height=0.2
    )
    world.push(body, [0.1, 0.1, -0.1], [1, 0.3, 0.2])
    return stepping(world, 4, **laws)


def ball(world, **laws):
    """A ball that touches down, so that the solver remembers nothing of it."""
    body = world.body(1, p.GEOM_SPHERE, [0, 0, 0.0499], radius=0.05)
    world.push(body, [1, 0.1, -0.1], [1, 20, 0.2])
    return VolumetricContact(Bodies(world.client), substeps=1, **laws)


def resisted(world, **laws):
    """A cube that turns and rubs, with rolling and spinning friction."""
    cube = world.box(*[HALF] * 3, position=[0, 0, HALF - 1e-3])
    for id in (cube, world.plane):
        p.changeDynamics(id, -1, rollingFriction=1e-3, spinningFriction=2e-3, physicsClientId=world.client)
    world.push(cube, [0.4, 0.1, 0], [0.5, 0.3, 2])
    return stepping(world, 2, **laws)


def sunk(world, **laws):
    """A needle that is deeper in the ground than it is wide."""
    turn = p.getQuaternionFromEuler([0.05, 0.03, 0.2])
    needle = world.box(0.01, 0.01, 0.15, position=[0, 0, 0.1], orientation=turn)
    world.push(needle, [0.04, 0.01, -0.05], [0.05, 0.1, 0.2])
    return stepping(world, 1, **laws)


def rebounding(world):
    cube = world.box(*[HALF] * 3, position=[0, 0, 0.09], orientation=POSES["skew"])
    for id in (cube, world.plane):
        p.changeDynamics(id, -1, restitution=0.8, physicsClientId=world.client)
    world.push(cube, [0.2, 0.1, -1], [1, 0.3, 0.2])
    return stepping(world, stiffness=1e6)


def freed(world, body):
    """Turn Bullet's own motors of joints off."""
    for joint in range(p.getNumJoints(body, world.client)):
        p.setJointMotorControl2(body, joint, p.VELOCITY_CONTROL, force=0, physicsClientId=world.client)


def arm(world, **laws):
    """A free base with a hinge and a slider that are not along its axes; its tip lands on the ground."""
    shapes = [
        p.createCollisionShape(p.GEOM_BOX, halfExtents=half, physicsClientId=world.client)
        for half in ([0.15, 0.03, 0.03], [0.05] * 3)
    ]
    body = p.createMultiBody(
        *(1.5, shapes[0], -1, [0, 0, 0.3], p.getQuaternionFromEuler([0.1, 0.2, 0.3])),
        linkMasses=[1, 0.7],
        linkCollisionShapeIndices=[-1, shapes[1]],
        linkVisualShapeIndices=[-1, -1],
        linkPositions=[[0.2, 0, 0], [0.1, 0, -0.2]],
        linkOrientations=[[0, 0, 0, 1]] * 2,
        linkInertialFramePositions=[[0.02, 0.01, 0]] * 2,
        linkInertialFrameOrientations=[TURN] * 2,
        linkParentIndices=[0, 1],
        linkJointTypes=[p.JOINT_REVOLUTE, p.JOINT_PRISMATIC],
        linkJointAxis=[[0, 1, 0.3], [0, 0.2, 1]],
        physicsClientId=world.client,
    )
    world.undamped(body, 0.5)
    freed(world, body)
    for joint, (position, speed) in enumerate([(0.1, -0.5), (0.02, 0.3)]):
        p.resetJointState(body, joint, position, speed, world.client)
    world.push(body, [0.2, 0.1, -0.5], [0.3, 0.4, 0.2])
    return stepping(world, then=1, **laws)


def panda(world, **laws):
    """The fingers of a robot that hit a cube."""
    p.setAdditionalSearchPath(pybullet_data.getDataPath(), world.client)
    robot = p.loadURDF("franka_panda/panda.urdf", useFixedBase=True, physicsClientId=world.client)
    for joint, position in enumerate([0, 0.9, 0, -1.2, 0, 2.1, 0.8]):
        p.resetJointState(robot, joint, position, 0.1 * (-1) ** joint, world.client)
    freed(world, robot)
    hand = p.getLinkState(robot, 8, physicsClientId=world.client)[4]
    cube = world.box(*[HALF] * 3, position=[hand[0], hand[1], hand[2] - 0.155])
    world.push(cube, [0, 0, 0.3], [0.3, 0.2, 0.1])
    return stepping(world, pairs=[(robot, cube)], **laws)


def hardening(world, **laws):
    return tumbling(world, then=1, hardening=500, **laws)


SCENES = [resting, leaning, sliding, tumbling, bouncing, stacked, in_parts, sunk, ball, resisted, arm, panda, hardening]


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("scene", SCENES)
def test_derivatives_are_central_differences(scene, law):
    with World() as world:
        resolved = Resolved.of(scene(world, **LAWS[law]))
        assert {each.reason for each in resolved.derivatives.kinks} <= ({"tipping"} if scene is resting else set())
        for cause in CAUSES:
            assert resolved.error(cause) < 1e-6, cause


def test_derivatives_in_a_pile_are_central_differences():
    """Twelve boxes at random, of which some touch without pressure. A step of each cause in eight."""
    rng = np.random.default_rng(5)
    with World() as world:
        for k in range(12):
            turn = p.getQuaternionFromEuler(rng.uniform(-3, 3, 3))
            place = [*rng.uniform(-0.06, 0.06, 2), 0.08 + 0.05 * k]
            world.box(*rng.uniform(0.03, 0.05, 3), position=place, orientation=turn)
        resolved = Resolved.of(stepping(world, 80, **LAWS["default"]))
        derived = resolved.derivatives
        assert len(derived.forces) > 8 and (np.linalg.norm(derived.forces.force, axis=1) == 0).any()
        assert not derived.kinks
        for cause in CAUSES:
            found = getattr(derived, f"velocity_by_{cause}")
            for which in range(0, found.shape[1], 8):
                column = resolved.difference(cause, which)[0]
                assert np.abs(column - found[:, which]).max() < 1e-6 * np.abs(found).max(), (cause, which)


def test_derivatives_of_a_bounce_are_central_differences():
    with World() as world:
        resolved = Resolved.of(rebounding(world))
        assert any(group.laws.regimes.bouncing.any() for group in groups(resolved.contact))
        assert not resolved.derivatives.kinks
        for cause in CAUSES:
            assert resolved.error(cause) < 1e-6, cause


def groups(contact):
    """The patches of the last solution, between two links each."""
    from overlapper.simulation.forces.equations import StepEquations

    made = []
    init = StepEquations._solve

    def kept(self):
        init(self)
        made.extend(self._groups)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(StepEquations, "_solve", kept)
        contact.derivatives()
    return made


def test_a_capsule_has_all_derivatives_but_those_by_pose():
    with World() as world:
        resolved = Resolved.of(capsule(world, **LAWS["given"]))
        for cause in set(CAUSES) - {"pose"}:
            assert resolved.error(cause) < 1e-6, cause
        sentence = (
            "derivatives by pose are not known for the contact between (0, -1) and (1, -1) of a HalfSpace and a "
            "Capsule: they are known for polyhedra, and for a Sphere on a HalfSpace"
        )
        for name in ("velocity_by_pose", "contact_by_pose", "A"):
            with pytest.raises(ValueError, match=f"^{re.escape(sentence)}$"):
                getattr(resolved.derivatives, name)
        assert resolved.derivatives.B.shape == (24, 12)


def test_the_solution_is_that_of_the_step():
    with World() as world:
        contact = stacked(world, **LAWS["given"])
        resolved = Resolved.of(contact)
        derived = resolved.derivatives
        assert derived.forces is contact.last
        assert np.abs(resolved.solved()[0] - derived.velocity).max() < 1e-13
        assert repr(derived) == "StepDerivatives(24 coordinates, 3 contacts, smooth)"
        assert derived.coordinates[6:12] == [(1, -1, name) for name in ("x", "y", "z", "rx", "ry", "rz")]


def test_coordinates_of_joints_are_named():
    with World() as world:
        derived = arm(world, **LAWS["given"]).derivatives()
        assert derived.coordinates[12:] == [(1, 0, "joint"), (1, 1, "joint")]


# Steps of pybullet


class Restarted:
    """A state of pybullet, from which a step is made with other velocities, poses and forces of one free body."""

    def __init__(self, world, body, contact):
        self.world, self.body, self.contact = world, body, contact
        self.begin = self.state()
        self.saved = p.saveState(world.client)

    def state(self):
        position, orientation = p.getBasePositionAndOrientation(self.body, self.world.client)
        return np.array(position), Rotation.from_quat(orientation), np.concatenate(self.world.velocity(self.body))

    def end(self, motion=(0,) * 6, velocity=(0,) * 6, force=(0,) * 6):
        """How far (12,) the pose and the velocity at the end of the step are from those at its beginning."""
        client = self.world.client
        p.restoreState(self.saved, physicsClientId=client)
        motion, force = np.array(motion, dtype=float), np.array(force, dtype=float)
        position, turn, speed = self.begin
        at = position + motion[:3]
        p.resetBasePositionAndOrientation(
            self.body, at, (Rotation.from_rotvec(motion[3:]) * turn).as_quat(), physicsClientId=client
        )
        speed = speed + velocity
        p.resetBaseVelocity(self.body, speed[:3], speed[3:], client)
        # The solver knows external forces one step later, so they act as in the step before here.
        if force.any():
            p.applyExternalForce(self.body, -1, force[:3], at, p.WORLD_FRAME, client)
            p.applyExternalTorque(self.body, -1, force[3:], p.WORLD_FRAME, client)
        self.contact.step()
        position, turn, speed = self.state()
        moved = (turn * self.begin[1].inv()).as_rotvec()
        return np.concatenate([position - self.begin[0], moved, speed])


@pytest.mark.parametrize("law", LAWS)
def test_a_step_of_pybullet_has_these_derivatives(law):
    """Bullet also turns the axis of a spinning box, which is held here. So the box is a cube."""
    with World() as world:
        cube = world.box(*[HALF] * 3, position=[0, 0, 0.09], orientation=POSES["skew"])
        world.push(cube, [0.2, 0.1, -1], [1, 0.3, 0.2])
        contact = VolumetricContact(Bodies(world.client), substeps=1, friction=0.3, **LAWS[law])
        with contact:
            while not len(contact):
                contact.step()
            restarted = Restarted(world, cube, contact)
            reference = restarted.end()
            derived = contact.derivatives()
            turned = Rotation.from_rotvec(reference[3:6])
            columns = []
            for name, step in (("motion", 1e-7), ("velocity", 1e-5)):
                for unit in np.eye(6):
                    ends = [restarted.end(**{name: sign * step * unit}) for sign in (1, -1)]
                    change = (ends[0] - ends[1]) / (2 * step)
                    # From differences of rotation vectors to a small motion at the end.
                    ways = [Rotation.from_rotvec(each[3:6]) * turned.inv() for each in ends]
                    change[3:6] = (ways[0].as_rotvec() - ways[1].as_rotvec()) / (2 * step)
                    columns.append(change)
    own = [*range(6, 12), *range(18, 24)]
    found, expected = derived.A[np.ix_(own, own)], np.array(columns).T
    for rows in (slice(0, 6), slice(6, 12)):
        for side in (slice(0, 6), slice(6, 12)):
            error = np.abs(found[rows, side] - expected[rows, side]).max()
            assert error < 2e-6 * np.abs(expected[rows, side]).max()


def test_bodies_in_free_flight_have_the_derivatives_of_their_masses():
    with World() as world:
        box = world.box(0.1, 0.2, 0.3, mass=2, position=[0, 0, 3], orientation=TURN)
        world.push(box, [1, 2, 3], [0.3, 0.2, 0.1])
        contact = VolumetricContact(Bodies(world.client), substeps=1)
        contact.forces()
        derived = contact.derivatives()
        turn = world.turn(box)
        angular = turn @ np.diag(1 / world.inertia(box)) @ turn.T
    own = slice(6, 12)
    assert derived.velocity_by_velocity[own, own] == pytest.approx(np.eye(6))
    assert derived.velocity_by_force[own, own][:3, :3] == pytest.approx(STEP / 2 * np.eye(3))
    assert derived.velocity_by_force[own, own][3:, 3:] == pytest.approx(STEP * angular)
    assert not derived.velocity_by_force[:6].any() and not derived.kinks
    kept, moved = derived.moved
    vector = STEP * np.array([0.3, 0.2, 0.1])
    step = 1e-6
    for axis in range(3):
        ends = [Rotation.from_rotvec(vector + sign * step * STEP * np.eye(3)[axis]) for sign in (1, -1)]
        change = [(each * Rotation.from_rotvec(vector).inv()).as_rotvec() for each in ends]
        assert moved[9:12, 9 + axis] == pytest.approx((change[0] - change[1]) / (2 * step), abs=1e-10)
    assert kept[9:12, 9:12] == pytest.approx(Rotation.from_rotvec(vector).as_matrix())


# What is not smooth


def kinks(contact):
    return {each.reason for each in contact.derivatives().kinks}


@pytest.mark.parametrize(("over", "told"), [(1 + 1e-8, {"cone"}), (1.01, set()), (0.5, set())])
def test_friction_at_its_limit_is_told(over, told):
    """A cube on an incline needs all of its friction: it slips if it is pulled, and sticks if it is pushed back."""
    with World(gravity=(0.3 * G, 0, -G)) as world:
        world.box(*[HALF] * 3, position=[0, 0, HALF - G / (1e6 * 4 * HALF**2)])
        (force,) = VolumetricContact(Bodies(world.client), substeps=1, **LAWS["given"]).forces().force
        contact = VolumetricContact(
            Bodies(world.client), substeps=1, friction=abs(force[0] / force[2]) * over, **LAWS["given"]
        )
        resolved = Resolved.of(contact)
        assert {each.reason for each in resolved.derivatives.kinks} == told
        if told:
            (kink,) = resolved.derivatives.kinks
            assert kink.row == 0 and kink.pair == (0, -1, 0, 1, -1, 0)
            assert str(kink) == "(0, -1) and (1, -1): the friction is at its limit and the contact does not slip"
            still, *ends = (resolved.solved("force", 6, step)[0][6] for step in (0, 1e-2, -1e-2))
            assert abs(ends[0] - still) > 1.5 * abs(ends[1] - still)
        else:
            assert resolved.error("force") < 1e-6


def test_a_contact_that_opens_is_told():
    """A cube moves away just so fast that the damping takes all of the pressure."""
    tau, depth = 1e-3, 1e-4
    with World(gravity=(0, 0, 0)) as world:
        cube = world.box(*[HALF] * 3, position=[0, 0, HALF - depth])
        for speed, told in ((depth / tau, {"opening"}), (0.9 * depth / tau, set()), (1.1 * depth / tau, set())):
            world.push(cube, [0, 0, speed])
            contact = VolumetricContact(Bodies(world.client), substeps=1, **LAWS["given"])
            found = contact.forces()
            assert (np.linalg.norm(found.force) > 1e-6) == (speed < 0.95 * depth / tau)
            assert kinks(contact) == told


def test_an_impact_at_its_threshold_is_told():
    with World(gravity=(0, 0, 0)) as world:
        cube = world.box(*[HALF] * 3, position=[0, 0, HALF - 1e-6])
        for speed, told in ((0.2, {"impact"}), (0.21, set()), (0.19, set())):
            world.push(cube, [0, 0, -speed])
            contact = VolumetricContact(Bodies(world.client), stiffness=1e6, substeps=1, restitution=0.5)
            contact.forces()
            assert kinks(contact) == told


def test_a_body_that_does_not_turn_is_told_with_the_default_damping():
    """Whether its contact stays as it tips or goes on as it rolls shows only as it turns."""
    with World() as world:
        assert kinks(resting(world, **LAWS["default"])) == {"tipping"}


def test_a_rolling_ball_is_told():
    """Its contact goes on with its centre, just at the limit where tipping begins."""
    with World() as world:
        contact = ball(world, **LAWS["given"])
        with contact:
            for _ in range(3):
                contact.step()
        assert kinks(contact) == {"tipping"}


def test_forces_that_feet_could_share_are_told_and_velocities_are_right():
    """A slab that sticks to two boxes at once, which would tear it if they moved by themselves."""
    with World() as world:
        for x in (-0.1, 0.1):
            world.box(HALF, HALF, HALF, mass=0, position=[x, 0, 0.2])
        world.box(0.2, 0.04, 0.02, position=[0, 0, 0.2699])
        resolved = Resolved.of(stepping(world, 3, **LAWS["given"]))
        assert {each.reason for each in resolved.derivatives.kinks} == {"shared"}
        own = slice(18, 24)
        for cause in ("velocity", "force"):
            found = resolved.differences(cause)[0][:, own]
            derived = getattr(resolved.derivatives, f"velocity_by_{cause}")[:, own]
            assert np.abs(derived - found).max() < 1e-6 * np.abs(found).max()
        apart = resolved.derivatives.velocity_by_velocity[:, 7]
        assert np.isnan(apart).all()


# What is refused


def test_derivatives_before_a_step_are_refused():
    with World() as world:
        world.box(*[HALF] * 3, position=[0, 0, HALF])
        contact = world.contact()
        with pytest.raises(ValueError, match=r"^derivatives are those of a step: call step\(\) or forces\(\) first$"):
            contact.derivatives()


def refused(contact, what):
    contact.forces()
    with pytest.raises(ValueError, match=f"^derivatives are not known for {re.escape(what)}$"):
        contact.derivatives()


def test_derivatives_in_mujoco_are_refused():
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body><freejoint/><geom type="box" size=".1 .1 .1"/></body></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    refused(VolumetricContact(MujocoBodies(model, data)), "MuJoCo's bodies, whose masses MuJoCo alone knows")


def test_derivatives_with_friction_at_points_motors_or_constraints_are_refused():
    with World() as world:
        cube = world.box(*[HALF] * 3, position=[0, 0, HALF])
        other = world.box(*[HALF] * 3, position=[0, 0, 3 * HALF])
        refused(world.contact(friction="distributed"), 'friction="distributed"')
        p.createConstraint(
            *(cube, -1, other, -1, p.JOINT_FIXED, [0, 0, 0], [0, 0, HALF], [0, 0, -HALF]), physicsClientId=world.client
        )
        refused(world.contact(), "constraints, and motors that a script commands")


def test_derivatives_by_pose_of_a_face_in_the_plane_of_another_are_refused():
    with World() as world:
        world.box(0.1, 0.1, 0.1, mass=0, position=[0, 0, -0.1])
        p.removeBody(world.plane, world.client)
        world.box(*[HALF] * 3, position=[0.1 - HALF, 0, HALF - 1e-3])
        contact = VolumetricContact(Bodies(world.client), substeps=1, **LAWS["given"])
        contact.forces()
        derived = contact.derivatives()
        with pytest.raises(
            ValueError, match=r"where (a face|a vertex or an edge) lies in the plane of (another|a) face$"
        ):
            _ = derived.A


# Patches that move


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (
            Placed(Box([0.1] * 3), (0, 0, 0.098), Rotation.from_rotvec([0.01, 0.02, 0.3]).as_quat()),
            HalfSpace([0, 0, 1], 0),
        ),
        (
            Placed(Box([0.1] * 3), (0, 0, 0.145), Rotation.from_rotvec([0.7, 0.1, 0.3]).as_quat()),
            Placed(Box([0.2, 0.3, 0.05]), (0.02, 0.01, -0.04), Rotation.from_rotvec([0.02, 0.03, 0.3]).as_quat()),
        ),
        (
            Placed(Box([0.1] * 3), (0.15, 0, 0.1), Rotation.from_rotvec([0.7, 0.1, 0.3]).as_quat()),
            Placed(Hull(np.random.default_rng(1).normal(size=(12, 3)) * 0.1), (0.02, 0.01, -0.04)),
        ),
        (Placed(Sphere(0.1), (0.15, 0.2, 0.09)), HalfSpace([0.1, 0.2, 1], 0.05)),
        (HalfSpace([0.1, 0.2, 1], 0.05), Placed(Sphere(0.1), (0.15, 0.2, 0.09))),
    ],
)
def test_patches_move_as_differences_of_overlaps_do(a, b):
    placed = [each if isinstance(each, Placed) else Placed(each) for each in (a, b)]
    centres, step = np.array([[0.03, 0.02, 0.05], [0.1, -0.1, 0.02]]), 1e-6

    def measured(motions):
        moved = []
        for body, centre, motion in zip(placed, centres, np.split(motions, 2)):
            turn = Rotation.from_rotvec(motion[3:])
            at = centre + motion[:3] + turn.apply(body.position - centre)
            moved.append(Placed(body.shape, at, (turn * Rotation.from_quat(body.orientation)).as_quat()))
        of = overlap(*moved)
        spread = np.trace(of.inertia) / 2 * np.eye(3) - of.inertia
        parts = [of.volume], of.centroid, of.patch_area, of.patch_centre, of.patch_moments, [of.patch_distance], spread
        return of, [np.ravel(each) for each in parts]

    of, parts = measured(np.zeros(12))
    found = following(of, centres)
    differences = []
    for unit in np.eye(12):
        ends = [np.concatenate(measured(sign * step * unit)[1]) for sign in (1, -1)]
        differences.append((ends[0] - ends[1]) / (2 * step))
    start = 0
    for part in parts:
        rows = slice(start, start + len(part))
        assert np.abs(found.geometry[rows] - part).max() < 1e-12 * max(np.abs(part).max(), 0.1)
        expected = np.array(differences).T[rows]
        assert np.abs(found.by_motion[rows] - expected).max() < 1e-6 * np.abs(expected).max()
        start = rows.stop
