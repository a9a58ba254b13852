"""Graded contacts of all 44 classes of pairs keep every rule. `python benchmarks graded` asks many more."""

from dataclasses import replace

import graded
import numpy as np
import pytest

from overlapper import Ellipsoid, HalfSpace, Placed, Sphere, overlap

SEEDS = range(3)
# Proofs of these classes take seconds.
SLOW = ("mesh with margin", "ellipsoid, rounded hull")
# Parts of these, cut by walls, may state errors up to this limit where walls nearly touch the ellipsoid.
PARTS, LIMIT = ("ellipsoid, rounded hull", "ellipsoid, mesh with margin"), 1e-8


@pytest.mark.parametrize("kinds", graded.CLASSES)
def test_contacts_of_a_class_keep_every_rule(kinds):
    proved = not any(name in kinds for name in SLOW)
    for seed in SEEDS:
        contact = graded.made(kinds, seed)
        judged = graded.judge(contact, proved and seed == 0)
        complaints = judged.complaints
        if kinds in PARTS and judged.found.volume_error <= LIMIT * judged.found.volume:
            complaints = [each for each in complaints if not each.startswith("the stated error")]
        assert not complaints, (seed, contact.detail)


def test_all_classes_of_the_page_are_graded():
    assert len(graded.CLASSES) == 44


def test_contacts_are_as_deep_as_they_are_meant_to_be():
    depths = []
    for seed in range(40):
        contact = graded.made("ball, ellipsoid", seed)
        if not contact.detail.startswith(("outside", "parallel", "similar")):
            continue
        found = overlap(contact.a, contact.b)
        smallest = min(graded.size(contact.a), graded.size(contact.b))
        far = np.abs(contact.a.position).max()
        assert found.depth == pytest.approx(contact.depth * smallest, rel=1e-3, abs=1e-15 * (1 + far))
        depths.append(contact.depth)
    assert min(depths) < 1e-8 and max(depths) > 1e-3


def test_a_wrong_answer_is_complained_about():
    a, b = Placed(Ellipsoid([1, 2, 3])), Placed(Sphere(0.5), (1.4, 0, 0))
    found, other = overlap(a, b), overlap(a, Placed(Sphere(0.5), (1.4 + 1e-6, 0, 0)))
    result = graded.Judged(other, 0.0)
    assert any("separates" in each for each in graded.depth_complaints(a, b, other, result))
    assert not [*graded.depth_complaints(a, b, found, replace(result, found=found))]
    assert any(
        "dual hull" in each for each in graded.measure_complaints(a, b, overlap(a, Placed(Sphere(0.45), b.position)))
    )


def test_the_depth_below_a_far_plane_is_taken_exactly():
    plane, ball = Placed(HalfSpace([0, 0, 2], 2e6)), Placed(Sphere(0.5), (0, 0, 1e6 + 0.25))
    deep, way = graded.from_half_space(ball, plane)
    assert float(deep) == 0.25 and list(map(float, way)) == [0, 0, 1]
