"""Times of impact of many pairs in one call: the answers of single calls, and pairs that boxes leave out."""

import pickle

import numpy as np
import pytest
from strategies import hull_points

from overlapper import (
    Batch,
    Box,
    Capsule,
    HalfSpace,
    Hull,
    Placed,
    RoundedHull,
    Sphere,
    TimesOfImpact,
    _core,
    time_of_impact,
    times_of_impact,
)

STILL = [[0, 0, 0, 1]] * 2
COUNT = 60


def scene(seed, turn):
    """Shapes of several kinds with poses at both ends of a motion."""
    rng = np.random.default_rng(seed)
    kinds = (
        lambda: Box(rng.uniform(0.1, 0.5, 3)),
        lambda: Sphere(rng.uniform(0.1, 0.5)),
        lambda: Capsule(*rng.uniform(0.1, 0.5, 2)),
        lambda: Hull(hull_points(rng, 12) / 3 + 0.5),  # away from its own origin
        lambda: RoundedHull(hull_points(rng, 8) / 4, 0.1),
    )
    shapes = [kinds[i % len(kinds)]() for i in range(COUNT)] + [HalfSpace([0, 0, 1], -3), HalfSpace([1, 0, 0], -3)]
    positions = rng.uniform(-3, 3, (len(shapes), 3))
    ends = positions + rng.normal(size=positions.shape)
    orientations = rng.normal(size=(len(shapes), 4))
    turned = orientations + turn * rng.normal(size=orientations.shape)
    turned[-1] = orientations[-1]  # a half-space that only moves
    return shapes, positions, orientations, ends, turned


def single(shapes, positions, orientations, ends, turned, a, b, **options):
    bodies = [Placed(shapes[i], positions[i], orientations[i]) for i in (a, b)]
    return time_of_impact(*bodies, *(Placed(shapes[i], ends[i], turned[i]) for i in (a, b)), **options)


@pytest.mark.parametrize("turn", [0, 0.3, 5])
def test_pairs_that_boxes_leave_out_stay_separated(turn):
    """All other pairs have the answers of single calls, to the last bit."""
    given = scene(3, turn)
    count = len(given[0])
    every = np.array([(a, b) for a in range(count) for b in range(a + 1, count)][:-1])  # but the two half-spaces
    examined = _core.swept_pairs(*given)
    assert 100 < len(examined) < len(every) / 2
    all_pairs = times_of_impact(*given, every)
    assert [each.__getstate__()[:5] for each in all_pairs] == [
        single(*given, *pair).__getstate__()[:5] for pair in every
    ]
    met = every[all_pairs.status != TimesOfImpact.STATUSES.index("separated")]
    assert len(met) > 20 and {*map(tuple, met.tolist())} <= {*map(tuple, examined.tolist())}
    found = times_of_impact(*given)
    assert found.pairs.tolist() == met.tolist()
    assert np.array_equal(found.time, all_pairs.time[~np.isnan(all_pairs.time)])


def test_columns_have_the_answers_of_the_rows():
    given = scene(4, 1)
    found = times_of_impact(*given, _core.swept_pairs(*given), duration=0.5)
    assert {*found.status.tolist()} >= {0, 1, 3}
    for row, each in enumerate(found):
        assert TimesOfImpact.STATUSES[found.status[row]] == each.status
        assert (found.distance[row], found.distance_time[row]) == (each.distance, each.distance_time)
        for name in ("time", "time_upper", "normal", "point"):
            value, own = getattr(found, name)[row], getattr(each, name)
            assert np.isnan(value).all() if own is None else np.array_equal(value, own)
    assert len(found) == len(found.pairs) and found[-1].status == each.status
    with pytest.raises(IndexError):
        found[len(found)]


def test_threads_and_batches_change_no_bit():
    given = scene(5, 1)
    alone = times_of_impact(*given)
    for again in (times_of_impact(*given, threads=2), times_of_impact(Batch(given[0]), *given[1:], threads=None)):
        assert pickle.dumps(again) == pickle.dumps(alone)


def test_matrices_are_poses():
    shapes = [Sphere(0.5), Sphere(0.5)]
    start, end = np.tile(np.eye(4), (2, 2, 1, 1))
    start[0, 0, 3], end[0, 0, 3] = 3, -3
    found = times_of_impact(shapes, start, None, end, None, duration=6)
    assert found.time == pytest.approx([2]) and found.normal.tolist() == [[1, 0, 0]]


def test_pickled_times_of_impact_are_the_same():
    given = scene(6, 1)
    found = times_of_impact(*given, _core.swept_pairs(*given), tolerance=1e-6)
    again = pickle.loads(pickle.dumps(found))
    for name in ("pairs", "status", "time", "time_upper", "normal", "point", "distance", "distance_time"):
        assert getattr(again, name).tobytes() == getattr(found, name).tobytes()
    assert [each.converged for each in again] == [each.converged for each in found]
    state = found.__getstate__()
    for altered in ((), (state[0][1:], *state[1:]), (state[0], [1] * len(found), state[2]), (*state[:2], "wide")):
        with pytest.raises(ValueError, match=r"^state must be [^\n]+$"):
            TimesOfImpact.__new__(TimesOfImpact).__setstate__(altered)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"end_positions": np.zeros((3, 3))}, r"^end_positions must be an array of shape \(k, 3\)"),
        ({"end_orientations": None}, "^end_orientations must be given"),
        ({"end_positions": [[0, 0, 0], [0, 0, np.nan]]}, "^end pose 1: "),
        ({"pairs": [[0, 2]]}, "^pairs must index the 2 shapes, not 2"),
        ({"shapes": [HalfSpace([0, 0, 1], 0)] * 2, "pairs": [[0, 1]]}, "^pairs must not pair two half-spaces"),
        ({"duration": 0}, "^duration must be greater than 0"),
        ({"duration": 1e-320}, "^duration is too short"),
        ({"tolerance": 1}, "^tolerance must be greater than 0"),
        ({"threads": 0}, "^threads must be 1 or more"),
    ],
)
def test_refused_arguments(arguments, words):
    places = np.array([[0, 0, 0], [3, 0, 0]])
    given = {"positions": places, "orientations": STILL, "end_positions": places / 4, "end_orientations": STILL}
    with pytest.raises(ValueError, match=words):
        times_of_impact(**{"shapes": [Sphere(1), Sphere(1)], **given, **arguments})
