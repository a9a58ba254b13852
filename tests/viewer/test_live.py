"""A live view shows the last step, where it is asked to be, and ends with its server."""

from __future__ import annotations

import base64
import re
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
import umsgpack
from pages import CUP, HAND, GreenBodies, hand_at

from overlapper import Placed, Sphere
from overlapper.viewer import Viewer
from overlapper.viewer.framing import Framing
from overlapper.viewer.look import BODIES, OVERLAPS, Look, owner_color, to_draw
from overlapper.viewer.stage import Stage, rgb


def test_a_live_view_is_served_at_the_requested_address():
    def listening(port):
        """The addresses at which this machine answers on a port, as the kernel lists them."""
        lines = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
        return {at.partition(":")[0] for _, at, _, state, *_ in lines if state == "0A" and at.endswith(f":{port:04X}")}

    for host, address in (("127.0.0.1", "0100007F"), ("0.0.0.0", "00000000")):
        with Viewer(host=host) as viewer:
            assert re.fullmatch(r"http://127\.0\.0\.1:\d+/static/", viewer.url)
            assert listening(int(viewer.url.split(":")[2].split("/")[0])) == {address}
            assert listening(int(viewer.visualizer.window.zmq_url.split(":")[2])) == {"0100007F"}
    with pytest.raises(
        ValueError, match=r"^host must be an address of this machine, not '192\.0\.2\.1': Cannot assign"
    ):
        Viewer(host="192.0.2.1")


def live_paths(viewer: Viewer, command: str = "set_object") -> set[str]:
    """The paths to which the server of a live view applies a command."""
    messages = [
        base64.b64decode(each)
        for each in re.findall(r'fetch\(.data:[a-z/-]*;base64,([^"]+)"', viewer.visualizer.static_html())
    ]
    return {each["path"] for each in map(umsgpack.unpackb, messages) if each["type"] == command}


def test_a_live_view_shows_the_last_step_and_ends_with_its_server():
    for _ in range(2):
        with Viewer() as viewer:
            server = viewer._server.process
            bodies = hand_at(0.12)
            viewer.show(bodies, bodies.contacts())
            arm, cup = "/overlapper/bodies/arm/hand/0", "/overlapper/bodies/cup/base/0"
            assert live_paths(viewer) == {arm, cup, "/overlapper/overlaps/cup-arm∕hand/1.34 dm³"}
            viewer.show(GreenBodies({CUP: Placed(Sphere(0.1))}), [])
            assert live_paths(viewer) == {cup}
        assert server.returncode is not None


def test_a_live_view_draws_every_facet_once_in_the_colour_of_its_owner():
    bodies = hand_at(0.12)
    (contact,) = bodies.contacts()
    drawn = Stage(Framing(bodies), BODIES, OVERLAPS).overlap(contact.overlap).lower()
    materials = {each["uuid"]: each for each in drawn["materials"]}
    triangles = {each["uuid"]: len(each["data"]["index"]["array"].data) // 12 for each in drawn["geometries"][:2]}
    solid = [each for each in drawn["object"]["children"] if each["geometry"] in triangles]
    assert [materials[each["material"]]["color"] for each in solid] == [rgb(0.7 * owner_color(k)) for k in (0, 1)]
    facets = to_draw(contact.overlap, Framing(bodies).size)
    sizes = [[len(ring) - 2 for ring, k in zip(facets.facets, facets.owner) if k == owner] for owner in (0, 1)]
    assert [triangles[each["geometry"]] for each in solid] == [sum(each) for each in sizes]


@dataclass
class Push:
    """A force of 30 N on the cup from the hand beside it. A part of the force is friction."""

    pairs = np.array([[*CUP, *HAND]])
    force = np.array([[-30.0, 0.0, 3.0]])
    torque = slip = np.zeros((1, 3))
    energy = np.zeros(1)
    normal = np.array([[-1.0, 0.0, 0.0]])
    stiffness: np.ndarray = field(default_factory=lambda: np.array([1e5]))
    hardening = np.zeros(1)


def test_a_live_view_has_an_arrow_and_tells_its_scale_until_forces_are_gone():
    with Viewer() as viewer:
        bodies = hand_at(0.12)
        viewer.show(bodies, bodies.contacts(), Push())
        overlap = "/overlapper/overlaps/cup-arm∕hand/1.34 dm³"
        (arrow,) = {each for each in live_paths(viewer) if "forces" in each}
        assert arrow == "/overlapper/forces/1 cm = 5 N, 8 kPa/cup-arm∕hand/30.1 N"
        # A scale stays until arrows or colours have outgrown it.
        viewer.show(bodies, bodies.contacts(), Push(np.array([0.9e5])))
        assert arrow in live_paths(viewer)
        viewer.show(bodies, bodies.contacts(), Push(np.array([5e5])))
        assert "/overlapper/forces/1 cm = 5 N, 40 kPa/cup-arm∕hand/30.1 N" in live_paths(viewer)
        viewer.show(bodies, bodies.contacts())
        assert live_paths(viewer) == {"/overlapper/bodies/arm/hand/0", "/overlapper/bodies/cup/base/0", overlap}


def test_a_live_view_without_forces_among_its_looks_has_none():
    with Viewer(overlaps=Look(forces=False)) as viewer:
        bodies = hand_at(0.12)
        viewer.show(bodies, bodies.contacts(), Push())
        assert not any("forces" in each for each in live_paths(viewer))


def test_a_visualizer_passed_in_keeps_its_camera_and_its_server():
    with Viewer() as owner:
        empty = owner.visualizer.static_html()
        with Viewer(owner.visualizer) as guest:
            guest.show(hand_at(0.12), [])
        assert owner._server.alive()
        assert owner.visualizer.static_html() != empty
        assert not live_paths(owner, "set_property")
        owner.show(hand_at(0.12), [])
        assert "/Cameras/default/rotated/<object>" in live_paths(owner, "set_property")


def test_without_meshcat_one_sentence_says_what_to_install():
    program = "import sys; sys.modules['meshcat'] = None; from overlapper.viewer import Viewer"
    failed = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert failed.stderr.splitlines()[-1] == "ImportError: overlapper.viewer needs meshcat: pip install meshcat"
