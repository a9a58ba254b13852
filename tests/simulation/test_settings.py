"""Settings are checked when they are made."""

import re

import pytest

from overlapper.simulation.settings import Asking, Modelling


@pytest.mark.parametrize(
    ("kind", "given", "message"),
    [
        (Asking, {"pairs": "most"}, "pairs must be 'simulated', 'all' or a list of pairs, not 'most'"),
        (Asking, {"pairs": 3}, "pairs must be 'simulated', 'all' or a list of pairs, not 3"),
        (Asking, {"pairs": [(1, 2, 3)]}, "pairs must be 'simulated', 'all' or a list of pairs, not [(1, 2, 3)]"),
        (Asking, {"tolerance": 1}, "tolerance must be a number greater than 0 and less than 1, not 1"),
        (Asking, {"tolerance": "fine"}, "tolerance must be a number greater than 0 and less than 1, not 'fine'"),
        (Asking, {"method": "best"}, "method must be one of 'auto', 'paper', not 'best'"),
        (Modelling, {"concave": "drop"}, "concave must be one of 'decompose', 'enclose', 'skip', not 'drop'"),
        (Modelling, {"surface": "rough"}, "surface must be one of 'nominal', 'margin', not 'rough'"),
        (Modelling, {"concave_threshold": 2}, "the concavity threshold must lie between 0.01 and 1, not 2"),
    ],
)
def test_an_invalid_setting_is_refused_in_one_sentence(kind, given, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        kind(**given)


def test_an_iterator_of_pairs_is_read_once():
    assert Asking(iter([("a", "b")])).pairs == [("a", "b")]
