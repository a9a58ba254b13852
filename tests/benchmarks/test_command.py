"""The command line of the benchmarks, and what they share: results files, clocks, tables, processes."""

import re
import time
from importlib import import_module
from pathlib import Path

import pytest

from harness import command, page, results, timing

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("name", command.COMMANDS)
def test_every_benchmark_is_imported_and_says_how_it_is_called(name, capsys):
    if name == "mujoco":
        pytest.importorskip("mujoco")
    module = import_module(command.COMMANDS[name])
    with pytest.raises(SystemExit) as ended:
        command.main([name, "--help"])
    assert ended.value.code == 0 and f"python benchmarks {name}" in capsys.readouterr().out
    assert f"    python benchmarks {name}" in module.__doc__
    assert hasattr(module, "main") is not hasattr(module, "measure")


def test_an_unknown_benchmark_is_refused(capsys):
    with pytest.raises(SystemExit) as ended:
        command.main(["spede"])
    assert ended.value.code == 2 and "invalid choice: 'spede'" in capsys.readouterr().err


def test_pages_name_benchmarks_that_there_are():
    pages = [ROOT / "README.md", ROOT / ".github" / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")]
    named = {name for each in pages for name in re.findall(r"python benchmarks (\S+?)\b", each.read_text("utf-8"))}
    assert set(command.COMMANDS) - {"chart", "stability"} <= named <= set(command.COMMANDS)


def test_results_are_read_as_they_were_written(tmp_path):
    path = tmp_path / "some.csv"
    with results.writing(path, ["name", "us"], results.today(), "missing: nobody") as write:
        write([["two, boxes", "1.5"]])
        assert results.read(path)[1] == [{"name": "two, boxes", "us": "1.5"}]
        write([["a box", ""]])
    notes, rows = results.read(path)
    assert notes == [results.today(), "missing: nobody"] and [row["us"] for row in rows] == ["1.5", ""]
    assert results.of_machine("some.csv").parent.parent == ROOT / "benchmarks" / "results"


def test_calls_take_turns_until_each_has_had_its_share():
    order = []
    quick, slow = timing.in_turn([lambda: order.append("q"), lambda: order.append("s") or time.sleep(2e-3)], 3, 5e-3,
                                 clock=time.perf_counter)  # fmt: skip
    assert order[:4] == ["q", "s", "q", "s"]
    assert 3 <= len(slow) <= 4 and sum(slow) >= 5e-3 and sum(quick) >= 5e-3
    (samples,) = timing.in_turn([lambda: None], 2, least=1e-4)
    assert len(samples) == 2 and all(0 < sample < 1e-5 for sample in samples)
    assert timing.quartiles([1, 2, 3, 4, 5]) == (3, 2, 4)


def test_a_stopwatch_counts_the_time_of_what_is_called_within_for_its_own_part():
    ticks = iter([0, 10_000, 40_000, 100_000])
    watch = timing.Stopwatch(lambda: next(ticks))
    assert watch("outer", lambda: watch("inner", max, 1, 2)) == 2
    assert watch.take() == {"inner": 30.0, "outer": 70.0} and watch.take() == {}


def test_tables_are_in_markdown_and_times_in_units_that_suit():
    assert page.table(["", "a"], [["b", "1"]]) == "|  | a |\n|---|--:|\n| b | 1 |"
    assert page.table(["a", "b"], [], left=0).endswith("|--:|--:|")
    assert [page.duration(us) for us in (0.1234, 1234, 2.5e6)] == ["0.123 µs", "1.23 ms", "2.5 s"]
