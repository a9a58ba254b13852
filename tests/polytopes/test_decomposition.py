"""Concave meshes are decomposed into convex parts once, also if CoACD or its files fail."""

import concurrent.futures
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from overlapper import Hull
from overlapper.polytopes.decomposition import NotDecomposed, WeldedMesh, cache_folder, decompose, packed, unpacked

CORNERS = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
HULL = Hull(CORNERS)
CUBE = np.concatenate(
    [[HULL.vertices[[ring[0], ring[k], ring[k + 1]]] for k in range(1, len(ring) - 1)] for ring in HULL.facets]
)
PROFILE = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], dtype=float)


def bent():
    """An L of three unit cubes in a row around a corner, volume 3."""
    low, high = np.c_[PROFILE, np.zeros(6)], np.c_[PROFILE, np.ones(6)]
    ends = [(0, 1, 2), (0, 2, 3), (0, 3, 5), (3, 4, 5)]
    triangles = [low[[c, b, a]] for a, b, c in ends] + [high[[a, b, c]] for a, b, c in ends]
    for i in range(6):
        j = (i + 1) % 6
        triangles += [[low[i], low[j], high[j]], [low[i], high[j], high[i]]]
    return np.array(triangles)


# Stands for CoACD and cuts an L in two; it notes in a file that it was called.
SAW = """
import pathlib
import numpy as np

def set_log_level(level): pass

class Mesh:
    def __init__(self, vertices, indices): self.vertices = vertices

def run_coacd(mesh, threshold):
    with open(pathlib.Path(__file__).with_name("calls"), "a") as calls:
        calls.write(".")
    v = mesh.vertices
    middle = v.max() / 2
    return [[v[v[:, 0] <= middle], None], [v[v[:, 1] <= middle], None]]
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "overlapper" / "convex_parts"


@pytest.fixture
def coacd_is(tmp_path, monkeypatch):
    """Puts another module in the place of CoACD; returns how often it was called."""

    def replace(source):
        (tmp_path / "fake").mkdir()
        (tmp_path / "fake" / "coacd.py").write_text(source)
        monkeypatch.syspath_prepend(tmp_path / "fake")
        calls = tmp_path / "fake" / "calls"
        return lambda: len(calls.read_text()) if calls.exists() else 0

    return replace


def test_coacd_cuts_an_l_into_two_parts_of_its_volume(folder, capfd):
    found = decompose(bent())
    assert found.mesh_volume == pytest.approx(3)
    assert len(found.parts) == 2
    # CoACD cuts near the corner, not at it.
    assert sum(part.volume for part in found.parts) == pytest.approx(3, rel=2e-3)
    assert found.path.parent == folder == cache_folder()
    assert str(found.path) in capfd.readouterr().err


def test_parts_are_made_once_and_read_again_to_the_bit(coacd_is, capfd):
    calls = coacd_is(SAW)
    first, second = decompose(bent()), decompose(bent())
    assert calls() == 1
    for a, b in zip(first.parts, second.parts, strict=True):
        assert_array_equal(a.vertices, b.vertices)
    assert capfd.readouterr().err.count("CoACD") == 1


def test_another_mesh_or_threshold_is_another_entry(coacd_is):
    calls = coacd_is(SAW)
    paths = {decompose(bent()).path, decompose(bent(), threshold=0.1).path, decompose(2 * bent()).path}
    assert len(paths) == calls() == 3


@pytest.mark.parametrize("damage", [lambda data: data[: len(data) // 2], lambda data: b"", lambda data: data[::-1]])
def test_a_damaged_entry_is_rebuilt(coacd_is, damage):
    calls = coacd_is(SAW)
    path = decompose(bent()).path
    sound = path.read_bytes()
    path.write_bytes(damage(sound))
    assert len(decompose(bent()).parts) == 2
    assert calls() == 2
    assert path.read_bytes() == sound


DATA = packed("key", [CORNERS, CORNERS + 1])


@given(st.integers(0, len(DATA) - 1), st.integers(1, 255))
def test_an_entry_with_a_changed_or_missing_byte_is_rejected(place, change):
    changed = bytearray(DATA)
    changed[place] ^= change
    assert unpacked("key", bytes(changed)) is None
    assert unpacked("key", DATA[:place]) is None
    assert unpacked("other key", DATA) is None


def test_an_entry_is_what_was_packed():
    assert_array_equal(unpacked("key", DATA), [CORNERS, CORNERS + 1])
    assert unpacked("key", packed("key", [])) == []


def test_processes_that_decompose_at_the_same_time_find_the_same_parts(coacd_is, folder):
    coacd_is(SAW)
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda _: decompose(bent()), range(4)))
    assert {each.path for each in found} == set(folder.iterdir())
    assert {len(each.parts) for each in found} == {2}


def test_a_folder_that_cannot_be_written_costs_no_answer(coacd_is, monkeypatch, tmp_path):
    coacd_is(SAW)
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    with pytest.warns(UserWarning, match=r"cannot be kept in .*Not a directory"):
        assert len(decompose(bent()).parts) == 2


@pytest.mark.parametrize(
    ("source", "reason"),
    [
        ("import os\nos.abort()", "process ended with signal SIGABRT"),
        ("import sys\nsys.exit(3)", "process ended with exit code 3"),
        ("raise RuntimeError('no luck')", r"exit code 1 \(RuntimeError: no luck\)"),
        ("import os\nos._exit(0)", "ended before its answer was complete"),
        ("import time\ntime.sleep(60)", "not decompose the concave mesh within 1 s"),
        (SAW.replace("return", "return [[v[:3], None]] #"), "no solid part"),
    ],
)
def test_every_end_of_coacd_has_a_reason(coacd_is, source, reason):
    coacd_is(source)
    with pytest.raises(NotDecomposed, match=reason):
        decompose(bent(), time_limit=1 if "sleep" in source else 60)


def test_without_coacd_a_concave_mesh_is_refused_by_name(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(NotDecomposed, match=r"needs coacd: pip install coacd$"):
        decompose(bent())


@pytest.mark.parametrize("way", [1, -1])
def test_convex_bodies_need_no_coacd_and_stay_exact(coacd_is, way):
    coacd_is("raise RuntimeError")
    pair = np.concatenate([CUBE, CUBE * [2, 1, 1] + [0.5, 0.5, 0.5]])[:, ::way]
    found = decompose(pair)
    assert found.path is None and found.mesh_volume == pytest.approx(3)
    assert sorted(part.volume for part in found.parts) == pytest.approx([1, 2])


def ball_of_triangles(corners=300, seed=0):
    """(t, 3, 3) the surface of a polytope with random corners on the unit sphere, facing out."""
    points = np.random.default_rng(seed).normal(size=(corners, 3))
    hull = Hull(points / np.linalg.norm(points, axis=1)[:, None])
    return hull.corners[hull.triangles]


@pytest.mark.parametrize("written", ["%.6f", "%.6g", "single"])
@pytest.mark.parametrize("size", [0.1, 1, 30])
def test_bodies_that_are_convex_up_to_rounding_stay_as_they_are(coacd_is, written, size):
    coacd_is("raise RuntimeError")
    pair = np.concatenate([ball_of_triangles(), ball_of_triangles(seed=1) + [1.2, 0, 0]]) * size
    text = (lambda x: np.float32(x)) if written == "single" else (lambda x: float(written % x))
    found = decompose(np.vectorize(text, otypes=[float])(pair))
    assert len(found.parts) == 2 and found.path is None
    assert found.mesh_volume == pytest.approx(sum(part.volume for part in found.parts), rel=1e-4)


def test_convex_bodies_may_touch_at_a_corner(coacd_is):
    coacd_is("raise RuntimeError")
    assert len(decompose(np.concatenate([CUBE, CUBE + 1])).parts) == 2


@pytest.mark.parametrize("depth", [1e-3, 1e-4])
def test_a_dent_deeper_than_rounding_is_not_filled(coacd_is, depth):
    calls = coacd_is(SAW)
    top = CUBE[:, :, 2].min(axis=1) == 1
    middle = np.array([0.5, 0.5, 1 - depth])
    ends = [edge for face in CUBE[top] for edge in (face[[0, 1]], face[[1, 2]], face[[2, 0]])]
    outer = [(a, b) for a, b in ends if (a == b).sum() == 2]  # and not the diagonal
    dented = np.concatenate([CUBE[~top], [[a, b, middle] for a, b in outer]])
    assert decompose(dented).mesh_volume == pytest.approx(1 - depth / 3)
    assert calls() == 1


def test_a_hole_is_not_filled_by_the_convex_body_around_it(coacd_is):
    calls = coacd_is(SAW.replace("middle = v.max() / 2", "middle = v.max()"))
    hollow = np.concatenate([CUBE, (CUBE / 2 + 0.25)[:, ::-1]])
    assert decompose(hollow).mesh_volume == pytest.approx(1 - 1 / 8)
    assert calls() == 1


def test_a_shell_that_is_inside_out_and_no_hole_leaves_the_volume_open():
    hollow = np.concatenate([CUBE, (CUBE / 2 + 0.25)[:, ::-1]])
    assert WeldedMesh.of(hollow).volume == pytest.approx(7 / 8)
    for beside in (CUBE + 3, CUBE / 2 + 0.75):
        surface = WeldedMesh.of(np.concatenate([CUBE, beside[:, ::-1]]))
        assert surface.volume is None and surface.convex_bodies() is None and surface.open_edges == 0


def test_a_mesh_drawn_from_both_sides_is_the_same_mesh():
    both = np.concatenate([CUBE, CUBE[:, ::-1]])
    (part,) = decompose(both).parts
    assert part.volume == pytest.approx(1)


@pytest.mark.parametrize(
    ("triangles", "reason"),
    [
        (CUBE[1:], "its surface has 3 open edges"),
        (np.concatenate([CUBE[:1], CUBE[:1, ::-1]]), "its surface has 3 open edges"),
        (np.empty((0, 3, 3)), "no triangle"),
        (np.zeros((4, 3, 3)), "no triangle"),
        (np.where(CUBE == 1, np.nan, CUBE), "not finite"),
    ],
)
def test_surfaces_without_a_volume_are_refused_by_name(triangles, reason):
    with pytest.raises(NotDecomposed, match=reason):
        decompose(triangles)


def test_an_open_surface_is_enclosed_only_when_asked():
    sheet = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], dtype=float)
    found = decompose(sheet, enclose=True)
    assert found.mesh_volume is None
    low, high = (bound(part.vertices[:, 2]) for part in found.parts for bound in (min, max))
    assert_allclose([low, high], [-1 / 180, 1 / 180], rtol=0.1)


@pytest.mark.parametrize("threshold", [0, 0.005, 1.5, -1, float("nan")])
def test_a_threshold_that_coacd_cannot_take_is_named(threshold):
    with pytest.raises(ValueError, match=r"concavity threshold must lie between 0\.01 and 1"):
        decompose(bent(), threshold=threshold)


@pytest.mark.parametrize("threshold", [0.01, 1])
def test_the_least_and_the_largest_threshold_are_taken(coacd_is, threshold):
    coacd_is(SAW)
    assert len(decompose(bent(), threshold=threshold).parts) == 2


def test_triangles_of_another_shape_are_named():
    with pytest.raises(ValueError, match=r"triangles must have the shape \(t, 3, 3\)"):
        decompose(CORNERS)


@pytest.mark.parametrize("home", ["", "relative/path"])
def test_the_cache_is_in_the_home_unless_said_otherwise(monkeypatch, home):
    monkeypatch.setenv("XDG_CACHE_HOME", home)
    assert cache_folder() == Path(os.path.expanduser("~")) / ".cache" / "overlapper" / "convex_parts"
