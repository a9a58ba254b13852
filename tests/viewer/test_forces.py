"""Forces are seen: an arrow for each pair of links, pressures as colours, and numbers beside those of overlaps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pybullet
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pages import Film, looks, opened, panel, scene
from PIL import Image

from overlapper import Box, HalfSpace, Placed, overlap
from overlapper.scenes.run import run
from overlapper.scenes.scene import load_scene
from overlapper.simulation import Bodies, Recorder, VolumetricContact
from overlapper.tables.outputs import recorder
from overlapper.viewer import Recording, picture
from overlapper.viewer.look import BODIES, OVERLAPS
from overlapper.viewer.pressure import Press, Scale, colors, deepest, depths, force_text, presses, pressures, usual

STIFFNESS = 1e6


@pytest.fixture(scope="module")
def client():
    client = pybullet.connect(pybullet.DIRECT)
    yield client
    pybullet.disconnect(client)


def pressed_cube(client, depth=1e-3, tilt=0.0, parts=1):
    """A cube of 10 cm, made of some parts, stands in a plane, leaning by an angle; the bodies and what pushes them."""
    pybullet.resetSimulation(physicsClientId=client)
    plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    pybullet.createMultiBody(0, plane, physicsClientId=client)
    height = 0.05 * (np.cos(tilt) + np.sin(abs(tilt))) - depth
    lean = pybullet.getQuaternionFromEuler([0, tilt, 0])
    sides = {"halfExtents": [[0.05, 0.05 / parts, 0.05]] * parts}
    places = [[0, 0.05 * (2 * k + 1 - parts) / parts, 0] for k in range(parts)]
    with Recorder(client) as recorder:
        shape = pybullet.createCollisionShapeArray(
            [pybullet.GEOM_BOX] * parts, **sides, collisionFramePositions=places, physicsClientId=client
        )
        pybullet.createMultiBody(1, shape, basePosition=[0, 0, height], baseOrientation=lean, physicsClientId=client)
        bodies = Bodies(client, recorder=recorder, names={0: "ground", 1: "cube"})
        return bodies, VolumetricContact(bodies, stiffness=STIFFNESS).forces()


def record(path, bodies, *forces):
    recording = Recording()
    for time, each in enumerate(forces):
        recording.add(bodies, each.contacts, time, forces=each)
    return recording.save(path)


@pytest.fixture(scope="module")
def cube_page(client, tmp_path_factory):
    bodies, forces = pressed_cube(client, tilt=0.02)
    return record(tmp_path_factory.mktemp("cube") / "cube.html", bodies, forces)


def test_the_depth_under_a_leaning_cube_rises_from_nothing_to_where_it_is_deepest():
    lean = Placed(Box([0.05] * 3), (0, 0, 0.05), (0, np.sin(0.01), 0, np.cos(0.01)))
    found = overlap(Placed(HalfSpace([0, 0, 1], 0.0)), lean)
    low = found.vertices[:, 2].min()
    assert_allclose(deepest(found, np.array([0, 0, -1.0])), -low, rtol=1e-12)
    corners = depths(found, np.array([0, 0, -1.0]), found.vertices)
    # The side of the cube leans inward from its lowest edge: there it is as deep as it is anywhere.
    assert_allclose(sorted({round(each, 9) for each in corners})[0], 0, atol=1e-9)
    assert corners.max() == pytest.approx(-low, rel=1e-9)


def test_where_two_edges_cross_it_is_deepest_in_the_middle():
    roof = (0, np.sin(np.pi / 8), 0, np.cos(np.pi / 8))
    gutter = (np.sin(np.pi / 8), 0, 0, np.cos(np.pi / 8))
    reach = 0.1 * np.sqrt(2)
    found = overlap(Placed(Box([0.1] * 3), (0, 0, -reach + 0.01), roof), Placed(Box([0.1] * 3), (0, 0, reach), gutter))
    assert deepest(found, np.array([0, 0, 1.0])) == pytest.approx(0.01)


def test_triangles_of_pressures_cover_the_surface_and_are_small_where_pressures_change():
    lean = Placed(Box([0.05] * 3), (0, 0, 0.05), (0, np.sin(0.01), 0, np.cos(0.01)))
    found = overlap(Placed(HalfSpace([0, 0, 1], 0.0)), lean)
    press = Press(np.array([0, 0, -1.0]), 0.0, 0.0, 0.0, np.array([0, 0, -1.0]), STIFFNESS)
    top = STIFFNESS * deepest(found, press.normal)
    corners, pressure = pressures(found, press, top)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    assert areas.sum() == pytest.approx(found.area)
    # The force on the plane is the integral of pressure over the patch.
    flat = np.abs(corners[..., 2]).max(axis=1) < 1e-12
    assert np.ptp(pressure[flat], axis=1).max() <= top / 8
    assert (areas[flat] * pressure[flat].mean(axis=1)).sum() == pytest.approx(STIFFNESS * found.volume, rel=0.01)


def test_colours_grow_lighter_from_no_pressure_to_the_highest_and_stay_so():
    found = colors(np.array([0.0, 1.0, 2.0, 5.0, 10.0, 20.0]), 10.0)
    assert (np.diff(found[:5] @ [0.2126, 0.7152, 0.0722]) > 0).all()
    assert_allclose(found[4], found[5])


@pytest.mark.parametrize(
    ("scale", "told", "top"),
    [
        (Scale.of(9.81, 1234.0, 0.05), "1 cm = 2 N", "1.5 kPa"),
        (Scale.of(2100.0, 3.1e6, 0.5), "10 cm = 500 N", "4 MPa"),
        (Scale.of(0.0, 0.0, 1.5), "1 m = 1 N", "1 Pa"),
        (Scale.of(21.0, 7e4, 0.04), "1 cm = 6 N", "80 kPa"),
        (Scale.of(3e-4, 7.0, 2e-3), "1 mm = 200 µN", "8 Pa"),
    ],
)
def test_a_scale_has_round_numbers(scale, told, top):
    assert (str(scale), scale.pressure) == (told, top)


def test_forces_are_shown_in_a_suitable_unit():
    assert [force_text(each) for each in (9.81, 0.0123, 4567.0)] == ["9.81 N", "12.3 mN", "4.57 kN"]


def test_friction_is_the_force_component_perpendicular_to_the_pressures():
    press = Press(np.array([1.0, 2.0, 3.0]), 0.0, 0.0, 0.0, np.array([0.0, 0.0, 1.0]), 1.0)
    assert_allclose(press.friction, [1, 2, 0])
    assert presses(None) == {}


def told(browser, name):
    """The texts beside a name in the numbers of the chosen pair."""
    rows = browser.ask("[...document.querySelectorAll('#numbers tr')].map(row => [...row.cells].map(c => c.innerText))")
    return dict(rows)[name]


def yellow(image):
    """How many pixels have the colours of high pressures."""
    red, green, blue = np.moveaxis(image, -1, 0)
    return int(((red > 200) & (green > 190) & (blue < 110)).sum())


def white(image):
    return int((image > 250).all(axis=-1).sum())


def test_a_recording_has_force_torque_energy_slip_direction_and_stiffness_of_each_pair(client, tmp_path):
    bodies, forces = pressed_cube(client)
    film = Film.of(record(tmp_path / "cube.html", bodies, forces))
    found = film.arrays["presses"].reshape(11, -1).T
    assert_allclose(found[0, :3], forces.force[0], rtol=1e-5, atol=1e-7)
    assert_allclose(found[0, 3:6], [0, forces.energy[0], np.linalg.norm(forces.slip[0])], rtol=1e-4, atol=1e-9)
    assert_allclose(found[0, 6:], [0, 0, -1, STIFFNESS, 0], atol=1e-6)
    assert_allclose(forces.energy[0], STIFFNESS * 0.01 * 1e-3**2 / 2)
    planes = film.arrays["planes"].reshape(4, -1).T
    ((vertices, facets),) = film.polytopes()
    *middle, unit = film.arrays["polytope_frame"]
    for (_, ring), plane in zip(facets, planes, strict=True):
        assert_allclose((vertices[ring] - middle) @ plane[:3] + unit * plane[3], 0, atol=1e-5)  # a hundredth of 1 mm


def test_a_recording_without_forces_says_nothing_of_them(client, tmp_path):
    bodies, forces = pressed_cube(client)
    recording = Recording()
    recording.add(bodies, forces.contacts, 0)
    film = Film.of(recording.save(tmp_path / "cube.html"))
    assert film.heading["forces"] is None
    assert len(film.arrays["presses"]) == len(film.arrays["planes"]) == 0


def test_scales_follow_usual_forces_and_not_one_impact(client, tmp_path):
    rest, impact = pressed_cube(client), pressed_cube(client, depth=0.02)
    recording = Recording()
    for time, (bodies, forces) in enumerate([rest, rest, impact, rest]):
        recording.add(bodies, forces.contacts, time, forces=forces)
    heading = Film.of(recording.save(tmp_path / "cube.html")).heading["forces"]
    assert heading["top"] == 1000
    assert heading["usual"] == pytest.approx(np.linalg.norm(rest[1].force), rel=1e-6)


@looks
def test_pressures_are_coloured_and_an_arrow_is_seen_until_forces_are_switched_off(browser, cube_page):
    seen = scene(opened(browser, cube_page, "#t=0"))
    assert white(seen) > 100 and yellow(seen) > 100
    assert browser.ask("document.querySelector('#top').innerText") == "1 kPa"
    browser.press("a")
    assert browser.ask("document.querySelector('#scale').hidden")
    hidden = scene(browser)
    assert white(hidden) == 0 and yellow(hidden) == 0
    panel(browser, "look")
    browser.click_on("#overlaps-forces")
    panel(browser, None)
    assert white(scene(browser)) == white(seen)


@looks
def test_arrows_have_a_scale_for_how_near_the_camera_is(browser, cube_page):
    opened(browser, cube_page, "#t=0")
    far = browser.ask("document.querySelector('#arrow-scale').innerText")
    browser.ask("location.hash = '#t=0&from=0.1,-0.1,0.05&at=0,0,0'")
    browser.wait(f"document.querySelector('#arrow-scale').innerText !== {far!r}")
    assert far.startswith("1 cm = ")


@looks
def test_numbers_list_and_chart_have_forces(browser, client, tmp_path):
    bodies, forces = pressed_cube(client, parts=2)
    total, each = np.linalg.norm(forces.force.sum(axis=0)), np.linalg.norm(forces.force, axis=1)
    page = record(tmp_path / "parts.html", bodies, forces, forces)
    panel(opened(browser, page, "#t=0&pair=ground,cube.0"), "overlaps")
    value, unit = told(browser, "force").split()
    assert (float(value), unit) == (pytest.approx(each[0], rel=2e-4), "N")
    assert told(browser, "energy") == "2.5 mJ"
    assert told(browser, "slip") == "sticks"
    rows = browser.ask("[...document.querySelectorAll('#list tbody tr')].map(row => row.cells[3].innerText)")
    assert rows == [f"{total:.3g} N", *[f"{one:.3g} N" for one in each]]
    browser.ask("location.hash = '#t=0&force=1000'")
    browser.wait("document.querySelectorAll('#list tbody tr').length === 0")
    browser.ask("location.hash = '#t=0'")
    browser.click_on("#of-force")
    browser.click_on("#in-total")
    browser.settle()
    assert (
        browser.ask("document.querySelector('#chart').ariaLabel")
        == f"force, the strongest, N, over time: up to {each.max():.3g}"
    )


FALL = '''
"""A cube stands on a plane."""
import pybullet as p

STEPS = 3


def build(client):
    p.setGravity(0, 0, -9.81, physicsClientId=client)
    plane, cube = p.GEOM_PLANE, p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.05] * 3, physicsClientId=client)
    p.createMultiBody(0, p.createCollisionShape(plane, physicsClientId=client), physicsClientId=client)
    p.createMultiBody(1, cube, basePosition=[0, 0, 0.0499], physicsClientId=client)
'''


def test_a_run_with_volumetric_contact_is_recorded_with_its_forces(tmp_path):
    (tmp_path / "fall.py").write_text(FALL)
    written = []
    with recorder(tmp_path / "fall.html", written) as record:
        for frame in run(load_scene(str(tmp_path / "fall.py")), contact="volumetric"):
            record(frame)
    (page,) = written
    film = Film.of(page)
    assert film.heading["forces"]["on_second"] == [True]
    assert film.arrays["presses"].reshape(11, -1)[2].max() < -1  # the first is the plane


def picture_of(client, path, look=OVERLAPS, forces=True):
    bodies, found = pressed_cube(client, tilt=0.02)
    picture.save(path, bodies, found.contacts, looks=(BODIES, look), forces=found if forces else None)
    return np.asarray(Image.open(path).convert("RGB"), dtype=int)


def test_a_picture_has_pressures_an_arrow_and_their_scale_and_none_of_them_if_not_asked_to(client, tmp_path):
    seen = picture_of(client, tmp_path / "forces.png")
    stage, legend, table = seen[200:780], seen[800:, 850:], seen[:60]
    assert yellow(stage) > 100 and white(stage) > 300 and yellow(legend) > 50
    without = picture_of(client, tmp_path / "none.png", replace(OVERLAPS, forces=False))
    assert yellow(without) == white(without[200:]) == 0
    assert_array_equal(without, picture_of(client, tmp_path / "plain.png", forces=False))
    # The row has one number more.
    assert (table > 128).all(axis=-1).sum() > (without[:60] > 128).all(axis=-1).sum()


def test_the_usual_force_ignores_a_few_outliers():
    assert usual([], []) == usual([3.0], [0.0]) == 0
    assert usual([5.0, 1.0, 100.0], [4.0, 4.0, 1.0]) == 5
    assert usual([1.0, 2.0], [1.0, 1.0]) == 2
