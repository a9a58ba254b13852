"""Every model of pybullet_data and of example-robot-data is modelled as pybullet collides with it."""

import json
import subprocess
import sys
from importlib.metadata import distribution
from pathlib import Path

import pybullet_data
import pytest

WALK = Path(__file__).parents[2] / "support" / "model_walk.py"
SHARES = 6  # of the models, walked side by side where there are cores
PYBULLET_DATA = Path(pybullet_data.getDataPath())
ROBOTS = Path(distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data/robots"))

# Files that pybullet cannot load: they name missing files, have a soft body, or crash pybullet.
NOT_LOADABLE = {
    "kuka_iiwa/kuka_world.sdf",
    "kuka_iiwa/model2.sdf",
    "kuka_iiwa/model_for_sdf.urdf",
    "torus_deform.urdf",
    "toys/concave_box.urdf",
    "cassie_description/robots/cassie.sdf",
    "cassie_description/robots/cassie_reduced.sdf",
    "cassie_description/robots/cassie_simple.sdf",
    "cassie_description/robots/cassie_v2.sdf",
    "cassie_description/robots/cassie_wo_gearbox_spring.sdf",
    "romeo_description/urdf/romeo_laas_small.urdf",
    "ur_description/urdf/ur3.urdf",
}
KILLS_PYBULLET = "gripper/wsg50_one_motor_gripper_free_base.sdf"

# Models with shapes that are skipped, and the reason in the warning.
SKIPPED = {
    "random_urdfs/168/168.urdf": "four points, not 1",
    "samurai.urdf": "concave mesh",
    "alex_description/urdf/alex_nub_hands.urdf": "2 of 4 shapes: vertices are flat",
}


def models():
    """The models by name: paths relative to their collection."""
    found = {
        str(path.relative_to(root)): path
        for root in (PYBULLET_DATA, ROBOTS)
        for path in root.rglob("*")
        if path.suffix in (".urdf", ".sdf")
        or (path.suffix == ".xml" and "<mujoco" in path.read_text(errors="ignore")[:4000])
    }
    return dict(sorted(found.items()))


def walk(paths, results):
    """The findings for each model, from a process that may die. The key None stands for the model that killed it."""
    command = [sys.executable, WALK, results, *paths]
    run = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=600, check=False)
    found = dict(map(json.loads, results.read_text().splitlines()))
    assert run.returncode == 0 or None in found.values(), run.stderr
    return found


@pytest.mark.parametrize("share", range(SHARES))
def test_every_model_is_modelled_as_pybullet_collides_with_it(tmp_path, share):
    everything = models()
    names = [name for name in everything if name != KILLS_PYBULLET][share::SHARES]
    paths = {str(everything[name]): name for name in names}
    found = {paths[path]: result for path, result in walk(paths, tmp_path / "results").items()}
    assert found.keys() == set(names), "the process died of the last model"
    assert {name for name in names if not found[name]["loaded"]} == NOT_LOADABLE & set(names)
    problems = {name: each["problems"] for name, each in found.items() if each["loaded"] and each["problems"]}
    assert problems == {}
    skipped = {name: each["skipped"] for name, each in found.items() if each.get("skipped")}
    assert skipped.keys() == SKIPPED.keys() & set(names)
    for name, each in skipped.items():
        assert all(SKIPPED[name] in reason for _, reason in each)


def test_the_collections_are_all_there():
    names = models()
    assert len(names) > 1190
    assert NOT_LOADABLE | SKIPPED.keys() | {KILLS_PYBULLET} <= names.keys()


def test_a_model_that_crashes_pybullet_is_not_counted_as_modelled(tmp_path):
    """pybullet crashes on this file in loadSDF; that shows here, so that no death goes unnoticed above."""
    path = str(models()[KILLS_PYBULLET])
    assert walk([path], tmp_path / "results") == {path: None}
