"""Common volumes of unions of convex shapes, against sums that count nothing twice."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from overlapper import Box, HalfSpace, Hull, Placed, Sphere, overlap, union
from overlapper.quaternion import composed, rotated
from overlapper.union import UnionOverlap, of_pairs, union_overlap, union_volume

TURN = np.array([0.1, -0.5, 0.3, 0.8]) / np.linalg.norm([0.1, -0.5, 0.3, 0.8])
SHIFT = np.array([0.3, -2.0, 5.0])
SIZE = 5
METHODS = [union._inclusion_exclusion, union._cells]


@st.composite
def blocks(draw):
    """Corners of a box with whole coordinates from 0 to SIZE."""
    ends = [sorted(draw(st.lists(st.integers(0, SIZE), min_size=2, max_size=2, unique=True))) for _ in range(3)]
    return np.array(ends, dtype=float).T


def moved(shape, position):
    """A shape that was made along the axes, moved with the whole scene."""
    return Placed(shape, SHIFT + rotated(TURN, np.asarray(position, dtype=float)), TURN)


def placed(block):
    return moved(Box((block[1] - block[0]) / 2), block.mean(axis=0))


def cells_in(some):
    """The unit cells of the grid that are in any of the blocks."""
    centres = np.array(list(itertools.product(range(SIZE), repeat=3))) + 0.5
    return centres[np.any([((low < centres) & (centres < high)).all(axis=1) for low, high in some], axis=0)]


def shared(method, a, b, tolerance=1e-3):
    pairs = {(i, j): overlap(x, y, tolerance=tolerance) for i, x in enumerate(a) for j, y in enumerate(b)}
    found = UnionOverlap()
    assert method(found, a, b, {pair: each for pair, each in pairs.items() if each})
    return found


@pytest.mark.parametrize("method", METHODS)
@given(a=st.lists(blocks(), min_size=1, max_size=3), b=st.lists(blocks(), min_size=1, max_size=3))
def test_unions_of_blocks_share_the_cells_that_are_in_both(method, a, b):
    first, second = ({tuple(cell) for cell in cells_in(blocks)} for blocks in (a, b))
    common = np.array(sorted(first & second)).reshape(-1, 3)
    found = shared(method, [placed(block) for block in a], [placed(block) for block in b])
    assert abs(found.volume - len(common)) <= found.volume_error + 1e-15
    assert found.volume_error < 1e-9
    if len(common):
        assert_allclose(found.centroid, SHIFT + rotated(TURN, common.mean(axis=0)), atol=1e-12)


def test_three_bars_that_cross_are_seven_cubes():
    bars = [placed(np.array([[1.0] * 3, [2.0] * 3]) + [-np.eye(3)[k], np.eye(3)[k]]) for k in range(3)]
    volume, error = union_volume(bars)
    assert sum(bar.volume for bar in bars) == pytest.approx(9)
    assert volume == pytest.approx(7, abs=error)
    assert error < 1e-10


def test_a_part_given_twice_counts_once():
    cube = Placed(Box([1, 1, 1]))
    found = union_overlap([cube, cube], [Placed(Box([1, 1, 1]), [0.5, 0, 0], TURN)] * 3)
    once = overlap(cube, Placed(Box([1, 1, 1]), [0.5, 0, 0], TURN))
    assert found.volume == pytest.approx(once.volume, rel=1e-12)
    assert_allclose(found.gradient[:, :3], once.gradient[:, :3], atol=1e-12)


def star(rng, count):
    """Boxes in all directions, all of them over the same point."""
    quaternions = rng.normal(size=(count, 4))
    sizes = rng.uniform(0.2, 0.6, (count, 3))
    return [Placed(Box(size), 0.05 * rng.normal(size=3), turn) for size, turn in zip(sizes, quaternions)]


def test_cells_and_inclusion_exclusion_agree(monkeypatch):
    monkeypatch.setattr(union, "TERMS", 1000)
    a = star(np.random.default_rng(1), 7)
    b = [Placed(Hull(np.random.default_rng(2).normal(size=(20, 3)) / 3), [0.3, 0.2, 0])]
    terms, cells = (shared(method, a, b) for method in METHODS)
    assert terms.terms == 127 > 2 * cells.terms
    assert cells.volume == pytest.approx(terms.volume, rel=1e-12)
    assert_allclose(cells.centroid, terms.centroid, atol=1e-12)
    assert_allclose(cells.gradient[:, :3], terms.gradient[:, :3], atol=1e-12)
    turned = terms.gradient[:, 3:] + np.cross(terms.about - cells.about, terms.gradient[:, :3])
    assert_allclose(cells.gradient[:, 3:], turned, atol=1e-12)


def test_many_shapes_over_each_other_take_few_cells():
    """Forty over one point have 2^40 subsets."""
    a = star(np.random.default_rng(3), 40)
    found = union_overlap(a, [Placed(Box([0.5, 2, 2]), [0.5, 0, 0])])
    assert found.terms < 1000
    assert found.volume_error < 1e-9
    points = np.random.default_rng(4).uniform([0, -1.2, -1.2], [1, 1.2, 1.2], (20000, 3))
    inside = np.zeros(len(points), dtype=bool)
    for each in a:
        local = rotated(each.orientation * [-1, -1, -1, 1], points - each.position)
        inside |= (np.abs(local) < each.shape.half_extents).all(axis=1)
    assert found.volume == pytest.approx(2.4**2 * inside.mean(), rel=0.05)


@pytest.mark.parametrize("method", METHODS)
def test_the_gradient_is_the_slope_of_the_volume_as_a_union_moves(method):
    rng = np.random.default_rng(5)
    a, b = star(rng, 3), [Placed(Box([0.5, 0.5, 0.5]), [0.4, 0, 0]), Placed(Box([0.5, 0.3, 0.2]), [0.5, 0.3, 0], TURN)]
    found = shared(method, a, b)
    step = 1e-5

    def volume(shift, turn):
        half = np.append(turn / 2, 1)
        half /= np.linalg.norm(half)
        positions = [found.about + rotated(half, each.position - found.about) + shift for each in a]
        turns = [composed(half, each.orientation) for each in a]
        return shared(method, [Placed(each.shape, *pose) for each, *pose in zip(a, positions, turns)], b).volume

    zero = np.zeros(3)
    slopes = [(volume(e, zero) - volume(-e, zero)) / (2 * step) for e in step * np.eye(3)]
    slopes += [(volume(zero, e) - volume(zero, -e)) / (2 * step) for e in step * np.eye(3)]
    assert_allclose(found.gradient[0], slopes, atol=1e-7)
    assert_allclose(found.gradient.sum(axis=0), 0, atol=1e-12)  # moving both changes nothing


def test_the_error_holds_for_spheres_in_either_way():
    a = [Placed(Sphere(0.5), [0.2 * k, 0.1 * k * k, 0]) for k in range(3)]
    b = [Placed(HalfSpace([0, 0, 1], 0.1))]
    fine = shared(union._inclusion_exclusion, a, b, 1e-4)
    for method in METHODS:
        found = shared(method, a, b, 1e-2)
        assert abs(found.volume - fine.volume) <= found.volume_error + fine.volume_error


def nearest_parts(centres, radii):
    """The volume of a union of balls as a sum of disjoint parts: where each ball is nearest, by power."""
    volume = 0.0
    for centre, radius in zip(centres, radii):
        walls = []
        for other, its_radius in zip(centres, radii):
            if (other != centre).any():
                apart = np.linalg.norm(other - centre)
                power = other @ other - centre @ centre - its_radius**2 + radius**2
                walls.append(Placed(HalfSpace((other - centre) / apart, power / (2 * apart))))
        volume += overlap(Placed(Sphere(radius), centre), *walls).volume
    return volume


@pytest.mark.parametrize(("balls", "spread"), [(24, 1.0), (24, 1.5), (9, 0.2)])
def test_a_union_of_balls_is_exact(balls, spread):
    rng = np.random.default_rng(balls)
    centres, radii = spread * rng.normal(size=(balls, 3)), rng.uniform(0.4, 0.8, balls)
    volume, error = union_volume([Placed(Sphere(radius), centre) for radius, centre in zip(radii, centres)])
    exact = nearest_parts(centres, radii)
    assert error <= 1e-10 * exact
    assert volume == pytest.approx(exact, rel=1e-12)


def test_cells_of_smooth_shapes_state_the_space_beside_them(monkeypatch):
    rng = np.random.default_rng(2)
    centres, radii = 0.2 * rng.normal(size=(8, 3)), rng.uniform(0.4, 0.8, 8)
    monkeypatch.setattr(union, "SMOOTH_TERMS", 1)
    volume, error = union_volume([Placed(Sphere(radius), centre) for radius, centre in zip(radii, centres)])
    exact = nearest_parts(centres, radii)
    assert 0.001 * exact < abs(volume - exact) <= error


def test_the_volume_of_no_shapes_is_zero_and_that_of_a_half_space_is_refused():
    assert union_volume([]) == (0, 0)
    with pytest.raises(ValueError, match=r"^shapes must be bounded"):
        union_volume([Placed(Sphere(1)), Placed(HalfSpace([0, 0, 1], 0))])


def test_unions_apart_share_nothing():
    found = of_pairs([Placed(Box([1, 1, 1]))], [Placed(Box([1, 1, 1]), [5, 0, 0])], {})
    assert not found and found.volume == found.volume_error == found.terms == 0
    assert found.centroid is None
    assert not found.gradient.any()


def test_touching_parts_add_their_error():
    a, b = [Placed(Box([1, 1, 1]))], [Placed(Box([1, 1, 1]), [2, 0, 0])]
    found = union_overlap(a, b)
    assert not found
    assert found.volume_error == overlap(*a, *b).volume_error > 0
