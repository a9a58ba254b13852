import pytest


@pytest.fixture
def client(client):
    """One that finds the models of pybullet_data."""
    import pybullet as p  # only here, so that the tests of MuJoCo run without pybullet
    from simulated import DATA

    p.setAdditionalSearchPath(str(DATA), physicsClientId=client)
    return client
