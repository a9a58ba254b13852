"""The panels of a page, its chart, its keys and its link, at the sizes of a desk, a tablet and a phone."""

from __future__ import annotations

import json
import re
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pages import Scene, coloured, hand_at, looks, opened, panel, recorded, scene, sides

from overlapper import Box, HalfSpace, Placed, Sphere
from overlapper.simulation.first_overlaps import FirstOverlap
from overlapper.simulation.model import Skipped
from overlapper.viewer import Recording
from overlapper.viewer.look import Look

pytestmark = looks
CUBES = 16
DESK, TABLET, PHONE = (1440, 900), (820, 1180), (390, 844)


def pile(lift: float = 0.0) -> Scene:
    """A table, in which stand 16 cubes, the first one 1 mm deep, and two links of a robot, one of two shapes."""
    cube = Box([0.1, 0.1, 0.1])
    shapes = {(0, -1, 0): Placed(Box([2, 2, 0.1]), (0, 0, -0.1 - lift))}
    for k in range(CUBES):
        shapes[1 + k, -1, 0] = Placed(cube, (0.5 * (k % 4) - 1, 0.5 * (k // 4) - 1, 0.1 - 0.001 * (k + 1)))
    robot = {(-1, 0): (1.5, 0, 0.5), (0, 0): (1.5, -0.5, 0.09), (0, 1): (1.5, -0.8, 0.08), (1, 0): (1.5, 0.5, 0.074)}
    shapes |= {(20, *key): Placed(cube, place) for key, place in robot.items()}
    return Scene(shapes)


@pytest.fixture(scope="module")
def piled(tmp_path_factory):
    """Twice, the second time less deep by 5 mm."""
    return recorded([pile(), pile(lift=0.005)], tmp_path_factory.mktemp("pile") / "pile.html")


@pytest.fixture
def sized(browser):
    """Gives the browser another size until the end of the test."""

    def size(width, height, touch=False):
        browser("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=touch)
        browser("Emulation.setTouchEmulationEnabled", enabled=touch)
        browser("Page.navigate", url="about:blank")

    yield size
    size(800, 800)


def text(browser, selector):
    return browser.ask(f"document.querySelector({selector!r}).innerText")


def rows(browser):
    return browser.ask(
        "[...document.querySelectorAll('#list tbody tr')].map(row => row.innerText.replace(/\\s+/g, ' '))"
    )


def put(browser, control, value):
    browser.ask(f"(each => {{ each.value = {json.dumps(value)}; (each.oninput ?? each.onchange)(); }})({control})")


def test_overlaps_are_grouped_by_bodies_and_links_with_totals_folded_where_there_are_many(browser, piled):
    panel(opened(browser, piled, "#t=0"), "overlaps")
    assert text(browser, "#total") == "19 overlaps, 7.68 dm³"  # 400 cm² times 136 mm and 56 mm
    assert text(browser, "#list th") == "19 overlaps"
    first, second, *_ = rows(browser)
    assert len(rows(browser)) == 17
    assert first == "▸body0 – body20 × 3 2.24 dm³ 26 mm"
    assert second == "body0 – body16 640 cm³ 16 mm"
    browser.click_on("#list tbody tr")
    assert rows(browser)[:4] == [
        "▾body0 – body20 × 3 2.24 dm³ 26 mm",
        "▸body0 – link0 × 2 1.2 dm³ 20 mm",
        "body0 – link1 1.04 dm³ 26 mm",
        "body0 – body16 640 cm³ 16 mm",
    ]
    browser.click_on("#list tbody tr:nth-child(2)")
    assert rows(browser)[2:4] == [
        "body0 – part 1 800 cm³ 20 mm",
        "body0 – part 0 400 cm³ 10 mm",
    ]
    assert browser.ask("document.querySelector('#list button').ariaExpanded") == "true"
    # By the keyboard: the space bar folds it, and does not play.
    browser.ask("document.querySelector('#list button').focus()")
    browser("Input.dispatchKeyEvent", type="keyDown", key=" ", code="Space", windowsVirtualKeyCode=32, text=" ")
    browser("Input.dispatchKeyEvent", type="keyUp", key=" ", code="Space", windowsVirtualKeyCode=32)
    browser.wait("document.querySelectorAll('#list tbody tr').length === 17")
    assert browser.ask("document.querySelector('#play').ariaLabel") == "play"


def test_a_few_overlaps_are_not_folded(browser, tmp_path):
    robot = {(1, k): Placed(Sphere(0.1), (k, 0, 0.05)) for k in range(3)}
    page = recorded([Scene({0: Placed(HalfSpace([0, 0, 1], 0))} | robot)], tmp_path / "few.html")
    panel(opened(browser, page, "#t=0"), "overlaps")
    assert len(rows(browser)) == 4
    assert browser.ask("document.querySelector('#time').hidden")  # there is one moment, and nothing over time


def test_a_filter_hides_small_and_shallow_overlaps_everywhere(browser, piled):
    panel(opened(browser, piled, "#t=0"), "overlaps")
    assert text(browser, "#by option") == "dm³ volume"
    before = browser.ask("document.querySelector('#chart').ariaLabel")
    whole = browser.picture()
    put(browser, "document.querySelector('#least')", "0.61")
    assert text(browser, "#list th") == "3 of 19 overlaps"
    assert text(browser, "#total") == "3 of 19 overlaps, 2.48 dm³"
    seen = browser.picture()
    assert 0 < coloured(seen, "pink") < 0.7 * coloured(whole, "pink")
    browser.press("t")
    browser.wait("document.querySelector('#chart').ariaLabel === 'volume in total, dm³, over time: up to 2.48'")
    browser.press("t")
    put(browser, "document.querySelector('#by')", "depth")
    put(browser, "document.querySelector('#least')", "19")
    assert text(browser, "#list th") == "2 of 19 overlaps"  # of 20 and of 26 mm
    browser.press("c")
    assert browser.ask("location.hash").endswith("&depth=0.019")
    put(browser, "document.querySelector('#least')", "")
    assert text(browser, "#list th") == "19 overlaps"
    browser.wait(f"document.querySelector('#chart').ariaLabel === {json.dumps(before)}")
    # A letter that is typed there is none of the page's keys.
    browser.ask("document.querySelector('#least').focus()")
    browser.press("w")
    assert not browser.ask("document.querySelector('#overlaps').hidden")
    browser.press("o")
    assert not browser.ask("document.querySelector('#overlaps').hidden")
    browser.ask("document.activeElement.blur()")


def test_the_largest_of_many_are_marked_and_labelled(browser, piled, tmp_path):
    opened(browser, piled, "#t=0")
    marked = coloured(scene(browser), "pink")
    assert not browser.ask("document.querySelector('#dull').hidden")
    labels = browser.ask("[...document.querySelectorAll('#tags span')].map(each => each.textContent)")
    assert 2 <= len(labels) <= 5 and labels[0] == "1.04 dm³"
    browser.ask("location.hash = '#t=0&volume=0.000281'")  # twelve are left of nineteen
    browser.wait("document.querySelector('#total').textContent.startsWith('12 of 19')")
    assert_allclose(coloured(scene(browser), "pink"), marked, rtol=0.1)
    assert browser.ask("document.querySelector('#dull').hidden")
    # A link that asks for the pair has it marked, too.
    browser.ask("location.hash = '#t=0&pair=body0,body1'")
    browser.wait("document.querySelector('#tags .picked')?.textContent === '40 cm³'")
    assert len(browser.ask("[...document.querySelectorAll('#tags span')].map(each => each.textContent)")) <= 6


def test_more_rows_than_can_be_read_are_counted(browser, tmp_path):
    balls = {1 + k: Placed(Sphere(0.1), (0.3 * (k % 15), 0.3 * (k // 15), 0.05)) for k in range(205)}
    page = recorded([Scene({0: Placed(HalfSpace([0, 0, 1], 0))} | balls)] * 2, tmp_path / "many.html")
    panel(opened(browser, page, "#t=0"), "overlaps")
    assert len(rows(browser)) == 200
    assert text(browser, "#more") == "and 5 more rows: the filter leaves the larger ones"
    chart = "document.querySelector('#chart').ariaLabel"
    assert ", the 200 largest of 205 pairs, over time" in browser.ask(chart)
    browser.press("t")
    browser.wait(f"!{chart}.includes('205')")


def test_the_chart_has_axes_with_units_for_volume_and_depth_of_pairs_and_of_all(browser, piled):
    opened(browser, piled, "#t=0")

    def chart():
        browser.picture()  # before which it is drawn
        return browser.ask("document.querySelector('#chart').ariaLabel"), browser.ask(
            "document.querySelector('#chart').scaleText"
        )

    def drawn():
        left, top, right, bottom = sides(browser, "#chart")
        return browser.picture()[top:bottom, left:right]

    label, scale = chart()
    assert label == "volume, dm³, over time: up to 1.04"
    assert scale[0] == "0" and float(scale[-1]) in (0.8, 1)
    linear = drawn()
    browser.click_on("#logarithmic")
    label, scale = chart()
    assert [float(b) / float(a) for a, b in pairwise(scale)] == pytest.approx([10] * (len(scale) - 1))
    assert (np.abs(drawn() - linear).max(axis=2) > 30).sum() > 300
    browser.press("g")
    browser.click_on("#in-total")
    assert chart()[0] == "volume in total, dm³, over time: up to 7.68"
    browser.press("d")
    assert chart()[0] == "depth, the deepest, mm, over time: up to 26"
    assert text(browser, "#in-total") == "deepest"
    browser.click_on("#per-pair")
    assert chart()[0] == "depth, mm, over time: up to 26"
    browser.click_on("#of-volume")
    pressed = "[...document.querySelectorAll('#bar [aria-pressed=true]')].map(each => each.id)"
    assert browser.ask(pressed) == ["of-volume", "per-pair", "linear"]
    # The slider's ends are those of the axis.
    left, _, right, _ = sides(browser, "#slider")
    chart_left, _, chart_right, _ = sides(browser, "#chart")
    assert (left + 8, right - 8) == (chart_left + 60, chart_right - 12)


def near(picture, color):
    """How many pixels have nearly this color."""
    return int((np.abs(picture.astype(int) - color).max(axis=2) < 40).sum())


def test_the_largest_pairs_have_a_colour_each_in_the_chart_and_in_its_legend(browser, tmp_path):
    """Here are ten pairs, of which eight have a colour. A click on the legend chooses a pair."""
    depths = [0.01 * (10 - k) for k in range(10)]
    balls = [{1 + k: Placed(Sphere(0.1), (0.3 * k, 0, 0.1 - depth * share)) for k, depth in enumerate(depths)}
             for share in (0.5, 1)]  # fmt: skip
    page = recorded([Scene({0: Placed(HalfSpace([0, 0, 1], 0))} | each) for each in balls], tmp_path / "ten.html")
    opened(browser, page, "#t=0")
    left, top, right, bottom = sides(browser, "#chart")
    drawn = browser.picture()[top:bottom, left:right]
    keys = "[...document.querySelectorAll('#caption .key')]"
    said = browser.ask(f"{keys}.map(key => key.textContent)")
    assert len(set(said)) == 9 and said[-1] == "others are grey" and all(" – " in pair for pair in said[:-1])
    hues = browser.ask(f"{keys}.slice(0, 8).map(key => getComputedStyle(key.firstChild).backgroundColor)")
    colors = [[int(part) for part in re.findall(r"\d+", hue)][:3] for hue in hues]
    assert len(set(hues)) == 8 and all(near(drawn, color) > 50 for color in colors)
    browser.ask(f"(window.third = {keys}[2]).onpointerenter()")
    assert (browser.picture()[top:bottom, left:right] != drawn).any()
    browser.ask("third.onpointerleave()")
    assert browser.ask(f"{keys}.length") == 9
    browser.ask("third.onclick()")
    assert text(browser, "#caption") == said[2]
    assert not browser.ask("document.querySelector('#numbers').hidden")
    browser.press("Escape")
    browser.press("t")
    browser.wait("document.querySelector('#caption').textContent === ''")


def test_a_chart_of_nothing_says_so(browser, tmp_path):
    page = recorded([hand_at(0.3), hand_at(0.4)], tmp_path / "apart.html")
    opened(browser, page, "#t=0")
    assert browser.ask("document.querySelector('#chart').ariaLabel") == "nothing is shared"
    browser.press("g")
    assert browser.ask("document.querySelector('#chart').ariaLabel") == "nothing is shared"
    browser.press("n")
    assert browser.ask("document.querySelector('#numbers').hidden")


def test_a_pair_that_is_apart_at_a_time_says_so(browser, reach):
    opened(browser, reach, "#t=0&pair=cup,arm/hand")
    assert "share nothing at this time" in text(browser, "#numbers")


def test_bodies_and_links_are_switched_in_a_list(browser, piled):
    panel(opened(browser, piled, "#t=0&from=1.5,-3,1&at=1.5,0,0"), "bodies")
    panel(browser, "bodies")
    names = text(browser, "#bodies-list").split("\n")
    assert names[:3] == ["body0", "body1", "body2"]

    def box(name):
        return f"document.querySelector('input[aria-label={json.dumps(name)}]')"

    everything = coloured(scene(browser), "green")
    browser.ask(f"{box('body0')}.click()")
    table_off = coloured(scene(browser), "green")
    assert table_off < 0.7 * everything
    browser.ask(f"{box('body20, link1')}.click()")
    link_off = coloured(scene(browser), "green")
    assert link_off < 0.98 * table_off
    assert browser.ask(f"[{box('body20')}.indeterminate, {box('body20')}.checked]") == [True, False]
    browser.ask("document.querySelector('#no-bodies').click()")
    assert coloured(scene(browser), "green") == 0
    assert coloured(scene(browser), "orange") > 0  # overlaps stay
    browser.ask("document.querySelector('#all-bodies').click()")
    assert coloured(scene(browser), "green") == everything
    assert not browser.ask(f"{box('body20')}.indeterminate")


def test_the_list_of_bodies_says_what_is_ground(browser, tmp_path):
    page = recorded([Scene({0: Placed(HalfSpace([0, 0, 1], 0)), 1: Placed(Sphere(0.1))})], tmp_path / "ground.html")
    panel(opened(browser, page, "#t=0"), "bodies")
    assert re.search(r"body0\s+ground\s+body1$", text(browser, "#bodies-list"))


def test_a_button_copies_the_link_to_this_moment(browser, piled):
    opened(browser, piled, "#t=1&from=3,-3,2&at=0.5,0,0&pair=body0,body16")
    seen = scene(browser)
    browser("Browser.grantPermissions", permissions=["clipboardReadWrite", "clipboardSanitizedWrite"])
    browser("Page.bringToFront")
    browser.click_on("#copy")
    browser.wait("document.querySelector('#copy').textContent === 'Copied'")
    assert browser.ask("document.querySelector('#said').textContent") == "the link is copied"
    link = browser.ask("navigator.clipboard.readText()")
    assert link == f"{piled.as_uri()}#t=1&from=3,-3,2&at=0.5,0,0&pair=body0%2Cbody16"
    browser.wait("document.querySelector('#copy').textContent === 'Link'")
    opened(browser, piled, "#t=0")
    browser.open(link, until="document.querySelector('#time output').textContent === '1.000 s'")
    panel(browser, None)
    browser.ask("document.querySelector('#legend').open = false")
    assert_allclose(scene(browser), seen, atol=8)
    # Not every browser lets a page copy.
    browser.ask("navigator.clipboard.writeText = () => Promise.reject(new Error('refused'))")
    browser.press("c")
    browser.wait("document.querySelector('#copy').textContent === 'See address'")
    assert browser.ask("document.querySelector('#said').textContent") == "the link is in the address bar"
    assert browser.ask("location.hash").startswith("#t=1&from=")


def test_every_key_is_listed_on_a_question_mark(browser, reach):
    opened(browser, reach, "#t=1&pair=cup,arm/hand")
    browser.press("?")
    assert browser.ask("document.querySelector('#keys').open")
    listed = browser.ask("[...document.querySelectorAll('#keys kbd')].map(each => each.textContent)")
    assert listed == [
        *("space", "←", "→", "Home", "End", "n", "p", "w", "esc", "o", "b", "l", "d", "t", "g", "c", "r", "?"),
        *("f", "F", "e", "E", "v", "V", "m"),
    ]
    browser.press("ArrowLeft")  # while it is open, keys are for it
    assert text(browser, "#time output") == "1.000 s"
    browser.ask("document.querySelector('#keys').close()")
    assert not browser.ask("document.querySelector('#numbers').hidden")
    for key, time in (("Home", "0.000 s"), ("End", "1.000 s"), ("ArrowLeft", "0.000 s"), ("ArrowRight", "1.000 s")):
        browser.press(key)
        assert text(browser, "#time output") == time
    for key, name in (("o", "overlaps"), ("b", "bodies"), ("l", "look")):
        browser.press(key)
        assert not browser.ask(f"document.querySelector('#{name}').hidden")
        browser.press(key)
        assert browser.ask(f"document.querySelector('#{name}').hidden")


def test_keys_go_from_the_largest_overlap_to_the_next(browser, piled):
    opened(browser, piled, "#t=0")
    shown = []
    for key in ("n", "n", "n", "p", "p", "p"):
        browser.press(key)
        shown.append(text(browser, "#numbers div").replace("×", "").strip())
    names = ["body0 – body20/link1", "body0 – body20/link0.1", "body0 – body16"]
    assert shown[:5] == [*names, *names[1::-1]]
    assert shown[5] == "body0 – body1"  # the smallest
    browser.press("Escape")


def test_the_legend_explains_pink_and_is_absent_for_custom_colours(browser, reach, tmp_path):
    opened(browser, reach)
    browser.ask("document.querySelector('#legend').open = true")
    said = text(browser, "#legend")
    for word in ("pink line", "pink arrow", "pink dot", "surface of the first", "surface of the second"):
        assert word in said
    assert "what two bodies share" not in said
    recording = Recording(overlaps=Look(front="#ff0000"))
    recording.add(hand_at(0.12), hand_at(0.12).contacts(), 0.0)
    opened(browser, recording.save(tmp_path / "red.html"), "#t=0")
    browser.ask("document.querySelector('#legend').open = true")
    said = text(browser, "#legend")
    assert "surface of" not in said and "pink line" in said and "what two bodies share" in said
    assert browser.ask("getComputedStyle(document.querySelector('#shared rect')).fill") == "rgb(255, 0, 0)"


def test_frames_with_names_are_shown_by_them(browser, tmp_path):
    recording = Recording()
    for time, (name, x) in enumerate((("as <b>recorded</b>", 0.12), ("today", 0.15))):
        recording.add(hand_at(x), hand_at(x).contacts(), float(time), name)
    browser.open(
        recording.save(tmp_path / "named.html").as_uri(),
        until="document.querySelector('#time output').textContent === 'as <b>recorded</b>'",
    )
    assert browser.ask("document.querySelector('#play').hidden && document.querySelector('#speed').hidden")
    browser.press(" ")
    browser.press("ArrowRight")
    assert text(browser, "#time output") == "today"
    assert browser.ask("document.querySelector('#slider').getAttribute('aria-valuetext')") == "today"
    assert browser.ask("document.querySelector('#chart').namesShown") == ["as <b>recorded</b>", "today"]


def test_the_chart_shows_only_the_names_that_fit(browser, tmp_path):
    recording = Recording()
    for k in range(40):
        x = 0.12 + 0.001 * k
        recording.add(hand_at(x), hand_at(x).contacts(), float(k), f"the pair of number {k}")
    browser.open(
        recording.save(tmp_path / "many.html").as_uri(),
        until="document.querySelector('#time output').textContent === 'the pair of number 0'",
    )
    shown = browser.ask("document.querySelector('#chart').namesShown")
    assert shown[0] == "the pair of number 0" and 2 < len(shown) < 12


@pytest.mark.parametrize(("width", "height"), [DESK, TABLET, PHONE])
def test_the_page_fits_a_desk_a_tablet_and_a_phone(browser, piled, sized, width, height):
    phone = width == PHONE[0]
    sized(width, height, touch=phone)
    browser.open(piled.as_uri(), until="document.querySelector('#time output').textContent === '0.000 s'")
    assert browser.ask(
        "document.documentElement.scrollWidth <= innerWidth && document.body.scrollHeight <= innerHeight"
    )
    assert browser.ask("document.querySelector('#overlaps').hidden") == phone
    assert browser.ask("document.querySelector('#legend').open") == (width == DESK[0])
    # The framed bodies are in sight and nothing covers them. The scene has most of the room.
    left, top, right, bottom = sides(browser, "#meshcat-pane")
    assert (right - left) * (bottom - top) > 0.4 * width * height
    canvas = sides(browser, "#meshcat-pane canvas")
    assert_allclose(canvas, [left, top, right, bottom], atol=1)
    green = browser.picture()[top:bottom, left:right]
    green = (green[..., 1] > green[..., 0] + 20) & (green[..., 1] > green[..., 2] + 20)
    assert green.sum() > 0.05 * green.size
    if not phone:
        return
    buttons = "[...document.querySelectorAll('button, select, summary, input')].filter(each => each.offsetParent)"
    assert (
        browser.ask(f"{buttons}.filter(each => each.getBoundingClientRect().height < 40).map(each => each.outerHTML)")
        == []
    )
    for name in ("overlaps", "bodies", "look"):
        browser.ask(f"document.querySelector('#show-{name}').click()")
        unfolded = "['overlaps', 'bodies', 'look'].filter(name => !document.getElementById(name).hidden)"
        assert browser.ask(unfolded) == [name]
        # A box is pressed by its label or in its cell, which are as high as a finger.
        pressed = (
            f"{buttons}.filter(each => each.closest('aside')).map(each => each.closest('label, td, summary') ?? each)"
        )
        assert browser.ask(f"{pressed}.filter(each => each.getBoundingClientRect().height < 40).length") == 0
        assert browser.ask("document.documentElement.scrollWidth <= innerWidth")
        left, top, right, bottom = sides(browser, "#meshcat-pane")
        assert bottom - top > 200
        assert_allclose(sides(browser, "#meshcat-pane canvas"), [left, top, right, bottom], atol=1)


def test_every_control_has_a_name_and_shows_its_focus(browser, piled):
    panel(opened(browser, piled, "#t=0&pair=body0,body16"), "look")
    unnamed = (
        "[...document.querySelectorAll('button, input, select, canvas[role]')].filter(each => "
        "!(each.ariaLabel || each.title || each.textContent.trim() || each.labels?.[0]?.textContent.trim()))"
        ".map(each => each.outerHTML)"
    )
    assert browser.ask(unnamed) == []
    browser.ask("document.querySelector('#show-overlaps').focus()")
    browser("Input.dispatchKeyEvent", type="keyDown", key="Tab", code="Tab", windowsVirtualKeyCode=9)
    assert browser.ask("document.activeElement.id") == "show-bodies"
    assert browser.ask("getComputedStyle(document.activeElement).outlineStyle") == "solid"


def test_framed_bodies_stay_visible_in_a_narrow_window(browser, reach, sized):
    sized(1000, 800)
    browser.open(reach.as_uri(), until="document.querySelector('#time output').textContent === '1.000 s'")
    panel(browser, None)
    wide = coloured(scene(browser), "green") / scene(browser).size
    browser("Emulation.setDeviceMetricsOverride", width=500, height=900, deviceScaleFactor=1, mobile=False)
    browser.wait("document.querySelector('#meshcat-pane').clientWidth === 500")
    panel(browser, None)
    narrow = scene(browser)
    # From farther off, so that both bodies are seen whole: nothing green at the sides.
    assert coloured(narrow[:, :2], "green") == coloured(narrow[:, -2:], "green") == 0
    assert coloured(narrow, "green") / narrow.size > 0.2 * wide


def test_the_page_leads_to_pairs_that_passed_through_each_other(browser, tmp_path):
    recording = Recording()
    through, stopped = (FirstOverlap(0, -1, 0, 2, -1, 0, "impact", 0.5, None, None, apart) for apart in (True, False))
    for frame, first in enumerate([(), (through, through), (stopped,), (), (through,)]):
        bodies = pile(lift=0.005 * frame)
        recording.add(bodies, bodies.contacts(), time=float(frame), first=first)
    opened(browser, recording.save(tmp_path / "through.html"))
    assert text(browser, "#tunnelled") == "2 tunnelled"
    told = browser.ask("document.getElementById('tunnelled').title").splitlines()
    assert [line.partition(":")[0] for line in told] == ["1.000 s", "4.000 s"]
    assert bodies.names[0, -1] in told[0] and bodies.names[2, -1] in told[0]
    for time in (4, 1, 4):
        browser.ask("document.getElementById('tunnelled').click()")
        browser.wait(f"document.querySelector('#time output').textContent === '{time:.3f} s'")
    opened(browser, recorded([pile()], tmp_path / "none.html"), "#t=0")
    assert browser.ask("document.getElementById('tunnelled').hidden")


def test_the_page_counts_and_names_what_is_not_modelled(browser, tmp_path):
    first, second = pile(), pile(lift=0.005)
    second.skipped = [Skipped(30, -1, "net/base", "it is soft")]
    opened(browser, recorded([first, second], tmp_path / "lost.html"))
    assert text(browser, "#left-out") == "1 not modelled"
    assert browser.ask("document.getElementById('left-out').title") == "net/base, it is soft"
    opened(browser, recorded([first], tmp_path / "whole.html"), "#t=0")
    assert browser.ask("document.getElementById('left-out').hidden")
