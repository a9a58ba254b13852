"""Height fields are the ground that pybullet's rays and contacts meet, where a recorder has heard of their heights."""

import math

import numpy as np
import pybullet as p
import pytest
from simulated import body

from overlapper import Placed, Sphere, distance, penetration_depth
from overlapper.simulation import Bodies, SkippedShapeWarning, link_contacts
from overlapper.simulation.bullet.recorder import height_field
from overlapper.simulation.height_field import HeightField

PROBE = 1e-6
TILTED = p.getQuaternionFromEuler([0.2, -0.1, 0.7])


def field_shape(client, heights, scale=(1, 1, 1), **options):
    """A height field of heights (columns, rows)."""
    heights = np.asarray(heights, dtype=float)
    return p.createCollisionShape(
        p.GEOM_HEIGHTFIELD,
        meshScale=scale,
        heightfieldData=heights.ravel().tolist(),
        numHeightfieldRows=heights.shape[1],
        numHeightfieldColumns=heights.shape[0],
        physicsClientId=client,
        **options,
    )


def field(client, heights, scale=(1, 1, 1), position=(0, 0, 0), orientation=(0, 0, 0, 1)):
    shape = field_shape(client, heights, scale)
    return p.createMultiBody(0, shape, -1, position, orientation, physicsClientId=client)


def ball(client, position, radius=0.1, mass=1):
    return body(client, p.GEOM_SPHERE, radius=radius, mass=mass, position=position)


def prisms(bodies, ground):
    return [placed for key, placed in zip(bodies.keys, bodies.placed) if key[0] == ground]


def modelled(bodies, ground):
    """The prisms by number."""
    return {key[2]: shape for key, shape in zip(bodies.keys, bodies.shapes) if key[0] == ground}


def rough(columns=7, rows=5, seed=1):
    return np.random.default_rng(seed).uniform(0, 1, (columns, rows))


@pytest.mark.parametrize("pose", [{}, {"position": [1, -2, 3], "orientation": TILTED}])
def test_the_ground_surface_is_where_rays_hit_it(client, recorder, pose):
    ground = field(client, rough(), scale=[0.3, 0.2, 0.5], **pose)
    everywhere = ball(client, pose.get("position", [0, 0, 0]), radius=2, mass=1)
    bodies = Bodies(client, recorder=recorder)
    p.removeBody(everywhere, physicsClientId=client)
    bodies.update()
    assert len(prisms(bodies, ground)) == 2 * 6 * 4 == bodies.report().shapes == bodies.report().shapes_read
    random, hits = np.random.default_rng(2), 0
    up = np.array(p.multiplyTransforms([0, 0, 0], pose.get("orientation", [0, 0, 0, 1]), [0, 0, 1], [0, 0, 0, 1])[0])
    for _ in range(40):
        under = [*random.uniform(-0.55, 0.55, 2), 0]
        foot = np.array(p.multiplyTransforms(*p.getBasePositionAndOrientation(ground, client), under, [0, 0, 0, 1])[0])
        ((hit, _, _, where, _),) = p.rayTest(foot + 3 * up, foot - 3 * up, physicsClientId=client)
        hits += hit == ground
        above, below = (Placed(Sphere(PROBE), np.array(where) + side * 1e-4 * up) for side in (1, -1))
        if hit == ground:
            assert min(distance(prism, above) for prism in prisms(bodies, ground)) > 0
            assert max(penetration_depth(prism, below) for prism in prisms(bodies, ground)) > 0
    assert hits > 30


def test_a_ball_in_flat_ground_shares_a_cap_with_it(client, recorder):
    ground = field(client, np.full((5, 5), 0.7), scale=[0.2, 0.2, 1])
    sunk = ball(client, [0.02, 0.03, 0.06])
    bodies = Bodies(client, recorder=recorder)
    (pair,) = link_contacts(bodies.overlaps(tolerance=0.01))
    assert (pair.bodyA, pair.bodyB) == (ground, sunk)
    cap = math.pi * 0.04**2 * (0.1 - 0.04 / 3)
    assert abs(pair.volume - cap) <= pair.volume_error < 0.02 * cap
    p.performCollisionDetection(client)
    deepest = -min(point[8] for point in p.getContactPoints(ground, sunk, physicsClientId=client))
    assert deepest == pytest.approx(0.04, abs=1e-6)
    assert {contact.shapeA for contact in pair.contacts} <= set(range(2 * 4 * 4))


def test_only_the_ground_near_moving_bodies_is_modelled(client, recorder):
    ground = field(client, rough(101, 101), scale=[0.1, 0.1, 0.1])
    moving, ghost = ball(client, [-3, -3, 0]), ball(client, [3, -3, 0])
    ball(client, [3, 3, 0], mass=0)
    p.setCollisionFilterPair(ghost, ground, -1, -1, 0, physicsClientId=client)
    bodies = Bodies(client, recorder=recorder)
    report = bodies.report()
    assert report.shapes == 2 * 100 * 100 + 3 and 10 < report.shapes_read < 100
    assert all(np.linalg.norm(prism.centroid[:2] + 3) < 1 for prism in prisms(bodies, ground))
    before = modelled(bodies, ground)
    p.resetBasePositionAndOrientation(moving, [-3, -2.9, 0.02], [0, 0, 0, 1], physicsClientId=client)
    bodies.update()
    after = modelled(bodies, ground)
    kept = before.keys() & after.keys()
    assert kept and before.keys() != after.keys() and all(before[number] is after[number] for number in kept)


def test_ground_is_released_behind_a_moving_body(client, recorder):
    ground = field(client, rough(21, 401), scale=[0.1, 0.1, 0.1])
    wheels = [ball(client, [-18, y, 0]) for y in (-0.4, 0.4)]
    bodies = Bodies(client, recorder=recorder)
    first, most = len(prisms(bodies, ground)), 0
    for x in np.linspace(-18, 18, 200):
        for wheel, y in zip(wheels, (-0.4, 0.4)):
            p.resetBasePositionAndOrientation(wheel, [x, y, 0.02], [0, 0, 0, 1], physicsClientId=client)
        bodies.update()
        # The heights are between -0.05 and 0.05.
        assert {contact.bodyB for contact in bodies.overlaps()} == {*wheels}
        most = max(most, len(prisms(bodies, ground)))
        assert all(np.abs(prism.centroid[0] - x) < 1 for prism in prisms(bodies, ground))
    assert first > 10 and most < 3 * first
    for wheel in wheels:
        p.resetBasePositionAndOrientation(wheel, [0, 0, 9], [0, 0, 0, 1], physicsClientId=client)
    bodies.update()
    assert prisms(bodies, ground) == []


def test_ground_is_updated_only_after_a_body_has_moved_some_distance(client, recorder, monkeypatch):
    field(client, rough(21, 401), scale=[0.1, 0.1, 0.1])
    wheel = ball(client, [-18, 0, 0], radius=1)
    bodies = Bodies(client, recorder=recorder)
    asked, under = [], HeightField.under
    monkeypatch.setattr(HeightField, "under", lambda *arguments: (asked.append(1), under(*arguments))[1])
    for x in np.linspace(-18, -8, 500):
        p.resetBasePositionAndOrientation(wheel, [x, 0, 0], [0, 0, 0, 1], physicsClientId=client)
        bodies.update()
    assert 10 < len(asked) < 10 / 0.25 + 5


def test_a_field_without_a_finite_pose_is_left_out_until_it_has_one(client, recorder):
    ground = field(client, rough(41, 41), scale=[0.1, 0.1, 0.1])
    ball(client, [0, 0, 0])
    bodies = Bodies(client, recorder=recorder)
    before = modelled(bodies, ground)
    p.resetBasePositionAndOrientation(ground, [math.nan] * 3, [0, 0, 0, 1], physicsClientId=client)
    with pytest.warns(SkippedShapeWarning, match=rf"height field \(body {ground}, .*no finite pose"):
        bodies.update()
    assert modelled(bodies, ground) == {} and bodies.overlaps() == []
    p.resetBasePositionAndOrientation(ground, [0, 0, 0], [0, 0, 0, 1], physicsClientId=client)
    bodies.update()
    assert modelled(bodies, ground).keys() == before.keys() and len(link_contacts(bodies.overlaps())) == 1


def test_another_body_on_the_ground_has_its_own_ground(client, recorder):
    ground = field(client, rough(41, 41), scale=[0.1, 0.1, 0.1])
    small = ball(client, [-1, -1, 0])
    bodies = Bodies(client, recorder=recorder)
    before = modelled(bodies, ground)
    p.removeBody(small, physicsClientId=client)
    assert ball(client, [-1, -1, 0], radius=0.5) == small
    bodies.update()
    assert before.keys() < modelled(bodies, ground).keys()
    ball(client, [1, 1, 0])
    bodies.update()
    assert any(prism.centroid[0] > 0.5 for prism in prisms(bodies, ground))


def test_heights_that_are_replaced_are_noticed(client, recorder):
    heights = np.zeros((3, 3))
    heights[2, 2] = 1
    shape = field_shape(client, heights)
    p.createMultiBody(0, shape, physicsClientId=client)
    ball(client, [-0.5, -0.5, -0.41])
    bodies = Bodies(client, recorder=recorder)
    assert len(link_contacts(bodies.overlaps())) == 1
    for height, met in ((-0.5, 0), (0.1, 1)):
        changed = np.where(heights == 1, 1, height)
        assert field_shape(client, changed, replaceHeightfieldIndex=shape) == shape
        ((_, _, _, where, _),) = p.rayTest([-0.6, -0.7, 5], [-0.6, -0.7, -5], physicsClientId=client)
        bodies.update()
        assert len(link_contacts(bodies.overlaps())) == met
        if met:
            assert where[2] == pytest.approx(0.1 - 0.5, abs=1e-6)


def test_a_field_that_no_recorder_has_noted_is_skipped_by_name(client):
    ground = field(client, rough())
    with pytest.warns(SkippedShapeWarning, match="a height field is modelled only if a Recorder noted"):
        bodies = Bodies(client)
    assert [(each.body, each.link) for each in bodies.skipped] == [(ground, -1)] and bodies.keys == []


def test_another_body_with_the_id_of_a_field_is_no_field(client, recorder):
    ground = field(client, rough())
    bodies = Bodies(client, recorder=recorder)
    p.removeBody(ground, physicsClientId=client)
    assert ball(client, [0, 0, 0]) == ground
    bodies.update()
    assert [type(shape) for shape in bodies.shapes] == [Sphere]
    p.resetSimulation(physicsClientId=client)
    assert recorder.height_field(ground) is None


def test_triangles_under_a_box_are_those_that_it_may_meet():
    heights = np.arange(20.0).reshape(4, 5)
    field = height_field(heights.ravel(), 5, 4, [1, 1, 1])
    assert field.count == 24 and field.heights.max() == 9.5 and field.base == -9.5 - 4
    everything = field.under(np.array([-9, -9, -99]), np.array([9, 9, 99]))
    assert sorted(everything) == list(range(24))
    assert field.under(np.array([-9, -9, 9.6]), np.array([9, 9, 99])).size == 0
    assert sorted(field.under(np.array([-1.9, -1.4, 0]), np.array([-1.8, -1.3, 99]))) == []
    assert sorted(field.under(np.array([-1.9, -1.4, -4]), np.array([-1.8, -1.3, 99]))) == [0, 1]
    total = sum(field.prism(number).volume for number in range(24))
    assert total == pytest.approx(3 * 4 * -field.base, rel=1e-12)  # of a slope through the middle
