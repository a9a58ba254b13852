"""The status of rounded hulls."""

import rounded_pairs


def test_rounded_hulls_overlap_where_their_cores_are_nearer_than_the_radii_reach():
    assert not list(rounded_pairs.false_statuses(7, 20000))


def test_a_false_status_is_named(monkeypatch):
    monkeypatch.setattr(rounded_pairs, "distance", lambda *_: 1e9)
    assert "overlapping, with cores 1e+09 m beyond" in next(rounded_pairs.false_statuses(7, 64))
