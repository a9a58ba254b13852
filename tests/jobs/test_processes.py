"""Items are done by processes that may raise, hang or die of them, each item once."""

import os
import threading
import time
from contextlib import closing

import psutil
import pytest

from overlapper.jobs import patience, processes, worker
from overlapper.jobs.executor import outcomes
from overlapper.jobs.hand import Done, Failed, Hand, Job
from overlapper.jobs.processes import Processes, cores
from overlapper.jobs.shares import Shares
from overlapper.jobs.worker import NotStarted


def job(setup="x"):
    return Job("jobs", "doing", setup)


def told(outcomes):
    """The value of each outcome, or its kind of failure and the sentence about it."""
    return [each.value[1] if isinstance(each, Done) else (each.what, each.sentence) for each in outcomes]


@pytest.fixture
def hand():
    with closing(Hand(job(), limit=1.0)) as hand:
        yield hand


def test_items_are_done_in_order_by_one_process_in_the_folder_of_whoever_asks(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with closing(Hand(job())) as hand:
        outcomes = [*hand.work([("give", k) for k in range(20)]), *hand.work([("give", 20)])]
    assert told(outcomes) == [*range(21)]
    assert {each.value[0] for each in outcomes} == {"x"}
    (place,) = {each.value[2:] for each in outcomes}
    assert place[0] != os.getpid() and place[1] == str(tmp_path)
    assert all(0 <= each.seconds < 5 for each in outcomes)


def test_an_item_that_raises_hangs_or_dies_stops_no_other_and_is_named(hand):
    items = [("give", 1), ("raise", "no\nmore"), ("give", 2), ("hang", 0), ("give", 3), ("hang in C", 0), ("abort", 0)]
    outcomes = [*hand.work([*items, ("exit", 3), ("give", 4)])]
    assert told(outcomes) == [
        *(1, ("raised", "ValueError: no"), 2, ("hung", "it took longer than 1 s"), 3),
        *(("hung", "it took longer than 1 s"), ("died", "its process ended with signal SIGABRT")),
        *(("raised", "SystemExit: 3"), 4),
    ]
    failures = [each for each in outcomes if isinstance(each, Failed)]
    assert all('jobs.py", line ' in each.traceback for each in failures)
    assert "ValueError: no\nmore" in failures[0].traceback


def test_the_error_names_the_failed_item(hand):
    (_, failed) = hand.work([("tell", "long ago"), ("abort", 0)])
    assert "long ago" not in failed.traceback


def test_an_item_whose_process_somebody_kills_is_done_again(hand, tmp_path):
    assert told(hand.work([("give", 1), ("die once", tmp_path / "died"), ("give", 2)])) == [1, tmp_path / "died", 2]


def test_a_process_that_is_killed_between_items_is_started_anew(hand):
    ((_, _, number, _),) = [each.value for each in hand.work([("give", 1)])]
    psutil.Process(number).kill()
    assert told(hand.work([("give", 2)])) == [2]


def test_a_job_that_cannot_be_prepared_is_refused():
    with (
        closing(Hand(job("never"))) as hand,
        pytest.raises(NotStarted, match=r"^a worker process could not be prepared: there is no such thing$"),
    ):
        [*hand.work([("give", 1)])]


def test_a_process_that_cannot_be_started_is_refused(monkeypatch):
    def lacking(*_, **__):
        raise OSError(12, "Cannot allocate memory")

    monkeypatch.setattr(worker.subprocess, "Popen", lacking)
    words = r"^a worker process could not be started \(.*Cannot allocate memory\)$"
    with pytest.raises(NotStarted, match=words):
        [*outcomes(Processes(2), job(), [("give", 1)])]


def test_a_process_ends_with_whoever_asked_it_even_while_it_hangs():
    hand = Hand(job())
    outcomes = hand.work([("give", 0), ("hang in C", 0)])

    def ask():
        numbers.append(next(outcomes).value[2])

    numbers: list[int] = []
    thread = threading.Thread(target=ask)  # whose end is that of whoever asks, for Linux
    thread.start()
    thread.join()
    _, alive = psutil.wait_procs([psutil.Process(numbers[0])] if psutil.pid_exists(numbers[0]) else [], 10)
    assert not alive or alive[0].status() == psutil.STATUS_ZOMBIE
    hand.close()


def test_all_items_are_done_once_by_all_processes():
    engine = Processes(2)
    items = [("raise", k) if k % 7 == 3 else ("give", k) for k in range(200)]
    found = [*outcomes(engine, job(), items)]
    assert sorted(number for number, _ in found) == [*range(200)]
    for number, outcome in found:
        assert isinstance(outcome, Failed) if number % 7 == 3 else outcome.value[1] == number
    assert len({outcome.value[2] for _, outcome in found if isinstance(outcome, Done)}) == 2
    assert Processes().workers == cores() >= 1
    assert [*outcomes(engine, job(), [])] == []


def test_an_item_that_takes_very_long_is_told_once(monkeypatch):
    monkeypatch.setattr(patience, "LATE", 0.5)
    monkeypatch.setattr(processes, "LOOK", 0.05)
    told = []
    items = [("give", 0), ("give", 1), ("sleep", 1.5), ("give", 3)]
    with closing(Processes(1).shares(job(), items, late=lambda *late: told.append(late))) as shares:
        assert sorted(number for numbers, _ in shares for number in numbers) == [0, 1, 2, 3]
    ((numbers, seconds),) = told
    assert numbers == [2] and 0.5 < seconds < 1.5


def test_stopping_early_leaves_no_process_behind():
    before = set(psutil.Process().children())
    found = outcomes(Processes(2), job(), [("give", 1)] + [("sleep", 30)] * 50)
    assert next(found)[0] == 0
    start = time.monotonic()
    found.close()
    assert time.monotonic() - start < 10 and set(psutil.Process().children()) <= before


def test_shares_are_of_about_so_many_seconds_and_small_near_the_end():
    shares = Shares(1000, takers=2, seconds=0.2)
    assert shares.take() == [0]  # before anything is known
    shares.learn(10, 0.02)
    assert shares.take() == [*range(1, 101)]
    shares.give_back([7, 8])
    sizes = []
    while share := shares.take():
        sizes.append(len(share))
    assert sum(sizes) == 901 and sizes[0] == 100 and sizes[-1] == 1
