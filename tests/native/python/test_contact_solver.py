"""The solver of contact forces by itself: its law in closed form, the motion of links, and refused arguments."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from overlapper import Box, HalfSpace, _core, overlaps

G, HALF, STIFFNESS = 9.81, 0.05, 1e7
HELD, FREE = (0.0, [0.0] * 3), (1.0, [1 / 600] * 3)
TURN = (0.0, 0.0, 0.0, 1.0)


def solver_of(*bodies):
    """A solver for bodies of one link each."""
    count = len(bodies)
    masses, inertias = zip(*bodies)
    return _core.ContactSolver([-1] * count, [0] * count, np.zeros((count, 3)), np.zeros((count, 3)), masses, inertias)


def cube_as_a_tree():
    """The solver of a held and a free body, with the free one as a tree whose motions and masses are given."""
    solver = _core.ContactSolver.of_trees([6], [-1, 0], [(1, k) for k in range(6)])
    still = np.zeros((3, 3))
    inverse = np.diag([1.0] * 3 + [600.0] * 3)
    solver.move(np.vstack([np.eye(3), still]), np.vstack([still, np.eye(3)]), np.tile([0, 0, HALF], (6, 1)), inverse)
    return solver


def placed(depth, dissipation=0.0, friction=0.0, solver=None, **laws):
    """A cube that has sunk into a half-space, and the squares of frequencies."""
    solver = solver or solver_of(HELD, FREE)
    poses = [(0, 0, 0), (0, 0, HALF - depth)]
    found = overlaps([HalfSpace([0, 0, 1], 0), Box([HALF] * 3)], poses, [TURN] * 2, [(0, 1)])
    frames = [(pose, TURN) for pose in poses]
    links = np.array([0, 1])
    return solver, solver.place(frames, found, links, [STIFFNESS], [dissipation], [friction], **laws)


def test_depths_are_volumes_over_areas_and_0_without_a_patch():
    assert placed(1e-4)[0].depths == pytest.approx([1e-4], rel=1e-9)
    assert placed(-1e-3)[0].depths.tolist() == [0]
    assert placed(3 * HALF)[0].depths.tolist() == [0]


@pytest.mark.parametrize("solver", [solver_of(HELD, FREE), None])
def test_travel_is_that_of_surfaces_at_a_patch_and_of_centres_of_links(solver):
    """A cube moves by (3, 4, 12) mm/s and turns by (0, 0, 2) rad/s, or by (0, 0.5, 0) rad/s about its centre."""
    depth, h = 1e-9, 0.01
    solver, _ = placed(depth, solver=solver or cube_as_a_tree())
    still = np.zeros(solver.coordinates - 6)
    patches, links = solver.travel(h, [*still, 3e-3, 4e-3, 12e-3, 0, 0, 2])
    assert patches == pytest.approx(np.array([[13e-3 * h, 2 * h]]), rel=1e-6)
    assert links == pytest.approx(np.array([[0, 0], [13e-3 * h, 2 * h]]), rel=1e-9)
    patches, links = solver.travel(h, [*still, 0, 0, 0, 0, 0.5, 0])
    assert patches == pytest.approx(np.array([[0.5 * h * HALF, 0.5 * h]]), rel=1e-6)
    assert links == pytest.approx(np.array([[0, 0], [0, 0.5 * h]]), abs=1e-10)
    with pytest.raises(ValueError, match=r"^velocity must have \d+ numbers, not 1$"):
        solver.travel(h, [0])


@pytest.mark.parametrize("recovery", [0.0, 0.02])
@pytest.mark.parametrize("dissipation", [0.0, 2e-3])
@pytest.mark.parametrize("damped", [False, True])
@pytest.mark.parametrize("approach", [-0.02, 0.0, 0.3])
def test_the_pressure_at_the_end_of_a_step_is_that_of_the_velocity_there(damped, dissipation, approach, recovery):
    """f = k V + k A (θ h (u' - u) + τ u'), or with backward Euler k V + k A (h + τ) u', of u' = u + h (g - f / m).

    The time of recovery adds to τ.
    """
    h, depth, area = 1 / 240, 1e-4, 4 * HALF**2
    solver, _ = placed(depth, dissipation, recovery=[recovery])
    velocity, weight = np.zeros(12), np.zeros(12)
    velocity[8], weight[8] = -approach, -G
    force, *_, wrenches, _, ours, _sweeps, _residual = solver.solve(h, velocity, weight, np.array([damped]), False)
    lag = (h if damped else h / 4) + dissipation + recovery
    ahead = lag * (approach + h * G) - (0 if damped else h / 4 * approach)
    expected = max(0, STIFFNESS * area * (depth + ahead) / (1 + STIFFNESS * area * h * lag))
    # A half-space is pushed by the opposite.
    assert force == pytest.approx(np.array([[0, 0, -expected]]), rel=1e-12, abs=1e-12)
    assert wrenches[1] == pytest.approx([0, 0, expected, 0, 0, 0], rel=1e-12, abs=1e-12)
    assert ours[8] == pytest.approx(expected, rel=1e-12, abs=1e-12) and not ours[:6].any()


def test_a_recovery_along_the_normal_does_not_resist_what_tips_or_rolls():
    velocity = np.zeros(12)
    velocity[9] = 0.1
    found = []
    for recovery in ([0.0], [0.02]):
        solver, _ = placed(1e-4, dissipation=1e-3, recovery=recovery)
        found.append(solver.solve(1 / 240, velocity, np.zeros(12), np.array([False]), False)[5][1, 3:])
    assert found[0][0] < 0 and found[0] == pytest.approx(found[1], rel=1e-12, abs=1e-12)


def test_a_cube_on_its_face_swings_fastest_up_and_down():
    """By k A / m; rolling has half of that square: k a^4 / 12 over an inertia of m a^2 / 6."""
    _, (square,) = placed(1e-6)
    assert square == pytest.approx(STIFFNESS * 4 * HALF**2, rel=1e-9)


def test_links_go_on_as_they_move():
    solver = _core.ContactSolver(
        [-1, 0], [0, 1], [[0, 0, 0], [0, 0, 1]], [[0, 0, 0], [1, 0, 0]], [1, 1], [[1, 1, 1], [1, 1, 1]]
    )
    nothing = overlaps([Box([1] * 3)], [(0, 0, 0)], [TURN], np.empty((0, 2), dtype=np.int32))
    solver.place([((0, 0, 0), TURN), ((2, 0, 0), TURN)], nothing, np.array([0]), [], [], [])
    # The base moves along y; the joint, 1 m out, turns about z.
    velocity = [0, 3, 0, 0, 0, 0, 0.5]
    positions, orientations = solver.ahead(0.2, velocity, np.array([0, 1]), [(0, 0, 1), (2.5, 0, 0)], [TURN] * 2)
    assert positions[0] == pytest.approx([0, 0.6, 1])
    turned = 0.1
    assert positions[1] == pytest.approx([2 + 0.5 * np.cos(turned), 0.2 * 3.5 + 0.5 * np.sin(turned), 0])
    assert orientations[1] == pytest.approx([0, 0, np.sin(turned / 2), np.cos(turned / 2)])


def test_a_tree_with_given_masses_moves_as_the_body_with_these_masses():
    """The given motions are about a point 0.3 m above the centre, which changes the velocities to give."""
    body, square = placed(1e-4, 1e-3, 0.4)
    tree = cube_as_a_tree()
    shift = np.eye(6)
    shift[:3, 3:] = [[0, 0.3, 0], [-0.3, 0, 0], [0, 0, 0]]  # the velocity of a point above by a rotation
    inverse = shift @ np.diag([1.0] * 3 + [600.0] * 3) @ shift.T
    above = np.tile([0, 0, HALF - 1e-4 + 0.3], (6, 1))
    tree.move(np.vstack([np.eye(3), np.zeros((3, 3))]), np.vstack([np.zeros((3, 3)), np.eye(3)]), above, inverse)
    _, same = placed(1e-4, 1e-3, 0.4, tree)
    assert same == pytest.approx(square, rel=1e-12)
    rng = np.random.default_rng(5)
    velocity, acceleration = rng.normal(scale=0.1, size=(2, 6))
    of_body = body.solve(1e-3, [0] * 6 + [*velocity], [0] * 6 + [*acceleration], [False], False)
    later = (0, 0, HALF - 1e-4) + 1e-3 * velocity[:3], Rotation.from_rotvec(1e-3 * velocity[3:]).as_quat()
    ahead = [((0, 0, 0), TURN), later]
    of_tree = tree.solve(1e-3, shift @ velocity, shift @ acceleration, [False], False, ahead)
    for ours, theirs in zip(of_tree[:3], of_body[:3]):
        assert ours == pytest.approx(theirs, rel=1e-10, abs=1e-12)
    assert of_tree[5] == pytest.approx(of_body[5], rel=1e-10, abs=1e-12)
    assert of_tree[7] == pytest.approx(shift @ of_body[7][6:], rel=1e-10) and of_tree[7].all()
    at = np.array([0, 1]), [(0, 0, 0), (0, 0, HALF)], [TURN] * 2
    for ours, theirs in zip(tree.ahead(0.1, shift @ velocity, *at), body.ahead(0.1, [0] * 6 + [*velocity], *at)):
        assert ours == pytest.approx(theirs, rel=1e-12, abs=1e-15)


def test_links_of_one_tree_push_each_other_through_their_common_masses():
    """A mass of 1 kg slides on one of 3 kg, which slides, too. The first coordinate moves both masses."""
    tree = _core.ContactSolver.of_trees([2], [0, 0], [(0, 0), (1, 0), (1, 1)])
    up, still = np.tile([0, 0, 1], (2, 1)), np.zeros((2, 3))
    inverse = np.linalg.inv([[4, 1], [1, 1]])
    tree.move(up, still, still, inverse)
    placed(1e-4, solver=tree)
    ahead = [((0, 0, 0), TURN), ((0, 0, HALF - 1e-4), TURN)]
    force, *_, ours, _sweeps, _residual = tree.solve(1e-3, [0, 0], [0, 0], [False], False, ahead)
    pressing = -force[0, 2]
    assert pressing > 9 and ours == pytest.approx([-pressing / 3, pressing * (1 + 1 / 3)], rel=1e-12)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"coordinates": [-1]}, "coordinates must be numbers from 0"),
        ({"coordinates": [2**40]}, "coordinates must be numbers from 0"),
        ({"trees": [-2, 0]}, "trees must be numbers of trees, or -1"),
        ({"trees": [0, 1]}, "trees must be numbers of trees, or -1"),
        ({"trees": [0, 2**40]}, "trees must be numbers of trees, or -1"),
        ({"moved": [(2, 0)]}, "moved must begin with places of links"),
        ({"moved": [(-1, 0)]}, "moved must begin with places of links"),
        ({"moved": [(1, 6)]}, "moved must be coordinates of the link's tree"),
        ({"moved": [(0, 0)]}, "moved must be coordinates of the link's tree"),
        ({"moved": [(1, -1)]}, "moved must be coordinates of the link's tree"),
    ],
)
def test_invalid_trees_are_refused(wrong, said):
    given = {"coordinates": [6], "trees": [-1, 0], "moved": [(1, 0)]}
    with pytest.raises(ValueError, match=f"^{said}$"):
        _core.ContactSolver.of_trees(**(given | wrong))


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"linear": np.zeros((5, 3))}, "motions must have a row for each coordinate in each array"),
        ({"angular": np.zeros((7, 3))}, "motions must have a row for each coordinate in each array"),
        ({"points": np.zeros((0, 3))}, "motions must have a row for each coordinate in each array"),
        ({"inverse_mass": np.zeros((6, 5))}, "inverse_mass must have 36 numbers, not 30"),
    ],
)
def test_invalid_motions_are_refused(wrong, said):
    given = {**dict.fromkeys(("linear", "angular", "points"), np.zeros((6, 3))), "inverse_mass": np.eye(6)}
    with pytest.raises(ValueError, match=f"^{said}$"):
        cube_as_a_tree().move(**(given | wrong))


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"parents": [-1, 1]}, "links must begin with a base, and come after their parents"),
        ({"parents": [0, -1]}, "links must begin with a base, and come after their parents"),
        ({"joints": [0, 4]}, "joints must be from 0 to 3"),
        ({"joints": [0]}, "links must have a row in each array"),
        ({"masses": [1]}, "masses must have 2 numbers, not 1"),
        ({"masses": ["a", "b"]}, "masses must be an array of numbers"),
        ({"axes": np.zeros((1, 3))}, "links must have a row in each array"),
    ],
)
def test_invalid_links_are_refused(wrong, said):
    given = {
        "parents": [-1, 0],
        "joints": [0, 1],
        "axes": np.zeros((2, 3)),
        "pivots": np.zeros((2, 3)),
        "masses": [1, 1],
        "inertias": np.ones((2, 3)),
    }
    with pytest.raises(ValueError, match=f"^{said}$"):
        _core.ContactSolver(**(given | wrong))


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"frames": []}, "frames must be one for each link"),
        ({"links": np.array([0, 2])}, "links must be places of links, one for each shape"),
        ({"links": np.array([0, -1])}, "links must be places of links, one for each shape"),
        ({"links": np.array([0])}, "links must be places of links, one for each shape"),
        ({"stiffness": []}, "stiffness must have 1 numbers, not 0"),
        ({"dissipation": [1, 2]}, "dissipation must have 1 numbers, not 2"),
        ({"friction": [[1, 2]]}, "friction must have 1 numbers, not 2"),
        ({"recovery": [1, 2]}, "recovery must have 1 numbers, not 2"),
        ({"restitution": [1, 2]}, "restitution must have 1 numbers, not 2"),
        ({"rolling": [1, 2]}, "rolling must have 1 numbers, not 2"),
        ({"spinning": [1, 2]}, "spinning must have 1 numbers, not 2"),
    ],
)
def test_invalid_places_are_refused(wrong, said):
    poses = [(0, 0, 0), (0, 0, HALF - 1e-4)]
    given = {
        "frames": [(pose, TURN) for pose in poses],
        "overlaps": overlaps([HalfSpace([0, 0, 1], 0), Box([HALF] * 3)], poses, [TURN] * 2, [(0, 1)]),
        "links": np.array([0, 1]),
        "stiffness": [1e7],
        "dissipation": [0],
        "friction": [0],
    }
    with pytest.raises(ValueError, match=f"^{said}$"):
        solver_of(HELD, FREE).place(**(given | wrong))


def test_invalid_steps_are_refused():
    solver, _ = placed(1e-4)
    rest, undamped = np.zeros(12), np.array([False])
    with pytest.raises(ValueError, match=r"^velocity must have 12 numbers, not 6$"):
        solver.solve(0.01, rest[:6], rest, undamped, False)
    with pytest.raises(ValueError, match=r"^acceleration must have 12 numbers, not 13$"):
        solver.solve(0.01, rest, np.zeros(13), undamped, False)
    with pytest.raises(ValueError, match=r"^damped must have 1 numbers, not 2$"):
        solver.solve(0.01, rest, rest, np.array([False, True]), False)
    with pytest.raises(ValueError, match=r"^ahead must be one for each link$"):
        solver.solve(0.01, rest, rest, undamped, False, [((0, 0, 0), TURN)])
    with pytest.raises(ValueError, match=r"^ahead must be given for the trees of a simulator$"):
        placed(1e-4, solver=cube_as_a_tree())[0].solve(0.01, rest[:6], rest[:6], undamped, False)
    with pytest.raises(ValueError, match=r"^links must be places of links$"):
        solver.ahead(0.01, rest, np.array([2]), [(0, 0, 0)], [TURN])
    with pytest.raises(ValueError, match=r"^positions must have 3 numbers, not 6$"):
        solver.ahead(0.01, rest, np.array([1]), [(0, 0, 0)] * 2, [TURN])
