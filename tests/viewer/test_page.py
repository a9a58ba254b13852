"""The page of a recording in headless Chromium: its picture, its controls and its contents."""

from __future__ import annotations

import re
from html.parser import HTMLParser

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pages import (
    CUP,
    HAND,
    GreenBodies,
    click_in_scene,
    coloured,
    hand_at,
    looks,
    opened,
    panel,
    recorded,
    scene,
    sides,
)

from overlapper import Box, Placed
from overlapper.viewer import Recording, Viewer
from overlapper.viewer.framing import Framing
from overlapper.viewer.look import Look


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
    page = recorded([GreenBodies({CUP: Placed(Box([0.5, 0.5, 0.5])), HAND: corner})], tmp_path / "corner.html")
    image = scene(opened(browser, page, "#t=0"))
    assert 20 < coloured(image, "pink") < 1000
    red, green, blue = np.moveaxis(image, -1, 0)
    rows, columns = np.nonzero((red > 200) & (red > 2 * green) & (blue > 1.5 * green))
    # The arrow points to the left and down, away from the corner.
    click_in_scene(browser, columns.max() - 2, rows.min() + 2)
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
    click_in_scene(browser, columns[middle], rows[middle])
    browser.wait("!document.querySelector('#numbers').hidden")
    text = browser.ask("document.querySelector('#numbers').innerText")
    assert "cup – arm/hand" in text
    # 8 x 14 x 12 cm about (0.06, 0.03, 0.04): pushed back by 8 cm, they are apart.
    assert re.search(r"volume\s1\.344 ± \S+ dm³", text)
    assert re.search(r"depth\s80 mm", text)
    assert re.search(r"surface\s752 cm²", text)
    assert "(0.0600, 0.0300, 0.0400) m" in text
    assert "(-1.0000, 0.0000, 0.0000)" in text
    click_in_scene(browser, 20, 20)
    browser.wait("document.querySelector('#numbers').hidden")


@looks
def test_a_click_on_a_row_zooms_in_and_highlights_its_pair_until_escape(browser, reach):
    def bar():
        left, top, right, bottom = sides(browser, "#chart")
        return browser.picture()[top:bottom, left:right]

    panel(opened(browser, reach), "overlaps")
    assert coloured(bar(), "pink") == 0
    browser.click_on("#list tbody tr")
    assert "1.344" in browser.ask("document.querySelector('#numbers').innerText")
    assert browser.ask("document.querySelector('#caption').textContent") == "cup – arm/hand"
    assert browser.ask("document.querySelector('#list tbody button').ariaCurrent") == "true"
    assert coloured(bar(), "pink") > 100
    # With the same room as before, more is seen of it.
    browser.ask("document.querySelector('#numbers').hidden = true")
    panel(browser, None)
    near = scene(browser)
    browser.press("Escape")
    assert coloured(near, "orange") > 1.1 * coloured(scene(browser), "orange")
    assert coloured(bar(), "pink") == 0
    assert browser.ask("document.querySelector('#numbers').hidden")


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
    assert browser.ask("document.querySelector('#tags').innerText") == "1.34 dm³"
    assert seen("m")["pink"] == 0
    assert browser.ask("document.querySelector('#tags').innerText") == ""
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
    assert browser.ask("document.querySelector('#total').textContent") == "0 overlaps"
    browser.press("ArrowRight")
    assert time() == "1.000 s"
    box = browser.ask("JSON.parse(JSON.stringify(document.querySelector('#chart').getBoundingClientRect()))")
    browser.click(box["x"] + 90, box["y"] + 50)
    assert time() == "0.000 s"
    browser.press(" ")
    browser.wait("document.querySelector('#time output').textContent === '1.000 s'")


@looks
def test_a_live_view_looks_like_a_recording(browser, reach, tmp_path):
    framing = Framing(hand_at(0.3))
    framing.see(hand_at(0.3), [])  # a live view does not know yet what will move, nor overlap
    view = framing.whole()
    camera = [",".join(map(str, point)) for point in (view.at + view.distance() * view.back, view.at)]
    recording = scene(opened(browser, reach, f"#t=1&from={camera[0]}&at={camera[1]}"))
    with Viewer() as viewer:
        for bodies in (hand_at(0.3), hand_at(0.12)):
            viewer.show(bodies, bodies.contacts())
        page = tmp_path / "live.html"
        page.write_text(viewer.visualizer.static_html(), encoding="utf-8")
    height = len(scene(browser)) + 51
    browser.open(page.as_uri(), until="document.querySelector('canvas')")
    live = next(each for each in (browser.picture() for _ in range(100)) if coloured(each, "orange"))
    for colour in ("orange", "sky blue", "green"):
        # The live view has the whole height. The recording leaves some height to its panels.
        assert_allclose(coloured(live, colour) * (height / 800) ** 2, coloured(recording, colour), rtol=0.25)


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
    assert "#list" in style
    assert "url(" not in style
    assert "@import" not in style


@looks
@pytest.mark.parametrize("name", ["constructor", "__proto__", "'constructor'", "{{film}}", "<object>", "a/b"])
def test_names_with_markup_are_shown_as_text(browser, tmp_path, name):
    frames = [hand_at(0.3), hand_at(0.12)]
    for bodies in frames:
        bodies.labels[1] = bodies.names[1, -1] = name
        bodies.names[2, 3] = f"arm/{name}"
    page = opened(browser, recorded(frames, tmp_path / "page.html"))
    assert coloured(scene(page), "orange") > 500
    panel(browser, "overlaps")
    assert f"{name} – arm/{name}" in page.ask("document.querySelector('#list').innerText")
    panel(browser, "bodies")
    assert name in page.ask("document.querySelector('#bodies-list').innerText").split("\n")


@looks
def test_a_page_runs_its_own_scripts_alone(browser, reach, tmp_path):
    page = tmp_path / "page.html"
    strange = "<script>document.title = 'strange'</script>"
    page.write_text(reach.read_text(encoding="utf-8").replace("</body>", f"{strange}</body>"), encoding="utf-8")
    assert opened(browser, page).ask("document.title") == "hand, overlapper"
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
        assert "the file is not complete: it was cut or changed" in browser.ask(shown)


def test_a_page_carries_the_licences_of_what_it_contains(reach):
    text = reach.read_text(encoding="utf-8").partition('id="licences">')[2].partition("</script>")[0]
    for name in ("meshcat", "three 0.", "dat.gui", "msgpack-lite"):
        assert f"\n{name}" in text
    assert text.count("Permission is hereby granted") >= 5 and "Apache License" in text
