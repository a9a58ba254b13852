"""The page of a scene that has moved shows the worst step twice, as it was and as it is, in headless Chromium."""

import asyncio
import json
import math
import re
import shutil
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest
from browser import Browser
from tornado.websocket import websocket_connect

from overlapper import verdicts
from overlapper.scenes import check
from overlapper.scenes.check import examined, record
from overlapper.scenes.scene import load_scene
from overlapper.verdicts import before_after
from overlapper.verdicts.comparison import Move
from overlapper.verdicts.expected import read_expected

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)

CUBES = '''
"""A cube reaches into a table that is 20 cm thick."""
import pybullet as p

STEPS = 2


def build(client):
    table = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.5, 0.5, 0.1], physicsClientId=client)
    p.createMultiBody(0, table, physicsClientId=client)
    cube = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.1] * 3, physicsClientId=client)
    p.createMultiBody(0, cube, basePosition=[0, 0, 0.15], physicsClientId=client)
'''


@pytest.fixture
def verdict(tmp_path):
    path = tmp_path / "cubes.py"
    path.write_text(CUBES)
    record(load_scene(path))
    path.write_text(CUBES.replace("0.15]", "0.17]"))
    scene = load_scene(path)
    return examined(scene, read_expected(scene.expected))


def test_the_page_tells_the_verdicts_and_holds_both_frames(verdict, tmp_path):
    page = before_after.save(verdict, "cubes <of mine>", tmp_path / "made" / "page.html")
    text = page.read_text(encoding="utf-8")
    assert "<h1>cubes &lt;of mine&gt; has moved</h1>" in text
    assert "<td>(0, 0, 0.15)</td><td>(0, 0, 0.17)</td><td>0.02</td><td>0.0001</td><td>200</td>" in text
    assert re.search(r'(src|href)="http', text) is None
    assert len(text) < 1_000_000


@pytest.mark.parametrize(
    ("recorded", "today", "cells"),
    [
        ("0.15", "0.35", "<td>overlapping</td><td>not there</td>"),
        ("0.35", "0.15", "<td>not there</td><td>overlapping</td>"),
    ],
)
def test_a_pair_that_comes_or_goes_has_a_line_without_figures(recorded, today, cells, tmp_path):
    path = tmp_path / "cubes.py"
    path.write_text(CUBES.replace("0.15]", f"{recorded}]"))
    record(load_scene(path))
    path.write_text(CUBES.replace("0.15]", f"{today}]"))
    outcome = check.hold(path, tmp_path / "pages" / "cubes.moved.html")
    assert outcome.word == "moved"
    assert f"status is {'not there' if today == '0.35' else 'overlapping'}, recorded as" in "\n".join(outcome.lines)
    assert f"<td>status</td>{cells}<td></td><td></td><td></td></tr>" in outcome.page.read_text(encoding="utf-8")


def test_without_meshcat_there_is_no_page_and_the_verdict_says_why(tmp_path, monkeypatch):
    path = tmp_path / "cubes.py"
    path.write_text(CUBES)
    record(load_scene(path))
    path.write_text(CUBES.replace("0.15]", "0.17]"))
    monkeypatch.delattr(verdicts, "before_after")
    monkeypatch.setitem(sys.modules, "overlapper.verdicts.before_after", None)
    outcome = check.hold(path, tmp_path / "pages" / "cubes.moved.html")
    assert (outcome.word, outcome.page) == ("moved", None)
    cause = "import of overlapper.verdicts.before_after halted"
    assert outcome.lines[-1].startswith(f"no page of before and after: {cause}")


def test_a_scene_that_ends_before_a_recorded_step_has_no_second_frame(tmp_path):
    path = tmp_path / "cubes.py"
    path.write_text(CUBES)
    record(load_scene(path))
    path.write_text(CUBES.replace("STEPS = 2", "STEPS = 1"))
    outcome = check.hold(path, tmp_path / "pages" / "cubes.moved.html")
    assert "    step 2, the scene: last step is 1, recorded as 2" in outcome.lines
    assert "<td>the scene</td><td>last step</td><td>2</td><td>1</td>" in outcome.page.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("figures", "cells", "sentence"),
    [
        ((), ("", "", ""), "a: depth_m is 2, recorded as 1"),
        ((1.0, 0.5, 2.0), ("1", "0.5", "2"), ": off by 1 where 0.5 is allowed, 2 times its budget"),
        ((1.0, 0.0, math.inf), ("1", "0", "inf"), ": off by 1 where 0 is allowed"),
        ((1.0, math.nan, 100.0), ("1", "", "100 %"), ": off by 1, 100 %"),
        ((math.inf, math.nan, math.inf), ("", "", ""), "a: depth_m is 2, recorded as 1"),
        ((math.nan, 0.5, math.nan), ("", "", ""), "a: depth_m is 2, recorded as 1"),
    ],
)
def test_a_move_is_described_by_its_known_figures(figures, cells, sentence):
    move = Move(3, "a", "depth_m", "1", "2", *figures)
    assert move.cells() == ("3", "a", "depth_m", "1", "2", *cells) and len(cells) + 5 == len(Move.HEADS)
    assert str(move).endswith(sentence)


@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not to be had here")
def test_one_pane_shows_what_was_recorded_and_the_other_what_is_today(verdict, tmp_path):
    page = before_after.save(verdict, "cubes", tmp_path / "page.html")
    panes = asyncio.run(asyncio.wait_for(texts_in_frames(page, tmp_path / "profile", until="step 1 "), timeout=120))
    # 20 cm by 20 cm by 5 cm, and by 3 cm. The moments have names, as they are none of one run.
    assert [re.search(r"\S+ dm³", pane)[0] for pane in panes] == ["2 dm³", "1.2 dm³"]
    assert [re.search("step 1 .*", pane)[0] for pane in panes] == ["step 1 as recorded", "step 1 today"]


@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not to be had here")
def test_the_panes_are_side_by_side_on_a_desk_and_one_below_the_other_on_a_phone(verdict, tmp_path):
    page = before_after.save(verdict, "cubes", tmp_path / "page.html")
    browser = Browser(tmp_path / "profile", (1200, 800))
    try:
        browser.open(page.as_uri(), until="document.querySelectorAll('iframe').length === 2")
        boxes = "[...document.querySelectorAll('iframe')].map(each => each.getBoundingClientRect())"
        assert browser.ask(f"(([a, b]) => a.top === b.top && a.right <= b.left)({boxes})")
        browser("Emulation.setDeviceMetricsOverride", width=390, height=844, deviceScaleFactor=1, mobile=True)
        browser.wait("innerWidth === 390")
        assert browser.ask(f"(([a, b]) => a.bottom <= b.top && a.left === b.left && a.height > 700)({boxes})")
    finally:
        browser.close()


async def texts_in_frames(page: Path, profile: Path, until: str) -> list[str]:
    """The text of both frames, once they have the words awaited; through DevTools, to which a frame is a target."""
    options = ["--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--no-first-run"]
    options += ["--enable-unsafe-swiftshader", "--disable-background-networking", "--remote-debugging-port=0"]
    command = [CHROMIUM, *options, f"--user-data-dir={profile}", page.as_uri()]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as browser:
        try:
            host = next(filter(None, (re.search(r"listening on ws://([^/]+)", line) for line in browser.stderr)))[1]
            frames: list[dict[str, str]] = []
            while len(frames) < 2:
                await asyncio.sleep(0.1)
                with urllib.request.urlopen(f"http://{host}/json", timeout=60) as answer:
                    frames = [each for each in json.load(answer) if each["type"] == "iframe"]
            frames.sort(key=lambda frame: frame["url"])
            return [await text_in(frame["webSocketDebuggerUrl"], until) for frame in frames]
        finally:
            browser.kill()


async def text_in(frame: str, until: str) -> str:
    connection = await websocket_connect(frame)
    evaluate = {"id": 1, "method": "Runtime.evaluate", "params": {"expression": "document.body.innerText"}}
    text = ""
    while until not in text:
        await asyncio.sleep(0.1)
        await connection.write_message(json.dumps(evaluate))
        text = json.loads(await connection.read_message())["result"]["result"].get("value", "")
    connection.close()
    return text
