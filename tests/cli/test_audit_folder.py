"""`overlapper audit FOLDER`: models that load, closed meshes, skipped shapes, and self-overlaps at rest."""

import csv
import json
import subprocess
import sys

import pytest
import trimesh
from command import overlapper
from in_mm import CUBE, L_SHAPE
from robots import turntable

from overlapper import Hull, write_mesh
from overlapper.audit.assets import read_asset
from overlapper.cli.audit import audit as command
from overlapper.cli.refusals import Refused
from overlapper.simulation.settings import Modelling

# Makes the convex hull of all, in the place of CoACD.
WRAP = """
def set_log_level(level): pass
class Mesh:
    def __init__(self, vertices, indices): self.vertices = vertices
def run_coacd(mesh, threshold):
    return [[mesh.vertices, None]]
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A cube, an open box, an L, two boxes in each other, no mesh, a robot, and what is no model."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "fake").mkdir()
    (tmp_path / "fake" / "coacd.py").write_text(WRAP)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "fake"))
    assets = tmp_path / "assets"
    (assets / "robots").mkdir(parents=True)
    write_mesh(assets / "cube.stl", Hull(CUBE))
    box = trimesh.creation.box((10, 10, 10))
    trimesh.Trimesh(box.vertices, box.faces[1:]).export(assets / "open.ply")
    (assets / "bent.obj").write_text(L_SHAPE)
    pair = trimesh.Scene()
    for name, at in (("left", 0), ("right", 8), ("far", 50)):
        pair.add_geometry(box, name, name, transform=trimesh.transformations.translation_matrix([at, 0, 0]))
    pair.export(assets / "pair.glb")
    (assets / "broken.stl").write_text("no mesh")
    (assets / "notes.xml").write_text("<notes/>")
    turntable(assets / "robots" / "table.urdf")
    return assets


def run(*arguments):
    done = overlapper("audit", *arguments)
    return done.returncode, done.stdout


def test_every_asset_of_a_folder_is_reported(folder):
    code, said = run(folder, "--units", "mm", "--json")
    found = {asset["name"]: asset for asset in json.loads(said)["assets"]}
    assert code == 1
    assert [*found] == ["bent.obj", "broken.stl", "cube.stl", "open.ply", "pair.glb", "robots/table.urdf"]
    assert {name for name, asset in found.items() if asset["sound"]} == {"bent.obj", "cube.stl"}
    assert found["broken.stl"]["failure"].startswith("is not a mesh that can be read")
    assert found["open.ply"]["closed"] is False
    assert found["open.ply"]["skipped"] == ["open.ply: the concave mesh bounds no volume: its surface has 3 open edges"]
    # The L is three cubes of 1 cm, its hull has half a cube more.
    assert (found["bent.obj"]["closed"], found["bent.obj"]["shapes"]) == (True, 1)
    assert found["bent.obj"]["excess"] == pytest.approx(1 / 6) and found["cube.stl"]["excess"] is None
    (shared,) = found["pair.glb"]["overlaps"]
    assert sorted(shared["names"]) == ["left", "right"] and found["pair.glb"]["bodies"] == 3
    assert (shared["volume"], shared["depth"]) == (pytest.approx(200.0), pytest.approx(2.0))  # glTF is in metres
    assert [each["names"] for each in found["robots/table.urdf"]["overlaps"]] == [["arm", "plate"], ["wall", "plate"]]
    assert (found["robots/table.urdf"]["bodies"], found["robots/table.urdf"]["closed"]) == (5, None)


def test_a_table_of_assets_has_a_row_for_each(folder, tmp_path):
    code, said = run(folder, "--units", "mm", "--out", tmp_path / "assets.csv")
    lines = (tmp_path / "assets.csv").read_text().splitlines()
    rows = {row["asset"]: row for row in csv.DictReader(line for line in lines if not line.startswith("#"))}
    assert code == 1 and said.endswith(f"Written: {tmp_path / 'assets.csv'}\n")
    assert {name: row["status"] for name, row in rows.items()} == {
        **dict.fromkeys(("bent.obj", "cube.stl"), "sound"),
        **dict.fromkeys(("open.ply", "pair.glb", "robots/table.urdf"), "not sound"),
        "broken.stl": "not read",
    }
    assert rows["broken.stl"]["failure"] and "its surface has 3 open edges" in rows["open.ply"]["not_modelled"]
    (shared,) = json.loads(rows["pair.glb"]["overlaps"])
    assert sorted(shared["names"]) == ["left", "right"] and "# units: mm" in lines


def test_a_fault_in_one_asset_is_its_failure(folder, monkeypatch):
    monkeypatch.setattr("overlapper.audit.assets._mesh", lambda *_: [][0])
    failed = read_asset(folder, folder / "cube.stl", "mm", 0.0, Modelling())
    assert failed.failure == "IndexError: list index out of range"


def test_people_get_a_table_and_sentences(folder):
    (folder / "open.ply").unlink()
    code, said = run(folder)
    assert code == 1
    assert "broken.stl is not read: is not a mesh" in said and "bent.obj" in said and "+16.7%" in said
    assert "robots/table.urdf, arm and plate share 0.0008 m³ at rest, 40 mm deep." in said
    assert said.endswith("Of 5 assets, 2 are sound.\n")


def test_concave_meshes_may_be_left_out_and_shallow_overlaps_passed_over(folder):
    skipped = read_asset(folder, folder / "bent.obj", "mm", 0.0, Modelling("skip"))
    assert skipped.skipped == ("bent.obj: the mesh is concave, and --concave skip leaves out concave meshes",)
    assert (skipped.closed, skipped.sound) == (True, False)
    assert read_asset(folder, folder / "pair.glb", "mm", 2.1, Modelling()).sound
    table = read_asset(folder, folder / "robots" / "table.urdf", "mm", 0.05, Modelling())
    assert table.sound


def test_only_an_overlap_deeper_than_the_rounding_of_its_corners_counts(tmp_path):
    """Corners 100 m off, written with six digits, are off by up to 0.506 mm in each coordinate, so parts by 1.75 mm."""
    path = tmp_path / "pair.glb"
    box = trimesh.creation.box((10, 10, 10))
    for depth, counted in ((1.7e-3, 0), (1.8e-3, 1)):
        pair = trimesh.Scene()
        for name, at in (("left", 85), ("right", 95 - depth)):
            pair.add_geometry(box, name, name, transform=trimesh.transformations.translation_matrix([at, 0, 0]))
        pair.export(path)
        assert len(read_asset(tmp_path, path, "m", 0.0, Modelling()).overlaps) == counted


def test_an_error_in_one_asset_does_not_stop_the_others(folder, monkeypatch):
    for library in ("pybullet", "yourdfpy"):
        monkeypatch.setitem(sys.modules, library, None)
    table = read_asset(folder, folder / "robots" / "table.urdf", "mm", 0.0, Modelling())
    assert table.failure.startswith("a URDF file needs yourdfpy: pip install yourdfpy, or pybullet: ")
    assert read_asset(folder, folder / "cube.stl", "mm", 0.0, Modelling()).sound


def test_options_for_robots_and_an_empty_folder_are_refused(folder, tmp_path):
    given = [sys.executable, "-m", "overlapper", "audit", folder, "--srdf", tmp_path / "out.srdf"]
    done = subprocess.run(given, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (2, f"overlapper: --srdf needs a robot, but {folder} is a folder\n")
    (tmp_path / "empty").mkdir()
    with pytest.raises(Refused, match=r"^the folder .*empty has no model and no mesh with one of the endings \.urdf, "):
        command(tmp_path / "empty")
