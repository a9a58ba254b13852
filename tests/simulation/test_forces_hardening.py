"""Pressures that grow faster than the depth: p = k d (1 + c d) below half-spaces, by integrals found another way."""

import math
import re

import mujoco
import numpy as np
import pybullet as p
import pytest
from contact_experiments import HALF, STEP, G, World
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from overlapper import Box, Capsule, Cylinder, HalfSpace, Placed, Sphere, overlap
from overlapper.mujoco import Bodies as MujocoBodies
from overlapper.simulation import TaxelGrid, VolumetricContact

K, C = 1e6, 300.0
KINDS = {
    "box": (Box([0.05, 0.04, 0.03]), p.GEOM_BOX, {"halfExtents": [0.05, 0.04, 0.03]}),
    "ball": (Sphere(0.04), p.GEOM_SPHERE, {"radius": 0.04}),
    "capsule": (Capsule(0.03, 0.06), p.GEOM_CAPSULE, {"radius": 0.03, "height": 0.06}),
    "cylinder": (Cylinder(0.04, 0.05), p.GEOM_CYLINDER, {"radius": 0.04, "height": 0.05}),
}
TURN = Rotation.from_rotvec([0.11, -0.07, 0.4])


def energy(shape, at, turn, hardening=C):
    """The work against all pressures: k ∫ V(s) (1 + 2 c s) ds, with the volume V(s) that lies deeper than s."""

    def deeper(s):
        return overlap(Placed(shape, at, turn.as_quat()), HalfSpace([0, 0, 1], -s)).volume * (1 + 2 * hardening * s)

    top = -Placed(shape, at, turn.as_quat()).bounds[0, 2]
    return K * quad(deeper, 0, top, epsabs=0, epsrel=1e-12, limit=200)[0]


def sunk(shape, depth=3e-3):
    """Where a turned shape is that deep below the plane."""
    return np.array([0.01, 0.02, -depth - Placed(shape, (0, 0, 0), TURN.as_quat()).bounds[0, 2]])


def wrench(kind, velocity=(0, 0, 0), spin=(0, 0, 0), rise=0.0, **law):
    """Force and torque on a body about its position in a step so short that nothing moves, and the contacts."""
    shape, geom, figures = KINDS[kind]
    at = sunk(shape) + [0, 0, rise]
    with World(step=1e-9) as world:
        id = world.body(1, geom, at, TURN.as_quat(), **figures)
        world.push(id, velocity, spin)
        with world.contact(substeps=1, stiffness=K, hardening=C, friction=0, **law) as contact:
            found = contact.forces()
            force, torque = found.on(id)
    return force, torque - np.cross(at, force), found


@pytest.mark.parametrize("kind", KINDS)
def test_the_energy_is_the_integral_of_the_pressures(kind):
    shape = KINDS[kind][0]
    _, _, found = wrench(kind)
    assert found.energy == pytest.approx([energy(shape, sunk(shape), TURN)], rel=1e-9)
    assert found.energy[0] > 1.2 * energy(shape, sunk(shape), TURN, hardening=0)


@pytest.mark.parametrize("kind", KINDS)
def test_force_and_torque_are_the_slope_of_the_energy(kind):
    shape, at, step = KINDS[kind][0], sunk(KINDS[kind][0]), 1e-6
    force, torque, _ = wrench(kind)
    for axis in np.eye(3):
        moved = [energy(shape, at + sign * step * axis, TURN) for sign in (1, -1)]
        turned = [energy(shape, at, Rotation.from_rotvec(sign * step * axis) * TURN) for sign in (1, -1)]
        scale = np.linalg.norm(force)
        assert force @ axis == pytest.approx(-(moved[0] - moved[1]) / (2 * step), abs=1e-6 * scale)
        assert torque @ axis == pytest.approx(-(turned[0] - turned[1]) / (2 * step), abs=1e-6 * scale * 0.05)


@pytest.mark.parametrize("kind", KINDS)
def test_dissipation_is_ahead_of_the_depth_by_the_slope_of_the_force(kind):
    """A fall at the speed u adds to force and torque what a depth larger by u times the dissipation would."""
    tau, speed, step = 1e-3, 1e-2, 1e-6
    still, falling = (wrench(kind, [0, 0, -each], dissipation=tau) for each in (0, speed))
    deeper, higher = (wrench(kind, rise=sign * step, dissipation=tau) for sign in (-1, 1))
    for k in range(2):
        slope = (deeper[k] - higher[k]) / (2 * step)
        if k == 1:  # about the same point
            slope = slope - np.cross([0, 0, 1], still[0])
        if k == 1 and kind == "ball":
            assert np.abs(falling[1]).max() < 1e-12 * np.abs(falling[0]).max()
        else:
            added = tau * speed * slope
            assert np.abs(falling[k] - still[k] - added).max() < 1e-6 * np.linalg.norm(added)


def test_tipping_feels_the_slope_of_the_pressure():
    """A cube that lies flat: the slope is the same all over its face."""
    tau, spin, depth = 1e-3, 0.1, 1e-4
    with World(step=1e-9) as world:
        cube = world.box(*[HALF] * 3, position=[0, 0, HALF - depth])
        world.push(cube, [0, 0, 0], [spin, 0, 0])
        with world.contact(substeps=1, stiffness=K, hardening=C, friction=0, dissipation=tau) as contact:
            contact.forces()
            (torque,) = contact.torque
    slope = K * (1 + 2 * C * depth) * (2 * HALF) ** 4 / 12
    assert np.abs(torque[0]) == pytest.approx(tau * spin * slope, rel=1e-5)


@pytest.mark.parametrize(("stiffness", "hardening"), [(1e7, 1e3), (1e7, 1e5), (1e6, 1e4)])
@pytest.mark.parametrize("dissipation", [None, 1e-3])
def test_a_cube_rests_at_the_depth_that_solves_the_quadratic(stiffness, hardening, dissipation):
    laws = {"stiffness": stiffness, "hardening": hardening, "dissipation": dissipation}
    with World() as world:
        cube = world.box(*[HALF] * 3, position=[0, 0, HALF], orientation=p.getQuaternionFromEuler([1e-3, 0, 0]))
        with world.contact(**laws) as contact:
            for _ in range(720):
                contact.step()
            force = contact.on(cube)[0]
        depth = HALF - world.position(cube)[2]
    linear = G / (stiffness * (2 * HALF) ** 2)
    expected = 2 * linear / (1 + math.sqrt(1 + 4 * hardening * linear))
    assert depth == pytest.approx(expected, rel=1e-6)
    assert force == pytest.approx([0, 0, G], abs=1e-6)


def test_mujocos_planes_harden_too():
    model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody><geom type="plane" size="1 1 1"/>
    <body pos="0 0 0.05"><freejoint/><geom type="box" size=".05 .05 .05" mass="1"/></body></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with VolumetricContact(MujocoBodies(model, data), stiffness=1e7, hardening=1e4) as contact:
        for _ in range(1000):
            contact.step()
        assert contact.mean().force[0, 2] == pytest.approx(-G, rel=1e-6)
    depth = 0.05 - data.qpos[2]
    assert 1e7 * 0.01 * depth * (1 + 1e4 * depth) == pytest.approx(G, rel=1e-6)


def rebound(turn, hardening, substeps):
    """The speed after a bounce over the speed before."""
    with World(gravity=(0, 0, 0), step=STEP / substeps) as world:
        lowest = -Placed(Box([HALF] * 3), (0, 0, 0), turn).bounds[0, 2]
        cube = world.box(*[HALF] * 3, position=[0, 0, lowest + 0.4e-3], orientation=turn)
        world.push(cube, [0, 0, -0.5], [0, 0, 0])
        deepest = 0
        with world.contact(stiffness=1e7, hardening=hardening, dissipation=0, friction=0, substeps=1) as contact:
            for _ in range(20 * substeps):
                contact.step()
                deepest = max(deepest, lowest - world.position(cube)[2])
        assert not len(contact) and deepest > 1e-3
        return world.velocity(cube)[0][2] / 0.5, hardening * deepest


@pytest.mark.parametrize(("pose", "within"), [((0, 0, 0), 2e-3), ((math.pi / 4, 0, 0), 1e-5)])
def test_a_bounce_keeps_its_energy_as_with_the_linear_law(pose, within):
    turn = p.getQuaternionFromEuler(pose)
    for hardening in (0, 1e3):
        kept, hardened = rebound(turn, hardening, 64)
        assert abs(kept**2 - 1) < within
    assert hardened > 0.5


def test_a_body_in_parts_feels_the_force_of_the_whole():
    """Second moments about each part's centroid and torques add up to those of the whole."""
    found = []
    for pieces in (1, 3):
        with World(step=1e-9) as world:
            half = [HALF / pieces, HALF, HALF]
            shape = p.createCollisionShapeArray(
                [p.GEOM_BOX] * pieces,
                halfExtents=[half] * pieces,
                collisionFramePositions=[[(2 * k + 1 - pieces) * half[0], 0, 0] for k in range(pieces)],
                physicsClientId=world.client,
            )
            turn = p.getQuaternionFromEuler([0.02, -0.01, 0.3])
            cube = p.createMultiBody(1, shape, -1, [0, 0, 0.047], turn, physicsClientId=world.client)
            with world.contact(substeps=1, stiffness=K, hardening=C, friction=0) as contact:
                contact.forces()
                assert len(contact) == pieces
                found.append((*contact.on(cube), contact.energy.sum()))
    for whole, parts in zip(*found, strict=True):
        assert np.abs(whole - parts).max() < 1e-11 * np.abs(whole).max()


def test_a_drawn_pressure_has_the_hardening(client):
    from overlapper.viewer.pressure import presses

    _, _, found = wrench("box")
    (press,) = presses(found).values()
    assert press.pressure(1e-3) == pytest.approx(K * 1e-3 * (1 + C * 1e-3))


# What is refused


def two_cubes(world):
    return [world.box(*[HALF] * 3, position=[0, 0, HALF + 0.2 * k]) for k in range(2)]


def test_a_hardening_between_bodies_without_a_flat_patch_is_refused():
    with World() as world:
        a, b = two_cubes(world)
        sentence = (
            f"hardening must be 0 between ({a}, -1) and ({b}, -1), as neither is a half-space, whose patches are flat; "
            "it may be a function of the pair"
        )
        with pytest.raises(ValueError, match=f"^{re.escape(sentence)}$"):
            world.contact(hardening=C)
        contact = world.contact(hardening=lambda one, other: C if world.plane in (one[0], other[0]) else 0)
        with contact:
            for _ in range(60):
                contact.step()
            assert contact.last.hardening.tolist() == [C, C][: len(contact)]


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"hardening": -1}, "hardening must be a number in 1/m 0 or greater, not -1"),
        ({"hardening": "x"}, "hardening must be a number in 1/m 0 or greater, not 'x'"),
        (
            {"hardening": 1, "friction": "distributed"},
            "hardening must not be given with friction='distributed', which knows the linear law alone",
        ),
    ],
)
def test_a_wrong_hardening_is_named(wrong, sentence):
    with World() as world, pytest.raises(ValueError, match=f"^{re.escape(sentence)}$"):
        world.contact(**wrong)


def test_a_tactile_image_of_a_hardening_contact_is_refused():
    with World() as world:
        cube = world.box(*[HALF] * 3, position=[0, 0, HALF - 1e-4])
        contact = world.contact(stiffness=K, hardening=C)
        contact.forces()
        pad = TaxelGrid((0.1, 0.1), (4, 4), position=(0, 0, -HALF), orientation=(1, 0, 0, 0))
        sentence = f"pressure of ({cube}, -1) is known for a hardening of 0 alone, where it is linear in the depth"
        with pytest.raises(ValueError, match=f"^{re.escape(sentence)}$"):
            contact.pressure((cube, -1), pad)
