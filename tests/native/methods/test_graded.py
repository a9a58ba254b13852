"""Graded contacts of all 44 classes of pairs keep every rule. `python benchmarks graded` asks many more."""

import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import graded
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from overlapper import Ellipsoid, HalfSpace, Placed, RoundedHull, Sphere, overlap

SEEDS = range(2)
# Proofs of these classes take seconds.
SLOW = ("mesh with margin", "ellipsoid, rounded hull")


@pytest.mark.parametrize("kinds", graded.CLASSES)
def test_contacts_of_a_class_keep_every_rule(kinds):
    proved = not any(name in kinds for name in SLOW)
    for seed in SEEDS:
        contact = graded.made(kinds, seed)
        judged = graded.judge(contact, proved and seed == 0)
        assert judged.complaints == (), (seed, contact.detail)


@pytest.mark.parametrize("turn", range(6))
def test_a_slab_of_a_margin_far_from_the_inner_point_states_its_error(turn):
    """Points on a cylinder are off by rounding, which opens gaps along the arcs of a slab that is thin."""
    contact = graded.made("cylinder, mesh with margin", 10420)
    whole = Rotation.random(random_state=turn)
    a, b = (
        Placed(
            body.shape,
            whole.apply(body.position - contact.b.position),
            (whole * Rotation.from_quat(body.orientation)).as_quat(),
        )
        for body in (contact.a, contact.b)
    )
    for third in ((), (HalfSpace([0, 0, 1], 1e3),)):  # groups are sliced
        found = overlap(a, b, *third)
        lower, upper = found.certificate().verify()
        assert lower - Fraction(found.volume_error) <= Fraction(found.volume) <= upper + Fraction(found.volume_error)
        assert found.volume_error <= 1e-12 * found.volume


# Contacts that once stated more than 1e-11 of their volume, by what was too large or too coarse.
MENDED = {
    "cuts through two capsules": ("capsule, capsule", 10428),
    "an edge oblique to a cylinder and nearly along it": ("hull, cylinder", 50288),
    "an edge nearer to a cylinder than its faces are steep": ("hull, cylinder", 61012),
    "an edge between nearly parallel faces": ("hull, cylinder", 10130),
    "an end of a cylinder that rushes across slices": ("cylinder, rounded hull", 52012),
    "parallel cylinders as thin as rounding": ("cylinder, cylinder", 70057),
    "a corner of three surfaces that rushes across slices": ("cylinder, cylinder", 904887),
    "parallel cylinders with round ends as thin as rounding": ("capsule, cylinder", 70325),
    "rounding of two ellipsoids of other sizes": ("ellipsoid, ellipsoid", 70238),
    "tilts of surfaces that leave a sliver": ("cylinder, ellipsoid", 100004),
    "tilts of a flat end and an ellipsoid": ("cylinder, ellipsoid", 50008),
    "a sliver beside its foot": ("cylinder, ellipsoid", 100062),
    "a thin capsule far from the inner point": ("capsule, ellipsoid", 50489),
}


@pytest.mark.parametrize("reason", MENDED)
def test_mended_contacts_state_small_errors(reason):
    contact = graded.made(*MENDED[reason])
    judged = graded.judge(contact, False, only_volume=True)
    assert judged.complaints == () and judged.found.way == "slicing"
    assert judged.found.volume_error <= 1e-12 * judged.found.volume


# Likewise, but a closed form gives the volume, and slices the area.
MENDED_SLICES = {
    "chords that end just beyond a corner": ("ball, rounded hull", 10128),
    "chords of a shallow contact that end just beyond a corner": ("ball, rounded hull", 10249),
    "rounding of many closed forms": ("ball, mesh with margin", 200130),
    "rounding of a small ball beside an ellipsoid": ("ellipsoid, mesh with margin", 10313),
    "parts within the ellipsoid": ("ellipsoid, rounded hull", 10118),
    "many parts within the ellipsoid": ("ellipsoid, mesh with margin", 10184),
    "cuts through two rounded hulls": ("rounded hull, mesh with margin", 10142),
    "what each of many faces may miss": ("ellipsoid, rounded hull", 80070),
    "what each of many faces of a flat rounded hull may miss": ("ellipsoid, rounded hull", 50122),
}


@pytest.mark.parametrize("reason", MENDED_SLICES)
def test_mended_slices_beside_a_closed_form_state_small_errors(reason):
    contact = graded.made(*MENDED_SLICES[reason])
    found = graded.judge(contact, False, only_volume=True).found
    assert found.way == "closed form" and found.volume_error <= 1e-12 * found.volume
    assert found.errors.area <= (1e-10 if "ellipsoid" in MENDED_SLICES[reason][0] else 3e-12) * found.area


def test_a_corner_in_a_far_plane_states_a_small_error():
    """The corner is 7e-12 m deep and 8e5 m away, where doubles are 1e-10 m apart."""
    judged = graded.judge(graded.made("hull, half-space", 80420), True, only_volume=True)
    assert judged.complaints == () and judged.found.volume_error <= 3e-12 * judged.found.volume


@pytest.mark.parametrize(
    ("kinds", "seed"), [("ellipsoid, rounded hull", 10118), ("ellipsoid, mesh with margin", 10237)]
)
def test_a_rounded_hull_within_an_ellipsoid_has_its_own_volume(kinds, seed):
    contact = graded.made(kinds, seed)
    hull = contact.a if isinstance(contact.a.shape, RoundedHull) else contact.b
    found, own = overlap(contact.a, contact.b), overlap(hull, hull)
    assert abs(found.volume - own.volume) <= found.volume_error + own.volume_error <= 1e-11 * own.volume


# Contacts whose halves once were off by more than they state, by what was too small.
HALVES = {
    "places of corners that were cut far outside": ("box, rounded hull", 70135),
    "places of corners in a thin polytope": ("hull, cylinder", 70170),
    "tilt of short edges inside a ball": ("ball, mesh with margin", 10115),
    "tilt of short edges inside a rounded corner": ("rounded hull, mesh with margin", 61351),
}


@pytest.mark.parametrize("reason", HALVES)
def test_halves_state_their_errors(reason):
    contact = graded.made(*HALVES[reason])
    found = overlap(contact.a, contact.b)
    normal = graded.directions(np.random.default_rng(1), 1)[0]
    for side in (1, -1):
        half = overlap(contact.a, contact.b, HalfSpace(side * normal, side * float(normal @ found.centroid)))
        lower, upper = graded.bounds(half)
        volume, error = Fraction(half.volume), Fraction(half.volume_error)
        assert lower - error <= volume <= upper + error and error <= 2e-12 * volume


# Contacts whose volumes once were off by more than 1e-13 of themselves, by terms of a series that fall slowly.
SLOW_TERMS = {
    "a disc that ends just beyond an interval": ("ball, ellipsoid", 341992),
    "circles that nearly touch": ("ellipsoid, ellipsoid", 340475),
    "circles that touch just beyond an interval": ("ellipsoid, ellipsoid", 341360),
}


@pytest.mark.parametrize("reason", SLOW_TERMS)
def test_rules_are_as_accurate_as_their_slowest_terms(reason):
    judged = graded.judge(graded.made(*SLOW_TERMS[reason]), True, only_volume=True)
    assert judged.complaints == () and judged.off < 1e-14


# Contacts whose proved bounds once were too far apart, by what the outline of a slice left out.
OUTLINES = {
    "a short side where a third surface cuts off a corner": ("cylinder, ellipsoid", 10416),
    "a short side of a surface that is cut off from inside": ("capsule, ellipsoid", 120240),
    "a short side of a surface that is cut off obliquely": ("capsule, ellipsoid", 120384),
}


@pytest.mark.parametrize("reason", OUTLINES)
def test_proved_bounds_are_narrow(reason):
    judged = graded.judge(graded.made(*OUTLINES[reason]), True, only_volume=True)
    assert judged.complaints == () and judged.proof_width < 1e-15


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


def test_a_proof_ends_in_time():
    """In the main thread of a process of its own, as in the benchmark."""
    asked = "graded.judge(graded.made('ellipsoid, ellipsoid', 1), True, 1e-3)"
    words = f"import graded; j = {asked}; print(bool(j.found), j.proof_ended, j.off, j.complaints)"
    folder = Path(graded.__file__).parent
    said = subprocess.run([sys.executable, "-c", words], cwd=folder, capture_output=True, text=True, check=True)
    assert said.stdout == "True True None ()\n"


def test_rules_for_volumes_alone_ask_for_no_depth():
    judged = graded.judge(graded.made("ball, cylinder", 1), False, only_volume=True)
    assert judged.found and judged.depth_off is None and judged.halves_off < 1e-12 and not judged.complaints


def test_halves_of_another_contact_do_not_add_up():
    a, b = Placed(Sphere(1)), Placed(Sphere(0.5), (1.4, 0, 0))
    found, other = overlap(a, b), overlap(a, Placed(Sphere(0.5), (1.4 + 1e-9, 0, 0)))
    result = graded.Judged(found, 0.0)
    assert not [*graded.halves_complaints(a, b, found, result)] and result.halves_off < 1e-13
    assert any("halves" in each for each in graded.halves_complaints(a, b, other, result))


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
