"""The search for inputs that take time out of proportion to their size."""

import numpy as np
import pytest

from harness import command
from speed import growth
from speed.growth import FAMILIES, QUESTIONS, Input, changed, searched, seconds

CONE = Input("cone", "hull")


def taking(time_of):
    return lambda given, n: (time_of(given, n), 2 * n)


def test_the_exponent_is_that_of_the_last_sizes():
    found = growth.growth(CONE, taking(lambda _, n: 1e-9 * n**2), 8000)
    assert found.exponent == pytest.approx(2)
    assert not found.too_steep  # as it takes no time worth to be spoken of
    slow = growth.growth(CONE, taking(lambda _, n: 1e-8 * n**2), 8000)
    assert slow.too_steep and list(slow.times) == [1000, 2000, 4000, 8000]
    assert "n^2.00" in slow.line()
    assert not growth.growth(CONE, taking(lambda _, n: 1e-4 * n), 8000).too_steep
    assert growth.growth(CONE, taking(lambda _, n: 1.0 * n), 8000).exponent == 0  # of one size nothing is known


def test_slow_cases_are_not_made_larger():
    assert list(growth.growth(CONE, taking(lambda _, n: n * 2e-3), 10**9).times) == [1000, 2000]


def test_endless_cases_are_reported_and_flat_growth_is_not():
    late = growth.growth(CONE, lambda _, n: "hang" if n > 2000 else (1e-3, n), 8000)
    assert late.too_steep and late.line().endswith("hang at 4000 points")
    assert not growth.growth(CONE, lambda *_: "raises ValueError", 8000).too_steep


def test_the_search_keeps_the_worse_input():
    ask = taking(lambda given, n: 1e-4 * n * (n / 1000 if given.noise else 1))
    start = [growth.growth(CONE, ask, 8000)]
    better = list(searched(start, 50, 0, ask, 8000))
    assert better and all(each.given.noise for each in better)
    assert list(searched([], 50, 0, ask, 8000)) == []


def test_every_property_of_an_input_is_mutated():
    rng = np.random.default_rng(0)
    others = [changed(CONE, rng) for _ in range(100)]
    for name in ("away", "turn", "stretch", "noise", "seed"):
        assert any(getattr(other, name) != getattr(CONE, name) for other in others)


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("ask", QUESTIONS)
def test_every_question_is_asked_of_every_family(family, ask):
    spent, facets = seconds(Input(family, ask), 64)
    assert spent >= 0 and facets >= 4


def test_the_command_prints_a_line_each_and_fails_if_one_is_too_steep(monkeypatch, capsys):
    arguments = [
        "growth",
        "--family",
        "cone",
        "--family",
        "prism",
        "--ask",
        "hull",
        "--largest",
        "2000",
        "--rounds",
        "2",
    ]
    assert command.main(arguments) == 0
    assert "0 of 2 grow faster" in capsys.readouterr().out
    monkeypatch.setattr(growth, "WORTH_TIMING", 0.0)
    monkeypatch.setattr(growth, "MOST_EXPONENT", 0.0)
    assert command.main(arguments) == 1
    assert " grow faster than n^0.0:" in capsys.readouterr().out
