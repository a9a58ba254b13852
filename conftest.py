"""`pytest --record` writes the expected files of the scenes anew, to be looked at before they are committed."""

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--record", action="store_true", help="write scenes/expected/*.csv anew, budgets kept")
