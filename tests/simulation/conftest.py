import pybullet as p
import pytest
from simulated import DATA


@pytest.fixture
def client(client):
    """One that finds the models of pybullet_data."""
    p.setAdditionalSearchPath(str(DATA), physicsClientId=client)
    return client
