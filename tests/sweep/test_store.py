"""The folder of a sweep: parts are there whole, each once, and of one sweep."""

import errno
import io
import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pyarrow.parquet
import pytest

from overlapper.scenes.scene import Scene
from overlapper.simulation.settings import Asking, Modelling
from overlapper.sweep import part
from overlapper.sweep.part import FAILURES, STEPS, TASKS, filled, must_be_no_columns, parts
from overlapper.sweep.store import Store
from overlapper.sweep.study import Study, Task

IDENTITY = {"scene": "balls", "scene file": "abc", "steps": "3", "overlapper": "1"}


HEADING = {"scene": "balls"}


def task(number, part=0):
    return Task(f"{number:032x}", {"a": float(number)}, number, part)


def names(*numbers):
    return np.array([bytes.fromhex(task(number).name) for number in numbers], "S16")


def tables(done=(), failed=(), steps=False):
    """The parts of some tasks."""
    made = {}
    if done:
        made[TASKS] = filled(TASKS, [(task(n), [{"steps": n}]) for n in done], HEADING)
        if steps:
            made[STEPS] = filled(STEPS, [(task(n), [{"step": 1}, {"step": 2}]) for n in done], HEADING)
    if failed:
        made[FAILURES] = filled(FAILURES, [(task(n), [{"what": "hung"}]) for n in failed], HEADING)
    return parts(made)


def files(folder, table):
    return sorted((folder / f"{table}.parquet").glob("*.parquet"))


def numbers(folder, table):
    """The tasks whose rows are there, as any reader has them."""
    if not (folder / f"{table}.parquet").exists():
        return []
    return sorted(int(row["task"], 16) for row in pyarrow.parquet.read_table(folder / f"{table}.parquet").to_pylist())


class Order:
    """A sweep of the tasks above, in the order of their numbers."""

    @staticmethod
    def numbers(found):
        return np.array([int.from_bytes(name.ljust(16, b"\0"), "big") for name in found])


def test_parts_are_kept_once_and_known_again(tmp_path):
    with Store(tmp_path / "runs", IDENTITY) as store:
        store.keep(tables([1, 2], [3], steps=True))
        store.keep(tables([1, 2], steps=True))
    with Store(tmp_path / "runs", IDENTITY) as store:
        assert (store.done.tolist(), store.failed.tolist()) == (names(1, 2).tolist(), names(3).tolist())
        store.keep(tables([3], steps=True))
        store.settle()
        assert (store.done.tolist(), store.failed.tolist()) == (names(1, 2, 3).tolist(), [])
    assert numbers(tmp_path / "runs", TASKS) == [1, 2, 3]
    assert numbers(tmp_path / "runs", STEPS) == [1, 1, 2, 2, 3, 3]
    # Readers of an empty folder would complain.
    assert not (tmp_path / "runs" / "failures.parquet").exists()


def test_failures_of_tasks_that_are_done_are_taken_out_of_their_part(tmp_path):
    with Store(tmp_path, IDENTITY) as store:
        store.keep(tables(failed=[1, 2, 3]))
        store.keep(tables([2], [3]))
    with Store(tmp_path, IDENTITY) as store:
        assert (store.done.tolist(), store.failed.tolist()) == (names(2).tolist(), names(1, 3).tolist())
    assert numbers(tmp_path, FAILURES) == [1, 3]


def test_a_task_is_done_when_all_its_parts_are_there(tmp_path, monkeypatch):
    def full(source, target):
        if "tasks.parquet" in str(target):
            raise OSError(errno.ENOSPC, "No space left on device", str(target))
        rename(source, target)

    rename = os.replace
    with Store(tmp_path, IDENTITY) as store:
        monkeypatch.setattr(os, "replace", full)
        with pytest.raises(OSError, match="No space left"):
            store.keep(tables([1], steps=True))
    assert len(files(tmp_path, STEPS)) == 1
    with Store(tmp_path, IDENTITY) as store:
        assert not len(store.done) and store.broken == []
    assert files(tmp_path, STEPS) == []


def test_pieces_make_the_same_part_as_all_tasks_at_once(tmp_path):
    """In whatever order they come, and if a kill came between the part and the end of its pieces."""
    with Store(tmp_path / "whole", IDENTITY) as store:
        store.keep(tables([1, 2, 4, 5], [3], steps=True))
    with Store(tmp_path / "pieces", IDENTITY) as store:
        kept = [*store.keep_piece(tables([4], [3], steps=True)), *store.keep_piece(tables([1, 5], steps=True))]
    with Store(tmp_path / "pieces", IDENTITY) as store:
        assert {path: found.tolist() for path, found in store.pieces.items()} == {
            kept[0]: names(4).tolist(),
            kept[1]: names(3).tolist(),
            kept[2]: names(1, 5).tolist(),
        }
        kept += store.keep_piece(tables([2], steps=True))
        spare = shutil.copytree(tmp_path / "pieces" / ".unfinished", tmp_path / "spare")
        store.assemble(Order, kept)
    assert not (tmp_path / "pieces" / ".unfinished").exists()
    for _ in range(2):
        for table in (TASKS, STEPS, FAILURES):
            (whole,), (assembled,) = (files(tmp_path / name, table) for name in ("whole", "pieces"))
            assert whole.name == assembled.name and whole.read_bytes() == assembled.read_bytes()
        shutil.copytree(spare, tmp_path / "pieces" / ".unfinished", dirs_exist_ok=True)
        with Store(tmp_path / "pieces", IDENTITY) as store:
            store.assemble(Order, kept)


@pytest.mark.parametrize("table", [TASKS, STEPS, FAILURES])
@pytest.mark.parametrize("place", [".", ".unfinished"])
def test_a_bit_that_has_changed_anywhere_in_a_part_is_noticed(tmp_path, table, place):
    """In its pages, its footer and its statistics; the part is named, and its tasks are missing."""
    with Store(tmp_path, IDENTITY) as store:
        (store.keep if place == "." else store.keep_piece)(tables([1, 2], [3], steps=True))
    (path,) = files(tmp_path / place, table)
    true = path.read_bytes()
    for bit in range(3, len(true), len(true) // 7):
        spare = shutil.copytree(tmp_path, tmp_path.with_name("spare"))
        (rotten,) = files(spare / place, table)
        rotten.write_bytes(true[:bit] + bytes([true[bit] ^ 4]) + true[bit + 1 :])
        with Store(spare, IDENTITY) as store:
            assert store.broken == [rotten]
            there = [found.tolist() for found in store.pieces.values()] if place != "." else []
            there += [each.tolist() for each in (store.done, store.failed) if len(each)]
            assert there == [names(1, 2).tolist() if table == FAILURES else names(3).tolist()]
        shutil.rmtree(spare)


def test_leftovers_of_a_killed_sweep_are_cleaned_up(tmp_path):
    with Store(tmp_path, IDENTITY) as store:
        store.keep(tables([1], steps=True))
        store.keep(tables([2], steps=True))
    (tmp_path / ".begun.parquet").write_bytes(b"half")
    for name, half in (("empty", b""), ("short", b"PAR1"), ("cut", b"PAR1PAR1PAR1")):
        (tmp_path / "tasks.parquet" / f"{name}.parquet").write_bytes(half)
    # A power cut may leave the row of a task without its steps.
    lost = files(tmp_path, STEPS)[0]
    lost.unlink()
    with Store(tmp_path, IDENTITY) as store:
        assert len(store.done) == 1 and len(store.broken) == 4 and lost in store.broken
    assert len(files(tmp_path, TASKS)) == len(files(tmp_path, STEPS)) == 1
    assert not (tmp_path / ".begun.parquet").exists()


def test_a_folder_of_an_earlier_version_is_left_alone(tmp_path):
    (tmp_path / "sweep.json").write_text(json.dumps(IDENTITY))
    (tmp_path / "tasks.parquet").mkdir()
    (tmp_path / "tasks.parquet" / f"{task(1).name}.parquet").write_bytes(b"of its only task")
    with pytest.raises(ValueError, match=r"has parts None, not named by digest: give another --out$"):
        Store(tmp_path, IDENTITY)
    assert len(files(tmp_path, TASKS)) == 1


def test_two_sweeps_do_not_work_in_one_folder(tmp_path):
    with Store(tmp_path, IDENTITY), pytest.raises(ValueError, match=rf"^another sweep is running in {tmp_path}$"):
        Store(tmp_path, IDENTITY)
    Store(tmp_path, IDENTITY).close()


@pytest.mark.parametrize(
    ("other", "words"),
    [
        ({"scene": "boxes"}, "has scene balls, not boxes: give another --out"),
        ({"steps": "4"}, "has steps 3, not 4: give another --out"),
        ({"overlapper": "2"}, "has overlapper 1, not 2: give another --out"),
    ],
)
def test_a_folder_belongs_to_one_sweep(tmp_path, other, words):
    Store(tmp_path, IDENTITY).close()
    with pytest.raises(ValueError, match=r"^the sweep in ") as refused:
        Store(tmp_path, IDENTITY | other)
    assert str(refused.value) == f"the sweep in {tmp_path} {words}"


def test_a_scene_file_that_has_changed_is_another_sweep(tmp_path):
    Store(tmp_path, IDENTITY).close()
    with pytest.raises(
        ValueError, match=r"^the scene file has changed since the sweep in .* began: give another --out$"
    ):
        Store(tmp_path, IDENTITY | {"scene file": "xyz"})


@pytest.mark.parametrize("text", ["half", "7", '["a"]'])
def test_a_folder_without_a_readable_description_is_refused(tmp_path, text):
    (tmp_path / "sweep.json").write_text(text)
    with pytest.raises(
        ValueError, match=r"sweep.json is damaged, so the sweep in .* is not known: give another --out$"
    ):
        Store(tmp_path, IDENTITY)


def test_the_name_of_a_task_depends_on_all_its_inputs(tmp_path):
    scene = tmp_path / "s.py"
    scene.write_text("STEPS = 1\ndef build(client, *, a=1.0): pass\n")
    study = Study.of(scene, 3)
    name = study.digests()({"a": 1.0})
    assert len(name) == 16 and name == Study.of(scene, 3).digests()({"a": 1.0})
    assert name != study.digests()({"a": 1.0000000000000002})
    assert name != Study.of(scene, 4).digests()({"a": 1.0})
    others = {"contact": "volumetric"}, {"asking": Asking(tolerance=1e-4)}, {"modelling": Modelling(surface="margin")}
    assert name not in [Study.of(scene, 3, **each).digests()({"a": 1.0}) for each in others]
    assert name != Study.of(scene, 3, kept=2).digests()({"a": 1.0})
    assert name != replace(study, versions={"overlapper": "9"}).digests()({"a": 1.0})
    scene.write_text(scene.read_text() + "# other\n")
    assert name != Study.of(scene, 3).digests()({"a": 1.0})
    # A sweep that has begun goes on with the file as it was read.
    assert isinstance(study.loaded({"a": 2.0}), Scene) and study.loaded({"a": 2.0}).parameters == {"a": 2.0}
    assert json.loads(json.dumps(study.identity())) == study.identity()


def test_equal_rows_are_equal_bytes_with_the_parameters_in_each():
    one = Task("0" * 32, {"a": 1.0, "n": 2, "on": True})
    made = [parts({FAILURES: filled(FAILURES, [(one, [{"what": "hung"}])], {"scene": "s"})}) for _ in range(2)]
    assert made[0] == made[1]
    table = pyarrow.parquet.read_table(io.BytesIO(made[0][FAILURES]))
    (row,) = table.to_pylist()
    expected = {"task": "0" * 32, "a": 1.0, "n": 2, "on": True, "what": "hung", "sentence": None, "traceback": None}
    assert row == expected
    assert table.schema.metadata[b"scene"] == b"s"


@pytest.mark.parametrize(
    ("name", "table"), [("task", "tasks"), ("steps", "tasks"), ("bodyA", "steps"), ("what", "failures")]
)
def test_a_parameter_that_is_called_like_a_column_is_refused(name, table):
    with pytest.raises(
        ValueError, match=rf"^the parameter '{name}' must not have the name of a column of the table {table}$"
    ):
        must_be_no_columns({name: 1})
    must_be_no_columns({"mass": 1})


def test_a_sweep_names_what_is_to_be_installed(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(ImportError, match=r"^a sweep needs pyarrow: pip install pyarrow$"):
        part.arrow()
    monkeypatch.setitem(sys.modules, "filelock", None)
    with pytest.raises(ImportError, match=r"^a sweep needs filelock: pip install filelock$"):
        Store(tmp_path, IDENTITY)


@pytest.mark.parametrize("module", ["sweep.sweep", "sweep.page", "cli.sweep"])
def test_sweeps_are_imported_where_there_is_no_fcntl_as_on_windows(module):
    program = f"import sys; sys.modules['fcntl'] = sys.modules['resource'] = None; import overlapper.{module}"
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)
