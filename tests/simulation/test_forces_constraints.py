"""Constraints of pybullet beside contacts: the solver knows what their forces do within the same step."""

import numpy as np
import pybullet as p
import pytest
from contact_experiments import World

from overlapper.simulation import Bodies, Recorder, VolumetricContact
from overlapper.simulation.bullet import stepping

HALF, GAP, G = 0.05, 1e-3, 9.81
DEFAULT_THRESHOLD = 1e-7  # of pybullet


@pytest.fixture
def world():
    with World() as made:
        yield made


def tied(world, kind, light=0.1, heavy=50.0):
    """A heavy box tied to a light one 1 mm below, which stands on the floor. Both have pybullet's own damping."""
    shape = p.createCollisionShape(p.GEOM_BOX, halfExtents=[HALF] * 3, physicsClientId=world.client)
    lower, upper = (
        p.createMultiBody(mass, shape, basePosition=(0, 0, z), physicsClientId=world.client)
        for mass, z in ((light, HALF), (heavy, 3 * HALF + GAP))
    )
    ends = [0, 0, HALF + GAP / 2], [0, 0, -HALF - GAP / 2]
    p.createConstraint(lower, -1, upper, -1, kind, [0, 1, 0], *ends, physicsClientId=world.client)
    return lower


@pytest.mark.parametrize("kind", [p.JOINT_FIXED, p.JOINT_POINT2POINT, p.JOINT_PRISMATIC])
def test_a_heavy_box_tied_to_a_light_one_presses_it_to_the_floor_with_its_weight(world, kind):
    lower = tied(world, kind)
    with VolumetricContact(Bodies(world.client)) as contact:
        forces, residuals = [], []
        for _ in range(240):
            contact.step()
            forces.append(contact.on(lower)[0][2])
            residuals.append(contact.residual)
    assert np.array(forces[120:]) == pytest.approx(50.1 * G, rel=2e-8)
    assert max(residuals) <= 1e-8
    assert contact.substeps == 1


@pytest.mark.parametrize(("force", "slides"), [(2.5, False), (6, True)])
def test_a_constraint_pulls_with_at_most_its_largest_force(world, force, slides):
    """A point of the world pulls a box of 1 kg to the side, and lifts it back to the surface of the floor."""
    id = world.box(*[HALF] * 3, position=(0, 0, HALF))
    ends = [0] * 3, [1, 0, HALF]
    point = p.createConstraint(id, -1, -1, -1, p.JOINT_POINT2POINT, [0] * 3, *ends, physicsClientId=world.client)
    p.changeConstraint(point, maxForce=force, physicsClientId=world.client)
    with VolumetricContact(Bodies(world.client), friction=0.5) as contact:
        for _ in range(60):
            contact.step()
        sideways, _, up = contact.on(id)[0]
    assert up == pytest.approx(G - force, rel=1e-2)
    assert sideways == pytest.approx(-(0.5 * up if slides else force), rel=1e-3)
    assert (world.position(id)[0] > 0.01) == slides


@pytest.mark.parametrize(("told", "during", "after"), [(None, 0.0, DEFAULT_THRESHOLD), (1e-5, 1e-5, 1e-5)])
def test_bullets_iterations_end_by_the_threshold_of_the_script_or_not_early(world, monkeypatch, told, during, after):
    tied(world, p.JOINT_FIXED)
    seen = []

    def spy(name):
        if name != "setPhysicsEngineParameter":
            return unheard(name)
        return lambda **arguments: seen.append(arguments["solverResidualThreshold"])

    unheard = stepping.unheard
    monkeypatch.setattr(stepping, "unheard", spy)
    with Recorder(world.client) as recorder:
        bodies = Bodies(world.client, recorder=recorder)
        if told is not None:
            p.setPhysicsEngineParameter(solverResidualThreshold=told, physicsClientId=world.client)
        with VolumetricContact(bodies) as contact:
            contact.step()
            assert seen == [during]
        assert seen == [during, after]
