"""Volumetric contact in a script: its arguments, Bullet's own response, and what else a script tells the simulator."""

import contextlib
import math
import re
from dataclasses import replace

import numpy as np
import pybullet as p
import pytest
from contact_experiments import HALF, STEP, G, World, run
from simulated import box, ground, jointed

import overlapper
from overlapper.simulation import Bodies, NoStepWarning, Recorder, SubstepsWarning, UnsettledWarning, VolumetricContact
from overlapper.simulation.forces import told


@pytest.fixture
def world():
    with World() as world:
        yield world


def resting(world, **options):
    return world.box(*[HALF] * 3, position=[0, 0, HALF - G / 1e5], **options)


# A block without a step


def test_a_block_that_asks_for_no_step_or_makes_one_or_fails_is_not_told(world):
    resting(world)
    contact = world.contact()
    with contact:
        p.getNumBodies(world.client)
    with contact:
        contact.forces()  # a script that integrates by itself
    with contact:
        p.stepSimulation(world.client)
    with pytest.raises(ZeroDivisionError), contact:
        raise ZeroDivisionError


def test_steps_by_a_name_that_was_imported_earlier_are_told(world):
    step = p.stepSimulation
    world.box(*[HALF] * 3, position=[0, 0, 1])
    said = r"although bodies have moved: a step is not noticed if its function was imported by name before, as in `from"
    with pytest.warns(NoStepWarning, match=said) as caught, world.contact():
        step(world.client)
    assert caught[0].filename == __file__


def test_a_client_that_is_disconnected_within_the_block_is_not_told(client):
    box(client)
    with VolumetricContact(Bodies(client)):
        p.disconnect(client)


# Arguments


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"stiffness": 0}, "stiffness must be a number in Pa/m greater than 0, not 0"),
        ({"stiffness": -1.0}, "stiffness must be a number in Pa/m greater than 0, not -1.0"),
        ({"stiffness": math.nan}, "stiffness must be a number in Pa/m greater than 0, not nan"),
        ({"stiffness": math.inf}, "stiffness must be a number in Pa/m greater than 0, not inf"),
        ({"stiffness": "hard"}, "stiffness must be a number in Pa/m greater than 0, not 'hard'"),
        ({"stiffness": "1e7"}, "stiffness must be a number in Pa/m greater than 0, not '1e7'"),
        (
            {"restitution": 0.5, "dissipation": 0},
            "restitution must not be given with dissipation, which determines how bodies bounce",
        ),
        ({"restitution": -1, "dissipation": None}, "restitution must be a number 0 or greater, not -1"),
        ({"rolling": "x"}, "rolling must be a number in m 0 or greater, not 'x'"),
        ({"dissipation": -1e-3}, "dissipation must be a number in s 0 or greater, not -0.001"),
        ({"dissipation": [1]}, "dissipation must be a number in s 0 or greater, not [1]"),
        ({"friction": "foo"}, "friction must be a number 0 or greater, or 'distributed', not 'foo'"),
        ({"friction": -0.5}, "friction must be a number 0 or greater, or 'distributed', not -0.5"),
        ({"substeps": 0}, "substeps must be a whole number from 1, or 'auto', not 0"),
        ({"substeps": 1.5}, "substeps must be a whole number from 1, or 'auto', not 1.5"),
        ({"substeps": True}, "substeps must be a whole number from 1, or 'auto', not True"),
        ({"substeps": "many"}, "substeps must be a whole number from 1, or 'auto', not 'many'"),
    ],
)
def test_invalid_arguments_are_named(world, given, said):
    with pytest.raises(ValueError, match=f"^{re.escape(said)}$"):
        world.contact(**given)


def test_numbers_of_numpy_are_numbers(world):
    resting(world)
    with world.contact(stiffness=np.float32(1e7), friction=np.float64(0.5), substeps=np.int64(3)) as contact:
        contact.step()
    assert contact.substeps == 3


@pytest.mark.parametrize("pairs", [[("nobody", "box")], "some", [(0, 99)], 7, [1, 2, 3]])
def test_invalid_pairs_are_refused_at_once_in_the_words_of_bodies(world, pairs):
    resting(world)
    with pytest.raises(ValueError, match=r"^\w+ ") as theirs:
        Bodies(world.client).pairs(pairs)
    with pytest.raises(ValueError, match=f"^{re.escape(str(theirs.value))}$"):
        world.contact(pairs=pairs)


@pytest.mark.parametrize(
    ("name", "given", "least"),
    [
        ("stiffness", 0, "in Pa/m greater than 0"),
        ("dissipation", math.nan, "in s 0 or greater"),
        ("friction", "slippery", "0 or greater"),
    ],
)
def test_a_function_that_returns_no_number_is_reported_with_the_pair(world, name, given, least):
    cube = resting(world)
    with world.contact(**{name: lambda a, b: given}) as contact:
        said = f"{name} of {(world.plane, -1)} and {(cube, -1)} must be a number {least}, not {given!r}"
        with pytest.raises(ValueError, match=f"^{re.escape(said)}$"):
            contact.step()


def test_functions_are_asked_once_for_each_pair_of_links_the_lesser_first(world):
    first, second = resting(world), world.box(*[HALF] * 3, position=[0, 0, 3 * HALF - 2e-4])
    asked = []

    def law(name, value):
        return lambda a, b: asked.append((name, a, b)) or value

    laws = {"stiffness": law("stiffness", 1e7), "dissipation": law("dissipation", 1e-3), "friction": law("friction", 1)}
    with world.contact(**laws) as contact:
        run(contact, 0.1)
    pairs = [((world.plane, -1), (first, -1)), ((first, -1), (second, -1))]
    assert sorted(asked) == sorted((name, *pair) for name in laws for pair in pairs)


def test_a_function_gives_the_stiffness_of_each_pair(world):
    soft = resting(world)
    hard = world.box(*[HALF] * 3, position=[1, 0, HALF - 1e-5])
    with world.contact(stiffness=lambda a, b: 1e8 if hard in (a[0], b[0]) else 1e7) as contact:
        run(contact, 2)
    assert HALF - world.position(soft)[2] == pytest.approx(G / 1e5, rel=1e-6)
    assert HALF - world.position(hard)[2] == pytest.approx(G / 1e6, rel=1e-6)


def test_a_step_outside_of_the_with_block_is_refused(world):
    contact = world.contact()
    said = r"^step\(\) must be called within `with contact:`, where the simulator does not push these pairs apart$"
    with pytest.raises(RuntimeError, match=said):
        contact.step()
    with contact:
        contact.step()
    with pytest.raises(RuntimeError, match=said):
        contact.step()


def test_too_few_substeps_are_reported_once_with_the_number_needed(world):
    resting(world)
    said = (
        r"^1 substeps are too few for the stiffness between plane and box, which oscillate at up to "
        r"(\d+) rad/s: with fewer than (\d+) substeps, their contact loses energy$"
    )
    with world.contact(stiffness=1e9, substeps=1) as contact:
        with pytest.warns(SubstepsWarning, match=said) as told:
            contact.step()
        assert told[0].filename == __file__
        swing, needed = map(int, re.match(said, str(told[0].message)).groups())
        assert swing >= math.floor(math.sqrt(1e9 * 0.01)) and needed == math.ceil(swing * STEP)
        contact.step()  # says nothing more
    with world.contact(stiffness=1e9, substeps=needed) as contact:
        contact.step()
        assert contact.substeps == needed


def test_more_substeps_than_the_maximum_are_reported(world):
    resting(world)
    with world.contact(stiffness=1e13) as contact, pytest.warns(SubstepsWarning, match="^200 substeps are too few"):
        contact.step()


def test_an_empty_simulation_steps(client):
    with VolumetricContact(Bodies(client)) as contact:
        contact.step()
    assert (len(contact), contact.substeps) == (0, 1)


def test_volumetric_contact_has_a_readable_repr(world):
    resting(world)
    with world.contact(substeps=2) as contact:
        contact.step()
    assert repr(contact) == "VolumetricContact(1 pairs of shapes press, 2 substeps)"
    assert repr(contact.last) == "Forces(1 pairs, 9.81 N at most)"


def test_results_of_the_last_step_stay_available(world):
    cube = resting(world)
    with world.contact() as contact:
        contact.step()
        found = contact.last
        force = found.force.copy()
        p.resetBasePositionAndOrientation(cube, [0, 0, HALF - 1e-3], [0, 0, 0, 1], world.client)
        contact.step()
    assert np.array_equal(found.force, force) and not np.array_equal(contact.force, force)


def test_every_run_has_the_same_bits():
    def heap():
        with World() as world:
            rng = np.random.default_rng(2)
            cubes = [
                world.box(0.05, 0.04, 0.03, position=[*rng.uniform(-0.05, 0.05, 2), 0.05 + 0.06 * k]) for k in range(8)
            ]
            with world.contact() as contact:
                run(contact, 0.5)
            return np.array([[*world.position(cube), *world.velocity(cube)[0]] for cube in cubes])

    assert np.array_equal(heap(), heap())


# Bullet's own response


def touched(world):
    p.performCollisionDetection(world.client)
    return len(p.getContactPoints(physicsClientId=world.client))


def test_bullet_does_not_respond_within_the_block_and_responds_after_it(world):
    resting(world)
    assert touched(world)
    contact = world.contact(substeps=1)
    assert touched(world)
    with contact:
        contact.step()
        assert not p.getContactPoints(physicsClientId=world.client)
    assert touched(world)


def test_bullet_responds_again_after_an_exception(world):
    resting(world)

    def broken():
        with world.contact() as contact:
            contact.step()
            raise KeyError

    with pytest.raises(KeyError):
        broken()
    assert touched(world)


def test_only_the_pairs_that_are_named_are_taken_from_bullet(world):
    ours, bullets = resting(world), world.box(*[HALF] * 3, position=[1, 0, HALF])
    with world.contact(pairs=[(world.plane, ours)]) as contact:
        run(contact, 0.5)
        assert {point[1] for point in p.getContactPoints(physicsClientId=world.client)} == {bullets}
        assert contact.pairs[:, [0, 3]].tolist() == [[world.plane, ours]]
        assert abs(world.position(bullets)[2] - HALF) < 1e-3


def test_a_disconnected_client_is_left_alone():
    world = World()
    resting(world)
    with world.contact() as contact:
        contact.step()
        p.disconnect(world.client)


@pytest.mark.parametrize("recorded", [True, False])
def test_bodies_may_come_and_go_within(client, recorded):
    recorder = Recorder(client) if recorded else None
    try:
        p.setGravity(0, 0, -G, physicsClientId=client)
        ground(client)
        first = box(client, HALF, position=(0, 0, HALF - G / 1e5))
        bodies = Bodies(client, recorder=recorder)
        with VolumetricContact(bodies) as contact:
            contact.step()
            second = box(client, HALF, position=(0.5, 0, HALF - G / 1e5))
            run(contact, 0.5)
            assert contact.on(second)[0] == pytest.approx([0, 0, G])
            assert not p.getContactPoints(physicsClientId=client)
            p.removeBody(first, client)
            run(contact, 0.1)
            assert len(contact) == 1
        p.performCollisionDetection(client)
        assert {point[1] for point in p.getContactPoints(physicsClientId=client)} == {second}
    finally:
        if recorder:
            recorder.close()


def test_pairs_that_a_script_has_filtered_stay_filtered(client, recorder):
    plane = ground(client)
    free, other = box(client, HALF, position=(0, 0, HALF - 1e-4)), box(client, HALF, position=(1, 0, HALF - 1e-4))
    p.setCollisionFilterPair(plane, free, -1, -1, 0, client)
    with VolumetricContact(Bodies(client, recorder=recorder)) as contact:
        contact.step()
        assert contact.pairs[:, [0, 3]].tolist() == [[plane, other]]
    assert recorder.pair_filters == {((plane, -1), (free, -1)): False}
    p.performCollisionDetection(client)
    assert {point[1] for point in p.getContactPoints(physicsClientId=client)} == {other}


# Other commands to bodies


def slider(world):
    """A mass of 2 kg on a rail along x, without gravity."""
    world.pull(0, 0, 0)
    shape = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.05] * 3, physicsClientId=world.client)
    base = (0, -1, [0, 0, 1])
    id = jointed(world.client, p.JOINT_PRISMATIC, shape, [[1, 0, 0]], [[0, 0, 0]], mass=2, base=base)
    world.undamped(id, 0.5)
    p.setJointMotorControl2(id, 0, p.VELOCITY_CONTROL, force=0, physicsClientId=world.client)
    return id


def speed_of(world, id):
    return p.getJointState(id, 0, world.client)[1]


ON_ONE_JOINT = {
    "velocity": {"controlMode": p.VELOCITY_CONTROL, "targetVelocity": 100, "force": 6},
    "position": {"controlMode": p.POSITION_CONTROL, "targetPosition": 100, "force": 6},
    "torque": {"controlMode": p.TORQUE_CONTROL, "force": 6},
}


@pytest.mark.parametrize("substeps", [1, 4])
@pytest.mark.parametrize("told", ["once", "each step"])
@pytest.mark.parametrize("by", ["setJointMotorControl2", "setJointMotorControlArray"])
@pytest.mark.parametrize("mode", ON_ONE_JOINT)
def test_a_motor_is_as_strong_in_substeps_as_in_a_step(world, mode, by, told, substeps):
    """6 N on 2 kg: 3 m/s², as long as it is told; a torque is told for one step alone."""
    id, arguments = slider(world), dict(ON_ONE_JOINT[mode])

    def tell():
        if by.endswith("Array"):
            forces = [arguments["force"]]
            many = {"targetVelocity": "targetVelocities", "targetPosition": "targetPositions"}
            rest = {many[name]: [arguments[name]] for name in arguments if name in many}
            p.setJointMotorControlArray(
                id, [0], arguments["controlMode"], forces=forces, physicsClientId=world.client, **rest
            )
        else:
            p.setJointMotorControl2(id, 0, physicsClientId=world.client, **arguments)

    with world.contact(substeps=substeps) as contact:
        for step in range(12):
            if told == "each step" or step == 0:
                tell()
            contact.step()
    steps = 1 if mode == "torque" and told == "once" else 12
    assert speed_of(world, id) == pytest.approx(3 * steps * STEP, rel=1e-9)


@pytest.mark.parametrize("substeps", [1, 4])
def test_a_motor_recorded_before_the_block_is_as_strong_within_it(client, recorder, substeps):
    world = World()
    try:
        with Recorder(world.client) as heard:
            id = slider(world)
            p.setJointMotorControl2(id, 0, physicsClientId=world.client, **ON_ONE_JOINT["velocity"])
            with VolumetricContact(Bodies(world.client, recorder=heard), substeps=substeps) as contact:
                run(contact, 0.1)
            assert speed_of(world, id) == pytest.approx(3 * 24 * STEP, rel=1e-9)
            p.stepSimulation(world.client)
            assert speed_of(world, id) == pytest.approx(3 * 25 * STEP, rel=1e-9)
    finally:
        p.disconnect(world.client)


def test_an_unrecorded_motor_is_stronger_by_the_number_of_substeps(world):
    """As the docstring says: pybullet keeps its impulse, and cannot be asked for what it was told."""
    id = slider(world)
    p.setJointMotorControl2(id, 0, physicsClientId=world.client, **ON_ONE_JOINT["velocity"])
    with world.contact(substeps=4) as contact:
        run(contact, 0.1)
    assert speed_of(world, id) == pytest.approx(4 * 3 * 24 * STEP, rel=1e-9)


@pytest.mark.parametrize("substeps", [1, 4])
def test_a_force_and_a_torque_act_for_the_whole_step_and_no_longer(world, substeps):
    world.pull(0, 0, 0)
    cube = world.box(*[HALF] * 3, position=[0, 0, 1])
    with world.contact(substeps=substeps) as contact:
        p.applyExternalForce(cube, -1, [3, 0, 0], [0, 0, 1], p.WORLD_FRAME, world.client)
        p.applyExternalTorque(cube, -1, [0, 0, 0.01], p.WORLD_FRAME, world.client)
        contact.step()
        contact.step()
        (x, _, _), (_, _, turning) = world.velocity(cube)
    assert x == pytest.approx(3 * STEP, rel=1e-9)
    assert turning == pytest.approx(0.01 / world.inertia(cube)[2] * STEP, rel=1e-9)


@pytest.mark.parametrize("substeps", [1, 4])
def test_a_constraint_is_as_strong_in_substeps_as_in_a_step(world, substeps):
    """Its greatest force draws the cube to a place far off."""
    world.pull(0, 0, 0)
    cube = world.box(*[HALF] * 3, position=[0, 0, 1])
    tie = p.createConstraint(
        cube, -1, -1, -1, p.JOINT_POINT2POINT, [0, 0, 0], [0, 0, 0], [0, 0, 1], physicsClientId=world.client
    )
    with world.contact(substeps=substeps) as contact:
        p.changeConstraint(tie, [10, 0, 1], maxForce=2, physicsClientId=world.client)
        run(contact, 0.1)
        assert world.velocity(cube)[0] == pytest.approx([2 * 0.1, 0, 0], abs=1e-6)
        p.removeConstraint(tie, world.client)
        contact.step()


@pytest.mark.parametrize("substeps", [1, 4])
@pytest.mark.parametrize("by", ["setJointMotorControlMultiDof", "setJointMotorControlMultiDofArray"])
@pytest.mark.parametrize("mode", ["position", "torque"])
def test_a_motor_of_any_joint_is_as_strong_in_substeps(world, mode, by, substeps):
    id = slider(world)
    arguments = {"targetPosition": [100], "force": [6]} if mode == "position" else {"force": [6]}
    kind, client = ON_ONE_JOINT[mode]["controlMode"], world.client
    with world.contact(substeps=substeps) as contact:
        for _ in range(12):
            if by.endswith("Array"):
                many = {f"{name}s": [value] for name, value in arguments.items()}
                p.setJointMotorControlMultiDofArray(id, [0], kind, physicsClientId=client, **many)
            else:
                p.setJointMotorControlMultiDof(id, 0, kind, physicsClientId=client, **arguments)
            contact.step()
    assert speed_of(world, id) == pytest.approx(3 * 12 * STEP, rel=1e-9)


def test_commands_to_bodies_that_are_gone_or_of_another_client_are_forgotten(world):
    with World() as other:
        stranger, id = slider(other), slider(world)
        with world.contact(substeps=2) as contact:
            p.setJointMotorControl2(stranger, 0, physicsClientId=other.client, **ON_ONE_JOINT["velocity"])
            p.setJointMotorControl2(id, 0, physicsClientId=world.client, **ON_ONE_JOINT["velocity"])
            contact.step()
            p.removeBody(id, world.client)
            contact.step()
            p.resetSimulation(physicsClientId=world.client)
            contact.step()
        assert speed_of(other, stranger) == 0


def test_a_ground_that_is_given_a_velocity_takes_along_what_lies_on_it(world):
    """A conveyor: friction speeds it up by µ g until it moves with the belt."""
    p.removeBody(world.plane, world.client)
    belt = world.box(2, 0.5, 0.1, mass=0, position=[0, 0, -0.1], friction=1)
    load = world.box(HALF, HALF, 0.02, position=[-1, 0, 0.02 - G / 1e5])
    with world.contact() as contact:
        run(contact, 0.5)
        speeds = []
        for _ in range(120):
            p.resetBasePositionAndOrientation(belt, [0, 0, -0.1], [0, 0, 0, 1], world.client)
            p.resetBaseVelocity(belt, [1, 0, 0], [0, 0, 0], world.client)
            contact.step()
            speeds.append(world.velocity(load)[0][0])
    assert speeds[35] - speeds[11] == pytest.approx(0.5 * G * 0.1, rel=1e-3)
    assert speeds[-1] == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("substeps", [1, "auto"])
def test_poses_and_velocities_set_between_steps_give_no_kick(world, substeps):
    """Neither a place nor a velocity is taken for something that acts on the body."""
    cube = resting(world)
    with world.contact(substeps=substeps, friction=0) as contact:
        run(contact, 1)
        height = world.position(cube)[2]
        p.resetBasePositionAndOrientation(cube, [0.5, 0.2, height], [0, 0, 0, 1], world.client)
        contact.step()
        assert np.abs(world.velocity(cube)).max() < 1e-9
        world.push(cube, [1, 0, 0])
        contact.step()
        linear, angular = world.velocity(cube)
        assert linear == pytest.approx([1, 0, 0], abs=1e-9) and angular == pytest.approx([0, 0, 0], abs=1e-8)


def test_forces_may_be_asked_for_between_steps(world):
    """Asking changes no other force. The bodies follow the same path to the accuracy of the solver."""

    def path(asking):
        with World() as world:
            cube = world.box(*[HALF] * 3, position=[0, 0, 0.1], orientation=p.getQuaternionFromEuler([0.3, 0.2, 0]))
            places = []
            with world.contact(substeps=4) as contact:
                for _ in range(60):
                    for _ in range(asking):
                        contact.forces()
                    contact.step()
                    places.append(world.position(cube))
            return np.array(places)

    alone = path(0)
    assert np.abs(alone[-1] - alone[0]).max() > 0.02
    assert np.abs(path(1) - alone).max() < 1e-7 and np.abs(path(2) - alone).max() < 1e-7


def test_forces_serve_a_script_that_integrates(world):
    """A ball of its own equations, let down on a plane that pybullet only shows."""
    world.pull(0, 0, 0)
    cube = world.box(*[HALF] * 3, position=[0, 0, HALF])
    height, speed = HALF, 0.0
    with world.contact(friction=0) as contact:
        for _ in range(480):
            p.resetBasePositionAndOrientation(cube, [0, 0, height], [0, 0, 0, 1], world.client)
            world.push(cube, [0, 0, speed])
            speed += (contact.forces().on(cube)[0][2] - G) * STEP
            height += speed * STEP
    assert HALF - height == pytest.approx(G / 1e5, rel=1e-3)


# Steps by other code


@pytest.mark.parametrize("recorded", [False, True])
def test_step_simulation_within_the_block_is_a_step(world, recorded):
    """Code that steps by itself, such as a gymnasium environment, works without a change."""
    cube = resting(world)
    other = p.connect(p.DIRECT)
    original = p.stepSimulation
    with Recorder(world.client) if recorded else contextlib.nullcontext() as recorder:
        contact = VolumetricContact(Bodies(world.client, recorder=recorder), stiffness=1e7, substeps=4)
        steps = []
        with overlapper.watch(world.client) as watch, contact:
            for step in (p.stepSimulation, lambda: p.stepSimulation(physicsClientId=world.client)) * 60:
                assert step(*[world.client] * (step is p.stepSimulation)) == ()
                steps.append(contact.substeps)
            p.stepSimulation(other)  # a client of its own
        assert watch.steps == 120 and set(steps) == {4}
        assert world.position(cube)[2] == pytest.approx(HALF - G / 1e5, abs=1e-9)
        assert contact.on(cube)[0][2] == pytest.approx(G, rel=1e-6)
    assert p.stepSimulation is original
    p.disconnect(other)


@pytest.mark.filterwarnings("ignore:VolumetricContact made no step")
def test_pybullet_refuses_invalid_calls_of_step_simulation_within_the_block(world):
    resting(world)
    with world.contact() as contact:
        for call in (lambda: p.stepSimulation(world.client, 1), lambda: p.stepSimulation(client=1)):
            with pytest.raises(TypeError, match="argument"):
                call()
        assert contact.substeps == 0
        p.disconnect(world.client)
        with pytest.raises(p.error, match="Not connected"):
            p.stepSimulation(world.client)
    assert p.connect(p.DIRECT) == world.client  # for the end of `world`


def test_a_warning_within_step_simulation_names_the_line_that_calls_it(world):
    resting(world)
    with world.contact(stiffness=1e12, substeps=1), pytest.warns(SubstepsWarning) as caught:
        p.stepSimulation(world.client)
    assert caught[0].filename == __file__


def test_forces_that_have_not_settled_are_reported_once(world, monkeypatch):
    resting(world)
    world.box(*[HALF] * 3, position=[0, 0, 3 * HALF - 1e-3], mass=10)
    with world.contact(substeps=1) as contact:
        contact.step()
        assert 0 < contact.residual <= 1e-8 and repr(contact.last).endswith("N at most)")
        monkeypatch.setattr(told, "SETTLED", contact.residual / 1e3)
        with pytest.warns(UnsettledWarning) as caught:
            contact.step()
        contact.step()
    assert contact.mean().residual == contact.residual
    words = (
        r"contact forces are inaccurate in some steps: the solver ended after \d+ sweeps, while slips still changed by"
    )
    assert re.match(words, str(caught[0].message)) and caught[0].filename == __file__
    assert ", residual 2e-05)" in repr(replace(contact.last, residual=2e-5))
