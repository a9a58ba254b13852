"""The benchmark writes the cost of each way into the table of its page, or refuses in one sentence."""

import re

import pytest

from harness import command
from speed import ways
from speed.ways import TYPICAL, Typical


@pytest.fixture
def page(monkeypatch, tmp_path):
    copy = tmp_path / "how.md"
    copy.write_text(ways.PAGE.read_text(encoding="utf-8"), encoding="utf-8")
    few = {name: TYPICAL[name] for name in ("two boxes", "a rounded hull of 80 facets and a box", "two boxes, apart")}
    monkeypatch.setattr(ways, "PAGE", copy)
    monkeypatch.setattr(ways, "TYPICAL", few)
    return copy


def test_the_table_is_measured_anew_and_the_rest_of_the_page_stays(page):
    before = page.read_text(encoding="utf-8")
    command.main(["ways", "--rounds=1"])
    after = page.read_text(encoding="utf-8")
    head, rows = before.split(f"| {' | '.join(ways.HEADING)} |\n|---|---|--:|--:|--:|\n")
    assert after.startswith(head)
    assert after.endswith(rows[rows.index("\n\n") :])
    number = r"[\d.,]+"
    assert re.search(rf"\n\| two boxes \| clipping \| {number} \| {number} \| {number} \|\n", after)
    rounded = "a rounded hull of 80 facets and a box"
    assert re.search(rf"\n\| {rounded} \| closed form \| {number} \| {number} \|  \|\n", after)
    assert re.search(rf"\n\| two boxes, apart \| separation \| {number} \|  \| {number} \|\n\n", after)


def test_a_status_that_the_article_has_wrong_is_not_timed():
    bodies = TYPICAL["a box resting on another, 1e-14 m deep"]
    assert ways.questions(bodies)[1:] == ["", "wrong"]


def test_a_way_that_is_not_the_one_of_the_page_is_named(page):
    ways.TYPICAL["two boxes"] = Typical(TYPICAL["two boxes"].bodies, "tracing")
    before = page.read_text(encoding="utf-8")
    with pytest.raises(SystemExit, match=r"^two boxes: the way is clipping, not tracing$"):
        command.main(["ways", "--rounds=1"])
    assert page.read_text(encoding="utf-8") == before


def test_a_page_without_the_table_is_named(page):
    page.write_text("# How\n", encoding="utf-8")
    with pytest.raises(SystemExit, match=r"how\.md has 0 such tables, not one$"):
        command.main(["ways", "--rounds=1"])
    assert page.read_text(encoding="utf-8") == "# How\n"
