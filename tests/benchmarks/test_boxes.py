"""The page about IoU of boxes is that of its results, and the peers agree with this package."""

from argparse import Namespace
from pathlib import Path

import numpy as np
import pytest

from boxes import iou, million, page, vectors
from harness import results
from overlapper import arrays

ROOT = Path(__file__).parents[2]


def test_the_page_is_that_of_the_results(tmp_path):
    (results,) = (ROOT / "benchmarks/results").glob("*/boxes.csv")
    written = page.write_page(results, tmp_path).read_text(encoding="utf-8")
    assert written == (ROOT / "docs/boxes.md").read_text(encoding="utf-8")


def test_peers_agree_where_boxes_overlap_well():
    rng = np.random.default_rng(2)
    numbers = iou.random_boxes(rng, 4)
    a, b = arrays.boxes(*numbers), arrays.boxes(*iou.beside(rng, numbers, 0.1))
    volumes, ratios = arrays.volume(a, b, aligned=True), arrays.iou(a, b, aligned=True)
    for k in range(4):
        assert iou.by_scipy(a, b, k) == pytest.approx(volumes[k], rel=1e-9)
        assert iou.by_points(rng, a, b, k) == pytest.approx(ratios[k], abs=1e-2)
    assert iou.proved_error(a, b, volumes, range(4)) < 1e-13
    row = np.array([1, 2, 3, 4, 0.5])
    assert iou.rectangle(row).area == pytest.approx(12) and iou.rectangle(row).centroid.coords[0] == pytest.approx(
        (1, 2)
    )


def test_pairs_of_the_million_are_proved():
    for rotation, offset in (("yaw", 0.1), ("any", 1e-8)):
        found = million.of_class(np.random.default_rng(0), Namespace(pairs=50, proved=3), rotation, offset)
        assert found["pairs"] == 50 and found["proved"] == 3 and found["above"] == 0
        assert found["off"] < 1e-12 and 0 < found["stated"] <= 1e-12


def test_one_command_measures_all_figures_of_the_page(tmp_path, monkeypatch):
    for name in ("errors", "times"):
        monkeypatch.setattr(iou, name, lambda rng: [("times", "street", "ours", 1.0)])
    monkeypatch.setattr(iou, "published", list)
    monkeypatch.setattr(iou, "version", lambda name: "1.0")
    asked = []
    for module in (iou, million, vectors):
        monkeypatch.setattr(module, "on_one_processor", lambda: None)
    for module in (million, vectors):
        monkeypatch.setattr(module, "measure", lambda chosen, path: asked.append((vars(chosen), path)))
    iou.measure(Namespace(all=False), tmp_path / "boxes.csv")
    assert not asked
    iou.measure(Namespace(all=True), tmp_path / "boxes.csv")
    assert [path.name for _, path in asked] == ["million_boxes.csv", "vectors.csv"]
    assert asked[0][0]["pairs"] == 50_000 and asked[1][0]["rounds"] == 15
    assert len(results.read(tmp_path / "boxes.csv")[1]) == 2


def test_volumes_without_avx2_have_the_same_bits(tmp_path, monkeypatch):
    monkeypatch.setattr(vectors, "on_one_processor", lambda: None)
    vectors.measure(Namespace(rounds=2), tmp_path / "vectors.csv")
    _, rows = results.read(tmp_path / "vectors.csv")
    assert len(rows) == 4 and all(float(row["value"]) > 0 for row in rows)
