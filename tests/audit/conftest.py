from importlib.util import find_spec

import pytest


@pytest.fixture
def by_pybullet(monkeypatch):
    """pybullet reads MJCF, as where mujoco is not installed."""
    monkeypatch.setattr("overlapper.audit.robot.find_spec", without("mujoco"))


@pytest.fixture
def by_yourdfpy(monkeypatch):
    """yourdfpy reads URDF, as where pybullet is not installed."""
    monkeypatch.setattr("overlapper.audit.robot.find_spec", without("pybullet"))


def without(library):
    return lambda name: None if name == library else find_spec(name)
