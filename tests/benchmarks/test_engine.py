"""The benchmark of MuJoCo: its page has all models, packages and types, and a wrong volume ends the run."""

from types import SimpleNamespace

import pytest

from harness import command, results

mujoco = pytest.importorskip("mujoco")

from overlapper.mujoco import Bodies  # noqa: E402
from speed import engine, engine_models, engine_page  # noqa: E402


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(engine, "SETTLING", 150)
    monkeypatch.setattr(engine, "SAMPLES", 3)
    monkeypatch.setattr(engine, "on_one_processor", lambda: None)
    monkeypatch.setattr(engine, "GRIDS", {name: engine.GRIDS[name] for name in ("100 boxes", "100 capsules")})
    monkeypatch.setattr(engine, "TYPES", ("plane", "capsule", "box"))
    monkeypatch.setattr(engine_models, "find_spec", lambda name: None)


def test_the_page_has_times_and_depths(small, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(engine, "find_spec", lambda name: None)
    assert command.main(["mujoco", "--cases=12", f"--out={tmp_path}"]) == 0
    assert "dm_control is not installed: its models are left out" in capsys.readouterr().out
    _, found = engine_page.read(tmp_path / "mujoco.csv")
    assert found["steps"]["100 boxes"]["geoms"] == 101 and found["steps"]["100 boxes"]["again"] > 0
    figures = found["distances"]["capsule–box"]
    assert figures["overlapping"] == figures["agree"] + figures["ours"] > 8
    assert figures["ours"] == figures["shallow"] > 0 and figures["difference"] > 0.01 and figures["sides"] == 0
    assert found["distances"]["plane–box"]["difference"] < 1e-14
    page = (tmp_path / "mujoco_benchmarks.md").read_text(encoding="utf-8")
    assert "| 100 boxes | 101 |" in page and "| capsule, box |" in page and "$" not in page


def test_the_models_of_dm_control_are_measured_if_it_is_installed(small, tmp_path, monkeypatch):
    (tmp_path / "suite").mkdir()
    for name in engine.SUITE:
        (tmp_path / "suite" / f"{name}.xml").write_text("<mujoco><worldbody><geom size='.1'/></worldbody></mujoco>")
    spec = SimpleNamespace(submodule_search_locations=[str(tmp_path)])
    monkeypatch.setattr(engine, "find_spec", lambda name: spec)
    assert [name for name, _ in engine.models()][:3] == [f"dm_control's {name}" for name in engine.SUITE]


def test_the_pairs_of_the_models_of_a_package_are_counted(tmp_path, monkeypatch):
    ball = "<body pos='{}'><freejoint/><geom size='.1'/></body>"
    body = f"<geom type='plane' size='1 1 1'/>{ball.format('0 0 .05')}{ball.format('1 0 .1')}{ball.format('2 0 1')}"
    (tmp_path / "model.xml").write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    (tmp_path / "part.xml").write_text("<mujocoinclude/>")
    (tmp_path / "other.xml").write_text("<robot/>")
    spec = SimpleNamespace(submodule_search_locations=[str(tmp_path)])
    monkeypatch.setattr(engine_models, "find_spec", lambda name: spec if name == "robots" else None)
    monkeypatch.setattr(engine_models, "POSES", 1)
    counts = engine_models.model_figures("robots")
    assert counts == {"models": 1, "poses": 1, "pairs": 1, "ours": 0, "theirs": 0, "touching": 0, "skipped": 0}
    assert engine_models.model_figures("others") is None
    # A pair that only one side has is counted on that side.
    monkeypatch.setattr(engine_models, "contact_depths", lambda data: {(0, 3): 0.5, (1, 2): 1e-12})
    counts = engine_models.model_figures("robots")
    assert (counts["pairs"], counts["ours"], counts["theirs"], counts["touching"]) == (0, 1, 1, 1)


def test_a_volume_that_is_not_that_of_a_single_call_ends_the_run(small, tmp_path, monkeypatch, capsys):
    true = engine.overlap
    half = lambda *pair: SimpleNamespace(volume=0.5 * true(*pair).volume, volume_error=0.0)  # noqa: E731
    monkeypatch.setattr(engine, "overlap", half)
    monkeypatch.setattr(engine, "find_spec", lambda name: None)
    assert command.main(["mujoco", f"--out={tmp_path}"]) == 1
    assert "overlapper: wrong: 100 boxes: " in capsys.readouterr().err
    assert results.read(tmp_path / "mujoco.csv")[1] == []


@pytest.mark.parametrize("kinds", [("plane", "mesh"), ("mesh", "ellipsoid")])
def test_a_random_pair_has_the_types_that_are_asked_for(kinds):
    shapes = Bodies(*engine.random_pair(kinds, 3)).shapes
    assert [type(each).__name__ for each in shapes] == [
        {"plane": "HalfSpace", "mesh": "Hull", "ellipsoid": "Ellipsoid"}[kind] for kind in kinds
    ]
