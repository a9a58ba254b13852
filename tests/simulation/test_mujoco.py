"""The geoms of MuJoCo models: shapes, poses, pairs, scenes, logs and watches."""

import ctypes
import json
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

import overlapper
from overlapper import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, Log, Placed, Sphere, overlap
from overlapper.scenes.check import hold
from overlapper.scenes.run import run
from overlapper.scenes.scene import SceneError, load_scene
from overlapper.simulation.cautions import SkippedShapeWarning, UnknownBodyWarning
from overlapper.simulation.imports import when_imported
from overlapper.tables.table_file import read_metadata, read_table

mujoco = pytest.importorskip("mujoco")

from overlapper.mujoco import Bodies, GeomContact, VolumetricContact, link_contacts  # noqa: E402
from overlapper.reference import Mujoco  # noqa: E402

ROBOT = """
<mujoco model="robot">
  <worldbody>
    <geom name="floor" type="plane" size="1 1 .1"/>
    <body name="torso" pos="0 0 .1">
      <freejoint/>
      <geom name="ball" type="sphere" size=".11"/>
      <geom type="capsule" size=".05 .1" pos=".1 0 0"/>
      <body name="leg" pos="0 0 -.05"><joint/><geom name="foot" type="ellipsoid" size=".1 .05 .07"/></body>
    </body>
  </worldbody>
</mujoco>
"""
TYPES = ["plane", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh"]
MESH = '<asset><mesh name="m" vertex="0 0 0 .3 0 0 0 .4 0 0 0 .5 .3 .4 .1"/></asset>'


def simulated(xml):
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def geom(kind, rng, where=""):
    size = " ".join(f"{each:.3f}" for each in rng.uniform(0.1, 0.4, 3))
    form = 'mesh="m"' if kind == "mesh" else f'size="{size}"'
    return f'<geom type="{kind}" {form} {where}/>'


def two(kinds, seed):
    """A model of two bodies with a geom each, at random poses that often overlap."""
    rng = np.random.default_rng(seed)
    bodies = ""
    for kind in kinds:
        position = " ".join(f"{each:.4f}" for each in rng.uniform(-0.3, 0.3, 3))
        turn = " ".join(f"{each:.4f}" for each in rng.normal(size=4))
        joint = "" if kind == "plane" else "<freejoint/>"
        inertia = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>' if joint else ""
        shape = geom(kind, rng, f'pos="{position}" quat="{turn}"' if kind == "plane" else "")
        bodies += shape if kind == "plane" else f'<body pos="{position}" quat="{turn}">{joint}{inertia}{shape}</body>'
    return simulated(f"<mujoco>{MESH}<worldbody>{bodies}</worldbody></mujoco>")


def tree(seed):
    """A random tree of spheres and capsules with masks, welds, mocap bodies, excludes and explicit pairs."""
    rng = np.random.default_rng(seed)
    names = {"g": 0, "b": 0}

    def named(kind):
        names[kind] += 1
        return f'name="{kind}{names[kind] - 1}"'

    def round_geom():
        masks = f'contype="{rng.integers(4)}" conaffinity="{rng.integers(4)}"'
        at = " ".join(f"{each:.3f}" for each in rng.uniform(-2, 2, 3))
        return f'<geom {named("g")} type="{rng.choice(["sphere", "capsule"])}" size=".1 .1 .1" pos="{at}" {masks}/>'

    def body(depth):
        mocap = depth == 0 and rng.random() < 0.25
        joint = "" if mocap or rng.random() < 0.4 else '<joint type="hinge"/>'
        inside = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
        inside += "".join(round_geom() for _ in range(rng.integers(3)))
        inside += "".join(body(depth + 1) for _ in range(rng.integers(3) if depth < 3 else 0))
        return f'<body {named("b")} mocap="{str(mocap).lower()}">{joint}{inside}</body>'

    world = "".join(round_geom() for _ in range(2)) + "<geom type='plane' size='0 0 1'/>"
    world += "".join(body(0) for _ in range(4))
    pairs = {tuple(sorted(rng.choice(names["g"], 2, replace=False).tolist())) for _ in range(3)}
    contact = "".join(f'<pair geom1="g{a}" geom2="g{b}"/>' for a, b in pairs)
    for _ in range(3):
        a, b = rng.choice(names["b"], 2, replace=False)
        contact += f'<exclude body1="b{a}" body2="b{b}"/>'
    flag = '<option><flag filterparent="disable"/></option>' if seed % 2 else ""
    return mujoco.MjModel.from_xml_string(
        f"<mujoco>{flag}<worldbody>{world}</worldbody><contact>{contact}</contact></mujoco>"
    )


def pairs_of_mujoco(data, touching):
    return {tuple(sorted(each.geom.tolist())) for each in data.contact if touching(each)}


@pytest.fixture(autouse=True)
def away(monkeypatch, tmp_path):
    """MuJoCo logs its warnings in the working folder."""
    monkeypatch.chdir(tmp_path)


# ------------------------------------------------------------------------------------------------------------- shapes


def test_bodies_have_names_numbers_and_shapes_of_mujoco():
    model, data = simulated(ROBOT)
    bodies = Bodies(model, data)
    assert bodies.keys == [(0, 0, 0), (1, 1, 0), (1, 2, 0), (2, 3, 0)]
    assert bodies.names == {
        (0, -1): "world",
        (0, 0): "world/floor",
        (1, -1): "torso",
        (1, 1): "torso/ball",
        (1, 2): "torso/geom 2",
        (2, -1): "leg",
        (2, 3): "leg/foot",
    }
    wanted = HalfSpace([0, 0, 1], 0), Sphere(0.11), Capsule(0.05, 0.2), Ellipsoid([0.1, 0.05, 0.07])
    assert str(bodies.shapes) == str([*wanted])
    assert bodies.model is model and bodies.data is data and bodies.engine == "mujoco"
    assert str(bodies.report()).startswith("3 bodies, 4 of 4 shapes read\n")
    assert Bodies(model, data, names={1: "trunk"}).names[1, 1] == "trunk/ball"
    with pytest.warns(UnknownBodyWarning, match="names has bodies that are not in the simulation: 7: 'x'"):
        Bodies(model, data, names={7: "x"})


def test_contacts_are_of_geoms_and_unions_of_bodies():
    model, data = simulated(ROBOT)
    contacts = Bodies(model, data).overlaps()
    assert all(isinstance(each, GeomContact) for each in contacts)
    assert [(each.bodyA, each.geomA, each.bodyB, each.geomB) for each in contacts] == [
        (0, 0, 1, 1), (0, 0, 1, 2), (0, 0, 2, 3),
    ]  # fmt: skip
    floor, ball = HalfSpace([0, 0, 1], 0), Placed(Sphere(0.11), (0, 0, 0.1))
    capsule = Placed(Capsule(0.05, 0.2), (0.1, 0, 0.1))
    assert contacts[0].overlap.volume == overlap(floor, ball).volume
    torso, leg = link_contacts(contacts)
    assert (torso.bodyA, torso.linkA, torso.bodyB, torso.linkB) == (0, -1, 1, -1)
    both = contacts[0].overlap.volume + contacts[1].overlap.volume - overlap(floor, ball, capsule).volume
    assert torso.volume == pytest.approx(both, rel=1e-3) and leg.volume == contacts[2].overlap.volume
    table = link_contacts(contacts).to_dict() if hasattr(link_contacts(contacts), "to_dict") else None
    assert table is None or table["nameB"] == ["torso", "leg"]
    assert [each.geomB for each in contacts[contacts.overlaps.depth > 0.015]] == [2, 3]


@pytest.mark.parametrize("first", TYPES)
def test_depths_and_distances_are_those_of_mj_geomDistance(first):
    """Where MuJoCo's are right: a plane with anything, and a sphere, box or mesh with a sphere, box or mesh."""
    exact = {"sphere", "box", "mesh"}
    met = 0
    for second in TYPES:
        if not ({first, second} <= exact or (first == "plane") != (second == "plane")):
            continue
        for seed in range(8):
            model, data = two([first, second], seed)
            bodies = Bodies(model, data)
            a, b = bodies.placed
            told = mujoco.mj_geomDistance(model, data, *(key[1] for key in bodies.keys), 10.0, None)
            found = overlap(a, b)
            ours = -found.depth if found else found.distance
            assert ours == pytest.approx(told, abs=2e-6), (first, second, seed)
            met += bool(found)
    assert met > 3 or first in ("capsule", "ellipsoid", "cylinder")


@pytest.mark.parametrize("kind", TYPES)
def test_each_type_of_geom_is_the_shape_that_mujoco_collides(kind):
    model, data = two([kind], 3)
    (shape,) = Bodies(model, data).shapes
    size = model.geom_size[0]
    wanted = {
        "plane": HalfSpace([0, 0, 1], 0),
        "sphere": Sphere(size[0]),
        "capsule": Capsule(size[0], 2 * size[1]),
        "ellipsoid": Ellipsoid(size),
        "cylinder": Cylinder(size[0], 2 * size[1]),
        "box": Box(size),
        "mesh": Hull(model.mesh_vert.astype(float)) if model.nmesh else None,
    }
    if kind == "mesh":
        np.testing.assert_array_equal(np.sort(shape.vertices, axis=0), np.sort(wanted[kind].vertices, axis=0))
    else:
        assert str(shape) == str(wanted[kind])


def test_a_mesh_is_the_hull_of_its_graph():
    points = np.random.default_rng(1).normal(size=(60, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    text = " ".join(f"{each:.5f}" for each in points.ravel())
    xml = '<mujoco><asset><mesh name="m" vertex="{}" {}/></asset><worldbody>{}</worldbody></mujoco>'
    one = '<geom type="mesh" mesh="m"/>'
    whole, coarse = (Bodies(*simulated(xml.format(text, limit, one * 2))).shapes for limit in ("", 'maxhullvert="20"'))
    assert whole[0] is whole[1] and whole[0].volume > coarse[0].volume
    assert len(coarse[0].vertices) <= 20 < len(whole[0].vertices) == 60
    unseen = simulated(xml.format(text, "", '<geom type="mesh" mesh="m" contype="0" conaffinity="0"/>'))
    assert Bodies(*unseen).shapes == []
    unseen[0].geom_contype[:] = 1
    assert Bodies(*unseen).shapes[0].volume == pytest.approx(whole[0].volume)


def test_what_is_not_modelled_is_named_once(tmp_path):
    xml = """<mujoco><asset><hfield name="h" nrow="2" ncol="2" size="1 1 .1 .1"/></asset>
    <worldbody><geom name="hills" type="hfield" hfield="h"/><geom name="ball" size=".1"/></worldbody></mujoco>"""
    model, data = simulated(xml)
    model.hfield_size[0, 3] = 0
    with pytest.warns(SkippedShapeWarning, match=r"world/hills \(body 0, link 0\) is left out: its height") as told:
        bodies = Bodies(model, data)
    assert told[0].filename == __file__ and len(told) == 1
    bodies.update()
    assert [each.name for each in bodies.skipped] == ["world/hills"] and len(bodies.shapes) == 1
    flex = """<mujoco><worldbody><flexcomp name="cloth" type="grid" count="3 3 1" spacing=".1 .1 .1" dim="2"
    radius=".01"><contact selfcollide="none"/></flexcomp></worldbody></mujoco>"""
    with pytest.warns(SkippedShapeWarning, match="cloth .*: flexes are deformable"):
        bodies = Bodies(*simulated(flex))
    assert bodies.report().shapes == 1 and not bodies.report().shapes_read


# -------------------------------------------------------------------------------------------------------------- pairs


@pytest.mark.parametrize("seeds", [range(k, k + 25) for k in range(1000, 1200, 25)])
def test_pairs_are_exactly_those_that_mj_collision_looks_at(seeds):
    """With a gap of 1 km, every pair that mj_collision looks at is a contact."""
    for seed in seeds:
        model = tree(seed)
        model.geom_gap[:] = model.pair_gap[:] = 1e3
        data = mujoco.MjData(model)
        mujoco.mj_setConst(model, data)
        mujoco.mj_forward(model, data)
        bodies = Bodies(model, data)
        asked = {(a[1], b[1]) for a, b in bodies.link_pairs()}
        looked_at = pairs_of_mujoco(data, lambda each: True)
        assert {tuple(sorted(each)) for each in asked} == looked_at, seed
        bodies.overlaps()
        assert bodies.report().pairs_possible == len(looked_at)


def test_more_geoms_than_a_table_holds_have_the_same_pairs():
    """300 geoms in chains, with masks, an exclude and an explicit pair."""
    chance, bodies = np.random.default_rng(5), ""
    for k in range(100):
        at = " ".join(f"{each:.3f}" for each in chance.uniform(-0.5, 0.5, 3))
        part = '<geom name="{}" size=".06" contype="{}" conaffinity="{}" pos="{} 0 0"/>'
        parts = [part.format(f"g{k}_{j}", *chance.integers(1, 4, 2), 0.05 * j) for j in range(3)]
        inner = f'<body name="i{k}" pos=".05 0 0"><joint/>{parts[1]}{parts[2]}</body>'
        bodies += f'<body name="o{k}" pos="{at}"><freejoint/>{parts[0]}{inner}</body>'
    contact = '<exclude body1="o1" body2="o2"/><pair geom1="g3_0" geom2="g3_1"/>'
    model, data = simulated(f"<mujoco><worldbody>{bodies}</worldbody><contact>{contact}</contact></mujoco>")
    bodies = Bodies(model, data)
    for _ in range(2):
        ours = {(each.geomA, each.geomB) for each in bodies.overlaps() if each.overlap}
        assert ours == pairs_of_mujoco(data, lambda each: each.dist < 0)
        model.geom_contype[:20] = 0
        mujoco.mj_setConst(model, data)
        mujoco.mj_forward(model, data)
        bodies.update()
    assert len(ours) > 100


def test_a_contact_filter_in_python_decides_as_in_mj_collision():
    """With a filter, mj_collision asks the masks of bodies, and of geoms only whether there is a mask."""
    discarded = 0
    for seed in range(1200, 1230):
        model = tree(seed)
        model.geom_gap[:] = model.pair_gap[:] = 1e3
        data = mujoco.MjData(model)
        mujoco.mj_setConst(model, data)
        mujoco.mj_forward(model, data)
        bodies = Bodies(model, data)
        before = bodies.link_pairs()
        mujoco.set_mjcb_contactfilter(lambda m, d, a, b: int((7 * a + 13 * b) % 3 == 0))
        try:
            mujoco.mj_forward(model, data)
            bodies.update()
            asked = {tuple(sorted((a[1], b[1]))) for a, b in bodies.link_pairs()}
            assert asked == pairs_of_mujoco(data, lambda each: True), seed
            bodies.overlaps()
            assert bodies.report().pairs_possible == len(asked)
            discarded += len({tuple(sorted((a[1], b[1]))) for a, b in before} - asked)
        finally:
            mujoco.set_mjcb_contactfilter(None)
        bodies.update()
        assert bodies.link_pairs() == before
    assert discarded > 100


def test_overlapping_pairs_are_those_with_a_negative_distance():
    met = 0
    for seed in range(30):
        rng = np.random.default_rng(seed)
        kinds = rng.choice(["sphere", "capsule", "box", "cylinder"], 12)
        made = ""
        for kind in kinds:
            at = " ".join(f"{each:.3f}" for each in rng.uniform(-0.6, 0.6, 3))
            turn = " ".join(f"{each:.3f}" for each in rng.normal(size=4))
            made += f'<body pos="{at}" quat="{turn}"><freejoint/>{geom(kind, rng)}</body>'
        model, data = simulated(f"<mujoco><worldbody>{made}</worldbody></mujoco>")
        ours = {(each.geomA, each.geomB) for each in Bodies(model, data).overlaps() if each.overlap}
        assert ours == pairs_of_mujoco(data, lambda each: each.dist < 0), seed
        met += len(ours)
    assert met > 300


def test_flags_filters_and_masks_are_followed():
    model, data = simulated(ROBOT)
    bodies = Bodies(model, data)
    for flag in (mujoco.mjtDisableBit.mjDSBL_CONTACT, mujoco.mjtDisableBit.mjDSBL_CONSTRAINT):
        model.opt.disableflags = int(flag)
        bodies.update()
        assert len(bodies.overlaps()) == 0 and bodies.report().pairs_possible == 0
    model.opt.disableflags = 0
    model.geom_contype[1] = model.geom_conaffinity[1] = 0
    bodies.update()
    assert [each.geomB for each in bodies.overlaps()] == [2, 3]
    assert len(bodies.overlaps(pairs="all")) == 3  # the leg lies in the capsule of its parent
    assert [each.geomB for each in bodies.overlaps(pairs=[("world", "torso/geom 2")])] == [2]
    assert [each.geomB for each in bodies.overlaps(pairs=("leg", "world"))] == [3]
    kind = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int, ctypes.c_int)
    mujoco.set_mjcb_contactfilter(kind(lambda m, d, a, b: 0))
    try:
        with pytest.warns(UserWarning, match="set a function of C"):
            bodies.overlaps()
        bodies.overlaps()  # says no more
    finally:
        mujoco.set_mjcb_contactfilter(None)


def test_sizes_types_and_meshes_that_are_edited_are_noticed():
    model, data = simulated(ROBOT)
    bodies = Bodies(model, data)
    model.geom_size[1, 0] = 0.05
    bodies.update()
    assert str(bodies.shapes[1]) == str(Sphere(0.05)) and [each.geomB for each in bodies.overlaps()] == [2, 3]
    model.geom_type[1] = int(mujoco.mjtGeom.mjGEOM_BOX)
    model.geom_size[1] = 0.12
    bodies.update()
    assert str(bodies.shapes[1]) == str(Box([0.12] * 3)) and bodies.overlaps()[0].overlap.depth == pytest.approx(0.02)
    model.geom_size[1] = 0
    with pytest.warns(SkippedShapeWarning, match="torso/ball .* is left out"):
        bodies.update()
    assert [key[1] for key in bodies.keys] == [0, 2, 3]


def test_poses_are_those_of_data_and_may_be_lost():
    model, data = simulated(ROBOT)
    bodies = Bodies(model, data)
    data.qpos[2] += 1
    bodies.update()
    assert len(bodies.overlaps()) == 3  # until mj_kinematics
    mujoco.mj_kinematics(model, data)
    bodies.update()
    assert len(bodies.overlaps()) == 0
    np.testing.assert_array_equal(bodies.positions, data.geom_xpos)
    data.geom_xpos[3, 0] = np.nan
    with pytest.warns(SkippedShapeWarning, match=r"leg \(body 2, link -1\) is left out: it has no finite pose"):
        bodies.update()
    assert (2, 3, 0) not in bodies.keys
    mujoco.mj_kinematics(model, data)
    bodies.update()
    assert (2, 3, 0) in bodies.keys


def test_wrong_arguments_are_refused_in_one_sentence():
    model, data = simulated(ROBOT)
    other, _ = simulated(ROBOT)
    for arguments, error, words in [
        ((data, model), TypeError, "model must be a mujoco.MjModel, not <mujoco"),
        ((model, 0), TypeError, "data must be a mujoco.MjData, not 0"),
        ((other, data), ValueError, "data is of another model"),
        ((model, mujoco.MjData(model)), ValueError, r"data has no poses yet: call mujoco.mj_forward\(model, data\)"),
    ]:
        with pytest.raises(error, match=words):
            Bodies(*arguments)
    with pytest.raises(ValueError, match="surface must be 'nominal', not 'margin': MuJoCo has no other surface"):
        Bodies(model, data, surface="margin")
    with pytest.raises(ValueError, match=r"pairs names 'torso/bal', which is not a body or link .*; 'torso/ball' is"):
        Bodies(model, data).overlaps(pairs=("torso/bal", "leg"))


def test_mujoco_is_needed_by_name_and_pybullet_is_not():
    def without(library):
        code = f"import sys; sys.modules[{library!r}] = None; from overlapper.mujoco import Bodies"
        return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)

    assert without("mujoco").stderr.splitlines()[-1] == (
        "ImportError: overlapper.mujoco needs mujoco: pip install mujoco"
    )
    assert without("pybullet").returncode == 0


# ---------------------------------------------------------------------------------------------- scenes, logs, watches


# ------------------------------------------------------------------------------------------------ MuJoCo's own answers

CAPSULE_IN_BOX = """<mujoco><worldbody><geom name="box" type="box" size=".2 .3 .4"/>
<body pos=".02 0 0" quat="1 .3 .2 0"><freejoint/><geom name="capsule" type="capsule" size=".05 .1"/></body>
</worldbody></mujoco>"""


def opinions(model, data, **chosen):
    bodies = Bodies(model, data)
    return Mujoco().compare_contacts(bodies, bodies.overlaps(**chosen))


@pytest.mark.parametrize("kinds", [("plane", "mesh"), ("sphere", "box"), ("box", "mesh"), ("capsule", "capsule")])
def test_mujoco_agrees_where_its_distances_are_exact(kinds):
    found = [each for seed in range(8) for each in opinions(*two(kinds, seed))]
    assert {each.verdict for each in found} == {"agree"} and all(each.by == "mujoco" for each in found)


def test_a_capsule_in_a_box_is_too_shallow_in_mujoco():
    (told,) = opinions(*simulated(CAPSULE_IN_BOX))
    assert (told.verdict, told.nearer) == ("disagree", "ours")
    assert told.theirs.signed_distance == pytest.approx(-0.23460177) and told.theirs.overlapping
    assert told.exact == pytest.approx((told.ours.signed_distance,) * 2, abs=1e-12)
    assert told.explanation.startswith("Signed distance by MuJoCo -0.234601") and "so ours is" in told.explanation


def test_what_mujoco_says_of_ellipsoids_is_not_decided():
    balls = """<mujoco><worldbody><geom type="ellipsoid" size=".03 .04 .06"/><body pos="{} 0 0"><freejoint/>
    <geom size=".03"/></body></worldbody></mujoco>"""
    (deep,) = opinions(*simulated(balls.format(0.02)))
    assert (deep.verdict, deep.nearer, deep.exact) == ("disagree", None, None)
    assert deep.explanation.endswith("by us -0.04 m (overlapping): the exact distance of an ellipsoid is not known.")
    (shallow,) = opinions(*simulated(balls.format(0.06 - 1e-8)))
    assert shallow.verdict == "agree"


def test_a_contact_that_mujoco_misses_is_a_disagreement():
    """MuJoCo tests an edited geom with its old bounding box until mj_setConst is called."""
    model, data = simulated(ROBOT.replace('pos="0 0 .1"', 'pos="0 0 2"'))
    model.geom_size[1, 0] = 2.5
    mujoco.mj_forward(model, data)
    told = opinions(model, data, pairs=[("world/floor", "torso/ball")])
    assert [(each.verdict, each.nearer) for each in told] == [("disagree", "ours")]
    assert told[0].theirs.signed_distance == pytest.approx(-0.5) and not told[0].theirs.overlapping
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT  # then MuJoCo tests nothing
    assert opinions(model, data, pairs="all")[0].verdict == "agree"


def test_pairs_without_contacts_are_compared_by_their_distances():
    model, data = simulated(ROBOT)
    told = {each.verdict for each in opinions(model, data, pairs="all")}
    assert len(Bodies(model, data).overlaps(pairs="all")) > len(data.contact) == 3 and told <= {"agree", "disagree"}
    bodies = Bodies(model, data)
    overlapping, distances = bodies.own_distances(bodies.overlaps(pairs="all"))
    assert overlapping.all() and (distances < 0).all()
    contacts = bodies.overlaps()
    with VolumetricContact(bodies):
        mujoco.mj_step(model, data)
        assert len(data.contact) == 0 and bodies.own_distances(contacts)[0].all()


def test_touching_geoms_agree():
    model, data = simulated(ROBOT.replace('pos="0 0 .1"', 'pos="0 0 .11"').replace(".05 .1", ".01 .1"))
    (ball, *_) = opinions(model, data)
    assert ball.verdict == "agree" and abs(ball.theirs.signed_distance) < 1e-6
    bodies = Bodies(model, data)
    contacts = bodies.overlaps()
    data.geom_xpos[1, 2] += 0.5
    assert bodies.own_distances(contacts)[1][0] == pytest.approx(0.5)
    empty = bodies.own_distances(contacts[:0])
    assert [each.shape for each in empty] == [(0,), (0,)]


@pytest.fixture
def here(away):
    Path("robot.xml").write_text(ROBOT)
    Path("dropped.py").write_text(
        '"""A robot is dropped."""\nimport mujoco\nENGINE, STEPS = "mujoco", 40\n'
        "def build(*, height=0.0, push=False):\n"
        '    model = mujoco.MjModel.from_xml_path("robot.xml")\n    data = mujoco.MjData(model)\n'
        "    data.qpos[2] += height\n    steps = []\n"
        "    return (model, data, steps.append) if push else (model, data)\n"
    )


@pytest.mark.usefixtures("here")
def test_a_model_file_is_a_scene_of_a_second():
    scene = load_scene("robot.xml")
    assert (scene.steps, scene.engine, scene.contact) == (500, "mujoco", "mujoco")
    with closing(run(scene, 3)) as frames:
        found = [(frame.step, frame.time, len(frame.contacts)) for frame in frames]
    assert found == [(1, 0.002, 3), (2, 0.004, 3), (3, 0.006, 3)]
    done = subprocess.run(
        [sys.executable, "-m", "overlapper", "run", "robot.xml", "--steps", "5", "--out", "robot.csv"],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    heading, rows = read_metadata(Path("robot.csv")), read_table(Path("robot.csv"))
    assert heading["mujoco"] == mujoco.__version__ and heading["contact"] == "mujoco" and "pybullet" not in heading
    assert [(row["linkB"], row["nameB"]) for row in rows[:3]] == [
        (1, "torso/ball"), (2, "torso/geom 2"), (3, "leg/foot"),
    ]  # fmt: skip
    Path("robot.xml").write_text("<mujoco><worldbody><geom/></worldbody></mujoco>")
    with pytest.raises(SceneError, match=r"robot.xml cannot be loaded: "):
        load_scene("robot.xml")


@pytest.mark.usefixtures("here")
def test_a_script_that_returns_model_and_data_is_a_scene():
    scene = load_scene("dropped.py", {"height": "0.5"})
    assert scene.parameters == {"height": 0.5, "push": False}
    (frame,) = run(scene, only={40})
    assert frame.time == pytest.approx(0.08) and frame.bodies.keys[0] == (0, 0, 0)
    assert len([*run(load_scene("dropped.py", {"push": "true"}), 2)]) == 2
    assert hold(Path("dropped.py"), Path("moved.html")).word == "new"
    assert hold(Path("dropped.py"), Path("moved.html")).word == "as recorded"
    text = Path("dropped.py").read_text()
    Path("robot.xml").write_text(ROBOT.replace('size=".11"', 'size=".12"'))
    outcome = hold(Path("dropped.py"), Path("moved.html"))
    assert (outcome.word, outcome.causes["geometry"], outcome.causes["shapes"]) == ("moved", "as recorded", "moved")
    Path("dropped.py").write_text(text + "    return 3\n")
    Path("dropped.py").write_text(
        text.replace("return (model, data, steps.append) if push else (model, data)", "return 3")
    )
    with pytest.raises(SceneError, match=r"cannot be built: .*build\(\) must return \(model, data\)"):
        next(run(load_scene("dropped.py")))
    Path("dropped.py").write_text(text.replace("STEPS =", "STEPS, CONTACT =").replace("40\n", '40, "bullet"\n', 1))
    with pytest.raises(SceneError, match="has CONTACT = 'bullet', which must be 'mujoco', 'volumetric' or"):
        load_scene("dropped.py")


@pytest.mark.usefixtures("here")
def test_a_loop_is_logged_and_watched():
    model, data = simulated(ROBOT)
    bodies = Bodies(model, data)
    with Log("own.csv", bodies) as log, overlapper.watch(data, "watched.csv", every=2) as watch:
        for _ in range(10):
            mujoco.mj_step(model, data)
            bodies.update()
            log.add(bodies.overlaps())
        mujoco.mj_step(model, mujoco.MjData(model))  # which nobody watches
        mujoco.mj_step(model, data, nstep=10)
    mujoco.mj_step(model, data)
    assert (watch.steps, watch.measured, watch.time) == (11, 5, pytest.approx(0.04))
    own, watched = (read_table(Path(name)) for name in ("own.csv", "watched.csv"))
    assert [row for row in own if row["step"] in (2, 4, 6, 8, 10)] == watched
    assert type(mujoco.mj_step).__name__ == "builtin_function_or_method"
    with pytest.raises(ValueError, match=r"a simulation of MuJoCo is a mujoco\.MjData, not 0"):
        overlapper.watch(0, engine="mujoco")


@pytest.mark.usefixtures("here")
def test_a_script_is_watched_as_it_is():
    Path("own.py").write_text(
        "import os, sys\nos.environ['MUJOCO_GL'] = 'disabled'\nassert 'mujoco' not in sys.modules\nimport mujoco\n"
        "model = mujoco.MjModel.from_xml_path('robot.xml')\n"
        "for _ in range(2):\n    data = mujoco.MjData(model)\n    for _ in range(3): mujoco.mj_step(model, data)\n"
        "print(float(data.qpos[2]).hex(), 'pybullet' in sys.modules)\n"
    )
    alone = subprocess.run([sys.executable, "own.py"], capture_output=True, text=True)
    command = [sys.executable, "-m", "overlapper", "watch", "--out", "own.csv", "own.py"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, alone.stdout), done.stderr
    assert alone.stdout.endswith(" False\n")
    assert [len({row["step"] for row in read_table(Path(name))}) for name in ("own.csv", "own-2.csv")] == [3, 3]


@pytest.mark.usefixtures("here")
def test_a_run_is_compared_with_mujoco():
    Path("capsule.xml").write_text(CAPSULE_IN_BOX)
    command = [sys.executable, "-m", "overlapper", "run", "capsule.xml", "--steps", "3", "--check", "mujoco"]
    done = subprocess.run([*command, "--out", "own.csv", "--json"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["mujoco"] == {"disagree": 3} and "fcl" not in json.loads(done.stdout)
    rows = read_table(Path("own.csv"))
    assert [(row["mujoco"], row["fcl"]) for row in rows] == [("disagree", None)] * 3
    assert "so ours is nearer." in rows[0]["mujoco_explanation"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert "MuJoCo on 3 pairs that overlap or touch: 3 disagree." in done.stdout
    Path("own.py").write_text(
        "import mujoco\nmodel = mujoco.MjModel.from_xml_path('capsule.xml')\ndata = mujoco.MjData(model)\n"
        "for _ in range(3): mujoco.mj_step(model, data)\n"
    )
    command = [sys.executable, "-m", "overlapper", "watch", "--out", "watched.csv", "--check", "mujoco", "own.py"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0 and "MuJoCo on 3 pairs that overlap or touch: 3 disagree." in done.stderr
    assert read_table(Path("watched.csv")) == rows


def test_work_waits_until_a_library_is_imported(monkeypatch, tmp_path):
    (tmp_path / "waited_for.py").write_text("done = True\n")
    monkeypatch.syspath_prepend(tmp_path)
    finders, heard = list(sys.meta_path), []
    when_imported("waited_for", lambda: heard.append(sys.modules["waited_for"].done))
    assert not heard and len(sys.meta_path) == len(finders) + 1
    import waited_for

    assert heard == [True] and sys.meta_path == finders
    assert waited_for.__spec__.loader is waited_for.__loader__
    when_imported("waited_for", lambda: heard.append("at once"))
    assert heard == [True, "at once"]
    del sys.modules["waited_for"]


def test_the_table_of_pairs_gives_the_overlaps_of_the_rule():
    """The first call asks the rule about each pair, and later calls look the pairs up in a table."""
    geoms = "".join(
        f'<body pos="{0.05 * k} 0 0"><freejoint/><geom type="box" size=".1 .1 .1" contype="{1 + k % 3}" '
        f'conaffinity="{1 + k % 2}"/></body>'
        for k in range(8)
    )
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{geoms}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    bodies = Bodies(model, data)
    by_rule, by_table = bodies.overlaps(), bodies.overlaps()
    assert len(by_rule) == 20 and by_table.keys.tolist() == by_rule.keys.tolist()
    assert by_table.overlaps.examined == by_rule.overlaps.examined == 20
    assert by_table.overlaps.volume.tobytes() == by_rule.overlaps.volume.tobytes()
    model.geom_contype[3] = model.geom_conaffinity[3] = 0
    bodies.update()
    masked = bodies.overlaps(), bodies.overlaps()
    assert [each.keys.tolist() for each in masked] == [masked[0].keys.tolist()] * 2
    assert 0 < len(masked[0]) < 20 and not (masked[1].keys[:, [1, 4]] == 3).any()
