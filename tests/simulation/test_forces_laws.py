"""Volumetric contact obeys mechanics: forces cancel, parts add up, energy is stored, friction is Coulomb's."""

import math
import warnings

import numpy as np
import pybullet as p
import pytest
from contact_experiments import HALF, STEP, G, World, run
from scipy.integrate import quad
from simulated import body, box

from overlapper import Box, Placed, overlap
from overlapper.simulation import Bodies, NoDirectionWarning, Recorder, VolumetricContact
from overlapper.simulation.bullet.dynamics import BulletDynamics


def heap(world, count=12):
    """Boxes, balls and cylinders that fall on each other."""
    rng = np.random.default_rng(5)
    kinds = [
        (p.GEOM_BOX, {"halfExtents": [0.05, 0.04, 0.03]}),
        (p.GEOM_SPHERE, {"radius": 0.04}),
        (p.GEOM_CYLINDER, {"radius": 0.04, "height": 0.08}),
    ]
    for k in range(count):
        kind, figures = kinds[k % 3]
        place = [*rng.uniform(-0.06, 0.06, 2), 0.08 + 0.05 * k]
        world.body(1 + k % 2, kind, place, p.getQuaternionFromEuler(rng.uniform(-3, 3, 3)), **figures)


def bodies_of(world):
    return [p.getBodyUniqueId(k, world.client) for k in range(p.getNumBodies(world.client))]


@pytest.mark.parametrize("friction", [None, "distributed"])
def test_forces_and_torques_on_all_bodies_cancel(friction):
    with World() as world:
        heap(world)
        with world.contact(friction=friction) as contact:
            most = 0
            for _ in range(120):
                contact.step()
                force, torque = (sum(each) for each in zip(*(contact.on(id) for id in bodies_of(world))))
                size = np.abs(contact.force).sum() + 1e-300
                assert np.abs(force).max() < 1e-14 * size and np.abs(torque).max() < 1e-14 * size
                most = max(most, len(contact))
        assert most > 10


def test_bodies_that_collide_in_space_keep_their_momentum():
    with World(gravity=(0, 0, 0)) as world:
        a = world.box(0.05, 0.04, 0.03, position=[-0.06, 0.01, 1], orientation=[0.1, 0.2, 0.3, 0.9])
        b = world.box(0.03, 0.05, 0.04, mass=2, position=[0.06, 0, 1], orientation=[0.3, 0.1, 0, 0.9])
        world.push(a, [1, 0, 0.1], [0, 3, 0])
        momenta = []
        with world.contact() as contact:
            touched = False
            for _ in range(60):
                contact.step()
                touched |= len(contact) > 0
                momenta.append(world.velocity(a)[0] + 2 * world.velocity(b)[0])
        assert touched and np.abs(np.array(momenta) - [1, 0, 0.1]).max() < 1e-13
        assert abs(world.velocity(a)[0][0] - 1) > 0.1


# A body in parts


def cube_in_parts(world, pieces, position, orientation):
    """A cube of so many parts along each axis, as heavy and as hard to turn as if it were one."""
    half = HALF / np.array(pieces)
    centres = [(2 * np.arange(count) + 1) * size - HALF for count, size in zip(pieces, half)]
    at = [[x, y, z] for x in centres[0] for y in centres[1] for z in centres[2]]
    shape = p.createCollisionShapeArray(
        [p.GEOM_BOX] * len(at),
        halfExtents=[half.tolist()] * len(at),
        collisionFramePositions=at,
        physicsClientId=world.client,
    )
    cube = p.createMultiBody(1, shape, -1, position, orientation, physicsClientId=world.client)
    world.undamped(cube, 0.5, localInertiaDiagonal=[(2 * HALF) ** 2 / 6] * 3)
    return cube


def pressed(pieces, step, linear=(0, 0, 0), angular=(0, 0, 0), friction=0.0, **law):
    """The force and the torque about the centre of mass of a tilted cube that has sunk into the plane."""
    with World(step=step) as world:
        at = np.array([0, 0, 0.047])
        cube = cube_in_parts(world, pieces, at, p.getQuaternionFromEuler([0.02, -0.01, 0.3]))
        world.push(cube, linear, angular)
        with world.contact(substeps=1, friction=friction, **law) as contact:
            contact.forces()
            assert len(contact) == pieces[0] * pieces[1]
            force, torque = contact.on(cube)
        return force, torque - np.cross(at, force)


@pytest.mark.parametrize("pieces", [(2, 2, 2), (4, 3, 1)])
def test_a_body_in_parts_feels_the_force_of_the_whole(pieces):
    """In a step so short that nothing comes to move, so that the sweeps of the solver leave nothing."""
    whole, parts = pressed((1, 1, 1), 1e-9), pressed(pieces, 1e-9)
    assert np.linalg.norm(whole[0]) > 100 and np.linalg.norm(whole[1]) > 0.1
    for one, other in zip(whole, parts):
        assert np.linalg.norm(one - other) < 1e-12 * np.linalg.norm(one)


@pytest.mark.parametrize("dissipation", [0.0, 1e-3, None])
def test_a_body_in_parts_that_moves_feels_the_force_of_the_whole_as_far_as_it_is_solved(dissipation):
    """Sweeps end when slips have settled to 1e-9 of the largest. Without a dissipation, parts share their damping."""
    moving = {"linear": (0.1, 0, -0.3), "angular": (0.5, 1, 0.2), "dissipation": dissipation, "stiffness": 1e7}
    whole, parts = pressed((1, 1, 1), STEP / 4, **moving), pressed((2, 2, 2), STEP / 4, **moving)
    for one, other in zip(whole, parts):
        assert np.linalg.norm(one - other) < (1e-5 if dissipation is None else 1e-9) * np.linalg.norm(one)


# Energy


@pytest.mark.parametrize("ground", ["half-space", "box"])
def test_the_energy_of_an_edge_in_the_ground_is_that_of_its_triangle(ground):
    """V = L d² / (2 sin cos), its centroid a third of d deep; by both ways of finding it."""
    angle, depth, stiffness = 0.4, 2e-3, 3e6
    with World() as world:
        if ground == "box":
            p.removeBody(world.plane, world.client)
            world.box(1, 1, 0.5, mass=0, position=[0, 0, -0.5])
        height = HALF * (math.sin(angle) + math.cos(angle)) - depth
        world.box(*[HALF] * 3, position=[0, 0, height], orientation=p.getQuaternionFromEuler([angle, 0, 0]))
        with world.contact(stiffness=stiffness) as contact:
            contact.forces()
            stored = stiffness * 2 * HALF * depth**3 / (6 * math.sin(angle) * math.cos(angle))
            assert contact.energy == pytest.approx([stored], rel=1e-12)


@pytest.mark.parametrize("euler", [(0.01, 0, 0), (0.02, -0.03, 0.5), (0.3, 0.2, 0)])
def test_the_energy_between_boxes_is_the_work_that_draws_them_apart(euler):
    stiffness = 1e7
    with World() as world:
        p.removeBody(world.plane, world.client)
        world.box(0.2, 0.15, 0.1, mass=0, position=[0, 0, -0.1])
        turned = p.getQuaternionFromEuler(euler)
        lowest = HALF * np.abs(np.array(p.getMatrixFromQuaternion(turned)).reshape(3, 3)[2]).sum()
        at = np.array([0.02, 0, lowest - 2e-3])
        world.box(*[HALF] * 3, position=at, orientation=turned)
        with world.contact(stiffness=stiffness) as contact:
            contact.forces()
            (normal,), (energy,) = contact.last.normal, contact.energy
            below, above = Placed(Box([0.2, 0.15, 0.1]), (0, 0, -0.1)), Box([HALF] * 3)
            up = normal if contact.pairs[0, 0] != 1 else -normal
            assert abs(abs(up[2]) - 1) < 1e-9
            up = up * np.sign(up[2])
            work = quad(lambda s: overlap(Placed(above, at + s * up, turned), below).volume, 0, 2e-3, epsrel=1e-10)[0]
            assert energy == pytest.approx(stiffness * work, rel=1e-6)


def test_energy_goes_from_motion_to_pressures_and_back():
    """Velocities of Bullet lag half a step behind positions."""
    substeps = 64
    with World(step=STEP / substeps) as world:
        edge = p.getQuaternionFromEuler([math.pi / 4, 0, 0])
        cube = world.box(*[HALF] * 3, position=[0, 0, HALF * math.sqrt(2) + 0.02], orientation=edge)
        totals, stored = [], []
        with world.contact(substeps=1, dissipation=0, friction=0) as contact:
            for _ in range(40 * substeps):
                contact.step()
                found = contact.forces()
                pressure = 1e7 * found.contacts.overlaps.volume.sum()
                speed = world.velocity(cube)[0][2] + (pressure - G) * world.step / 2
                stored.append(found.energy.sum())
                totals.append(G * world.position(cube)[2] + speed**2 / 2 + stored[-1])
        assert max(stored) > 0.9 * G * 0.02
        assert np.ptp(totals) < 1e-4 * G * 0.02


# Friction


@pytest.mark.parametrize("seed", range(20))
def test_friction_of_a_patch_follows_coulombs_law(seed):
    """Within the ellipsoid of force and torque, and where anything is left of slip and spin, against both."""
    rng = np.random.default_rng(seed)
    with World(step=1e-3) as world:
        cube = world.box(0.05, 0.03, 0.04, position=[0, 0, 0.04 - 2e-5], friction=0.4)
        world.push(cube, [*rng.normal(size=2) * 10.0 ** rng.uniform(-4, 0), 0], [0, 0, rng.normal() * 3])
        with world.contact(substeps=1) as contact:
            contact.step()
        (force,), (torque,), (normal,) = contact.force, contact.torque, contact.last.normal
        sign = 1 if contact.pairs[0, 0] == cube else -1
        distance = contact.contacts.overlaps.patch_distance[0]
        pressing = force @ normal
        friction = np.array([*(force - pressing * normal), torque @ normal / distance])
        slip = np.array([*contact.slip[0], sign * distance * world.velocity(cube)[1] @ normal])
        assert np.linalg.norm(friction) <= 0.4 * pressing * (1 + 1e-9)
        if np.linalg.norm(slip) > 1e-9:
            assert np.linalg.norm(friction) == pytest.approx(0.4 * pressing, rel=1e-9)
            assert friction @ slip == pytest.approx(-np.linalg.norm(friction) * np.linalg.norm(slip), rel=1e-6)


@pytest.mark.parametrize("friction", [None, "distributed"])
def test_friction_in_a_heap_is_within_its_limit_and_against_the_slip(friction):
    """All patches are solved together, until nothing changes."""
    with World() as world:
        heap(world)
        with world.contact(friction=friction) as contact:
            slipping = 0
            for _ in range(120):
                contact.step()
                normal, found = contact.last.normal, contact.contacts.overlaps
                pressing = (contact.force * normal).sum(axis=1)
                along = contact.force - pressing[:, None] * normal
                held = contact.pairs[:, 0] == world.plane
                limit = np.where(held, 0.5, 0.25) * pressing
                size, slip = np.linalg.norm(along, axis=1), np.linalg.norm(contact.slip, axis=1)
                assert (pressing >= 0).all() and (size <= limit + 1e-9).all()
                twist = np.abs((contact.torque * normal).sum(axis=1))
                assert (twist <= limit * np.nan_to_num(found.patch_distance) * (1 + 1e-9) + 1e-12).all()
                fast = slip > 0.01
                assert ((along * contact.slip).sum(axis=1)[fast] <= 1e-12).all()
                slipping += fast.sum()
        assert slipping > 50


# Robots

ROBOTS = [
    # A file, whether its base is held, and the link that is pushed: here and there one that joints let move.
    ("franka_panda/panda.urdf", True, 10),
    ("kuka_iiwa/model.urdf", True, 6),
    ("kuka_iiwa/model.urdf", False, 6),
    ("r2d2.urdf", False, 14),
    ("r2d2.urdf", True, 9),
    ("humanoid/humanoid.urdf", False, 14),
    ("humanoid/humanoid.urdf", True, 14),
    ("mjcf/humanoid.xml", False, 13),
]


def limp(client, file, fixed):
    """A robot with its joints somewhere, without motors."""
    if file.endswith(".xml"):
        loaded = p.loadMJCF(file, flags=p.URDF_USE_IMPLICIT_CYLINDER, physicsClientId=client)
        (robot,) = (id for id in loaded if p.getNumJoints(id, client))
        for id in loaded:
            if id != robot:
                p.removeBody(id, client)
    else:
        robot = p.loadURDF(file, [0, 0, 1], [0.1, 0.2, 0.3, 0.9], useFixedBase=fixed, physicsClientId=client)
    rng, joints = np.random.default_rng(3), range(p.getNumJoints(robot, client))
    for joint in joints:
        kind = p.getJointInfo(robot, joint, client)[2]
        if kind in (p.JOINT_REVOLUTE, p.JOINT_PRISMATIC):
            p.resetJointState(robot, joint, rng.uniform(0.01, 0.3), 0, client)
            p.setJointMotorControl2(robot, joint, p.VELOCITY_CONTROL, force=0, physicsClientId=client)
        elif kind == p.JOINT_SPHERICAL:
            turn = rng.normal(size=4)
            p.resetJointStateMultiDof(robot, joint, turn / np.linalg.norm(turn), [0, 0, 0], physicsClientId=client)
            p.setJointMotorControlMultiDof(
                robot,
                joint,
                p.POSITION_CONTROL,
                targetPosition=[0, 0, 0, 1],
                positionGain=0,
                velocityGain=0,
                force=[0, 0, 0],
                physicsClientId=client,
            )
        p.changeDynamics(robot, joint, jointLowerLimit=-100, jointUpperLimit=100, physicsClientId=client)
    for link in (-1, *joints):
        p.changeDynamics(robot, link, linearDamping=0, angularDamping=0, jointDamping=0, physicsClientId=client)
        for other in range(-1, link):
            p.setCollisionFilterPair(robot, robot, link, other, 0, client)
    return robot


@pytest.mark.parametrize(("file", "fixed", "link"), ROBOTS)
def test_a_robot_answers_to_forces_as_the_solver_says(client, file, fixed, link):
    """Bullet's own change of all velocities by the forces, in a step without anything else, beside what is foretold."""
    robot = limp(client, file, fixed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of shapes that are not modelled
        bodies = Bodies(client)
    at = bodies.positions[next(k for k, key in enumerate(bodies.keys) if key[:2] == (robot, link))]
    below = at + [0, 0.02, -0.49]
    block = body(client, p.GEOM_BOX, halfExtents=[0.05, 0.03, 0.5], mass=0, position=below)
    bodies.update()
    for each in range(-1, p.getNumJoints(robot, client)):
        p.setCollisionFilterPair(block, robot, -1, each, 0, client)
    dynamics = BulletDynamics(client, [robot, block])
    found = bodies.overlaps(pairs=[(block, robot)]).overlaps
    links = np.array([dynamics.place[key[:2]] for key in bodies.keys], dtype=np.int64)
    count, frames = len(found), dynamics.frames()
    assert count
    dynamics.solver.place(frames, found, links, np.full(count, 1e6), np.zeros(count), np.full(count, 0.5))
    velocity = dynamics.velocity()
    assert not velocity.any()
    *_, wrenches, _, foretold, _sweeps, _residual = dynamics.solver.solve(
        STEP, velocity, np.zeros(len(velocity)), np.zeros(count, bool), False
    )
    dynamics.apply(wrenches, frames)
    p.stepSimulation(client)
    assert np.abs(foretold).max() > 1
    assert np.abs(dynamics.velocity() / STEP - foretold).max() < 1e-11 * np.abs(foretold).max()


# Contacts without a direction


def test_a_body_that_gets_within_another_is_pushed_as_it_was_last(client):
    box(client, 0.5, mass=0)
    small = box(client, 0.1, position=(0.55, 0, 0))
    contact = VolumetricContact(Bodies(client), dissipation=1e-3)
    with contact:
        contact.step()
        assert contact.last.directed.all()
        sign = 1 if contact.pairs[0, 0] == small else -1
        assert sign * contact.last.normal[0] == pytest.approx([1, 0, 0], abs=1e-12)
        p.resetBasePositionAndOrientation(small, [0.1, 0.2, 0.05], [0, 0, 0, 1], client)
        p.resetBaseVelocity(small, [0, 0, 0], [0, 0, 0], client)
        said = (
            r"^box 1 m and box 0.2 m overlap without a direction of force, because one lies within the other or "
            r"goes through it; the force keeps its last direction$"
        )
        with pytest.warns(NoDirectionWarning, match=said) as told:
            contact.step()
        assert told[0].filename == __file__
        assert not contact.last.directed.any()
        assert sign * contact.last.normal[0] == pytest.approx([1, 0, 0], abs=1e-12)
        assert contact.on(small)[0] == pytest.approx([1e7 * 0.2**3, 0, 0])
        contact.step()  # says nothing more


def test_a_body_that_is_within_another_from_the_first_is_pushed_the_shortest_way_out(client):
    box(client, 0.5, mass=0)
    small = box(client, 0.1, position=(0.1, -0.3, 0.05))
    with VolumetricContact(Bodies(client), dissipation=1e-3) as contact:
        with pytest.warns(NoDirectionWarning, match="without a direction of force"):
            contact.step()
        force = contact.on(small)[0]
        assert force == pytest.approx([0, -1e7 * 0.2**3, 0])


def test_a_rod_through_a_plate_has_no_direction(client):
    plate = body(client, p.GEOM_BOX, halfExtents=[0.5, 0.5, 0.005], mass=0)
    rod = body(client, p.GEOM_BOX, halfExtents=[0.01, 0.01, 0.3])
    with VolumetricContact(Bodies(client), dissipation=1e-3) as contact:
        with pytest.warns(NoDirectionWarning, match="goes through it"):
            contact.step()
        assert not contact.last.directed.any()
        force = contact.on(rod)[0]
        assert np.linalg.norm(force) == pytest.approx(1e7 * 0.02**2 * 0.01)
        assert contact.on(plate)[0] == pytest.approx(-force)


@pytest.mark.parametrize("size", [0.02, 0.2])
def test_a_body_within_another_is_pushed_out_with_its_size_over_the_time_of_recovery_at_most(client, size):
    box(client, 0.5, mass=0)
    small = box(client, size / 2, position=(0.1, -0.3, 0.05))
    with VolumetricContact(Bodies(client)) as contact:
        with pytest.warns(NoDirectionWarning, match="without a direction of force"):
            contact.step()
        assert 0.5 * size / 0.02 < np.linalg.norm(p.getBaseVelocity(small, client)[0]) < size / 0.02


# Where the law is not a plane's


def test_a_box_over_the_rim_of_another_is_pushed_aside_by_the_depth_over_the_breadth():
    """The area vector of the patch is that of the face below and of the side beneath it."""
    depth, over = 1e-4, 0.02
    with World() as world:
        p.removeBody(world.plane, world.client)
        world.box(*[HALF] * 3, mass=0, position=[0, 0, HALF])
        cube = world.box(*[HALF] * 3, position=[over, 0, 3 * HALF - depth])
        with world.contact(friction=0) as contact:
            contact.forces()
            x, y, z = contact.on(cube)[0]
    assert x / z == pytest.approx(depth / (2 * HALF - over), rel=1e-9) and abs(y) < 1e-12


@pytest.mark.parametrize("seed", range(4))
def test_the_work_around_a_small_loop_follows_from_how_the_area_of_the_patch_changes(seed):
    """Around a loop, the force V n does the work V (n × grad ln A) for each unit of area. n is -grad V / A."""
    random = np.random.default_rng(seed)
    cube, turns = Box([HALF] * 3), random.normal(size=(2, 4))
    below = Placed(cube, (0, 0, 0), turns[0])
    centre = 0.07 * np.array([0.6, -0.5, 0.7]) + 0.01 * random.normal(size=3)

    def law(at):
        shared = overlap(Placed(cube, at, turns[1]), below)
        slope = shared.gradient[0, :3]
        area = np.linalg.norm(slope)
        return -shared.volume * slope / area, math.log(area)

    u, v, _ = np.linalg.qr(random.normal(size=(3, 3)))[0].T
    radius, angles = 1e-4, 2 * math.pi * np.arange(64) / 64
    work = sum(
        law(centre + radius * (math.cos(a) * u + math.sin(a) * v))[0] @ (math.cos(a) * v - math.sin(a) * u)
        for a in angles
    ) * (radius * angles[1])
    growth = [(law(centre + step)[1] - law(centre - step)[1]) / 2e-6 for step in 1e-6 * np.eye(3)]
    expected = np.cross(law(centre)[0], growth) @ np.cross(u, v) * math.pi * radius**2
    assert work == pytest.approx(expected, rel=1e-3) and abs(expected) > 1e-15


HAND = """<robot name="hand"><link name="palm"><inertial><mass value="0"/>
<inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>{}</robot>"""
FINGER = """<link name="finger{0}"><inertial><mass value=".2"/>
<inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><box size=".02 .04 .04"/></geometry></collision></link>
<joint name="rail{0}" type="prismatic"><parent link="palm"/><child link="finger{0}"/><origin xyz="{1} 0 0"/>
<axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="100" velocity="9"/></joint>"""


def test_fingers_of_one_hand_press_each_other(tmp_path):
    """Both sides of the patch are moved by the joints of one body; motors press with 10 N."""
    path = tmp_path / "hand.urdf"
    path.write_text(HAND.format(FINGER.format(0, -0.02) + FINGER.format(1, 0.02)))
    with World(gravity=(0, 0, 0)) as world, Recorder(world.client) as recorder:
        client, flags = world.client, p.URDF_USE_SELF_COLLISION
        hand = p.loadURDF(str(path), [0, 0, 1], useFixedBase=True, flags=flags, physicsClientId=client)
        world.undamped(hand, 0.5)
        with VolumetricContact(Bodies(client, recorder=recorder)) as contact:
            for joint, way in ((0, 1), (1, -1)):
                p.setJointMotorControl2(
                    hand, joint, p.VELOCITY_CONTROL, targetVelocity=way, force=10, physicsClientId=client
                )
            run(contact, 1)
            assert contact.on(hand, 0)[0] == pytest.approx([-10, 0, 0], abs=1e-9)
            assert contact.on(hand, 1)[0] == pytest.approx([10, 0, 0], abs=1e-9)
            assert contact.on(hand)[0] == pytest.approx([0, 0, 0], abs=1e-12)
        assert abs(p.getJointState(hand, 0, client)[1]) < 1e-9


def test_a_body_that_becomes_heavier_sinks_in_deeper():
    with World() as world:
        cube = world.box(*[HALF] * 3, position=[0, 0, HALF - G / 1e5])
        with world.contact() as contact:
            run(contact, 0.5)
            p.changeDynamics(cube, -1, mass=3, physicsClientId=world.client)
            run(contact, 2)
        assert HALF - world.position(cube)[2] == pytest.approx(3 * G / 1e5, rel=1e-9)
