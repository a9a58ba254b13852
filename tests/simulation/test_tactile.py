"""Tactile images: pressure and shear on the taxels of a pad, beside exact integrals, and their sums."""

import math
import re
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import exact
import numpy as np
import pybullet as p
import pytest
from contact_experiments import HALF, G, World, run

from overlapper.quaternion import rotated
from overlapper.simulation import TactileImage, TaxelGrid, Taxels
from overlapper.simulation.forces.cells import moments, nearest

DOWN = (1, 0, 0, 0)  # half a turn about x: the normal of a pad below a body


@pytest.fixture
def world():
    with World() as world:
        yield world


def sole(shape, size=2 * HALF):
    """A grid below a cube."""
    return TaxelGrid((size, size), shape, (0, 0, -HALF), DOWN)


def at_rest(forces):
    """The same contacts with the forces of the law at rest: stiffness times volume, through the centroid."""
    size = forces.stiffness * forces.contacts.overlaps.volume
    return replace(forces, force=size[:, None] * forces.normal, torque=np.zeros_like(forces.torque))


# Exact integrals


def polygon(random, corners):
    """A convex polygon (corners, 2) with coordinates that are few bits long, counter-clockwise."""
    while True:
        angles = np.sort(random.uniform(0, 2 * np.pi, corners))
        found = np.round(64 * random.uniform(0.2, 1) * np.stack([np.cos(angles), np.sin(angles)], axis=1)) / 64
        edges = np.roll(found, -1, axis=0) - found
        turns = edges[:, 0] * np.roll(edges, -1, axis=0)[:, 1] - edges[:, 1] * np.roll(edges, -1, axis=0)[:, 0]
        if (turns > 0).all() and np.ptp(angles) > np.pi:
            return found + np.round(64 * random.uniform(-0.5, 0.5, 2)) / 64


def exact_moments(triangle, cell):
    """The integrals of h, x h and y h over a triangle within a cell, as fractions."""
    part = [tuple(map(Fraction, corner)) for corner in triangle.tolist()]
    for (ax, ay), (bx, by) in zip(cell.tolist(), np.roll(cell, -1, axis=0).tolist()):
        start, along = (Fraction(ax), Fraction(ay)), (Fraction(bx) - Fraction(ax), Fraction(by) - Fraction(ay))
        sides = [along[0] * (q[1] - start[1]) - along[1] * (q[0] - start[0]) for q in part]
        kept = []
        for k, (q, s) in enumerate(zip(part, sides)):
            r, t = part[(k + 1) % len(part)], sides[(k + 1) % len(part)]
            kept += [q] if s >= 0 else []
            kept += [tuple(a + s / (s - t) * (b - a) for a, b in zip(q, r))] if (s >= 0) != (t >= 0) else []
        part = kept
    total = [Fraction(0)] * 3
    for q, r in pairwise(part[1:]):
        corners = [part[0], q, r]
        (x0, y0, _), (x1, y1, _), (x2, y2, _) = corners
        area = ((x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)) / 2
        for k, axis in enumerate((None, 0, 1)):
            weights = [Fraction(1) if axis is None else corner[axis] for corner in corners]
            # The integral of two linear functions over a triangle is the area over 12 times this.
            products = sum(w * c[2] for w, c in zip(weights, corners)) + sum(weights) * sum(c[2] for c in corners)
            total[k] += area * products / 12
    return total


@pytest.mark.parametrize("seed", range(5))
def test_integrals_over_clipped_polygons_are_those_of_fractions(seed):
    random = np.random.default_rng(seed)
    triangles = np.round(64 * random.uniform(-1, 1, (12, 3, 3))) / 64
    cells = [polygon(random, corners) for corners in (3, 4, 5, 6)]
    for cell in cells:
        (found,) = moments(triangles, cell[None])
        expected = [sum(each) for each in zip(*(exact_moments(triangle, cell) for triangle in triangles))]
        assert found == pytest.approx([float(each) for each in expected], abs=2e-15)


@pytest.mark.parametrize("seed", range(4))
def test_taxels_of_the_ground_feel_stiffness_times_the_exact_volume_above_each(world, seed):
    random = np.random.default_rng(seed)
    turn = random.normal(size=4)
    world.box(0.05, 0.04, 0.03, position=[0.003, 0.002, 0.045], orientation=turn / np.linalg.norm(turn))
    contact = world.contact()
    forces = at_rest(contact.forces())
    (found,) = forces.contacts
    cube = found.overlap.shapes[1]
    corners = np.stack(np.meshgrid(*[[-1, 1]] * 3), axis=-1).reshape(-1, 3) * cube.shape.half_extents
    solid = exact.hull(exact.placed(corners, cube.position, cube.orientation))
    solid = exact.clipped(solid, exact.halfspace((0, 0, 1), 0), 1)
    grid = TaxelGrid((0.125, 0.125), (4, 4))
    felt = forces.pressure((world.plane, -1), grid)
    lines = np.linspace(-0.0625, 0.0625, 5)  # a 32nd: no line is rounded
    for i, j in np.ndindex(4, 4):
        column = solid
        for axis, k in ((0, i), (1, j)):
            for sign, line in ((-1, lines[k]), (1, lines[k + 1])):
                normal = [0, 0, 0]
                normal[axis] = sign
                column = exact.clipped(column, exact.halfspace(normal, sign * line), 2)
        volume = float(column.volume) if column.dimension == 3 else 0.0
        expected = 1e7 * volume
        assert felt.force[i, j] == pytest.approx([0, 0, -expected], abs=1e-13 * abs(forces.force[0, 2]))
        assert felt.pressure[i, j] == pytest.approx(expected / grid.areas[i, j], abs=1e-12 * 1e7 * 0.05)
    assert np.abs(felt.outside).max() < 1e-13 * abs(forces.force[0, 2])


def test_the_pressure_below_a_resting_cube_is_its_weight_over_its_area(world):
    cube = world.box(*[HALF] * 3, position=[0, 0, HALF - G / 1e5])
    with world.contact() as contact:
        run(contact, 1)
    felt = contact.pressure((cube, -1), sole((8, 4)))
    assert felt.pressure == pytest.approx(np.full((8, 4), G / (2 * HALF) ** 2), rel=1e-9)
    assert np.abs(felt.shear).max() < 1e-9 and np.abs(felt.outside).max() < 1e-12 * G


@pytest.mark.parametrize(("tolerance", "error"), [(1e-2, 3e-3), (1e-3, 3e-4)])
def test_the_pressure_below_a_ball_is_that_of_its_cap(world, tolerance, error):
    ball = world.body(1, p.GEOM_SPHERE, position=[0, 0, HALF - 1e-3], radius=HALF)
    contact = world.contact()
    forces = at_rest(contact.forces())
    grid = TaxelGrid((0.012, 0.012), (6, 6), (0, 0, -HALF), DOWN)
    felt = forces.pressure((ball, -1), grid, tolerance=tolerance)
    nodes, weights = np.polynomial.legendre.leggauss(8)
    across = grid.points[:, 0, 0][:, None] + 1e-3 * nodes  # m, in each row of taxels
    square = (across**2)[:, None, :, None] + (across**2)[None, :, None, :]
    depth = np.sqrt(HALF**2 - square) - (HALF - 1e-3)
    pressure = 1e7 * np.einsum("ijkl,k,l->ij", depth, weights / 2, weights / 2)
    assert felt.pressure == pytest.approx(pressure, abs=error * pressure.max())
    assert felt.force.sum(axis=(0, 1)) + felt.outside == pytest.approx(forces.force[0] * -1, rel=1e-12)


# Sums


def torque_about_origin(felt, forces, link, grid):
    """The torque of the taxels' forces at their centres, moved into the plane of the patch."""
    position, orientation = map(np.array, forces.frame(link)[:2])
    points = position + rotated(orientation, grid.points)
    along = forces.normal[0]
    points += ((forces.centre[0] - points) @ along)[..., None] * along
    return np.cross(points, felt.force).reshape(-1, 3).sum(axis=0)


@pytest.mark.parametrize("friction", [None, "distributed"])
def test_taxels_of_a_sliding_and_spinning_cube_have_the_force_and_the_torque_of_the_contact(world, friction):
    cube = world.box(*[HALF] * 3, position=[0, 0, HALF - G / 1e5])
    with world.contact(friction=friction) as contact:
        run(contact, 0.2)
        world.push(cube, [1, 0.5, 0], [0, 0, 5])
        contact.step()
    force, torque = contact.on(cube)
    assert abs(force[0]) > 1 and abs(torque[2] - np.cross(contact.centre[0], force)[2]) > 1e-2
    errors = []
    for count in (8, 16, 32):
        grid = sole((count, count), 0.12)
        felt = contact.pressure((cube, -1), grid)
        assert felt.force.sum(axis=(0, 1)) == pytest.approx(force, abs=1e-12 * np.linalg.norm(force))
        assert np.abs(felt.outside).max() < 1e-12 * np.linalg.norm(force)
        errors.append(np.abs(torque_about_origin(felt, contact.last, (cube, -1), grid) - torque).max())
    assert errors[2] < errors[1] / 2 < errors[0] / 3 and errors[2] < 1e-3 * np.abs(torque).max()


def test_a_sliding_cube_has_shear_of_friction_times_pressure_against_the_slip(world):
    cube = world.box(*[HALF] * 3, position=[0, 0, HALF - G / 1e5])
    with world.contact(friction=0.5) as contact:
        run(contact, 0.2)
        world.push(cube, [1, 0, 0])
        contact.step()
    felt = contact.pressure((cube, -1), sole((4, 4)))
    # The friction at the sole tips the cube, so that the front presses harder.
    assert felt.pressure[3].min() > felt.pressure[0].max() > 0
    assert felt.shear[..., 0].sum() == pytest.approx(-0.5 * felt.pressure.sum(), rel=3e-3)
    assert felt.shear[..., 1] == pytest.approx(0, abs=1e-6 * felt.pressure.max())


def test_the_axes_of_shear_are_those_of_the_grid(world):
    cube = world.box(*[HALF] * 3, position=[0, 0, HALF - G / 1e5])
    with world.contact(friction=0.5) as contact:
        run(contact, 0.2)
        world.push(cube, [1, 0, 0])
        contact.step()
    turned = TaxelGrid((0.1, 0.1), (4, 4), (0, 0, -HALF), (math.sqrt(0.5), math.sqrt(0.5), 0, 0))  # x and y swapped
    felt, along_y = (contact.pressure((cube, -1), grid) for grid in (sole((4, 4)), turned))
    assert along_y.shear[..., 1].sum() == pytest.approx(felt.shear[..., 0].sum())
    assert along_y.shear[..., 0] == pytest.approx(0, abs=1e-6 * felt.pressure.max())


@pytest.mark.parametrize("seed", range(3))
def test_the_forces_of_two_pressed_bodies_are_opposite_on_both_pads(world, seed):
    random = np.random.default_rng(seed)
    lower = world.box(0.1, 0.1, 0.05, position=[0, 0, 0.05 - 1e-4])
    turn = p.getQuaternionFromEuler([0, 0, random.uniform(0, 6)])
    upper = world.box(0.03, 0.05, 0.04, position=[*random.uniform(-0.03, 0.03, 2), 0.14 - 3e-4], orientation=turn)
    with world.contact() as contact:
        run(contact, 0.05)
    above = contact.pressure((upper, -1), TaxelGrid((0.06, 0.1), (7, 3), (0, 0, -0.04), DOWN))
    below = contact.pressure((lower, -1), TaxelGrid((0.2, 0.2), (9, 5), (0, 0, 0.05)))
    force = contact.last.between_links()[lower, -1, upper, -1]
    assert below.force.sum(axis=(0, 1)) == pytest.approx(force, abs=1e-12 * np.linalg.norm(force))
    all_of_upper = above.force.sum(axis=(0, 1)) + above.outside
    assert all_of_upper == pytest.approx(-force, abs=1e-12 * np.linalg.norm(force))
    # The ground presses the lower box from below, where it has no pad.
    on_lower, _ = contact.on(lower)
    assert below.outside == pytest.approx(on_lower - force, abs=1e-11 * np.linalg.norm(on_lower - force))


def test_what_lies_outside_the_grid_is_told(world):
    cube = world.box(*[HALF] * 3, position=[0, 0, HALF - G / 1e5])
    contact = world.contact()
    forces = at_rest(contact.forces())
    half = TaxelGrid((HALF, 2 * HALF), (5, 5), (HALF / 2, 0, -HALF), DOWN)
    felt = forces.pressure((cube, -1), half)
    assert felt.outside == pytest.approx(felt.force.sum(axis=(0, 1)), rel=1e-12)
    assert repr(felt) == "TactileImage((5, 5), 4.9 N felt, 4.9 N outside)"


@pytest.mark.parametrize("orientation", [(0, 0, 0, 1), (0, math.sqrt(0.5), 0, math.sqrt(0.5))], ids=["back", "side"])
def test_pads_that_are_pressed_from_behind_or_from_the_side_feel_nothing(world, orientation):
    cube = world.box(*[HALF] * 3, position=[0, 0, HALF - G / 1e5])
    contact = world.contact()
    force = contact.forces().on(cube)[0]
    felt = contact.pressure((cube, -1), TaxelGrid((1, 1), (3, 3), (0, 0, -HALF), orientation))
    assert not felt.force.any() and felt.outside == pytest.approx(force, rel=1e-15)


def test_a_link_without_contacts_feels_nothing(world):
    cube = world.box(*[HALF] * 3, position=[0, 0, 1])
    felt = world.contact().pressure((cube, -1), sole((3, 2)))
    assert isinstance(felt, TactileImage) and felt.force.shape == (3, 2, 3)
    assert not felt.force.any() and not felt.pressure.any() and not felt.shear.any() and not felt.outside.any()


def test_the_mean_of_a_step_has_images_too_and_earlier_forces_keep_their_frames(world):
    cube = world.box(*[HALF] * 3, position=[0, 0, HALF - G / 1e5])
    with world.contact(substeps=3) as contact:
        world.push(cube, [0.3, 0, 0])
        contact.step()
        first, before = contact.last, contact.pressure((cube, -1), sole((6, 6)))
        mean = contact.mean()
        felt = mean.pressure((cube, -1), sole((6, 6)))
        assert felt.force.sum(axis=(0, 1)) + felt.outside == pytest.approx(mean.on(cube)[0], rel=1e-12)
        run(contact, 0.5)
    assert np.array_equal(first.pressure((cube, -1), sole((6, 6))).force, before.force)


# Points with normals


def test_points_at_the_centres_of_a_grid_have_its_cells(world):
    cube = world.box(*[HALF] * 3, position=[0, 0, HALF - 2e-4], orientation=p.getQuaternionFromEuler([1e-3, 2e-3, 0]))
    contact = world.contact()
    forces = at_rest(contact.forces())
    grid = sole((6, 5))
    points = Taxels(grid.points.reshape(-1, 3), np.tile([0, 0, -2.0], (30, 1)), reach=0.1)
    felt, by_points = forces.pressure((cube, -1), grid), forces.pressure((cube, -1), points)
    inner = (slice(1, -1), slice(1, -1))
    # The contact is tilted by 2e-3 against the pad, so its cells are those of points seen at this angle.
    assert by_points.force.reshape(6, 5, 3)[inner] == pytest.approx(felt.force[inner], rel=1e-4)
    assert by_points.force.sum(axis=0) == pytest.approx(forces.on(cube)[0], rel=1e-12)
    assert points.areas.reshape(6, 5)[inner] == pytest.approx(grid.areas[inner])


def hemisphere(count):
    """Points on the lower half of a sphere of radius 1."""
    k = np.arange(count) + 0.5
    height, angle = k / count, math.pi * (1 + math.sqrt(5)) * k
    around = np.sqrt(1 - height**2)
    return np.stack([around * np.cos(angle), around * np.sin(angle), -height], axis=1)


def test_a_round_fingertip_feels_all_of_a_tilted_plate(world):
    directions = hemisphere(60)
    turn = p.getQuaternionFromEuler([0.4, 0.2, 0])
    tip = world.body(1, p.GEOM_SPHERE, position=[0, 0, HALF - 2e-3], orientation=turn, radius=HALF)
    with world.contact() as contact:
        world.push(tip, [0.1, 0, 0], [0, 0, 3])
        contact.step()
    taxels = Taxels(HALF * directions, directions, reach=0.5 * HALF)
    felt = contact.pressure((tip, -1), taxels, tolerance=1e-2)
    force = contact.on(tip)[0]
    assert felt.force.sum(axis=0) == pytest.approx(force, abs=1e-12 * np.linalg.norm(force))
    pressed = np.flatnonzero(felt.pressure > 0.05 * felt.pressure.max())
    below = rotated(np.array(turn), directions)[pressed]
    assert 2 <= len(pressed) < 20 and below[:, 2].max() < -0.8


def test_the_cells_of_a_ball_cover_it_once():
    directions = np.concatenate([hemisphere(150), -hemisphere(150)])
    taxels = Taxels(HALF * directions, directions, reach=HALF)
    assert taxels.areas.sum() == pytest.approx(4 * math.pi * HALF**2, rel=0.03)


def test_points_feel_no_farther_than_their_reach(world):
    cube = world.box(*[HALF] * 3, position=[0, 0, HALF - G / 1e5])
    forces = at_rest(world.contact().forces())
    alone = Taxels([[0.01, 0, -HALF]], [[0, 0, -1]], reach=0.01)
    polygon = 16 / 2 * 0.01**2 * math.sin(2 * math.pi / 16)
    assert alone.areas == pytest.approx([polygon])
    felt = forces.pressure((cube, -1), alone)
    assert felt.pressure == pytest.approx([G / 0.01], rel=1e-9)
    assert felt.outside[2] == pytest.approx(G * (1 - polygon / 0.01), rel=1e-9)


def test_points_that_are_pressed_from_behind_feel_nothing(world):
    cube = world.box(*[HALF] * 3, position=[0, 0, HALF - G / 1e5])
    contact = world.contact()
    force = contact.forces().on(cube)[0]
    felt = contact.pressure((cube, -1), Taxels([[0, 0, -HALF], [0.01, 0, -HALF]], [[0, 0, 1], [1, 0, 0]], reach=0.01))
    assert not felt.force.any() and felt.outside == pytest.approx(force, rel=1e-15)


def test_of_points_behind_each_other_the_front_one_feels(world):
    cube = world.box(*[HALF] * 3, position=[0, 0, HALF - G / 1e5])
    forces = at_rest(world.contact().forces())
    taxels = Taxels([[0, 0, 0.01], [0, 0, -HALF]], [[0, 0, -1]] * 2, reach=1)
    felt = forces.pressure((cube, -1), taxels)
    assert felt.force[0].tolist() == [0, 0, 0] and felt.force[1] == pytest.approx(forces.on(cube)[0], rel=1e-12)


# Arguments


@pytest.mark.parametrize(
    ("kind", "given", "said"),
    [
        (TaxelGrid, ((0.1, 0), (2, 2)), "size must be two lengths greater than 0 in m, not (0.1, 0)"),
        (TaxelGrid, (0.1, (2, 2)), "size must be two lengths greater than 0 in m, not 0.1"),
        (TaxelGrid, ("ab", (2, 2)), "size must be two lengths greater than 0 in m, not 'ab'"),
        (TaxelGrid, ((math.inf, 1), (2, 2)), "size must be two lengths greater than 0 in m, not (inf, 1)"),
        (TaxelGrid, ((1, 1), 4), "shape must be two whole numbers, not 4"),
        (TaxelGrid, ((1, 1), (4,)), "shape must be two whole numbers, not (4,)"),
        (TaxelGrid, ((1, 1), (4, 0)), "shape must be two whole numbers from 1, not (4, 0)"),
        (TaxelGrid, ((1, 1), (4, 1.5)), "shape must be a whole number, not 1.5"),
        (TaxelGrid, ((1, 1), (2, 2), (0, 0)), "position must be three coordinates in m, not (0, 0)"),
        (
            TaxelGrid,
            ((1, 1), (2, 2), (0, 0, 0), (0, 0, 0, 0)),
            "orientation must be a quaternion x, y, z, w that is not 0, not (0, 0, 0, 0)",
        ),
        (Taxels, ([], [], 1), "points must be an (n, 3) array of coordinates in m, not []"),
        (
            Taxels,
            (np.zeros((2, 4)), [], 1),
            "points must be an (n, 3) array of coordinates in m, not an array of shape (2, 4)",
        ),
        (
            Taxels,
            (np.full((2, 3), np.nan), [], 1),
            "points must be an (n, 3) array of coordinates in m, but some of them are not finite",
        ),
        (
            Taxels,
            ([[0, 0, 0]], [[0, 0, 0]], 1),
            "normals must be an (1, 3) array of directions that are not 0, one for each point, not [[0, 0, 0]]",
        ),
        (
            Taxels,
            ([[0, 0, 0], [1, 0, 0]], [[0, 0, 1]], 1),
            "normals must be an (2, 3) array of directions that are not 0, one for each point, not [[0, 0, 1]]",
        ),
        (Taxels, ([[0, 0, 0]], [[0, 0, 1]], 0), "reach must be a length greater than 0 in m, not 0"),
        (Taxels, ([[0, 1, 0]] * 2, [[0, 0, 1]] * 2, 1), "points must be different, but 2 of them are [0.0, 1.0, 0.0]"),
    ],
)
def test_invalid_pads_are_refused_in_one_sentence(kind, given, said):
    with pytest.raises((TypeError, ValueError), match=f"^{re.escape(said)}$"):
        kind(*given)


def test_invalid_questions_are_refused_in_one_sentence(world):
    cube = world.box(*[HALF] * 3, position=[0, 0, HALF])
    contact = world.contact()
    with pytest.raises(TypeError, match=r"^grid must be a TaxelGrid or Taxels, not \(8, 8\)$"):
        contact.pressure((cube, -1), (8, 8))
    with pytest.raises(ValueError, match=r"^link must be \(body, link\), not 1$"):
        contact.pressure(1, sole((2, 2)))
    with pytest.raises(ValueError, match=r"^there is no body 99 in the simulation$"):
        contact.pressure((99, -1), sole((2, 2)))
    with pytest.raises(ValueError, match=f"^body {cube} has no link 3$"):
        contact.pressure((cube, 3), sole((2, 2)))
    with pytest.raises(ValueError, match=r"^tolerance must be a number greater than 0 and less than 1, not 0$"):
        contact.pressure((cube, -1), sole((2, 2)), tolerance=0)


def test_pads_have_a_readable_repr():
    assert repr(sole((2, 3))) == "TaxelGrid(size=[0.1, 0.1], shape=(2, 3))"
    assert repr(Taxels([[0, 0, 0]], [[0, 0, 1]], 0.5)) == "Taxels(1 points, reach=0.5)"


@pytest.mark.parametrize("seed", range(20))
def test_cells_of_a_turned_lattice_leave_no_gap(seed):
    """Four cells meet at each corner. Rounding parts these corners by edges of any direction."""
    turn = np.random.default_rng(seed).uniform(0, 2 * np.pi)
    points = np.stack(np.meshgrid(np.linspace(-0.018, 0.018, 7), np.linspace(-0.013, 0.013, 5)), -1).reshape(-1, 2)
    points = points @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    offsets = points[None] - points[:, None]
    offsets[range(35), range(35)] = np.inf
    cells = points[:, None] + nearest(offsets, 0.02)
    corners = np.array([[-0.015, -0.01, 1], [0.015, -0.01, 1], [0, 0.012, 1]])
    assert moments(corners[None], cells)[:, 0].sum() == pytest.approx(0.03 * 0.022 / 2, rel=1e-12)
