"""The same bits from many threads, no hang after fork or spawn, Ctrl-C heard, memory flat, copies that are the same."""

import copy
import multiprocessing
import os
import pickle
import signal
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from strategies import hull_points, overlapping_points, quaternion

import overlapper
from overlapper import (
    Batch,
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Overlap,
    Placed,
    RoundedHull,
    Sphere,
    _core,
    distance,
    iou,
    maximum_depth,
    maximum_volume,
    overlap,
    overlaps,
    penetration_depth,
    random_polytope,
    swept_hull,
    time_of_impact,
    times_of_impact,
)

HANG = 120  # s after which something hangs; nothing here takes a tenth of it
TOLERANCE = 0.03


def random_shape(rng):
    radius, length = rng.uniform(0.2, 0.8, 2)
    solids = (
        lambda: Box(rng.uniform(0.2, 0.8, 3)),
        lambda: Sphere(radius),
        lambda: Capsule(radius, length),
        lambda: Cylinder(radius, length),
        lambda: Hull(hull_points(rng, int(rng.integers(6, 16)))),
        lambda: HalfSpace(rng.normal(size=3), rng.uniform(-0.5, 0.5)),
    )
    return solids[rng.integers(len(solids))]()


def random_bodies(rng, count):
    """Placed shapes of all kinds; some pairs are apart, most overlap. The first is bounded."""
    bodies = [Placed(Box(rng.uniform(0.2, 0.8, 3)), rng.uniform(-0.6, 0.6, 3), quaternion(rng))]
    while len(bodies) < count:
        bodies.append(Placed(random_shape(rng), rng.uniform(-0.6, 0.6, 3), quaternion(rng)))
    return bodies


def bits(value):
    """Anything that the package hands out, down to the last bit."""
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, (list, tuple)):
        return tuple(bits(part) for part in value)
    if isinstance(value, float):
        return value.hex()
    if type(value).__module__.startswith("overlapper"):
        return type(value).__name__, tuple((name, bits(asked(value, name))) for name in properties(value))
    return value


def asked(value, name):
    """A property, or the sentence that refuses it: groups with a round body have no `hessian`."""
    try:
        return getattr(value, name)
    except ValueError as refusal:
        return str(refusal)


def properties(value):
    names = (name for name in dir(type(value)) if not name.startswith("_"))
    return [name for name in names if not callable(getattr(type(value), name))]


def answers(seed):
    """Every public function and class at work, as bits."""
    rng = np.random.default_rng(seed)
    a, b, c = random_bodies(rng, 3)
    points = overlapping_points(rng, 9)
    found = {
        "Placed": [a, b, c],
        "overlap": [overlap(a, b, tolerance=TOLERANCE), overlap(a, b, c, tolerance=TOLERANCE), overlap(*points)],
        "paper": overlap(*points, method="paper"),
        "distance": distance(a, b),
        "penetration_depth": penetration_depth(a, b),
        "iou": iou(a, b, TOLERANCE),
        "time_of_impact": time_of_impact(a, b, (rng.normal(size=3), rng.normal(size=3))),
    }
    cube, lands = Placed(Box([0.5, 0.5, 0.5]), rng.normal(size=3)), ([0, 0, -1], rng.normal(size=3))
    found["maximum_depth"] = maximum_depth(cube, Sphere(0.5), lands, tolerance=1e-2)
    found["maximum_volume"] = maximum_volume(cube, Box([2, 2, 0.5]), lands, tolerance=1e-1)
    found["swept_hull"] = swept_hull(cube, lands, tolerance=1e-1)
    found["swept_supports"] = _core.swept_supports(cube, lands, 1.0, np.eye(3), 1e-6)
    shapes, positions, orientations = zip(*((body.shape, body.position, body.orientation) for body in (a, b, c)))
    pairs = _core.candidate_pairs(shapes, positions, orientations)
    found["candidate_pairs"] = pairs
    found["overlaps"] = overlaps(shapes, positions, orientations, tolerance=TOLERANCE, threads=2)
    ends = np.array(positions) + rng.normal(size=(3, 3))
    found["times_of_impact"] = times_of_impact(shapes, positions, orientations, ends, orientations, threads=2)
    found["swept_pairs"] = _core.swept_pairs(shapes, positions, orientations, ends, orientations)
    found["Batch"] = Batch(shapes).overlaps(positions, orientations, pairs, TOLERANCE)
    ellipsoid = Placed(Ellipsoid([0.4, 0.5, 0.6]))
    found["Ellipsoid"] = [overlap(ellipsoid, body, tolerance=TOLERANCE) for body in (a, Placed(points[0]))]
    found["RoundedHull"] = overlap(Placed(RoundedHull(points[0], 0.1)), Placed(Box([0.5, 0.5, 0.5])))
    frames = [(body.position, body.orientation) for body in (a, b, c)]
    found["world_poses"] = _core.world_poses(frames, np.arange(3), positions, orientations)
    boxes = _core.boxes([[1, 1, 2]] * 3, positions, orientations)
    round_shapes = [_core.spheres([0.5, 1], positions[:2]), _core.ellipsoids([[0.4, 0.5, 0.6]], positions[:1])]
    round_shapes += [make([0.3], [0.6], positions[:1]) for make in (_core.capsules, _core.cylinders)]
    common = _core.common_volumes
    found["ShapeArray"] = [common(boxes, each, False, TOLERANCE, 2) for each in round_shapes]
    rectangles = _core.rectangles([[0, 0, 1, 2, 0.3], [0.2, 0.1, 1, 1, 1]], "a")
    found["rectangles"] = [_core.volumes_around(rectangles, rectangles, False, 2), rectangles.volume]
    found["volume_gradients"] = _core.volume_gradients(boxes, boxes, np.ones(3), True, TOLERANCE, 2)
    along = rng.normal(size=(3, 9)), rng.normal(size=(3, 9))
    of_second = (np.ones(3), *along, True, TOLERANCE, 2)
    found["volume_second_derivatives"] = _core.volume_second_derivatives(boxes, boxes, *of_second)
    found["fit_boxes"] = _core.fit_boxes([[[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)]], "corners")
    found["ChosenFrames"] = _core.ChosenFrames(np.array(positions), np.array(orientations), np.arange(3)).read()
    found["any_moved"] = _core.any_moved(positions, np.zeros(3), np.eye(3), positions, np.zeros(3), np.ones(3, bool))
    found["FixedShapes"] = _core.FixedShapes(np.arange(3), positions, orientations).world(frames, 1e3)
    mask = _core.PairMask(np.arange(3), ~np.eye(3, dtype=bool))
    found["masked_overlaps"] = _core.masked_overlaps(Batch(shapes), positions, orientations, mask, TOLERANCE)
    rule = _core.WeldRule([[1, 1, k, k, 0, False, False] for k in range(3)], [], [], True, False)
    mask = _core.PairMask.of_rule(np.arange(3), rule)
    found["WeldRule"] = _core.masked_overlaps(Batch(shapes), positions, orientations, mask, TOLERANCE)
    found["random_polytope"] = Placed(random_polytope(9, rng=rng))
    return {name: bits(value) for name, value in found.items()}


# Threads


def test_answers_cover_every_public_name():
    used = set(answers.__code__.co_names) | set(random_shape.__code__.co_names)
    used |= {name for part in random_shape.__code__.co_consts if hasattr(part, "co_names") for name in part.co_names}
    used |= set(random_bodies.__code__.co_names)
    assert set(overlapper.__all__) - used == {
        "Maximum",
        "Overlap",
        "Overlaps",
        "Shape",
        "SweptHull",
        "TimeOfImpact",
        "TimesOfImpact",
    }  # what functions return, and a typing alias
    assert {name for name, value in vars(_core).items() if not isinstance(value, type) and name[0] != "_"} <= {
        *used,
        "explain_constructor",
        "explain_with",
        "function",
        "method",
    }


def test_eight_threads_at_once_get_the_bits_of_one():
    alone = [answers(seed) for seed in range(12)]
    together = threading.Barrier(8)

    def all_answers(_):
        together.wait(HANG)
        return [answers(seed) for seed in range(12)]

    with ThreadPoolExecutor(8) as pool:
        for answer in pool.map(all_answers, range(8)):
            assert answer == alone


@pytest.mark.parametrize("method", ["auto", "paper"])
def test_eight_threads_may_ask_one_overlap_for_everything(method):
    for seed in range(20):
        bodies = [*overlapping_points(np.random.default_rng(seed), 4), Sphere(1)]
        alone = bits(overlap(*bodies, tolerance=TOLERANCE, method=method))
        shared = overlap(*bodies, tolerance=TOLERANCE, method=method)
        together = threading.Barrier(8)

        def ask(first, shared=shared, together=together):
            """Each thread starts with another property, so that each part of the lazy answer is built by some other."""
            names = properties(shared)
            together.wait(HANG)
            for name in names[first:] + names[:first]:
                asked(shared, name)
            return bits(shared)

        with ThreadPoolExecutor(8) as pool:
            assert set(pool.map(ask, range(0, 24, 3))) == {alone}


# Processes


def in_another_process(start, function, *arguments):
    """The value that the function returns in another process. A process that hangs or dies fails the test."""
    with multiprocessing.get_context(start).Pool(1) as pool:
        return pool.apply_async(function, arguments).get(timeout=HANG)


unasked: list[Overlap] = []


def bits_of_unasked():
    return bits(unasked)


def test_a_forked_process_goes_on_with_what_it_inherits():
    before = answers(0)  # method "paper" has started threads by now
    bodies = overlapping_points(np.random.default_rng(1), 8)
    methods = ("auto", "paper")
    unasked[:] = [overlap(*bodies, method=method) for method in methods]
    assert in_another_process("fork", bits_of_unasked) == bits([overlap(*bodies, method=method) for method in methods])
    assert in_another_process("fork", answers, 0) == before == answers(0)


def test_a_process_forked_while_a_thread_computes_does_not_wait_for_it():
    bodies = Placed(Capsule(0.5, 1)), Placed(Cylinder(0.5, 1), (0.2, 0.1, 0.3), (0.1, 0.2, 0.3, 0.9))
    shared = overlap(*bodies, tolerance=5e-5)  # a tenth of a second, when asked
    begins = threading.Event()
    context = multiprocessing.get_context("fork")
    receiving, sending = context.Pipe(duplex=False)
    child = context.Process(target=lambda: sending.send(shared.volume))
    with ThreadPoolExecutor(1) as pool:
        asked = pool.submit(lambda: (begins.set(), shared.volume)[1])
        begins.wait(HANG)
        child.start()
        try:
            assert receiving.poll(HANG) and receiving.recv() == asked.result(HANG)
        finally:
            child.kill()


def test_a_spawned_process_gives_the_same_bits():
    assert in_another_process("spawn", answers, 2) == answers(2)


@pytest.mark.parametrize("start", ["fork", "spawn"])
def test_overlaps_are_pickled_between_processes(start):
    rng = np.random.default_rng(3)
    there = [overlap(*random_bodies(rng, count), tolerance=TOLERANCE) for count in (2, 2, 3, 4)]
    assert in_another_process(start, bits, there) == bits(there)
    assert bits(in_another_process(start, copy.copy, there)) == bits(there)


@pytest.mark.parametrize("distance", [1.2, 3, 0.5])
def test_copies_and_pickles_of_times_of_impact_are_the_same(distance):
    original = time_of_impact(Placed(Box([0.5, 0.5, 0.5]), (distance, 0, 0)), Sphere(0.5), ((-1, 0, 0), (1, 2, 3)))
    for again in (pickle.loads(pickle.dumps(original)), copy.copy(original), copy.deepcopy([original])[0]):
        assert bits(again) == bits(original) and repr(again) == repr(original)


@pytest.mark.parametrize("seed", range(6))
def test_copies_and_pickles_of_overlaps_and_bodies_are_the_same(seed):
    rng = np.random.default_rng(seed)
    bodies = random_bodies(rng, 2 + seed % 3)
    for method in ("auto", "paper"):
        for original in (*bodies, overlap(*bodies, tolerance=TOLERANCE, method=method)):
            for again in (copy.copy(original), copy.deepcopy(original), pickle.loads(pickle.dumps(original))):
                assert bits(again) == bits(original)


# Interruption


def interrupted_batch():
    """True if Ctrl-C ends a batch that would go on for minutes."""
    balls, positions, orientations = [Sphere(1), Sphere(1)], [[0, 0, 0], [1, 0, 0]], [[0, 0, 0, 1]] * 2
    pairs = np.broadcast_to(np.array([0, 1], np.int32), (1_000_000, 2))
    press = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
    press.start()  # it can only fire inside of the call, as nothing comes before it
    try:
        overlaps(balls, positions, orientations, pairs, 1e-2, method="paper")
    except KeyboardInterrupt:
        return True
    return False


def test_ctrl_c_ends_a_long_batch():
    assert in_another_process("spawn", interrupted_batch)


# Memory


def set_sanitizer(monkeypatch, option):
    """For processes spawned from here on, where they run under AddressSanitizer."""
    monkeypatch.setenv("ASAN_OPTIONS", os.environ.get("ASAN_OPTIONS", "") + ":" + option)


def test_an_array_beyond_all_memory_is_a_memory_error(monkeypatch):
    set_sanitizer(monkeypatch, "allocator_may_return_null=1")  # as malloc does by itself
    assert in_another_process("spawn", refusals_of_huge_arrays) == ["MemoryError"] * 4


def refusals_of_huge_arrays():
    """The names of what is raised for petabytes of points, poses and pairs."""
    huge = np.broadcast_to(0.0, (2**46, 3))
    pairs = np.broadcast_to(np.array([0, 1], np.int32), (2**46, 2))
    batch = ([Sphere(1)], [[0, 0, 0]], [[0, 0, 0, 1]])
    calls = (
        lambda: Hull(huge),
        lambda: overlap(huge, Sphere(1)),
        lambda: overlaps(*batch, pairs),
        lambda: _core.candidate_pairs(batch[0], huge, batch[2]),
    )
    names = []
    for call in calls:
        try:
            call()
        except Exception as error:
            names.append(next(c.__name__ for c in type(error).__mro__ if c.__module__ == "builtins"))
    return names


def resident():
    """Bytes of this process in memory."""
    with open("/proc/self/statm") as statm:
        return int(statm.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def growth_over(pairs):
    """Growth of memory over `pairs` overlaps. Each pair has a new hull, and its measures are read."""
    rng = np.random.default_rng(0)
    bodies = random_bodies(rng, 97)
    points = [hull_points(rng, 8) for _ in range(89)]

    def soak(count):
        for i in range(count):
            method = "paper" if i % 20 == 0 else "auto"
            common = overlap(bodies[i % 97], Hull(points[i % 89]), tolerance=0.3, method=method)
            bits([common.volume, common.volume_error, common.gradient, common.vertices, common.patch, common.normal])

    soak(1000)
    before = resident()
    soak(pairs)
    return resident() - before


def test_memory_is_flat_over_many_pairs(monkeypatch):
    set_sanitizer(monkeypatch, "quarantine_size_mb=1")  # it would keep what is freed, to recognise its use
    pairs = 8_000
    assert in_another_process("spawn", growth_over, pairs) < 200 * pairs  # an overlap alone has more bytes than that


# Found by the fuzzer

THIN_CAPSULES = {
    "through a box": (Placed(Box((2, 3, 3)), (0.28292285252742166, 1, 0)), Placed(Capsule(2.0**-27, 1), (0, 0, -2))),
    "inside of a ball": (Placed(Sphere(3), (0, -0.86, 0.14)), Placed(Capsule(2.0**-31, 1), (-0.417, 0.0059, 0.0059))),
}


@pytest.mark.parametrize("bodies", THIN_CAPSULES.values(), ids=THIN_CAPSULES)
@pytest.mark.parametrize("method", ["auto", "paper"])
def test_the_surface_of_a_needle_is_closed(bodies, method):
    """Merging corners that only rounding parts must leave one closed surface; the paper's method once took minutes."""
    common = overlap(*bodies, tolerance=0.003125, method=method)
    edges = sum(len(facet) for facet in common.facets) / 2
    assert len(common.vertices) - edges + len(common.facets) == (2 if common else 0)


def test_a_pickled_hull_is_as_fast_to_work_with():
    """Where it is not searched from the neighbours of its facets, far more of them take part."""
    points = np.random.default_rng(1).normal(size=(800, 3))
    hull = Hull(points / np.linalg.norm(points, axis=1)[:, None])
    again = pickle.loads(pickle.dumps(hull))
    first, second = (overlap(each, Placed(each, (1.9, 0, 0), (0, 0, 1, 1))) for each in (hull, again))
    assert first.status == "overlapping" and first.facets_touched < 300
    assert (first.volume, first.facets_touched) == (second.volume, second.facets_touched)
