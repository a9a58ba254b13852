"""`overlapper clashes`: the one pair of a folder or an assembly that should not overlap, and an exit code."""

import json
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import bearing
import numpy as np
import pytest
import trimesh
from command import overlapper
from in_mm import CUBE, L_SHAPE
from pages import Film, drawings, enclosed, meshes, numbers
from step_text import step_text

from overlapper import Hull, write_mesh
from overlapper.audit import clashes as scene
from overlapper.polytopes import mesh_overlap
from overlapper.tables.table_file import read_metadata, read_table

# Cuts an L in two, in the place of CoACD.
SAW = """
def set_log_level(level): pass
class Mesh:
    def __init__(self, vertices, indices): self.vertices = vertices
def run_coacd(mesh, threshold):
    v = mesh.vertices
    return [[v[v[:, 0] <= 10], None], [v[v[:, 1] <= 10], None]]
"""
NO_COACD = "raise RuntimeError('no luck')"


@pytest.fixture(autouse=True)
def files(tmp_path, monkeypatch):
    """In mm: two cubes that share an eighth, one far away, an L, and in its corner a cube that does not touch it."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    write_mesh("one.stl", Hull(CUBE))
    write_mesh("two.obj", Hull(CUBE + 5))
    write_mesh("far.ply", Hull(CUBE + [300, 0, 0]))
    write_mesh("in_corner.stl", Hull(CUBE * 0.5 + [12, 12, 0]))
    write_mesh("in_arm.stl", Hull(CUBE * 0.5 + [17.5, 2, 2]))
    (tmp_path / "bent.obj").write_text(L_SHAPE)
    (tmp_path / "open.obj").write_text("\n".join(L_SHAPE.strip().splitlines()[:-1]))


@pytest.fixture
def coacd_is(tmp_path, monkeypatch):
    """Puts another module in the place of CoACD."""

    def replace(source):
        (tmp_path / "fake").mkdir()
        (tmp_path / "fake" / "coacd.py").write_text(source)
        monkeypatch.syspath_prepend(tmp_path / "fake")  # which the processes that decompose are given

    return replace


def clashes(*arguments):
    return overlapper("clashes", "--units", "mm", *arguments)


def facts(*arguments):
    done = clashes(*arguments, "--json")
    return done.returncode, json.loads(done.stdout)


# Folders and files


def test_the_planted_clash_is_found_among_thirty_parts(tmp_path):
    bearing.write(tmp_path / "parts")
    code, found = facts("parts", "--out", "pairs.csv", "--html", "page.html")
    assert (code, len(found["bodies"])) == (1, 30)
    (pair,) = found["pairs"]
    assert tuple(pair["names"]) == bearing.CLASH and pair["status"] == "clash"
    solids = dict(bearing.solids(0.65))
    exact = (solids[bearing.CLASH[0]] ^ solids[bearing.CLASH[1]]).volume()
    # Files are in single precision.
    assert pair["volume_m3"] == pytest.approx(1e-9 * exact, rel=1e-4)
    assert pair["volume_of"] == "meshes" and pair["volume_error_m3"] < 1e-8 * pair["volume_m3"]
    assert 1e-4 < pair["depth_m"] < 2e-4
    # The volume that CoACD's parts add to a mesh is reported. Only the two clashing meshes were decomposed.
    ways = {body["name"]: body["way"] for body in found["bodies"]}
    assert {name for name, way in ways.items() if way == "decomposed"} == {*bearing.CLASH}
    assert {name for name, way in ways.items() if way == "convex"} == {"shaft.stl"}
    excess = {body["name"]: body["excess"] for body in found["bodies"]}
    assert 0.01 < excess["sleeve.ply"] < 0.3
    assert json.loads(read_metadata(tmp_path / "pairs.csv")["excess"]).keys() == {*bearing.CLASH}
    (row,) = read_table(tmp_path / "pairs.csv")
    assert (row["nameA"], row["nameB"], row["volume_m3"]) == (*bearing.CLASH, pair["volume_m3"])
    page = Film.of(tmp_path / "page.html")
    assert [tuple(name.rpartition(".")[0] for name in names) for names in page.heading["pairs"]] == [bearing.CLASH]
    assert len([path for path in drawings(tmp_path / "page.html") if "/washer_" in path]) == 8


def test_parts_that_fit_pass_without_a_decomposition(tmp_path, coacd_is):
    coacd_is(NO_COACD)
    bearing.write(tmp_path / "parts", off=0)
    done = clashes("parts")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == "Of 435 pairs of 30 bodies, none clashes.\n"


def test_a_matrix_and_a_list_are_for_people():
    done = clashes("one.stl", "two.obj", "far.ply")
    assert (done.returncode, done.stderr) == (1, "")
    assert "Volumes in cm³ above the diagonal, depths in mm below it:" in done.stdout
    assert re.search(r"^1 one.stl +· +0\.125", done.stdout, re.MULTILINE)
    assert re.search(r"^2 two.obj +5 +·", done.stdout, re.MULTILINE)
    assert re.search(r"^one.stl +clash +0\.125 +\S+ +5 +itself$", done.stdout, re.MULTILINE)
    assert done.stdout.endswith("Of 3 pairs of 3 bodies, 1 clashes.\n")


def test_many_pairs_are_listed_by_size_without_a_matrix(tmp_path):
    for k in range(13):
        write_mesh(f"cube_{k:02}.stl", Hull(CUBE + [0, 0, 0.5 * k]))
    done = clashes(*tmp_path.glob("cube_*.stl"))
    assert "Of 78 pairs of 13 bodies, 78 clash." in done.stdout and "diagonal" not in done.stdout
    assert "The 20 largest of 78 pairs." in done.stdout
    assert len(re.findall(r"^cube_", done.stdout, re.MULTILINE)) == 20


def test_lengths_have_the_requested_units():
    _, in_mm = facts("one.stl", "two.obj")
    _, in_inches = facts("one.stl", "two.obj", "--units", "in")
    assert in_mm["pairs"][0]["volume_m3"] == pytest.approx(125e-9)
    assert in_inches["pairs"][0]["depth_m"] == pytest.approx(5 * 0.0254)


def test_files_of_one_name_are_told_apart_by_their_folders(tmp_path):
    for name, shift in (("left", 0), ("right", 5)):
        (tmp_path / name).mkdir()
        write_mesh(f"{name}/cube.stl", Hull(CUBE + shift))
    code, found = facts("left", "right/cube.stl", "left/cube.stl", "--html", "page.html")
    assert code == 1
    assert [body["name"] for body in found["bodies"]] == ["left/cube.stl", "right/cube.stl"]
    assert Film.of(tmp_path / "page.html").heading["pairs"] == [["left/cube.stl", "right/cube.stl"]]


def test_other_files_of_a_folder_are_ignored(tmp_path):
    (tmp_path / "parts").mkdir()
    for name in ("a.stl", "b.STL", ".hidden.stl"):
        write_mesh(tmp_path / "parts" / name.lower(), Hull(CUBE))
        (tmp_path / "parts" / name.lower()).rename(tmp_path / "parts" / name)
    (tmp_path / "parts" / "notes.txt").write_text("hello")
    (tmp_path / "parts" / "folder.stl").mkdir()
    assert [body["name"] for body in facts("parts")[1]["bodies"]] == ["a.stl", "b.STL"]


# Which pairs are clashes


def test_bodies_that_touch_are_no_clash_whatever_rounding_does_to_them():
    turn = trimesh.transformations.rotation_matrix(0.3, [1, 2, 3])[:3, :3]
    for k, corners in enumerate((CUBE, CUBE + [10, 0, 0], CUBE + [0, 9.9999, 0])):
        write_mesh(f"turned_{k}.stl", Hull(corners @ turn.T))
    code, found = facts("turned_0.stl", "turned_1.stl", "turned_2.stl")
    status = {tuple(name[7] for name in pair["names"]): pair["status"] for pair in found["pairs"]}
    assert (code, status["0", "1"], status["0", "2"]) == (0, "touching", "touching")
    write_mesh("left.obj", Hull(CUBE @ turn.T))
    write_mesh("right.obj", Hull((CUBE + [10, 0, 0]) @ turn.T))
    code, found = facts("left.obj", "right.obj", "--out", "pairs.csv")
    (pair,) = found["pairs"]
    assert (code, pair["status"], pair["volume_m3"], pair["depth_m"]) == (0, "touching", 0, 0)
    assert read_table(Path("pairs.csv"))[0]["status"] == "touching"
    assert clashes("turned_0.stl", "turned_1.stl").stdout.endswith("Of 1 pair of 2 bodies, none clashes, 1 touches.\n")


def test_meshes_that_touch_are_no_clash_either(coacd_is):
    coacd_is(NO_COACD)
    write_mesh("at_arm.stl", Hull(CUBE * 0.5 + [10 - 1e-5, 12, 1]))  # 10 nm into the arm
    code, found = facts("bent.obj", "at_arm.stl")
    assert (code, [pair["status"] for pair in found["pairs"]]) == (0, ["touching"])
    assert found["pairs"][0]["volume_m3"] == pytest.approx(5 * 5 * 1e-5 * 1e-9, rel=0.2)


def test_an_overlap_less_deep_than_asked_and_one_that_is_expected_are_no_clash():
    code, found = facts("one.stl", "two.obj", "--least-depth", "0.006")
    assert (code, found["pairs"][0]["status"]) == (0, "shallow")
    assert "none clashes, 1 is shallow." in clashes("one.stl", "two.obj", "--least-depth", "0.006").stdout
    assert facts("one.stl", "two.obj", "--least-depth", "0.004")[0] == 1
    for names in ("one.stl,two.obj", "two*,*", "t*,one.stl"):
        code, found = facts("one.stl", "two.obj", "--expect", names)
        assert (code, found["pairs"][0]["status"]) == (0, "expected")
    assert facts("one.stl", "two.obj", "--expect", "one.stl,one.stl")[0] == 1
    done = clashes("one.stl", "two.obj", "--expect", "*,*", "--out", "pairs.sqlite")
    assert "none clashes, 1 overlaps as expected." in done.stdout and "Written: pairs.sqlite" in done.stdout


# Concave meshes


def test_a_body_in_the_corner_of_a_concave_mesh_is_separated(coacd_is):
    coacd_is(NO_COACD)
    code, found = facts("bent.obj", "in_corner.stl")
    assert (code, found["pairs"], found["remarks"]) == (0, [], [])


def test_a_concave_mesh_that_clashes_with_nothing_is_drawn_as_it_is(tmp_path, coacd_is):
    coacd_is(NO_COACD)
    assert clashes("bent.obj", "in_corner.stl", "--html", "pages/page.html").returncode == 0
    (drawing,) = (each for path, each in drawings(tmp_path / "pages" / "page.html").items() if "/bent.obj/" in path)
    assert enclosed(meshes(drawing)) == pytest.approx(3e-6, rel=1e-5)
    lines = next(each for each in drawing["object"]["children"] if each.get("name") == "edges")
    (geometry,) = (each for each in drawing["geometries"] if each["uuid"] == lines["geometry"])
    assert len(numbers(geometry["data"]["attributes"]["position"])) == 2 * 18  # and no diagonal of a face


def test_volume_added_by_convex_parts_is_reported_and_not_counted(coacd_is):
    coacd_is(SAW.replace("<= 10], None], ", "<= 10], None], [v, None], "))  # and the hull
    code, found = facts("bent.obj", "in_arm.stl")
    (pair,) = found["pairs"]
    assert code == 1 and pair["volume_m3"] == pytest.approx(2.5 * 5 * 5 * 1e-9)
    bent = next(body for body in found["bodies"] if body["name"] == "bent.obj")
    assert (bent["way"], bent["parts"]) == ("decomposed", 3)
    assert bent["excess"] == pytest.approx(3.5 / 3 - 1)
    assert re.search(r"^bent.obj +clash +62\.5 .* 3, \+16\.7%$", clashes("bent.obj", "in_arm.stl").stdout, re.MULTILINE)


def test_without_parts_the_hull_gives_the_place_and_the_volume_is_exact(coacd_is):
    coacd_is(NO_COACD)
    done = clashes("bent.obj", "in_arm.stl")
    assert done.returncode == 1
    assert re.search(r"^bent.obj +clash +62\.5 .* hull, \+16\.7%$", done.stdout, re.MULTILINE)
    sentence = "The convex hull of bent.obj is used instead: CoACD failed on the concave mesh: "
    assert sentence + "its process ended with exit code 1 (RuntimeError: no luck)." in done.stdout


def test_parts_that_miss_what_meshes_share_leave_the_depth_open(coacd_is):
    coacd_is(SAW.replace("[v[v[:, 1] <= 10], None]", ""))
    code, found = facts("bent.obj", "in_arm.stl", "--html", "page.html", "--out", "pairs.csv")
    (pair,) = found["pairs"]
    assert (code, pair["status"], pair["depth_m"], pair["normal"]) == (1, "clash", None, None)
    assert pair["volume_m3"] == pytest.approx(2.5 * 5 * 5 * 1e-9)
    assert clashes("bent.obj", "in_arm.stl").returncode == 1


def test_an_open_mesh_is_not_measured_unless_it_is_enclosed(coacd_is):
    coacd_is(SAW)
    done = clashes("open.obj", "in_arm.stl", "one.stl")
    assert done.returncode == 2
    reason = "the concave mesh bounds no volume: its surface has 4 open edges"
    assert done.stderr.splitlines()[0] == f"overlapper: open.obj is not measured: {reason}"
    code, found = facts("open.obj", "in_arm.stl", "--concave", "enclose")
    (pair,) = found["pairs"]
    assert (code, pair["volume_of"]) == (1, "parts")
    assert pair["volume_m3"] == pytest.approx(2.5 * 5 * 5 * 1e-9)
    marked = clashes("open.obj", "in_arm.stl", "--concave", "enclose").stdout
    assert re.search(r"^open.obj +clash +62\.5\* .* 2, open$", marked, re.MULTILINE)
    assert re.search(r"^ in_arm.stl +itself$", marked, re.MULTILINE)


def test_an_open_mesh_far_from_all_others_is_ignored():
    assert clashes("open.obj", "far.ply").returncode == 0


def test_a_mesh_that_turns_both_ways_is_measured_by_its_parts(tmp_path, coacd_is):
    coacd_is(SAW)
    lines = L_SHAPE.strip().splitlines()
    lines[-1] = "f " + " ".join(lines[-1].split()[:0:-1])
    (tmp_path / "both.obj").write_text("\n".join(lines))
    code, found = facts("both.obj", "in_arm.stl")
    (pair,) = found["pairs"]
    assert (code, pair["volume_of"], pair["volume_m3"]) == (1, "parts", pytest.approx(2.5 * 5 * 5 * 1e-9))


def test_meshes_of_too_many_triangles_are_measured_by_their_parts(monkeypatch):
    monkeypatch.setattr(mesh_overlap, "MOST", 3)
    bodies, failures = scene.read([Path("bent.obj"), Path("in_arm.stl")], "mm")
    (pair,) = scene.clashes(bodies).pairs
    assert (failures, pair.of_meshes, pair.status) == ([], False, "clash")
    assert pair.volume == pytest.approx(2.5 * 5 * 5 * 1e-9, rel=0.01)


def test_parts_flattened_by_a_transform_are_left_out():
    ((_, part),), _ = scene.read([Path("one.stl")], "mm")
    hull = Hull(part.placed(part.triangles.reshape(-1, 3)))
    body = scene.MeshBody("one.stl", part, None, (hull,), "hull", hull.volume, None)
    in_file = Hull(part.triangles.reshape(-1, 3))
    assert scene._of_parts(body, [in_file], "convex").parts_volume == pytest.approx(1e-6)
    flat = replace(body, part=replace(part, transform=np.diag([1e-3, 1e-3, 0, 1])))
    assert scene._of_parts(flat, [in_file], "convex") is flat


def test_a_body_without_a_volume_is_named(tmp_path):
    (tmp_path / "flat.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    done = clashes("flat.obj", "one.stl", "two.obj")
    assert done.returncode == 2 and "one.stl" in done.stdout
    assert re.fullmatch(r"overlapper: flat\.obj is not measured: .+\n", done.stderr)


# Assemblies


def assembly(path, **places):
    """A scene of cubes of 10 mm by the names of their nodes, all instances of one mesh."""
    scene = trimesh.Scene()
    scale = 1 if path.suffix == ".3mf" else 1e-3  # 3MF is written in mm, glTF is in m
    mesh = trimesh.convex.convex_hull(scale * CUBE)
    for name, (matrix, place) in places.items():
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = matrix, scale * np.array(place)
        scene.add_geometry(mesh, node_name=name, geom_name="cube", transform=pose)
    scene.export(path)


@pytest.mark.parametrize("ending", ["glb", "gltf", "3mf"])
def test_bodies_of_an_assembly_are_its_nodes_where_they_stand(tmp_path, ending):
    if ending == "3mf":
        pytest.importorskip("networkx")
    path = tmp_path / "car" / f"car.{ending}"
    path.parent.mkdir()
    path.write_bytes(b"")
    mirror = np.diag([-1.0, 1, 1])
    assembly_of = {"base": (np.eye(3), [0, 0, 0]), "lid": (np.eye(3), [0, 0, 8]), "twin": (mirror, [0, 0, 20])}
    if ending == "gltf":
        scene = tmp_path / "car" / "scene.glb"
        assembly(scene, **assembly_of)
        for name, data in trimesh.load_scene(scene).export(file_type="gltf").items():
            (path if name.endswith(".gltf") else path.parent / name).write_bytes(data)
        scene.unlink()
    else:
        assembly(path, **assembly_of)
    code, found = facts(path, "--units", "in")  # which the file knows better
    assert code == 1
    assert [body["name"] for body in found["bodies"]] == ["base", "lid", "twin"]
    assert [body["mesh_volume_m3"] for body in found["bodies"]] == pytest.approx([1e-6] * 3)
    (pair,) = (pair for pair in found["pairs"] if pair["status"] == "clash")
    assert pair["names"] == ["base", "lid"] and pair["volume_m3"] == pytest.approx(200e-9, rel=1e-5)
    beside = facts(path, "one.stl")[1]
    assert {body["name"] for body in beside["bodies"]} == {f"car/car.{ending}/{n}" for n in ("base", "lid", "twin")} | {
        "one.stl"
    }


def test_step_is_read_in_its_own_units(tmp_path):
    pytest.importorskip("cascadio")
    hull = Hull(CUBE)
    rings = [ring.tolist() for ring in hull.facets]
    bodies = {"base": (hull.vertices, rings), "lid": (hull.vertices + [5, 2.5, 0], rings)}
    (tmp_path / "two.step").write_text(step_text(bodies))
    code, found = facts("two.step")
    (pair,) = found["pairs"]
    assert (code, pair["names"]) == (1, ["base", "lid"])
    assert pair["volume_m3"] == pytest.approx(375e-9) and pair["depth_m"] == pytest.approx(5e-3)
    (tmp_path / "bad.stp").write_text("ISO-10303-21;\ngarbage")
    done = clashes("bad.stp", "one.stl", "two.obj")
    assert done.returncode == 2
    assert done.stderr == "overlapper: bad.stp is not a mesh that can be read: OpenCASCADE finds no shape in it\n"


def test_a_step_file_that_crashes_its_reader_is_named_and_the_others_measured(tmp_path, monkeypatch):
    (tmp_path / "fake").mkdir()
    (tmp_path / "fake" / "cascadio.py").write_text("import os\ndef step_to_glb(*a, **k): os.abort()\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "fake"))
    (tmp_path / "bad.step").write_text("ISO-10303-21;\n")
    done = clashes("bad.step", "one.stl", "two.obj")
    reason = "reading it ended its process with signal SIGABRT"
    assert (done.returncode, done.stderr) == (
        2,
        f"overlapper: bad.step is not a mesh that can be read: {reason}\n",
    )
    assert "Of 1 pair of 2 bodies, 1 clashes." in done.stdout


def test_the_library_that_a_format_needs_is_named(tmp_path, monkeypatch):
    (tmp_path / "hidden").mkdir()
    hide = "import importlib.util as u\nfind = u.find_spec\n"
    hide += "u.find_spec = lambda name, *a: None if name in ('cascadio', 'networkx') else find(name, *a)\n"
    (tmp_path / "hidden" / "sitecustomize.py").write_text(hide)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "hidden"))
    for name, package in (("a.step", "cascadio"), ("a.3mf", "networkx")):
        (tmp_path / name).write_bytes(b"")
        done = clashes(name, "one.stl")
        assert (done.returncode, done.stderr) == (2, f"overlapper: {name} needs {package}: pip install {package}\n")


def test_neither_a_simulator_nor_a_viewer_is_needed(tmp_path, monkeypatch):
    (tmp_path / "hidden").mkdir()
    hide = (
        "import sys\nsys.modules.update(dict.fromkeys(['pybullet', 'pybullet_data', 'meshcat', 'matplotlib', 'fcl']))\n"
    )
    (tmp_path / "hidden" / "sitecustomize.py").write_text(hide)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "hidden"))
    done = clashes("one.stl", "two.obj")
    assert (done.returncode, done.stderr) == (1, "") and "1 clashes." in done.stdout
    done = clashes("one.stl", "two.obj", "--html", "page.html")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "overlapper: overlapper.viewer needs meshcat: pip install meshcat\n"


# Errors of the user


def test_files_that_cannot_be_read_are_named_and_the_others_measured(tmp_path):
    (tmp_path / "words.stl").write_text("hello")
    done = clashes("words.stl", "one.stl", "none.stl", "two.obj")
    assert done.returncode == 2
    first, second = done.stderr.splitlines()
    assert first.startswith("overlapper: words.stl is not a mesh that can be read: ")
    assert second == "overlapper: none.stl: No such file or directory"
    assert "Of 1 pair of 2 bodies, 1 clashes." in done.stdout
    code, found = facts("words.stl", "one.stl", "two.obj")
    assert code == 2 and len(found["failures"]) == 1


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["one.stl"], "at least two bodies are needed, not 1"),
        (
            ["empty"],
            "the folder empty has no mesh with one of the endings "
            ".obj, .off, .ply, .stl, .3mf, .glb, .gltf, .step, .stp",
        ),
        (
            ["one.stl", "two.obj", "--expect", "one.stl"],
            "--expect must be two names with a comma between them, not 'one.stl'",
        ),
        (["one.stl", "two.obj", "--expect", "one.stl,tow.obj"], "no body is called 'tow.obj'"),
        (["one.stl", "two.obj", "--out", "a.txt"], "--out must end in .csv, .parquet, .sqlite, not 'a.txt'"),
        (["one.stl", "two.obj", "--out", "one.stl/a.csv"], "one.stl: File exists"),
        (["one.stl", "two.obj", "--html", "empty"], "empty: Is a directory"),
        (
            ["one.stl", "two.obj", "--concave-threshold", "2"],
            "--concave-threshold must lie between 0.01 and 1, not 2.0",
        ),
    ],
)
def test_user_errors_are_one_sentence(tmp_path, arguments, sentence):
    (tmp_path / "empty").mkdir()
    done = clashes(*arguments)
    assert (done.returncode, done.stdout, done.stderr) == (2, "", f"overlapper: {sentence}\n")


def test_a_file_that_cannot_be_read_is_the_only_sentence_where_too_few_bodies_are_left():
    done = clashes("none.stl", "one.stl")
    said = "overlapper: none.stl: No such file or directory\n"
    assert (done.returncode, done.stderr) == (2, said)


def test_ctrl_c_ends_the_command_in_one_sentence(tmp_path, monkeypatch, coacd_is):
    coacd_is("import time; time.sleep(60)")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "fake"))
    command = [
        sys.executable,
        "-m",
        "overlapper",
        "clashes",
        "--units",
        "mm",
        "bent.obj",
        "in_arm.stl",
        "--out",
        "a.csv",
    ]
    running = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    running.stderr.readline()  # that CoACD has been asked
    time.sleep(0.5)
    running.send_signal(signal.SIGINT)
    out, words = running.communicate(timeout=60)
    assert (running.returncode, out, words) == (130, "", "overlapper: interrupted; nothing was written\n")


def test_help_says_what_the_exit_code_means():
    said = " ".join(clashes("--help").stdout.split())
    assert "The exit code is 0 without a clash, 1 with a clash, and 2 if a mesh could not be read or measured." in said
