"""Display in a notebook: an overlap is a picture that turns, contacts are a table, a recording is its page."""

import base64
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from itertools import product

import nbclient
import nbformat
import numpy as np
import pybullet as p
import pytest
from scipy.spatial import ConvexHull

from overlapper import Box, Capsule, HalfSpace, Hull, Placed, Sphere, overlap
from overlapper.simulation import Bodies, link_contacts
from overlapper.viewer import Recording
from overlapper.viewer.look import INK, hexadecimal
from overlapper.viewer.turning import turning

SVG = "{http://www.w3.org/2000/svg}"
BOX = Placed(Box((0.5, 0.5, 0.5)))
TURNED = Placed(Box((0.4, 0.4, 0.4)), (0.6, 0.5, 0.3), (0.2, 0.3, 0.1, 0.9))


def numbers(text):
    return np.array([[float(x) for x in pair.split(",")] for pair in text.split()])


def area(ring):
    x, y = ring.T
    return abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def drawn(found):
    """The polygons of a picture: attributes, corners at every step, and whether each is seen at each."""
    for polygon in ET.fromstring(turning(found)).iter(f"{SVG}polygon"):
        moving = {each.get("attributeName"): each.get("values").split(";") for each in polygon}
        yield polygon.attrib, [numbers(each) for each in moving["points"]], moving.get("visibility")


@pytest.mark.parametrize(
    "pair",
    [
        (BOX, TURNED),
        (Placed(Hull(np.random.default_rng(1).normal(size=(30, 3)))), BOX),
        (Placed(Sphere(0.5)), Placed(HalfSpace((0, 0, 1), 0), (0, 0, -0.4))),
        (BOX, TURNED, Placed(Capsule(0.5, 1.0))),
    ],
)
def test_visible_facets_cover_the_overlap_at_every_step(pair):
    found = overlap(*pair)
    facets = [(rings, seen) for _, rings, seen in drawn(found) if seen]
    for step in range(25):
        seen = sum(area(rings[step]) for rings, visible in facets if visible[step] == "visible")
        corners = np.concatenate([rings[step] for rings, _ in facets])
        assert seen == pytest.approx(ConvexHull(corners).volume, rel=0.01)


def test_a_full_turn_ends_where_it_began_and_bodies_contain_their_overlap():
    bodies = [rings for attributes, rings, seen in drawn(overlap(BOX, TURNED)) if "fill-opacity" in attributes]
    assert len(bodies) == 2
    for _, rings, seen in drawn(overlap(BOX, TURNED)):
        assert (rings[0] == rings[-1]).all()
        for body, step in product(bodies, range(25)) if seen else ():
            both = ConvexHull(np.concatenate([body[step], rings[step]])).volume
            assert both <= 1.01 * ConvexHull(body[step]).volume


def test_separated_bodies_are_drawn_with_the_line_between_them():
    picture = turning(overlap(BOX, Placed(Sphere(0.3), (1.2, 0, 0.3))))
    assert f'<path fill="none" stroke="{hexadecimal(INK)}"' in picture and "visibility" not in picture


def test_an_overlap_is_a_picture_and_numbers():
    shown = overlap(BOX, Placed(Box((0.5, 0.5, 0.5)), (0.98, 0, 0)))._repr_html_()
    text = re.sub("<[^>]*>", " ", shown)
    for words in ("overlapping", "20 dm³ ±", "0.49, 0, 0 m", "20 mm ±", "-1, 0, 0"):
        assert words in text
    assert 'alt="Box and Box, overlapping"' in shown
    ET.fromstring(base64.b64decode(re.search(r"base64,([^\"]*)", shown)[1]))
    apart = overlap(BOX, Placed(Sphere(0.3), (1.2, 0, 0)))._repr_html_()
    assert re.search(r"distance.*400 mm ±", apart) and "volume" not in apart


def test_an_overlap_is_shown_without_the_libraries_of_the_viewer():
    code = (
        "import sys; sys.modules |= dict.fromkeys(['meshcat', 'matplotlib', 'PIL'])\n"
        "from overlapper import *; print(len(overlap(Placed(Sphere(1)), Placed(Sphere(1), (1, 0, 0)))._repr_html_()))"
    )
    assert int(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout) > 10_000


def test_contacts_are_a_table_of_their_first_rows(client):
    shape = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.5] * 3, physicsClientId=client)
    for k in range(30):
        p.createMultiBody(1, shape, -1, [0.9 * k, 0, 0], physicsClientId=client)
    bodies = Bodies(client, names={0: "<b>crate</b>"})
    contacts = bodies.overlaps()
    for shown in (contacts._repr_html_(), link_contacts(contacts)._repr_html_()):
        assert shown.count("<tr>") == 21 and "<p>9 more</p>" in shown and ", 29</p>" in shown
        assert "&lt;b&gt;crate&lt;/b&gt;" in shown and "<b>" not in shown
        assert "<th>volume_m3</th>" in shown and "<td>0.1</td>" in shown
    assert "more" not in contacts[:3]._repr_html_() and contacts[:0]._repr_html_().count("<tr>") == 1


NOTEBOOK = """
import pybullet, overlapper
from overlapper.simulation import Bodies
from overlapper.viewer import Recording
client = pybullet.connect(pybullet.DIRECT)
box = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[0.5] * 3)
for x in (0, 0.9): _ = pybullet.createMultiBody(1, box, -1, [x, 0, 0])
bodies = Bodies(client)
contacts = bodies.overlaps()
contacts
---
contacts[0].overlap
---
recording = Recording()
recording.add(bodies, contacts, 0.0)
recording
---
with overlapper.watch(client) as watch: pybullet.stepSimulation()
print(watch.summary.largest()[0].names)
---
with overlapper.Log("run.csv", bodies) as log: log.add(contacts)
axes = log.plot()
---
contacts.plot()
"""


def test_a_notebook_shows_them_all(tmp_path):
    cells = [nbformat.v4.new_code_cell(code.strip()) for code in NOTEBOOK.split("---")]
    notebook = nbformat.v4.new_notebook(cells=cells)
    nbclient.NotebookClient(notebook, timeout=120, resources={"metadata": {"path": str(tmp_path)}}).execute()
    table, picture, page = (cell.outputs[-1].data["text/html"] for cell in notebook.cells[:3])
    assert "<table>" in table and "data:image/svg+xml" in picture and page.startswith("<iframe srcdoc=")
    assert "box#0" in notebook.cells[3].outputs[-1].text
    for cell in notebook.cells[4:]:
        assert sum("image/png" in output.get("data", {}) for output in cell.outputs) == 1


def test_a_recording_without_a_frame_is_a_line():
    assert Recording()._repr_html_() == "Recording(0 frames, 0 pairs)"
