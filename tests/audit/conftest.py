import pytest


@pytest.fixture
def by_pybullet(monkeypatch):
    """pybullet reads MJCF, as where mujoco is not installed."""
    monkeypatch.setattr("overlapper.audit.robot.find_spec", lambda name: None)
