import pytest
from robots import without


@pytest.fixture
def by_pybullet(monkeypatch):
    """pybullet reads MJCF, as where mujoco is not installed."""
    monkeypatch.setattr("overlapper.audit.robot.find_spec", without("mujoco"))


@pytest.fixture
def by_yourdfpy(monkeypatch):
    """yourdfpy reads URDF, as where pybullet is not installed."""
    monkeypatch.setattr("overlapper.audit.robot.find_spec", without("pybullet"))
