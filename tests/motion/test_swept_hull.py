"""Hulls of swept volumes: closed forms, poses within the outer polytope, and refused arguments."""

import numpy as np
import pytest
from strategies import rotation

from motion import many
from overlapper import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, Placed, RoundedHull, Sphere, swept_hull

STILL = (0, 0, 0)
BRICK = Box([0.5, 0.3, 0.2])


def part_of_turn(angle):
    """The volume of the hull of BRICK at all turns about z by up to an angle less than its corners' least distance."""
    gap = 2 * np.arctan2(0.3, 0.5)
    # Four arcs of the circle through the corners, and four chords between these.
    chords = np.sin(gap - angle) + np.sin(np.pi - gap - angle)
    return 0.34 * (chords + 2 * angle) * 0.4


CLOSED = {
    "translated box": (BRICK, ((3, 0, 0), STILL), 3 * 0.24 + BRICK.volume),
    "translated box, diagonal": (BRICK, ((1, 2, 3), STILL), BRICK.volume + 1 * 0.24 + 2 * 0.4 + 3 * 0.6),
    "ball along a segment": (Sphere(0.5), ((2, 0, 0), (1, 2, 3)), Capsule(0.5, 2).volume),
    "capsule along its axis": (Capsule(0.5, 1), ((0, 0, 1), (0, 0, 3)), Capsule(0.5, 2).volume),
    "cylinder along its axis": (Cylinder(0.5, 1), ((0, 0, 1), STILL), Cylinder(0.5, 2).volume),
    "box, full turn": (BRICK, (STILL, (0, 0, 7)), Cylinder(np.sqrt(0.34), 0.4).volume),
    "box, part of a turn": (BRICK, (STILL, (0, 0, 0.3)), part_of_turn(0.3)),
    "screw": (BRICK, ((0, 0, 1), (0, 0, 200)), None),
    "at rest": (BRICK, None, BRICK.volume),
    "plate, full turn": (Box([0.5, 0.3, 1e-6]), (STILL, (0, 0, 7)), Cylinder(np.sqrt(0.34), 2e-6).volume),
}


@pytest.mark.parametrize("tolerance", [0.05, 0.003])
@pytest.mark.parametrize("name", CLOSED)
def test_volumes_with_closed_forms_lie_between_both_polytopes(name, tolerance):
    shape, motion, volume = CLOSED[name]
    found = swept_hull(Placed(shape, (1, 2, 3)), motion, tolerance=tolerance)
    inner, outer = found.inner.volume, found.outer.volume
    assert found.converged and outer * (1 - tolerance) <= inner * (1 + 1e-12)
    if volume is not None:
        assert inner * (1 - 1e-12) <= volume <= outer * (1 + 1e-12)
    else:  # between a cylinder of the length of the way, and one with both ends
        assert Cylinder(np.sqrt(0.34), 1.0).volume < outer and inner < Cylinder(np.sqrt(0.34), 1.4).volume


def test_polyhedra_that_do_not_turn_are_exact():
    found = swept_hull(BRICK, ((3, 0, 0), STILL))
    assert found.inner.volume == pytest.approx(found.outer.volume, rel=1e-11)
    assert len(found.inner.shape.vertices) == 8


def test_the_motion_to_a_pose_is_that_of_the_velocities():
    to_pose = swept_hull(BRICK, Placed(BRICK, (1, 0, 0), (0, 0, np.sin(0.5), np.cos(0.5))), duration=2)
    by_velocity = swept_hull(BRICK, ((0.5, 0, 0), (0, 0, 0.5)), duration=2)
    assert to_pose.outer.volume == pytest.approx(by_velocity.outer.volume, rel=1e-9)


@pytest.mark.parametrize("name", [name for name in many.SHAPES if name != "half-space"])
def test_the_outer_polytope_contains_all_poses_and_the_inner_one_lies_in_their_hull(name):
    rng = np.random.default_rng(12)
    for spin in (0, 1, 6):
        body = Placed(many.SHAPES[name](rng), (1e3, 0, 0), rng.normal(size=4))
        motion = rng.normal(size=3), rng.normal(size=3) * spin
        found = swept_hull(body, motion, tolerance=0.03)
        assert found.converged
        assert found.inner.volume <= found.outer.volume <= found.inner.volume / 0.97 * (1 + 1e-9)
        planes = found.outer.shape.halfspaces
        times = rng.uniform(0, 1, 50)
        poses = [many.placed(body, motion, time) for time in times]
        reaches = np.array([[support(pose, n) for n in planes[:60, :3]] for pose in poses])
        assert (reaches - (planes[:60, :3] @ found.outer.position - planes[:60, 3])).max() < 1e-11
        # The vertices of the inner polytope are not farther than the body ever is.
        times = np.linspace(0, 1, 400)
        poses = [many.placed(body, motion, time) for time in times]
        corners = found.inner.shape.vertices + found.inner.position
        for n in planes[:8, :3]:
            most = max(support(pose, n) for pose in poses)
            assert (corners @ n).max() <= most + (1 + spin) ** 2 * 1e-4


def support(body, n):
    """How far a body reaches along a unit direction, from its formula."""
    shape, r = body.shape, rotation(body.orientation)
    local = r.T @ n
    if isinstance(shape, Sphere):
        far = shape.radius
    elif isinstance(shape, Box):
        far = np.abs(local) @ shape.half_extents
    elif isinstance(shape, Capsule):
        far = shape.radius + abs(local[2]) * shape.length / 2
    elif isinstance(shape, Cylinder):
        far = shape.radius * np.hypot(*local[:2]) + abs(local[2]) * shape.length / 2
    elif isinstance(shape, Ellipsoid):
        far = np.linalg.norm(local * shape.half_axes)
    elif isinstance(shape, RoundedHull):
        far = (shape.core.vertices @ local).max() + shape.radius
    else:
        assert isinstance(shape, Hull)
        far = (shape.vertices @ local).max()
    return n @ body.position + far


def test_a_thin_rod_in_any_direction():
    rod = Placed(Cylinder(1e-5, 2), orientation=(1, 2, 3, 4))
    found = swept_hull(rod, ((0.1, 0.2, 0.3), (0.3, 0.1, 0.2)))
    assert found.converged and found.inner.volume > 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"body": HalfSpace([0, 0, 1], 0)}, "body must not be a half-space"),
        ({"duration": -1}, "duration must be greater than 0"),
        ({"motion": (1, 2, 3)}, "motion must be a pair"),
        ({"motion": ((0, 0, np.inf), (0, 0, 0))}, "motion must be finite"),
        ({"tolerance": 2}, "tolerance must be greater than 0 and less than 1"),
        ({"tolerance": "1e-2"}, "tolerance must be a number"),
    ],
)
def test_refused_arguments(arguments, words):
    with pytest.raises(ValueError, match=words):
        swept_hull(**{"body": BRICK, **arguments})
