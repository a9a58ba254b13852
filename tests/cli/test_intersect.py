"""Mesh files, and the command for people who have polytopes and no simulator."""

import json
import re

import numpy as np
import pytest
import trimesh
from command import overlapper as run
from numpy.testing import assert_allclose

import overlapper
from overlapper import Hull, overlap, random_polytope, read_hull, write_mesh, write_polytopes
from overlapper.cli.intersect import intersect as command
from overlapper.cli.refusals import Interrupted
from overlapper.polytopes.mesh_file import NotConvexWarning

CUBE = np.array(np.meshgrid([0, 1], [0, 1], [0, 1.0])).reshape(3, 8).T
L_SHAPE = """
v 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\nv 0 0 1\nv 2 0 1\nv 2 1 1\nv 1 1 1\nv 1 2 1\nv 0 2 1
f 4 3 2 1\nf 6 5 4 1\nf 7 8 9 10\nf 7 10 11 12
f 1 2 8 7\nf 2 3 9 8\nf 3 4 10 9\nf 4 5 11 10\nf 5 6 12 11\nf 6 1 7 12
"""


def without_a_facet(obj):
    """The text of a mesh file less its last face."""
    return "\n".join(obj.strip().splitlines()[:-1])


# Mesh files


@pytest.mark.parametrize(("ending", "error"), [("obj", 1e-15), ("stl", 1e-6), ("ply", 1e-6)])
def test_a_written_mesh_is_closed_convex_and_read_as_it_was(tmp_path, ending, error):
    hull = random_polytope(30, rng=2)
    path = tmp_path / f"hull.{ending}"
    write_mesh(path, hull)
    found = read_hull(path)  # without a warning, which would fail the test
    assert len(found.vertices) == len(hull.vertices)
    assert found.volume == pytest.approx(hull.volume, rel=error)


def test_the_common_part_is_written_with_whole_facets(tmp_path):
    common = overlap(CUBE, CUBE + [0.5, 0.25, 0])
    write_mesh(tmp_path / "common.obj", common)
    found = read_hull(tmp_path / "common.obj")
    assert_allclose(np.sort(found.vertices, axis=0), np.sort(common.vertices, axis=0), rtol=0, atol=1e-16)
    assert len(found.facets) == 6


def test_a_mesh_smaller_than_its_hull_is_reported(tmp_path):
    path = tmp_path / "shape.obj"
    path.write_text(L_SHAPE)
    with pytest.warns(NotConvexWarning, match=r"shape.obj is not convex: it fills 85\.7% of its convex hull"):
        assert read_hull(path).volume == pytest.approx(3.5)
    path.write_text(without_a_facet(L_SHAPE))
    with pytest.warns(NotConvexWarning, match=r"shape.obj is not closed"):
        assert read_hull(path).volume == pytest.approx(3.5)


def test_files_that_are_no_meshes_are_refused(tmp_path):
    with pytest.raises(FileNotFoundError):
        read_hull(tmp_path / "none.obj")
    flat = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3"
    for name, text in (("words.stl", "hello"), ("words.ply", "hello"), ("flat.obj", flat)):
        (tmp_path / name).write_text(text)
        with pytest.raises(ValueError, match=f"{name} is not a mesh with a hull: "):
            read_hull(tmp_path / name)


def test_without_an_overlap_no_file_is_written(tmp_path):
    with pytest.raises(ValueError, match="polytope is empty"):
        write_mesh(tmp_path / "none.obj", overlap(CUBE, CUBE + 3))
    with pytest.raises(ValueError, match=r"must end in \.obj, \.stl, \.ply, not 'cube\.step'"):
        write_mesh(tmp_path / "cube.step", Hull(CUBE))
    assert not (tmp_path / "none.obj").exists() and not (tmp_path / "cube.step").exists()


# The command


@pytest.fixture(autouse=True)
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_mesh("one.stl", Hull(CUBE))
    write_mesh("two.obj", Hull(CUBE + [0.5, 0.25, 0]))
    write_mesh("far.ply", Hull(CUBE + [3, 0, 0]))
    (tmp_path / "bent.obj").write_text(L_SHAPE)


def intersect(*arguments):
    return run("intersect", *arguments)


def test_two_mesh_files_share_a_volume_and_a_mesh():
    done = intersect("one.stl", "two.obj", "--out", "common.stl")
    assert (done.returncode, done.stderr) == (0, "")
    lines = dict(line.split(maxsplit=1) for line in done.stdout.splitlines())
    assert lines["status"] == "overlapping" and lines["depth"] == "0.5 m"
    assert lines["volume"].startswith("0.375 ± ") and lines["volume"].endswith("e-14 m³")
    assert lines["Written:"] == "common.stl"
    assert read_hull("common.stl").volume == pytest.approx(0.375, rel=1e-6)


def test_all_polytopes_of_a_database_and_of_files_meet_in_one():
    write_polytopes("sqlite:///parts.db", [(i, CUBE + [0, 0, 0.125 * i]) for i in range(3)])
    done = intersect("sqlite:///parts.db", "one.stl", "two.obj", "--json")
    facts = json.loads(done.stdout)
    assert facts["polytopes"] == 5 and facts["depth"] is None
    assert abs(facts["volume"] - 0.375 * 0.75) <= facts["volume_error"] < 1e-13
    query = "SELECT polytope_id, x, y, z FROM vertices WHERE polytope_id > 0 ORDER BY 1, corner"
    fewer = json.loads(intersect("sqlite:///parts.db", "--query", query, "--json").stdout)
    assert fewer["polytopes"] == 2 and abs(fewer["volume"] - 0.875) <= fewer["volume_error"]


def test_no_overlap_is_an_answer_and_not_an_error():
    done = intersect("one.stl", "far.ply", "--out", "none.obj")
    assert done.returncode == 0
    assert "status    separated" in done.stdout and "distance  2 m" in done.stdout
    assert "Not written, as nothing is in common: none.obj" in done.stdout


def test_a_mesh_that_is_not_convex_is_named_beside_the_answer():
    done = intersect("one.stl", "bent.obj", "--json")
    assert json.loads(done.stdout)["volume"] == pytest.approx(1.0)
    assert "bent.obj is not convex: it fills 85.7% of its convex hull" in done.stderr


def test_ctrl_c_is_told_as_in_other_commands(monkeypatch):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(overlapper, "overlap", interrupt)
    with pytest.raises(Interrupted):
        command(["one.stl", "two.obj"])


# Concave meshes


def test_with_concave_the_volume_is_that_of_the_meshes_and_not_of_hulls(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    write_mesh("bar.stl", Hull(CUBE * [0.5, 2, 0.5] + [0.75, 0, 0.25]))
    done = intersect("bent.obj", "bar.stl", "--concave", "--json", "--out", "common.obj")
    facts = json.loads(done.stdout)
    assert (done.returncode, facts["status"], facts["out"]) == (0, "overlapping", "common.obj")
    assert facts["volume"] == pytest.approx(0.375, rel=1e-6) and facts["volume_error"] < 1e-12
    bent, bar = facts["bodies"]
    assert (bent["way"], bar["way"]) == ("decomposed", "convex") and abs(bent["excess"]) < 0.01
    assert re.search(r"convex parts of bent\.obj: 2, [+-]0\.\d% of its volume\n$", done.stderr)
    assert sum(each.volume for each in trimesh.load_mesh("common.obj").split()) == pytest.approx(0.375, rel=0.01)
    lines = dict(line.split(maxsplit=1) for line in intersect("bent.obj", "bar.stl", "--concave").stdout.splitlines())
    assert lines["volume"].startswith("0.375 ± ") and lines.keys() >= {"status", "centroid", "depth", "normal"}


def test_open_meshes_and_invalid_files_are_refused_with_concave(tmp_path):
    (tmp_path / "open.obj").write_text(without_a_facet(L_SHAPE))
    (tmp_path / "words.stl").write_text("hello")
    for name, reason in (
        ("open.obj", r"not measured: .* its surface has \d+ open edges"),
        ("words.stl", "not a mesh that can be"),
    ):
        done = intersect("one.stl", name, "--concave")
        assert (done.returncode, done.stdout) == (2, "")
        assert re.match(rf"overlapper: {name} is {reason}", done.stderr)


def test_a_body_in_the_corner_of_a_concave_mesh_shares_nothing_with_it():
    write_mesh("in_corner.stl", Hull(CUBE / 2 + [1.25, 1.25, 0]))
    done = intersect("bent.obj", "in_corner.stl", "--concave", "--out", "none.obj")
    assert (done.returncode, done.stderr) == (0, "")
    assert "status    separated" in done.stdout and "volume    0 ± 0 m³" in done.stdout
    assert "Not written, as nothing is in common: none.obj" in done.stdout
    turn = trimesh.transformations.rotation_matrix(0.3, [1, 2, 3])[:3, :3]
    for name, x in (("left.obj", 0), ("right.obj", 1)):
        write_mesh(name, Hull((CUBE + [x, 0, 0]) @ turn.T))
    assert "status    touching" in intersect("left.obj", "right.obj", "--concave").stdout


def test_without_coacd_the_hull_gives_the_place_and_the_output_says_so(tmp_path, monkeypatch):
    (tmp_path / "fake").mkdir()
    (tmp_path / "fake" / "coacd.py").write_text("raise RuntimeError('no luck')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "fake"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    done = intersect("one.stl", "bent.obj", "--concave")
    assert "volume    1 ± " in done.stdout
    assert "overlapper: The convex hull of bent.obj is used instead: CoACD failed" in done.stderr
    assert "overlapper: convex parts of bent.obj: hull, +16.7% of its volume\n" in done.stderr


@pytest.mark.parametrize(
    "query",
    [
        "DROP TABLE vertices",
        "DELETE FROM vertices RETURNING polytope_id, x, y, z",
        "VACUUM INTO 'stolen.db'",
        "ATTACH DATABASE 'made.db' AS made",
        "PRAGMA user_version = 7",
        "CREATE TABLE made AS SELECT * FROM vertices",
    ],
)
def test_a_query_only_reads(tmp_path, query):
    write_polytopes("sqlite:///parts.db", [(1, CUBE), (2, CUBE)])
    before, names = (tmp_path / "parts.db").read_bytes(), {*tmp_path.iterdir()}
    done = intersect("sqlite:///parts.db", "--query", query)
    assert (done.returncode, done.stdout) == (2, "")
    assert re.fullmatch(r"overlapper: the database says: .*(not authorized|authorization denied).*\n", done.stderr)
    assert (tmp_path / "parts.db").read_bytes() == before
    assert {*tmp_path.iterdir()} == names


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["one.stl"], "at least two polytopes are needed, not 1"),
        (["one.stl", "none.stl"], "none.stl: No such file or directory"),
        (["one.stl", "two.obj", "--out", "no/folder.stl"], "no/folder.stl: No such file or directory"),
        (["one.stl", "two.obj", "--out", "common.step"], "a mesh must end in .obj, .stl, .ply, not 'common.step'"),
        (["sqlite:///none.db"], "there is no database none.db"),
        (["sqlite://"], "the database says: no such table: polytopes"),
        (
            ["one.stl", "--concave"],
            "--concave takes two mesh files; overlapper clashes takes more, and measures all pairs",
        ),
        (
            ["one.stl", "sqlite://", "--concave"],
            "--concave takes two mesh files; overlapper clashes takes more, and measures all pairs",
        ),
        (["one.stl", "none.stl", "--concave"], "none.stl: No such file or directory"),
        (
            ["one.stl", "two.obj", "--concave", "--method", "paper"],
            "--concave and --method paper exclude each other: the method `paper` is for polytopes",
        ),
    ],
)
def test_user_errors_are_one_sentence(arguments, sentence):
    done = intersect(*arguments)
    assert (done.returncode, done.stdout, done.stderr) == (2, "", f"overlapper: {sentence}\n")
