"""Altered pickles are refused in one sentence, arrays may change while they are worked on, and indices do not wrap."""

import pickle
import threading

import numpy as np
import pytest
from strategies import hull_points

from overlapper import (
    Batch,
    Box,
    HalfSpace,
    Hull,
    Overlap,
    Overlaps,
    Placed,
    RoundedHull,
    Sphere,
    TimeOfImpact,
    _core,
    overlap,
    overlaps,
    time_of_impact,
)

POSES = np.zeros((2, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (2, 1))
CUBE = [[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]
FIELDS = ("origin", "vertices", "planes", "ring", "ring_start", "corners", "triangles", "facet_corners")


def changes_of(values):
    """The array with one of its numbers changed, or with numbers too few or too many."""
    first, last = (0,) * values.ndim, (-1,) * values.ndim
    wrong = (10**6, -5, 2**31 - 1, values[first] + 1) if values.dtype.kind == "i" else (np.nan, np.inf, 1e300, 0.125)
    for place in (first, last):
        for value in wrong:
            changed = values.copy()
            changed[place] = value
            if not np.array_equal(changed, values):
                yield changed
    for changed in (values[:-1], np.concatenate([values, values[-1:]]), values[::-1], values[:0], 2 * values):
        if not np.array_equal(changed, values):
            yield changed.copy()


@pytest.mark.parametrize("points", [CUBE, hull_points(np.random.default_rng(0), 12), np.add(CUBE, 1e6)])
def test_every_altered_state_of_a_hull_is_refused(points):
    state = Hull(points).__getstate__()
    for number, field in enumerate(FIELDS):
        if field == "origin" and state[number].any():
            continue  # the same hull elsewhere is a hull
        for changed in [*changes_of(state[number]), None, "text"]:
            altered = (*state[:number], changed, *state[number + 1 :])
            for blank, whole in ((Hull.__new__(Hull), altered), (RoundedHull.__new__(RoundedHull), (altered, 0.1))):
                with pytest.raises(ValueError, match=r"^[^\n]+$"):
                    blank.__setstate__(whole)


@pytest.mark.parametrize("triangles", ["turned round", "twice", "less one", "with a crease"])
def test_a_surface_that_is_no_hull_is_refused(triangles):
    state = list(Hull(hull_points(np.random.default_rng(1), 12)).__getstate__())
    flat = state[6].reshape(-1, 3)
    if triangles == "with a crease":
        state[5] = state[5].copy()
        state[5][0] *= 0.1
    else:
        changed = {"turned round": flat[:, ::-1], "twice": np.vstack([flat, flat]), "less one": flat[1:]}
        state[6] = changed[triangles].ravel()
    with pytest.raises(ValueError, match="state must be that of a hull"):
        Hull.__new__(Hull).__setstate__(tuple(state))


@pytest.mark.parametrize("state", [(), ((), 0.1), (None, 0.1), 3])
def test_a_state_of_another_kind_is_refused(state):
    for kind in (Hull, RoundedHull, Overlap, Overlaps, Batch, TimeOfImpact):
        with pytest.raises(ValueError, match="state must be that of"):
            kind.__new__(kind).__setstate__(state)


def test_an_altered_state_of_a_rounded_hull_or_an_overlap_is_refused():
    core = Hull(CUBE).__getstate__()
    for radius in (-1.0, float("nan"), "wide"):
        with pytest.raises(ValueError, match="radius must be"):
            RoundedHull.__new__(RoundedHull).__setstate__((core, radius))
    bodies = (Placed(Sphere(1)), Placed(Sphere(1)))
    bare = (Sphere(1), Sphere(1))
    for state in ((bare, 0.1, "auto"), (bodies, 2.0, "auto"), (bodies, 0.1, "car"), (bodies[:1], 0.1, "auto")):
        with pytest.raises(ValueError, match=r"^[^\n]+$"):
            Overlap.__new__(Overlap).__setstate__(state)


@pytest.mark.parametrize(("number", "value"), [(0, "late"), (0, 3), (1, "soon"), (5, (0, 1)), (6, None), (7, 0.5)])
def test_an_altered_state_of_a_time_of_impact_is_refused(number, value):
    state = [*time_of_impact(Sphere(1), Placed(Sphere(1), (3, 0, 0)), ((2, 0, 0), (0, 0, 0))).__getstate__()]
    state[number] = value
    with pytest.raises(ValueError, match=r"^state must be [^\n]+$"):
        TimeOfImpact.__new__(TimeOfImpact).__setstate__(tuple(state))


def some_overlaps(**options):
    shapes = [Box([1, 1, 1]), Sphere(1.0), RoundedHull(CUBE, 0.1), HalfSpace([0, 0, 1], 0)]
    places = [[0, 0, 0], [0.5, 0, 0], [5, 0, 0], [0, 0, 0]]
    return Batch(shapes).overlaps(places, [[0, 0, 0, 1], [0, 0, 0, 2], [0.5, 1, 0, 0], [0, 0, 0, 1]], **options)


@pytest.mark.parametrize("options", [{}, {"pairs": [[2, 0], [0, 1], [0, 2]]}, {"pairs": np.empty((0, 2), int)}])
def test_pickled_overlaps_are_the_same_to_the_last_bit(options):
    found = some_overlaps(tolerance=0.01, **options)
    again = pickle.loads(pickle.dumps(found))
    columns = ("pairs", "status", "way", "volume", "volume_error", "centroid", "normal", "gradient")
    for name in (*columns, "patch_centre", "patch_moments", "patch_distance"):
        assert getattr(again, name).tobytes() == getattr(found, name).tobytes()
    for name in ("examined", "planes_asked", "tolerance", "method"):
        assert getattr(again, name) == getattr(found, name)


def test_a_pickled_batch_has_its_shapes():
    batch = Batch([Box([1, 1, 1]), Sphere(1.0)])
    again = pickle.loads(pickle.dumps(batch))
    assert repr(again) == repr(batch) == "Batch(2 shapes)"
    assert again.overlaps(*POSES).volume.tobytes() == batch.overlaps(*POSES).volume.tobytes()


@pytest.mark.parametrize(
    ("place", "value", "message"),
    [
        (0, ("box",) * 4, r"^shapes\[0\] must be"),
        (1, np.full((4, 3), np.nan), "^pose 0: position must"),
        (2, np.zeros((4, 4)), "^pose 0: orientation must not be"),
        (3, [[0, 9]], "^pairs must index the 4 shapes, not 9$"),
        (4, 2.0, "^tolerance must"),
        (5, "car", "^method must"),
        (6, -1, "^state must be that of overlaps$"),
        (7, "many", "^state must be that of overlaps$"),
    ],
)
def test_an_altered_state_of_overlaps_is_refused(place, value, message):
    state = list(some_overlaps().__getstate__())
    state[place] = value
    with pytest.raises((ValueError, TypeError), match=message):
        Overlaps.__new__(Overlaps).__setstate__(tuple(state))


@pytest.mark.parametrize("seed", range(6))
def test_a_pickled_hull_is_the_same_to_the_last_number_of_a_facet(seed):
    rng = np.random.default_rng(seed)
    points = [
        CUBE,
        np.vstack([CUBE, rng.uniform(0, 1, (40, 3)), rng.integers(0, 2, (40, 3)) * [1, 1, 0.5]]),
        hull_points(rng, 60) + 1e5 * rng.normal(size=3),
        np.round(rng.normal(size=(60, 3))),
        rng.normal(size=(40, 3)) * [1, 1e-9, 1],
        rng.normal(size=(12, 3)) * 1e-20,
    ][seed]
    hull = Hull(points)
    again = pickle.loads(pickle.dumps(hull))
    for one, other in zip(hull.__getstate__(), again.__getstate__(), strict=True):
        assert one.tobytes() == other.tobytes()
    assert again.volume == hull.volume


def test_arrays_may_change_while_a_batch_works_on_them():
    pairs = np.tile(np.array([0, 1], np.int32), (40_000, 1))
    positions, orientations = (array.copy() for array in POSES)
    done = threading.Event()

    def change():
        while not done.is_set():
            for array, value in ((pairs, 2**30), (positions, np.nan), (orientations, 0)):
                before = array.copy()
                array[len(array) // 2 :] = value
                array[:] = before

    threading.Thread(target=change, daemon=True).start()
    batch = Batch([Box([1, 1, 1])] * 2)
    try:
        for _ in range(30):
            try:
                found = batch.overlaps(positions, orientations, pairs)
                assert np.isin(found.pairs, (0, 1)).all()
            except ValueError:
                pass
    finally:
        done.set()


@pytest.mark.parametrize("index", [2**32, 2**32 + 1, -(2**32), 2**31, -1, 2, 2**63, 2**64 - 1, 2**70, 0.5, "1"])
def test_indices_do_not_wrap(index):
    with pytest.raises(ValueError, match="pairs must"):
        overlaps([Sphere(1)] * 2, *POSES, [[index, 1]])
    frames = [((0, 0, 0), (0, 0, 0, 1))] * 2
    with pytest.raises(ValueError, match="which must"):
        _core.world_poses(frames, [index, 1], *POSES)


@pytest.mark.parametrize("row", [2**31, 2**32, 2**63, 2**70, 1, -2, 0.5])
def test_rows_do_not_wrap(row):
    found = overlaps([Sphere(1)] * 2, *POSES)
    for key in (row, [row]):
        with pytest.raises((IndexError, OverflowError)):
            found[key]


@pytest.mark.parametrize("kind", ["int8", "uint16", "int32", "uint32", "int64", "uint64"])
def test_whole_numbers_of_any_width_are_indices(kind):
    assert len(overlaps([Sphere(1)] * 2, *POSES, np.array([[0, 1]], kind))) == 1


def test_an_overlap_of_a_pickled_quaternion_is_the_same():
    body = Placed(Box([1, 2, 3]), (0.5, 0, 0), (1, 1, 1, 5))
    again = pickle.loads(pickle.dumps(overlap(body, Box([1, 1, 1]))))
    assert again.shapes[0].given_orientation.tolist() == [1, 1, 1, 5]
    assert again.volume == overlap(body, Box([1, 1, 1])).volume
