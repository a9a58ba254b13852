"""What the recording holds is read back from its file; what it looks like is seen through headless Chromium."""

from __future__ import annotations

import base64
import gzip
import json
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import umsgpack
from numpy.testing import assert_allclose
from PIL import Image

from overlapper import Box, Capsule, Cylinder, HalfSpace, Hull, Overlap, Placed, Sphere, overlap
from overlapper.viewer import Recording, Viewer

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
looks = pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not to be had here, and the picture is taken with it")

GROUND, CUP, HAND = (0, -1, 0), (1, -1, 0), (2, 3, 0)
GREEN = (0.1, 0.8, 0.1, 1.0)


@dataclass
class Contact:
    bodyA: int
    linkA: int
    shapeA: int
    bodyB: int
    linkB: int
    shapeB: int
    overlap: Overlap


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


def unpacked(page: Path, name: str) -> list[dict]:
    text = re.search(f'id="{name}">([^<]*)<', page.read_text(encoding="utf-8"))[1]
    return json.loads(gzip.decompress(base64.b64decode(text)))


def drawings(page: Path) -> dict[str, dict]:
    """What is drawn at each path of the tree, in three.js's object format."""
    return {each["path"]: each["object"] for each in unpacked(page, "commands") if each["type"] == "set_object"}


def tracks(page: Path) -> dict[tuple[str, str], list[tuple[float, object]]]:
    """Key frames (time, value) by path and track."""
    (animation,) = [each for each in unpacked(page, "commands") if each["type"] == "set_animation"]
    return {
        (clip["path"], track["name"]): [(key["time"], key["value"]) for key in track["keys"]]
        for clip in animation["animations"]
        for track in clip["clip"]["tracks"]
    }


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


def picture(page: Path, time: float, view: str = "") -> np.ndarray:
    """The page at a time as Chromium shows it, (600, 800, 3), its table of overlaps and its slider cut off."""
    shot = page.with_suffix(f".{time}.png")
    options = ["--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--no-first-run"]
    options += ["--enable-unsafe-swiftshader", "--disable-background-networking", "--virtual-time-budget=4000"]
    options += [f"--user-data-dir={page.with_suffix('.profile')}", f"--screenshot={shot}", "--window-size=800,800"]
    subprocess.run(
        [CHROMIUM, *options, f"{page.as_uri()}#t={time}{view}"], check=True, capture_output=True, timeout=120
    )
    return np.asarray(Image.open(shot).convert("RGB"), dtype=int)[120:720]


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
def reach(tmp_path_factory):
    """A recording of two frames, apart and overlapping."""
    return recorded([hand_at(0.3), hand_at(0.12)], tmp_path_factory.mktemp("reach") / "hand.html")


@pytest.fixture(scope="module")
def overlapping(reach):
    return picture(reach, time=1)


@looks
def test_an_overlap_is_seen_opaque_in_the_colours_of_both_owners(overlapping):
    for colour in ("orange", "sky blue"):
        assert coloured(overlapping, colour) > 500
    assert coloured(overlapping, "pink") > 20
    assert coloured(overlapping, "green") > 10_000


@looks
def test_only_the_bodies_are_seen_before_they_overlap(reach):
    image = picture(reach, time=0)
    assert [coloured(image, colour) for colour in ("orange", "sky blue", "pink")] == [0, 0, 0]
    assert coloured(image, "green") > 10_000


@looks
def test_an_overlap_of_a_millimetre_in_a_scene_of_metres_is_found(tmp_path):
    corner = Placed(Box([0.5, 0.5, 0.5]), (0.999, 0.999, 0.999))
    page = recorded([Bodies({CUP: Placed(Box([0.5, 0.5, 0.5])), HAND: corner})], tmp_path / "corner.html")
    assert coloured(picture(page, time=0), "pink") > 20


@looks
def test_a_link_opens_the_page_with_the_camera_where_it_says(reach):
    above = picture(reach, time=1, view="&from=0.06,0.029,0.5&at=0.06,0.03,0.04")  # upon the top of the cup
    below = picture(reach, time=1, view="&from=0.06,0.029,-0.5&at=0.06,0.03,0.04")  # upon the bottom of the hand
    assert coloured(above, "orange") > 2000
    assert coloured(above, "sky blue") == 0
    assert coloured(below, "sky blue") > 2000
    assert coloured(below, "orange") == 0


@looks
def test_a_live_view_looks_like_a_recording(overlapping, tmp_path):
    with Viewer() as viewer:
        for bodies in (hand_at(0.3), hand_at(0.12)):
            viewer.show(bodies, bodies.contacts())
        page = tmp_path / "live.html"
        page.write_text(viewer.visualizer.static_html(), encoding="utf-8")
    live = picture(page, time=1)
    for colour in ("orange", "sky blue", "green"):
        assert_allclose(coloured(live, colour), coloured(overlapping, colour), rtol=0.1)


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


def test_the_tree_names_links_and_pairs_and_the_largest_volume_of_a_pair(tmp_path):
    page = recorded([hand_at(0.19), hand_at(0.12), hand_at(0.3)], tmp_path / "hand.html")
    volume = "1.34 dm³"  # 8 x 14 x 12 cm
    assert set(drawings(page)) == {
        "/overlapper/bodies/cup/base/0",
        "/overlapper/bodies/arm/hand/0",
        f"/overlapper/overlaps/cup-arm.hand/at most {volume}",
    }


def test_the_table_lists_the_overlaps_of_each_frame(tmp_path):
    page = recorded([hand_at(0.3), hand_at(0.12)], tmp_path / "hand.html")
    before, after = unpacked(page, "frames")
    assert (before["time"], before["overlaps"]) == (0, [])
    (row,) = after["overlaps"]
    assert (row["pair"], row["volume"], row["depth"]) == (["cup", "arm.hand"], "1.34 dm³", "80 mm")
    assert_allclose(row["centroid"], [0.06, 0.03, 0.04], atol=1e-12)


def test_bodies_are_sent_once_and_have_key_frames_only_where_they_move(tmp_path):
    page = recorded([hand_at(x) for x in (0.3, 0.3, 0.12, 0.12)], tmp_path / "hand.html")
    sent = [each["path"] for each in unpacked(page, "commands") if each["type"] == "set_object"]
    assert sent.count("/overlapper/bodies/arm/hand/0") == sent.count("/overlapper/bodies/cup/base/0") == 1
    times = {path: [time for time, _ in keys] for (path, name), keys in tracks(page).items() if name == ".position"}
    assert times == {"/overlapper/bodies/arm/hand/0": [0, 2, 4], "/overlapper/bodies/cup/base/0": [0, 4]}


def test_one_mesh_stands_for_an_overlap_at_rest_and_is_hidden_without_it(tmp_path):
    page = recorded([hand_at(x) for x in (0.3, 0.12, 0.12, 0.15, 0.3)], tmp_path / "hand.html")
    switches = {
        name: keys for (path, name), keys in tracks(page).items() if path == "/overlapper/overlaps/cup-arm.hand"
    }
    assert switches == {
        "frame0.visible": [(0, False), (1, True), (3, False), (5, False)],
        "frame1.visible": [(0, False), (3, True), (4, False), (5, False)],
    }


def test_a_body_that_takes_over_an_id_is_drawn_anew(tmp_path):
    ball = Bodies({CUP: Placed(Sphere(0.1)), HAND: Placed(Box([0.1, 0.1, 0.1]), (0.3, 0, 0))})
    page = recorded([hand_at(0.3), ball], tmp_path / "cup.html")
    old, new = "/overlapper/bodies/cup/base/0", "/overlapper/bodies/cup/base/0 from frame 2"
    assert {old, new} <= set(drawings(page))
    assert [value for _, value in tracks(page)[old, ".visible"]] == [True, False, False]
    assert [value for _, value in tracks(page)[new, ".visible"]] == [False, True, True]


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


def test_the_facets_of_each_owner_close_the_overlap(tmp_path):
    bodies = hand_at(0.12)
    (contact,) = bodies.contacts()
    page = recorded([bodies], tmp_path / "hand.html")
    surfaces = meshes(drawings(page)["/overlapper/overlaps/cup-arm.hand/at most 1.34 dm³"])
    assert_allclose(enclosed(surfaces), contact.overlap.volume, rtol=1e-6)
    first, second = (vertices for vertices, _, _ in surfaces)
    reds, blues = zip(*((colour >> 16, colour & 255) for _, _, colour in surfaces), strict=True)
    assert reds[0] > blues[0]  # orange
    assert reds[1] < blues[1]  # sky blue
    # About the centroid (0.06, 0.03, 0.04): the cup ends at 0.1 in x, the hand begins at 0.02.
    assert_allclose([first[:, 0].max(), second[:, 0].min()], [0.04, -0.04], atol=1e-7)


def test_a_round_overlap_of_thousands_of_facets_is_drawn_with_hundreds(tmp_path):
    bodies = Bodies({CUP: Placed(Sphere(0.1)), HAND: Placed(Sphere(0.1), (0.05, 0, 0))})
    (contact,) = bodies.contacts()
    page = recorded([bodies], tmp_path / "balls.html")
    (drawn,) = [drawing for path, drawing in drawings(page).items() if "/overlaps/" in path]
    assert len(contact.overlap.faces) > 2000
    assert sum(len(faces) for _, faces, _ in meshes(drawn)) < 1000
    assert_allclose(enclosed(meshes(drawn)), contact.overlap.volume, rtol=0.1)


def test_far_from_the_origin_nothing_is_lost_to_single_precision(tmp_path):
    far = np.array([3e6, -2e6, 1e6])
    boxes = {CUP: Placed(Box([0.1, 0.1, 0.1]), far), HAND: Placed(Box([0.1, 0.1, 0.1]), far + [0.1875, 0, 0])}
    page = recorded([Bodies(boxes)], tmp_path / "far.html")
    ((_, hand), _) = tracks(page)["/overlapper/bodies/arm/hand/0", ".position"]
    ((_, cup), _) = tracks(page)["/overlapper/bodies/cup/base/0", ".position"]
    assert_allclose(np.float32(hand) - np.float32(cup), [0.1875, 0, 0], atol=1e-6)
    (drawn,) = [drawing for path, drawing in drawings(page).items() if "/overlaps/" in path]
    assert_allclose(np.ptp(meshes(drawn)[0][0], axis=0), [0.0125, 0.2, 0.2], atol=1e-7)


def test_frames_must_come_in_the_order_of_time(tmp_path):
    recording = Recording()
    recording.add(hand_at(0.3), [], time=0.5)
    with pytest.raises(ValueError, match="time must increase from frame to frame"):
        recording.add(hand_at(0.2), [], time=0.5)


def test_a_recording_without_frames_is_not_saved(tmp_path):
    with pytest.raises(ValueError, match="add at least one frame"):
        Recording().save(tmp_path / "empty.html")
    assert list(tmp_path.iterdir()) == []


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
            server = viewer.visualizer.window.server_proc
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
        assert owner.visualizer.window.server_proc.poll() is None
        assert owner.visualizer.static_html() != empty
        assert not live_paths(owner, "set_property")
        owner.show(hand_at(0.12), [])
        assert "/Cameras/default/rotated/<object>" in live_paths(owner, "set_property")


def test_without_meshcat_one_sentence_says_what_to_install():
    program = "import sys; sys.modules['meshcat'] = None; import overlapper.viewer"
    failed = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (
        failed.stderr.splitlines()[-1] == "ImportError: overlapper.viewer needs meshcat: pip install 'overlapper[view]'"
    )
