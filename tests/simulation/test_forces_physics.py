"""Volumetric contact against textbooks: each experiment is compared with the formula that predicts it."""

import math

import contact_experiments as experiments
import pytest
from contact_experiments import FRICTION, STEP, G
from scipy.optimize import brentq

# One substep is asked where more would be needed, to see what is left of the law.
pytestmark = pytest.mark.filterwarnings("ignore::overlapper.simulation.cautions.SubstepsWarning")


@pytest.mark.parametrize("stiffness", [1e7, 1e8])
def test_the_cube_of_drake_22213_comes_to_rest(stiffness):
    seen = experiments.rattle(stiffness=stiffness)
    assert seen["speed"][-1] < 1e-9 and seen["spin"][-1] < 1e-9 and seen["tilt"][-1] < 1e-9
    assert seen["depth"][-1] / (G / (stiffness * 0.01)) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize(
    ("pose", "substeps", "most"), [("face", 16, 1e-3), ("edge", 20, 1e-6), ("corner", 16, 1e-6), ("skew", 16, 1e-3)]
)
def test_a_bounce_keeps_the_energy(pose, substeps, most):
    assert experiments.bounce(pose, substeps) < most


def test_the_energy_loss_of_a_bounce_on_a_face_is_of_second_order_in_the_step():
    coarse, fine = (experiments.bounce("face", substeps, phases=7) for substeps in (4, 16))
    assert fine < coarse / 8


def test_balls_keep_their_energy_and_cubes_change_it_by_the_law_not_by_the_step():
    assert experiments.collide("balls", 16, seed=0) == pytest.approx(1, abs=1e-4)
    coarse, fine = (experiments.collide("cubes", substeps, seed=0) for substeps in (16, 48))
    assert 0.9 < fine < 0.99 and coarse == pytest.approx(fine, abs=1e-3)


@pytest.mark.parametrize("drop", [0.5, 1.0])
@pytest.mark.parametrize("dissipation", [1e-4, 5e-4, 2e-3])
def test_dissipation_determines_the_loss_of_a_bounce_at_any_speed(dissipation, drop):
    assert experiments.restitution(dissipation, drop) == pytest.approx(experiments.rebound(dissipation), abs=0.01)


def test_the_damping_by_default_does_not_slow_what_rolls():
    rolled = [experiments.roll("ball", dissipation=tau, seconds=0.5) for tau in (None, 1e-3)]
    assert rolled[0] == pytest.approx(rolled[1], rel=1e-6)
    assert rolled[0][1] < rolled[0][0]


@pytest.mark.parametrize("substeps", [1, 4])
def test_a_sliding_box_stops_at_the_distance_that_friction_predicts(substeps):
    assert experiments.slide(substeps) == pytest.approx(1, abs=1e-4)


@pytest.mark.parametrize("substeps", [1, "auto"])
def test_a_body_on_an_incline_below_the_friction_angle_does_not_creep(substeps):
    acceleration, way = experiments.incline(0.999, substeps=substeps)
    assert abs(acceleration) < 1e-9 and abs(way) < 1e-9


@pytest.mark.parametrize("substeps", [1, "auto"])
def test_a_body_on_an_incline_above_the_friction_angle_slides_as_predicted(substeps):
    angle = math.atan(1.001 * FRICTION)
    acceleration, way = experiments.incline(1.001, substeps=substeps)
    assert acceleration == pytest.approx(G * (math.sin(angle) - FRICTION * math.cos(angle)), rel=1e-3) and way > 0


@pytest.mark.parametrize("substeps", [1, 4])
def test_a_new_force_acts_one_substep_later_and_is_then_held(substeps):
    """Until then it moves the box freely: by F h² / m, and what friction takes to stop that."""
    way, speed = experiments.shove(substeps)
    alone = 2 * (STEP / substeps) ** 2
    assert alone < way < 3 * alone and speed < 1e-9


@pytest.mark.parametrize("friction", [None, "distributed"])
@pytest.mark.parametrize("shape", ["box", "disc"])
@pytest.mark.parametrize("substeps", [1, 4])
def test_a_spin_ends_at_the_time_predicted_by_the_mean_distance(shape, substeps, friction):
    stopped, foretold = experiments.spin(shape, substeps, friction=friction)
    assert abs(stopped - foretold) < STEP / substeps + (1e-3 if friction is None else 1e-2) * foretold


@pytest.mark.parametrize("shape", ["box", "disc"])
def test_combined_slip_and_spin_match_a_rigid_base_if_friction_is_distributed(shape):
    rigid = experiments.rigid_slide_and_spin(shape)
    ours = experiments.slide_and_spin(shape, friction="distributed")
    assert ours.way == pytest.approx(rigid.way, rel=0.005)
    assert ours.angle == pytest.approx(rigid.angle, rel=0.015)
    assert ours.time == pytest.approx(rigid.time, rel=0.01)


def test_combined_slip_and_spin_fall_short_by_a_twentieth_if_friction_is_not_distributed():
    rigid, ours = experiments.rigid_slide_and_spin("box"), experiments.slide_and_spin("box")
    assert ours.way / rigid.way == pytest.approx(0.95, abs=0.01)


@pytest.mark.parametrize("shape", ["cylinder", "ball"])
@pytest.mark.parametrize("stiffness", [1e7, 1e9])
def test_rolling_bodies_keep_their_energy_without_dissipation(shape, stiffness):
    v0, _, e0, e1 = experiments.roll(shape, stiffness=stiffness, substeps=4)
    assert v0 > 0.9 and abs(e1 / e0 - 1) < 1e-9


@pytest.mark.parametrize(("shape", "factor"), [("cylinder", 2 / 3), ("ball", 5 / 7)])
@pytest.mark.parametrize("stiffness", [1e7, 1e8])
def test_dissipation_slows_rolling_bodies_at_any_stiffness(shape, factor, stiffness):
    """The front of a patch comes down and its back goes up: by their velocities w x pressures resist with the torque

    k tau w int x² dA. Of a cylinder or a ball that has sunk in by little, int x² dA = V r, and it is tau w N r; that
    slows the mass and what of its inertia turns: (1 + I / m r²) dv/dt = -tau g v / r.
    """
    tau, r, seconds = 1e-3, experiments.HALF, 1.0
    v0, v1, _, _ = experiments.roll(shape, stiffness=stiffness, substeps=4, dissipation=tau, seconds=seconds)
    decay = math.log(v0 / v1) / seconds
    assert decay / (factor * tau * G / r) == pytest.approx(1, abs=0.02)
    # Friction acts at the centroid of the overlap, which is nearer to the axis.
    if shape == "cylinder":
        moment = r**2 / 2
        depth = brentq(lambda d: 0.1 * (r**2 * math.acos(1 - d / r) - (r - d) * _half(r, d)) - G / stiffness, 0, r / 2)
        second, centroid = 2 / 3 * _half(r, depth) ** 3 * 0.1, 2 / 5 * depth
    else:
        moment = r**2 * 2 / 5
        depth = brentq(lambda d: math.pi * d**2 * (r - d / 3) - G / stiffness, 0, r / 2)
        second, centroid = math.pi / 4 * _half(r, depth) ** 4, depth / 3
    arm = r - depth + centroid
    assert decay == pytest.approx(stiffness * tau * second / (arm**2 + moment), rel=1e-3)


def _half(r, depth):
    """The half breadth of the patch of a cylinder or a ball."""
    return math.sqrt(depth * (2 * r - depth))


@pytest.mark.parametrize("angle", [0, math.pi / 4, math.pi / 3])
def test_simbenchmarks_balls_roll_on_the_box_that_is_pushed_in_any_direction(angle):
    box, balls = experiments.simbenchmark(angle)
    along, across = [math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]
    assert [box @ along, balls @ along] == pytest.approx([1, 1], rel=0.01)
    assert [box @ across, balls @ across] == pytest.approx([0, 0], abs=1e-3)


@pytest.mark.parametrize("substeps", [1, "auto"])
def test_a_box_that_is_gripped_hard_enough_does_not_creep(substeps):
    held = experiments.grip(1.01, substeps=substeps)
    assert held.pressing == pytest.approx([10, 10], rel=1e-6)
    assert abs(held.fallen) < 1e-9 and abs(held.speed) < 1e-9


@pytest.mark.parametrize("substeps", [1, "auto"])
def test_a_box_that_is_not_gripped_hard_enough_slips(substeps):
    held = experiments.grip(0.99, substeps=substeps)
    assert held.acceleration == pytest.approx(-0.01 * G, rel=0.01)
    assert held.fallen < -0.01


@pytest.mark.parametrize(("turn", "substeps"), [(1, 1), (3, 1), (3, 4)])
def test_a_cube_that_sticks_to_a_turntable_does_not_creep(turn, substeps):
    """Along tangents of its circle, it would creep outwards by turn² radius step / 2: 0.6 to 6 mm/s."""
    outwards, slip = experiments.turntable(turn, substeps=substeps)
    assert abs(outwards) < 1e-8 and slip < 1e-12


def test_a_stack_of_five_stands():
    drift, speed = experiments.stack()
    assert drift < 1e-5 and speed < 1e-4
