"""`overlapper view`: a scene, or a table of one, is seen as a page, as a picture, or live."""

import re
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from command import overlapper
from pages import Film
from PIL import Image

from overlapper import Box, HalfSpace, Placed, RoundedHull, Sphere, overlap
from overlapper.cli import view as cli
from overlapper.scenes.check import record
from overlapper.scenes.playback import largest, play
from overlapper.scenes.scene import load_scene
from overlapper.tables.table_file import NEEDED
from overlapper.viewer import picture
from overlapper.viewer.look import Look

PRESS = '''
"""A cube is pushed into another, and out again."""
import pybullet as p

STEPS = 12
PAIRS = "all"  # nothing moves by itself


def build(client):
    cube = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.05] * 3, physicsClientId=client)
    p.createMultiBody(0, cube, physicsClientId=client)
    upper = p.createMultiBody(0, cube, physicsClientId=client)

    def step(i):
        height = 0.08 + 0.01 * abs(i - 6)
        p.resetBasePositionAndOrientation(upper, [0.02, 0.01, height], [0, 0, 0, 1], physicsClientId=client)

    return step
'''


@pytest.fixture(autouse=True)
def scene_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "press.py").write_text(PRESS)
    return tmp_path / "press.py"


def colours(path):
    """How many pixels of a picture are orange, sky blue, pink and green."""
    image = np.asarray(Image.open(path).convert("RGB"), dtype=int)[110:]
    red, green, blue = np.moveaxis(image, -1, 0)
    return {
        "orange": int(((red > 130) & (red > 1.3 * green) & (green > 3 * blue)).sum()),
        "sky blue": int(((blue > 130) & (blue > 1.15 * green) & (green > 1.5 * red)).sum()),
        "pink": int(((red > 200) & (red > 2 * green) & (blue > 1.5 * green)).sum()),
        "green": int(((green > red + 20) & (green > blue + 20)).sum()),
        "red": int(((red > 100) & (green < 20) & (blue < 20)).sum()),
    }


def test_a_scene_becomes_a_page_and_its_table_a_picture_of_the_largest_overlap(tmp_path):
    assert overlapper("view", "press.py").stdout == "Written: out/press.html\n"
    assert (tmp_path / "out" / "press.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    overlapper("run", "press.py", "--out", "table.sqlite")
    done = overlapper(
        "view", "table.sqlite", "--scene", "press.py", "--png", "made/press.png", "--overlaps-front", "#ff0000"
    )
    assert (done.stdout, done.stderr, done.returncode) == ("Written: made/press.png\n", "", 0)
    seen = colours("made/press.png")
    assert seen["orange"] == seen["sky blue"] == 0
    assert seen["red"] > 1000


def test_the_overlap_is_largest_when_the_cube_is_deepest():
    view = largest(play("press.py").views)
    assert view.step == 7
    assert view.contacts[0].overlap.volume == pytest.approx(0.08 * 0.09 * 0.02)
    assert view.bodies.placed[1].position == pytest.approx([0.02, 0.01, 0.08], abs=1e-3)


def test_a_table_is_distinguished_from_its_changed_scene(scene_file):
    overlapper("run", "press.py", "--out", "press.csv")
    playback = play("press.csv", scene="press.py")
    assert len(list(playback.views)) == playback.total == 9  # the cubes are apart from then on
    assert playback.remarks == []
    scene_file.write_text(PRESS.replace("0.08 +", "0.07 +"))
    list((playback := play("press.csv", scene="press.py")).views)
    (remark,) = playback.remarks
    assert re.match(r"the steps shown differ from press\.csv, because the simulation has changed: step \d, ", remark)


def test_a_longer_table_does_not_extend_the_run_of_a_scene(scene_file):
    overlapper("run", "press.py", "--out", "press.csv")
    text = Path("press.csv").read_text()
    last = next(line for line in text.splitlines() if line.startswith("9,"))
    unsealed = re.sub("^# rows.*\n", "", text, flags=re.MULTILINE)
    Path("endless.csv").write_text(unsealed + last.replace("9,", "2000000000,", 1) + "\n")
    playback = play("endless.csv", scene="press.py")
    assert len(list(playback.views)) == playback.total == 12
    assert playback.remarks == ["endless.csv has 2,000,000,000 steps: --steps 2000000000 shows all of them"]
    scene_file.write_text(PRESS.replace("STEPS = 12", "STEPS = 5"))
    assert len(list(play("press.csv", scene="press.py").views)) == 5
    playback = play("press.csv", 20, "press.py")
    assert (len(list(playback.views)), playback.remarks) == (9, [])


def test_a_table_of_bodies_with_margins_is_played_with_margins(scene_file):
    points = "vertices=[[x, y, z] for x in (-0.05, 0.05) for y in (-0.05, 0.05) for z in (-0.05, 0.05)]"
    scene_file.write_text(PRESS.replace("GEOM_BOX, halfExtents=[0.05] * 3", f"GEOM_MESH, {points}"))
    overlapper("run", "press.py", "--surface", "margin", "--out", "press.csv")
    playback = play("press.csv", scene="press.py")
    assert {type(body.shape) for view in playback.views for body in view.bodies.placed} == {RoundedHull}
    assert playback.remarks == []


def test_an_expected_file_is_viewed_without_its_scene(scene_file):
    record(load_scene(scene_file))
    scene_file.unlink()
    playback = play("expected/press.csv")
    views = list(playback.views)
    assert [view.step for view in views] == [3, 6, 9, 12]
    assert playback.sparse
    assert views[1].contacts[0].overlap.volume == pytest.approx(0.08 * 0.09 * 0.01)


@pytest.mark.parametrize(
    ("source", "options", "sentence"),
    [
        (
            "lost.csv",
            {},
            "lost.csv has no shapes to show: give its scene with --scene (it says '../lost')",
        ),
        ("mute.csv", {}, "mute.csv has no shapes to show: give its scene with --scene"),
        (
            "odd.csv",
            {"scene": "press.py"},
            "odd.csv has an invalid setting: could not convert string to float: 'x'",
        ),
        ("press.py", {"scene": "press.py"}, "--scene is for tables, but press.py is not a table"),
        ("press.py", {"live": True, "host": "192.0.2.1"}, "host must be an address of this machine, not '192.0.2.1': "),
        ("press.py", {"live": True, "host": "no host"}, "host must be an address of this machine, not 'no host': "),
        ("gone.csv", {}, "gone.csv: No such file"),
        ("press.py", {"png": Path("a.png"), "step": 13}, "there is no step 13 to show"),
        (
            "press.py",
            {"overlaps": "faces,corners"},
            "--overlaps must name some of faces,edges,vertices,marks,forces, not 'c",
        ),
        ("press.py", {"bodies_back": "red"}, "--bodies-back must be a colour like #e69f00, not 'red'"),
        ("press.py", {"live": True, "png": Path("a.png")}, "--html, --png and --live exclude each other"),
    ],
)
def test_files_that_cannot_be_viewed_are_refused_in_one_sentence(source, options, sentence, tmp_path):
    (tmp_path / "lost.csv").write_text(f"# scene: ../lost\n# steps: 3\n{','.join(NEEDED)}\n")
    (tmp_path / "mute.csv").write_text(f"{','.join(NEEDED)}\n")
    (tmp_path / "odd.csv").write_text(f"# tolerance: x\n{','.join(NEEDED)}\n")
    with pytest.raises(cli.Refused, match=re.escape(sentence)):
        cli.view(source, **options)


def test_a_live_view_says_where_it_is_and_ends_with_the_scene_where_nobody_watches():
    done = overlapper("view", "press.py", "--live")
    assert done.returncode == 0
    assert re.fullmatch(r"overlapper: http://127\.0\.0\.1:\d+/static/ \(Ctrl-C ends it\)\n", done.stderr)


@dataclass
class Contact:
    overlap: object
    bodyA: int = 0
    linkA: int = -1
    shapeA: int = 0
    bodyB: int = 1
    linkB: int = -1
    shapeB: int = 0


class Bodies:
    """Two green shapes."""

    keys = ((0, -1, 0), (1, -1, 0))
    names = {(0, -1): "cup", (1, -1): "hand"}  # noqa: RUF012
    labels = {0: "cup", 1: "hand"}  # noqa: RUF012
    colors = dict.fromkeys(names, (0.1, 0.8, 0.1, 1.0))

    def __init__(self, a, b):
        self.placed = [a, b]
        self.contacts = [Contact(overlap(a, b))]


@pytest.fixture(scope="module")
def corner():
    """Two boxes that share a corner of 3 x 10 x 10 cm."""
    return Bodies(Placed(Box([0.1, 0.1, 0.1])), Placed(Box([0.1, 0.1, 0.1]), (0.17, 0.1, 0.1)))


@pytest.fixture(scope="module")
def whole(corner, tmp_path_factory):
    return colours(picture.save(tmp_path_factory.mktemp("whole") / "a.png", corner, corner.contacts))


def test_a_picture_shows_both_owners_opaque_and_comes_near(corner, whole, tmp_path):
    near = colours(picture.save(tmp_path / "a.png", corner, corner.contacts, close=True))
    for name in ("orange", "sky blue"):
        assert whole[name] > 1000
        assert near[name] > 1.2 * whole[name]
    assert whole["pink"] > 100
    assert whole["green"] > 20_000


def test_the_look_selects_the_parts_drawn_in_a_picture(corner, whole, tmp_path):
    def seen(bodies, overlaps):
        return colours(picture.save(tmp_path / "a.png", corner, corner.contacts, looks=(bodies, overlaps)))

    edges = seen(Look(faces=False), Look(faces=False, marks=False))
    assert edges["orange"] == edges["sky blue"] == edges["pink"] == 0
    assert 500 < edges["green"] < whole["green"] / 5
    red = seen(Look(opacity=0, edges=False), Look(front="#ff0000", edges=False))
    assert red["orange"] == red["sky blue"] == red["green"] == 0
    assert red["red"] > 1000


def test_a_ball_in_the_ground_is_pictured_with_the_plane_around_it(tmp_path):
    both = Bodies(Placed(HalfSpace([0, 0, 1], 0)), Placed(Sphere(0.1), (0, 0, 0.08)))
    seen = colours(picture.save(tmp_path / "a.png", both, both.contacts))
    assert seen["green"] > 10_000
    assert seen["orange"] + seen["sky blue"] > 500


def test_a_playback_without_views_has_nothing_to_see():
    with pytest.raises(ValueError, match=r"^there is nothing to show: no step was simulated or recorded$"):
        largest(iter(()))


def test_the_view_of_the_largest_overlap_is_kept_or_the_last_if_nothing_ever_overlaps():
    @dataclass
    class Seen:
        volumes: tuple[float, ...]

        @property
        def contacts(self):
            return [SimpleNamespace(overlap=SimpleNamespace(volume=volume)) for volume in self.volumes]

        def kept(self):
            return self

    views = [Seen(volumes) for volumes in ((), (2.0,), (1.0, 1.5), (2.5,), (0.0,), ())]
    assert largest(iter(views)) is views[2]
    assert largest(iter([views[0], views[4], views[5]])) is views[5]


def test_the_first_step_in_which_a_pair_overlaps_is_on_the_page_at_any_rate(scene_file, tmp_path):
    late = scene_file.read_text().replace("abs(i - 6)", "(0 if i == 10 else 9)")
    (tmp_path / "late.py").write_text(late)
    overlapper("view", "late.py", "--html", "late.html")
    found = Film.of(tmp_path / "late.html")
    assert [round(240 * time) for time in found.heading["times"]] == [0, 7, 10]  # steps 1, 8 and 11
    assert len(found.heading["pairs"]) == 1
