import pytest
from browser import Browser
from pages import hand_at, recorded


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    browser = Browser(tmp_path_factory.mktemp("profile"))
    yield browser
    browser.close()


@pytest.fixture(scope="module")
def reach(tmp_path_factory):
    """A recording of two frames, apart and overlapping."""
    return recorded([hand_at(0.3), hand_at(0.12)], tmp_path_factory.mktemp("reach") / "hand.html")
