"""What the recording holds is read back from its file; what it looks like is seen through headless Chromium."""

from __future__ import annotations

import base64
import errno
import gzip
import json
import os
import re
import subprocess
import sys
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import umsgpack
from browser import CHROMIUM, Browser
from numpy.testing import assert_allclose

from overlapper import Box, Capsule, Cylinder, HalfSpace, Hull, Placed, Sphere, overlap
from overlapper.simulation.contacts import Contact
from overlapper.viewer import Recording, Viewer
from overlapper.viewer.look import Look

looks = pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not to be had here, and the picture is taken with it")

GROUND, CUP, HAND = (0, -1, 0), (1, -1, 0), (2, 3, 0)
GREEN = (0.1, 0.8, 0.1, 1.0)


class Bodies:
    """Shapes in the world by (body, link, shape), all green."""

    def __init__(self, shapes: dict[tuple[int, int, int], Placed]) -> None:
        self.keys = sorted(shapes)
        self.placed = [shapes[key] for key in self.keys]
        self.names = {(0, -1): "ground/base", (1, -1): "cup/base", (2, 3): "arm/hand", (2, 4): "arm/finger"}
        self.colors = dict.fromkeys(self.names, GREEN)

    def contacts(self) -> list[Contact]:
        pairs = [(i, j) for i in range(len(self.keys)) for j in range(i) if self.keys[i][0] != self.keys[j][0]]
        return [Contact(*self.keys[j], *self.keys[i], overlap(self.placed[j], self.placed[i])) for i, j in pairs]


def hand_at(x: float) -> Bodies:
    """A hand that is a box of 20 cm and reaches into a cup that is another when x < 0.2."""
    return Bodies({CUP: Placed(Box([0.1, 0.1, 0.1])), HAND: Placed(Box([0.1, 0.1, 0.1]), (x, 0.06, 0.08))})


def recorded(frames: list[Bodies], path: Path) -> Path:
    recording = Recording()
    for i, bodies in enumerate(frames):
        recording.add(bodies, bodies.contacts(), time=2.0 + i)
    return recording.save(path)


def unpacked(page: Path, name: str) -> bytes:
    text = re.search(f'id="{name}">([^<]*)<', page.read_text(encoding="utf-8"))[1]
    return gzip.decompress(base64.b64decode(text))


def commands(page: Path) -> list[dict]:
    return json.loads(unpacked(page, "commands"))


def drawings(page: Path) -> dict[str, dict]:
    """What is drawn at each path of the tree, in three.js's object format."""
    return {each["path"]: each["object"] for each in commands(page) if each["type"] == "set_object"}


@dataclass
class Film:
    """The frames of a page, put together from its arrays."""

    heading: dict
    arrays: dict[str, np.ndarray]

    @classmethod
    def of(cls, page: Path) -> Film:
        data = unpacked(page, "film")
        length = int.from_bytes(data[:4], "little")
        heading, data = json.loads(data[4 : 4 + length]), data[4 + length :]
        arrays = {}
        for name, (kind, count) in heading["arrays"].items():
            dtype = np.dtype(kind.removesuffix("Array").lower())
            planes, data = data[: count * dtype.itemsize], data[count * dtype.itemsize :]
            shuffled = np.frombuffer(planes, np.uint8).reshape(dtype.itemsize, count)
            arrays[name] = np.ascontiguousarray(shuffled.T).view(dtype).ravel()
        return cls(heading, arrays)

    def poses(self, node: str) -> list[tuple[int, np.ndarray]]:
        """(frame, pose) wherever that of the node changes, about the scene's centre; zeros where it is not there."""
        number = self.heading["nodes"].index(node)
        poses = self.arrays["key_pose"].reshape(7, -1).T
        chosen = self.arrays["key_node"] == number
        return list(zip(self.arrays["key_frame"][chosen].tolist(), poses[chosen]))

    def sightings(self, frame: int) -> dict[tuple[str, str], tuple[int, np.ndarray]]:
        """The polytope, and volume, error, depth, area, centroid about the scene's centre, normal, by pair."""
        start = self.arrays["sighting_start"]
        numbers = self.arrays["numbers"].reshape(10, -1).T
        return {
            tuple(self.heading["pairs"][self.arrays["sighting_pair"][k]]): (
                int(self.arrays["sighting_polytope"][k]),
                numbers[k],
            )
            for k in range(start[frame], start[frame + 1])
        }

    def polytopes(self) -> list[tuple[np.ndarray, list[tuple[int, np.ndarray]]]]:
        """The vertices of each about the scene's centre, and its facets: owner and ring."""
        corners = np.split(self.arrays["vertices"].reshape(-1, 3), np.cumsum(self.arrays["polytope_vertices"])[:-1])
        rings = np.split(self.arrays["rings"], np.cumsum(self.arrays["ring_length"])[:-1])
        facets = list(zip(self.arrays["owners"].tolist(), rings))
        made, grids = [], []
        for k, (*middle, unit) in enumerate(self.arrays["polytope_frame"].reshape(4, -1).T):
            like = self.arrays["polytope_previous"][k]
            grids.append(corners[k] + (grids[like] if like >= 0 else 0))
            count = self.arrays["polytope_facets"][k]
            made.append((middle + unit / 32767 * grids[-1], facets[:count]))
            facets = facets[count:]
        return made


def enclosed_by_rings(vertices: np.ndarray, facets: list[tuple[int, np.ndarray]]) -> float:
    """Volume inside of facets that are counter-clockwise from outside."""
    fans = [vertices[[ring[0], ring[i], ring[i + 1]]] for _, ring in facets for i in range(1, len(ring) - 1)]
    return np.linalg.det(np.array(fans)).sum() / 6


def numbers(attribute: dict) -> np.ndarray:
    kind = {"Float32Array": np.float32, "Uint32Array": np.uint32}[attribute["type"]]
    return np.frombuffer(base64.b64decode(attribute["array"]), kind).reshape(-1, 3)


def meshes(drawing: dict) -> list[tuple[np.ndarray, np.ndarray, int]]:
    """Vertices, triangles and colour of what is lit in a drawing, as the bodies and overlaps are."""
    geometries = {each["uuid"]: each["data"] for each in drawing["geometries"]}
    materials = {each["uuid"]: each for each in drawing["materials"]}
    found, seen = [drawing["object"]], []
    while found:
        each = found.pop(0)
        found += each.get("children", [])
        if each["type"] == "Mesh" and materials[each["material"]]["type"] == "MeshPhongMaterial":
            data = geometries[each["geometry"]]
            corners = numbers(data["attributes"]["position"]).astype(float)
            seen.append((corners, numbers(data["index"]), materials[each["material"]]["color"]))
    return seen


def enclosed(surfaces: list[tuple[np.ndarray, np.ndarray, int]]) -> float:
    """Volume inside of triangles that are counter-clockwise from outside."""
    return sum(np.linalg.det(vertices[faces]).sum() / 6 for vertices, faces, _ in surfaces)


def coloured(image: np.ndarray, name: str) -> int:
    """How many pixels have a colour, in light or shade: the owners' orange and sky blue, the marks' pink, green."""
    red, green, blue = np.moveaxis(image, -1, 0)
    return int(
        {
            "orange": (red > 130) & (red > 1.3 * green) & (green > 3 * blue),
            "sky blue": (blue > 130) & (blue > 1.15 * green) & (green > 1.5 * red),
            "pink": (red > 200) & (red > 2 * green) & (blue > 1.5 * green),
            "green": (green > red + 20) & (green > blue + 20),
        }[name].sum()
    )


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    browser = Browser(tmp_path_factory.mktemp("profile"))
    yield browser
    browser.close()


@pytest.fixture(scope="module")
def reach(tmp_path_factory):
    """A recording of two frames, apart and overlapping."""
    return recorded([hand_at(0.3), hand_at(0.12)], tmp_path_factory.mktemp("reach") / "hand.html")


def opened(browser: Browser, page: Path, view: str = "#t=1") -> Browser:
    """The page with a frame shown as it was first, its panel folded away."""
    if browser.ask("location.href").partition("#")[0] == page.as_uri():
        browser.press("r")
        browser.ask("location.hash = '#'")
    else:
        browser.open(page.as_uri(), until="document.querySelector('#time output').textContent.endsWith(' s')")
        browser.ask("document.querySelector('#look').open = false")
    browser.ask(f"location.hash = {view!r}")
    time = float(re.search(r"t=([\d.]+)", view)[1])
    browser.wait(f"document.querySelector('#time output').textContent === '{time:.3f} s'")
    return browser


def scene(browser: Browser) -> np.ndarray:
    """What is seen below the panels and above the bar with the time."""
    return browser.picture()[130:680]


@looks
def test_an_overlap_is_seen_opaque_in_the_colours_of_both_owners(browser, reach):
    image = scene(opened(browser, reach))
    for colour in ("orange", "sky blue"):
        assert coloured(image, colour) > 500
    assert coloured(image, "pink") > 20
    assert coloured(image, "green") > 10_000


@looks
def test_only_the_bodies_are_seen_before_they_overlap(browser, reach):
    image = scene(opened(browser, reach, "#t=0"))
    assert [coloured(image, colour) for colour in ("orange", "sky blue", "pink")] == [0, 0, 0]
    assert coloured(image, "green") > 10_000


@looks
def test_an_overlap_of_a_millimetre_in_a_scene_of_metres_is_found_and_clicked_upon(browser, tmp_path):
    corner = Placed(Box([0.5, 0.5, 0.5]), (0.999, 0.999, 0.999))
    page = recorded([Bodies({CUP: Placed(Box([0.5, 0.5, 0.5])), HAND: corner})], tmp_path / "corner.html")
    image = scene(opened(browser, page, "#t=0"))
    assert 20 < coloured(image, "pink") < 1000
    red, green, blue = np.moveaxis(image, -1, 0)
    rows, columns = np.nonzero((red > 200) & (red > 2 * green) & (blue > 1.5 * green))
    # The arrow points to the left and down, away from the corner.
    browser.click(columns.max() - 2, 130 + rows.min() + 2)
    assert "1 ± " in browser.ask("document.querySelector('#numbers').innerText")


@looks
def test_a_link_opens_the_page_with_the_camera_where_it_says(browser, reach):
    for height, seen, hidden in ((0.5, "orange", "sky blue"), (-0.5, "sky blue", "orange")):
        # From above upon the top of the cup, from below upon the bottom of the hand.
        image = scene(opened(browser, reach, f"#t=1&from=0.06,0.029,{height}&at=0.06,0.03,0.04"))
        assert coloured(image, seen) > 2000
        assert coloured(image, hidden) == 0


@looks
def test_a_click_on_an_overlap_shows_its_numbers_and_one_beside_it_hides_them(browser, reach):
    opened(browser, reach)
    rows, columns = np.nonzero(
        (lambda red, green, blue: (red > 130) & (red > 1.3 * green) & (green > 3 * blue))(
            *np.moveaxis(scene(browser), -1, 0)
        )
    )
    middle = len(rows) // 2
    browser.click(columns[middle], 130 + rows[middle])
    browser.wait("!document.querySelector('#numbers').hidden")
    text = browser.ask("document.querySelector('#numbers').innerText")
    assert "cup – arm.hand" in text
    # 8 x 14 x 12 cm about (0.06, 0.03, 0.04): pushed back by 8 cm, they are apart.
    assert re.search(r"volume\s1\.344 ± \S+ dm³", text)
    assert re.search(r"depth\s80 mm", text)
    assert re.search(r"surface\s752 cm²", text)
    assert "(0.0600, 0.0300, 0.0400) m" in text
    assert "(-1.0000, 0.0000, 0.0000)" in text
    browser.click(20, 660)
    browser.wait("document.querySelector('#numbers').hidden")


@looks
def test_a_row_comes_near_and_its_pair_stands_out_in_the_chart_until_escape(browser, reach):
    opened(browser, reach)
    far = scene(browser)
    plain = coloured(browser.picture()[700:], "pink")
    browser.click_on("#overlaps tbody tr")
    near, bar = scene(browser), browser.picture()[700:]
    assert coloured(near, "orange") > 1.1 * coloured(far, "orange")
    assert plain == 0
    assert coloured(bar, "pink") > 100
    assert "1.344" in browser.ask("document.querySelector('#numbers').innerText")
    browser.press("Escape")
    assert_allclose(scene(browser), far, atol=8)


@looks
def test_keys_and_controls_choose_what_is_drawn(browser, reach):
    opened(browser, reach)

    def seen(*keys: str) -> dict[str, int]:
        for key in keys:
            browser.press(key)
        image = scene(browser)
        # Lines and points of overlaps are nearly white.
        white = int((image.min(axis=-1) > 200).sum())
        return {name: coloured(image, name) for name in ("orange", "sky blue", "pink", "green")} | {"white": white}

    whole = seen()
    assert seen("m")["pink"] == 0
    edges = seen("f", "e")
    assert edges["orange"] == edges["sky blue"] == 0
    vertices = seen("e", "v")
    assert 8 * 4 <= vertices["white"] <= 8 * 25 < edges["white"]
    assert seen("r") == whole
    wires = seen("F")["green"]
    assert 500 < wires < whole["green"] / 5
    dots = seen("E", "V")["green"]
    assert 16 * 4 <= dots <= 16 * 25 < wires
    browser.press("r")
    browser.ask(
        "for (const [id, value] of Object.entries({'overlaps-front': '#ff0000', 'overlaps-opacity': 0.5,"
        "'overlaps-back': '#0000ff', 'bodies-opacity': 0})) {"
        "const control = document.getElementById(id); control.value = value; control.oninput(); }"
    )
    image = scene(browser)
    red, green, blue = np.moveaxis(image, -1, 0)
    assert coloured(image, "orange") == coloured(image, "sky blue") == 0
    assert ((red > green + 60) & (blue > green + 60)).sum() > 500  # the blue inside through the red outside
    assert seen("r") == whole


@looks
def test_the_arrow_keys_and_the_chart_go_through_time(browser, reach):
    def time() -> str:
        return browser.ask("document.querySelector('#time output').textContent")

    opened(browser, reach)
    browser.press("ArrowLeft")
    assert time() == "0.000 s"
    assert "0 overlaps" in browser.ask("document.querySelector('#overlaps').innerText")
    browser.press("ArrowRight")
    assert time() == "1.000 s"
    box = browser.ask("JSON.parse(JSON.stringify(document.querySelector('#chart').getBoundingClientRect()))")
    browser.click(box["x"] + 20, box["y"] + 5)
    assert time() == "0.000 s"
    browser.press(" ")
    browser.wait("document.querySelector('#time output').textContent === '1.000 s'")


@looks
def test_a_live_view_looks_like_a_recording(browser, reach, tmp_path):
    recording = scene(opened(browser, reach))
    with Viewer() as viewer:
        for bodies in (hand_at(0.3), hand_at(0.12)):
            viewer.show(bodies, bodies.contacts())
        page = tmp_path / "live.html"
        page.write_text(viewer.visualizer.static_html(), encoding="utf-8")
    browser.open(page.as_uri(), until="document.querySelector('canvas')")
    while coloured(live := browser.picture()[:680], "orange") == 0:
        pass
    for colour in ("orange", "sky blue", "green"):
        # The live view has the whole height, of which the recording leaves 680 pixels of 800.
        assert_allclose(coloured(live, colour) * (680 / 800) ** 2, coloured(recording, colour), rtol=0.25)


@looks
def test_a_recording_begins_with_the_look_it_was_made_with(browser, tmp_path):
    recording = Recording(bodies=Look(faces=False), overlaps=Look(front="#ff0000", marks=False))
    recording.add(hand_at(0.12), hand_at(0.12).contacts(), time=0.0)
    image = scene(opened(browser, recording.save(tmp_path / "hand.html"), "#t=0"))
    assert coloured(image, "sky blue") == coloured(image, "pink") == 0
    red, green, blue = np.moveaxis(image, -1, 0)
    assert ((red > 100) & (green < 20) & (blue < 20)).sum() > 1000
    assert 500 < coloured(image, "green") < 10_000


def test_the_page_needs_nothing_from_outside(tmp_path):
    links = []

    class Links(HTMLParser):
        def handle_starttag(self, tag, attributes):
            links.extend(value for name, value in attributes if name in ("src", "href", "srcset", "data", "action"))

    text = recorded([hand_at(0.12)], tmp_path / "hand.html").read_text(encoding="utf-8")
    Links().feed(text)
    assert links == []
    style = text.partition("<style>")[2].partition("</style>")[0]
    assert "#overlaps" in style
    assert "url(" not in style
    assert "@import" not in style


def test_the_tree_names_bodies_by_body_link_and_shape(tmp_path):
    page = recorded([hand_at(0.19), hand_at(0.12), hand_at(0.3)], tmp_path / "hand.html")
    assert set(drawings(page)) == {"/overlapper/bodies/cup/base/0", "/overlapper/bodies/arm/hand/0"}


def test_the_numbers_are_those_of_each_frame(tmp_path):
    film = Film.of(recorded([hand_at(0.3), hand_at(0.12)], tmp_path / "hand.html"))
    assert film.heading["times"] == [0, 1]
    assert film.sightings(0) == {}
    ((polytope, (volume, error, depth, area, *rest)),) = film.sightings(1).values()
    assert list(film.sightings(1)) == [("cup", "arm.hand")]
    assert polytope == 0
    assert_allclose([volume, depth, area], [0.08 * 0.14 * 0.12, 0.08, 0.0752], rtol=1e-5)
    assert 0 < error < 1e-15
    assert_allclose(rest[:3] + np.array(film.heading["center"]), [0.06, 0.03, 0.04], atol=1e-5)
    assert_allclose(rest[3:], [-1, 0, 0], atol=1e-6)


def test_bodies_are_sent_once_and_have_poses_only_where_they_move(tmp_path):
    page = recorded([hand_at(x) for x in (0.3, 0.3, 0.12, 0.12)], tmp_path / "hand.html")
    sent = [each["path"] for each in commands(page) if each["type"] == "set_object"]
    assert sent.count("/overlapper/bodies/arm/hand/0") == sent.count("/overlapper/bodies/cup/base/0") == 1
    film = Film.of(page)
    frames = {node: [frame for frame, _ in film.poses(node)] for node in film.heading["nodes"]}
    assert frames == {"/overlapper/bodies/arm/hand/0": [0, 2], "/overlapper/bodies/cup/base/0": [0]}


def test_a_shape_that_many_bodies_have_is_kept_once(tmp_path):
    page = recorded([Bodies({CUP: Placed(Sphere(0.1)), HAND: Placed(Sphere(0.1), (1, 0, 0))})], tmp_path / "two.html")
    first, second = (drawing["geometries"] for drawing in drawings(page).values())
    assert [each["uuid"] for each in first] == [each["uuid"] for each in second]
    assert all("data" in each for each in first)
    assert not any("data" in each for each in second)


def test_one_polytope_stands_for_an_overlap_at_rest(tmp_path):
    positions = (0.3, 0.12, 0.12, 0.12 + 1e-5, 0.15, 0.3, 0.15)
    film = Film.of(recorded([hand_at(x) for x in positions], tmp_path / "hand.html"))
    assert [[polytope for polytope, _ in film.sightings(k).values()] for k in range(7)] == [
        [], [0], [0], [0], [1], [], [1],
    ]  # fmt: skip


def test_a_thin_overlap_that_thins_by_less_than_is_seen_of_its_width_is_drawn_anew(tmp_path):
    def pressed(depth: float) -> Bodies:
        plates = Placed(Box([1, 1, 0.1])), Placed(Box([1, 1, 0.1]), (0, 0, 0.2 - depth))
        return Bodies({CUP: plates[0], HAND: plates[1]})

    film = Film.of(recorded([pressed(2e-3), pressed(1.9e-3), pressed(1.899e-3)], tmp_path / "plates.html"))
    assert [polytope for k in range(3) for polytope, _ in film.sightings(k).values()] == [0, 1, 1]


def test_a_spinning_overlap_is_drawn_anew_though_its_measures_stay(tmp_path):
    def spun(angle: float) -> Bodies:
        turned = Placed(Box([0.1, 0.1, 0.1]), (0, 0, 0.19), (0, 0, np.sin(angle / 2), np.cos(angle / 2)))
        return Bodies({CUP: Placed(Box([1, 1, 0.1])), HAND: turned})

    film = Film.of(recorded([spun(angle) for angle in (0, 0.02, 0.0201)], tmp_path / "spin.html"))
    assert [polytope for k in range(3) for polytope, _ in film.sightings(k).values()] == [0, 1, 1]


def test_a_body_that_takes_over_an_id_is_drawn_anew(tmp_path):
    ball = Bodies({CUP: Placed(Sphere(0.1)), HAND: Placed(Box([0.1, 0.1, 0.1]), (0.3, 0, 0))})
    page = recorded([hand_at(0.3), ball], tmp_path / "cup.html")
    old, new = "/overlapper/bodies/cup/base/0", "/overlapper/bodies/cup/base/0 from frame 2"
    assert {old, new} <= set(drawings(page))
    film = Film.of(page)
    assert [(frame, bool(pose[3:].any())) for frame, pose in film.poses(old)] == [(0, True), (1, False)]
    assert [(frame, bool(pose[3:].any())) for frame, pose in film.poses(new)] == [(1, True)]


@pytest.mark.parametrize(
    "shape",
    [
        Box([0.1, 0.2, 0.3]),
        Sphere(0.2),
        Capsule(0.1, 0.3),
        Cylinder(0.1, 0.3),
        Hull(np.random.default_rng(7).normal(size=(30, 3))),
    ],
    ids=lambda shape: type(shape).__name__,
)
def test_the_surface_drawn_encloses_the_volume_of_the_shape(shape, tmp_path):
    page = recorded([Bodies({CUP: Placed(shape)})], tmp_path / "shape.html")
    surfaces = meshes(drawings(page)["/overlapper/bodies/cup/base/0"])
    assert_allclose(
        enclosed(surfaces), shape.volume, rtol=1e-2 if isinstance(shape, Sphere | Capsule | Cylinder) else 1e-6
    )


def test_a_half_space_is_drawn_as_a_plate_in_its_plane_as_large_as_the_scene(tmp_path):
    ground = HalfSpace([0.6, 0, 0.8], 0.5)
    page = recorded([Bodies({GROUND: Placed(ground), CUP: Placed(Sphere(2))})], tmp_path / "ground.html")
    ((corners, _, _),) = meshes(drawings(page)["/overlapper/bodies/ground/base/0"])
    assert_allclose(corners @ ground.normal, ground.offset, atol=1e-6)
    assert np.ptp(corners, axis=0)[1] >= 4


def test_the_facets_of_each_owner_close_the_overlap_in_every_frame(tmp_path):
    frames = [hand_at(x) for x in (0.15, 0.14, 0.12)]
    page = recorded(frames, tmp_path / "hand.html")
    film = Film.of(page)
    assert film.arrays["polytope_previous"].tolist() == [-1, 0, 1]
    for k, (bodies, (vertices, facets)) in enumerate(zip(frames, film.polytopes(), strict=True)):
        (contact,) = bodies.contacts()
        assert_allclose(enclosed_by_rings(vertices, facets), contact.overlap.volume, rtol=1e-4)
        first, second = (
            np.concatenate([vertices[ring] for owner, ring in facets if owner == side]) + film.heading["center"]
            for side in (0, 1)
        )
        # The cup ends at 0.1 in x, where its facet is.
        assert_allclose([first[:, 0].max(), second[:, 0].min()], [0.1, (0.05, 0.04, 0.02)[k]], atol=1e-5)


def test_a_round_overlap_of_thousands_of_facets_is_drawn_with_hundreds(tmp_path):
    bodies = Bodies({CUP: Placed(Sphere(0.1)), HAND: Placed(Sphere(0.1), (0.05, 0, 0))})
    (contact,) = bodies.contacts()
    ((vertices, facets),) = Film.of(recorded([bodies], tmp_path / "balls.html")).polytopes()
    assert len(contact.overlap.faces) > 2000
    assert len(facets) < 500
    assert_allclose(enclosed_by_rings(vertices, facets), contact.overlap.volume, rtol=0.1)


def test_far_from_the_origin_nothing_is_lost_to_single_precision(tmp_path):
    far = np.array([3e6, -2e6, 1e6])
    boxes = {CUP: Placed(Box([0.1, 0.1, 0.1]), far), HAND: Placed(Box([0.1, 0.1, 0.1]), far + [0.1875, 0, 0])}
    film = Film.of(recorded([Bodies(boxes)], tmp_path / "far.html"))
    ((_, hand),) = film.poses("/overlapper/bodies/arm/hand/0")
    ((_, cup),) = film.poses("/overlapper/bodies/cup/base/0")
    assert_allclose((hand - cup)[:3], [0.1875, 0, 0], atol=1e-6)
    ((vertices, _),) = film.polytopes()
    assert_allclose(np.ptp(vertices, axis=0), [0.0125, 0.2, 0.2], atol=1e-5)


@pytest.mark.parametrize(
    ("look", "sentence"),
    [
        ({"opacity": 1.5}, "opacity must lie between 0 and 1, not 1.5"),
        ({"front": "red"}, "front must be a colour like #e69f00, not 'red'"),
    ],
)
def test_a_look_that_cannot_be_drawn_is_refused(look, sentence):
    with pytest.raises(ValueError, match=sentence):
        Look(**look)


def test_frames_must_come_in_the_order_of_time(tmp_path):
    recording = Recording()
    recording.add(hand_at(0.3), [], time=0.5)
    with pytest.raises(ValueError, match="time must increase from frame to frame"):
        recording.add(hand_at(0.2), [], time=0.5)


def test_a_recording_without_frames_is_not_saved(tmp_path):
    with pytest.raises(ValueError, match="add at least one frame"):
        Recording().save(tmp_path / "empty.html")
    assert list(tmp_path.iterdir()) == []


@looks
@pytest.mark.parametrize("name", ["constructor", "__proto__", "'constructor'", "{{film}}", "<object>"])
def test_a_name_that_means_something_to_the_page_is_a_name(browser, tmp_path, name):
    frames = [hand_at(0.3), hand_at(0.12)]
    for bodies in frames:
        bodies.names |= {(1, -1): f"{name}/{name}", (2, 3): f"arm/{name}"}
    page = opened(browser, recorded(frames, tmp_path / "page.html"))
    assert coloured(scene(page), "orange") > 500
    label = name if name == "{{film}}" else f"'{name}'"
    assert f"{label} – arm.{label}" in page.ask("document.querySelector('#overlaps').innerText")
    page.ask("document.querySelector('#tree').onclick()")


@looks
def test_a_page_runs_its_own_scripts_alone(browser, reach, tmp_path):
    page = tmp_path / "page.html"
    strange = "<script>document.title = 'strange'</script>"
    page.write_text(reach.read_text(encoding="utf-8").replace("</body>", f"{strange}</body>"), encoding="utf-8")
    assert opened(browser, page).ask("document.title") == "overlapper"
    refused = "fetch('https://example.org').then(() => 'loaded', () => 'refused')"
    assert browser.ask(refused) == "refused"


@looks
def test_a_page_that_was_cut_says_so(browser, reach, tmp_path):
    text = reach.read_text(encoding="utf-8")
    shown = "document.querySelector('#unread')?.innerText ?? ''"
    assert opened(browser, reach).ask(shown) == ""
    film = text.index('id="film">') + 400
    changed = text[:film] + ("B" if text[film] == "A" else "A") + text[film + 1 :]
    for number, broken in enumerate((text[:-100], text[: len(text) // 2], changed)):
        page = tmp_path / f"{number}.html"
        page.write_text(broken, encoding="utf-8")
        browser.open(page.as_uri(), until="document.readyState === 'complete'")
        browser.ask("new Promise(done => setTimeout(done, 300))")
        assert "it is not whole: it was cut or changed" in browser.ask(shown)


def test_a_page_carries_the_licences_of_what_it_contains(reach):
    text = reach.read_text(encoding="utf-8").partition('id="licences">')[2].partition("</script>")[0]
    for name in ("meshcat", "three 0.", "dat.gui", "msgpack-lite"):
        assert f"\n{name}" in text
    assert text.count("Permission is hereby granted") >= 5 and "Apache License" in text


def test_an_earlier_page_is_whole_when_a_new_one_cannot_be_written(reach, tmp_path, monkeypatch):
    page = tmp_path / "page.html"
    page.write_text("earlier")

    def full(self, *arguments, **options):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(OSError, match="No space left"):
        recorded([hand_at(0.12)], page)
    assert page.read_text() == "earlier" and list(tmp_path.iterdir()) == [page]


def test_a_live_view_is_seen_where_it_is_asked_to_be():
    def listening(port):
        """The addresses at which this machine answers on a port, as the kernel lists them."""
        lines = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
        return {at.partition(":")[0] for _, at, _, state, *_ in lines if state == "0A" and at.endswith(f":{port:04X}")}

    for host, address in (("127.0.0.1", "0100007F"), ("0.0.0.0", "00000000")):
        with Viewer(host=host) as viewer:
            assert re.fullmatch(r"http://127\.0\.0\.1:\d+/static/", viewer.url)
            assert listening(int(viewer.url.split(":")[2].split("/")[0])) == {address}
            assert listening(int(viewer.visualizer.window.zmq_url.split(":")[2])) == {"0100007F"}
    with pytest.raises(
        ValueError, match=r"^host must be an address of this machine, not '192\.0\.2\.1': Cannot assign"
    ):
        Viewer(host="192.0.2.1")


def live_paths(viewer: Viewer, command: str = "set_object") -> set[str]:
    """The paths to which the server of a live view applies a command."""
    messages = [
        base64.b64decode(each)
        for each in re.findall(r'fetch\(.data:[a-z/-]*;base64,([^"]+)"', viewer.visualizer.static_html())
    ]
    return {each["path"] for each in map(umsgpack.unpackb, messages) if each["type"] == command}


def test_a_live_view_shows_the_last_step_and_ends_with_its_server():
    for _ in range(2):
        with Viewer() as viewer:
            server = viewer._server.process
            bodies = hand_at(0.12)
            viewer.show(bodies, bodies.contacts())
            arm, cup = "/overlapper/bodies/arm/hand/0", "/overlapper/bodies/cup/base/0"
            assert live_paths(viewer) == {arm, cup, "/overlapper/overlaps/cup-arm.hand/1.34 dm³"}
            viewer.show(Bodies({CUP: Placed(Sphere(0.1))}), [])
            assert live_paths(viewer) == {cup}
        assert server.returncode is not None


def test_a_visualizer_passed_in_keeps_its_camera_and_its_server():
    with Viewer() as owner:
        empty = owner.visualizer.static_html()
        with Viewer(owner.visualizer) as guest:
            guest.show(hand_at(0.12), [])
        assert owner._server.alive()
        assert owner.visualizer.static_html() != empty
        assert not live_paths(owner, "set_property")
        owner.show(hand_at(0.12), [])
        assert "/Cameras/default/rotated/<object>" in live_paths(owner, "set_property")


def test_without_meshcat_one_sentence_says_what_to_install():
    program = "import sys; sys.modules['meshcat'] = None; import overlapper.viewer"
    failed = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert failed.stderr.splitlines()[-1] == "ImportError: overlapper.viewer needs meshcat: pip install meshcat"
