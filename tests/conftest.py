"""Hypothesis draws the same examples on every run; `--hypothesis-profile=explore` looks further, with new ones."""

import importlib.util
import signal
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

SLOW = [HealthCheck.too_slow]  # a busy machine may be slow
settings.register_profile(
    "same", deadline=None, derandomize=True, database=None, max_examples=40, suppress_health_check=SLOW
)
settings.register_profile("explore", deadline=None, max_examples=2000, suppress_health_check=SLOW)
settings.load_profile("same")


# Tests send Ctrl-C. A process that a shell started in the background ignores it, so the handler is set again.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

HERE = Path(__file__).parent

# `make test-torch` runs these, in an environment of its own with torch.
collect_ignore = [] if importlib.util.find_spec("torch") else ["with_torch"]


def pytest_addoption(parser):
    parser.addoption("--every", type=positive, default=1, help="run only each N-th case of a parametrized test")


def positive(text):
    """The number. argparse reports a number below 1."""
    if int(text) < 1:
        raise ValueError(text)
    return int(text)


def pytest_collection_modifyitems(config, items):
    """Keeps each N-th case, and turns off coverage for tests of the core: it slows down exact arithmetic by a half."""
    seen = Counter()
    for item in list(items):
        test = item.nodeid.partition("[")[0]
        if seen[test] % config.getoption("every"):
            items.remove(item)
        seen[test] += 1
    for item in items:
        if item.path.is_relative_to(HERE / "native") or item.path.is_relative_to(HERE / "support"):
            item.add_marker("no_cover")


@pytest.fixture
def client():
    """A client of pybullet without a window; the test may disconnect it itself."""
    import pybullet as p  # only here, as it says on import when it was built

    client = p.connect(p.DIRECT)
    yield client
    if p.isConnected(client):
        p.disconnect(client)


@pytest.fixture
def recorder(client):
    from overlapper.simulation import Recorder

    with Recorder(client) as recorder:
        yield recorder
