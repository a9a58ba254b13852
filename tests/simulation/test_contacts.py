"""Overlaps of the bodies of a simulation, pair by pair, with names and colours."""

import pickle
import re
import sys

import pybullet as p
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from simulated import body, box, random_robot

from overlapper.simulation import Bodies, SkippedShapeWarning, link_contacts
from overlapper.tables.table import COLUMNS

# --- overlaps


def test_contacts_name_bodies_links_and_shapes_in_order(client, tmp_path):
    ground = box(client, mass=0, position=[0, 0, -0.45])
    robot = p.loadURDF("r2d2.urdf", [0, 0, 0.5], physicsClientId=client)
    cube = box(client, 0.1, position=[0, 0, 0.1])
    bodies = Bodies(client)
    contacts = bodies.overlaps()
    keys = [(c.bodyA, c.linkA, c.shapeA, c.bodyB, c.linkB, c.shapeB) for c in contacts]
    assert keys == sorted(keys) and len(keys) == len(set(keys)) > 2
    assert {(c.bodyA, c.bodyB) for c in contacts} <= {(ground, robot), (ground, cube), (robot, cube)}
    placed = dict(zip(bodies.keys, bodies.placed))
    for key, contact in zip(keys, contacts):
        a, b = contact.overlap.shapes
        assert_array_equal([a.position, b.position], [placed[key[:3]].position, placed[key[3:]].position])


def test_the_overlap_of_two_cubes_is_the_box_they_share(client):
    a = box(client, position=[0, 0, 0.95])
    b = box(client, position=[0.25, 0, 0])
    (contact,) = Bodies(client).overlaps()
    assert (contact.bodyA, contact.linkA, contact.shapeA) == (a, -1, 0)
    assert (contact.bodyB, contact.linkB, contact.shapeB) == (b, -1, 0)
    assert contact.overlap.status == "overlapping"
    assert contact.overlap.volume == pytest.approx(0.75 * 0.05, rel=1e-12)
    assert contact.overlap.depth == pytest.approx(0.05, rel=1e-12)
    assert_allclose(contact.overlap.normal, [0, 0, 1], atol=1e-12)


def test_shapes_that_only_touch_are_contacts_without_volume(client):
    box(client), box(client, position=[1, 0, 0])
    bodies = Bodies(client)
    (contact,) = bodies.overlaps()
    assert contact.overlap.status == "touching" and contact.overlap.volume == 0
    assert_allclose(contact.overlap.normal, [-1, 0, 0], atol=1e-12)
    assert bodies.report().pairs_overlapping == 0


def test_contacts_are_a_sequence_and_arrays_at_once(client):
    for x in range(4):
        box(client, position=[0.9 * x, 0, 0])
    contacts = Bodies(client).overlaps()
    assert len(contacts) == 3 and contacts and contacts != [] and contacts == list(contacts)
    assert contacts[0] is contacts[-3] is next(iter(contacts)) and contacts[2] in contacts
    with pytest.raises(IndexError):
        contacts[3]
    assert_array_equal(contacts.keys, [[k, -1, 0, k + 1, -1, 0] for k in range(3)])
    for row, contact in enumerate(contacts):
        assert contact.overlap.volume == contacts.overlaps.volume[row] == pytest.approx(0.1, rel=1e-12)
        assert_array_equal(contact.overlap.gradient, contacts.overlaps.gradient[row])
    for picked in (contacts[1:], contacts[[1, 2]], contacts[contacts.keys[:, 0] > 0]):
        assert [(c.bodyA, c.bodyB) for c in picked] == [(1, 2), (2, 3)] and len(picked.overlaps) == 2
    assert not contacts[:0] and contacts[:0] == []


def test_contacts_of_a_step_keep_what_they_say_when_the_simulation_goes_on(client):
    ball = body(client, p.GEOM_SPHERE, radius=0.5, position=[0, 0, 0.3])
    box(client, mass=0)
    bodies = Bodies(client)
    looked_at, kept = bodies.overlaps(0.01), bodies.overlaps(0.01)
    volume, corners = looked_at.overlaps.volume[0], looked_at[0].overlap.vertices
    p.resetBasePositionAndOrientation(ball, [0, 0, 0.5], [0, 0, 0, 1], physicsClientId=client)
    bodies.update()
    assert bodies.overlaps(0.01).overlaps.volume[0] < volume
    assert_array_equal(kept[0].overlap.vertices, corners)
    assert kept[0].overlap.volume == kept.overlaps.volume[0] == volume


def test_the_article_s_method_and_threads_are_asked_for_by_step(client):
    for x in range(3):
        box(client, position=[0.9 * x, 0.1 * x, 0])
    bodies = Bodies(client)
    by_article = bodies.overlaps(method="paper", threads=2)
    assert by_article.overlaps.method == by_article[0].overlap.method == "paper"
    assert bodies.overlaps(threads=2)[0].overlap.method == "auto"
    assert_allclose(by_article.overlaps.volume, bodies.overlaps().overlaps.volume, rtol=1e-9)


def test_normal_and_depth_are_those_of_get_contact_points(client):
    a = body(client, p.GEOM_SPHERE, radius=0.5, position=[0.2, 0.1, 0.6])
    b = box(client, position=[0, 0, -0.3], mass=0)
    p.performCollisionDetection(client)
    (point,) = p.getContactPoints(a, b, physicsClientId=client)
    (contact,) = Bodies(client).overlaps()
    assert_allclose(contact.overlap.normal, point[7], atol=1e-6)
    assert contact.overlap.depth == pytest.approx(-point[8], abs=1e-6)


def test_separated_shapes_whose_boxes_meet_make_no_contact(client):
    body(client, p.GEOM_SPHERE, radius=0.5)
    body(client, p.GEOM_SPHERE, radius=0.5, position=[0.8, 0.8, 0])
    bodies = Bodies(client)
    assert bodies.overlaps() == []
    assert bodies.report().pairs_examined == 1 and bodies.report().pairs_overlapping == 0


def test_shapes_of_one_body_are_not_paired(client):
    p.loadURDF("franka_panda/panda.urdf", physicsClientId=client)
    bodies = Bodies(client)
    assert bodies.overlaps() == []
    assert bodies.report().pairs_possible == bodies.report().pairs_examined == 0


def test_static_bodies_are_not_paired_until_one_is_released(client):
    box(client, mass=0), box(client, mass=0, position=[0.9, 0, 0])
    bodies = Bodies(client)
    assert bodies.overlaps() == []
    p.changeDynamics(1, -1, mass=1, physicsClientId=client)
    bodies.update()
    assert len(bodies.overlaps()) == 1


def test_a_body_that_has_become_static_is_noticed_when_it_rests(client):
    box(client, mass=0)
    moved = box(client, position=[0.8, 0, 0])
    bodies = Bodies(client)
    p.changeDynamics(moved, -1, mass=0, physicsClientId=client)
    p.resetBasePositionAndOrientation(moved, [0.9, 0, 0], [0, 0, 0, 1], physicsClientId=client)
    bodies.update()
    assert len(bodies.overlaps()) == 1
    bodies.update()
    assert bodies.overlaps() == []


def test_the_report_counts_what_was_looked_at(client):
    body(client, p.GEOM_PLANE, mass=0)
    for x in range(4):
        box(client, position=[0.95 * x, 0, 0.45])
    bodies = Bodies(client)
    bodies.overlaps()
    report = bodies.report()
    assert (report.bodies, report.shapes, report.shapes_read) == (5, 5, 5)
    assert report.pairs_possible == 10
    assert report.pairs_examined == report.pairs_overlapping == 4 + 3
    assert report.planes_asked >= report.facets_touched > 0
    bodies.overlaps()
    assert bodies.report().planes_asked == 0  # nothing has moved
    read, examined, overlapping = str(report).splitlines()
    assert read == "5 bodies, 5 of 5 shapes read"
    assert examined.startswith("7 of 10 pairs examined, ")
    assert overlapping == "7 overlap, none of them measured again in wider arithmetic"


def test_the_report_counts_overlaps_too_thin_for_doubles(client):
    for x in (0, 0.5, 1.5 - 1e-13):
        box(client, position=[x, 0, 0])
    bodies = Bodies(client)
    _, second = sorted(contact.overlap.volume for contact in bodies.overlaps())
    assert second == pytest.approx(0.5)
    assert bodies.report().pairs_widened == 1
    assert str(bodies.report()).splitlines()[2] == "2 overlap, 1 of them measured again in wider arithmetic"


# --- names and colours


def test_names_are_those_of_the_model_and_unique(client):
    for x in range(2):
        p.loadURDF("franka_panda/panda.urdf", [x, 0, 0], physicsClientId=client)
    p.loadURDF("r2d2.urdf", physicsClientId=client)
    box(client)
    names = Bodies(client).names
    assert names[0, -1] == "panda#0/panda_link0" and names[1, 8] == "panda#1/panda_hand"
    assert names[2, -1] == "physics/base_link"
    assert names[3, -1] == "box"
    assert len(set(names.values())) == len(names)


def test_colours_are_those_pybullet_shows(client):
    robot = p.loadURDF("kuka_iiwa/model.urdf", physicsClientId=client)
    red = p.createVisualShape(p.GEOM_SPHERE, radius=1, rgbaColor=[1, 0, 0, 0.5], physicsClientId=client)
    shape = p.createCollisionShape(p.GEOM_SPHERE, radius=1, physicsClientId=client)
    ball = p.createMultiBody(1, shape, red, physicsClientId=client)
    colors = Bodies(client).colors
    for visual in p.getVisualShapeData(robot, physicsClientId=client):
        assert colors[robot, visual[1]] == visual[7]
    assert colors[ball, -1] == (1, 0, 0, 0.5)


def test_bodies_without_a_visual_shape_have_colours_of_their_own(client):
    for _ in range(2):
        p.createMultiBody(1, -1, physicsClientId=client)
        assert p.getVisualShapeData(0, physicsClientId=client) == ()
    first, second = Bodies(client).colors.values()
    assert first != second
    assert all(len(color) == 4 and 0 <= min(color) <= max(color) <= 1 for color in (first, second))


def test_every_shape_has_a_colour_and_a_name(client, tmp_path):
    random_robot(client, 1, tmp_path)
    p.loadMJCF("mjcf/humanoid.xml", physicsClientId=client)
    bodies = Bodies(client)
    links = {key[:2] for key in bodies.keys}
    assert links <= bodies.colors.keys() and links <= bodies.names.keys()


# --- as tables


def a_cube_in_two_others(client):
    for position in ([0, 0, 0], [0, 0, 0.9], [0.5, 0, -0.5], [1, 0, 0]):
        box(client, position=position)
    return Bodies(client)


@pytest.mark.parametrize("by_links", [False, True])
def test_contacts_are_a_table_of_pandas_polars_and_arrow(client, by_links):
    found = a_cube_in_two_others(client).overlaps()
    rows = link_contacts(found) if by_links else found
    touching = [contact.overlap.status == "touching" for contact in found]
    assert any(touching) and not all(touching)
    frame, polar, arrow = rows.to_pandas(), rows.to_polars(), rows.to_arrow()
    assert [*frame.columns] == polar.columns == arrow.column_names
    left_out = {"step", "time_s", *(name for name in COLUMNS if name.startswith(("position", "orientation", "fcl")))}
    if by_links:
        left_out |= {"shapeA", "shapeB"}
    assert {*frame.columns} == {*COLUMNS} - left_out
    assert_array_equal(frame.volume_m3, [each.volume if by_links else each.overlap.volume for each in rows])
    assert [*frame.nameA] == [found.names[each.bodyA, each.linkA] for each in rows]
    assert [*frame.status] == ["touching" if each else "overlapping" for each in touching]
    assert [*frame.centroid_x_m.isna()] == touching
    assert polar["centroid_x_m"].is_null().to_list() == arrow["centroid_x_m"].is_null().to_pylist() == touching
    assert polar["bodyB"].to_list() == arrow["bodyB"].to_pylist() == [each.bodyB for each in rows]
    assert polar["depth_m"].to_list() == arrow["depth_m"].to_pylist() == [*frame.depth_m]
    empty = found[:0]
    assert [*(link_contacts(empty) if by_links else empty).to_pandas().columns] == [*frame.columns]


@pytest.mark.parametrize("library", ["pandas", "polars", "pyarrow"])
def test_a_table_names_the_library_that_it_needs(client, monkeypatch, library):
    contacts = a_cube_in_two_others(client).overlaps()
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(ImportError, match=f"^a table of {library} needs {library}: pip install {library}$"):
        getattr(contacts, "to_arrow" if library == "pyarrow" else f"to_{library}")()


def test_contacts_are_pickled_with_their_names(client):
    contacts = a_cube_in_two_others(client).overlaps()
    again = pickle.loads(pickle.dumps(contacts))
    assert again.names == contacts.names and again.to_pandas().equals(contacts.to_pandas())


def test_results_have_a_readable_repr(client):
    bodies = a_cube_in_two_others(client)
    assert repr(bodies) == "Bodies(4 bodies, 4 shapes)"
    assert re.fullmatch(r"Contacts\(\d+, \d of them overlapping\)", repr(bodies.overlaps()))
    p.resetBasePositionAndOrientation(0, [float("nan")] * 3, [0, 0, 0, 1], physicsClientId=client)
    with pytest.warns(SkippedShapeWarning):
        bodies.update()
    assert repr(bodies) == "Bodies(4 bodies, 3 shapes, 1 left out)"
