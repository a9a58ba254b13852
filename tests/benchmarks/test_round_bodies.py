"""The page of round bodies: it has all classes and scenes, its volumes are those of single calls or the run ends."""

import pytest
from round_exact import exactly

from harness import command
from overlapper import Box, Placed, Sphere, overlap
from speed import round as round_bodies
from speed import round_page


@pytest.fixture
def small(monkeypatch):
    """Few classes, and scenes without bodies that fall for seconds."""
    classes = [("box", "box"), ("box", "ball"), ("ball", "ellipsoid"), ("capsule", "rounded hull")]
    monkeypatch.setattr(round_bodies, "CLASSES", classes)
    monkeypatch.setattr(round_bodies, "on_one_processor", lambda: None)
    heaps = {
        name: round_bodies.Heap(heap.build, 0, 2, heap.surface, heap.measures)
        for name, heap in round_bodies.heaps().items()
    }
    monkeypatch.setattr(round_bodies, "heaps", lambda: heaps)


def test_classes_batches_margins_and_scenes_are_measured_and_their_page_is_drawn(small, tmp_path):
    assert command.main(["round", "--pairs=8", "--rounds=1", f"--out={tmp_path}"]) == 0
    figures = round_page.read(tmp_path / "round.csv")[1]
    assert set(figures["class"]) == {"box, box", "box, ball", "ball, ellipsoid", "capsule, rounded hull"}
    assert all(0 < each["median"] <= each["99 %"] for each in figures["class"].values())
    assert figures["class"]["ball, ellipsoid"]["dual hull"] == 100
    assert set(figures["scene"]) == set(round_bodies.heaps()) == set(round_page.AIMS)
    page = (tmp_path / "round.md").read_text(encoding="utf-8")
    assert "| capsule, rounded hull |" in page and "$" not in page
    assert "**Planes around ellipsoids.**" in page and "ball and ellipsoid" in " ".join(page.split())
    assert (tmp_path / "round.png").stat().st_size > 10_000 and (tmp_path / "round.svg").is_file()


def test_a_volume_of_a_batch_that_is_not_that_of_a_single_call_ends_the_run(small, tmp_path, monkeypatch, capsys):
    class Half:
        def __init__(self, *shapes):
            self.volume, self.way = 0.5 * true(*shapes).volume, true(*shapes).way
            self.depth, self.normal = true(*shapes).depth, true(*shapes).normal

    true = round_bodies.overlap
    monkeypatch.setattr(round_bodies, "overlap", Half)
    assert command.main(["round", "--pairs=4", "--rounds=1", f"--out={tmp_path}"]) == 1
    assert "wrong: box, box: volumes of a batch" in capsys.readouterr().err
    assert not (tmp_path / "round.csv").exists()


def test_a_ball_over_an_edge_is_measured_as_by_slices_along_it():
    ball, cube = Placed(Sphere(0.5), (1.25, 1.25, 0.0625)), Placed(Box([1, 1, 1]))
    expected = exactly(ball, cube).volume
    assert round_bodies.over_an_edge(ball) == pytest.approx(expected, rel=1e-15)
    assert overlap(ball, cube).volume == pytest.approx(expected, rel=1e-13)


def test_figures_that_keep_their_aim_are_bold():
    assert round_page.times(1.5, 1.5) == "**1.5**" and round_page.times(1.51, 1.5) == "1.5"
    assert round_page.aim_of("fifty capsule humanoids", {"stepSimulation": 30.0}) == 15
