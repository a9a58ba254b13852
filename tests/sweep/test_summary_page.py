"""The summary of a sweep: its charts group what a grid or a sample has, and its commands show what they say."""

import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sweeping import rows, sweep_of, swept

from overlapper.simulation.settings import Modelling
from overlapper.sweep import charts, page
from overlapper.sweep.charts import APART, BINS, MEASURES, axis


def test_values_of_a_grid_are_told_apart_and_those_of_a_sample_are_binned():
    grid = axis("mass", [1.0, 2.0, 4.0, 2.0])
    assert grid.group.tolist() == [0, 1, 2, 1] and not grid.log
    assert grid.middles.tolist() == [1, 2, 4] and grid.edges.tolist() == [0.5, 1.5, 3, 5]
    sample = axis("mass", np.linspace(0, 1, APART + 1).tolist())
    assert len(sample.middles) == BINS and set(sample.group.tolist()) == set(range(BINS))
    assert sample.edges[0] == 0 and sample.edges[-1] == 1


def test_values_in_factors_of_ten_have_logarithmic_axes():
    scale = axis("mass", [0.1, 1.0, 10.0])
    assert scale.log and scale.middles == pytest.approx([0.1, 1, 10])
    assert scale.edges == pytest.approx([10**-1.5, 10**-0.5, 10**0.5, 10**1.5])
    assert not axis("count", [1, 100]).log


def test_texts_and_truths_have_their_names():
    assert axis("kind", ["b", "a", "b"]).labels == ["a", "b"]
    assert axis("soft", [True, False]).labels == ["False", "True"]


def test_charts_are_the_same_again_and_are_svg():
    values = np.array([1e-6, 2e-6, 3e-6, 4e-6])
    measured = [(measure, values) for measure in MEASURES]
    across, up = axis("mass", [1.0, 2.0, 1.0, 2.0]), axis("kind", ["a", "a", "b", "b"])
    for drawn in (charts.lines(across, measured), charts.heat_map(across, up, measured[:2])):
        assert ET.fromstring(drawn).tag == "{http://www.w3.org/2000/svg}svg"
        assert "largest volume, cm³" in drawn and "mass" in drawn
    assert charts.lines(across, measured) == charts.lines(across, measured)


def test_ticks_are_the_values_of_a_short_parameter_and_have_no_offset():
    assert axis("mass", [0.1, 10**-0.5, 1.0]).labels == ["0.1", "0.316", "1"]
    assert axis("mass", np.arange(9.0)).labels is None
    values = 1e-6 * (123456 + np.array([0.0, 1.0, 2.0, 3.0]))
    across, up = axis("mass", [0.1, 1.0, 10.0, 100.0]), axis("friction", [0.3, 0.5, 0.3, 0.5])
    for drawn in (charts.lines(across, [(MEASURES[0], values)]), charts.heat_map(across, up, [(MEASURES[0], values)])):
        texts = {text.text for text in ET.fromstring(drawn).iter("{http://www.w3.org/2000/svg}text")}
        assert {"0.1", "100"} <= texts and any(text.startswith("12345") for text in texts)
        assert not any(text.startswith("+") for text in texts)


@pytest.mark.usefixtures("balls")
def test_a_page_of_samples_and_settings_has_maps_and_whole_commands():
    grids = ["apart=0.1:0.19:30", "seconds=0.0,0.001", "seed=0,1"]
    swept("runs", grids, steps=1)
    sweep = sweep_of(grids, steps=1)
    sweep.study = replace(sweep.study, modelling=Modelling(surface="margin"))
    with sweep_of(grids, steps=1).opened(Path("runs")) as store:
        assert page.write(sweep_of(grids, steps=1), store, "my scene.py") == Path("runs/summary.html")
    text = Path("runs/summary.html").read_text()
    assert "120 of 120 tasks are done over apart (30), seconds (2), seed (2)." in text
    assert text.count("<svg") == 4 and "Over two parameters" in text  # three of lines, one map
    row = rows("runs")[0] | {"apart": 0.125, "seed": 0, "seconds": 0.0}
    assert page.command(sweep, "my scene.py", row, Path("a.html")) == (
        "overlapper run 'my scene.py' --set=apart=0.125 --steps=1 --surface=margin --html=a.html"
    )
    sweep.study = replace(sweep.study, modelling=Modelling(), contact="volumetric")
    assert page.command(sweep, "my scene.py", row, Path("a.html")).endswith(
        " --steps=1 --contact=volumetric --html=a.html"
    )
    assert page.command(sweep, "my scene.py", row, Path("a.html")).startswith("overlapper view ")


@pytest.mark.usefixtures("balls")
def test_the_summary_counts_the_tasks_in_which_something_overlaps():
    grids = ["apart=0.15,0.199,0.201,0.25,0.3"]
    swept("runs", grids, steps=1)
    with sweep_of(grids, steps=1).opened(Path("runs")) as store:
        page.write(sweep_of(grids, steps=1), store, "balls.py")
    text = Path("runs/summary.html").read_text()
    assert "5 of 5 tasks are done over apart (5). Something overlaps in 2 of them." in text
    assert "<a href" not in text


@pytest.mark.usefixtures("balls")
def test_the_links_of_the_summary_are_to_pages_that_exist():
    swept("runs", ["apart=0.15,0.199"], steps=1)
    with sweep_of(["apart=0.15,0.199"], steps=1).opened(Path("runs")) as store:
        page.write(sweep_of(["apart=0.15,0.199"], steps=1), store, "balls.py", pages=1)
    (link,) = re.findall(r'<a href="([^"#]*)#t=', Path("runs/summary.html").read_text())
    assert Path("runs", link).is_file()


def test_the_summary_names_what_is_to_be_installed(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "matplotlib.figure", None)
    with pytest.raises(ImportError, match=r"^the summary of a sweep needs matplotlib: pip install matplotlib$"):
        charts.must_be_there()
