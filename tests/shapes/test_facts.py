"""Every kind of shape answers every question, and its answers agree with the core and with each other."""

from fractions import Fraction
from random import Random
from typing import get_args

import numpy as np
import pytest
from plain_cases import MORE_SHAPES
from plain_cases import SHAPES as RECORDED

import overlapper
from overlapper import Placed, Shape
from overlapper.polytopes.shape_text import shape_of, text_of
from overlapper.proof.rational_body import RationalBody
from overlapper.quaternion import rotated
from overlapper.rational import exact
from overlapper.shapes.facts import Facts
from overlapper.shapes.table import KINDS, facts

MADE = [make(Random(1)) for make in (*RECORDED.values(), *MORE_SHAPES.values())]
SHAPES = [shape for shape in MADE if type(shape) in KINDS]
BOUNDED = [shape for shape in SHAPES if facts(shape).bounded]


def name(shape):
    return type(shape).__name__


def directions(count):
    return np.random.default_rng(0).normal(size=(count, 3))


def test_the_table_has_every_kind_of_shape():
    assert set(get_args(Shape)) <= KINDS.keys()
    assert {type(shape) for shape in SHAPES} == KINDS.keys()
    assert {kind.__name__ for kind in get_args(Shape)} <= {*overlapper.__all__}


@pytest.mark.parametrize("shape", SHAPES, ids=name)
def test_every_question_is_answered(shape):
    asked = {each for each in {*vars(Facts), *Facts.__annotations__} if not each.startswith("_")}
    assert len(asked) > 15
    assert asked - set(dir(facts(shape))) == set()


@pytest.mark.parametrize("shape", SHAPES, ids=name)
def test_the_text_of_a_shape_makes_the_same_shape(shape):
    again = shape_of(text_of(shape))
    assert type(again) is type(shape)
    assert text_of(again) == text_of(shape)


@pytest.mark.parametrize("shape", BOUNDED, ids=name)
def test_a_ball_around_a_shape_is_not_much_larger(shape):
    centre, radius = facts(shape).ball()
    for turn in np.random.default_rng(0).normal(size=(200, 4)):
        placed = Placed(shape, (0, 0, 0), turn)
        reach = np.abs(placed.bounds - rotated(placed.orientation, centre)).max()
        assert 0.2 * radius < reach <= radius * (1 + 1e-12)


@pytest.mark.parametrize("shape", SHAPES, ids=name)
def test_only_unbounded_shapes_have_balls_without_end(shape):
    assert np.isfinite(facts(shape).ball()[1]) == np.isfinite(shape.bounds).all() == facts(shape).bounded


@pytest.mark.parametrize("shape", BOUNDED, ids=name)
def test_the_drawn_mesh_is_as_large_as_the_shape(shape):
    drawn = facts(shape).tessellation()
    size = np.ptp(shape.bounds, axis=0).max()
    assert np.abs([drawn.vertices.min(axis=0), drawn.vertices.max(axis=0)] - shape.bounds).max() < 0.3 * size
    corners = drawn.vertices[drawn.faces]
    volume = np.linalg.det(corners - shape.centroid).sum() / 6
    assert 0.8 * shape.volume < volume < 1.2 * shape.volume


@pytest.mark.parametrize("shape", BOUNDED, ids=name)
def test_support_is_that_of_the_bounds_of_the_core(shape):
    body = RationalBody(Placed(shape))
    for k in range(3):
        for side, bound in ((-1, shape.bounds[0][k]), (1, shape.bounds[1][k])):
            direction = exact(np.eye(3)[k] * side)
            flat, square = body.support(direction)
            assert float(flat) + np.sqrt(float(square)) == pytest.approx(side * bound, rel=1e-12)


@pytest.mark.parametrize("shape", BOUNDED, ids=name)
def test_points_are_held_up_to_the_support_and_not_beyond(shape):
    """A ray from the centroid leaves the shape below every plane that supports it."""
    body = RationalBody(Placed(shape, (0.3, -0.2, 0.1), (0.1, 0.2, 0.3, 0.9)))
    centre = body.position + body.axes @ exact(shape.centroid)
    assert body.contains(centre[None], Fraction(1, 10**6)).all()
    for direction in map(exact, directions(10)):
        flat, square = body.support(direction)
        height = float(flat - direction @ centre) + np.sqrt(float(square))
        beyond = centre + direction * Fraction(1.001 * height) / (direction @ direction)
        assert not body.contains(beyond[None])[0]
        if body.facts.has_exits:
            (share,) = body.exits(centre, (beyond - centre)[None], 64)
            inside = centre + (beyond - centre) * Fraction(share, 1 << 64)
            outside = centre + (beyond - centre) * (Fraction(share, 1 << 64) + Fraction(1, 1 << 40))
            assert body.contains(np.array([inside, outside])).tolist() == [True, False]


@pytest.mark.parametrize("shape", SHAPES, ids=name)
def test_the_tightest_plane_separates_an_outside_point_from_the_shape(shape):
    body = RationalBody(Placed(shape))
    size = np.ptp(shape.bounds, axis=0).max() if body.facts.bounded else 1.0
    points = [point for point in map(exact, 4 * size * directions(20)) if not body.contains(point[None])[0]]
    assert points
    for point in points:
        normal = body.tightest(point)
        flat, square = body.support(normal)
        assert float(normal @ point) > float(flat) + np.sqrt(float(square))


@pytest.mark.parametrize("shape", SHAPES, ids=name)
def test_a_flat_side_faces_the_point_that_was_asked_for(shape):
    known = facts(shape)
    assert (known.side(np.ones(3)) is None) == (known.planes is None)
    if known.planes:
        normal, offset, corners = known.side(np.array([10.0, 0.0, 0.0]))
        assert np.linalg.norm(normal) == pytest.approx(1.0)
        assert corners @ normal == pytest.approx(np.full(len(corners), offset))
        exactly = known.planes.facing(normal)
        flat, _ = RationalBody(Placed(shape)).support(exactly)
        assert float(flat) / np.sqrt(float(exactly @ exactly)) == pytest.approx(offset)
