"""The room of a live view: z is up, and the camera turns about the middle of the scene."""

from collections import defaultdict
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
from numpy.testing import assert_allclose

from overlapper.viewer.stage import set_room


def test_the_scene_stands_upright_about_the_point_that_the_camera_turns_about():
    room = defaultdict(Mock)
    at = np.array([1.0, 2.0, 3.0])
    set_room(room, SimpleNamespace(at=at, distance=lambda: 4.0, back=np.array([0.6, 0.0, 0.8])))
    (scene,) = room["/"].set_transform.call_args.args
    # meshcat's y is up, and its z is towards the viewer.
    assert_allclose(scene @ [*at, 1], [0, 0, 0, 1], atol=1e-15)
    for ours, of_meshcat in (((1, 0, 0), (1, 0, 0)), ((0, 0, 1), (0, 1, 0)), ((0, -1, 0), (0, 0, 1))):
        assert_allclose(scene[:3, :3] @ ours, of_meshcat, atol=1e-15)
    lens = dict(call.args for call in room["/Cameras/default/rotated/<object>"].set_property.call_args_list)
    assert_allclose(lens["position"], [2.4, 3.2, 0], atol=1e-15)
