"""The fault of a broken scene is one sentence, whatever the scene does; a plain script is not run."""

import pytest

from overlapper.scenes.check import pages_of
from overlapper.scenes.parameters import value_of
from overlapper.scenes.run import run
from overlapper.scenes.scene import SceneError, load_scene

HEAD = '"""A box."""\nimport pybullet as p\nSTEPS = 2\n'

BROKEN = {
    "def build(client):\n    p.disconnect(client)": r"cannot be measured: physicsClientId \d+ is not connected to .*",
    "def build(client):\n    return lambda i: p.disconnect(client)": "cannot be read: its client is disconnected",
    "CONTACT = 'volumetric'\ndef build(client):\n    return lambda i: p.disconnect(client)": (
        r"cannot be measured: physicsClientId \d+ is not connected to a physics server"
    ),
    "PAIRS = [('a', 'b')]\ndef build(client):\n    pass": (
        "cannot be measured: pairs names 'a', which is not a body or link in the simulation"
    ),
    "class Mute(Exception):\n    def __str__(self):\n        raise ValueError\ndef build(client):\n    raise Mute": (
        "cannot be built at line 8: Mute"
    ),
    "def build(client):\n    raise ValueError('x' * 5_000_000)": (
        r"cannot be built at line 5: ValueError: x{250} \.\.\. \(4,999,500 characters left out\) \.\.\. x{250}"
    ),
    "def build(client):\n    raise ValueError('no\\nmore')": "cannot be built at line 5: ValueError: no",
}


@pytest.mark.parametrize("body", BROKEN)
def test_whatever_a_scene_does_is_one_sentence(body, tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(HEAD + body)
    with pytest.raises(SceneError, match=rf"^the scene {path} {BROKEN[body]}$"):
        [*run(load_scene(path))]


def test_a_plain_script_is_not_run_and_is_sent_to_watch(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text("raise RuntimeError('it runs')")
    sentence = rf"^{path} is not a scene, because it has no STEPS: overlapper watch {path} runs it as a script$"
    with pytest.raises(SceneError, match=sentence):
        load_scene(path)
    path.write_text("from overlapper.scenes.scene import *\n")
    with pytest.raises(SceneError, match="must have STEPS"):
        load_scene(path)


def test_a_parameter_that_is_no_text_is_refused():
    assert value_of("name", "häßlich", "") == "häßlich"
    with pytest.raises(ValueError, match=r"^name must be text in UTF-8, not 'mesh\\udcff'$"):
        value_of("name", "mesh\udcff", "")


def test_pages_of_scenes_of_one_name_have_the_names_of_their_folders(tmp_path):
    names = ["a/x/one.py", "b/x/one.py", "b/y/one.py", "two.py"]
    pages = pages_of([tmp_path / name for name in names], tmp_path)
    assert [page.name for page in pages.values()] == [
        *("a-x-one.moved.html", "b-x-one.moved.html", "y-one.moved.html", "two.moved.html")
    ]
    assert pages_of([tmp_path / "one.py"] * 2, tmp_path) == {tmp_path / "one.py": tmp_path / "one.moved.html"}
