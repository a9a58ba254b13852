"""A sweep is held against a recorded one: task by task of the same parameters, measure by measure, by its budgets."""

import math
import re
import shutil
import tracemalloc
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
from sweeping import BALLS, rows, sweep_of, swept

from overlapper.jobs.hand import Done
from overlapper.sweep import comparison as comparison_module
from overlapper.sweep import page
from overlapper.sweep import sweep as sweep_module
from overlapper.sweep.comparison import Recorded
from overlapper.sweep.measures import Measures
from overlapper.sweep.part import TASKS, digest, parts
from overlapper.sweep.tasks import gathered

GRIDS = ["apart=0.1:0.19:4", "seed=0,1"]
NOWHERE = Path("expected/balls.csv")

pytestmark = pytest.mark.usefixtures("balls")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """The folder of a sweep, which tests do not write to."""
    folder = tmp_path_factory.mktemp("recorded")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        Path("balls.py").write_text(BALLS)
        swept("runs", GRIDS)
    return folder / "runs"


@pytest.fixture
def other(recorded, balls):
    """A function that edits rows in a copy of the recorded sweep."""
    shutil.copytree(recorded, "other")
    return edit


def edit(**changes):
    """Rows of the folder `other` with some columns as functions of the row say."""
    for part in [*Path("other/tasks.parquet").iterdir()]:
        table = pyarrow.parquet.read_table(part)
        (row,) = table.to_pylist()
        for name, change in changes.items():
            row[name] = change(row)
        written(pyarrow.Table.from_pylist([row], schema=table.schema), part)


def written(table, part):
    """A part in place of another, named by its digest."""
    data = parts({TASKS: table})[TASKS]
    part.unlink()
    part.with_stem(digest(data)).write_bytes(data)


def compared(check, runs, grids=GRIDS, expected=NOWHERE):
    sweep = sweep_of(grids)
    held = Recorded(Path(check), Path(expected), sweep)
    with sweep.opened(Path(runs)) as store:
        return held.compare(store)


def test_a_sweep_is_as_it_was_recorded(recorded):
    comparison = compared(recorded, recorded)
    assert comparison.lines(10) == [f"All 8 tasks are as in {recorded}."]
    assert not comparison.moved.size and comparison.counts == {}


@pytest.mark.parametrize(
    ("measure", "factor", "moved"),
    [
        ("largest_volume_m3", 1 + 0.5e-9, False),
        ("largest_volume_m3", 1 + 2e-9, True),
        ("mean_volume_m3", 1 - 2e-9, True),
        ("largest_depth_m", 1 + 2e-9, True),
        ("contact_time_s", 1 + 1e-12, False),
        ("contact_time_s", 2 / 3, True),
    ],
)
def test_a_measure_moves_by_more_than_its_budget(recorded, other, measure, factor, moved):
    other(**{measure: lambda row: row[measure] * (factor if row["seed"] else 1.0)})
    comparison = compared("other", recorded)
    assert comparison.counts == ({measure: 4} if moved else {})
    assert {change.parameters["seed"] for change in comparison.worst} == ({1} if moved else set())


def test_forces_are_compared_as_vectors_and_their_rounding_is_that_of_the_surface(recorded, other):
    row = max(rows(recorded), key=lambda row: row["largest_volume_m3"])
    surface = row["largest_volume_m3"] ** (2 / 3)
    other(mean_force_y_m2=lambda row: (row["mean_force_y_m2"] or 0.0) + 1e-12 * surface)
    assert compared("other", recorded).counts == {}
    other(mean_force_y_m2=lambda row: 0.1 * surface)
    assert compared("other", recorded).counts == {"mean_force_m2": 8}


def test_nan_differs_from_numbers_and_not_from_nan(recorded, other):
    other(largest_depth_m=lambda row: math.nan if row["seed"] else row["largest_depth_m"])
    comparison = compared("other", recorded)
    assert comparison.counts == {"largest_depth_m": 4}
    assert comparison.lines(1)[1].endswith(", recorded as nan")
    shutil.copytree("other", "same")
    assert not compared("other", "same").moved.size


def test_a_comparison_block_by_block_is_the_same(recorded, other, monkeypatch):
    other(largest_depth_m=lambda row: row["largest_depth_m"] * (1 + row["apart"]), skipped=lambda row: row["seed"])
    whole = compared("other", recorded)
    assert whole.counts == {"skipped": 4, "largest_depth_m": 8} and whole.parts.shape == (8,)
    monkeypatch.setattr(comparison_module, "BLOCK", 3)
    blocks = compared("other", recorded)
    assert blocks.lines(20) == whole.lines(20)
    assert np.array_equal(blocks.parts, whole.parts) and np.array_equal(blocks.moved, whole.moved)
    assert np.array_equal(blocks.differences["largest_depth_m"], whole.differences["largest_depth_m"])


class AtOnce:
    """An executor whose tasks need no scene and no process; `factor` changes what they come to."""

    workers = 1

    def __init__(self, factor=1.0):
        self.factor = factor

    def shares(self, job, items, limit=None, late=None):
        row = Measures().row() | {"steps": 1, "time_s": 1 / 240}
        for start in range(0, len(items), 500):
            numbers = range(start, min(start + 500, len(items)))
            rows = [row | {"largest_volume_m3": 1e-9 * self.factor * (items[number].number + 1)} for number in numbers]
            yield [*numbers], gathered(job.setup, [(items[k], Done({TASKS: of}, 0.0)) for k, of in zip(numbers, rows)])


def test_the_memory_of_a_comparison_hardly_grows_with_the_tasks(monkeypatch):
    """A row as a dictionary takes some thousand bytes."""
    monkeypatch.setattr(comparison_module, "BLOCK", 500)
    monkeypatch.setattr(sweep_module, "PARTS", 40)  # each part is a file, which costs milliseconds per block
    peaks = []
    for count in (1000, 4000):
        grids = [f"apart=0.1:0.2:{count // 4}", "seed=0,1,2,3"]
        for folder, factor in (("before", 1.0), ("after", 1.001)):
            swept(f"{folder}-{count}", grids, engine=AtOnce(factor))
        sweep = sweep_of(grids)
        with sweep.opened(Path(f"after-{count}")) as store:
            tracemalloc.start()
            comparison = Recorded(Path(f"before-{count}"), NOWHERE, sweep).compare(store)
            peaks.append(tracemalloc.get_traced_memory()[1])
            tracemalloc.stop()
        assert len(comparison.numbers) == len(comparison.moved) == count
        assert comparison.lines(0)[0] == f"{count:,} of {count:,} tasks have moved since before-{count}: " + (
            f"largest_volume_m3 in {count:,}."
        )
    assert (peaks[1] - peaks[0]) / 3000 < 300


def test_parameters_are_equal_to_12_digits_whatever_their_type():
    key = comparison_module._key
    assert key([0.1, 1, "red"]) == key([0.1 + 1e-14, 1.0, "red"]) == key([0.1, True, "red"])
    others = [
        [0.1, 1, "redd"],
        [0.1 + 1e-11, 1, "red"],
        [0.1, 2, "red"],
        [0.1, "1", "red"],
        [10**17, 1],
        [10**17 + 1, 1],
    ]
    assert len({key(each) for each in [[0.1, 1, "red"], *others]}) == 7


def test_budgets_are_those_of_the_expected_file(recorded, other):
    other(largest_volume_m3=lambda row: row["largest_volume_m3"] * 1.01)
    assert len(compared("other", recorded).moved) == 8
    NOWHERE.parent.mkdir()
    NOWHERE.write_text("# budget volume: relative 0.02 absolute 0.0\n")
    assert not compared("other", recorded).moved.size


def test_the_largest_change_is_reported_first_with_its_parameters(recorded, other):
    other(largest_volume_m3=lambda row: row["largest_volume_m3"] * (1 + 1e-3 * row["apart"]))
    first, *worst, more = compared("other", recorded).lines(2)
    assert first == "8 of 8 tasks have moved since other: largest_volume_m3 in 8."
    words = r" +apart=0.19, seed=\d, fate=good, seconds=0.0: largest_volume_m3 is (\S+), recorded as (\S+): "
    words += r"1.9e\+05 times its budget"
    figures = [tuple(map(float, re.fullmatch(words, each).groups())) for each in worst]
    assert [was / now for now, was in figures] == pytest.approx([1 + 1.9e-4] * 2)
    assert more == "    and 6 more"


def test_a_task_that_failed_on_one_side_has_moved(tmp_path):
    grids = ["apart=0.1,0.12", "fate=good,raises"]
    swept("before", grids)
    Path("balls.py").write_text(BALLS.replace('fate == "raises"', "apart == 0.12"))
    swept("after", grids)
    comparison = compared("before", "after", grids)
    assert comparison.counts == {"task": 2}
    assert sorted(comparison.lines(10)[1:]) == [
        "    apart=0.1, seed=0, fate=raises, seconds=0.0: task is done, recorded as raised",
        "    apart=0.12, seed=0, fate=good, seconds=0.0: task is raised, recorded as done",
    ]
    assert comparison.same_failures == 1


def test_tasks_are_matched_by_the_parameters_that_both_have(recorded):
    Path("balls.py").write_text(BALLS.replace('fate="good"', 'fate="good", colour="red"'))
    grids = ["apart=0.1:0.19:4", "seed=1,2"]
    swept("after", grids, steps=3)
    comparison = compared(recorded, "after", grids)
    assert comparison.lines(10) == [
        f"All 4 tasks are as in {recorded}.",
        "Not compared: 4 new tasks, 4 tasks that only the recorded sweep has.",
    ]
    with pytest.raises(ValueError, match=r": two tasks of this sweep have the same apart, seed, "):
        compared(recorded, "after", [*grids, "colour=red,blue"])


def test_a_scene_without_parameters_is_compared(other):
    plain = re.sub(r"\*, .*\):", "):", BALLS.partition('    if fate == "raises"')[0]).replace("seconds)", "0)")
    Path("balls.py").write_text(plain.replace("apart + 1e-3 * seed", "0.15"))
    swept("before", [])
    Path("balls.py").write_text(plain.replace("apart + 1e-3 * seed", "0.16"))
    swept("after", [])
    assert compared("before", "after", []).lines(1)[1].startswith("    the scene: ")
    with pytest.raises(ValueError, match=r"^--check other: two tasks of the recorded sweep cannot be told apart"):
        compared("other", "after", [])


def spoiled(table, data=b"none"):
    Path("other", table).mkdir(exist_ok=True)
    Path("other", table, "a.parquet").write_bytes(data)


def without(column):
    for part in [*Path("other/tasks.parquet").iterdir()]:
        table = pyarrow.parquet.read_table(part)
        written(table.drop_columns([column]), part)


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (lambda: shutil.rmtree("other"), "the folder has no sweep"),
        (lambda: spoiled("tasks.parquet"), "tasks.parquet cannot be read: .*[Pp]arquet"),
        (lambda: spoiled("failures.parquet"), "failures.parquet cannot be read: .*[Pp]arquet"),
        (lambda: without("task"), "tasks.parquet has no column 'task'"),
        (lambda: without("largest_depth_m"), "tasks.parquet has no column 'largest_depth_m'"),
    ],
)
@pytest.mark.usefixtures("other")
def test_a_folder_without_a_sweep_is_refused(spoil, sentence):
    spoil()
    with pytest.raises(ValueError, match=rf"^--check other: {sentence}"):
        Recorded(Path("other"), NOWHERE, sweep_of(GRIDS))


def test_a_sweep_of_other_points_is_refused(recorded):
    with pytest.raises(ValueError, match=r": the folder has no task of this sweep$"):
        Recorded(recorded, NOWHERE, sweep_of(["seed=7"]))


def test_the_page_has_a_map_of_where_it_has_moved():
    grids = ["apart=0.1:0.19:3", "seconds=0.0,0.001", "fate=good,raises"]
    swept("runs", grids)
    shutil.copytree("runs", "other")
    edit(largest_volume_m3=lambda row: row["largest_volume_m3"] * (1 + 1e-3 * (row["apart"] > 0.14)))
    next(Path("other/failures.parquet").iterdir()).unlink()
    sweep = sweep_of(grids)
    held = Recorded(Path("other"), NOWHERE, sweep)
    with sweep.opened(Path("runs")) as store:
        comparison = held.compare(store)
        plain = page.write(sweep, store, "balls.py").read_text()
        text = page.write(sweep, store, "balls.py", comparison=comparison).read_text()
    assert "What has moved" not in plain
    told = "<p>4 of 11 tasks have moved since other: largest_volume_m3 in 4. Not compared: 1 new tasks"
    assert told in text and text.count("<td>largest_volume_m3</td>") == 4
    # Lines over each of the three parameters, maps over each two.
    assert text.count("<svg") == plain.count("<svg") + 6 and "change of largest volume, cm³" in text
    assert "tasks that moved, %" in text
    differences = comparison.differences["largest_volume_m3"]
    assert {*np.sign(differences[comparison.parts > 1])} == {-1}
    assert np.isnan(differences).sum() == 5
