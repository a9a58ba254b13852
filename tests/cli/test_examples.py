"""The examples run as a user runs them, stay short, and print true figures."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from overlapper import read_hull

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def run(tmp_path):
    """Runs an example in an empty folder; returns what it prints."""

    def run(name):
        command = [sys.executable, EXAMPLES / name]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


def numbers(pattern, text):
    """The groups of every match, as floats."""
    return [tuple(map(float, match if isinstance(match, tuple) else (match,))) for match in re.findall(pattern, text)]


def test_every_example_is_short_says_what_it_shows_and_is_tested():
    tests = Path(__file__).read_text(encoding="utf-8")
    for example in sorted(EXAMPLES.glob("*.py")):
        text = example.read_text(encoding="utf-8")
        assert len(text.splitlines()) < 40, example.name
        assert text.startswith('"""'), example.name
        assert f'run("{example.name}")' in tests, f"{example.name} has no test"


def test_two_boxes_share_a_box(run):
    text = run("two_boxes.py")
    assert numbers(r"volume +([\d.]+) m³", text) == [(0.25 * 0.5 * 0.75,)]
    assert "centroid  [0.375 0.25  0.125] m" in text
    assert "depth     0.250000 m, along the normal [-1.  0.  0.]" in text
    assert "moved     separated, 0.250 mm between them" in text


def test_many_pairs_are_all_measured_and_their_forces_cancel(run):
    text = run("many_pairs.py")
    (first, volume), (second, volume_after) = numbers(
        r"moved: ([\d,.]+) pairs share ([\d.]+) m³", text.replace(",", "")
    )
    assert first > 1000 and abs(second - first) < 30 and 0 < abs(volume_after - volume) < 0.01 * volume
    ((deepest,),) = numbers(r"deepest: \d+ and \d+, ([\d.]+) m", text)
    assert 0.05 < deepest < 0.2  # the largest half extent is 0.1 m
    ((largest, remains),) = numbers(r"largest force ([\d.e+-]+) N, sum ([\d.e+-]+) N", text)
    assert largest > 1e3 and remains < 1e-12 * largest * 300


def test_the_loop_ends_with_every_box_on_the_one_below(run):
    text = run("pybullet_loop.py")
    assert len(re.findall(r"^\d\.\d s: ", text, re.MULTILINE)) == 11
    assert text.startswith("0.0 s: 0 pairs")
    resting = re.findall(r"bodies (\d) and (\d): ([\d.]+) mm deep, ([\d.]+) mm³, normal on \d \[(.*)\]", text)
    assert [(int(a), int(b)) for a, b, *_ in resting] == [(i, i + 1) for i in range(5)]
    for *_, depth, volume, normal in resting:
        assert 0.0 < float(depth) < 1.0
        assert float(volume) <= 200 * 200 * float(depth) * 1.01
        assert float(normal.split()[2]) == pytest.approx(-1.0, abs=1e-3)
    assert "6 bodies, 6 of 6 shapes read" in text


def test_both_fingers_penetrate_as_deep_as_the_gripper_closes(run):
    rows = numbers(r"finger at ([\d.]+) mm: ([\d.]+) mm deep, (\d+) mm³, on (\d+) mm²", run("grasp_depth.py"))
    assert len(rows) == 2
    for position, depth, volume, area in rows:
        # Half the cube, less where the finger is; its pad stands out by 0.13 mm.
        assert depth == pytest.approx(20.0 - position + 0.13, abs=0.02)
        assert 0.5 < depth < 5.0
        assert 0.5 * area * depth < volume <= area * depth * 1.01


def test_the_ious_are_the_exact_ones(run):
    *exact, car = [value for (value,) in numbers(r"([01]\.\d{9})", run("iou_of_boxes.py"))]
    assert exact == [1.0, pytest.approx(1 / 3, abs=1e-9), pytest.approx(0.5**0.5, abs=1e-9), 0.0]
    # The car and its guess are of the same height, so counting points of the ground plan measures them.
    x, y = np.meshgrid((np.arange(2000) + 0.5) / 500, (np.arange(1000) + 0.5) / 500)
    u, v = (x - 0.2) * np.cos(0.1) + (y - 0.1) * np.sin(0.1), (y - 0.1) * np.cos(0.1) - (x - 0.2) * np.sin(0.1)
    common = 8.0 * ((u > 0) & (u < 4) & (v > 0) & (v < 2)).mean()
    assert car == pytest.approx(common / (16.0 - common), abs=1e-4)


def test_the_crate_floats_as_archimedes_says(run):
    text = run("floating_crate.py")
    ((draught, expected),) = numbers(r"draught ([\d.]+) m, by Archimedes ([\d.]+) m", text)
    assert expected == pytest.approx(0.6 * 0.4)
    assert draught == pytest.approx(expected, abs=2e-4)
    shares = [share for (share,) in numbers(r"([\d.]+)% of the crate", text)]
    assert shares[0] == 0.0 and shares[-1] == pytest.approx(60.0, abs=0.05)


def test_the_film_is_one_html_file_with_overlaps(run, tmp_path):
    text = run("record_scene.py")
    ((deepest,),) = numbers(r"deepest overlap ([\d.]+) mm", text)
    assert 1.0 < deepest < 50.0
    film = Path(text.split("open ")[1].strip())
    assert film.parent == tmp_path.resolve()
    page = film.read_text(encoding="utf-8")
    assert "<html" in page and len(page) > 500_000
    assert re.search(r'<script[^>]+src="http', page) is None


def test_fcl_is_asked_and_its_crash_is_survived(run):
    text = run("ask_fcl.py")
    verdicts = re.findall(r"^(\S.*): (agree|disagree|crashed)$", text, re.MULTILINE)
    assert verdicts == [
        ("cubes", "agree"),
        ("ball and cylinder, apart", "agree"),
        ("specks of 0.1 mm", "disagree"),
        ("cubes, edge on edge", "crashed"),
    ]
    assert "by us -1e-05 m (overlapping), exactly -1e-05 m" in text and "so ours is nearer" in text


def test_polytopes_of_a_database_share_less_than_each_of_them(run, tmp_path):
    text = run("polytopes_from_a_database.py")
    volumes = [volume for _, volume in numbers(r"polytope (\d): \d+ corners, ([\d.]+) m³", text)]
    ((common,),) = numbers(r"all share +([\d.]+) m³", text)
    assert len(volumes) == 5 and 0.0 < common < min(volumes)
    assert read_hull(tmp_path / "common.stl").volume == pytest.approx(common, rel=1e-5)


def test_links_of_a_chain_share_less_than_their_hulls(run, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    text = run("chain_links.py")
    rings = numbers(r"\S+: (\d+) parts, ([\d.]+) cm³, mesh ([\d.]+) cm³", text)
    assert len(rings) == 2
    for parts, volume, mesh in rings:
        assert parts > 4
        assert mesh == pytest.approx(568.9)
        assert mesh < volume < 1.05 * mesh
    ((whole, error),) = numbers(r"rings +([\d.]+) cm³ ± (\S+),", text)
    ((by_parts, pairs),) = numbers(r"by parts +([\d.]+) cm³ in (\d+) pairs", text)
    ((hulls,),) = [numbers(r"hulls +([\d.]+) cm³", text)]
    # The meshes themselves share 16.6 cm³.
    assert 16.6 < whole < by_parts + 1e-3 < hulls[0] / 4
    assert pairs > 1 and error < 1e-9
    assert (tmp_path / "chain_links.html").is_file()


def test_the_example_workflow_guards_a_repository(tmp_path):
    repository = shutil.copytree(EXAMPLES / "ci", tmp_path / "mine", ignore=shutil.ignore_patterns("out"))
    workflow = (repository / ".github" / "workflows" / "scenes.yml").read_text(encoding="utf-8")
    (command,) = re.findall(r"- run: (pytest .*)", workflow)
    (install,) = re.findall(r"- run: (pip .*)", workflow)
    assert f"\n{install}\n" in (repository / "README.md").read_text(encoding="utf-8")  # which .ci/run follows

    def guard():
        python = [sys.executable, "-m", *command.split(), "-p", "no:cacheprovider"]
        return subprocess.run(python, cwd=repository, capture_output=True, text=True, timeout=120)

    as_it_is = guard()
    assert as_it_is.returncode == 0, as_it_is.stdout
    assert "2 passed" in as_it_is.stdout
    model = repository / "models" / "drawer.urdf"
    model.write_text(model.read_text(encoding="utf-8").replace("0.5 0.396 0.015", "0.5 0.398 0.015"), encoding="utf-8")
    thicker = guard()
    assert thicker.returncode == 1
    assert "1 failed, 1 passed" in thicker.stdout
    assert "drawer" in thicker.stdout and "volume_m3" in thicker.stdout
    assert 'failures="1"' in (repository / "out" / "scenes.xml").read_text(encoding="utf-8")
    assert (repository / "out" / "drawer.moved.html").is_file()


def test_poses_free_of_self_collision_are_those_of_pybullet(run):
    text = run("self_collision.py")
    ((free, same),) = numbers(r"^(\d+) of 100 poses are free, and pybullet says the same of (\d+)", text)
    assert 0 < free < 100 and same == 100
    ((deepest,),) = numbers(r"deepest: lbr_iiwa/\w+ and lbr_iiwa/\w+, ([\d.]+) mm", text)
    assert deepest > 10


def test_fingers_squeeze_as_hard_as_they_are_told_and_carry_what_they_hold(run):
    text = run("grasp_force.py")
    fingers = numbers(r"finger \d+: squeezes with ([\d.]+) N, carries ([\d.]+) N", text)
    assert len(fingers) == 2
    assert [squeeze for squeeze, _ in fingers] == pytest.approx([20, 20], abs=0.05)
    assert sum(carried for _, carried in fingers) == pytest.approx(0.5 * 9.81, abs=2e-3)
    ((together, weight, slip),) = numbers(r"carry ([\d.]+) N of ([\d.]+) N; slip (\S+) m/s", text)
    assert together == pytest.approx(weight, abs=1e-3) and slip < 1e-8


def test_a_box_slips_at_the_angle_of_its_friction(run):
    ((degrees, friction, told),) = numbers(
        r"slips at ([\d.]+)°: friction ([\d.]+), and it was told ([\d.]+)", run("friction_from_incline.py")
    )
    assert told == 0.5 and 0 < friction - told < 1e-3
    assert np.tan(np.radians(degrees)) == pytest.approx(friction, abs=2e-4)


def test_two_feet_press_as_hard_as_what_stands_on_them(run, tmp_path):
    text = run("foot_pressure.py")
    feet = numbers(r"foot \d: ([\d.]+) N at y = ([\d.-]+) mm, from (\d+) to (\d+) Pa", text)
    assert len(feet) == 2
    for force, at, least, most in feet:
        # 5 cm by 20 cm, from 5 cm behind to 15 cm before the joint: the middle is at 5 cm.
        assert force == pytest.approx(90.02 * 9.81 / 2, rel=5e-3)
        assert (least + most) / 2 * 0.05 * 0.2 == pytest.approx(force, rel=0.01)
        assert 30 < at < 40 and 2 * least < most
    ((together,),) = numbers(r"together ([\d.]+) N", text)
    assert together == pytest.approx(90.02 * 9.81, rel=5e-3)
    assert (tmp_path / "foot_pressure.png").read_bytes().startswith(b"\x89PNG")


def test_the_pad_of_a_finger_feels_the_grip(run, tmp_path):
    ((felt, outside),) = numbers(r"felt ([\d.]+) N, outside ([\d.]+) N", run("tactile_image.py"))
    # Two motors of 20 N. Both fingers together carry the bar of 0.3 kg.
    assert felt + outside == pytest.approx(20, abs=0.2) and outside < 0.5
    assert (tmp_path / "tactile_image.png").read_bytes().startswith(b"\x89PNG")


def test_boxes_are_fitted_by_gradients(run):
    ratios = [value for (value,) in numbers(r"mean IoU ([01]\.\d+)", run("fit_boxes.py"))]
    assert ratios[0] < 0.6 and ratios[-1] > 0.999 and ratios == sorted(ratios)


def test_boxes_fall_into_a_bin_without_overlap(run):
    found = numbers(r"([\d.]+) cm³ wrong, mean height ([\d.]+) m", run("pack_a_bin.py"))
    assert found[0][0] > 100 and found[-1][0] == 0 and 0.1 < found[-1][1] < 0.25


def test_a_gripper_touches_with_a_given_volume(run):
    found = numbers(r"left +([\d.]+) mm³, ([\d.]+) mm deep; right +([\d.]+) mm³, ([\d.]+) mm", run("gentle_grip.py"))
    assert max(found[0][::2]) > 100 and found[-1][::2] == (20, 20) and max(found[-1][1::2]) < 1
    off = [max(abs(volume / 20 - 1) for volume in row[::2]) for row in found]
    assert off[-2] < 10 * off[-4] ** 2 < 0.1  # the error is squared in each step
