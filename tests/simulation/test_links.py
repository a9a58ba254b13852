"""The overlap of a pair of links counts every volume once. Concave meshes are unions of convex parts."""

import pybullet as p
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from simulated import body

from overlapper.polytopes import decomposition
from overlapper.simulation import Bodies, SkippedShapeWarning, link_contacts, modelling

PROFILE = [[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]]
CORNERS = [[x, y, z] for z in (0, 1) for x, y in PROFILE]
ENDS = [[0, 1, 2], [0, 2, 3], [0, 3, 5], [3, 4, 5]]
SIDES = [side for i in range(6) for j in [(i + 1) % 6] for side in ([i, j, j + 6], [i, j + 6, i + 6])]
FACES = [end[::-1] for end in ENDS] + [[k + 6 for k in end] for end in ENDS] + SIDES


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    modelling._decomposition.cache_clear()


def bent(client, scale=1.0, faces=FACES, **frame):
    """An L of three cubes, its volume 3 scale³."""
    indices = [corner for face in faces for corner in face]
    return body(client, p.GEOM_MESH, vertices=CORNERS, indices=indices, meshScale=[scale] * 3, **frame)


def cross(client, position):
    """Three bars that cross in the middle: seven cubes of edge 0.2."""
    bars = [[0.3, 0.1, 0.1], [0.1, 0.3, 0.1], [0.1, 0.1, 0.3]]
    shape = p.createCollisionShapeArray(
        shapeTypes=[p.GEOM_BOX] * 3, halfExtents=bars, collisionFramePositions=[[0, 0, 0]] * 3, physicsClientId=client
    )
    return p.createMultiBody(1, shape, basePosition=position, physicsClientId=client)


def test_bars_that_cross_share_their_middle_once(client):
    first = cross(client, [0, 0, 0])
    second = body(client, p.GEOM_BOX, halfExtents=[1, 1, 1], position=[0.95, 0.05, 0.02])
    contacts = Bodies(client).overlaps()
    assert len(contacts) == 3
    (pair,) = link_contacts(contacts)
    assert (pair.bodyA, pair.linkA, pair.bodyB, pair.linkB) == (first, -1, second, -1)
    assert pair and pair.status == "overlapping"
    # Beyond x = -0.05: of the bar along x 0.35, of the two others a cross-section of 5 squares over 0.15 less the bar.
    exact = 0.35 * 0.04 + 4 * 0.04 * 0.15
    assert sum(contact.overlap.volume for contact in contacts) > 1.2 * exact
    assert abs(pair.volume - exact) <= pair.volume_error + 1e-15 and pair.volume_error < 1e-12
    assert_allclose(pair.centroid[1:], 0, atol=1e-12)
    deepest = max(contacts, key=lambda contact: contact.overlap.depth)
    assert_allclose(pair.gradient, pair.overlap.gradient)
    assert_allclose(pair.patch_area, -pair.gradient[0, :3], atol=1e-12)
    # As the box moves along x, the volume changes by the cross-section in its face.
    assert_allclose(pair.patch_area, [-0.2, 0, 0], atol=1e-12)
    assert pair.deepest is deepest
    assert pair.depth == deepest.overlap.depth
    assert_array_equal(pair.normal, deepest.overlap.normal)
    assert_allclose(pair.overlap.gradient.sum(axis=0), 0, atol=1e-12)


def test_overlapping_crosses_share_the_volume_of_their_cubes(client):
    cross(client, [0, 0, 0])
    cross(client, [0.2, 0, 0])
    (pair,) = link_contacts(Bodies(client).overlaps())
    # The bars along x have two cubes in common, and each middle lies in an arm of the other.
    assert len(pair.contacts) > 1
    assert abs(pair.volume - 2 * 0.2**3) <= pair.volume_error + 1e-15


def test_every_pair_of_links_is_seen_once_and_sorted(client):
    for x in (0.0, 0.5, 1.0):
        cross(client, [x, 0, 0])
    contacts = Bodies(client).overlaps()
    pairs = link_contacts(reversed(contacts))
    assert [(pair.bodyA, pair.bodyB) for pair in pairs] == [(0, 1), (1, 2)]
    assert sum(len(pair.contacts) for pair in pairs) == len(contacts)
    assert link_contacts([]) == []


def test_links_that_touch_have_no_volume(client):
    body(client, p.GEOM_BOX, halfExtents=[1, 1, 1])
    body(client, p.GEOM_BOX, halfExtents=[1, 1, 1], position=[2, 0, 0])
    (pair,) = link_contacts(Bodies(client).overlaps())
    assert not pair and pair.status == "touching" and pair.volume == pair.depth == 0
    assert pair.centroid is None
    assert abs(pair.normal[0]) == pytest.approx(1)


# --- concave meshes


def test_a_concave_mesh_meets_a_box_in_its_solid_and_not_in_its_hull(client, capfd):
    frame = {"collisionFramePosition": [0.1, 0.2, 0.3], "collisionFrameOrientation": [0, 0, 2**-0.5, 2**-0.5]}
    mesh = bent(client, 0.1, **frame)
    plate = body(client, p.GEOM_BOX, halfExtents=[1, 1, 0.01], position=[0, 0, 0.35])
    bodies = Bodies(client)
    (found,) = bodies.decomposed
    assert (found.body, found.link, found.shapes) == (mesh, -1, range(2))
    assert found.mesh_volume == pytest.approx(3e-3)
    assert found.volume == pytest.approx(3e-3, rel=2e-3)
    assert found.path.is_file() and str(found.path) in capfd.readouterr().err
    assert bodies.keys == [(mesh, -1, 0), (mesh, -1, 1), (plate, -1, 0)]
    assert bodies.skipped == []
    assert (bodies.report().shapes, bodies.report().shapes_read) == (3, 3)
    (pair,) = link_contacts(bodies.overlaps())
    assert pair.volume == pytest.approx(0.02 * 0.03, rel=2e-3)
    # The L's centre of area is at 5/6 of its cubes, turned by a quarter about z.
    assert_allclose(pair.centroid, [0.1 - 0.1 * 5 / 6, 0.2 + 0.1 * 5 / 6, 0.35], atol=1e-4)


def test_bullet_and_the_convex_parts_agree_on_the_place_of_a_mesh(client):
    """The part of the L's hull that is empty, and its two arms, probed by a ball."""
    bent(client)
    ball = body(client, p.GEOM_SPHERE, radius=0.1)
    bodies = Bodies(client)
    for place, inside in (([1.4, 1.4, 0.5], False), ([0.5, 1.95, 0.5], True), ([1.95, 0.5, 0.5], True)):
        p.resetBasePositionAndOrientation(ball, place, [0, 0, 0, 1], physicsClientId=client)
        bodies.update()
        assert bool(bodies.overlaps()) == inside
        points = p.getClosestPoints(0, ball, 0.0, physicsClientId=client)
        assert bool(points) == inside


def test_shape_numbers_continue_after_a_concave_mesh(client, tmp_path):
    corners = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS)
    faces = "".join("f {} {} {}\n".format(*(corner + 1 for corner in face)) for face in FACES)
    (tmp_path / "bent.obj").write_text(corners + faces)
    inertia = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    mesh = f'<collision concave="yes"><geometry><mesh filename="{tmp_path}/bent.obj"/></geometry></collision>'
    box = '<collision><origin xyz="9 0 0"/><geometry><box size="1 1 1"/></geometry></collision>'
    (tmp_path / "bent.urdf").write_text(f'<robot name="r"><link name="l">{inertia}{mesh}{box}</link></robot>')
    id = p.loadURDF(str(tmp_path / "bent.urdf"), physicsClientId=client)
    bodies = Bodies(client)
    assert bodies.keys == [(id, -1, 0), (id, -1, 1), (id, -1, 2)]
    assert_allclose(bodies.positions[2], [9, 0, 0], atol=1e-9)
    with pytest.warns(
        SkippedShapeWarning, match="1 of 2 shapes: a concave mesh is left out, because concave is 'skip'"
    ):
        assert Bodies(client, concave="skip").keys == [(id, -1, 1)]


def test_equal_meshes_are_decomposed_once_and_share_their_parts(client, monkeypatch):
    asked = []
    monkeypatch.setattr(modelling, "decompose", lambda *a: asked.append(a) or decomposition.decompose(*a))
    bent(client)
    bent(client, position=[0.5, 0, 0.5])
    bodies = Bodies(client, concave_threshold=0.1)
    assert len(asked) == 1 and asked[0][1:] == (0.1, False)
    assert bodies.shapes[0] is bodies.shapes[2]


def test_an_open_mesh_is_skipped_unless_it_may_be_enclosed(client):
    id = bent(client, faces=FACES[1:])
    with pytest.warns(SkippedShapeWarning, match="its surface has 3 open edges"):
        assert Bodies(client).keys == []
    bodies = Bodies(client, concave="enclose", concave_threshold=1)
    assert bodies.keys == [(id, -1, 0)]
    assert bodies.decomposed[0].mesh_volume is None


def test_a_failure_of_coacd_is_named_and_not_repeated(client, monkeypatch, tmp_path):
    (tmp_path / "coacd.py").write_text("import os\nos.abort()")
    monkeypatch.syspath_prepend(tmp_path)
    bent(client)
    with pytest.warns(SkippedShapeWarning, match="CoACD failed on the concave mesh: its process ended with signal"):
        bodies = Bodies(client)
    monkeypatch.setattr(modelling, "decompose", None)
    bent(client)
    with pytest.warns(SkippedShapeWarning, match="CoACD failed"):
        bodies.update()
    assert [each.body for each in bodies.skipped] == [0, 1]


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"concave": "yes"}, "concave must be one of 'decompose', 'enclose', 'skip'"),
        ({"concave_threshold": 0}, "concavity threshold"),
    ],
)
def test_invalid_choices_are_named(client, options, reason):
    with pytest.raises(ValueError, match=reason):
        Bodies(client, **options)
