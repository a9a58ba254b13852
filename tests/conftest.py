"""Hypothesis draws the same examples on every run; `--hypothesis-profile=explore` looks further, with new ones."""

import pytest
from hypothesis import HealthCheck, settings

settings.register_profile("same", deadline=None, derandomize=True, database=None, max_examples=40)
settings.register_profile("explore", deadline=None, max_examples=2000, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("same")


@pytest.fixture
def client():
    """A client of pybullet without a window; the test may disconnect it itself."""
    import pybullet as p  # only here, as it says on import when it was built

    client = p.connect(p.DIRECT)
    yield client
    if p.isConnected(client):
        p.disconnect(client)


@pytest.fixture
def recorder(client):
    from overlapper.simulation import Recorder

    with Recorder(client) as recorder:
        yield recorder
