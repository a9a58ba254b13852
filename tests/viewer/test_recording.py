"""Recordings are read back from their files."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pages import (
    CUP,
    HAND,
    Film,
    GreenBodies,
    commands,
    drawings,
    enclosed,
    enclosed_by_rings,
    hand_at,
    meshes,
    recorded,
)

from overlapper import Box, Capsule, Cylinder, Hull, Placed, Sphere
from overlapper.viewer import Recording
from overlapper.viewer.look import Look


def test_the_tree_names_bodies_by_body_link_and_shape(tmp_path):
    page = recorded([hand_at(0.19), hand_at(0.12), hand_at(0.3)], tmp_path / "hand.html")
    assert set(drawings(page)) == {"/overlapper/bodies/cup/base/0", "/overlapper/bodies/arm/hand/0"}


def test_the_numbers_are_those_of_each_frame(tmp_path):
    film = Film.of(recorded([hand_at(0.3), hand_at(0.12)], tmp_path / "hand.html"))
    assert film.heading["times"] == [0, 1]
    assert film.sightings(0) == {}
    ((polytope, (volume, error, depth, area, *rest)),) = film.sightings(1).values()
    assert list(film.sightings(1)) == [("cup", "arm/hand")]
    assert polytope == 0
    assert_allclose([volume, depth, area], [0.08 * 0.14 * 0.12, 0.08, 0.0752], rtol=1e-5)
    assert 0 < error < 1e-15
    assert_allclose(rest[:3] + np.array(film.heading["center"]), [0.06, 0.03, 0.04], atol=1e-5)
    assert_allclose(rest[3:], [-1, 0, 0], atol=1e-6)


def test_bodies_are_sent_once_and_have_poses_only_where_they_move(tmp_path):
    page = recorded([hand_at(x) for x in (0.3, 0.3, 0.12, 0.12)], tmp_path / "hand.html")
    sent = [each["path"] for each in commands(page) if each["type"] == "set_object"]
    assert sent.count("/overlapper/bodies/arm/hand/0") == sent.count("/overlapper/bodies/cup/base/0") == 1
    film = Film.of(page)
    frames = {node: [frame for frame, _ in film.poses(node)] for node in film.heading["nodes"]}
    assert frames == {"/overlapper/bodies/arm/hand/0": [0, 2], "/overlapper/bodies/cup/base/0": [0]}


def test_a_shape_that_many_bodies_have_is_kept_once(tmp_path):
    balls = GreenBodies({CUP: Placed(Sphere(0.1)), HAND: Placed(Sphere(0.1), (1, 0, 0))})
    page = recorded([balls], tmp_path / "two.html")
    first, second = (drawing["geometries"] for drawing in drawings(page).values())
    assert [each["uuid"] for each in first] == [each["uuid"] for each in second]
    assert all("data" in each for each in first)
    assert not any("data" in each for each in second)


def test_one_polytope_stands_for_an_overlap_at_rest(tmp_path):
    positions = (0.3, 0.12, 0.12, 0.12 + 1e-5, 0.15, 0.3, 0.15)
    film = Film.of(recorded([hand_at(x) for x in positions], tmp_path / "hand.html"))
    assert [[polytope for polytope, _ in film.sightings(k).values()] for k in range(7)] == [
        [], [0], [0], [0], [1], [], [1],
    ]  # fmt: skip


def test_a_thin_overlap_is_redrawn_after_a_small_change_of_its_thickness(tmp_path):
    def pressed(depth: float) -> GreenBodies:
        plates = Placed(Box([1, 1, 0.1])), Placed(Box([1, 1, 0.1]), (0, 0, 0.2 - depth))
        return GreenBodies({CUP: plates[0], HAND: plates[1]})

    film = Film.of(recorded([pressed(2e-3), pressed(1.9e-3), pressed(1.899e-3)], tmp_path / "plates.html"))
    assert [polytope for k in range(3) for polytope, _ in film.sightings(k).values()] == [0, 1, 1]


def test_a_spinning_overlap_is_drawn_anew_though_its_measures_stay(tmp_path):
    def spun(angle: float) -> GreenBodies:
        turned = Placed(Box([0.1, 0.1, 0.1]), (0, 0, 0.19), (0, 0, np.sin(angle / 2), np.cos(angle / 2)))
        return GreenBodies({CUP: Placed(Box([1, 1, 0.1])), HAND: turned})

    film = Film.of(recorded([spun(angle) for angle in (0, 0.02, 0.0201)], tmp_path / "spin.html"))
    assert [polytope for k in range(3) for polytope, _ in film.sightings(k).values()] == [0, 1, 1]


def test_a_body_that_takes_over_an_id_is_drawn_anew(tmp_path):
    ball = GreenBodies({CUP: Placed(Sphere(0.1)), HAND: Placed(Box([0.1, 0.1, 0.1]), (0.3, 0, 0))})
    page = recorded([hand_at(0.3), ball], tmp_path / "cup.html")
    old, new = "/overlapper/bodies/cup/base/0", "/overlapper/bodies/cup/base/0 from frame 2"
    assert {old, new} <= set(drawings(page))
    film = Film.of(page)
    assert [(frame, bool(pose[3:].any())) for frame, pose in film.poses(old)] == [(0, True), (1, False)]
    assert [(frame, bool(pose[3:].any())) for frame, pose in film.poses(new)] == [(1, True)]


@pytest.mark.parametrize(
    "shape",
    [
        Box([0.1, 0.2, 0.3]),
        Sphere(0.2),
        Capsule(0.1, 0.3),
        Cylinder(0.1, 0.3),
        Hull(np.random.default_rng(7).normal(size=(30, 3))),
    ],
    ids=lambda shape: type(shape).__name__,
)
def test_the_surface_drawn_encloses_the_volume_of_the_shape(shape, tmp_path):
    page = recorded([GreenBodies({CUP: Placed(shape)})], tmp_path / "shape.html")
    surfaces = meshes(drawings(page)["/overlapper/bodies/cup/base/0"])
    assert_allclose(
        enclosed(surfaces), shape.volume, rtol=1e-2 if isinstance(shape, Sphere | Capsule | Cylinder) else 1e-6
    )


def test_the_facets_of_each_owner_close_the_overlap_in_every_frame(tmp_path):
    frames = [hand_at(x) for x in (0.15, 0.14, 0.12)]
    page = recorded(frames, tmp_path / "hand.html")
    film = Film.of(page)
    assert film.arrays["polytope_previous"].tolist() == [-1, 0, 1]
    for k, (bodies, (vertices, facets)) in enumerate(zip(frames, film.polytopes(), strict=True)):
        (contact,) = bodies.contacts()
        assert_allclose(enclosed_by_rings(vertices, facets), contact.overlap.volume, rtol=1e-4)
        first, second = (
            np.concatenate([vertices[ring] for owner, ring in facets if owner == side]) + film.heading["center"]
            for side in (0, 1)
        )
        # The cup ends at 0.1 in x, where its facet is.
        assert_allclose([first[:, 0].max(), second[:, 0].min()], [0.1, (0.05, 0.04, 0.02)[k]], atol=1e-5)


def test_a_round_overlap_of_thousands_of_facets_is_drawn_with_hundreds(tmp_path):
    bodies = GreenBodies({CUP: Placed(Sphere(0.1)), HAND: Placed(Sphere(0.1), (0.05, 0, 0))})
    (contact,) = bodies.contacts()
    ((vertices, facets),) = Film.of(recorded([bodies], tmp_path / "balls.html")).polytopes()
    assert len(contact.overlap.faces) > 2000
    assert len(facets) < 500
    assert_allclose(enclosed_by_rings(vertices, facets), contact.overlap.volume, rtol=0.1)


def test_far_from_the_origin_nothing_is_lost_to_single_precision(tmp_path):
    far = np.array([3e6, -2e6, 1e6])
    boxes = {CUP: Placed(Box([0.1, 0.1, 0.1]), far), HAND: Placed(Box([0.1, 0.1, 0.1]), far + [0.1875, 0, 0])}
    film = Film.of(recorded([GreenBodies(boxes)], tmp_path / "far.html"))
    ((_, hand),) = film.poses("/overlapper/bodies/arm/hand/0")
    ((_, cup),) = film.poses("/overlapper/bodies/cup/base/0")
    assert_allclose((hand - cup)[:3], [0.1875, 0, 0], atol=1e-6)
    ((vertices, _),) = film.polytopes()
    assert_allclose(np.ptp(vertices, axis=0), [0.0125, 0.2, 0.2], atol=1e-5)


@pytest.mark.parametrize(
    ("look", "sentence"),
    [
        ({"opacity": 1.5}, "opacity must lie between 0 and 1, not 1.5"),
        ({"front": "red"}, "front must be a colour like #e69f00, not 'red'"),
    ],
)
def test_a_look_that_cannot_be_drawn_is_refused(look, sentence):
    with pytest.raises(ValueError, match=sentence):
        Look(**look)


def test_frames_must_come_in_the_order_of_time(tmp_path):
    recording = Recording()
    recording.add(hand_at(0.3), [], time=0.5)
    with pytest.raises(ValueError, match="time must increase from frame to frame"):
        recording.add(hand_at(0.2), [], time=0.5)


def test_a_time_that_is_not_a_number_is_refused():
    with pytest.raises(TypeError, match=r"^time must be a number of seconds, not 'first'$"):
        Recording().add(hand_at(0.3), [], "first")


def test_a_recording_without_frames_is_not_saved(tmp_path):
    with pytest.raises(ValueError, match="add at least one frame"):
        Recording().save(tmp_path / "empty.html")
    assert list(tmp_path.iterdir()) == []


def test_an_earlier_page_is_whole_when_a_new_one_cannot_be_written(reach, tmp_path, monkeypatch):
    page = tmp_path / "page.html"
    page.write_text("earlier")

    def full(self, *arguments, **options):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(OSError, match="No space left"):
        recorded([hand_at(0.12)], page)
    assert page.read_text() == "earlier" and list(tmp_path.iterdir()) == [page]
