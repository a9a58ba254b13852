"""Overlaps of many pairs in one call: the bits of single calls, whatever the threads, memory and interruptions."""

import multiprocessing
import os
import pickle
import re
import signal
import threading
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy.spatial.transform import Rotation
from strategies import hull_points, quaternion, turn

from overlapper import Batch, Box, Capsule, Cylinder, HalfSpace, Hull, Overlaps, Placed, Sphere, overlap, overlaps

HANG = 120  # s after which something hangs
TOLERANCE = 0.05
COLUMNS = ("pairs", "status", "volume", "volume_error", "centroid", "area", "normal", "depth", "gradient")
COLUMNS += ("facets_touched", "widened")


def scene(rng, count=30):
    """Shapes of all kinds in a heap on the ground, and their poses."""
    shapes = [HalfSpace([0, 0, 1], 0)]
    while len(shapes) < count:
        radius, length = rng.uniform(0.1, 0.4, 2)
        solids = (Box(rng.uniform(0.1, 0.4, 3)), Sphere(radius), Capsule(radius, length), Cylinder(radius, length))
        solids += (Hull(hull_points(rng, 10, 0.5)), Box([0.25, 0.25, 0.25]))
        shapes.append(solids[rng.integers(len(solids))])
    positions = rng.uniform([-1, -1, 0], [1, 1, 1], (count, 3))
    positions[0] = 0
    orientations = np.array([[0, 0, 0, 1], *(quaternion(rng) for _ in shapes[1:])])
    return shapes, positions, orientations


def walk(rng, positions, orientations):
    """Poses a step later: some bodies rest, some move a little, some jump."""
    step = rng.choice([0, 0, 1e-15, 1e-3, 0.3], len(positions))[:, None]
    step[0] = 0
    return positions + step * rng.normal(size=positions.shape), orientations + step * rng.normal(size=(len(step), 4))


def bits(answer):
    return {name: (getattr(answer, name).shape, getattr(answer, name).tobytes()) for name in COLUMNS}


def all_pairs(count):
    return np.argwhere(np.triu(np.ones((count, count), bool), 1)).astype(np.int32)


# The answer


def assert_row_is_that_of(answer, row, single):
    """Row by row the quantities of Overlap, to the last bit."""
    assert ("separated", "touching", "overlapping")[answer.status[row]] == single.status
    assert answer.volume[row] == single.volume
    assert answer.area[row] == single.area
    assert answer.facets_touched[row] == single.facets_touched
    assert answer.widened[row] == single.widened
    assert_array_equal(answer.gradient[row], single.gradient)
    if single:
        assert_array_equal(answer.centroid[row], single.centroid)
        assert answer.depth[row] == single.depth
    else:
        assert np.isnan(answer.centroid[row]).all()
        assert answer.depth[row] == 0
    if single.status == "separated":
        assert answer.volume_error[row] == 0
        assert_array_equal(answer.normal[row], 0)
    else:
        assert answer.volume_error[row] == single.volume_error
        assert_array_equal(answer.normal[row], single.normal)


@pytest.mark.parametrize("seed", range(3))
def test_a_row_is_the_overlap_of_its_pair(seed):
    shapes, positions, orientations = scene(np.random.default_rng(seed))
    placed = [Placed(*each) for each in zip(shapes, positions, orientations)]
    pairs = np.random.default_rng(seed).permutation(all_pairs(len(shapes)))[:150]
    answer = overlaps(shapes, positions, orientations, pairs, TOLERANCE)
    assert_array_equal(answer.pairs, pairs)
    assert len(answer) == answer.examined == len(pairs)
    for row, (i, j) in enumerate(pairs):
        assert_row_is_that_of(answer, row, overlap(placed[i], placed[j], tolerance=TOLERANCE))


def test_homogeneous_matrices_are_poses():
    shapes, positions, orientations = scene(np.random.default_rng(0))
    matrices = np.tile(np.eye(4), (len(shapes), 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = Rotation.from_quat(orientations).as_matrix(), positions
    placed = [Placed(*each) for each in zip(shapes, matrices)]
    where = [each.position for each in placed], [each.given_orientation for each in placed]
    batch = Batch(shapes)
    expected = bits(overlaps(shapes, *where))
    assert bits(overlaps(shapes, matrices)) == bits(batch.overlaps(matrices.tolist())) == expected
    assert_array_equal(batch.candidate_pairs(matrices), batch.candidate_pairs(*where))


def test_a_row_hands_out_its_overlap():
    shapes, positions, orientations = scene(np.random.default_rng(0))
    answer = overlaps(shapes, positions, orientations, tolerance=TOLERANCE)
    for row, single in enumerate(answer):
        assert single.tolerance == TOLERANCE
        assert_array_equal([body.position for body in single.shapes], positions[answer.pairs[row]])
        assert_row_is_that_of(answer, row, single)
    assert len(answer[-1].vertices) > 0 or not answer[-1]
    with pytest.raises(IndexError):
        answer[len(answer)]


@pytest.mark.parametrize("seed", range(3))
def test_without_a_list_of_pairs_all_overlapping_or_touching_pairs_are_found(seed):
    shapes, positions, orientations = scene(np.random.default_rng(seed))
    every = overlaps(shapes, positions, orientations, all_pairs(len(shapes)), TOLERANCE)
    answer = overlaps(shapes, positions, orientations, tolerance=TOLERANCE)
    assert bits(answer) == bits(every[every.status != Overlaps.SEPARATED])
    assert len(answer) <= answer.examined < every.examined


def test_pairs_that_are_apart_may_be_left_out():
    shapes, positions, orientations = scene(np.random.default_rng(2))
    batch, pairs = Batch(shapes), all_pairs(len(shapes))
    every = batch.overlaps(positions, orientations, pairs, TOLERANCE)
    for asked in (batch, Batch(shapes)):
        answer = asked.overlaps(positions, orientations, pairs, TOLERANCE, separated=False)
        assert bits(answer) == bits(every[every.status != Overlaps.SEPARATED])
        assert answer.examined == every.examined == len(pairs)


def test_bodies_that_touch_are_found():
    """Three unit cubes in a row on the ground, far enough out that their sides are rounded."""
    cube = Box([0.5, 0.5, 0.5])
    ground = HalfSpace([0, 0, 1], 0)
    positions = [[1000.1, 0, 0.5], [1001.1, 0, 0.5], [1002.1, 1, 0.5], [0, 0, 0]]
    answer = overlaps([cube, cube, cube, ground], positions, [[0, 0, 0, 1]] * 4)
    assert_array_equal(answer.pairs, [[0, 1], [0, 3], [1, 2], [1, 3], [2, 3]])
    assert_array_equal(answer.depth < 1e-12, True)


def test_candidates_are_the_boxes_that_meet_however_large_and_wherever_they_have_moved():
    rng = np.random.default_rng(8)
    halves = 10 ** rng.uniform(-3, 1, 300)[:, None] * rng.uniform(0.2, 1, (300, 3))
    shapes, upright = [HalfSpace([0, 0, 1], 0), *map(Box, halves)], np.tile([0, 0, 0, 1], (301, 1))
    batch = Batch(shapes)
    positions = rng.normal(size=(301, 3)) * np.exp(rng.normal(size=(301, 1)))
    positions[0] = 0
    for step in (0, 1e-3, 1e-3, 0.1, 3, 1e-3, 1e-3, 100, 0, 1e7):
        positions[1:] += step * rng.normal(size=(300, 3)) * (rng.random((300, 1)) < 0.5)
        apart = np.abs(positions[1:, None] - positions[None, 1:]) > halves[:, None] + halves[None]
        meet = np.argwhere(np.triu(~apart.any(axis=2), 1)) + 1
        grounded = np.flatnonzero(positions[1:, 2] <= halves[:, 2]) + 1
        expected = sorted([[0, k] for k in grounded.tolist()] + meet.tolist())
        assert_array_equal(batch.candidate_pairs(positions, upright), np.reshape(expected, (-1, 2)))


def test_rows_are_picked_as_from_an_array():
    shapes, positions, orientations = scene(np.random.default_rng(1))
    answer = overlaps(shapes, positions, orientations, tolerance=TOLERANCE)
    deep = answer.depth > np.median(answer.depth)
    for key in (deep, slice(2, 9, 3), [4, 1, 1], np.array([], int)):
        picked = answer[key]
        assert picked.examined == answer.examined
        for name in COLUMNS:
            assert_array_equal(getattr(picked, name), getattr(answer, name)[key])
    assert [single.volume for single in answer[deep]] == answer.volume[deep].tolist()


def test_arrays_are_views_that_outlive_the_answer():
    shapes, positions, orientations = scene(np.random.default_rng(1))
    answer = overlaps(shapes, positions, orientations, tolerance=TOLERANCE)
    before, arrays = bits(answer), {name: getattr(answer, name) for name in COLUMNS}
    assert answer.volume.ctypes.data == arrays["volume"].ctypes.data
    del answer
    overlaps(*scene(np.random.default_rng(2)), tolerance=TOLERANCE)
    assert {name: (array.shape, array.tobytes()) for name, array in arrays.items()} == before
    assert not any(array.flags.writeable or not array.flags.c_contiguous for array in arrays.values())


def test_no_pairs_and_no_shapes_are_answers():
    nothing = overlaps([], np.zeros((0, 3)), np.zeros((0, 4)))
    assert len(nothing) == nothing.examined == 0
    assert nothing.gradient.shape == (0, 2, 6)
    assert len(overlaps([Sphere(1)], [[0, 0, 0]], [[0, 0, 0, 1]], [])) == 0


@pytest.mark.parametrize("tolerance", [0, -1, 1, 2, float("nan")])
def test_a_tolerance_is_refused_though_there_is_nothing_to_measure(tolerance):
    with pytest.raises(ValueError, match="tolerance must be greater than 0 and less than 1"):
        overlaps([], np.zeros((0, 3)), np.zeros((0, 4)), tolerance=tolerance)


# The same bits


@pytest.mark.parametrize("threads", [2, 8, None])
def test_the_number_of_threads_changes_no_bit(threads):
    arguments = scene(np.random.default_rng(3), 60)
    alone = overlaps(*arguments, tolerance=TOLERANCE)
    assert bits(overlaps(*arguments, tolerance=TOLERANCE, threads=threads)) == bits(alone)
    batch = Batch(arguments[0])
    for _ in range(2):
        assert bits(batch.overlaps(*arguments[1:], tolerance=TOLERANCE, threads=threads)) == bits(alone)


@pytest.mark.skipif(not os.path.isdir("/proc/self/task"), reason="threads are listed on Linux only")
@pytest.mark.parametrize("threads", [1, 3])
def test_at_most_the_requested_number_of_threads_work(threads):
    balls = [Sphere(1)] * 60
    positions, pairs = np.linspace([0, 0, 0], [0.5, 0, 0], len(balls)), all_pairs(len(balls))
    poses = positions, [[0, 0, 0, 1]] * len(balls), pairs
    with ThreadPoolExecutor(1) as caller:
        caller.submit(int).result()  # it has its thread
        before = len(os.listdir("/proc/self/task"))
        answer = caller.submit(overlaps, [*balls[1:], Cylinder(1, 1)], *poses, threads=threads)
        most = 0
        while not answer.done():
            most = max(most, len(os.listdir("/proc/self/task")) - before)
        assert len(answer.result()) == len(pairs)
    assert most <= threads - 1


@pytest.mark.parametrize("seed", range(3))
def test_remembered_rows_have_the_same_bits(seed):
    """Along a walk, with pairs and tolerances that come and go."""
    rng = np.random.default_rng(seed)
    shapes, positions, orientations = scene(rng, 25)
    batch, every = Batch(shapes), all_pairs(25)
    fixed = rng.permutation(every)[:60]
    for step in range(12):
        pairs = (None, every, fixed, every[::2], every[rng.integers(len(every), size=40)])[rng.choice(5)]
        tolerance = TOLERANCE if step % 4 else 0.02
        warm = batch.overlaps(positions, orientations, pairs, tolerance)
        assert bits(warm) == bits(overlaps(shapes, positions, orientations, pairs, tolerance))
        positions, orientations = walk(rng, positions, orientations)


def test_bodies_that_part_by_less_than_rounding_are_judged_alike_warm_and_cold():
    """An axis that was good a step ago proves no more than a first look does."""
    cubes = [Box([0.5, 0.5, 0.5]), Hull(np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T / 2.0)]
    for a, b in ((0, 0), (0, 1), (1, 1)):
        shapes = [cubes[a], cubes[b]]
        batch = Batch(shapes)
        for ulps in range(64, -9, -1):
            for orientation in ([0, 0, 0, 1], turn([0, 0, 0.3]), turn([1e-9, 0, 0])):
                positions, orientations = [[0, 0, 0], [0, 0, 1 + ulps * 2.0**-52]], [orientation, orientation]
                warm = batch.overlaps(positions, orientations, [[0, 1]])
                assert bits(warm) == bits(overlaps(shapes, positions, orientations, [[0, 1]]))


def test_a_batch_serves_eight_threads_at_once():
    rng = np.random.default_rng(5)
    shapes, *poses = scene(rng)
    steps = [poses]
    for _ in range(5):
        steps.append(walk(rng, *steps[-1]))
    alone = [bits(overlaps(shapes, *step, tolerance=TOLERANCE)) for step in steps]
    batch, together = Batch(shapes), threading.Barrier(8)

    def ask(first):
        together.wait(HANG)
        order = [(first + i) % len(steps) for i in range(len(steps))]
        return all(bits(batch.overlaps(*steps[i], tolerance=TOLERANCE)) == alone[i] for i in order)

    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(ask, range(8))) == [True] * 8


def test_a_refused_pose_leaves_the_batch_as_it_was():
    shapes, positions, orientations = scene(np.random.default_rng(6))
    batch = Batch(shapes)
    first = bits(batch.overlaps(positions, orientations, tolerance=TOLERANCE))
    bad = positions + 0.1
    bad[20, 1] = np.nan
    with pytest.raises(ValueError, match="pose 20: position must be finite"):
        batch.overlaps(bad, orientations, tolerance=TOLERANCE)
    assert bits(batch.overlaps(positions, orientations, tolerance=TOLERANCE)) == first


# Processes and interruption


def in_another_process(start, function, *arguments):
    """The answer of the function in another process. A process that hangs or dies fails the test."""
    with multiprocessing.get_context(start).Pool(1) as pool:
        return pool.apply_async(function, arguments).get(timeout=HANG)


def bits_with_threads(threads):
    return bits(overlaps(*scene(np.random.default_rng(7)), tolerance=TOLERANCE, threads=threads))


@pytest.mark.parametrize("start", ["fork", "spawn"])
def test_another_process_gets_the_same_bits_with_threads_of_its_own(start):
    here = bits_with_threads(8)
    assert in_another_process(start, bits_with_threads, 2) == here


def interrupted_rows(threads):
    """A batch of half a minute, and Ctrl-C: the finished rows, and whether each is the answer for its pair."""
    shapes, *poses = scene(np.random.default_rng(8), 40)
    pairs = np.tile(all_pairs(40), (400, 1))
    alone = overlaps(shapes, *poses, all_pairs(40), TOLERANCE)
    number = {tuple(pair): row for row, pair in enumerate(alone.pairs.tolist())}
    batch = Batch(shapes)
    for patience in (0.3, 1, 3, 9):  # s, where the first row takes long
        threading.Timer(patience, os.kill, (os.getpid(), signal.SIGINT)).start()
        try:
            batch.overlaps(*poses, pairs, TOLERANCE, threads)
        except KeyboardInterrupt as interruption:
            found = interruption.overlaps
            if len(found):
                break
    same = bits(found) == bits(alone[[number[tuple(pair)] for pair in found.pairs.tolist()]])
    again = bits(batch.overlaps(*poses, all_pairs(40), TOLERANCE)) == bits(alone)
    return len(found), len(pairs), same, again


@pytest.mark.parametrize("threads", [1, 3])
def test_ctrl_c_keeps_the_rows_that_were_finished(threads):
    rows, asked, same, again = in_another_process("spawn", interrupted_rows, threads)
    assert 0 < rows < asked
    assert same and again


def memory_errors():
    """The names of what is raised for petabytes of poses and pairs."""
    batch = Batch([Sphere(1)])
    huge = np.broadcast_to(0.0, (2**46, 3))
    pairs = np.broadcast_to(np.array([0, 0], np.int32), (2**46, 2))
    names = []
    for arguments in ((huge, [[0, 0, 0, 1]]), ([[0, 0, 0]], [[0, 0, 0, 1]], pairs)):
        try:
            batch.overlaps(*arguments)
        except Exception as error:
            names.append(next(c.__name__ for c in type(error).__mro__ if c.__module__ == "builtins"))
    return names


def test_arrays_beyond_all_memory_are_a_memory_error(monkeypatch):
    monkeypatch.setenv("ASAN_OPTIONS", os.environ.get("ASAN_OPTIONS", "") + ":allocator_may_return_null=1")
    assert in_another_process("spawn", memory_errors) == ["MemoryError"] * 2


# Bad input

POSES = ([[0, 0, 0], [1, 0, 0]], [[0, 0, 0, 1]] * 2)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            {"positions": [[0, 0, 0]]},
            "positions must be an array of shape (k, 3), one row per shape, not of shape (1, 3)",
        ),
        (
            {"orientations": [0, 0, 0, 1]},
            "orientations must be an array of shape (k, 4), one row per shape, not of shape (4,)",
        ),
        ({"positions": "there"}, "positions must be an array of shape (k, 3) or (k, 4, 4), one row per shape"),
        (
            {"positions": [np.eye(4)], "orientations": None},
            "positions must be an array of shape (k, 3) or (k, 4, 4), one row per shape, not of shape (1, 4, 4)",
        ),
        (
            {"positions": [np.eye(4), np.diag([1, 1, -1, 1])], "orientations": None},
            "positions[1] must not reflect: the determinant of its rotation is -1",
        ),
        (
            {"positions": np.zeros((1, 2, 3))},
            "positions must be an array of shape (k, 3) or (k, 4, 4), one row per shape, not of shape (1, 2, 3)",
        ),
        ({"positions": [np.eye(4)] * 2}, "orientations must be left out if the positions are matrices"),
        (
            {"orientations": None},
            "orientations must be given, unless the positions are matrices of shape (k, 4, 4)",
        ),
        ({"orientations": np.zeros((2, 4))}, "pose 0: orientation must not be the zero quaternion"),
        ({"positions": [[0, 0, 0], [0, np.inf, 0]]}, "pose 1: position must be finite"),
        ({"pairs": [[0, 2]]}, "pairs must index the 2 shapes, not 2"),
        ({"pairs": [[-1, 0]]}, "pairs must index the 2 shapes, not -1"),
        ({"pairs": [[0, 1, 1]]}, "pairs must be an array of whole numbers of shape (p, 2)"),
        ({"pairs": [[0.5, 1]]}, "pairs must be an array of whole numbers of shape (p, 2)"),
        ({"tolerance": 1}, "tolerance must be greater than 0 and less than 1"),
        ({"threads": 0}, "threads must be 1 or more, not 0"),
    ],
)
def test_a_bad_argument_is_named(change, sentence):
    arguments = {"positions": POSES[0], "orientations": POSES[1], **change}
    with pytest.raises(ValueError, match=re.escape(sentence)):
        overlaps([Sphere(1), Sphere(1)], **arguments)


def test_an_argument_that_is_not_a_shape_is_named():
    with pytest.raises(
        TypeError, match=re.escape("shapes[1] must be a shape, an (n, 3) array of points or a trimesh.Trimesh, not str")
    ):
        overlaps([Sphere(1), "ball"], *POSES)
    with pytest.raises(TypeError, match=r"^shapes\[0\] must be one shape, not a list of shapes: overlap\(\*shapes\)"):
        overlap([Sphere(1), Placed(Sphere(1))])
    with pytest.raises(TypeError, match=r"not SimpleNamespace: Hull\(mesh\.vertices\) makes a shape of a mesh$"):
        overlap(Sphere(1), SimpleNamespace(vertices=POSES[0]))
    with pytest.raises(TypeError, match="shapes must be a sequence"):
        Batch(7)
    with pytest.raises(TypeError, match="threads must be a whole number, or None"):
        overlaps([Sphere(1), Sphere(1)], *POSES, threads="all")


def test_half_spaces_that_overlap_without_bound_are_a_value_error():
    ground = HalfSpace([0, 0, 1], 0)
    with pytest.raises(ValueError, match="shapes must have a bounded common set"):
        overlaps([ground, HalfSpace([1, 0, 0], 0)], *POSES, [[0, 1]])
    assert len(overlaps([ground, HalfSpace([1, 0, 0], 0)], *POSES)) == 0


def test_boxes_that_touch_within_rounding_are_a_pair():
    cube, beside = Box([1, 1, 1]), np.nextafter(2.0, 3.0)
    assert overlap(cube, Placed(cube, (beside, 0, 0))).status == "touching"
    assert len(overlaps([cube, cube], [[0, 0, 0], [beside, 0, 0]], [[0, 0, 0, 1]] * 2)) == 1


def test_patches_are_those_of_new_batches_once_they_were_asked_of_earlier_results():
    """The batch then finds them with the measures, and keeps those of pairs that rest."""
    rng = np.random.default_rng(5)
    shapes, positions, orientations = scene(rng)
    batch = Batch(shapes)
    for step in range(4):
        found = batch.overlaps(positions, orientations)
        fresh = Batch(shapes).overlaps(positions, orientations)
        chosen = np.flatnonzero(found.volume > 0)[::2]
        for name in ("patch_centre", "patch_moments", "patch_distance"):
            assert_array_equal(getattr(found, name), getattr(fresh, name))
            assert_array_equal(getattr(found[chosen], name), getattr(fresh, name)[chosen])
        if step != 1:
            positions, orientations = walk(rng, positions, orientations)
    assert (fresh.volume > 0).any()


def test_depths_that_nobody_has_asked_for_are_found_on_first_use():
    """They have the bits of depths that are found at once, whatever was asked of earlier results."""
    rng = np.random.default_rng(8)
    shapes, positions, orientations = scene(rng)
    batch = Batch(shapes)
    for step in range(8):
        found = batch.overlaps(positions, orientations, threads=1 + step % 2)
        at_once = Batch(shapes).overlaps(positions, orientations)
        if step % 3:  # else the depths of the next results are deferred
            assert_array_equal(found.depth, at_once.depth)
        half = found[np.arange(0, len(found), 2)]
        for each in (found, pickle.loads(pickle.dumps(found))):
            assert_array_equal(each.normal, at_once.normal)
        assert_array_equal(half.depth, at_once.depth[::2])
        assert_array_equal(half.normal, at_once.normal[::2])
        positions, orientations = walk(rng, positions, orientations)
    for row in range(0, len(found), 5):
        assert found[row].depth == found.depth[row]


def test_deferred_depths_of_pairs_that_have_not_moved_are_those_of_before():
    rng = np.random.default_rng(9)
    shapes, positions, orientations = scene(rng)
    batch = Batch(shapes)
    batch.overlaps(positions, orientations)
    for _ in range(2):
        positions, orientations = positions + 1e-3, orientations
        batch.overlaps(positions, orientations)
    again = [batch.overlaps(positions, orientations) for _ in range(3)]
    truth = Batch(shapes).overlaps(positions, orientations)
    for found in reversed(again):
        assert_array_equal(found.depth, truth.depth)
        assert_array_equal(found.normal, truth.normal)
