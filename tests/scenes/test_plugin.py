"""`pytest scenes` as a user runs it: what is collected, what passes, and what is said of a scene that has moved."""

import re
import subprocess
import sys
from xml.etree import ElementTree

import pytest

# Loaded here, as pytester unloads what was loaded during its runs, and extension modules cannot be loaded twice.
from overlapper.scenes import check
from overlapper.verdicts import before_after

pytest_plugins = ["pytester"]

SLIDE = '''
"""A cube reaches into another and moves on by a centimetre a step."""
import pybullet as p

STEPS = 4


def build(client):
    cube = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.5] * 3, physicsClientId=client)
    p.createMultiBody(0, cube, physicsClientId=client)
    slider = p.createMultiBody(0, cube, basePosition=[0.8, 0, 0], physicsClientId=client)
    p.createMultiBody(1, cube, basePosition=[0, 0, 9], physicsClientId=client)

    def step(i):
        p.resetBasePositionAndOrientation(slider, [0.8 + 0.01 * i, 0, 0], [0, 0, 0, 1], physicsClientId=client)

    return step
'''


@pytest.fixture
def scenes(pytester):
    """Runs pytest on a folder `scenes` with the scene `slide`; `scenes.edit` changes it."""
    folder = pytester.mkdir("scenes")
    (folder / "slide.py").write_text(SLIDE)

    def run(*arguments):
        return pytester.runpytest_inprocess("scenes", "-p", "no:cacheprovider", *arguments)

    run.folder = folder
    run.edit = lambda old, new: (folder / "slide.py").write_text(SLIDE.replace(old, new))
    return run


def test_the_modules_that_the_plugin_needs_are_loaded_only_once():
    assert check.hold and before_after.save


def test_a_new_scene_is_written_fails_once_and_passes_from_then_on(scenes):
    new = scenes()
    new.assert_outcomes(failed=1)
    new.stdout.fnmatch_lines(
        ["the scene slide is new", "written: *expected/slide.csv", "look at the file and commit it*"]
    )
    assert (scenes.folder / "expected" / "slide.csv").is_file()
    scenes().assert_outcomes(passed=1)


def test_a_moved_scene_says_what_moved_and_shows_before_and_after(scenes, pytester):
    scenes()
    scenes.edit("0.01 * i", "0.02 * i")
    moved = scenes("--junitxml=report.xml", "--overlapper-out=pages")
    moved.assert_outcomes(failed=1)
    moved.stdout.fnmatch_lines(
        [
            "the scene slide has moved",
            "geometry  as recorded*",
            "shapes    as recorded*",
            "dynamics  3 moved*",
            "    step 4, *(1/-1/0): position_m is (0.86, 0, 0), recorded as (0.83, 0, 0): "
            "off by 0.03 where 0.0001 is allowed, 300 times its budget",
            "overlaps  *",
            "    step 4, *(0/-1/0) and *(1/-1/0): volume_m3 is 0.14, recorded as 0.17: off by 0.03, 17.6 %",
            "before and after: *pages/slide.moved.html",
            "to accept the change: pytest --overlapper-record scenes/slide.py",
        ]
    )
    page = (pytester.path / "pages" / "slide.moved.html").read_text(encoding="utf-8")
    assert "Before: step 4 as recorded" in page and "<td>300</td>" in page
    case = ElementTree.parse(pytester.path / "report.xml").find(".//testcase")
    assert case.find("failure") is not None
    assert {each.get("name"): each.get("value") for each in case.iter("property")} == {
        "geometry": "as recorded",
        "shapes": "as recorded",
        "dynamics": "moved",
        "before and after": str(pytester.path / "pages" / "slide.moved.html"),
    }

    scenes("--overlapper-record").assert_outcomes(passed=1)
    scenes("--overlapper-out=pages").assert_outcomes(passed=1)
    assert not (pytester.path / "pages" / "slide.moved.html").exists()


def test_expected_files_are_rewritten_on_demand(scenes):
    recorded = scenes("--overlapper-record")
    recorded.assert_outcomes(passed=1)
    recorded.stdout.fnmatch_lines(["slide: written: *slide.csv"])


def test_a_loose_budget_is_reported_of_a_scene_that_passes(scenes):
    scenes()
    expected = scenes.folder / "expected" / "slide.csv"
    expected.write_text(re.sub(r"volume: relative \S+", "volume: relative 0.5", expected.read_text()))
    run = scenes()
    run.assert_outcomes(passed=1)
    run.stdout.fnmatch_lines(["slide: note: the budget of volume is * times as large as needed"])


def test_a_scene_that_cannot_be_run_fails_with_one_sentence(scenes):
    scenes.edit("STEPS = 4", "STEPS = 4 / 0")
    run = scenes()
    run.assert_outcomes(failed=1)
    run.stdout.fnmatch_lines(["the scene *slide.py cannot be loaded at line 5: ZeroDivisionError: division by zero"])
    run.stdout.no_fnmatch_line("*check.py*")


def test_scenes_are_spread_over_processes(scenes, pytester):
    (scenes.folder / "other.py").write_text(SLIDE)
    scenes("--overlapper-record")
    scenes.edit("0.01 * i", "0.02 * i")
    run = pytester.runpytest_subprocess("scenes", "-n", "2")
    run.assert_outcomes(passed=1, failed=1)
    run.stdout.fnmatch_lines(["dynamics  3 moved*"])


def test_only_scenes_are_collected(scenes, pytester):
    pytester.makepyfile(
        test_strings=f"'''Has a scene in it.'''\nSCENE = '''{SLIDE.replace(chr(34), '')}'''\n\ndef test_it(): pass",
        no_docstring="STEPS = 3\ndef build(client): pass",
        no_steps="'''Builds.'''\ndef build(client): pass\nsteps = '''\nSTEPS = 3\n'''",
        builder="'''Builds something else.'''\nSTEPS = 3\ndef build(target): pass",
    )
    collected = pytester.runpytest_inprocess("--collect-only", "-q")
    collected.stdout.fnmatch_lines(["scenes/slide.py::slide", "test_strings.py::test_it", "", "2 tests collected*"])


def test_a_scene_with_a_syntax_error_is_not_overlooked(scenes):
    scenes.edit("return step", "return step +")
    run = scenes()
    run.assert_outcomes(failed=1)
    run.stdout.fnmatch_lines(["the scene *slide.py cannot be loaded at line 17: SyntaxError*"])


def test_other_runs_import_nothing_for_the_plugin(pytester):
    pytester.makepyfile(
        """
        import sys

        def test_nothing_heavy_is_loaded():
            heavy = {"numpy", "pybullet", "meshcat", "overlapper.scenes.scene", "overlapper.scenes.check"}
            assert not heavy & set(sys.modules)
        """
    )
    # With an editable install, pytest warns that a module is imported already. The warning is harmless.
    quiet = ["-W", "ignore:Module already imported:pytest.PytestAssertRewriteWarning"]
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *quiet, pytester.path]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stdout
    assert "overlapper" not in done.stdout


def test_an_editable_install_gives_no_warning_of_pytest(tmp_path):
    (tmp_path / "test_nothing.py").write_text("def test_nothing(): pass\n")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_nothing.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert (done.returncode, "warning" in done.stdout) == (0, False), done.stdout
