"""Volumetric contact on MuJoCo: textbooks, MuJoCo's own masses, and what it leaves as a script has set it."""

import ctypes
import math
import re
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
import pytest

import overlapper
from overlapper.scenes.run import run
from overlapper.scenes.scene import load_scene
from overlapper.simulation.mujoco.calls import listen
from overlapper.simulation.mujoco.friction import friction
from overlapper.simulation.mujoco.stepping import MujocoStepping
from overlapper.tables.table_file import read_table

mujoco = pytest.importorskip("mujoco")

from overlapper.mujoco import Bodies, VolumetricContact  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore::overlapper.simulation.cautions.SubstepsWarning")

G, HALF, STEP, FRICTION = 9.81, 0.05, 1e-3, 0.5
CONTACT = int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
CUBE = '<geom type="box" size=".05 .05 .05" mass="1"/>'
FLAT = '<geom type="box" size=".05 .05 .01" mass="1"/>'
BALL = '<geom type="sphere" size=".05" mass="1"/>'

# Armature, ball joints, several joints of a body, and bodies without joints, on a free and on a held base.
MECHANISM = """
<body pos="0 0 .12"><freejoint/>
  <geom type="box" size=".1 .05 .04"/><geom type="sphere" size=".06" pos=".1 0 0"/>
  <body pos=".15 0 0"><joint type="ball" armature=".002" damping="{} {} {}"/>
    <geom type="capsule" size=".03 .1" euler="0 90 0" pos=".1 0 0"/>
    <body pos=".22 0 0">
      <joint axis="0 1 0" armature=".01" damping="{}"/>
      <joint axis="0 0 1" armature=".003"/>
      <joint type="slide" axis="1 0 0" damping="{}"/>
      <geom type="box" size=".05 .04 .03"/>
      <body pos=".05 0 .05"><geom size=".05"/></body>
    </body>
  </body>
</body>
<body pos="0 .4 .1">
  <joint type="slide" axis="0 0 1" armature=".5"/><joint axis="1 0 0"/><joint axis="0 1 0" pos="0 0 .1" damping="{}"/>
  <geom type="cylinder" size=".1 .05"/>
  <body pos=".2 0 0"><joint type="ball"/><geom size=".07"/></body>
</body>
<body pos="0 -.3 .3"><geom size=".05"/></body>
"""


def simulated(bodies, step=STEP, rest="", gravity=f"0 0 -{G}"):
    """A plane and these bodies, with friction 0.5."""
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{step}" gravity="{gravity}"/><default><geom friction="{FRICTION}"/></default>'
        f'<worldbody><geom name="floor" type="plane" size="0 0 1"/>{bodies}</worldbody>{rest}</mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def free(geom, position, more=""):
    return f'<body pos="{position}" {more}><freejoint/>{geom}</body>'


def resting_cube(**options):
    return simulated(free(CUBE, f"0 0 {HALF - G / 1e5}"), **options)


@contextmanager
def pressing(model, data, **parameters):
    with VolumetricContact(Bodies(model, data), **{"dissipation": 1e-3} | parameters) as contact:
        yield contact


def advance(contact, seconds, step=STEP):
    for _ in range(round(seconds / step)):
        contact.step()


@pytest.fixture(autouse=True)
def away(monkeypatch, tmp_path):
    """MuJoCo logs its warnings in the working folder."""
    monkeypatch.chdir(tmp_path)


# ---------------------------------------------------------------------------------------------------------- textbooks


@pytest.mark.parametrize("stiffness", [1e7, 1e8])
def test_a_box_rests_at_the_depth_of_its_weight_and_a_ball_at_its_volume(stiffness):
    model, data = simulated(free(CUBE, f"0 0 {HALF + 1e-4}") + free(BALL, f"1 0 {HALF - 1e-4}"))
    with pressing(model, data, stiffness=stiffness, dissipation=5e-3) as contact:
        advance(contact, 3)
    assert (HALF - data.qpos[2]) / (G / (stiffness * 4 * HALF**2)) == pytest.approx(1, abs=1e-9)
    depth = HALF - data.qpos[9]
    assert stiffness * math.pi * depth**2 * (HALF - depth / 3) == pytest.approx(G, rel=1e-5)
    assert np.abs(data.qvel).max() < 1e-6
    assert contact.on(1)[0] == pytest.approx([0, 0, G]) and contact.on(0)[0] == pytest.approx([0, 0, -2 * G])


def test_the_cube_of_drake_22213_comes_to_rest():
    """It is set down 1 mm high and tilted by 1e-3."""
    model, data = simulated(free(CUBE, f"0 0 {HALF + 1e-3}", 'euler=".0573 0 0"'))
    assert data.xmat[1].reshape(3, 3)[2, 1] == pytest.approx(1e-3, rel=1e-2)
    with pressing(model, data) as contact:
        advance(contact, 3)
    assert np.abs(data.qvel).max() < 1e-9 and np.abs(data.xmat[1].reshape(3, 3)[2, :2]).max() < 1e-9


@pytest.mark.parametrize("substeps", [1, 4])
def test_a_sliding_box_stops_at_the_distance_that_friction_predicts(substeps):
    """MuJoCo moves a body by the velocity that it has after a step: by v h / 2 too little."""
    model, data = simulated(free(FLAT, f"0 0 {0.01 - G / 1e6}"))
    with pressing(model, data, stiffness=1e8, substeps=substeps) as contact:
        advance(contact, 0.5)
        start = data.qpos[0]
        data.qvel[0] = 1
        advance(contact, 0.5)
    way = data.qpos[0] - start + STEP / substeps / 2
    assert way * 2 * FRICTION * G == pytest.approx(1, abs=1e-3) and abs(data.qvel[0]) < 1e-9


@pytest.mark.parametrize("slope", [0.999, 1.001])
def test_a_box_on_an_incline_slides_only_above_the_friction_angle(slope):
    model, data = simulated(free(FLAT, f"0 0 {0.01 - G / 1e5}"))
    with pressing(model, data) as contact:
        for part in np.linspace(0, slope, 1000):
            angle = math.atan(part * FRICTION)
            model.opt.gravity[:] = G * math.sin(angle), 0, -G * math.cos(angle)
            contact.step()
        advance(contact, 0.5)
        start, before = data.qpos[0], data.qvel[0]
        advance(contact, 1)
    if slope < 1:
        assert abs(data.qpos[0] - start) < 1e-9 and abs(data.qvel[0]) < 1e-9
    else:
        wanted = G * (math.sin(angle) - FRICTION * math.cos(angle))
        assert data.qvel[0] - before == pytest.approx(wanted, rel=1e-2)


@pytest.mark.parametrize(("turn", "substeps", "most"), [("0 0 0", 8, 1e-3), ("45 0 0", 8, 1e-6), ("17 11 0", 8, 1e-3)])
def test_a_bounce_keeps_the_energy(turn, substeps, most):
    """Energy is that of the velocity half a step later, as MuJoCo's Euler integrator is half a step off."""
    model, data = simulated(free(CUBE, "0 0 .15", f'euler="{turn}"'))
    lag, drop = G * STEP / substeps / 2, 0.05

    def energy():
        speed2 = data.qvel[0] ** 2 + data.qvel[1] ** 2 + (data.qvel[2] - lag) ** 2
        return G * data.qpos[2] + speed2 / 2 + data.qvel[3:] @ (model.body_inertia[1] * data.qvel[3:]) / 2

    before, pressed = energy(), False
    with pressing(model, data, dissipation=0, friction=0, substeps=substeps) as contact:
        for _ in range(500):
            contact.step()
            pressed |= len(contact) > 0
            if pressed and not len(contact) and data.qvel[2] > 0:
                break
    assert pressed and data.qvel[2] > 0
    assert abs(energy() - before) < most * G * drop


def test_the_forces_keep_the_energy_that_the_integrator_does_not():
    """A chain falls on a plane. The work of the forces is what the pressures store and give back.

    The rest of the change is that of MuJoCo's integrator, which is of first order in the time step.
    """
    chain = ""
    for k in range(4):
        joint = '<joint type="ball" pos="-.15 0 0"/>' if k else "<freejoint/>"
        at = f'pos="{0.3 if k else 0} 0 {0 if k else 0.8}"' + ("" if k else ' quat="1 .1 .15 0"')
        chain += f'<body {at}>{joint}<geom type="capsule" size=".04 .15" quat="1 0 1 0" contype="0"/>'
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><option timestep=".001"/><worldbody><geom type="plane" size="0 0 1" conaffinity="0"/>'
        f"{chain}{'</body>' * 4}</worldbody></mujoco>"
    )
    data, other = mujoco.MjData(model), mujoco.MjData(model)
    mujoco.mj_forward(model, data)

    def energy():
        other.qpos[:], other.qvel[:] = data.qpos, data.qvel
        mujoco.mj_fwdPosition(model, other)
        mujoco.mj_energyPos(model, other)
        mujoco.mj_energyVel(model, other)
        return float(other.energy.sum())

    contact = VolumetricContact(Bodies(model, data), friction=0, dissipation=0)
    mechanics = contact._mechanics
    second_half, stored, work, drift = mechanics.step, [], [], []

    def step():
        force, before, energy_before = np.zeros(model.nv), data.qvel.copy(), energy()
        for body, wrench in enumerate(mechanics.wrenches):
            mujoco.mj_applyFT(model, data, wrench[:3], wrench[3:], data.xipos[body], body, force)
        stored.append(float(contact.last.energy.sum()))
        second_half()
        work.append(mechanics.length * force @ (before + data.qvel) / 2)
        drift.append(energy() - energy_before - work[-1])

    mechanics.step = step
    whole = energy()
    with contact:
        for _ in range(700):
            contact.step()
    lost = np.cumsum(work)[:-1] + np.array(stored[1:])
    free = np.array(stored[1:]) == 0
    assert max(stored) > 0.02 * whole and free[-200:].any() and not free.all()
    assert np.abs(lost[free]).max() < 0.002 * whole
    assert abs(sum(drift)) > 2 * abs(lost[free][-1])


@pytest.mark.parametrize("dissipation", [1e-4, 5e-4, 2e-3])
def test_dissipation_determines_the_loss_of_a_bounce(dissipation):
    """By Schwager and Pöschel (2007): a spring and a damper that do not draw."""
    model, data = simulated(free(CUBE, f"0 0 {HALF + 1e-4}"), gravity="0 0 0")
    data.qvel[2] = -1
    with pressing(model, data, dissipation=dissipation, substeps=16) as contact:
        advance(contact, 0.05)
    ratio = math.sqrt(1e7 * 4 * HALF**2) * dissipation / 2
    root = math.sqrt(1 - ratio**2)
    wanted = math.exp(-ratio / root * (math.pi - math.atan2(2 * ratio * root, 1 - 2 * ratio**2)))
    assert data.qvel[2] == pytest.approx(wanted, abs=0.01)


def test_a_force_of_the_script_is_held_by_friction_from_its_first_step():
    """MuJoCo tells this force before the step, so the box never slips. It tilts, by the stiffness of its patch."""
    model, data = simulated(free(FLAT, f"0 0 {0.01 - G / 1e5}"))
    with pressing(model, data) as contact:
        advance(contact, 0.5)
        start = data.qpos[0]
        data.xfrc_applied[1, 0] = 2
        advance(contact, 0.5)
    tilt = 2 * 0.01 / (1e7 * (2 * HALF) ** 4 / 12)
    assert data.qpos[0] - start == pytest.approx(0.01 * tilt, rel=0.02) and abs(data.qvel[0]) < 1e-9
    assert contact.on(1)[0] == pytest.approx([-2, 0, G])


# ------------------------------------------------------------------------------------------------------------- masses


@pytest.mark.parametrize("substeps", [1, 3])
@pytest.mark.parametrize("damping", [(0,) * 6, (0.3, 0.2, 0.1, 0.5, 2, 0.1)])
def test_the_solver_foretells_the_velocities_of_mujoco(damping, substeps):
    """Its acceleration is M⁻¹Jᵀf of MuJoCo without damping. With damping, Euler's integrator adds h D to M."""
    model, data = simulated(MECHANISM.format(*damping))
    assert model.nv == 18 and model.dof_armature.any() and model.dof_dampingpoly.any() == any(damping)
    bodies, stepping = Bodies(model, data), MujocoStepping(model, data)
    dynamics = stepping.dynamics([*range(model.nbody)])
    links = np.array([dynamics.place[body, geom] for body, geom, _ in bodies.keys])
    pressed, length = 0, STEP / substeps
    stepping.length = length
    stepping.enter(bodies.link_pairs(), list, list)
    for _ in range(400 * substeps):
        stepping.prepare()
        bodies.follow()
        frames, found, velocity = dynamics.frames(), bodies.overlaps().overlaps, dynamics.velocity()
        count = np.ones(len(found))
        dynamics.solver.place(frames, found, links, 1e6 * count, 1e-3 * count, dynamics.friction(links[found.pairs]))
        solved = dynamics.solver.solve(
            length, velocity, dynamics.acceleration, 0 * count, False, dynamics.ahead(length, velocity)
        )
        wrenches, ours = solved[5], solved[7]
        dynamics.apply(wrenches, frames)
        if len(found) and not any(damping):
            turned = np.zeros(model.nv)
            for body, wrench in enumerate(stepping.wrenches):
                mujoco.mj_applyFT(model, data, wrench[:3], wrench[3:], data.xipos[body], body, turned)
            theirs = np.zeros((1, model.nv))
            mujoco.mj_solveM(model, data, theirs, turned[None])
            assert np.abs(theirs[0] - ours).max() <= 1e-10 * np.abs(ours).max()
        stepping.begin(length, STEP, first=True)
        stepping.step()
        foretold = velocity + length * (dynamics.acceleration + ours)
        assert np.abs(data.qvel - foretold).max() <= 1e-10 * max(1.0, np.abs(foretold).max())
        pressed += len(found) > 1
    stepping.leave()
    assert pressed > 100


def test_bodies_of_one_tree_push_each_other_and_leave_the_momentum_of_the_tree():
    finger = '<body pos="{0} 0 0"><joint type="slide" axis="1 0 0"/><geom size=".05" mass="1"/></body>'
    base = f'<geom size=".02" mass="2" pos="0 0 .5"/>{finger.format(-0.049)}{finger.format(0.049)}'
    model, data = simulated(free(base, "0 0 1"), gravity="0 0 0")
    with pressing(model, data, dissipation=0) as contact:
        contact.step()
        assert contact.pairs[:, [1, 4]].tolist() == [[2, 3]]
        advance(contact, 0.1)
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    assert data.qvel[7] > 0.01 and data.qvel[6] == pytest.approx(-data.qvel[7])
    assert np.abs(data.subtree_linvel[1]).max() < 1e-9


GLIDE = '<joint name="{0}" type="slide" axis="0 0 1"/>'
UNSEEN = 'contype="0" conaffinity="0"'
CARRIED = {
    # A mass that glides along z, with a leg whose knee the ground bends back to its limit.
    "limit": (
        f'<body pos="0 0 .3">{GLIDE.format("z")}<geom size=".03" mass="2" {UNSEEN}/><body>'
        '<joint axis="0 1 0" range="-5 5"/><geom size=".05" pos=".1 0 -.25" mass=".2"/></body></body>',
        "",
    ),
    # A ball that glides along z. An equality hangs a mass on it.
    "equality": (
        f'<body pos="0 0 .05">{GLIDE.format("z")}<geom size=".05" mass=".2"/></body>'
        f'<body pos="1 0 .5">{GLIDE.format("other")}<geom size=".05" mass="2" {UNSEEN}/></body>',
        '<equality><joint joint1="z" joint2="other"/></equality>',
    ),
}


@pytest.mark.parametrize("constraint", CARRIED)
def test_what_a_constraint_carries_presses_with_its_weight(constraint):
    """The solver expects the reaction of the constraint. Without it, it would expect that the body gives way."""
    model, data = simulated(CARRIED[constraint][0], rest=CARRIED[constraint][1])
    with pressing(model, data, friction=0, dissipation=1e-2) as contact:
        advance(contact, 2)
        assert data.nefc == 1 and contact.on(0)[0] == pytest.approx([0, 0, -2.2 * G], rel=1e-6, abs=1e-6)
        assert 1e7 * contact.contacts.overlaps.volume == pytest.approx([2.2 * G], rel=1e-6)
    assert np.abs(data.qvel).max() < 1e-9


def test_a_cube_that_sticks_to_a_turntable_does_not_creep():
    """Along tangents of its circle, it would creep outwards by 5 mm/s."""
    disc = '<geom type="box" size="0.6 0.6 0.05" mass="500"/>'
    cube = free('<geom type="box" size="0.03 0.03 0.03" mass="1"/>', "0.3 0 1.0797275")
    model, data = simulated(f'<body pos="0 0 1"><joint type="hinge" axis="0 0 1"/>{disc}</body>{cube}', step=0.004)
    data.qvel[:] = [3, 0, 0.9, 0, 0, 0, 3]
    with VolumetricContact(Bodies(model, data), dissipation=1e-3) as contact:
        for _ in range(750):
            contact.step()
        before = np.linalg.norm(data.qpos[1:3])
        for _ in range(250):
            contact.step()
    assert abs(np.linalg.norm(data.qpos[1:3]) - before) < 1e-8
    assert np.abs(contact.slip).max() < 1e-12


def test_friction_is_that_of_mujoco():
    """Priorities, dimensions, explicit pairs and the override, against the contacts that mj_collision makes."""
    rng = np.random.default_rng(7)
    for _ in range(20):
        kinds = zip(rng.uniform(0.1, 1, 6), rng.integers(0, 2, 6), rng.choice([1, 3, 4], 6))
        geoms = [
            f'<geom name="{{}}" size=".1" friction="{f:.3f}" priority="{first}" condim="{size}"/>'
            for f, first, size in kinds
        ]
        bodies = "".join(free(geom.format(f"g{k}"), f"{0.01 * k} 0 1") for k, geom in enumerate(geoms))
        pairs = '<pair geom1="g0" geom2="g1" friction=".7" condim="3"/><pair geom1="g3" geom2="g2" condim="1"/>'
        model, data = simulated(bodies, rest=f"<contact>{pairs}</contact>")
        for override in (False, True):
            if override:
                model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_OVERRIDE)
                model.opt.o_friction[0] = 0.33
            mujoco.mj_forward(model, data)
            first, second = data.contact.geom.T.astype(int)
            wanted = np.where(data.contact.dim[:, None] >= (2, 4, 6), data.contact.friction[:, [0, 2, 3]], 0)
            assert len(wanted) == 15
            assert friction(model, first, second) == pytest.approx(wanted)
            assert friction(model, second, first) == pytest.approx(wanted)


# ------------------------------------------------------------------------------------------- what is left as it was


def test_contacts_are_off_within_the_block_and_come_back_after_an_exception():
    model, data = resting_cube()
    assert data.ncon
    bodies = Bodies(model, data)
    contact = VolumetricContact(bodies, dissipation=1e-3)
    before = bodies.rules

    def broken():
        with contact:
            contact.step()
            mujoco.mj_forward(model, data)
            assert model.opt.disableflags == CONTACT and not data.ncon
            bodies.update()
            assert bodies.rules is before and len(bodies.overlaps()) == 1  # they do not see the flag
            assert len(Bodies(model, data).overlaps()) == 1
            raise KeyError

    with pytest.raises(KeyError):
        broken()
    assert model.opt.disableflags == 0
    mujoco.mj_forward(model, data)
    assert data.ncon
    with pytest.raises(
        RuntimeError, match=r"^step\(\) must be called within `with contact:`, where the simulator does"
    ):
        contact.step()


def test_sensors_of_contacts_are_named_once():
    sensor = '<site name="skin" type="box" size=".06 .06 .06"/>'
    rest = '<sensor><touch name="press" site="skin"/><touch site="skin"/><gyro site="skin"/></sensor>'
    model, data = simulated(free('<geom type="box" size=".05 .05 .05"/>' + sensor, "0 0 .0499"), rest=rest)
    contact = VolumetricContact(Bodies(model, data), dissipation=1e-3)
    with pytest.warns(UserWarning, match="so these sensors read 0: press, sensor 1$") as told, contact:
        contact.step()
    assert len(told) == 1 and told[0].filename == __file__ and not data.sensordata[:2].any()
    with contact:  # warnings are errors here
        contact.step()


def test_flags_that_a_script_has_set_stay():
    model, data = resting_cube()
    gravity = int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    model.opt.disableflags = CONTACT
    with pressing(model, data) as contact:
        contact.step()
        assert len(contact) == 0  # nothing collides in this simulation
        model.opt.disableflags |= gravity
    assert model.opt.disableflags == CONTACT | gravity
    with pressing(model, data, pairs="all") as contact:
        contact.step()
        assert len(contact) == 1
        model.opt.disableflags = gravity  # the script turns contacts on: the next step turns them off
        contact.step()
        assert model.opt.disableflags == CONTACT | gravity and not data.ncon
    assert model.opt.disableflags == CONTACT | gravity


def test_one_data_has_one_contact_and_one_model_may_have_several_data():
    model, data = resting_cube()
    other = mujoco.MjData(model)
    mujoco.mj_forward(model, other)
    with pressing(model, data) as one:
        with pytest.raises(RuntimeError, match=r"^data already has an active VolumetricContact: leave "):
            one.__enter__()
        with pressing(model, other) as two:
            two.step()
        assert model.opt.disableflags == CONTACT
        one.step()
        assert one.on(1)[0] == pytest.approx(two.on(1)[0])
    assert model.opt.disableflags == 0


@pytest.mark.parametrize("substeps", [1, 4])
def test_forces_and_motors_of_the_script_act_for_the_whole_step_and_stay(substeps):
    slider = '<body pos="0 0 1"><joint name="j" type="slide" axis="1 0 0"/><geom size=".05" mass="2"/></body>'
    motor = '<actuator><motor joint="j"/></actuator>'
    model, data = simulated(slider + free(CUBE, "0 1 1"), rest=motor, gravity="0 0 0")
    data.ctrl[0], data.xfrc_applied[2, 1] = 6, 3
    with pressing(model, data, substeps=substeps) as contact:
        advance(contact, 0.01)
        assert contact.substeps == substeps
    assert data.qvel[0] == pytest.approx(0.03) and data.qvel[2] == pytest.approx(0.03)
    assert data.xfrc_applied.tolist() == [[0] * 6, [0] * 6, [0, 3, 0, 0, 0, 0]]
    assert data.time == pytest.approx(0.01, abs=1e-12) and model.opt.timestep == STEP


def test_a_step_that_fails_leaves_the_time_step_and_the_forces(monkeypatch):
    model, data = resting_cube()
    data.xfrc_applied[1] = 0, 0, -1, 0, 0, 0

    def fails(model, data):
        assert model.opt.timestep == STEP / 2 and data.xfrc_applied[1, 2] > 0
        raise KeyError

    with pressing(model, data, substeps=2) as contact:
        contact.step()
        monkeypatch.setattr(mujoco, "mj_step2", fails)
        with pytest.raises(KeyError):
            contact.step()
        assert data.xfrc_applied[1].tolist() == [0, 0, -1, 0, 0, 0] and model.opt.timestep == STEP
    assert model.opt.disableflags == 0


def test_forces_of_data_that_diverged_are_those_of_its_reset():
    """MuJoCo resets such data in the second half of a step."""
    model, data = resting_cube()
    data.xfrc_applied[1, 0] = 1e300
    with pressing(model, data) as contact:
        contact.step()
    assert data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number == 1
    assert not data.xfrc_applied.any() and data.qpos[2] == pytest.approx(HALF - G / 1e5, abs=2e-5)


def test_forces_are_told_without_a_step():
    model, data = resting_cube()
    state = np.concatenate([data.qpos, data.qvel, [data.time]])
    contact = VolumetricContact(Bodies(model, data), dissipation=1e-3)
    found = contact.forces()
    assert found.on(1)[0] == pytest.approx([0, 0, G]) and model.opt.disableflags == 0
    assert np.array_equal(state, [*data.qpos, *data.qvel, data.time]) and not data.xfrc_applied.any()
    data.qpos[2] -= 1e-5
    assert contact.forces().on(1)[0][2] > 1.05 * G  # poses are those of qpos, not of the last step


def test_the_mean_of_a_step_is_at_the_poses_after_it():
    model, data = resting_cube()
    data.qvel[2] = -0.01
    with pressing(model, data, substeps=4) as contact:
        contact.step()
        (overlap,) = contact.mean().contacts
    assert overlap.overlap.depth == pytest.approx(HALF - data.qpos[2], rel=1e-9)


def test_laws_are_functions_of_bodies_and_geoms():
    model, data = simulated(free(CUBE + BALL.replace("/>", ' pos="0 0 .2"/>'), f"0 0 {HALF - 1e-4}"))
    asked = []
    with pressing(model, data, stiffness=lambda a, b: asked.append((a, b)) or 1e7) as contact:
        contact.step()
        contact.step()
    assert asked == [((0, 0), (1, 1))]


# ------------------------------------------------------------------------------------------ loops that are unchanged


def test_mj_step_within_the_block_has_the_forces_of_a_step_in_one_substep():
    model, data = simulated(MECHANISM.format(0.3, 0, 0, 0.5, 2, 0.1))
    other = mujoco.MjData(model)
    mujoco.mj_forward(model, other)
    with pressing(model, data, substeps=1) as one, pressing(model, other) as two:
        for _ in range(200):
            one.step()
            mujoco.mj_step(model, other)
            assert np.array_equal(one.force, two.force)
        mujoco.mj_step(model, other, 50)
        advance(one, 0.05)
        assert two.substeps == 1 and len(two) > 1 and two.mean().force == pytest.approx(one.mean().force)
    assert np.array_equal(data.qpos, other.qpos) and np.array_equal(data.qvel, other.qvel)
    assert data.time == other.time and not other.xfrc_applied.any() and mujoco.get_mjcb_control() is None


def test_mj_step_after_substeps_has_the_forces_of_a_whole_step():
    """The length of the step enters the masses of damped joints."""
    model, data = simulated(MECHANISM.format(0.3, 0, 0, 0.5, 2, 0.1))
    with pressing(model, data, substeps=8) as one:
        advance(one, 0.35)
        other = mujoco.MjData(model)
        mujoco.mj_copyState(model, data, other, mujoco.mjtState.mjSTATE_INTEGRATION)
        mujoco.mj_forward(model, other)
        with pressing(model, other) as two:
            mujoco.mj_step(model, data)
            mujoco.mj_step(model, other)
            assert len(one) > 1 and one.force == pytest.approx(two.force, rel=1e-5, abs=1e-5)


def test_only_its_own_data_is_pushed():
    model, data = resting_cube()
    other_model, other = resting_cube()
    with pressing(model, data):
        for _ in range(200):
            mujoco.mj_step(model, data)
            mujoco.mj_step(other_model, other)
    assert other.ncon and not data.ncon and data.qpos[2] == pytest.approx(HALF - G / 1e5, abs=1e-7)
    assert abs(other.qpos[2] - data.qpos[2]) > 1e-5  # MuJoCo's own contacts are softer


def test_a_control_callback_of_the_script_is_called_first_and_comes_back():
    slider = '<body pos="0 0 1"><joint name="j" type="slide" axis="1 0 0"/><geom size=".05" mass="2"/></body>'
    model, data = simulated(slider + free(CUBE, f"0 0 {HALF}"), rest='<actuator><motor joint="j"/></actuator>')

    def push(model, data):
        data.ctrl[0] = 6

    mujoco.set_mjcb_control(push)
    try:
        with pressing(model, data) as contact:
            for _ in range(10):
                mujoco.mj_step(model, data)
            assert contact.on(2)[0][2] > 0 and data.qvel[0] == pytest.approx(0.03)
            advance(contact, 0.01)
        assert mujoco.get_mjcb_control() is push and data.qvel[0] == pytest.approx(0.06)
        with pressing(model, data):
            mujoco.set_mjcb_control(None)  # what the script sets within the block stays, too
        assert mujoco.get_mjcb_control() is None
    finally:
        mujoco.set_mjcb_control(None)


def test_contacts_may_end_in_any_order():
    models = [resting_cube() for _ in range(2)]
    first, second = (VolumetricContact(Bodies(*each), dissipation=1e-3) for each in models)
    first.__enter__()
    second.__enter__()
    first.__exit__()
    for model, data in models:
        mujoco.mj_step(model, data)
    assert (len(first), len(second)) == (0, 1) and models[0][1].ncon
    second.__exit__()
    assert mujoco.get_mjcb_control() is None


def test_forces_of_the_script_replace_ours_until_the_next_step():
    """Rows of xfrc_applied that the script writes are the script's. All others are as it has left them."""
    model, data = simulated(free(CUBE, f"0 0 {HALF - G / 1e5}") + free(CUBE, f"1 0 {HALF - G / 1e5}"))
    data.xfrc_applied[1] = data.xfrc_applied[2] = 0, 0, -1, 0, 0, 0
    with pressing(model, data, dissipation=1e-3):
        mujoco.mj_step(model, data)
        assert data.xfrc_applied[:, 2] == pytest.approx([0, G - 1, G - 1], abs=0.2)  # with those of contacts
        data.xfrc_applied[2] = 0, 0, -3, 0, 0, 0
        for _ in range(2000):
            mujoco.mj_step(model, data)
    assert data.xfrc_applied[:, 2].tolist() == [0, -1, -3]
    assert HALF - data.qpos[2] == pytest.approx((G + 1) / 1e5) and HALF - data.qpos[9] == pytest.approx((G + 3) / 1e5)


def test_one_substep_of_mj_step_that_is_too_few_is_reported_at_its_line():
    model, data = resting_cube(step=0.01)
    with pressing(model, data, stiffness=1e8):
        with pytest.warns(
            overlapper.simulation.SubstepsWarning, match="^1 substeps are too few .* fewer than 1. "
        ) as told:
            mujoco.mj_step(model, data)
        assert told[0].filename == __file__


def test_what_fails_in_a_step_of_mujoco_is_told_and_undone():
    model, data = resting_cube()

    def fails(a, b):
        raise KeyError

    with pressing(model, data, stiffness=fails):
        with pytest.raises(KeyError):
            mujoco.mj_step(model, data)
        model.opt.integrator = int(mujoco.mjtIntegrator.mjINT_RK4)
        with pytest.raises(ValueError, match=r"^VolumetricContact needs MuJoCo's Euler integrator, not RK4"):
            mujoco.mj_step(model, data)
    assert not data.xfrc_applied.any() and model.opt.disableflags == 0


def test_a_control_callback_of_c_is_refused():
    model, data = resting_cube()
    mujoco.set_mjcb_control(ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(lambda model, data: None))
    try:
        with pytest.raises(
            ValueError, match=r"^mujoco\.set_mjcb_control has set a function of C: VolumetricContact can"
        ):
            VolumetricContact(Bodies(model, data), dissipation=1e-3).__enter__()
    finally:
        mujoco.set_mjcb_control(None)
    assert model.opt.disableflags == 0


# ----------------------------------------------------------------------------------------------------------- refusals


@pytest.mark.parametrize("name", ["RK4", "IMPLICIT", "IMPLICITFAST", "DISCRETE"])
def test_other_integrators_are_refused(name):
    model, data = resting_cube()
    said = f"^VolumetricContact needs MuJoCo's Euler integrator, not {name}: set model.opt.integrator = "
    contact = VolumetricContact(Bodies(model, data), dissipation=1e-3)
    with contact:
        model.opt.integrator = int(getattr(mujoco.mjtIntegrator, f"mjINT_{name}"))
        with pytest.raises(ValueError, match=said):
            contact.step()
    with pytest.raises(ValueError, match=said):
        contact.__enter__()
    with pytest.raises(ValueError, match=said):
        VolumetricContact(Bodies(model, data), dissipation=1e-3)
    assert model.opt.disableflags == 0


def test_sleeping_bodies_are_refused():
    model, data = resting_cube()
    model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    with pytest.raises(ValueError, match=r"^VolumetricContact does not support sleeping bodies: "):
        VolumetricContact(Bodies(model, data), dissipation=1e-3)


@pytest.mark.filterwarnings("ignore::overlapper.simulation.cautions.SkippedShapeWarning")
def test_geoms_that_are_not_modelled_are_refused():
    hills = '<mujoco><asset><hfield name="h" nrow="2" ncol="2" size="1 1 .1 .1"/></asset><worldbody>'
    cloth = '<flexcomp name="cloth" type="grid" count="3 3 1" spacing=".1 .1 .1" dim="2" radius=".01">'
    for xml, named in (
        (
            f'{hills}<geom name="hills" type="hfield" hfield="h"/><geom size=".1"/>',
            "world/hills: its heights must be finite",
        ),
        (f'<mujoco><worldbody>{cloth}<contact selfcollide="none"/></flexcomp>', "cloth: flexes are deformable bodies"),
    ):
        model = mujoco.MjModel.from_xml_string(f"{xml}</worldbody></mujoco>")
        data = mujoco.MjData(model)
        model.hfield_size[:, 3] = 0
        mujoco.mj_forward(model, data)
        with pytest.raises(ValueError, match=f"^VolumetricContact cannot replace MuJoCo's contacts of {named}"):
            VolumetricContact(Bodies(model, data), dissipation=1e-3)


def test_pairs_must_contain_all_that_collide():
    model, data = simulated(free(CUBE, "0 0 .049") + free(BALL, "1 0 .049"))
    said = "pairs must contain all pairs that MuJoCo lets collide, but it leaves out 2: MuJoCo's contacts can only be"
    with pytest.raises(ValueError, match=f"^{re.escape(said)}"):
        VolumetricContact(Bodies(model, data), pairs=[(0, 1)]).__enter__()
    assert model.opt.disableflags == 0
    with pressing(model, data, pairs=[(0, 1), (0, 2), (1, 2)]) as contact:
        contact.step()
        assert len(contact) == 2
    model.geom_contype[2] = model.geom_conaffinity[2] = 0  # the ball collides with nothing any more
    with pressing(model, data, pairs=[(0, 1)]) as contact:
        contact.step()
        model.geom_contype[2] = 1
        with pytest.raises(ValueError, match="but it leaves out 2: "):
            contact.step()


# --------------------------------------------------------------------------------------------------- logs and scenes


def test_a_step_in_substeps_is_one_step_for_those_who_watch():
    model, data = resting_cube()
    with overlapper.watch(data, "watched.csv") as watch, pressing(model, data, substeps=3) as contact:
        advance(contact, 0.005)
    assert (watch.steps, watch.time) == (5, pytest.approx(0.005))
    assert [row["step"] for row in read_table(Path("watched.csv"))] == [1, 2, 3, 4, 5]


def test_listeners_hear_of_a_simulation_that_began_before_they_came():
    model, data = resting_cube()
    heard = []
    with pressing(model, data, substeps=2) as contact:
        contact.step()
        unlisten = listen(lambda happening, which: heard.append((happening, which is data)))
        contact.step()
        unlisten()
        contact.step()
    assert heard == [("began", True), ("stepped", True)]


def test_a_scene_may_ask_for_volumetric_contact():
    cube = free(CUBE, f"0 0 {HALF - G / 1e5}")
    Path("cube.xml").write_text(f'<mujoco><worldbody><geom type="plane" size="0 0 1"/>{cube}</worldbody></mujoco>')
    scene = load_scene("cube.xml")
    with closing(run(scene, 20, contact="volumetric")) as frames:
        *_, last = frames
    assert last.forces.on(1)[0] == pytest.approx([0, 0, G], rel=1e-2)
    Path("round.xml").write_text("<mujoco><option integrator='RK4'/><worldbody><geom size='1'/></worldbody></mujoco>")
    with pytest.raises(overlapper.scenes.scene.SceneError, match="has an invalid CONTACT: VolumetricContact needs"):
        next(run(load_scene("round.xml"), contact="volumetric"))


def test_an_empty_model_steps():
    model, data = simulated("")
    with pressing(model, data) as contact:
        contact.step()
    assert (len(contact), contact.substeps, data.time) == (0, 1, STEP)


BELT = '<body name="belt" mocap="true" pos="0 0 .3"><geom type="box" size="1 1 .05" pos="0 0 -.05"/></body>'
ON_BELT = 0.3 + HALF - G / 1e5


@pytest.mark.parametrize("unchanged", [False, True])
def test_a_moving_mocap_body_carries_a_cube_along(unchanged):
    """The cube slides until it is as fast as the belt: over at most v² / 2 µ g, and three steps."""
    speed = 0.1
    model, data = simulated(BELT + free(CUBE, f"0 0 {ON_BELT}"))
    with pressing(model, data) as contact:
        for k in range(1, 501):
            data.mocap_pos[0, 0] = speed * k * STEP
            if unchanged:
                mujoco.mj_step(model, data)
                mujoco.mj_forward(model, data)  # at the same time, before the belt moves on
            else:
                contact.step()
    behind = data.mocap_pos[0, 0] - data.qpos[0]
    assert 0 < behind < speed**2 / (2 * FRICTION * G) + 3 * STEP * speed
    assert data.qvel[0] == pytest.approx(speed, rel=0.01) and abs(data.qpos[1]) < 1e-9


def test_a_turning_mocap_body_carries_a_cube_around():
    model, data = simulated(BELT + free(CUBE, f".3 0 {ON_BELT}"))
    with pressing(model, data) as contact:
        for k in range(1, 1001):
            data.mocap_quat[0] = math.cos(k * STEP / 2), 0, 0, math.sin(k * STEP / 2)
            contact.step()
    assert data.qvel[5] == pytest.approx(1, rel=1e-3)
    assert math.hypot(*data.qpos[:2]) == pytest.approx(0.3, abs=1e-3)
    assert math.atan2(data.qpos[1], data.qpos[0]) == pytest.approx(1, abs=0.05)


def test_a_mocap_body_that_jumps_once_throws_nothing():
    model, data = simulated(BELT + free(CUBE, f"0 0 {ON_BELT}"))
    with pressing(model, data) as contact:
        advance(contact, 0.05)
        data.mocap_pos[0, 0] = 0.5
        fastest = 0.0
        for _ in range(50):
            contact.step()
            fastest = max(fastest, float(np.abs(data.qvel).max()))
    assert fastest < 1e-9 and abs(data.qpos[0]) < 1e-12
