"""Constraints between links: their laws, and the laws of contact beside them."""

from itertools import product

import numpy as np
import pytest
from mechanics import REVOLUTE, Link, Links
from scipy.spatial.transform import Rotation

from overlapper import Box, HalfSpace, overlaps

H = 1 / 240
POINT, FIXED, SLIDER = 0, 1, 2
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
WORLD = -1
PULL = 48.0  # 1/s: the correction of an error


def constraint(kind, one, other, frames, axis=(0, 0, 0), correction=PULL, limit=1e9, key=1):
    (p, p_turn), (q, q_turn) = frames
    return [key, kind, one, other, *p, *p_turn, *q, *q_turn, *axis, correction, limit]


def two_bodies(seed):
    """A tree of three links and a free link, at random."""
    rng = np.random.default_rng(seed)
    links = [
        Link(mass=2, inertia=(0.1, 0.2, 0.3)),
        Link(0, REVOLUTE, (0, 0, 1), (0.1, 0, 0), 1, (0.1, 0.1, 0.05)),
        Link(1, REVOLUTE, (0, 1, 0), (0.2, 0, 0), 0.5, (0.02, 0.03, 0.02)),
        Link(mass=10 ** rng.uniform(-2, 2), inertia=10 ** rng.uniform(-3, 1) * np.array([0.8, 1, 1.2])),
    ]
    return Links(links, rng.normal(size=(4, 3)), Rotation.random(4, rng).as_quat()), rng


def solve(links, constraints=None, motors=None, velocity=0.0, acceleration=0.0, solver=None):
    """The answer of the core for links without patches: constraint forces, acceleration, residual."""
    solver = solver or links.solver()
    count = len(links.coordinates)
    nothing = overlaps([HalfSpace([0, 0, 1], 0)], [(0, 0, 0)], [UPRIGHT], np.empty((0, 2), dtype=np.int32))
    solver.place(links.frames, nothing, np.array([0]), [], [], [])
    full = (np.broadcast_to(np.asarray(each, float), (count,)) for each in (velocity, acceleration))
    told = solver.solve(H, *full, None, False, motors=motors, constraints=constraints)
    return told[6], told[7], told[9]


@pytest.mark.parametrize(
    ("kind", "ends", "seed"), [*product((POINT, FIXED, SLIDER), ((2, 3), (3, WORLD), (WORLD, 2)), range(4))]
)
def test_a_constraint_corrects_its_error_and_leaves_other_directions_free(kind, ends, seed):
    links, rng = two_bodies(seed)
    # The frames of both links nearly agree in the world.
    turn, at, axis = Rotation.random(rng=rng), rng.normal(size=3), rng.normal(size=3)
    off = rng.normal(scale=1e-3, size=6)
    frames, points, turns, jacobians = [], [], [], []
    for end, sign in zip(ends, (0, 1), strict=True):
        point, turned = at + sign * off[:3], turn * Rotation.from_rotvec(sign * off[3:])
        base, pose = (np.zeros(3), Rotation.identity()) if end == WORLD else (links.positions[end], links.turns[end])
        frames.append((pose.inv().apply(point - base), (pose.inv() * turned).as_quat()))
        points.append(point), turns.append(turned)
        jacobians.append(np.zeros((6, 14)) if end == WORLD else links.jacobian(end, point))
    velocity, acceleration = rng.normal(size=(2, 14))
    row = constraint(kind, *ends, frames, axis)
    force, ours, residual = solve(links, [row], velocity=velocity, acceleration=acceleration)
    axes = np.zeros((6, 6))
    first = Rotation.identity() if ends[0] == WORLD else links.turns[ends[0]]
    slide = first.apply(axis) / np.linalg.norm(axis)
    axes[:3, :3] = np.eye(3) - np.outer(slide, slide) if kind == SLIDER else np.eye(3)
    if kind != POINT:
        axes[3:, 3:] = np.eye(3)
    rows = axes @ (jacobians[0] - jacobians[1])
    error = np.concatenate([points[0] - points[1], turns[0].as_matrix() @ angles(turns[1].inv() * turns[0])])
    end = velocity + H * (acceleration + ours)
    assert rows @ end == pytest.approx(-PULL * axes @ error, abs=1e-8)
    # Newton's law: the acceleration is that by forces in these directions.
    pushes = np.linalg.lstsq(links.inverse_mass() @ rows.T, ours, rcond=1e-9)[0]
    assert links.inverse_mass() @ rows.T @ pushes == pytest.approx(ours, abs=1e-8 * np.abs(ours).max())
    assert residual < 1e-8
    assert force.shape == (1, 6)
    free = {POINT: [3, 4, 5], FIXED: [], SLIDER: [2]}[kind]
    assert force[0, free] == pytest.approx(0, abs=0)


def angles(turn):
    return turn.as_euler("XYZ")


def test_a_constraint_pushes_with_its_largest_force_in_each_direction():
    links = Links([Link(mass=2)], np.zeros((1, 3)), np.array([UPRIGHT]))
    row = constraint(POINT, 0, WORLD, [((0, 0, 0), UPRIGHT)] * 2, limit=3)
    force, ours, residual = solve(links, [row], acceleration=[10, -0.5, 0, 0, 0, 0])
    assert force[0] == pytest.approx([-3, 1, 0, 0, 0, 0])
    assert ours == pytest.approx([-1.5, 0.5, 0, 0, 0, 0])
    assert residual < 1e-8


def test_a_weak_constraint_off_the_centre_keeps_the_law_in_each_direction():
    """Its directions depend on each other, as its force turns the body."""
    links = Links([Link(mass=2, inertia=(0.1, 0.2, 0.3))], np.zeros((1, 3)), np.array([UPRIGHT]))
    at = (0.3, -0.2, 0.5)
    row = constraint(FIXED, 0, WORLD, [(at, UPRIGHT)] * 2, limit=3)
    acceleration = np.array([9.0, -4, 2, 5, 1, -20])
    force, ours, residual = solve(links, [row], acceleration=acceleration)
    slip = links.jacobian(0, np.array(at)) @ (acceleration + ours)
    full = np.abs(force[0]) > 3 * (1 - 1e-9)
    assert 0 < full.sum() < 6
    assert np.abs(force[0]).max() <= 3
    assert slip[~full] == pytest.approx(0, abs=1e-7)
    assert (slip[full] * force[0][full] < 0).all()
    assert residual < 1e-8


def leg(rng):
    """Two chains of two links, whose ends meet. They swing about y below a held base, and are turned at random."""
    links = [Link(mass=0)]
    positions = [(0, 0, 0)]
    for side in (-1, 1):
        upper = len(links)
        links += [
            Link(0, REVOLUTE, (0, 1, 0), (0.1 * side, 0, 0), 1, (0.01, 0.01, 0.001)),
            Link(upper, REVOLUTE, (0, 1, 0), (0, 0, -0.1), 1, (0.01, 0.01, 0.001)),
        ]
        positions += [(0.1 * side, 0.0, -0.1), (0.1 * side, 0.0, -0.3)]
    turn = Rotation.random(rng=rng)
    return Links(links, turn.apply(positions), np.tile(turn.as_quat(), (5, 1)))


@pytest.mark.parametrize("seed", range(4))
def test_a_closed_loop_ignores_what_its_joints_cannot_move(seed):
    """Both ends stay in one plane, in any orientation. An error across this plane cannot be corrected."""
    rng = np.random.default_rng(seed)
    links = leg(rng)
    ends = [((0.1, 0.0, -0.1), UPRIGHT), ((-0.1, 5e-3, -0.1), UPRIGHT)]
    velocity = np.concatenate([np.zeros(6), rng.normal(size=4)])
    force, ours, residual = solve(links, [constraint(POINT, 2, 4, ends)], velocity=velocity)
    points = [links.positions[i] + links.turns[i].apply(at) for i, (at, _) in zip((2, 4), ends, strict=True)]
    slip = (links.jacobian(2, points[0]) - links.jacobian(4, points[1]))[:3] @ (velocity + H * ours)
    assert links.turns[0].inv().apply(slip)[[0, 2]] == pytest.approx(0, abs=1e-8)
    assert residual < 1e-8
    assert np.abs(force).max() < 1e4


def test_a_constraint_begins_with_its_last_force():
    links, _ = two_bodies(0)
    row = constraint(POINT, 2, 3, [((0, 0, 0.1), UPRIGHT)] * 2, correction=0)
    solver = links.solver()
    acceleration = np.arange(14.0)
    first, *_ = solve(links, [row], acceleration=acceleration, solver=solver)
    again, *_ = solve(links, [row], acceleration=acceleration, solver=solver)
    assert again == pytest.approx(first, rel=1e-9)


def test_a_constraint_moves_what_a_motor_does_not_hold():
    """The motor of the upper link holds, so that the constraint turns the lower link alone."""
    links = leg(np.random.default_rng(0))
    at = [((0, 0, -0.1), UPRIGHT), (links.positions[2] + links.turns[2].apply((0, 0, -0.1)), UPRIGHT)]
    at[1] = (at[1][0] + links.turns[0].apply((1e-3, 0, 0)), UPRIGHT)
    row = constraint(POINT, 2, WORLD, at)
    _, ours, residual = solve(links, [row], motors=[[6, 0.0, 1.0, 1e9]])
    assert ours[6] == pytest.approx(0, abs=1e-9)
    slip = links.jacobian(2, at[1][0])[:3] @ (H * ours)
    assert links.turns[0].inv().apply(slip)[0] == pytest.approx(PULL * 1e-3, rel=1e-6)
    assert residual < 1e-8


def test_a_heavy_body_fixed_to_a_light_one_rests_on_it():
    """50 kg above 0.1 kg, which alone touches the floor. The force of the floor is what makes both stop."""
    half, depth, g = 0.05, 1e-3, 9.81
    solid = [Link(mass=m, inertia=(m * half**2 / 1.5,) * 3) for m in (0.1, 50)]
    links = Links(
        [Link(mass=0), *solid], np.array([(0, 0, 0), (0, 0, half), (0, 0, 3 * half)]), np.array([UPRIGHT] * 3)
    )
    poses = [(0, 0, 0), (0, 0, half)], [UPRIGHT] * 2
    found = overlaps([HalfSpace([0, 0, 1], depth), Box([half] * 3)], *poses, np.array([(1, 0)], dtype=np.int32))
    solver = links.solver()
    stiffness = 50.1 * g / (depth * 4 * half**2)
    solver.place(links.frames, found, np.array([0, 1]), [stiffness], [0.0], [0.5])
    acceleration = np.zeros(18)
    acceleration[[8, 14]] = -g
    rows = [constraint(FIXED, 1, 2, [((0, 0, half), UPRIGHT), ((0, 0, -half), UPRIGHT)])]
    force, *_, ours, _, residual = solver.solve(H, np.zeros(18), acceleration, None, False, constraints=rows)
    assert force[0] == pytest.approx([0, 0, 50.1 * g], rel=1e-7, abs=1e-6)
    assert ours + acceleration == pytest.approx(0, abs=1e-6)
    assert residual < 1e-8


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({1: 3}, "of a kind from 0 to 2"),
        ({2: 9}, "between links"),
        ({4: np.nan}, "finite"),
        ({22: -1}, "limit from 0"),
        ({1: SLIDER}, "axis"),
        ({10: 0, 7: 0, 8: 0, 9: 0}, "quaternions"),
    ],
)
def test_wrong_constraints_are_named(changed, message):
    row = np.array(constraint(POINT, 0, 1, [((0, 0, 0), UPRIGHT)] * 2))
    row[[*changed]] = [*changed.values()]
    with pytest.raises(ValueError, match=f"constraints must .*{message}"):
        solve(two_bodies(0)[0], [row])
