"""Restitution, recovery, rolling and spinning resistance of the contact solver, in closed form."""

import numpy as np
import pytest

from overlapper import Box, HalfSpace, Sphere, _core, overlaps

G, HALF, STEP = 9.81, 0.05, 1e-3
TURN = (0.0, 0.0, 0.0, 1.0)
FLOOR = HalfSpace([0, 0, 1], 0)


def solved(shape, depth, linear=(0, 0, 0), angular=(0, 0, 0), stiffness=1e9, torque=(0, 0, 0), **laws):
    """Force, torque about the centroid and velocity after a step, of a body of 1 kg that has sunk into the ground."""
    solver = _core.ContactSolver(
        *([-1, -1], [0, 0], np.zeros((2, 3)), np.zeros((2, 3)), [0.0, 1.0], [[0.0] * 3, [1 / 600] * 3])
    )
    poses = [(0, 0, 0), (0, 0, HALF - depth)]
    found = overlaps([FLOOR, shape], poses, [TURN] * 2, [(0, 1)])
    given = {"dissipation": [0.0], "friction": [0.0]} | laws
    solver.place([(pose, TURN) for pose in poses], found, np.array([0, 1]), [stiffness], **given)
    velocity, acceleration = np.zeros(12), np.zeros(12)
    velocity[6:], acceleration[6:] = [*linear, *angular], [0, 0, -G, *(600 * np.array(torque))]
    force, about, *_, ours, _sweeps, _residual = solver.solve(STEP, velocity, acceleration, np.array([False]), False)
    return -force[0], -about[0], (velocity + STEP * (acceleration + ours))[6:]


CUBE, BALL = Box([HALF] * 3), Sphere(HALF)


@pytest.mark.parametrize("speed", [0.5, 5])
@pytest.mark.parametrize("restitution", [0.3, 1.0])
@pytest.mark.parametrize("shape", [CUBE, BALL])
def test_a_stiff_impact_gives_back_its_restitution_of_the_speed(shape, restitution, speed):
    given = {"recovery": [0.02], "restitution": [restitution]}
    *_, velocity = solved(shape, 1e-3, linear=(0.1, 0, -speed), stiffness=1e14, **given)
    assert velocity[2] == pytest.approx(restitution * speed, rel=1e-4)
    assert velocity[0] == 0.1


def test_slow_bodies_and_bodies_without_restitution_do_not_bounce():
    """The depth recovers within 0.02 s, and pressures follow a quarter of the change of the velocity in the step."""
    for speed, restitution in ((0.19, 1.0), (5.0, 0.0)):
        given = {"recovery": [0.02], "restitution": [restitution]}
        *_, velocity = solved(CUBE, 1e-3, linear=(0, 0, -speed), stiffness=1e12, **given)
        assert velocity[2] == pytest.approx((1e-3 - STEP / 4 * speed) / (0.02 + STEP / 4), rel=5e-3)


def test_a_depth_that_gives_back_more_than_the_restitution_decides():
    given = {"recovery": [1e-3], "restitution": [0.1]}
    *_, velocity = solved(CUBE, 1e-2, linear=(0, 0, -0.5), stiffness=1e12, **given)
    assert velocity[2] > 5


@pytest.mark.parametrize("spin", [(3.0, 0, 0), (0, -2.0, 0), (3.0, 4.0, 0)])
def test_rolling_resistance_is_its_length_times_the_force_against_the_rolling(spin):
    free, *_ = solved(BALL, 1e-3, angular=spin, recovery=[0.02])
    force, torque, velocity = solved(BALL, 1e-3, angular=spin, recovery=[0.02], rolling=[1e-4])
    without = solved(BALL, 1e-3, angular=spin, recovery=[0.02])[1]
    assert force == pytest.approx(free, rel=1e-9)
    more = torque - without
    assert np.linalg.norm(more) == pytest.approx(1e-4 * force[2], rel=2e-3)  # pressures change, too
    assert more @ velocity[3:] == pytest.approx(-np.linalg.norm(more) * np.linalg.norm(velocity[3:]), rel=1e-9)


def test_rolling_resistance_holds_a_body_against_a_smaller_torque():
    push = (0.5e-3 * G, 0, 0)
    assert np.linalg.norm(solved(BALL, 3e-6, torque=push, stiffness=1e11)[2][3:]) > 1e-3
    _, torque, velocity = solved(BALL, 3e-6, torque=push, stiffness=1e11, rolling=[1.0])
    assert np.abs(velocity[3:]).max() < 1e-12 and torque[0] == pytest.approx(-push[0], rel=1e-6)


def test_spinning_resistance_adds_to_the_friction_of_the_area():
    spin = (0, 0, 50.0)
    force, torque, _ = solved(CUBE, 1e-4, angular=spin, friction=[0.4])
    more = solved(CUBE, 1e-4, angular=spin, friction=[0.4], spinning=[2e-3])[1]
    assert more[2] - torque[2] == pytest.approx(-2e-3 * force[2], rel=1e-9)


def test_a_body_that_is_apart_has_no_resistance():
    force, torque, _ = solved(BALL, -1e-3, angular=(3, 0, 0), rolling=[0.1], spinning=[0.1], recovery=[0.02])
    assert not force.any() and not torque.any()
