"""Hulls with a margin: rounded by a ball, and as near to each other as Bullet says."""

import copy
import math
import pickle

import numpy as np
import pybullet as p
import pytest
from numpy.testing import assert_allclose
from simulated import body

from overlapper import (
    Box,
    Capsule,
    HalfSpace,
    Hull,
    Placed,
    RoundedHull,
    Sphere,
    distance,
    overlap,
    penetration_depth,
)
from overlapper.polytopes.shape_text import alike, shape_of, text_of
from overlapper.reference import Fcl
from overlapper.simulation import Bodies
from overlapper.viewer.tessellation import tessellation

CUBE = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
SKEW = np.random.default_rng(3).normal(size=(12, 3)) + [3, -2, 1]
PROBE = 1e-9


# --- the shape


def test_a_rounded_cube_has_the_volume_of_its_slabs_edges_and_corners():
    cube = RoundedHull(CUBE, 0.1)
    assert cube.volume == pytest.approx(1 + 6 * 0.1 + 3 * math.pi * 0.01 + 4 / 3 * math.pi * 0.001, rel=1e-14)
    assert_allclose(cube.centroid, 0, atol=1e-15)
    assert_allclose(cube.bounds, [[-0.6] * 3, [0.6] * 3], rtol=1e-15)
    assert cube.core.volume == 1 and cube.radius == 0.1


@pytest.mark.parametrize("radius", [0.05, 1.0, 30.0])
def test_volume_and_centroid_are_those_of_the_set_itself(radius):
    """All of it is cut out of a box around it, by planes laid where they are needed."""
    hull = RoundedHull(SKEW, radius)
    middle, half = hull.bounds.mean(axis=0), np.diff(hull.bounds, axis=0)[0]
    whole = overlap(hull, Placed(Box(half), middle), tolerance=1e-3)
    assert abs(whole.volume - hull.volume) <= whole.volume_error <= 3e-3 * hull.volume
    assert_allclose(whole.centroid, hull.centroid, atol=1e-3 * half.max())


@pytest.mark.parametrize("height", [0.55, 0.5, 0.3, -0.57])
def test_a_plane_cuts_off_what_the_integral_over_its_slices_says(height):
    """Above the cube the slices are squares grown by s = sqrt(r² - h²); below the edge they are whole."""
    radius = 0.1
    cube = RoundedHull(CUBE, radius)

    def above(h):  # of the plane at h over the cube's face, 0 <= h <= r
        angle, root = math.acos(h / radius), math.sqrt(radius**2 - h**2)
        segment = (radius**2 * angle - h * root) / 2
        return (radius - h) + 4 * segment + math.pi * (2 / 3 * radius**3 - radius**2 * h + h**3 / 3)

    slab = 1 + 4 * radius + math.pi * radius**2
    if height >= 0.5:
        expected = above(height - 0.5)
    elif height >= -0.5:
        expected = above(0) + (0.5 - height) * slab
    else:
        expected = cube.volume - above(-height - 0.5)
    upper = overlap(cube, HalfSpace([0, 0, -1], -height), tolerance=1e-4)
    assert abs(upper.volume - expected) <= upper.volume_error < 3e-4 * expected


@pytest.mark.parametrize("seed", range(4))
def test_bounds_of_the_volume_hold_at_every_tolerance(seed):
    random = np.random.default_rng(seed)
    a = Placed(RoundedHull(SKEW, 0.3))
    b = Placed(RoundedHull(random.normal(size=(30, 3)), 0.1), a.centroid + random.normal(size=3), random.normal(size=4))
    fine = overlap(a, b, tolerance=1e-4)
    assert fine
    for tolerance in (0.5, 0.1, 0.01):
        rough = overlap(a, b, tolerance=tolerance)
        assert abs(rough.volume - fine.volume) <= rough.volume_error + fine.volume_error
    assert fine.volume_error < 3e-4 * fine.volume
    assert max(distance(Hull(SKEW), Placed(Sphere(PROBE), corner)) for corner in fine.vertices) < 0.301


def test_a_hull_of_nearly_a_point_is_nearly_a_ball():
    ball = RoundedHull(1e-6 * CUBE, 0.5)
    for other in (Sphere(0.5), Capsule(0.5, 1e-9)):
        lens = overlap(ball, Placed(other, (0.6, 0, 0)))
        assert lens.volume == pytest.approx(math.pi * 2.6 * 0.4**2 / 12, rel=1e-5 + lens.volume_error / lens.volume)
        assert lens.depth == pytest.approx(0.4, abs=2e-6)


def test_far_from_the_origin_nothing_is_lost():
    near = overlap(RoundedHull(CUBE, 0.1), Placed(RoundedHull(CUBE, 0.1), (0.7, 0.7, 0.7)))
    away = np.array([1e6, 2e6, -4e6])
    far = overlap(RoundedHull(CUBE + away, 0.1), Placed(RoundedHull(CUBE, 0.1), away + 0.7))
    assert far.volume == pytest.approx(near.volume, rel=1e-6)
    assert_allclose(RoundedHull(CUBE + away, 0.1).centroid, away, rtol=1e-15)


def test_the_status_changes_where_the_margins_meet():
    a = RoundedHull(CUBE, 1e-3)
    for height, status in ((1.002 - 1e-9, "overlapping"), (1.002, "touching"), (1.002 + 1e-9, "separated")):
        assert overlap(a, Placed(a, (0, 0, height))).status == status


def test_a_rounded_hull_is_pickled_unchanged():
    shape = RoundedHull(SKEW, 0.25)
    for again in (pickle.loads(pickle.dumps(shape)), copy.deepcopy(shape), shape_of(text_of(shape))):
        assert again.volume == pytest.approx(shape.volume, rel=1e-14)
        assert alike(again, shape) and not alike(again, Hull(SKEW)) and not alike(again, RoundedHull(SKEW, 0.26))
    assert (
        repr(shape) == f"RoundedHull({len(shape.core.vertices)} vertices, {len(shape.core.facets)} facets, radius=0.25)"
    )


def test_a_rounded_hull_is_drawn_with_its_facets_where_they_are():
    drawn = tessellation(RoundedHull(CUBE, 0.1)).vertices
    assert_allclose([drawn.min(axis=0), drawn.max(axis=0)], [[-0.6] * 3, [0.6] * 3], rtol=1e-12)


def test_unsupported_uses_of_a_rounded_hull_are_refused():
    with pytest.raises(ValueError, match="radius must be greater than 0"):
        RoundedHull(CUBE, 0)
    with pytest.raises(ValueError, match="vertices are flat"):
        RoundedHull(CUBE[:4], 0.1)
    pair = RoundedHull(CUBE, 0.1), Placed(RoundedHull(CUBE, 0.1), (0.5, 0, 0))
    with pytest.raises(ValueError, match="shapes must not be rounded hulls for method 'paper'"):
        overlap(*pair, method="paper")
    with Fcl() as fcl:
        assert fcl.compare(overlap(*pair)).verdict == "unsupported"


# --- Bullet's


def hull(client, points, **pose):
    return body(client, p.GEOM_MESH, vertices=np.asarray(points).tolist(), **pose)


def apart(a, b):
    """As pybullet has it: negative where they overlap."""
    return distance(a, b) or -penetration_depth(a, b)


@pytest.mark.parametrize("surface", ["nominal", "margin"])
def test_hulls_are_as_far_apart_as_bullet_says_with_their_margins(client, surface):
    random = np.random.default_rng(5)
    first = hull(client, 0.3 * random.normal(size=(15, 3)))
    second = hull(client, 0.3 * random.normal(size=(15, 3)), position=[1, 0, 0])
    bodies, found = Bodies(client, surface=surface), []
    for _ in range(12):
        p.resetBasePositionAndOrientation(
            second, random.normal(size=3).tolist(), random.normal(size=4).tolist(), physicsClientId=client
        )
        bodies.update()
        nearest = p.getClosestPoints(first, second, 10, physicsClientId=client)
        found.append((apart(*bodies.placed), min(point[8] for point in nearest)))
    ours, bullets = np.array(found).T
    assert (ours < 0).any() and (ours > 0).any()
    assert_allclose(ours - bullets, 0 if surface == "margin" else 2e-3, atol=1e-6)


@pytest.mark.parametrize("gap", [-0.05, -0.001, 0.0015])
@pytest.mark.parametrize("other", ["hull", "box", "sphere", "capsule", "cylinder", "plane"])
def test_depths_are_those_of_contact_points(client, other, gap):
    """A cube of points over the middle of another shape; which of the two has a margin is Bullet's affair."""
    tops = {"plane": 0.0, "capsule": 0.7}
    below = {
        "hull": lambda: hull(client, CUBE, mass=0),
        "box": lambda: body(client, p.GEOM_BOX, halfExtents=[0.5] * 3, mass=0),
        "sphere": lambda: body(client, p.GEOM_SPHERE, radius=0.5, mass=0),
        "capsule": lambda: body(client, p.GEOM_CAPSULE, radius=0.5, height=0.4, mass=0),
        "cylinder": lambda: body(client, p.GEOM_CYLINDER, radius=0.5, height=1, mass=0),
        "plane": lambda: body(client, p.GEOM_PLANE, mass=0),
    }[other]()
    above = hull(client, CUBE, position=[0, 0, tops.get(other, 0.5) + 0.5 + gap])
    p.performCollisionDetection(client)
    points = p.getContactPoints(above, below, physicsClientId=client)
    bodies = Bodies(client, surface="margin")
    ours = apart(*bodies.placed)
    assert_allclose([point[8] for point in points], ours, atol=2e-6)
    contacts = bodies.overlaps()
    assert [contact.overlap.depth for contact in contacts] == pytest.approx([-ours] if ours < 0 else [], abs=1e-12)


def test_boxes_are_sharp_with_and_without_margins(client):
    body(client, p.GEOM_BOX, halfExtents=[0.1, 0.2, 0.3]), body(client, p.GEOM_CYLINDER, radius=0.1, height=0.2)
    plain, margined = (Bodies(client, surface=surface).shapes for surface in ("nominal", "margin"))
    assert list(map(repr, plain)) == list(map(repr, margined))
    with pytest.raises(ValueError, match="surface must be one of 'nominal', 'margin', not 'sharp'"):
        Bodies(client, surface="sharp")


def test_a_margin_that_is_changed_is_noticed(client):
    first = hull(client, CUBE)
    shape = p.createCollisionShape(p.GEOM_MESH, vertices=CUBE.tolist(), physicsClientId=client)
    shared = [p.createMultiBody(1, shape, basePosition=[x, 0, 0], physicsClientId=client) for x in (3, 6)]
    bodies, nominal = Bodies(client, surface="margin"), Bodies(client)
    untouched = bodies.shapes[0]
    p.changeDynamics(shared[0], -1, collisionMargin=0.05, physicsClientId=client)
    bodies.update(), nominal.update()
    assert bodies.shapes[0] is untouched
    assert [shape.radius for shape in bodies.shapes] == [0.001, 0.05, 0.05]
    (nearest,) = p.getClosestPoints(first, shared[0], 10, physicsClientId=client)
    assert apart(*bodies.placed[:2]) == pytest.approx(nearest[8], abs=1e-6)
    assert {type(shape) for shape in nominal.shapes} == {Hull}
    # A margin of none leaves the hull as it is.
    p.changeDynamics(first, -1, collisionMargin=0, physicsClientId=client)
    bodies.update()
    assert isinstance(bodies.shapes[0], Hull)


def test_the_report_counts_pairs_that_only_margins_hold_apart(client):
    """Cubes of points 1.5 mm apart, and one that overlaps; boxes have no margin around them."""
    gap = 1.0015
    ground = body(client, p.GEOM_BOX, halfExtents=[9, 9, 0.5], position=[0, 0, -0.5], mass=0)
    low, high = (hull(client, CUBE, position=[0, 0, z]) for z in (0.5005, 0.5005 + gap))
    hull(client, CUBE, position=[3, 0, 0.49])
    body(client, p.GEOM_BOX, halfExtents=[0.5] * 3, position=[6, 0, 0.5])
    bodies = Bodies(client)
    assert bodies.report().pairs_within_margins == 0  # nothing has been asked for
    bodies.overlaps()
    assert bodies.report().pairs_within_margins == 0  # pybullet has not looked for contacts
    p.performCollisionDetection(client)
    contacts = bodies.overlaps()
    assert bodies.report().pairs_within_margins == 2
    assert str(bodies.report()).splitlines()[-1] == (
        "2 more pairs of links touch only with the collision margins of Bullet; surface='margin' measures them"
    )
    margined = Bodies(client, surface="margin")
    assert len(margined.overlaps()) == len(contacts) + 2
    assert margined.report().pairs_within_margins == 0
    assert "margins" not in str(margined.report())
    for among, number in (("all", 2), ([(low, ground)], 1), ([(high, ground)], 0)):
        bodies.overlaps(pairs=among)
        assert bodies.report().pairs_within_margins == number
    p.removeBody(high, physicsClientId=client)
    p.performCollisionDetection(client)
    bodies.update()
    bodies.overlaps()
    assert bodies.report().pairs_within_margins == 1


def test_contacts_of_bodies_that_are_not_known_yet_are_not_counted(client):
    body(client, p.GEOM_BOX, halfExtents=[9, 9, 0.5], position=[0, 0, -0.5], mass=0)
    bodies = Bodies(client)
    bodies.overlaps()
    hull(client, CUBE, position=[0, 0, 0.5005])
    p.performCollisionDetection(client)
    assert bodies.report().pairs_within_margins == 0
    bodies.update()
    bodies.overlaps()
    assert bodies.report().pairs_within_margins == 1
