"""Robots of MJCF files, as MuJoCo's own compiler reads them."""

import json
import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pytest

from overlapper.audit.audit import audit
from overlapper.audit.findings import remarks
from overlapper.audit.kinematics import Kinematics
from overlapper.audit.robot import not_modelled, read_robot
from overlapper.audit.sampling import Sampling
from overlapper.simulation.bullet.model_file import NotRead
from overlapper.simulation.settings import Modelling

mujoco = pytest.importorskip("mujoco")

ARM = """
<mujoco model="arm">
  {}
  <worldbody>
    <geom name="post" type="box" size=".1 .1 .1"/>
    <body name="upper" pos="0 0 .3">
      <joint name="shoulder" axis="0 1 0" range="-20 20"/>
      <geom type="capsule" fromto="0 0 0 0 0 .4" size=".05"/>
      <body name="lower" pos="0 0 .5">
        <joint name="elbow" axis="0 1 0" range="{}"/>
        <geom type="capsule" fromto="0 0 0 0 0 .7" size=".05"/>
      </body>
    </body>
  </worldbody>
  {}
</mujoco>
"""


def arm(path, elbow="-90 90", compiler="", rest=""):
    path.write_text(ARM.format(compiler, elbow, rest))
    return path


def tree(seed):
    """A random tree with hinges, slides and balls beside the origins of their bodies, and references that are not 0."""
    rng = np.random.default_rng(seed)

    def numbers(n, scale=1.0):
        return " ".join(f"{each:.4f}" for each in scale * rng.normal(size=n))

    def joint():
        kind = rng.choice(["hinge", "slide"])
        return f'<joint type="{kind}" axis="{numbers(3)}" pos="{numbers(3, 0.2)}" ref="{rng.uniform(-1, 1):.3f}"/>'

    def body(depth):
        joints = "".join(joint() for _ in range(rng.integers(3)))
        if rng.random() < 0.2:
            joints = f'<joint type="ball" limited="false" pos="{numbers(3, 0.2)}"/>'
        shape = f'<geom type="box" size=".1 .2 .3" pos="{numbers(3, 0.2)}" quat="{numbers(4)}"/>'
        inside = "".join(body(depth + 1) for _ in range(rng.integers(3) if depth < 3 else 0))
        return f'<body pos="{numbers(3, 0.5)}" quat="{numbers(4)}">{joints}{shape}{inside}</body>'

    limits = '<compiler angle="radian"/><default><joint range="-1 1" limited="true"/></default>'
    return f"<mujoco>{limits}<worldbody>{body(0)}{body(0)}</worldbody></mujoco>"


@pytest.mark.parametrize("seed", range(20))
def test_shapes_are_where_mj_kinematics_puts_them(seed, tmp_path):
    path = tmp_path / "tree.xml"
    path.write_text(tree(seed))
    robot = read_robot(path)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    kinematics, sampling = Kinematics(robot), Sampling(robot, 700, 1)
    address = {model.joint(j).name or f"joint {j}": int(model.jnt_qposadr[j]) for j in range(model.njnt)}
    assert sorted(degree.name for degree in robot.degrees) == sorted(address)
    for number in (0, 1, 698, 699):
        values = sampling.configuration(number)
        for degree in robot.degrees:
            at, column = address[degree.name], degree.column
            if degree.range == "spherical":
                data.qpos[at : at + 4] = values[[column + 3, column, column + 1, column + 2]]
            else:
                assert (degree.lower, degree.upper) == (-1, 1)
                data.qpos[at] = values[column]
        mujoco.mj_kinematics(model, data)
        (positions,), (orientations,) = kinematics.poses(values[None])
        assert np.abs(positions - data.geom_xpos).max() < 1e-12
        dots = (orientations * data.geom_xquat[:, [1, 2, 3, 0]]).sum(axis=1)
        assert np.abs(np.abs(dots) - 1).max() < 1e-12


def test_limits_are_in_degrees_and_automatic_as_in_mujoco(tmp_path):
    robot = read_robot(arm(tmp_path / "arm.xml"))
    assert robot.name == "arm" and robot.link_names == ("world", "upper", "lower")
    elbow = next(degree for degree in robot.degrees if degree.name == "elbow")
    assert (elbow.lower, elbow.upper) == pytest.approx((-np.pi / 2, np.pi / 2))
    met = {each.names: each.status for each in audit(robot, 2000).pairs}
    assert met[("world", "lower")] == "never"
    # With radians, as pybullet's importer has them, the lower arm would turn around often.
    far = read_robot(arm(tmp_path / "far.xml", elbow="-3 3", compiler='<compiler angle="radian"/>'))
    assert {each.names: each.status for each in audit(far, 2000).pairs}[("world", "lower")] == "sometimes"
    free = read_robot(arm(tmp_path / "free.xml", elbow='0 1" limited="false'))
    assert {degree.name: degree.range for degree in free.degrees}["elbow"] == "endless"


def test_an_equality_of_joints_is_a_mimic_and_others_are_remarked_upon(tmp_path):
    tie = '<equality><joint joint1="elbow" joint2="shoulder" polycoef=".1 2 0 0 0"/></equality>'
    robot = read_robot(arm(tmp_path / "arm.xml", rest=tie))
    assert robot.columns == ("shoulder",) and remarks(robot) == []
    mimic = robot.mimics["elbow"]
    assert (mimic.leader, mimic.multiplier, mimic.offset) == ("shoulder", 2, pytest.approx(0.1))
    bent = read_robot(arm(tmp_path / "bent.xml", rest=tie.replace("2 0 0 0", "2 1 0 0")))
    weld = '<equality><weld body1="lower"/><joint joint1="elbow"/></equality>'
    welded = read_robot(arm(tmp_path / "welded.xml", rest=weld))
    assert remarks(bent) == ["An <equality> of kind joint is not read: what it couples moves freely."]
    assert remarks(welded) == [
        f"An <equality> of kind {kind} is not read: what it couples moves freely." for kind in ("weld", "joint")
    ]
    loop = tie.replace("</equality>", '<joint joint1="shoulder" joint2="elbow"/></equality>')
    with pytest.raises(NotRead, match="mimics itself"):
        read_robot(arm(tmp_path / "loop.xml", rest=loop))


def test_free_bodies_are_trees_of_their_own(tmp_path):
    path = tmp_path / "two.xml"
    ball = '<geom size=".1"/><body name="{}"><joint type="ball" range="0 30"/><geom size=".1" pos=".15 0 0"/></body>'
    path.write_text(
        f"<mujoco><worldbody><body name='a'><freejoint/>{ball.format('b')}</body>"
        f"<body name='c' pos='0 0 .05'><freejoint/>{ball.format('d')}</body></worldbody></mujoco>"
    )
    robot = read_robot(path)
    assert robot.tree.bodies == ("world", "a", "c") and robot.link_names[1:] == ("a/a", "a/b", "c/c", "c/d")
    assert [each.names for each in audit(robot, 10).pairs] == [("a/a", "a/b"), ("c/c", "c/d")]
    assert remarks(robot) == [f"The limit of the ball joint joint {j} is not read: it turns freely." for j in (1, 3)]


def test_what_cannot_be_read_or_modelled_is_told(tmp_path):
    for text, words in [
        ("<mujoco><worldbody/></mujoco>", "it has no body"),
        ("<mujoco><worldbody><geom/></worldbody></mujoco>", "MuJoCo says 'Error: size 0 must be positive in geom"),
        ("nonsense", "MuJoCo says 'XML parse error"),
        ("<mujoco><asset><mesh file='none.stl'/></asset></mujoco>", "MuJoCo says .*none.stl"),
    ]:
        path = tmp_path / "bad.xml"
        path.write_text(text)
        with pytest.raises(NotRead, match=f"bad.xml cannot be read: {words}"):
            read_robot(path)
    with pytest.raises(NotRead, match=r"there is no file .*none\.xml"):
        read_robot(tmp_path / "none.xml")
    with pytest.raises(NotRead, match="is read by MuJoCo, which has only the surface 'nominal'"):
        read_robot(arm(tmp_path / "arm.xml"), Modelling(surface="margin"))
    hills = '<asset><hfield name="h" nrow="2" ncol="2" size="1 1 1 1"/></asset>'
    upper = '<body name="upper"'
    path.write_text(ARM.format(hills, "0 1", "").replace(upper, f'<geom type="hfield" hfield="h"/>{upper}'))
    assert not_modelled(read_robot(path)) == {"world": "1 of 2 shapes: height fields are not modelled"}


def test_the_command_reads_a_model_and_writes_excludes(tmp_path):
    path, never = arm(tmp_path / "arm.xml"), tmp_path / "never.xml"
    command = [sys.executable, "-m", "overlapper", "audit", str(path), "--configurations", "500", "--json"]
    done = subprocess.run([*command, "--exclude", str(never)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["robot"] == "arm" and told["exclude"] == str(never)
    excludes = {tuple(each.attrib.values()) for each in ElementTree.parse(never).iter("exclude")}
    assert excludes == {("world", "upper"), ("world", "lower"), ("upper", "lower")}
    whole = path.read_text().replace("</worldbody>", '</worldbody><include file="never.xml"/>')
    path.write_text(whole)
    assert mujoco.MjModel.from_xml_path(str(path)).nexclude == 3
