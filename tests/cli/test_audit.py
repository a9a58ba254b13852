"""`overlapper audit`: pairs of links for people, for programs, for a planner and for CI."""

import json
import sqlite3
import sys
from contextlib import closing
from xml.etree import ElementTree

import pandas
import pyarrow.parquet
import pytest
from command import overlapper
from pages import Film
from robots import joint, limit, link, mimic, turntable, urdf

from overlapper.audit.audit import audit
from overlapper.audit.findings import remarks
from overlapper.audit.page import write_page
from overlapper.audit.robot import not_modelled, read_robot
from overlapper.audit.srdf import read_srdf
from overlapper.audit.table import COLUMNS
from overlapper.cli.audit import audit as command
from overlapper.cli.refusals import Refused
from overlapper.cli.shapes import shapes

COUNT = 300
FIXED = ["--expect", "arm,plate", "--expect", "plate,wa*"]  # what no configuration parts


@pytest.fixture(autouse=True)
def robot(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return turntable(tmp_path / "table.urdf")


def run(*arguments):
    sampled = not {"--verify", "."} & {*arguments}
    done = overlapper("audit", *(["--configurations", COUNT] if sampled else []), *arguments)
    return done.returncode, done.stdout, done.stderr


def test_an_audit_is_written_as_json_table_srdf_and_page(robot, tmp_path):
    code, said, complaints = run(
        robot, "--json", "--out", "pairs.csv", "--srdf", "made/table.srdf", "--html", "worst.html", "--seed", 4
    )
    found = json.loads(said)
    assert (code, complaints) == (1, "")
    assert found["findings"] == [
        f"{names} always overlap, and no joint connects them." for names in ("arm and plate", "wall and plate")
    ]
    assert (found["robot"], found["joints"], found["settings"]["seed"]) == ("made", ["turn"], 4)
    pairs = {(each["nameA"], each["nameB"]): each for each in found["pairs"]}
    wall = pairs["arm", "wall"]
    assert (wall["status"], wall["adjacent"], wall["asked"], len(pairs)) == ("sometimes", 0, COUNT, 10)
    assert (wall["at_rest"], pairs["arm", "plate"]["at_rest"]) == (0, 1)
    assert 0 < wall["fraction_low"] < wall["fraction"] < wall["fraction_high"] < 1
    assert 1.2 < wall["volume_joints"]["turn"] < 1.9 and 0.005 < wall["volume_m3"] < 0.008 and wall["depth_m"] > 0.1
    assert pairs["post", "arm"]["volume_m3"] is None
    # The SRDF file disables adjacent pairs, pairs that never overlap and pairs that always overlap.
    disabled = {
        (each.get("link1"), each.get("link2")): each.get("reason")
        for each in ElementTree.parse("made/table.srdf").getroot()
    }
    assert disabled.keys() == pairs.keys() - {("arm", "wall")}
    assert (disabled["arm", "plate"], disabled["post", "arm"], disabled["disc", "arm"]) == (
        "Always",
        "Never",
        "Adjacent",
    )
    assert read_srdf(tmp_path / "made" / "table.srdf")[frozenset(("arm", "plate"))] == "Always"
    rows = (tmp_path / "pairs.csv").read_text().splitlines()
    assert "# robot: made" in rows and "# configurations: 300" in rows
    assert rows[-11] == ",".join(COLUMNS) and len([row for row in rows if not row.startswith("#")]) == 11
    # The largest volume is the first frame of the page.
    film = Film.of(tmp_path / "worst.html")
    frames = film.heading["names"]
    assert frames[0].startswith("arm and wall, ")
    assert sorted(frames[1:]) == ["arm and plate, 100.00%", "wall and plate"]
    assert wall["page"] == "worst.html#t=0"
    assert pairs["wall", "plate"]["page"] == f"worst.html#t={frames.index('wall and plate')}"


def test_expected_overlaps_are_no_findings_and_the_default_output_is_a_table(robot):
    code, said, complaints = run(robot, *FIXED)
    assert (code, complaints) == (0, "")
    assert "Links that overlap and are not adjacent" in said and "sometimes" in said
    assert said.endswith(
        "Of 10 pairs of 5 links, 4 are adjacent, 3 never overlap, 1 sometimes overlaps, 2 always overlap in 300 "
        "configurations.\n"
    )


def test_an_srdf_file_that_disables_an_overlapping_pair_is_reported(robot, tmp_path):
    pairs = [("arm", "wall", "Never"), ("plate", "arm", "Always"), ("wall", "plate", "Always"), ("arm", "roof", "User")]
    text = "".join(f'<disable_collisions link1="{a}" link2="{b}" reason="{why}"/>' for a, b, why in pairs)
    (tmp_path / "table.srdf").write_text(f'<robot name="made">{text}</robot>')
    code, said, _ = run(robot, "--against", "table.srdf", "--out", "pairs.csv")
    assert code == 1
    assert "The SRDF file names the link 'roof', which the robot does not have.\n" in said
    table = pandas.read_csv("pairs.csv", comment="#").set_index(["nameA", "nameB"])
    met, depth = table.loc[("arm", "wall"), ["overlapping", "depth_m"]]
    assert (
        f"arm and wall never overlap by the SRDF file, but overlap in {met:.0f} of {COUNT} configurations, by up to "
        f"{1e3 * depth:.3g} mm.\n" in said
    )
    assert "no joint connects them" not in said


def test_an_srdf_file_that_exists_keeps_its_groups_comments_and_pairs_of_people(robot, tmp_path):
    (tmp_path / "table.srdf").write_text(
        '<robot name="made"><!-- by hand --><group name="all"><chain base_link="post" tip_link="arm"/></group>'
        '<disable_collisions link1="plate" link2="post" reason="User"/>'
        '<disable_collisions link1="arm" link2="wall" reason="Default"/></robot>'
    )
    code, _, complaints = run(robot, *FIXED, "--srdf", "table.srdf")
    assert (code, complaints) == (0, "")
    text = (tmp_path / "table.srdf").read_text()
    assert "<!-- by hand -->" in text and '<chain base_link="post" tip_link="arm" />' in text
    disabled = read_srdf(tmp_path / "table.srdf")
    assert len(disabled) == text.count("<disable_collisions") == 9
    assert disabled[frozenset(("plate", "post"))] == "User" and disabled[frozenset(("arm", "plate"))] == "Always"
    assert frozenset(("arm", "wall")) not in disabled
    again = text
    run(robot, *FIXED, "--srdf", "table.srdf")
    assert (tmp_path / "table.srdf").read_text() == again


def test_a_pair_that_overlaps_at_rest_but_not_always_is_disabled_by_default(tmp_path):
    robot = turntable(tmp_path / "at_wall.urdf", 0.6, 2.6)  # joints with such limits rest halfway between them
    _, said, complaints = run(robot, *FIXED, "--json", "--srdf", "made.srdf")
    at_rest = {(each["nameA"], each["nameB"]): (each["status"], each["at_rest"]) for each in json.loads(said)["pairs"]}
    assert complaints == "" and at_rest["arm", "wall"] == ("sometimes", 1) and at_rest["post", "arm"] == ("never", 0)
    disabled = read_srdf(tmp_path / "made.srdf")
    assert disabled[frozenset(("arm", "wall"))] == "Default" and disabled[frozenset(("arm", "plate"))] == "Always"
    code, said, _ = run(robot, *FIXED, "--against", "made.srdf")
    assert code == 1 and "arm and wall are disabled by the SRDF file as 'Default', and overlap in " in said


MUST_NAME = "a <disable_collisions> must name link1 and link2, not {'link1': 'arm'}"


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"expect": ["arm"]}, "--expect must be two names with a comma between them, not 'arm'"),
        ({"expect": ["arm,roof"]}, "no link is called 'roof'"),
        ({"out": "pairs.txt"}, "--out must end in .csv, .parquet, .sqlite, not 'pairs.txt'"),
        ({"srdf": "."}, ".: Is a directory"),
        ({"srdf": "sdf.srdf"}, "sdf.srdf is not an SRDF file: its root is <sdf>, not <robot>"),
        ({"srdf": "other.srdf"}, "other.srdf is the SRDF file of robot 'panda', not of 'made'"),
        ({"against": "none.srdf"}, "none.srdf: No such file or directory"),
        ({"against": "table.urdf.txt"}, "table.urdf.txt is not an SRDF file: syntax error: line 1, column 0"),
        ({"against": "sdf.srdf"}, "sdf.srdf is not an SRDF file: its root is <sdf>, not <robot>"),
        ({"against": "half"}, "half is not an SRDF file: " + MUST_NAME),
        ({"robot": "none.urdf"}, "there is no file none.urdf"),
        ({"robot": "table.bullet"}, "the name must end in .urdf, .sdf, .xml, not 'table.bullet'"),
        ({"robot": "bare.urdf"}, "bare.urdf has no two links with shapes that could overlap"),
        ({"robot": "one.urdf"}, "one.urdf has no two links with shapes that could overlap"),
    ],
)  # fmt: skip
def test_invalid_requests_are_refused_in_one_sentence(options, sentence, robot, tmp_path):
    (tmp_path / "table.urdf.txt").write_text("no XML")
    (tmp_path / "sdf.srdf").write_text("<sdf/>")
    (tmp_path / "other.srdf").write_text('<robot name="panda"/>')
    (tmp_path / "half").write_text('<robot><disable_collisions link1="arm"/></robot>')
    urdf(tmp_path / "bare.urdf", link("a"), link("b"), joint("j", "fixed", "a", "b"))
    urdf(tmp_path / "one.urdf", link("a", ("1 1 1", "0 0 0")))
    given = {name: value if name == "expect" else tmp_path / value for name, value in options.items()}
    with pytest.raises(Refused) as refused:
        command(given.pop("robot", robot), configurations=1, **given)
    assert str(refused.value).replace(f"{tmp_path}/", "").replace(str(tmp_path), ".") == sentence


def test_without_pybullet_the_error_names_what_to_install(robot, monkeypatch):
    for library in ("pybullet", "yourdfpy"):
        monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(Refused, match=r"^a URDF file needs yourdfpy: pip install yourdfpy, or pybullet: pip install"):
        command(robot)
    with pytest.raises(Refused, match=r"^overlapper.simulation needs pybullet: pip install pybullet"):
        shapes(robot)


@pytest.mark.parametrize("ending", [".parquet", ".sqlite"])
def test_tables_of_every_kind_have_the_same_columns(ending, robot, tmp_path):
    with pytest.raises(Exception, match="1"):
        command(robot, configurations=20, out=tmp_path / f"pairs{ending}")
    if ending == ".parquet":
        table = pyarrow.parquet.read_table(tmp_path / "pairs.parquet")
        columns, rows = table.schema.names, table.num_rows
    else:
        with closing(sqlite3.connect(tmp_path / "pairs.sqlite")) as base:
            cursor = base.execute("SELECT * FROM overlaps")
            columns, rows = [each[0] for each in cursor.description], len(cursor.fetchall())
    assert (columns, rows) == (list(COLUMNS), 10)


def test_where_nothing_overlaps_a_page_shows_the_robot_at_rest(tmp_path):
    path = urdf(
        tmp_path / "two.urdf",
        link("a", ("1 1 1", "0 0 0")),
        link("b", ("1 1 1", "3 0 0")),
        joint("j", "fixed", "a", "b"),
    )
    write_page(audit(read_robot(path), 5), tmp_path / "page.html")
    assert Film.of(tmp_path / "page.html").heading["names"] == ["at rest; no links overlap"]


def test_unmoved_joints_and_unmodelled_shapes_are_reported(tmp_path):
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n"
    (tmp_path / "flat.obj").write_text(f"o flat\n{corners}f 1 2 3\nf 2 3 4\n")
    flat = link("flat").replace(
        "</link>", '<collision><geometry><mesh filename="flat.obj"/></geometry></collision></link>'
    )
    path = urdf(
        tmp_path / "robot.urdf",
        *(link(name, ("1 1 1", "0 0 0")) for name in "abcd"),
        flat,
        joint("slide", "prismatic", "a", "b", limit(1, -1)),
        joint("table", "planar", "a", "c"),
        joint("turn", "revolute", "a", "d", limit(0, 1)),
        joint("follow", "revolute", "d", "flat", limit(0, 1) + mimic("turn")),
    )
    robot = read_robot(path)
    assert [*not_modelled(robot)] == ["flat"]
    assert remarks(robot) == [
        "The prismatic joint slide stays at rest, because it has no limits.",
        "The planar joint table stays at rest, because planar joints are not moved.",
    ]


def planar_arm(path, size, shoulder, elbow):
    """An arm of two links of 1 m in a plane. The base and the end have boxes of this size."""
    return urdf(
        path / "arm.urdf",
        link("base", (size, "0 0 0")),
        link("upper", ("0.2 0.2 0.2", "0.5 0 0")),
        link("lower", (size, "1 0 0")),
        joint("shoulder", "revolute", "base", "upper", limit(-shoulder, shoulder)),
        joint("elbow", "revolute", "upper", "lower", limit(-elbow, elbow), xyz="1 0 0"),
    )


def test_proofs_are_shown_written_and_verified(tmp_path):
    arm = planar_arm(tmp_path, "0.2 0.2 0.2", shoulder=1, elbow=2)
    code, said, complaints = run(arm, "--prove", "--cover", "proofs.npz", "--srdf", "arm.srdf")
    assert (code, complaints) == (0, "")
    assert "For all joint positions: 1 of 1 pairs that are not adjacent never overlap (proved), 0 overlap" in said
    assert read_srdf(tmp_path / "arm.srdf")[frozenset(("base", "lower"))] == "Never, proved"
    code, said, _ = run(arm, "--verify", "proofs.npz")
    assert (code, said) == (0, "1 of 1 pairs of links in proofs.npz are proved never to overlap.\n")
    code, said, _ = run(arm, "--prove", "--limit", 1, "--json", "--cover", "open.npz")
    found = json.loads(said)
    (row,) = (each for each in found["pairs"] if each["proof"])
    assert (code, row["proof"], row["proof_open"], found["settings"]["limit"]) == (1, "open", 1.0, 1)
    assert found["findings"][0].startswith("Open: base and lower, 100 % of the joint positions")
    assert found["cover"] == "open.npz"
    code, said, _ = run(arm, "--verify", "open.npz")
    assert (code, said.splitlines()[0]) == (1, "Open: base and lower, 100 % of the joint positions.")


def test_a_refused_proof_is_an_exit_code(robot, tmp_path):
    assert run(robot, "--prove", "--cover", "proofs.npz")[0] == 1  # the plate is always in the wall
    other = robot.read_text().replace('xyz="0 0 0.27"', 'xyz="0 0 0.1"')
    robot.write_text(other)
    code, said, _ = run(robot, "--verify", "proofs.npz", "--json")
    pairs = {tuple(each["names"]): each["wrong"] for each in json.loads(said)["pairs"]}
    assert code == 1 and "too small" in pairs["disc", "plate"] and not pairs["post", "arm"]
    code, said, _ = run(robot, "--verify", "proofs.npz")
    assert code == 1 and "Refused: disc and plate, the room along the axis of a box is too small" in said


def test_an_overlap_that_only_the_proof_found_is_said(tmp_path):
    arm = planar_arm(tmp_path, "0.001 0.001 0.001", shoulder=0.1, elbow=4)
    code, said, _ = run(arm, "--prove", "--configurations", 1)
    assert code == 0 and "Overlap that no sample had: base and lower at shoulder " in said


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["table.urdf", "--cover", "proofs.npz"], "--cover needs --prove"),
        (["table.urdf", "--limit", "5"], "--limit needs --prove"),
        (["table.urdf", "--prove", "--cover", "proofs.json"], "--cover must end in .npz, not 'proofs.json'"),
        ([".", "--prove"], "--prove needs a robot, but . is a folder"),
        ([".", "--seed", "3"], "--seed needs a robot, but . is a folder"),
        (["table.urdf", "--units", "mm"], "--units needs a folder, but table.urdf is a robot"),
        (["table.urdf", "--verify", "none.npz", "--seed", "0"], "--seed has no effect with --verify, which"),
        (["table.urdf", "--verify", "none.npz", "--workers", "1"], "--workers has no effect with --verify, which"),
        (["table.urdf", "--verify", "table.urdf"], "table.urdf is not a file of covers"),
        (["table.urdf", "--verify", "none.npz"], "none.npz: No such file or directory"),
        (["none.urdf", "--verify", "none.npz"], "there is no file none.urdf"),
    ],
)
def test_wrong_requests_for_proofs_are_refused(arguments, sentence):
    code, _, complaints = run(*arguments)
    assert code == 2 and sentence in complaints
