"""`Log.plot` draws the rows of its table over time; `plot` of contacts and forces draws the bars of one step."""

import re
import subprocess
import sys
from contextlib import suppress

import numpy as np
import pybullet as p
import pytest
from matplotlib import pyplot
from numpy.testing import assert_allclose
from simulated import box

from overlapper import Log
from overlapper.simulation import Bodies, VolumetricContact, link_contacts

ENDINGS = ["csv", "parquet", "sqlite"]


@pytest.fixture(autouse=True)
def closed_figures():
    yield
    pyplot.close("all")


@pytest.fixture
def bodies(client):
    """Two pairs of cubes of 1 m; the cubes of each pair share 0.1 m and 0.2 m in x."""
    for x in (0.0, 0.9, 5.0, 5.8):
        box(client, position=[x, 0, 0])
    return Bodies(client)


def moved(bodies, body, x):
    p.resetBasePositionAndOrientation(body, [x, 0, 0], [0, 0, 0, 1], bodies.physicsClientId)
    bodies.update()


def lines(panel):
    return {line.get_label(): (line.get_xdata().tolist(), line.get_ydata()) for line in panel.lines}


PAIRS = ["box#2 and box#3", "box#0 and box#1"]


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_line_has_the_measures_of_its_pair_and_is_zero_without_contact(bodies, tmp_path, ending):
    with Log(tmp_path / f"own.{ending}", bodies) as log:
        for x, time in ((0.9, 0.1), (2.0, 0.2), (0.95, 0.4)):
            moved(bodies, 1, x)
            log.add(bodies.overlaps(), time=time)
        growing = log.plot()
    for depth, volume in (growing, log.plot()):
        assert (depth.get_ylabel(), volume.get_ylabel()) == ("depth, mm", "volume, cm³")
        assert volume.get_xlabel() == "time, s"
        for panel, factor in ((depth, 1e3), (volume, 1e6)):
            found = lines(panel)
            assert [*found] == PAIRS
            for label, values in zip(PAIRS, ([0.2] * 3, [0.1, 0, 0.05])):
                times, drawn = found[label]
                assert times == [0.1, 0.2, 0.4]
                assert_allclose(drawn, np.multiply(values, factor), rtol=1e-9, atol=1e-9)
        (legend,) = depth.figure.legends
        assert [text.get_text() for text in legend.get_texts()] == PAIRS
        assert depth.figure.get_suptitle() == ""


def test_the_largest_pairs_are_drawn_and_the_number_of_all_is_said(bodies, tmp_path):
    with Log(tmp_path / "own.csv", bodies) as log:
        log.add(bodies.overlaps())
    contacts = bodies.overlaps()
    for depth, volume in (log.plot(most=1), contacts.plot(1), link_contacts(contacts).plot(1)):
        assert depth.figure.get_suptitle() == "the 1 of 2 pairs with the largest volumes"
        drawn = lines(volume)[PAIRS[0]][1][0] if volume.lines else volume.patches[0].get_width()
        assert drawn == pytest.approx(0.2e6)
        assert len(volume.lines or volume.patches) == 1
    for wrong, kind, words in (
        (0, ValueError, "most must be 1 or more, not 0"),
        (1.5, TypeError, "most must be a whole number, not 1.5"),
    ):
        for plot in (log.plot, contacts.plot):
            with pytest.raises(kind, match=f"^{re.escape(words)}$"):
                plot(wrong)


def test_contacts_are_bars_of_their_measures_largest_volume_first(bodies):
    depth, volume = bodies.overlaps().plot()
    assert [text.get_text() for text in depth.get_yticklabels()] == PAIRS
    assert_allclose([bar.get_width() for bar in depth.patches], [200, 100])
    assert_allclose([bar.get_width() for bar in volume.patches], [200000, 100000])
    assert (depth.get_xlabel(), volume.get_xlabel()) == ("depth, mm", "volume, cm³")


def test_charts_without_contacts_say_so(client, tmp_path):
    box(client)
    bodies = Bodies(client)
    with Log(tmp_path / "own.csv", bodies) as log:
        with pytest.raises(ValueError, match=r"^this Log has no steps to draw: add\(\) writes one$"):
            log.plot()
        log.add(bodies.overlaps())
    for axes in (log.plot(), bodies.overlaps().plot()):
        assert axes[0].figure.get_suptitle() == "no contacts"


def test_forces_have_a_panel_and_a_gap_where_no_force_is_known(client, tmp_path):
    p.setGravity(0, 0, -9.8, client)
    ground = p.createCollisionShape(p.GEOM_PLANE, physicsClientId=client)
    p.createMultiBody(0, ground, physicsClientId=client)
    box(client, half=0.05, position=[0, 0, 0.0499])
    bodies = Bodies(client)
    with VolumetricContact(bodies) as contact, Log(tmp_path / "own.csv", bodies, forces=True) as log:
        for _ in range(3):
            contact.step()
            log.add(bodies.overlaps(), forces=contact.mean())
        expected = np.linalg.norm(contact.mean().force[0])
        log.add(bodies.overlaps())
    _, _, force = log.plot()
    ((_, drawn),) = lines(force).values()
    assert force.get_ylabel() == "force, N"
    assert drawn[2] == pytest.approx(expected, rel=1e-12) and expected > 0
    assert np.isnan(drawn[3])
    _, _, bars = contact.mean().plot()
    assert bars.patches[0].get_width() == pytest.approx(expected, rel=1e-12)


def test_pairs_of_equal_names_have_the_numbers_of_their_shapes(client, tmp_path):
    two = p.createCollisionShapeArray(
        shapeTypes=[p.GEOM_BOX] * 2,
        halfExtents=[[0.5] * 3] * 2,
        collisionFramePositions=[[0, 0, 0], [0, 3, 0]],
        physicsClientId=client,
    )
    p.createMultiBody(0, two, physicsClientId=client)
    p.createMultiBody(1, two, basePosition=[0.9, 0, 0], physicsClientId=client)
    bodies = Bodies(client)
    found = {}
    for per in ("shape", "link"):
        with Log(tmp_path / f"{per}.csv", bodies, per=per) as log:
            log.add(bodies.overlaps())
        found[per] = [*lines(log.plot()[0])]
    (plain,) = found["link"]
    a, b = plain.split(" and ")
    assert found["shape"] == [f"{a}[0] and {b}[0]", f"{a}[1] and {b}[1]"]


@pytest.mark.parametrize("ending", ENDINGS)
def test_after_an_error_the_rows_that_are_left_are_drawn(bodies, tmp_path, ending):
    def ended(position):
        moved(bodies, 1, position)
        moved(bodies, 3, 9.0)
        with suppress(ZeroDivisionError), Log(tmp_path / f"own.{ending}", bodies) as log:
            log.add(bodies.overlaps())
            raise ZeroDivisionError
        return log.plot()[0]

    with Log(tmp_path / f"own.{ending}", bodies) as log:
        log.add(bodies.overlaps())
    assert [*lines(ended(0.9))] == PAIRS[1:]
    assert lines(ended(3.0)) == {}  # no row was written, and the table of another run is not drawn


def test_rows_that_cannot_be_put_in_their_place_are_drawn(bodies, tmp_path):
    log = Log(tmp_path / "own.csv", bodies)
    log.add(bodies.overlaps())
    (tmp_path / "own.csv").mkdir()
    with pytest.raises(OSError, match=r"own\.csv"):
        log.close()
    assert [*lines(log.plot()[0])] == PAIRS


def test_a_table_that_was_removed_is_named(bodies, tmp_path):
    with Log(tmp_path / "own.csv", bodies) as log:
        log.add(bodies.overlaps())
    (tmp_path / "own.csv").unlink()
    with pytest.raises(FileNotFoundError, match=r"own\.csv"):
        log.plot()


def test_without_matplotlib_a_plot_says_how_to_install_it(bodies, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ImportError, match=r"^a plot needs matplotlib: pip install matplotlib$"):
        bodies.overlaps().plot()


def test_a_script_without_a_display_saves_a_chart_and_only_a_plot_imports_matplotlib(tmp_path, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "MPLBACKEND"):
        monkeypatch.delenv(name, raising=False)
    program = """
import sys
import pybullet as p
from overlapper import Log
from overlapper.simulation import Bodies
client = p.connect(p.DIRECT)
cube = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.5] * 3)
for x in (0, 0.9):
    p.createMultiBody(1, cube, basePosition=[x, 0, 0])
bodies = Bodies(client)
with Log("run.csv", bodies) as log:
    log.add(bodies.overlaps())
assert not any("matplotlib" in name for name in sys.modules)
log.plot()[0].figure.savefig("run.png")
"""
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "run.png").read_bytes().startswith(b"\x89PNG")
