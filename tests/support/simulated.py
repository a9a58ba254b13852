"""Makes bodies in a simulation, and compares Bullet's and our distances of a point from a body."""

from pathlib import Path

import numpy as np
import pybullet as p
import pybullet_data
import pytest

from overlapper import Box, Cylinder, Hull, Placed, Sphere, distance

DATA = Path(pybullet_data.getDataPath())
CUBE = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
CUBE_FACES = [
    (1, 2, 4),
    (1, 4, 3),
    (5, 7, 8),
    (5, 8, 6),
    (1, 5, 6),
    (1, 6, 2),
    (3, 4, 8),
    (3, 8, 7),
    (1, 3, 7),
    (1, 7, 5),
]
POSITION, ORIENTATION = [0.1, -0.2, 0.3], p.getQuaternionFromEuler([0.3, -0.5, 0.7])
INERTIAL = (
    '<inertial><origin xyz="{}" rpy="{}"/><mass value="1"/>'
    '<inertia ixx=".1" iyy=".2" izz=".3" ixy="0" ixz="0" iyz="0"/></inertial>'
)
GEOMETRIES = [
    '<box size=".2 .4 .6"/>',
    '<sphere radius=".15"/>',
    '<cylinder radius=".2" length=".8"/>',
    '<capsule radius=".1" length=".6"/>',
    '<mesh filename="two.obj" scale=".5 .3 .2"/>',
]
HULL_MARGIN = 1e-3
# Bullet rounds the edges of boxes and cylinders by a margin of 1 mm, and so reports up to this much more at a corner.
ROUNDED_CORNER = 1e-3 * (np.sqrt(3) - 1)


def body(client, *shape, mass=1, position=(0, 0, 0), orientation=(0, 0, 0, 1), maximal=False, **figures):
    collision = p.createCollisionShape(*shape, physicsClientId=client, **figures)
    return p.createMultiBody(
        mass, collision, -1, position, orientation, useMaximalCoordinates=maximal, physicsClientId=client
    )


def box(client, half=0.5, **options):
    return body(client, p.GEOM_BOX, halfExtents=[half] * 3, **options)


def ground(client):
    return body(client, p.GEOM_PLANE, mass=0)


def jointed(
    client, kind, shape, axes, positions, parents=None, mass=1, base=(0, -1, (0, 0, 0)), centre=(0, 0, 0), **options
):
    """Links of one shape at joints of one kind; `base` is the mass, the shape and the position of the base."""
    count, (base_mass, base_shape, place) = len(axes), base
    return p.createMultiBody(
        *(base_mass, base_shape, -1, place),
        linkMasses=[mass] * count,
        linkCollisionShapeIndices=[shape] * count,
        linkVisualShapeIndices=[-1] * count,
        linkPositions=positions,
        linkOrientations=[[0, 0, 0, 1]] * count,
        linkInertialFramePositions=[centre] * count,
        linkInertialFrameOrientations=[[0, 0, 0, 1]] * count,
        linkParentIndices=parents or [0] * count,
        linkJointTypes=[kind] * count,
        linkJointAxis=axes,
        physicsClientId=client,
        **options,
    )


def two_cubes(path, gap=2):
    """An .obj file of two cubes, the second `gap` further along x."""
    text = ""
    for part in (0, 1):
        text += f"o part{part}\n" + "".join(f"v {x + part * gap} {y} {z}\n" for x, y, z in CUBE)
        text += "".join(f"f {a + 8 * part} {b + 8 * part} {c + 8 * part}\n" for a, b, c in CUBE_FACES)
    path.write_text(text)
    return str(path)


def random_robot(client, seed, folder, flags=0):
    """A chain of links of all shapes of a URDF, with random inertial frames, collision frames, joints and base pose."""
    random = np.random.default_rng(seed)

    def triple():
        return " ".join(f"{x:.6f}" for x in random.uniform(-0.6, 0.6, 3))

    two_cubes(folder / "two.obj")
    text = '<robot name="random">'
    for i, geometry in enumerate(['<box size=".3 .3 .3"/>', *GEOMETRIES]):
        inertial = INERTIAL.format(triple(), triple())
        origin = f'<origin xyz="{triple()}" rpy="{triple()}"/>'
        text += f'<link name="l{i}">{inertial}<collision>{origin}<geometry>{geometry}</geometry></collision></link>'
        if i:
            text += (
                f'<joint name="j{i}" type="revolute"><parent link="l{i - 1}"/><child link="l{i}"/>'
                f'<origin xyz="{triple()}" rpy="{triple()}"/><axis xyz="0 1 0"/>'
                '<limit lower="-3" upper="3" effort="9" velocity="9"/></joint>'
            )
    (folder / "robot.urdf").write_text(text + "</robot>")
    orientation = p.getQuaternionFromEuler(random.normal(size=3))
    robot = p.loadURDF(
        str(folder / "robot.urdf"), random.normal(size=3), orientation, flags=flags, physicsClientId=client
    )
    for joint in range(p.getNumJoints(robot, client)):
        p.resetJointState(robot, joint, random.uniform(-1, 1), physicsClientId=client)
    return robot


PROBE = 1e-4


def bullet_distance(client, id, link, point):
    """Bullet's distance in m of a point from a link, asked with a tiny ball."""
    ball = p.createCollisionShape(p.GEOM_SPHERE, radius=PROBE, physicsClientId=client)
    nearest = p.getClosestPoints(
        id, -1, 100.0, linkIndexA=link, collisionShapeB=ball, collisionShapePositionB=point, physicsClientId=client
    )
    return min(each[8] for each in nearest) + PROBE


def our_distance(bodies, id, link, point):
    near = [placed for key, placed in zip(bodies.keys, bodies.placed) if key[:2] == (id, link)]
    ball = Placed(Sphere(PROBE), point)
    return min(distance(placed, ball) for placed in near) + PROBE


def assert_modelled_as_collided(client, bodies, id, link, random, points=4):
    (kind,) = {type(shape) for key, shape in zip(bodies.keys, bodies.shapes) if key[:2] == (id, link)}
    centre = np.mean([x for key, x in zip(bodies.keys, bodies.positions) if key[:2] == (id, link)], axis=0)
    for _ in range(points):
        direction = random.normal(size=3)
        point = centre + direction / np.linalg.norm(direction) * random.uniform(2, 4)
        excess = bullet_distance(client, id, link, point) - our_distance(bodies, id, link, point)
        if kind is Hull:
            assert excess == pytest.approx(-HULL_MARGIN, abs=2e-6)
        else:
            assert -2e-6 < excess < (ROUNDED_CORNER if kind in (Box, Cylinder) else 2e-6)
