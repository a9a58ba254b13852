"""The benchmark of four engines: each experiment runs in each engine, and the page has what was measured."""

import pytest

from harness import command, results

pytest.importorskip("mujoco")

from forces import engines, engines_page
from forces.worlds import ENGINES, Body, Material

HERE = [name for name in ENGINES if name != "Drake"]  # Drake is 170 MB


@pytest.fixture
def short(monkeypatch):
    monkeypatch.setattr(engines, "installed", lambda: {name: ENGINES[name] for name in HERE})
    monkeypatch.setattr(engines, "on_one_processor", lambda: None)
    monkeypatch.setattr(engines, "SUBSTEPS", (1, 4))


@pytest.mark.parametrize(
    ("name", "most"), [("bounce edge", 1e-4), ("slide", 1e-5), ("spin", 1e-3), ("incline", 1e-9), ("turntable", 1e-9)]
)
def test_volumetric_contact_does_what_textbooks_say(name, most):
    error, ms, cost = engines.run(name, ENGINES["volumetric"], 4)
    assert error < most and ms > 0 and cost > 0


@pytest.mark.parametrize("engine", HERE)
@pytest.mark.parametrize(
    "body",
    [
        Body("box", (0.05, 0.04, 0.03), (0, 0, 1), (0.6, 0, 0, 0.8), 2.0, (1, 2, 3), (0.3, 0.2, 0.1)),
        Body("ball", 0.05, (0, 0, 1), velocity=(1, 2, 3), spin=(0.3, 0.2, 0.1)),
        Body("hull", [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], (0, 0, 5), velocity=(1, 2, 3)),
        Body("box", (0.5, 0.5, 0.05), (1, 2, 3), mass=1e6, spin=(0, 0, 3), hinge=True),
    ],
    ids=["box", "ball", "hull", "hinge"],
)
def test_a_body_starts_as_it_is_asked_to(engine, body):
    with ENGINES[engine]([Body("box", (1, 1, 1), (9, 9, 9), mass=0), body], Material(), 4, (0, 0, -9.81)) as world:
        if body.hinge:
            assert world.run(0.1) is None and world.seconds == pytest.approx(0.1)
            return
        linear, angular = world.velocity(1)
        assert world.position(1) == pytest.approx(body.position) and linear == pytest.approx(body.velocity)
        assert angular == pytest.approx(body.spin, abs=1e-12)
        world.run(0.1)
        fallen = world.velocity(1)[0]
        assert fallen == pytest.approx([1, 2, 3 - 0.981])
        assert world.positions()[0] == pytest.approx(body.position + 0.1 * (fallen + body.velocity) / 2, abs=1e-3)


def test_experiments_and_engines_are_rows_and_the_page_has_them(short, tmp_path, capsys):
    assert command.main(["engines", f"--out={tmp_path}", "slide"]) == 0
    _, rows = results.read(tmp_path / "engines.csv")
    assert [(row["engine"], row["substeps"]) for row in rows] == [(name, str(n)) for name in HERE for n in (1, 4)]
    page = (tmp_path / "engines.md").read_text(encoding="utf-8")
    assert "| slide: distance | volumetric |" in page and "$" not in page
    assert (tmp_path / "engines.png").stat().st_size > 10_000
    # Another experiment joins those that were measured before.
    assert command.main(["engines", f"--out={tmp_path}", "roll"]) == 0
    assert {row["experiment"] for row in results.read(tmp_path / "engines.csv")[1]} == {"slide", "roll"}
    with pytest.raises(SystemExit, match="no experiment jump; there are bounce face"):
        command.main(["engines", f"--out={tmp_path}", "jump"])


def test_a_solver_that_fails_is_a_row_and_others_go_on(short, tmp_path, monkeypatch, capsys):
    class Failing(ENGINES["MuJoCo"]):
        def step(self):
            raise RuntimeError("The solver failed to converge. Try another one.")

    monkeypatch.setattr(engines, "installed", lambda: {"Drake": Failing, "MuJoCo": ENGINES["MuJoCo"]})
    rows = list(engines.measured("slide"))
    assert [row[3] == "nan" for row in rows] == [True, True, False, False]
    assert "slide, Drake, 1 substeps: The solver failed to converge\n" in capsys.readouterr().out
    failed = (4, float("nan"), float("nan"))
    assert engines_page.cell([failed], 4) == "failed"
    found = {("slide", "volumetric"): [(1, 1e-3, 50.0)], ("slide", "Drake"): [(1, 1e-2, 60.0), failed]}
    found |= {
        ("spin", "volumetric"): [(1, 1e-3, 50.0)],
        ("spin", "Drake"): [(1, 1e-4, 9.0)],
        ("roll", "Drake"): [failed],
    }
    assert engines_page.beside(found, "Drake") == ["Drake", "2", "1", "1", "1"]
    assert engines_page.beside(found, "Bullet") is None


def test_an_engine_that_is_slow_is_not_run_with_more_substeps(short, monkeypatch):
    monkeypatch.setattr(engines, "LONGEST", 0.0)
    assert [row[2] for row in engines.measured("slide")] == [1] * len(HERE)
