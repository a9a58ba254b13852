"""Tasks that misbehave, each in a way of its own: each is one row that says so, and none stops or changes another."""

from misdeeds import sweep_of_misdeeds


def test_tasks_that_misbehave_are_a_row_each_and_stop_no_other(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sweep_of_misdeeds("processes")
