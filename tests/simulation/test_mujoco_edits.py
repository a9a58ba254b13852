"""A thousand random models of MuJoCo whose types, sizes, meshes, masks and flags are edited while they run."""

import warnings

import numpy as np
import pytest

from overlapper.simulation.cautions import SkippedShapeWarning

mujoco = pytest.importorskip("mujoco")

from overlapper.mujoco import Bodies  # noqa: E402

GEOM = mujoco.mjtGeom
PRIMITIVES = [int(getattr(GEOM, f"mjGEOM_{name}")) for name in ("SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX")]
MESH = int(GEOM.mjGEOM_MESH)
FLAGS = [int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}")) for name in ("CONTACT", "CONSTRAINT", "FILTERPARENT")]
MESHES = "".join(f'<mesh name="m{k}" vertex="0 0 0 .{3 + k} 0 0 0 .4 0 0 0 .5 .3 .4 .1"/>' for k in range(3))
CLEAR = 2e-5  # m: MuJoCo's distances of round bodies are right to about 1e-5 near 0


def model_of(chance):
    """Some bodies near each other, some of them in chains, and a plane."""
    made = '<geom type="plane" size="0 0 1" pos="0 0 -.4"/>'
    for _ in range(chance.integers(2, 6)):
        at, turn = chance.uniform(-0.4, 0.4, 3), chance.normal(size=4)
        where = f'pos="{at[0]} {at[1]} {at[2]}" quat="{turn[0]} {turn[1]} {turn[2]} {turn[3]}"'
        inner = f'<body pos=".2 0 0"><joint/>{geom(chance)}</body>' if chance.random() < 0.4 else ""
        made += f"<body {where}><freejoint/>{geom(chance)}{geom(chance, '.1 .1 0')}{inner}</body>"
    return mujoco.MjModel.from_xml_string(f"<mujoco><asset>{MESHES}</asset><worldbody>{made}</worldbody></mujoco>")


def geom(chance, at="0 0 0"):
    kind = chance.choice(["sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh"])
    a, b, c = chance.uniform(0.1, 0.3, 3)
    form = f'mesh="m{chance.integers(3)}"' if kind == "mesh" else f'size="{a} {b} {c}"'
    return f'<geom type="{kind}" {form} pos="{at}" mass="1" contype="{chance.integers(1, 4)}" conaffinity="1"/>'


def edit(model, chance):
    """Make some edits. Returns the geoms that have no shape afterwards."""
    moving = np.flatnonzero(model.geom_bodyid > 0)
    for one in chance.choice(moving, min(3, len(moving)), replace=False).tolist():
        is_mesh = model.geom_dataid[one] >= 0 and model.geom_type[one] == MESH
        match chance.choice(["type", "size", "mesh", "mask", "flag", "wrong"]):
            case "type" if not is_mesh:
                model.geom_type[one] = chance.choice(PRIMITIVES)
                model.geom_size[one] = chance.uniform(0.1, 0.3, 3)
            case "size" if not is_mesh:
                model.geom_size[one] = chance.uniform(0.05, 0.4, 3)
            case "mesh" if is_mesh:
                model.geom_dataid[one] = chance.integers(3)
            case "mask":
                model.geom_contype[one], model.geom_conaffinity[one] = chance.integers(4, size=2)
            case "flag":
                model.opt.disableflags ^= int(chance.choice(FLAGS))
            case "wrong" if not is_mesh:
                model.geom_size[one] = chance.choice([0.0, -0.1, np.nan, np.inf])
    wrong = ~((model.geom_size > 0) & np.isfinite(model.geom_size)).all(axis=1)
    masked = (model.geom_contype | model.geom_conaffinity) != 0
    return {geom for geom in moving[(wrong & masked)[moving]].tolist() if model.geom_type[geom] != MESH}


def check(model, data, bodies, left_out):
    """The bodies are those that are read anew, and their overlaps are MuJoCo's."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SkippedShapeWarning)
        anew = Bodies(model, data)
    assert bodies.keys == anew.keys and str(bodies.shapes) == str(anew.shapes)
    assert bodies.link_pairs() == anew.link_pairs()
    skipped = {each.link for each in bodies.skipped}
    assert skipped <= left_out and not skipped & {key[1] for key in bodies.keys}
    for each in bodies.skipped:
        assert each.reason and "\n" not in each.reason
    if left_out:
        return 0  # MuJoCo's contacts of such sizes mean nothing
    # MuJoCo's bounds do not follow the edits.
    model.geom_rbound[model.geom_rbound > 0] = 2
    model.geom_aabb[:] = 0, 0, 0, 2, 2, 2
    mujoco.mj_setConst(model, data)
    model.geom_rbound[model.geom_rbound > 0] = 2
    mujoco.mj_forward(model, data)
    bodies.update()
    found = bodies.overlaps()
    deep = {(each.geomA, each.geomB) for each in found if each.overlap and each.overlap.depth > CLEAR}
    ours = {(each.geomA, each.geomB) for each in found}
    theirs = {tuple(sorted(each.geom.tolist())): each.dist for each in data.contact if each.dist < 0}
    assert deep <= theirs.keys()
    assert {pair for pair, distance in theirs.items() if distance < -CLEAR} <= ours
    return len(deep)


@pytest.mark.parametrize("seeds", [range(k, k + 125) for k in range(0, 1000, 125)])
def test_edited_models_are_read_as_new_models_or_refused_in_one_sentence(seeds):
    met = refused = 0
    for seed in seeds:
        chance = np.random.default_rng(seed)
        model = model_of(chance)
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        bodies = Bodies(model, data)
        met += check(model, data, bodies, set())
        for _ in range(2):
            left_out = edit(model, chance)
            with warnings.catch_warnings(record=True) as told:
                warnings.simplefilter("always")
                bodies.update()
            assert all(each.category is SkippedShapeWarning for each in told)
            met += check(model, data, bodies, left_out)
            refused += len(bodies.skipped)
    assert met > 300 and refused > 10
