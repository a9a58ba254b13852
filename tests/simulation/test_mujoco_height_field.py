"""Height fields of MuJoCo are the prisms that MuJoCo collides."""

import math

import numpy as np
import pytest

from overlapper import Placed, Sphere, distance, penetration_depth
from overlapper.scenes.run import run
from overlapper.scenes.scene import load_scene
from overlapper.simulation.cautions import SkippedShapeWarning

mujoco = pytest.importorskip("mujoco")

from overlapper.mujoco import Bodies, VolumetricContact, link_contacts  # noqa: E402
from overlapper.reference import Mujoco  # noqa: E402

PROBE = 1e-6
KINDS = {
    "sphere": 'type="sphere" size=".1"',
    "capsule": 'type="capsule" size=".05 .1"',
    "ellipsoid": 'type="ellipsoid" size=".1 .07 .05"',
    "cylinder": 'type="cylinder" size=".08 .05"',
    "box": 'type="box" size=".1 .08 .06"',
    "mesh": 'type="mesh" mesh="m"',
}
MESH = '<mesh name="m" vertex="0 0 0 .3 0 0 0 .2 0 0 0 .2 .2 .2 .1"/>'


def hills(body, where="", heights=None, size=".6 .4 .3 .1", rest="", more=""):
    """A model of a field in the world, and its data. `heights` (rows, columns) are between 0 and 1."""
    heights = np.random.default_rng(1).uniform(0, 1, (5, 7)) if heights is None else np.asarray(heights, dtype=float)
    rows, columns = heights.shape
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><asset>{MESH}<hfield name="h" nrow="{rows}" ncol="{columns}" size="{size}"/>{more}</asset>'
        f'<worldbody>{rest}<geom name="hills" type="hfield" hfield="h" {where}/>{body}</worldbody></mujoco>'
    )
    model.hfield_data[: heights.size] = heights.ravel()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def free(form, at="0 0 .5"):
    return f'<body pos="{at}"><freejoint/><geom {form}/></body>'


def prisms(bodies, geom=0):
    return [placed for key, placed in zip(bodies.keys, bodies.placed) if key[1] == geom]


def modelled(bodies, geom):
    """The prisms by number."""
    return {key[2]: shape for key, shape in zip(bodies.keys, bodies.shapes) if key[1] == geom}


def overlapping(contacts):
    return {tuple(sorted((each.geomA, each.geomB))) for each in contacts if each.overlap}


def of_mujoco(data):
    return {tuple(sorted(each.geom.tolist())) for each in data.contact if each.dist < 0}


@pytest.mark.parametrize("kind", KINDS)
def test_geoms_overlap_a_field_exactly_where_mujoco_has_contacts(kind):
    model, data = hills(free(KINDS[kind]), 'pos=".3 -.2 .1" euler="20 10 30"')
    bodies, random, met = Bodies(model, data), np.random.default_rng(2), 0
    for _ in range(150):
        turn = random.normal(size=4)
        data.qpos[:] = *random.uniform([-0.4, -0.7, -0.3], [1, 0.5, 0.6]), *(turn / np.linalg.norm(turn))
        mujoco.mj_forward(model, data)
        bodies.update()
        ours = overlapping(bodies.overlaps())
        assert ours == of_mujoco(data)
        met += len(ours)
    assert 40 < met < 130


def test_the_surface_is_where_mujocos_rays_hit_it():
    model, data = hills(free('size="2"'))
    bodies, random = Bodies(model, data), np.random.default_rng(3)
    found = prisms(bodies)
    assert len(found) == 2 * 6 * 4 and bodies.report().shapes == bodies.report().shapes_read == 49
    for _ in range(40):
        x, y = random.uniform([-0.55, -0.35], [0.55, 0.35])
        only = np.array([1, 0, 0, 0, 0, 0], dtype=np.uint8)
        to = mujoco.mj_ray(model, data, [x, y, 9], [0, 0, -1.0], only, 1, 1, np.zeros(1, dtype=np.int32))
        above, below = (Placed(Sphere(PROBE), [x, y, 9 - to + side]) for side in (1e-4, -1e-4))
        assert min(distance(prism, above) for prism in found) > 0
        assert max(penetration_depth(prism, below) for prism in found) > 0


def test_a_ball_in_a_flat_field_shares_a_cap_with_it():
    model, data = hills(free('size=".1"', "0.02 0.03 .21"), heights=np.full((5, 5), 0.5))
    bodies = Bodies(model, data)
    (pair,) = link_contacts(bodies.overlaps(tolerance=0.01))
    cap = math.pi * 0.04**2 * (0.1 - 0.04 / 3)
    assert abs(pair.volume - cap) <= pair.volume_error < 0.02 * cap
    assert {(each.bodyA, each.geomA, each.geomB, each.shapeB) for each in pair.contacts} == {(0, 0, 1, 0)}
    assert {each.shapeA for each in pair.contacts} <= set(range(32)) and len(pair.contacts) > 1
    assert -min(each.dist for each in data.contact) == pytest.approx(0.04, abs=1e-6)
    data.qpos[2] = -0.1 - 0.09  # below the base
    mujoco.mj_forward(model, data)
    bodies.update()
    (pair,) = link_contacts(bodies.overlaps())
    assert pair.volume == pytest.approx(math.pi * 0.01**2 * (0.1 - 0.01 / 3), rel=2e-3)


def test_fields_among_other_geoms_of_the_world_are_modelled_near_moving_geoms():
    other = '<hfield name="k" nrow="101" ncol="101" size="5 5 .1 .1"/>'
    floor = '<geom name="rock" size=".3"/>'
    far = '<geom name="far" type="hfield" hfield="k" pos="20 0 0"/>'
    body = free('size=".1"', "-3 -3 .05") + free('size=".1"', "21 1 .05")
    ghost = '<body pos="3 3 .05"><freejoint/><geom size=".1" contype="2" conaffinity="2"/></body>'
    model, data = hills(far + body + ghost, heights=np.zeros((101, 101)), size="5 5 .1 .1", rest=floor, more=other)
    bodies = Bodies(model, data)
    assert bodies.skipped == [] and bodies.keys == sorted(bodies.keys)
    for geom, at in ((1, (-3, -3)), (2, (21, 1))):
        near = prisms(bodies, geom)
        assert 10 < len(near) < 60 and all(np.abs(each.centroid[:2] - at).max() < 0.5 for each in near)
    assert overlapping(bodies.overlaps()) == of_mujoco(data) == {(1, 3), (2, 4)}
    report = bodies.report()
    assert report.shapes == 2 * 20_000 + 4 and report.shapes_read == len(bodies.shapes) < 130
    data.qpos[:2] = -1, 2
    mujoco.mj_forward(model, data)
    before = modelled(bodies, 2)
    bodies.update()
    assert all(np.abs(each.centroid[:2] - (-1, 2)).max() < 0.5 for each in prisms(bodies, 1))
    after = modelled(bodies, 2)
    assert before.keys() == after.keys() and all(before[number] is after[number] for number in before)
    assert bodies.names[0, 2] == "world/far" and overlapping(bodies.overlaps()) == {(1, 3), (2, 4)}


def test_heights_and_sizes_that_are_edited_are_noticed():
    model, data = hills(free('size=".1"', "0 0 .3"), heights=np.zeros((3, 4)))
    bodies = Bodies(model, data)
    assert len(bodies.overlaps()) == 0
    model.hfield_data[:] = 0.9
    bodies.update()
    mujoco.mj_forward(model, data)
    assert overlapping(bodies.overlaps()) == of_mujoco(data) == {(0, 1)}
    model.hfield_size[0, 2] = 0.1
    bodies.update()
    assert len(bodies.overlaps()) == 0
    model.hfield_size[0, 2] = 1
    bodies.update()
    (pair,) = link_contacts(bodies.overlaps())
    assert pair.volume == pytest.approx(4 / 3 * math.pi * 0.1**3, rel=2e-3)


@pytest.mark.parametrize(
    "edit", [("hfield_data", math.nan), ("hfield_data", -1.0), ("hfield_size", 0.0), ("hfield_size", math.nan)]
)
def test_a_field_without_ground_is_left_out_by_name_until_it_has_ground(edit):
    model, data = hills(free('size=".1"', "0 0 .1"))
    bodies = Bodies(model, data)
    array, value = getattr(model, edit[0]), edit[1]
    before, keys = array.copy(), bodies.keys
    array[:] = value
    with pytest.warns(SkippedShapeWarning, match=r"world/hills .*: its heights must be finite and above") as told:
        bodies.update()
    assert told[0].filename == __file__ and prisms(bodies) == []
    bodies.update()
    array[:] = before
    bodies.update()
    assert bodies.skipped == [] and bodies.keys == keys


def test_a_field_that_a_script_moves_is_followed_until_it_has_no_pose():
    moved = '<body mocap="true" pos="0 0 -9"><geom name="lift" type="hfield" hfield="h"/></body>'
    model, data = hills(free('size=".1"', "0 0 .3") + moved, "pos='9 9 9'", heights=np.zeros((5, 5)))
    bodies = Bodies(model, data)
    lift = model.geom("lift").id
    assert prisms(bodies, lift) == []
    data.mocap_pos[0] = math.nan
    mujoco.mj_kinematics(model, data)
    bodies.update()
    assert prisms(bodies, lift) == []
    data.mocap_pos[0] = 0.1, 0, 0.25
    data.mocap_quat[0] = math.cos(0.5), 0, 0, math.sin(0.5)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_collision(model, data)
    bodies.update()
    (pair,) = link_contacts(bodies.overlaps())
    assert pair.volume == pytest.approx(math.pi * 0.05**2 * (0.1 - 0.05 / 3), rel=2e-3)
    assert overlapping(bodies.overlaps()) == of_mujoco(data)
    data.mocap_pos[0] = math.nan
    mujoco.mj_kinematics(model, data)
    with pytest.warns(SkippedShapeWarning, match="no finite pose"):
        bodies.update()
    assert len(bodies.overlaps()) == 0


def quadruped():
    legs = "".join(
        f'<body pos="{x} {y} 0" euler="0 20 {turn}"><joint axis="0 1 0" damping="1" stiffness="20"/>'
        '<geom type="capsule" fromto="0 0 0 .35 0 0" size=".04"/>'
        '<body pos=".35 0 0" euler="0 60 0"><joint axis="0 1 0" damping="1" stiffness="20"/>'
        '<geom type="capsule" fromto="0 0 0 .3 0 0" size=".03"/>'
        '<geom type="ellipsoid" size=".06 .05 .04" pos=".3 0 0"/>'
        "</body></body>"
        for x, y, turn in ((0.2, 0.15, 45), (0.2, -0.15, -45), (-0.2, 0.15, 135), (-0.2, -0.15, -135))
    )
    return f'<body pos="0 0 1"><freejoint/><geom type="ellipsoid" size=".3 .22 .12"/>{legs}</body>'


def test_a_quadruped_on_terrain_has_mujocos_overlaps():
    """As in dm_control's task `escape`: the task writes the heights after the model is compiled."""
    across = np.linspace(-3, 3, 61)
    bumps = (np.sin(3 * across)[:, None] * np.cos(4 * across) + 1) / 2
    model, data = hills(quadruped(), heights=bumps, size="6 6 .4 .1")
    model.geom_friction[:, 0] = 0.05
    data.qvel[:2] = 2, 1
    bodies, met, most = Bodies(model, data), 0, 0
    for _ in range(600):
        mujoco.mj_step(model, data)
        bodies.update()
        ours = overlapping(bodies.overlaps())
        assert ours == of_mujoco(data)
        met, most = met + len(ours), max(most, len(prisms(bodies)))
    assert met > 500 and most < 500 and np.linalg.norm(data.qpos[:2]) > 0.3


def test_a_cube_rests_on_a_flat_field_by_its_overlap():
    model, data = hills(free('type="box" size=".05 .05 .05" mass="1"', ".013 .027 .0499"), heights=np.zeros((9, 9)))
    with VolumetricContact(Bodies(model, data), stiffness=1e7, friction=0.5) as contact:
        for _ in range(200):
            contact.step()
        force, _ = contact.on(1)
        assert len(data.contact) == 0
    assert force == pytest.approx([0, 0, 9.81], abs=1e-4)
    assert 0.05 - data.qpos[2] == pytest.approx(9.81 / (1e7 * 0.01), rel=1e-2) and abs(data.qvel[:3]).max() < 1e-6


def moved(body, heights, steps, speed=0.0, tilt="", **law):
    """The pose of a body after steps on a field, whose cells are 0.1 m wide."""
    model, data = hills(body, where=tilt, heights=heights, size=".8 .8 .8 .8")
    data.qvel[0] = speed
    with VolumetricContact(Bodies(model, data), friction=0.5, **{"stiffness": 1e7} | law) as contact:
        for _ in range(steps):
            contact.step()
        return data.qpos.copy(), contact.mean()


def test_prisms_press_with_their_tops_alone():
    """The walls between prisms are inside the field. A ball on them, dropped beside a vertex, does not roll away."""
    flat = np.zeros((17, 17))
    fallen, forces = moved(free('size=".05" mass="1"', ".013 .021 .07"), flat, 400)
    assert len(forces) > 1 and np.abs(fallen[:2] - (0.013, 0.021)).max() < 1e-7
    assert np.allclose(np.abs(forces.normal), (0, 0, 1)) and np.linalg.norm(fallen[4:6]) < 1e-6
    cap = 9.81 / 1e7  # m³: the volume of the ball below the ground
    depth = 0.05 - fallen[2]
    assert math.pi * depth**2 * (0.05 - depth / 3) == pytest.approx(cap, rel=1e-6)


def test_a_cube_slides_on_prisms_as_far_as_on_a_plane():
    cube = free('type="box" size=".05 .05 .05" mass="1"', ".013 .021 .0499")
    slid, _ = moved(cube, np.zeros((17, 17)), 400, speed=1.0)
    assert slid[0] - 0.013 == pytest.approx(1 / (2 * 0.5 * 9.81), rel=0.02)
    assert abs(slid[1] - 0.021) < 5e-5
    assert math.degrees(2 * math.acos(min(1, abs(slid[3])))) < 0.2


def test_a_cube_on_a_slope_of_prisms_rests_at_the_depth_of_its_weight():
    """The walls are not perpendicular to this top, and still nothing presses against them."""
    slope = 0.3  # rise per run: 0.48 m over the field
    heights = np.tile(np.linspace(0, slope * 1.6 / 0.8, 17), (17, 1))
    angle = math.atan(slope)
    up = np.array([-math.sin(angle), 0, math.cos(angle)])
    middle = np.array([0.013, 0.021, 0.8 * heights[0, 8] + slope * 0.013]) + (0.05 - 1e-4) * up
    turn = f'quat="{math.cos(angle / 2)} 0 {-math.sin(angle / 2)} 0"'
    at = " ".join(map(repr, middle.tolist()))
    cube = f'<body pos="{at}" {turn}><freejoint/><geom type="box" size=".05 .05 .05" mass="1"/></body>'
    rests, forces = moved(cube, heights, 400)
    assert np.allclose(np.abs(forces.normal @ up), 1)
    assert forces.on(1)[0] == pytest.approx([0, 0, 9.81], abs=1e-4)
    depth = 0.05 - (rests[:3] - (0, 0, 0.8 * heights[0, 8])) @ up
    assert depth == pytest.approx(9.81 * math.cos(angle) / (1e7 * 0.01), rel=0.01)
    assert np.linalg.norm(rests[:3] - middle) < 2e-4


def test_walls_at_the_border_of_a_field_are_free():
    field = Bodies(*hills(free('size=".1"', "-.6 0 .05"), heights=np.zeros((5, 7))))
    tops = {key[2]: top for key, top in zip(field.keys, field.tops) if key[1] == 0}
    assert {number for number, top in tops.items() if not top.any()} == {
        n for n in tops if n % 2 and (n % 12 == 1 or n > 36)
    }
    assert all(top.tolist() in ([0, 0, 0], [0, 0, 1]) for top in tops.values())


def test_parts_of_a_field_are_not_compared_with_mujocos_whole_field():
    model, data = hills(free('size=".1"', "0 0 .1"), rest='<geom size=".05" pos="0 0 .1"/>')
    bodies = Bodies(model, data)
    contacts = bodies.overlaps()
    overlapping, distances = bodies.own_distances(contacts)
    of_field = contacts.keys[:, 1] == model.geom("hills").id
    np.testing.assert_array_equal(np.isnan(distances), of_field)
    assert overlapping.all() and 1 < of_field.sum() < len(contacts)
    told = Mujoco().compare_contacts(bodies, contacts)
    assert {each.verdict for each, of in zip(told, of_field) if of} == {"unsupported"}
    assert told[-1].explanation == "MuJoCo answers for a whole height field, not for the part of it in this pair."
    assert [each.verdict for each, of in zip(told, of_field) if not of] == ["agree"]


def test_a_model_file_with_a_field_is_a_scene(tmp_path):
    path = tmp_path / "hills.xml"
    path.write_text(
        '<mujoco><asset><hfield name="h" nrow="2" ncol="2" size="1 1 .1 .1"/></asset><worldbody>'
        f'<geom type="hfield" hfield="h"/>{free(KINDS["box"], "0 0 .06")}</worldbody></mujoco>'
    )
    frames = [*run(load_scene(str(path)), 20)]
    assert frames[-1].bodies.skipped == [] and len(frames[-1].contacts) == 2
