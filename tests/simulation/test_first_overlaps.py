"""First overlaps between two updates: bullets through thin sheets in both simulators, and motions that are left out."""

import pickle

import numpy as np
import pytest
from simulated import body

from overlapper.simulation.first_overlaps import FirstOverlap, FirstOverlaps

SHEET = [1, 1, 5e-4]
SPEED = 300.0  # m/s, of which pybullet allows 100

MODEL = """<mujoco><option timestep="0.004" gravity="0 0 0"/><worldbody>
  <geom name="sheet" type="box" size="1 1 .0005"/>
  <body name="bullet" pos="0.25 0 1"><freejoint/><geom name="lead" type="sphere" size=".01"/></body>
</worldbody></mujoco>"""


class Bullet:
    """A ball that flies down to a sheet at z = 0, in pybullet."""

    def __init__(self, client, height=1.0, speed=SPEED):
        import pybullet

        self.p, self.client = pybullet, client
        self.sheet = body(client, pybullet.GEOM_BOX, halfExtents=SHEET, mass=0)
        self.ball = self.new_ball(height, speed)

    def new_ball(self, height, speed, radius=0.01):
        at = [0.25, 0, height]
        ball = body(self.client, self.p.GEOM_SPHERE, radius=radius, mass=0.01, position=at)
        self.p.changeDynamics(ball, -1, linearDamping=0, angularDamping=0, physicsClientId=self.client)
        self.p.resetBaseVelocity(ball, [0, 0, -speed], physicsClientId=self.client)
        return ball

    def put(self, height):
        pose = [0.25, 0, height], [0, 0, 0, 1]
        self.p.resetBasePositionAndOrientation(self.ball, *pose, physicsClientId=self.client)

    def bodies(self, **options):
        from overlapper.simulation import Bodies

        return Bodies(self.client, **options)

    def step(self):
        self.p.stepSimulation(self.client)


class MujocoBullet:
    """The same in MuJoCo."""

    def __init__(self):
        import mujoco

        self.mujoco, self.model = mujoco, mujoco.MjModel.from_xml_string(MODEL)
        self.data = mujoco.MjData(self.model)
        self.data.qvel[2] = -SPEED
        mujoco.mj_forward(self.model, self.data)

    def bodies(self):
        from overlapper.mujoco import Bodies

        return Bodies(self.model, self.data)

    def step(self):
        self.mujoco.mj_step(self.model, self.data)


@pytest.fixture(params=["pybullet", "mujoco"])
def bullet(request):
    if request.param == "mujoco":
        pytest.importorskip("mujoco")
        return MujocoBullet()
    return Bullet(request.getfixturevalue("client"))


def test_bullet_through_a_thin_sheet_is_found_and_nothing_else_finds_it(bullet):
    bodies = bullet.bodies()
    assert not bodies.overlaps()
    met, heights = [], [bodies.positions[1, 2]]
    for _ in range(4):
        bullet.step()
        bodies.update()
        assert not bodies.overlaps()
        met.append(bodies.first_overlaps())
        heights.append(bodies.positions[1, 2])
    (step,) = (i for i, found in enumerate(met) if found)
    assert heights[step] > 0 > heights[step + 1]
    (found,) = met[step]
    truth = (heights[step] - 0.01 - SHEET[2]) / (heights[step] - heights[step + 1])
    assert found.fraction <= truth <= found.fraction + 1.1e-9
    assert (found.status, found.apart, found.tunnelled) == ("impact", True, True)
    assert met[step].tunnelled == met[step]
    # The sheet has the lesser number, so the normal points down from the bullet to the sheet.
    assert found.point == pytest.approx([0.25, 0, SHEET[2]], abs=1e-6) and found.normal == pytest.approx([0, 0, -1])
    assert bodies.first_overlaps(pairs="all") == bodies.first_overlaps(threads=2)


def test_no_motion_is_known_before_an_update(bullet):
    with pytest.raises(ValueError, match=r"^first_overlaps\(\) needs the poses of two updates: call update\(\)"):
        bullet.bodies().first_overlaps()


def test_wrong_pairs_get_one_sentence(bullet):
    bodies = bullet.bodies()
    bodies.update()
    with pytest.raises(ValueError, match=r"^pairs names 'shet', which is not a body or link in the simulation"):
        bodies.first_overlaps(pairs=[("shet", "bullet")])
    with pytest.raises(ValueError, match=r"^threads must be 1 or more"):
        bodies.first_overlaps(threads=0)


def test_a_filtered_pair_is_examined_only_if_it_is_asked_for(client):
    scene = Bullet(client, height=0.3)
    scene.p.setCollisionFilterGroupMask(scene.ball, -1, 0, 0, physicsClientId=client)
    scene.p.setCollisionFilterGroupMask(scene.sheet, -1, 1, 1, physicsClientId=client)
    bodies = scene.bodies()
    scene.step()
    bodies.update()
    assert bodies.first_overlaps() == []
    assert len(bodies.first_overlaps(pairs=[(scene.sheet, scene.ball)])) == len(bodies.first_overlaps(pairs="all")) == 1


@pytest.mark.parametrize("measured", [False, True])
def test_pairs_that_overlap_at_the_start_are_left_out(client, measured):
    scene = Bullet(client, height=0.009)
    bodies = scene.bodies()
    if measured:
        assert len(bodies.overlaps()) == 1
    scene.put(-1)
    bodies.update()
    assert bodies.first_overlaps() == [] == bodies.first_overlaps(pairs="all")


def test_a_pair_that_still_overlaps_at_the_end_has_not_tunnelled(client):
    scene = Bullet(client, height=1)
    bodies = scene.bodies()
    scene.put(0.005)
    bodies.update()
    (found,) = bodies.first_overlaps()
    assert found.fraction == pytest.approx((1 - 0.01 - SHEET[2]) / 0.995) and not found.apart
    assert bodies.first_overlaps().tunnelled == [] and bodies.overlaps()


def test_the_motion_is_between_updates_whatever_follows(client):
    scene = Bullet(client, height=1)
    bodies = scene.bodies()
    scene.put(0.5)
    bodies.follow()
    scene.put(-1)
    bodies.update()
    scene.put(3)
    bodies.follow()
    (found,) = bodies.first_overlaps()
    assert found.fraction == pytest.approx((1 - 0.01 - SHEET[2]) / 2)
    scene.put(-1)
    bodies.update()  # after a reset
    bodies.update()
    assert bodies.first_overlaps() == []


def test_bodies_that_come_or_go_do_not_disturb_the_others(client):
    scene = Bullet(client, height=1)
    extra = scene.new_ball(5, 0)
    bodies = scene.bodies()
    scene.p.removeBody(extra, physicsClientId=client)
    wall = body(client, scene.p.GEOM_BOX, halfExtents=[1, 1, 0.1], position=[0, 0, 0.5])  # in the way, but new
    scene.put(-1)
    bodies.update()
    assert [found.key[:4] for found in bodies.first_overlaps(pairs="all")] == [(scene.sheet, -1, 0, scene.ball)]
    scene.put(1)
    bodies.update()
    assert {found.bodyB for found in bodies.first_overlaps(pairs="all")} == {scene.ball, wall}


def test_prisms_of_a_height_field_are_known_before_they_are_modelled(client, recorder):
    import pybullet as p

    shape = p.createCollisionShape(
        p.GEOM_HEIGHTFIELD,
        meshScale=[1, 1, 1],
        heightfieldData=[0.0] * 81,
        numHeightfieldRows=9,
        numHeightfieldColumns=9,
        physicsClientId=client,
    )
    ground = p.createMultiBody(0, shape, physicsClientId=client)
    ball = body(client, p.GEOM_SPHERE, radius=0.1, mass=1, position=[0.25, 0.2, 3])
    from overlapper.simulation import Bodies

    bodies = Bodies(client, recorder=recorder)
    assert {key[0] for key in bodies.keys} == {ball}
    p.resetBasePositionAndOrientation(ball, [0.25, 0.2, -0.05], [0, 0, 0, 1], physicsClientId=client)
    bodies.update()
    found = bodies.first_overlaps()
    assert {(each.bodyA, each.bodyB) for each in found} == {(ground, ball)}
    assert min(each.fraction for each in found) == pytest.approx(2.9 / 3.05, abs=1e-6)
    assert not found.tunnelled


def test_tables_and_pickles_of_first_overlaps(client):
    pandas = pytest.importorskip("pandas")
    scene = Bullet(client, height=0.3)
    bodies = scene.bodies(names={1: "bullet"})
    scene.step()
    bodies.update()
    found = bodies.first_overlaps()
    frame = found.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    row = frame.iloc[0]
    assert (row.nameA, row.nameB, row.status, row.apart) == (bodies.labels[scene.sheet], "bullet", "impact", True)
    assert row.impact_fraction == found[0].fraction and row.impact_z_m == found[0].point[2] and row.normal_z == -1
    again = pickle.loads(pickle.dumps(found[0]))
    assert again == found[0] and isinstance(again, FirstOverlap) and np.array_equal(again.point, found[0].point)
    assert FirstOverlaps().to_pandas().empty and "FirstOverlaps, 1" in found._repr_html_()


def test_a_reset_before_a_step_is_no_motion(client):
    scene = Bullet(client, height=0.5, speed=0)
    bodies = scene.bodies()
    scene.put(-0.5)  # through the sheet, but not by a step
    bodies.step_begins()
    scene.step()
    bodies.update()
    assert bodies.first_overlaps() == []
    scene.put(0.5)
    scene.p.resetBaseVelocity(scene.ball, [0, 0, -SPEED], physicsClientId=client)
    bodies.step_begins()
    scene.step()  # 0.42 m with at most 100 m/s: it does not reach the sheet
    bodies.update()
    assert bodies.first_overlaps() == []
    bodies.step_begins()
    scene.step()
    bodies.update()
    assert len(bodies.first_overlaps().tunnelled) == 1
    scene.put(0.5)
    bodies.update()  # without step_begins(), everything is a motion
    assert len(bodies.first_overlaps().tunnelled) == 1


def test_bodies_that_come_before_a_step_take_part_in_its_motion(client):
    scene = Bullet(client, height=5, speed=0)
    bodies = scene.bodies()
    ball = scene.new_ball(0.2, SPEED)
    bodies.step_begins()
    scene.step()
    bodies.update()
    assert [found.bodyB for found in bodies.first_overlaps().tunnelled] == [ball]


class Resets:
    """A bullet that is put back in front of a sheet again and again, with the reset that is given."""

    def __init__(self, reset):
        mujoco = pytest.importorskip("mujoco")
        self.mujoco, self.reset = mujoco, reset
        self.model = mujoco.MjModel.from_xml_string(MODEL)
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)

    def run(self, heights, speed, steps=2):
        """Each round: the ball is put at a height with a speed, then some steps of 0.004 s are made."""
        from overlapper.mujoco import Bodies

        bodies, met = Bodies(self.model, self.data), []
        for height in heights:
            self.reset(self, height, speed)
            for _ in range(steps):
                bodies.step_begins()
                self.mujoco.mj_step(self.model, self.data)
                bodies.update()
                met.append(len(bodies.first_overlaps().tunnelled))
        return met


def put_back(scene, height, speed):
    scene.data.qpos[2], scene.data.qvel[2] = height, -speed


def reset_data(scene, height, speed):
    scene.mujoco.mj_resetData(scene.model, scene.data)
    put_back(scene, height, speed)
    scene.mujoco.mj_forward(scene.model, scene.data)


@pytest.mark.parametrize("reset", [put_back, reset_data])
def test_resets_of_mujoco_are_no_motions(reset):
    scene = Resets(reset)
    assert scene.run([0.5, -0.5, 0.5, -0.5], 0.0) == [0] * 8
    # The poses after a step of MuJoCo are those of its beginning, so a motion is found one step later.
    assert scene.run([0.5, -0.5, 0.5], 150.0) == [0, 1, 0, 0, 0, 1]
    assert scene.run([0.5, 0.5, -0.5], 150.0, steps=1) == [0, 1, 1]  # the last step before a reset is a motion


def test_a_mocap_body_that_is_moved_between_steps_moves():
    mujoco = pytest.importorskip("mujoco")
    from overlapper.mujoco import Bodies

    text = MODEL.replace('<geom name="sheet"', '<body name="holder" mocap="true"><geom name="sheet"')
    model = mujoco.MjModel.from_xml_string(text.replace('.0005"/>', '.0005"/></body>'))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    bodies, met = Bodies(model, data), []
    for height in (0.5, 1.5, 1.5):  # the ball is at 1
        data.mocap_pos[0, 2] = height
        bodies.step_begins()
        mujoco.mj_step(model, data)
        bodies.update()
        met.append(len(bodies.first_overlaps().tunnelled))
    assert met == [0, 1, 0]
