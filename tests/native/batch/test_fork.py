"""A batch in a fork; apart, as under a sanitizer whose allocator another thread holds, a fork waits for ever."""

import threading

import numpy as np
from test_batch import TOLERANCE, bits, bits_with_threads, in_another_process, scene

from overlapper import Batch

inherited: list[Batch] = []


def bits_of_inherited():
    _, *poses = scene(np.random.default_rng(7))
    return bits(inherited[0].overlaps(*poses, tolerance=TOLERANCE, threads=2))


def test_a_batch_goes_on_in_a_process_forked_while_it_was_at_work():
    """The other thread, and so its hold on the memory, does not exist in the fork."""
    shapes, *poses = scene(np.random.default_rng(7))
    inherited[:] = [Batch(shapes)]
    stop = threading.Event()

    def keep_busy():
        while not stop.is_set():
            inherited[0].overlaps(*poses, tolerance=0.01, threads=2)

    busy = threading.Thread(target=keep_busy)
    busy.start()
    try:
        for _ in range(5):
            assert in_another_process("fork", bits_of_inherited) == bits_with_threads(1)
    finally:
        stop.set()
        busy.join()
