"""Tests of sweeps run in a folder of their own, in which the scene is."""

import os
import warnings
from pathlib import Path

import pytest
from sweeping import BALLS, SLOW, parts, swept

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import pybullet  # noqa: F401


@pytest.fixture
def balls(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "balls.py").write_text(BALLS)


@pytest.fixture(scope="session")
def undisturbed(tmp_path_factory):
    """The parts of the slow sweep, if nothing happens to it."""
    folder, before = tmp_path_factory.mktemp("undisturbed"), Path.cwd()
    (folder / "balls.py").write_text(BALLS)
    os.chdir(folder)
    try:
        swept(folder / "runs", SLOW)
    finally:
        os.chdir(before)
    return parts(folder / "runs")
