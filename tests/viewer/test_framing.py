"""Views have what moves and what overlaps in them, never a ground, and are from where the largest overlap is seen."""

from __future__ import annotations

import base64
import json

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pages import Film, Scene, coloured, drawings, looks, numbers, opened, panel, scene
from PIL import Image

from overlapper import Box, HalfSpace, Hull, Placed, Sphere
from overlapper.viewer import Recording, Viewer, picture
from overlapper.viewer.framing import BACK, Framing, View
from overlapper.viewer.look import Look

SLAB = Placed(Box([100, 100, 5]), (0, 0, -5))


def framing(*scenes):
    made = Framing(scenes[0])
    for each in scenes:
        made.see(each, each.contacts())
    return made


def box_around(view: View):
    corners = np.array(view.framed)
    return [corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)]


@pytest.mark.parametrize(
    "ground",
    [
        SLAB,
        Placed(HalfSpace([0, 0, 1], 0)),
        Placed(Hull(np.array([(x, y, z) for x in (-50, 50) for y in (-50, 50) for z in (-1, 0)]))),
        Placed(Sphere(6371.0), (0, 0, -6371.0)),
    ],
    ids=lambda placed: type(placed.shape).__name__,
)
def test_no_view_is_made_to_fit_a_ground(ground):
    made = framing(Scene({0: ground, 1: Placed(Box([0.1, 0.2, 0.3]), (1, 0, 0.29))}))
    for view in (made.opening(), made.whole()):
        assert_allclose(box_around(view), [(0.9, -0.2, -0.01), (1.1, 0.2, 0.59)], atol=1e-9)
    assert_allclose(made.size, np.linalg.norm([0.2, 0.4, 0.6]))
    assert made.is_ground(ground) and not made.is_ground(Placed(Box([1, 1, 1])))


def test_neither_a_robot_nor_a_table_is_ground_of_small_bodies():
    robot = {(0, link): Placed(Box([0.2, 0.2, 0.2]), (0, 0, 0.4 * link)) for link in range(-1, 3)}
    made = framing(Scene(robot | {1: Placed(Sphere(1e-4), (0, 0, 3)), 2: Placed(Box([1, 1, 0.1]), (0, 0, -1))}))
    assert_allclose(box_around(made.whole()), [(-1, -1, -1.1), (1, 1, 3.0001)])


def test_bodies_that_are_grounds_of_each_other_alone_are_seen_from_somewhere():
    made = framing(Scene({0: Placed(HalfSpace([0, 0, 1], 0))}))
    assert_allclose(box_around(made.whole()), [(-1, -1, -1), (1, 1, 1)])
    made = framing(Scene({0: SLAB, 1: SLAB, 2: Placed(Sphere(0.5), (0, 0, 0.4))}))
    assert made.main.volume < 1  # not what the two slabs share
    assert_allclose(box_around(made.opening()), [(-0.5, -0.5, -0.1), (0.5, 0.5, 0.9)])


def test_moving_and_overlapping_bodies_are_framed_and_the_whole_scene_excludes_grounds():
    def at(z):
        wall, cube = Placed(Box([0.1, 2, 2]), (-3, 0, 2)), Placed(Box([0.1, 0.1, 0.1]), (0, 0, z))
        return Scene({0: SLAB, 1: wall, 2: cube, 3: Placed(Box([1, 1, 0.1]), (0, 0, 0.1))})

    made = framing(at(0.5), at(0.29), at(0.31))
    assert made.moment == 1
    # The cube where it was first and at the largest overlap; of the table below it what is shared.
    assert_allclose(box_around(made.opening()), [(-0.1, -0.1, 0.19), (0.1, 0.1, 0.6)])
    assert_allclose(box_around(made.whole()), [(-3.1, -2, 0), (1, 2, 4)])
    # Where nothing moves, the bodies that share something.
    assert_allclose(box_around(framing(at(0.29)).moving()), [(-1, -1, 0), (1, 1, 0.39)])
    assert_allclose(box_around(framing(at(0.29)).opening()), [(-0.8, -0.8, 0), (0.8, 0.8, 0.39)])  # nearer
    # Where nothing is shared either, all.
    assert_allclose(box_around(framing(at(0.5)).opening()), [(-3.1, -2, 0), (1, 2, 4)])


def test_the_main_overlap_is_that_of_two_moving_bodies_and_both_are_large_in_the_opening_view():
    def at(grip, drop):
        """An arm of three links whose last holds a ball, which sinks into a still tray first."""
        arm = {(0, link): Placed(Box([0.5, 0.1, 0.1]), (link + grip, 0, 0)) for link in range(-1, 2)}
        ball, tray = Placed(Sphere(0.05), (1.545, 0, drop)), Placed(Box([2, 2, 0.1]), (1.5, 0, -0.2))
        return Scene(arm | {1: ball, 2: tray})

    made = framing(at(0, -0.05), at(-0.01, -0.1), at(0.001, 0), at(-0.001, 0))
    volumes = [sorted(each.overlap.volume for each in at(*pose).contacts()) for pose in ((-0.01, -0.1), (0.001, 0))]
    assert volumes[0][-1] > 10 * made.main.volume == 10 * volumes[1][-1] and made.moment == 2
    opening, moving = (box_around(view) for view in (made.opening(), made.moving()))
    assert np.linalg.norm(np.subtract(*moving)) > 3
    assert np.linalg.norm(np.subtract(*opening)) <= 8.001 * np.linalg.norm([0.1, 0.1, 0.1])
    assert (opening[0] < [1.5, -0.04, -0.04]).all() and (opening[1] > [1.59, 0.04, 0.04]).all()


def test_an_overlap_behind_a_wall_is_seen_from_the_other_side():
    pair = {0: Placed(Box([0.1, 0.1, 0.1])), 1: Placed(Box([0.1, 0.1, 0.1]), (0.1, 0.1, 0.1))}
    assert_allclose(framing(Scene(pair)).side(), BACK)
    wall = Placed(Box([3.5, 0.05, 3]), (0, -1, 0))
    assert framing(Scene(pair | {2: wall})).side()[1] > 0


def test_a_narrow_picture_is_taken_from_farther_off():
    view = View.of([np.array([(-1.0, -1, 0), (1, 1, 1)])])
    assert view.distance(0.5) > 1.5 * view.distance(4 / 3) > view.distance(2)


@pytest.fixture(scope="module")
def fall(tmp_path_factory):
    """A cube falls into a slab of 200 m, between still walls; deepest in the middle."""

    def at(z):
        wall = Placed(Box([0.1, 2, 1]), (-4, 0, 1))
        return Scene({0: SLAB, 1: Placed(Box([0.1, 0.1, 0.1]), (0, 0, z)), 2: wall})

    recording = Recording()
    for k, z in enumerate((0.3, 0.08, 0.09)):
        recording.add(at(z), at(z).contacts(), float(k))
    return recording.save(tmp_path_factory.mktemp("fall") / "fall.html")


TIME = "document.querySelector('#time output').textContent"


@looks
def test_a_page_opens_at_the_largest_overlap_and_the_whole_scene_is_a_key_away(browser, fall):
    browser.open(fall.as_uri(), until=f"{TIME} === '1.000 s'")
    panel(browser, None)
    browser.ask("document.querySelector('#legend').open = false")
    near = scene(browser)
    assert coloured(near, "green") > 10_000  # the cube, which would be less than a pixel on the slab
    assert coloured(near, "orange") > 200
    browser.press("w")
    whole = scene(browser)
    assert 20 < coloured(whole, "orange") < coloured(near, "orange") / 20
    assert coloured(whole, "green") > 2000  # the wall
    browser.press("Escape")
    assert_allclose(scene(browser), near, atol=8)


@looks
def test_a_ground_is_a_calm_plane_with_a_grid_whatever_its_body_looks_like(browser, fall):
    opened(browser, fall, "#t=0&from=0,-1,1&at=0,-9,0.2")  # nothing but the ground is in sight

    def lines(image):
        return int((np.abs(np.diff(image.sum(axis=2), axis=0)) > 20).sum())

    with_grid = scene(browser)
    assert coloured(with_grid, "green") == 0
    assert lines(with_grid) > 1000
    browser.press("E")
    without = scene(browser)
    assert lines(without) < lines(with_grid) / 10
    browser.press("F")
    assert scene(browser).mean() < without.mean() - 2
    browser.press("r")
    assert_allclose(scene(browser), with_grid, atol=8)


def test_the_plane_of_a_ground_faces_the_scene_fades_out_and_ends_with_the_ground(tmp_path):
    for name, ground, normal, offset, across in (
        ("plane", Placed(HalfSpace([0.6, 0, 0.8], 0.5)), (0.6, 0, 0.8), 0.5, 3),
        ("slab", Placed(Box([100, 1, 5]), (0, 0, -4.5)), (0, 0, 1), 5, 2),
    ):
        recording = Recording(bodies=Look(front="#ff0000"))
        scene = Scene({0: ground, 1: Placed(Box([0.5, 0.5, np.sqrt(0.5)]))})
        recording.add(scene, [], 0.0)
        page = recording.save(tmp_path / f"{name}.html")
        assert Film.of(page).heading["grounds"] == [0]
        drawing = drawings(page)["/overlapper/bodies/body0/base/0"]
        assert "ff0000" not in json.dumps([f"{each['color']:06x}" for each in drawing["materials"]])
        mesh, grid = (each["data"]["attributes"] for each in drawing["geometries"])
        for part in (mesh, grid):
            corners = numbers(part["position"]).astype(float)
            assert_allclose(corners @ normal, offset, atol=1e-5)
        corners = numbers(mesh["position"])
        assert_allclose(np.ptp(corners[:, 1]) / 2, across if name == "plane" else 1, atol=1e-5)
        strength = np.frombuffer(base64.b64decode(mesh["color"]["array"]), np.float32).reshape(-1, 4)
        assert mesh["color"]["itemSize"] == 4
        assert (strength[:, :3] == 1).all()
        assert strength[:, 3].max() > 0.99 and strength[:, 3].min() == 0


def test_a_ground_that_is_round_is_drawn_as_it_is(tmp_path):
    recording = Recording()
    recording.add(Scene({0: Placed(Sphere(500), (0, 0, -500)), 1: Placed(Sphere(0.5), (0, 0, 0.4))}), [], 0.0)
    assert Film.of(recording.save(tmp_path / "round.html")).heading["grounds"] == []


def seen(path, *scenes, **options):
    """How much of a picture of the last moment is green and orange."""
    made = framing(*scenes)
    picture.save(path, scenes[-1], scenes[-1].contacts(), framing=made, **options)
    image = np.asarray(Image.open(path).convert("RGB"), dtype=int)[150:]
    return coloured(image, "green"), coloured(image, "orange")


def test_a_picture_is_framed_as_a_page_is(tmp_path):
    def at(z):
        cube, wall = Placed(Box([0.1, 0.1, 0.1]), (0, 0, z)), Placed(Box([0.1, 2, 1]), (-4, 0, 1))
        return Scene({0: SLAB, 1: cube, 2: wall})

    green, orange = seen(tmp_path / "moves.png", at(0.3), at(0.08))
    assert green > 30_000 and orange > 1000
    # A single frame shows no motion, so the overlapping bodies are framed.
    assert seen(tmp_path / "still.png", at(0.08))[1] > orange


def test_a_wall_that_goes_on_behind_the_camera_is_pictured_where_rays_meet_it(tmp_path):
    cubes = {0: Placed(Box([0.1, 0.1, 0.1])), 1: Placed(Box([0.1, 0.1, 0.1]), (0.15, 0.15, 0.15))}
    wall, path = Placed(Box([0.01, 2, 0.5]), (-0.3, 0, 0)), tmp_path / "wall.png"

    def pictured(shapes):
        bodies = Scene(shapes)
        picture.save(
            path,
            bodies,
            bodies.contacts()[:1],
            close=True,
            looks=(Look(edges=False, opacity=0.5), Look(opacity=0, marks=False)),
        )
        return np.asarray(Image.open(path).convert("RGB"), dtype=int), framing(bodies).side()

    before, back = pictured(cubes)
    after, same = pictured(cubes | {2: wall})
    assert_allclose(same, back)
    at = np.full(3, 0.075)
    eye = at + picture.NEAR * np.linalg.norm([0.05] * 3) * back
    right = np.array([-back[1], back[0], 0.0]) / np.hypot(back[0], back[1])
    x, y = np.meshgrid((np.arange(10, 1200, 20) + 0.5 - 600) / 450, (450 - np.arange(10, 900, 20) - 0.5) / 450)
    slope = np.tan(np.deg2rad(35) / 2)
    rays = slope * (x[..., None] * right + y[..., None] * np.cross(back, right)) - back
    walls = np.sort([(bound - eye) / rays for bound in wall.bounds], axis=0)
    hit = (walls[0].max(axis=-1) < walls[1].min(axis=-1)) & (walls[1].min(axis=-1) > 0)
    changed = (np.abs(after - before).max(axis=2) > 8)[10::20, 10::20]
    assert 0.1 < hit.mean() < 0.9
    assert (hit[10:] == changed[10:]).mean() > 0.98  # the table is above


def test_a_live_view_is_not_made_to_fit_a_ground_either():
    with Viewer() as viewer:
        bodies = Scene({0: SLAB, 1: Placed(Box([0.1, 0.1, 0.1]), (0, 0, 0.3))})
        viewer.show(bodies, bodies.contacts())
        assert viewer._stage.size == pytest.approx(np.linalg.norm([0.2] * 3))
        assert "/overlapper/bodies/body0/base/0" in viewer._shapes
