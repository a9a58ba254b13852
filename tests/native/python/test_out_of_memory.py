"""An answer that runs out of memory raises a MemoryError. The same question can be asked again later."""

import multiprocessing
import resource

from overlapper import Box, Overlap, Placed, Sphere, overlap

TOLERANCE = 1e-5  # of the polytope of a ball on an edge: hundreds of megabytes


def ball_on_an_edge() -> Overlap:
    return overlap(Sphere(1), Placed(Box([1, 1, 1]), (0.9, 0.9, 0)), tolerance=TOLERANCE)


def limit_memory(further: int) -> None:
    """So many bytes may still be asked for; all there are, if negative."""
    with open("/proc/self/statm") as statm:
        used = int(statm.read().split()[0]) * resource.getpagesize()
    limit = used + further if further >= 0 else resource.RLIM_INFINITY
    resource.setrlimit(resource.RLIMIT_AS, (limit, resource.RLIM_INFINITY))


def corners_in_little_memory_and_then_in_enough() -> list[object]:
    common = ball_on_an_edge()
    said: list[object] = []
    for further in (20_000_000, 20_000_000, -1):
        limit_memory(further)
        try:
            said.append(len(common.vertices))
        except MemoryError:
            said.append(MemoryError)
    return said


def test_an_overlap_that_ran_out_of_memory_can_be_asked_again() -> None:
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        said = pool.apply_async(corners_in_little_memory_and_then_in_enough).get(timeout=120)
    assert said == [MemoryError, MemoryError, len(ball_on_an_edge().vertices)]
