"""The page of round bodies has all classes and meshes, in words and as a picture."""

from harness import command
from speed import round as round_bodies
from speed import round_page


def test_classes_and_margins_are_measured_and_their_page_is_drawn(monkeypatch, tmp_path):
    classes = [("box", "box"), ("box", "ball"), ("capsule", "ellipsoid"), ("capsule", "rounded hull")]
    monkeypatch.setattr(round_bodies, "CLASSES", classes)
    monkeypatch.setattr(round_bodies, "QUANTITIES", ("box, box", "box, ball"))
    monkeypatch.setattr(round_bodies, "on_one_processor", lambda: None)
    assert command.main(["round", "--pairs=8", "--rounds=1", f"--out={tmp_path}"]) == 0
    figures = round_page.read(tmp_path / "round.csv")[1]
    assert set(figures["class"]) == {"box, box", "box, ball", "capsule, ellipsoid", "capsule, rounded hull"}
    assert all(0 < each["median"] <= each["99 %"] for each in figures["class"].values())
    assert figures["class"]["capsule, ellipsoid"]["slicing"] == 100
    assert set(figures["quantity"]["box, ball"]) == {"volume", "patch", "errors", "six, calls", "six, batch"}
    page = (tmp_path / "round.md").read_text(encoding="utf-8")
    assert (
        "| **box, box** |" in page
        and "| capsule, rounded hull |" in page
        and "| meshes of 8 corners |" in page
        and "$" not in page
    )
    assert (tmp_path / "round.png").stat().st_size > 10_000
