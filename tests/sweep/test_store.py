"""The folder of a sweep: parts are there whole, each once, and of one sweep."""

import errno
import json
import os
import subprocess
import sys
from dataclasses import replace

import pytest

from overlapper.scenes.scene import Scene
from overlapper.simulation.settings import Asking, Modelling
from overlapper.sweep import part as parts
from overlapper.sweep.part import FAILURES, STEPS, TASKS, must_be_no_columns, part
from overlapper.sweep.store import Store
from overlapper.sweep.study import Study

IDENTITY = {"scene": "balls", "scene file": "abc", "steps": "3", "overlapper": "1"}


def whole(words=b""):
    """Bytes that begin and end as a Parquet file does."""
    return b"PAR1" + words + b"PAR1PAR1"


def files(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*.parquet") if path.is_file())


def test_parts_are_kept_once_and_known_again(tmp_path):
    with Store(tmp_path / "runs", IDENTITY) as store:
        store.keep("a", {TASKS: whole(b"1"), STEPS: whole(b"2")})
        store.keep("b", {FAILURES: whole(b"3")})
        store.keep("a", {TASKS: whole(b"1"), STEPS: whole(b"2")})
    with Store(tmp_path / "runs", IDENTITY) as store:
        assert (store.done, store.failed) == ({"a"}, {"b"})
        store.keep("b", {TASKS: whole(b"4")})
        assert (store.done, store.failed) == ({"a", "b"}, set())
    assert files(tmp_path / "runs") == ["steps.parquet/a.parquet", "tasks.parquet/a.parquet", "tasks.parquet/b.parquet"]
    # Readers of an empty folder would complain.
    assert not (tmp_path / "runs" / "failures.parquet").exists()


def test_a_task_is_done_when_all_its_parts_are_there(tmp_path, monkeypatch):
    def full(source, target):
        if "tasks.parquet" in str(target):
            raise OSError(errno.ENOSPC, "No space left on device", str(target))
        rename(source, target)

    rename = os.replace
    with Store(tmp_path, IDENTITY) as store:
        monkeypatch.setattr(os, "replace", full)
        with pytest.raises(OSError, match="No space left"):
            store.keep("a", {TASKS: whole(b"1"), STEPS: whole(b"2")})
    with Store(tmp_path, IDENTITY) as store:
        assert store.done == set()
    assert files(tmp_path) == ["steps.parquet/a.parquet"]


def test_leftovers_of_a_killed_sweep_are_cleaned_up(tmp_path):
    with Store(tmp_path, IDENTITY) as store:
        store.keep("a", {TASKS: whole(b"1")})
    (tmp_path / "failures.parquet").mkdir()
    for task in "ab":
        (tmp_path / "failures.parquet" / f"{task}.parquet").write_bytes(whole(b"3"))
    (tmp_path / ".begun.parquet").write_bytes(b"half")
    for name, half in (("empty", b""), ("short", b"PAR1"), ("cut", whole()[:-1] + b"\0")):
        (tmp_path / "tasks.parquet" / f"{name}.parquet").write_bytes(half)
    # A power cut may leave the row of a task without its steps.
    (tmp_path / "steps.parquet").mkdir()
    (tmp_path / "steps.parquet" / "a.parquet").write_bytes(whole(b"2"))
    (tmp_path / "steps.parquet" / "c.parquet").write_bytes(b"PAR1")
    (tmp_path / "tasks.parquet" / "c.parquet").write_bytes(whole(b"1"))
    with Store(tmp_path, IDENTITY) as store:
        assert (store.done, store.failed) == ({"a"}, {"b"})
    left = [
        "failures.parquet/b.parquet",
        "steps.parquet/a.parquet",
        "tasks.parquet/a.parquet",
        "tasks.parquet/c.parquet",
    ]
    assert files(tmp_path) == left


def test_two_sweeps_do_not_work_in_one_folder(tmp_path):
    with Store(tmp_path, IDENTITY), pytest.raises(ValueError, match=rf"^another sweep is at work in {tmp_path}$"):
        Store(tmp_path, IDENTITY)
    Store(tmp_path, IDENTITY).close()


@pytest.mark.parametrize(
    ("other", "words"),
    [
        ({"scene": "boxes"}, "is of scene balls, not boxes: give another --out"),
        ({"steps": "4"}, "is of steps 3, not 4: give another --out"),
        ({"overlapper": "2"}, "is of overlapper 1, not 2: give another --out"),
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
        ValueError, match=r"^the scene file is not that of the sweep in .* any more: give another --out$"
    ):
        Store(tmp_path, IDENTITY | {"scene file": "xyz"})


@pytest.mark.parametrize("text", ["half", "7", '["a"]'])
def test_a_folder_without_a_readable_description_is_refused(tmp_path, text):
    (tmp_path / "sweep.json").write_text(text)
    with pytest.raises(ValueError, match=r"sweep.json does not say what is in .*: give another --out$"):
        Store(tmp_path, IDENTITY)


def test_the_name_of_a_task_depends_on_all_its_inputs(tmp_path):
    scene = tmp_path / "s.py"
    scene.write_text("STEPS = 1\ndef build(client, *, a=1.0): pass\n")
    study = Study.of(scene, 3)
    name = study.digest({"a": 1.0})
    assert len(name) == 32 and name == Study.of(scene, 3).digest({"a": 1.0})
    assert name != study.digest({"a": 1.0000000000000002})
    assert name != Study.of(scene, 4).digest({"a": 1.0})
    others = {"contact": "volumetric"}, {"asking": Asking(tolerance=1e-4)}, {"modelling": Modelling(surface="margin")}
    assert name not in [Study.of(scene, 3, **each).digest({"a": 1.0}) for each in others]
    assert name != Study.of(scene, 3, kept=2).digest({"a": 1.0})
    assert name != replace(study, versions={"overlapper": "9"}).digest({"a": 1.0})
    scene.write_text(scene.read_text() + "# other\n")
    assert name != Study.of(scene, 3).digest({"a": 1.0})
    # A sweep that has begun goes on with the file as it was read.
    assert isinstance(study.loaded({"a": 2.0}), Scene) and study.loaded({"a": 2.0}).parameters == {"a": 2.0}
    assert json.loads(json.dumps(study.identity())) == study.identity()


def test_equal_rows_are_equal_bytes_with_the_parameters_in_each():
    import io

    import pyarrow.parquet

    made = [part(FAILURES, "t", {"a": 1.0, "n": 2, "on": True}, [{"what": "hung"}], {"scene": "s"}) for _ in range(2)]
    assert made[0] == made[1]
    table = pyarrow.parquet.read_table(io.BytesIO(made[0]))
    (row,) = table.to_pylist()
    assert row == {"task": "t", "a": 1.0, "n": 2, "on": True, "what": "hung", "sentence": None, "traceback": None}
    assert table.schema.metadata[b"scene"] == b"s"


@pytest.mark.parametrize(
    ("name", "table"), [("task", "tasks"), ("steps", "tasks"), ("bodyA", "steps"), ("what", "failures")]
)
def test_a_parameter_that_is_called_like_a_column_is_refused(name, table):
    with pytest.raises(ValueError, match=rf"^the parameter '{name}' has the name of a column of the table of {table}$"):
        must_be_no_columns({name: 1})
    must_be_no_columns({"mass": 1})


def test_a_sweep_names_what_is_to_be_installed(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(ImportError, match=r"^a sweep needs pyarrow: pip install pyarrow$"):
        parts.arrow()
    monkeypatch.setitem(sys.modules, "filelock", None)
    with pytest.raises(ImportError, match=r"^a sweep needs filelock: pip install filelock$"):
        Store(tmp_path, IDENTITY)


@pytest.mark.parametrize("module", ["sweep.sweep", "sweep.page", "cli.sweep"])
def test_sweeps_are_imported_where_there_is_no_fcntl_as_on_windows(module):
    program = f"import sys; sys.modules['fcntl'] = sys.modules['resource'] = None; import overlapper.{module}"
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)
