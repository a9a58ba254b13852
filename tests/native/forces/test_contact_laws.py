"""The contact solver keeps the laws of mechanics, as tests/support/mechanics.py states them by another route."""

import itertools
from dataclasses import fields, replace

import numpy as np
import pytest
from mechanics import PRISMATIC, REVOLUTE, SPHERICAL, Link, Links, Scene, Solution, broken_laws
from scipy.spatial.transform import Rotation
from strategies import directions, quaternion

from overlapper import Box, Capsule, HalfSpace, Placed, Sphere, overlap

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
FLOOR = HalfSpace([0, 0, 1], 0)
HALF = 0.05
FREE_LINK, FLOOR_LINK = 9, 10  # of the scenes at random


def bodies(rng):
    """A held arm, a branched free body, a free link, a floor and a held pair, at random poses."""

    def jointed(parent, joint):
        return replace(single(), parent=parent, joint=joint, axis=directions(rng, 1)[0], pivot=rng.normal(size=3) * 0.1)

    def single():
        return Link(mass=rng.uniform(0.3, 2), inertia=rng.uniform(0.5, 2, 3) * 1e-2)

    held = Link(mass=0)
    links = [
        *(held, jointed(0, REVOLUTE), jointed(1, SPHERICAL), jointed(1, PRISMATIC)),
        *(single(), jointed(4, REVOLUTE), jointed(5, PRISMATIC), jointed(4, SPHERICAL), jointed(7, 0)),
        *(single(), held),
        *(held, jointed(11, 0)),
    ]
    count = len(links)
    return Links(links, rng.normal(size=(count, 3)) * 0.12, np.array([quaternion(rng) for _ in range(count)]))


def scene(seed, **given):
    """Shallow overlaps of the shapes of all these links, two pairs that are apart, and one body on the floor."""
    rng = np.random.default_rng(seed)
    links = bodies(rng)
    sizes = rng.uniform(0.06, 0.12, (len(links.links), 3))
    kinds = [Box, Box, lambda size: Sphere(size[0]), lambda size: Capsule(size[0] / 2, size[1])]
    shapes = [
        Placed(kinds[rng.integers(4)](size), at + rng.normal(size=3) * 0.02, quaternion(rng))
        for size, at in zip(sizes, links.positions)
    ]
    shapes[FLOOR_LINK] = Placed(HalfSpace([0, 0, 1], shapes[FREE_LINK].bounds[0, 2] + 0.01))
    pairs = [pair for pair in itertools.combinations(range(len(shapes)), 2) if FLOOR_LINK not in pair]
    pairs = [pairs[i] if rng.integers(2) else pairs[i][::-1] for i in rng.permutation(len(pairs))]
    found = {pair: overlap(shapes[pair[0]], shapes[pair[1]]) for pair in pairs}
    shallow = [pair for pair in pairs if found[pair] and found[pair].depth < 0.03][:7]
    apart = [pair for pair in pairs if not found[pair]][:2]
    drawn = {
        "stiffness": 10 ** rng.uniform(4, 7),
        "dissipation": rng.choice([0.0, 2e-3]),
        "friction": rng.choice([0.0, 0.1, 0.5, 2.0]),
        "damped": bool(rng.integers(2)),
        "velocity": rng.normal(size=len(links.coordinates)) * 0.3,
        "acceleration": rng.normal(size=len(links.coordinates)) * 3,
    }
    return Scene(links, shapes, range(len(shapes)), [(FREE_LINK, FLOOR_LINK), *shallow, *apart], **(drawn | given))


# Laws in scenes at random


@pytest.mark.parametrize("seed", range(32))
def test_forces_between_bodies_of_any_links_keep_the_laws(seed):
    assert broken_laws(scene(seed, rounds=40).solve(), 1e-8) == []


@pytest.mark.parametrize("seed", range(32))
def test_friction_at_points_keeps_the_laws(seed):
    """Every solution begins with points that share the known force evenly, so that sweeps leave more."""
    assert broken_laws(scene(seed, distributed=True, rounds=40).solve(), 1e-4) == []


def test_a_solution_with_a_fault_breaks_the_law_about_it():
    found = scene(7, rounds=40).solve()
    for name, law in (
        ("force", "forces on links"),
        ("slip", "slip"),
        ("acceleration", "acceleration"),
        ("on_links", "forces on links"),
    ):
        faulty = replace(found, **{name: getattr(found, name) * (1 + 1e-6)})
        assert any(complaint.startswith(law) for complaint in broken_laws(faulty, 1e-8)), name


@pytest.mark.parametrize("seed", range(6))
def test_links_go_on_by_the_velocity_of_their_coordinates(seed):
    drawn = scene(seed)
    links, h = drawn.links, 0.3
    on = np.array(drawn.on)
    given = [each.position for each in drawn.shapes], [each.given_orientation for each in drawn.shapes]
    positions, orientations = drawn.solver.ahead(h, drawn.velocity, on, *given)
    for i, link in enumerate(on):
        twist = links.jacobian(link, links.positions[link]) @ drawn.velocity
        turn = Rotation.from_rotvec(h * twist[3:])
        arm = drawn.shapes[i].position - links.positions[link]
        assert positions[i] == pytest.approx(links.positions[link] + h * twist[:3] + turn.apply(arm), abs=1e-9)
        off = Rotation.from_quat(orientations[i]) * (turn * Rotation.from_quat(given[1][i])).inv()
        assert off.magnitude() < 1e-9


# Masses


def cube_on(links, position=(0, 0, HALF - 1e-3), **given):
    """The last link carries a cube, and the first one a floor, into which the cube has sunk by 1 mm."""
    shapes = [Placed(FLOOR), Placed(Box([HALF] * 3), position)]
    return Scene(links, shapes, [0, len(links.links) - 1], [(1, 0)], **given)


def at_rest(*links, positions=None):
    count = len(links)
    return Links(
        links, np.zeros((count, 3)) if positions is None else np.array(positions), np.tile(UPRIGHT, (count, 1))
    )


def test_a_joint_that_moves_no_mass_stands_still():
    links = at_rest(
        Link(mass=0),
        Link(mass=1),
        Link(1, REVOLUTE, (0, 1, 0), (0.1, 0, 0), mass=0),
        Link(1, PRISMATIC, (0, 0, 1), mass=1, inertia=(1, 2, 3)),
        positions=[(0, 0, 0), (0.1, 0, 0), (0.3, 0, 0), (0, 0.1, 0.2)],
    )
    found = cube_on(links, velocity=np.arange(14) / 100).solve()
    assert broken_laws(found) == []
    assert found.acceleration[12] == 0 and found.acceleration[13] != 0


def test_a_base_without_mass_moves_only_its_joints():
    links = at_rest(Link(mass=0), Link(mass=0), Link(1, SPHERICAL, pivot=(0.2, 0.1, 0), inertia=(1, 2, 3)))
    found = cube_on(links, velocity=np.arange(15) / 100).solve()
    assert broken_laws(found) == []
    assert not found.acceleration[6:12].any() and found.acceleration[12:].all()


def test_the_only_joint_of_the_first_body_moves():
    links = at_rest(Link(mass=0), Link(0, PRISMATIC, (0, 0, 1)), Link(mass=0))
    found = replace(cube_on(links), on=[2, 1]).solve()
    assert broken_laws(found) == []
    assert found.acceleration[6] > 0 and found.scene.frequency2 > 0


def test_a_body_without_moments_of_inertia_does_not_turn():
    found = cube_on(at_rest(Link(mass=0), Link(inertia=(0, 0, 0))), acceleration=[0] * 6 + [1, 2, 3, 0, 0, 0]).solve()
    assert found.acceleration[8] > 0 and not found.acceleration[9:].any()


def test_held_bodies_are_pressed_and_do_not_move():
    found = cube_on(at_rest(Link(mass=0), Link(mass=0)), friction=0.5, velocity=np.arange(12) / 10).solve()
    assert broken_laws(found) == []
    assert found.force[0, 2] > 0 and not found.acceleration.any() and found.scene.frequency2 == [0]
    assert np.linalg.norm(found.force[0, :2]) == pytest.approx(
        0.5 * found.force[0, 2] / np.hypot(1, distance_share(found))
    )


def distance_share(found):
    """The spin at the mean distance, as a fraction of the slip."""
    (patch,) = found.scene.patches()
    rows = found.scene.jacobian((1, 0), patch.found.centroid)
    slip = rows @ found.velocity
    return patch.found.patch_distance * slip[5] / np.hypot(slip[0], slip[1])


def test_frequencies_of_a_cube_that_swings_alike_in_all_ways():
    """k A / m, if the moments of inertia are m times the squares of the patch's radii of gyration."""
    square = HALF**2 / 3
    drawn = cube_on(
        at_rest(Link(mass=0), Link(mass=2, inertia=[2 * square] * 3), positions=[(0, 0, 0), (0, 0, HALF / 2)])
    )
    assert drawn.frequency2 == pytest.approx([drawn.stiffness * 4 * HALF**2 / 2], rel=1e-12)


# Shapes of patches


def test_pressure_on_a_blade_has_no_torque_about_the_blade():
    """Its centre stays on a line, which has one radius of gyration alone."""
    blade = [Placed(FLOOR), Placed(Box([HALF, 1e-8, HALF]), (0, 0, HALF - 1e-3))]
    links = at_rest(Link(mass=0), Link(inertia=[1e-3] * 3))
    velocity = np.zeros(12)
    velocity[9:11] = 3, 30
    found = Scene(links, blade, [0, 1], [(1, 0)], stiffness=1e12, velocity=velocity, friction=0).solve()
    force, (about_blade, across, _) = found.force[0, 2], found.torque[0]
    assert force > 0 and abs(about_blade) < 1e-5 * HALF * force
    assert 0.1 * HALF * force < abs(across) <= (1 + 1e-9) * HALF * force


@pytest.mark.parametrize("spin", [(-120, 60, 0), (60, -120, 5), (-80, -100, -5)])
def test_the_centre_of_pressure_of_a_rocking_box_is_on_the_border(spin):
    """A box that is not level, turns fast and slides: the centre is drawn back to sqrt(3) radii of gyration."""
    tilt = Rotation.from_rotvec([0.004, -0.003, 0.2]).as_quat()
    shapes = [Placed(FLOOR), Placed(Box([HALF, 0.7 * HALF, HALF]), (0.01, 0.02, HALF - 1e-3), tilt)]
    links = at_rest(Link(mass=0), Link(inertia=[2, 3, 4]), positions=[(0, 0, 0), (0.02, 0.01, HALF)])
    velocity = np.array([0] * 6 + [0.1, 0.2, -0.05, *spin])
    found = Scene(links, shapes, [0, 1], [(1, 0)], stiffness=1e7, velocity=velocity, friction=0.3).solve()
    assert broken_laws(found) == []
    (patch,) = found.scene.patches()
    force, torque, normal = found.force[0], found.torque[0], found.normal[0]
    pressure = force @ normal
    pressed = patch.found.patch_centre - patch.found.centroid
    area, product = patch.found.patch_area, np.cross(normal, torque) / pressure - pressed
    radii = patch.found.patch_moments / np.linalg.norm(area)
    assert pressure > 0
    assert product @ np.linalg.pinv(radii, rcond=1e-6) @ product == pytest.approx(3, rel=1e-6)


def test_a_pair_that_is_apart_has_no_force():
    links = at_rest(Link(mass=0), Link())
    for direction in (-1, 1):
        velocity = np.array([0] * 8 + [direction, 0, 0, 0])
        found = cube_on(links, position=(0, 0, HALF + 1e-3), velocity=velocity, friction=0.5).solve()
        assert not found.force.any() and not found.torque.any() and not found.acceleration.any()


def test_a_body_inside_another_is_pushed_in_its_last_direction():
    """Its area vector is zero: the force does not depend on the motion, and has no torque."""
    inside, leaving = (Placed(Sphere(0.02), (x, 0.01, 0)) for x in (0, 0.1))
    links = at_rest(Link(mass=0), Link(), Link())
    velocity = np.arange(18) / 30
    given = {"on": [1, 2], "pairs": [(0, 1)], "velocity": velocity, "friction": 0.5, "dissipation": 0.0}
    drawn = Scene(links, [Placed(Box([0.1] * 3)), leaving], **given)
    before = drawn.solve()
    assert before.directed.all() and before.normal[0] == pytest.approx([-1, 0, 0], abs=1e-12)
    deep = replace(drawn, shapes=[Placed(Box([0.1] * 3)), inside])
    unknown = deep.solve()
    assert not unknown.directed.any() and unknown.normal[0] == pytest.approx(overlap(*deep.shapes).normal)
    assert deep.place(drawn.solver) == [0]
    found = replace(unknown, **told(drawn.solver.solve(1 / 240, velocity, np.zeros(18), np.array([False]), False)))
    assert not found.directed.any() and found.normal[0] == pytest.approx([-1, 0, 0], abs=1e-12)
    assert found.force[0] @ found.normal[0] == pytest.approx(1e5 * deep.patches()[0].found.volume, rel=1e-12)
    assert found.torque[0] == pytest.approx(np.zeros(3), abs=1e-15)
    (now,), (then,) = deep.patches(), drawn.patches()
    moved = 240 * (now.found.centroid - then.found.centroid)
    by_spin = np.cross(velocity[15:], now.found.centroid)
    staying = np.clip((moved - velocity[12:15]) @ by_spin / (by_spin @ by_spin), 0, 1)
    assert broken_laws(found, staying=staying) == []


@pytest.mark.parametrize("staying", [0, 1])
def test_a_contact_keeps_its_place_or_goes_on_with_the_body(staying):
    """The step before tells which, and the same poses again change nothing."""
    links = at_rest(Link(mass=0), Link(inertia=[1e-3] * 3), positions=[(0, 0, 0), (0.02, 0.01, HALF)])
    velocity = np.array([0] * 6 + [0.3, 0.2, 0, 2, 1, 4])  # the surface moves level
    before = cube_on(links, velocity=velocity, friction=0.1)
    first = before.solve()
    assert broken_laws(first) == []
    (patch,) = before.patches()
    by_spin = np.cross(velocity[9:], patch.found.centroid - links.positions[1])
    moved = (velocity[6:9] + staying * by_spin) / 240
    after = replace(
        before,
        links=replace(links, positions=links.positions + [np.zeros(3), moved]),
        shapes=[before.shapes[0], Placed(Box([HALF] * 3), np.add((0, 0, HALF - 1e-3), moved))],
    )
    for _ in range(2):
        after.place(before.solver)
        found = Solution(after, *before.solver.solve(1 / 240, velocity, np.zeros(12), np.array([False]), False))
        assert broken_laws(found, staying=staying) == []


def told(solution):
    names = [each.name for each in fields(Solution)][1:]
    return dict(zip(names, solution, strict=True))


# The last solution, and the number of sweeps


@pytest.mark.parametrize("seed", range(4))
def test_a_step_like_the_last_begins_with_the_solution_of_the_last(seed):
    """Whatever order the pairs come in; a copy knows the same, and what it solves changes nothing."""
    drawn = scene(seed, stiffness=1e6, friction=0.5)
    first = drawn.solve()
    copy = drawn.solver.copy()
    turned = replace(drawn, pairs=drawn.pairs[::-1])
    cold = turned.solve().sweeps
    assert turned.place(copy) == pytest.approx(drawn.frequency2[::-1])
    again = copy.solve(
        drawn.duration, drawn.velocity, drawn.acceleration, np.full(len(drawn.pairs), drawn.damped), False
    )
    assert again[-2] <= 2 < cold
    assert again[0][::-1] == pytest.approx(first.force, rel=1e-4, abs=1e-4 * np.abs(first.force).max())
    empty = replace(drawn, pairs=[])
    assert empty.solve().sweeps == 0 and not empty.solve().acceleration.any()


SWEEPS = [4, 6, 6, 3, 6, 4, 7, 6, 4, 6, 4, 6]


def test_scenes_at_random_are_solved_in_as_many_sweeps_as_before():
    """Sweeps end when no slip changes by more than a fraction of the largest."""
    found = [scene(seed, stiffness=1e5, friction=0.5).solve() for seed in range(12)]
    assert [each.sweeps for each in found] == SWEEPS
    assert all(0 <= each.residual <= 1e-8 for each in found)


def stack(count, **given):
    """Each cube is ten times as heavy as that below, so that sweeps settle slowly."""
    masses = 10.0 ** np.arange(count).clip(max=8)
    links = at_rest(Link(mass=0), *(Link(mass=m, inertia=[m / 600] * 3) for m in masses))
    heights = (2 * HALF - 1e-3) * np.arange(count) + HALF - 1e-3
    links = replace(links, positions=np.array([(0, 0, 0), *((0, 0, z) for z in heights)]))
    shapes = [Placed(FLOOR), *(Placed(Box([HALF] * 3), (0, 0, z)) for z in heights)]
    pairs = [(i + 1, i) for i in range(count)]
    weight = np.tile([0, 0, -9.81, 0, 0, 0], count + 1)
    return Scene(links, shapes, range(count + 1), pairs, stiffness=1e9, acceleration=weight, **given)


@pytest.mark.parametrize("count", [4, 8, 30])
def test_a_stack_settles_from_rest(count):
    """Its slips are measured by what the forces do to them, as none of them is known without forces."""
    found = stack(count).solve()
    assert found.sweeps < 300 and 0 < found.residual <= 1e-8


def foot(seed):
    """A foot of two capsules turns slowly on a floor. The capsules cannot both stick."""
    rng = np.random.default_rng(seed)
    links = at_rest(Link(mass=0), Link(inertia=[1e-3, 2e-3, 2e-3]))
    links = replace(links, positions=np.array([(0, 0, 0), (0, 0, 0.05)]))
    lying = [Rotation.from_rotvec([0, np.pi / 2 + tilt, 0]).as_quat() for tilt in (0, 0.02)]
    places = (0, 0.03, 0.0295 - 0.002 * rng.uniform()), (0, -0.03, 0.029)
    shapes = [Placed(FLOOR), *(Placed(Capsule(0.03, 0.1), at, turn) for at, turn in zip(places, lying))]
    velocity = np.concatenate([np.zeros(6), rng.normal(size=3) * 0.01, rng.normal(size=3) * 0.1])
    weight = np.array([*np.zeros(6), 0, 0, -9.81, 0, 0, 0])
    given = {"stiffness": 1e6, "friction": 0.5, "velocity": velocity, "acceleration": weight}
    return Scene(links, shapes, [0, 1, 1], [(1, 0), (2, 0)], **given)


@pytest.mark.parametrize("distributed", [False, True])
@pytest.mark.parametrize("seed", range(8))
def test_patches_of_a_body_that_cannot_all_stick_are_solved_together(seed, distributed):
    """One after the other, they need more than 2,000 sweeps."""
    solution = replace(foot(seed), distributed=distributed).solve()
    assert solution.sweeps <= 10 and solution.residual <= 1e-8
    assert broken_laws(solution, 1e-6 if distributed else 1e-8) == []


def wall(seed, rows=4, columns=4):
    """A wall of bricks in bond of very different masses, that move at random on a floor."""
    rng = np.random.default_rng(seed)
    half, gap = np.array([0.1, 0.05, 0.03]), 1e-3
    made, places, shapes, pairs, at = [Link(mass=0)], [(0.0, 0.0, 0.0)], [Placed(FLOOR)], [], {}
    for row, column in itertools.product(range(rows), range(columns)):
        place = (0.199 * column + 0.1 * (row % 2), 0.0, (2 * half[2] - gap) * row + half[2] - gap)
        at[row, column] = len(shapes)
        mass = 10.0 ** rng.uniform(-1, 1)
        made.append(Link(mass=mass, inertia=mass * np.array([3.4e-3, 10.9e-3, 12.5e-3]) / 3))
        places.append(place)
        shapes.append(Placed(Box(half), place))
    for (row, column), brick in at.items():
        below = [0] if row == 0 else [at[row - 1, c] for c in (column, column + 2 * (row % 2) - 1) if 0 <= c < columns]
        beside = [at[row, column - 1]] if column else []
        pairs += [(brick, other) for other in below + beside]
    links = replace(at_rest(*made), positions=np.array(places))
    count = len(made)
    velocity = np.concatenate([np.zeros(6), rng.normal(size=6 * (count - 1)) * 0.1])
    given = {"stiffness": 1e7, "velocity": velocity, "acceleration": np.tile([0, 0, -9.81, 0, 0, 0], count)}
    return Scene(links, shapes, range(count), pairs, **given)


@pytest.mark.parametrize("seed", range(6))
def test_a_wall_of_bricks_is_solved_as_a_whole(seed):
    """Each brick touches up to six others, so that the elimination of one joins others."""
    solution = wall(seed).solve()
    assert solution.sweeps <= 20 and solution.residual <= 1e-8
    # Where a slip is small, its direction and that of friction have fewer digits.
    assert broken_laws(solution, 1e-4) == []


@pytest.mark.parametrize(("seed", "most"), [(0, 0.01), (1, 0.02), (2, 0.02), (3, 0.01)])
def test_a_wall_of_many_bricks_ends_after_ten_thousand_visits(seed, most):
    """Without extrapolation, the residuals are 0.016, 0.038, 0.030 and 0.012."""
    large = wall(seed, 8, 8)
    solution = large.solve()
    assert solution.sweeps == 10000 // len(large.pairs)
    assert 1e-8 < solution.residual < most


def test_sweeps_of_a_large_wall_do_not_end_before_ten():
    large = wall(0, 24, 24)
    found = large.solve()
    assert 10000 // len(large.pairs) < 10 == found.sweeps and found.residual > 1e-8


def test_each_group_of_bodies_is_solved_by_itself():
    """A slow group beside a fast one has the forces that it has alone, to the last bit."""
    alone = foot(0)
    links = alone.links
    apart = replace(
        links,
        links=(*links.links, Link(mass=1, inertia=[1 / 600] * 3)),
        positions=np.vstack([links.positions, (5, 0, HALF - 1e-3)]),
        orientations=np.vstack([links.orientations, UPRIGHT]),
    )
    both = replace(
        alone,
        links=apart,
        shapes=[*alone.shapes, Placed(Box([HALF] * 3), (5, 0, HALF - 1e-3))],
        on=[*alone.on, 2],
        pairs=[*alone.pairs, (3, 0)],
        velocity=np.concatenate([alone.velocity, [100.0, 0, 0, 0, 0, 0]]),
        acceleration=np.concatenate([alone.acceleration, [0, 0, -9.81, 0, 0, 0]]),
    )
    assert np.array_equal(both.solve().force[:2], alone.solve().force)


@pytest.mark.parametrize("seed", range(8))
def test_a_step_that_is_solved_again_has_the_same_forces(seed):
    """Patches of one body that stick share their forces, so that the laws have many solutions."""
    drawn = foot(seed)
    first, second = drawn.solve(), drawn.solve()
    assert second.sweeps <= 2
    assert second.force == pytest.approx(first.force, rel=0, abs=1e-8 * np.abs(first.force).max())


@pytest.mark.parametrize("direction", [(1, 0, 0), (0, 1, 0), (0.6, 0.8, 0)])
def test_sweeps_of_a_fast_stack_end_sooner_whatever_way_it_slides(direction):
    """Sweeps end when no slip changes by more than a fraction of the largest."""
    velocity = np.concatenate([np.zeros(6), *3 * [[*(1e9 * np.array(direction)), 0, 0, 0]]])
    assert stack(3, velocity=velocity).solve().sweeps <= 3


def test_a_cube_that_sticks_and_tips_is_solved_to_the_last_digits():
    """Its slip is zero from the first visit on, while the torque of the pressures still changes."""
    links = at_rest(Link(mass=0), Link(mass=1, inertia=(1 / 600,) * 3), positions=[(0, 0, 0), (0, 0, HALF - 1e-3)])
    drawn = cube_on(links, stiffness=1e6, velocity=[0] * 6 + [1e-3, 0, 0, 0, 0, 0])
    coarse, fine = (
        drawn.solver.copy().solve(drawn.duration, drawn.velocity, drawn.acceleration, None, False, settled=settled)[7]
        for settled in (1e-8, 1e-15)
    )
    assert np.abs(coarse - fine).max() < 1e-8 * np.abs(fine).max()
