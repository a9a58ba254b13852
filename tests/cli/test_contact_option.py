"""--contact: scenes pushed apart by the volumes that their bodies share, and their forces in every answer."""

import json
import re
from pathlib import Path

import pyarrow.parquet
import pytest
from command import overlapper as run

from overlapper.tables.table_file import read_table

CUBE = '''"""A cube on a plane."""
import pybullet as p
STEPS = 30
def build(client, *, mass=1.0):
    p.setGravity(0, 0, -9.81, physicsClientId=client)
    p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE, physicsClientId=client), physicsClientId=client)
    box = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.05] * 3, physicsClientId=client)
    p.createMultiBody(mass, box, -1, [0, 0, 0.05 - 3e-8], physicsClientId=client)
'''

# A ball within a box, and a stiffness that no step follows.
WITHIN = '''"""A ball within a box."""
import pybullet as p
STEPS = 3
CONTACT = "volumetric"
def build(client):
    box = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.5] * 3, physicsClientId=client)
    ball = p.createCollisionShape(p.GEOM_SPHERE, radius=0.01, physicsClientId=client)
    p.createMultiBody(0, box, physicsClientId=client)
    p.createMultiBody(1, ball, -1, [0.2, 0, 0], physicsClientId=client)
'''


@pytest.fixture(autouse=True)
def cube(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("cube.py").write_text(CUBE, encoding="utf-8")


def overlapper(*arguments, code=0):
    done = run(*arguments)
    assert done.returncode == code, done.stderr
    return done


def test_a_run_has_forces_in_its_table_and_in_its_files():
    said = overlapper("run", "cube.py", "--contact", "volumetric", "--out", "cube.csv", "--html", "cube.html").stdout
    assert re.search(r"force *\n.* N *\n", said) and re.search(r" 9\.81 *\n", said)
    assert "Force: the largest between" in " ".join(said.split())
    assert read_table(Path("cube.csv"))[-1]["force_z_n"] == pytest.approx(-9.81)
    assert "\n# contact: volumetric\n" in Path("cube.csv").read_text()
    told = json.loads(overlapper("run", "cube.py", "--contact", "volumetric", "--json").stdout)
    assert told["settings"]["contact"] == "volumetric"
    assert told["pairs"][0]["largest_force_n"] == pytest.approx(9.81)


def test_a_run_of_contact_points_prints_no_forces():
    done = overlapper("run", "cube.py", "--out", "cube.csv")
    assert "orce" not in done.stdout and "force_z_n" not in Path("cube.csv").read_text()
    assert json.loads(overlapper("run", "cube.py", "--json").stdout)["settings"]["contact"] == "bullet"


def test_a_table_is_viewed_with_its_own_contact_model():
    Path("cube.py").write_text(CUBE.replace("- 3e-8", "+ 1e-3"), encoding="utf-8")
    overlapper("run", "cube.py", "--contact", "volumetric", "--out", "cube.csv")
    done = overlapper("view", "cube.csv", "--scene", "cube.py", "--png", "cube.png")
    assert "is not what" not in done.stderr and Path("cube.png").is_file()
    text = Path("cube.csv").read_text()
    Path("cube.csv").write_text(text.replace("# contact: volumetric", "# contact: bullet"), encoding="utf-8")
    done = overlapper("view", "cube.csv", "--scene", "cube.py", "--png", "cube.png")
    assert "the steps shown differ from cube.csv, because the simulation has changed" in done.stderr


def test_a_scene_is_viewed_with_the_requested_contact_model():
    overlapper("view", "cube.py", "--contact", "volumetric", "--png", "cube.png")
    done = overlapper("view", "cube.csv", "--contact", "volumetric", code=2)
    assert (
        done.stderr == "overlapper: --contact is for scenes, but cube.csv is a table, which has its own contact model\n"
    )


def test_a_table_with_an_unknown_contact_model_is_refused():
    overlapper("run", "cube.py", "--out", "cube.csv")
    text = Path("cube.csv").read_text()
    Path("cube.csv").write_text(text.replace("# contact: bullet", "# contact: soft"), encoding="utf-8")
    done = overlapper("view", "cube.csv", "--scene", "cube.py", "--png", "cube.png", code=2)
    assert done.stderr == "overlapper: contact must be 'bullet' or 'volumetric', not 'soft'\n"


def test_forces_of_tables_are_compared():
    soft = CUBE.replace("STEPS = 30", 'STEPS = 30\nCONTACT = {"stiffness": 1e7}').replace("3e-8", "9.81e-5 * mass")
    Path("cube.py").write_text(soft, encoding="utf-8")
    for mass in ("1.0", "1.1"):
        overlapper("run", "cube.py", "--set", f"mass={mass}", "--out", f"{mass}.csv")
    assert "forces    the same\n" in overlapper("diff", "1.0.csv", "1.0.csv").stdout
    said = overlapper("diff", "1.0.csv", "1.1.csv", code=1).stdout
    assert "forces    60 moved\n" in said and "energy_j is " in said
    overlapper("run", "cube.py", "--contact", "bullet", "--out", "points.csv")
    assert "forces" not in overlapper("diff", "points.csv", "1.0.csv", code=1).stdout


def test_a_sweep_keeps_the_largest_force_and_compares_it():
    given = ["sweep", "cube.py", "--contact", "volumetric", "--grid", "mass=1.0,2.0", "--steps-kept", "every 10"]
    overlapper(*given, "--out", "runs")
    tasks = sorted(pyarrow.parquet.read_table("runs/tasks.parquet").to_pylist(), key=lambda row: row["mass"])
    assert [row["largest_force_n"] for row in tasks] == pytest.approx([9.81, 19.62])
    assert [(row["hardestA"], row["hardestB"]) for row in tasks] == [("plane", "box")] * 2
    steps = pyarrow.parquet.read_table("runs/steps.parquet").to_pylist()
    assert [row["force_z_n"] for row in steps if row["mass"] == 2] == pytest.approx([-19.62] * 3)
    page = Path("runs/summary.html").read_text(encoding="utf-8")
    assert "largest force, N" in page and "--contact=volumetric" in page
    assert overlapper(*given, "--out", "again", "--check", "runs").stdout.count("All 2 tasks are as in runs.") == 1
    for part in Path("again/tasks.parquet").glob("*.parquet"):
        row = pyarrow.parquet.read_table(part)
        where = row.schema.get_field_index("largest_force_n")
        pyarrow.parquet.write_table(row.set_column(where, "largest_force_n", [[9.0]]), part)
    said = overlapper(*given, "--out", "runs", "--check", "again", code=1).stdout
    assert "2 of 2 tasks have moved since again: largest_force_n in 2." in said
    # Contact points have no forces, and what both have is compared.
    overlapper(*[each for each in given if each not in ("--contact", "volumetric")], "--out", "points")
    said = json.loads(overlapper(*given, "--out", "runs", "--check", "points", "--json", code=1).stdout)
    assert "largest_force_n" not in said["check"]["measures"] and said["settings"]["contact"] == "volumetric"


def test_a_sweep_in_which_nothing_presses_has_no_force():
    Path("cube.py").write_text(CUBE.replace("0.05 - ", "0.5 - "), encoding="utf-8")
    overlapper("sweep", "cube.py", "--contact", "volumetric", "--steps", "2", "--out", "runs")
    (row,) = pyarrow.parquet.read_table("runs/tasks.parquet").to_pylist()
    assert row["largest_force_n"] == 0 and row["hardestA"] is None


def test_contacts_without_a_direction_are_reported_once():
    Path("within.py").write_text(WITHIN, encoding="utf-8")
    done = overlapper("run", "within.py")
    (line,) = done.stderr.splitlines()
    assert line.startswith("overlapper: box and sphere overlap without a direction of force")
