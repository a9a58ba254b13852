"""The status of rounded hulls: they overlap if their cores are nearer to each other than the radii reach together."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from strategies import directions

from overlapper import Hull, Placed, RoundedHull, distance, overlap

HALF_ULP = 2.0**-53


def bodies(rng: np.random.Generator, count: int) -> list[tuple[Hull, RoundedHull]]:
    """Cores and what is rounded of them: round, flat and needle-like, of 1e-2 to 30 m, of any radius beside that."""
    made = []
    for _ in range(count):
        size = float(rng.choice([1, 1, 1e-2, 30]))
        points = size * rng.normal(size=(int(rng.integers(4, 20)), 3)) * rng.uniform(0.3, 1, 3)
        points *= rng.choice([[1, 1, 1], [1, 1, 1], [1, 1, 1e-3], [1, 1e-2, 1e-2]])
        radius = float(np.abs(points).max() * rng.choice([1e-3, 1e-2, 0.1, 0.5, 2]))
        made.append((Hull(points), RoundedHull(points, radius)))
    return made


def false_statuses(seed: int, count: int) -> Iterator[str]:
    """Describes each of `count` random pairs whose status contradicts the distance of their cores, beyond rounding."""
    rng = np.random.default_rng(seed)
    made = bodies(rng, 400)
    for _ in range(0, count, 8):
        (core_a, a), (core_b, b) = (made[i] for i in rng.integers(len(made), size=2))
        turns, u, away = rng.normal(size=(2, 4)), directions(rng, 1)[0], rng.normal(size=3) * rng.choice([0, 1, 100])
        sizes = [float(np.abs(core.vertices).max()) for core in (core_a, core_b)]
        far = 8 * sum(sizes)
        apart = overlap(Placed(core_a, away, turns[0]), Placed(core_b, away + far * u, turns[1]))
        reach = a.radius + b.radius
        room = 1e-12 * min(sizes[0] + a.radius, sizes[1] + b.radius)
        room += 128 * HALF_ULP * (float(np.abs(away).max()) + far)
        for _ in range(8):
            wanted = reach * (1 - rng.choice([1, 1, 1, -1]) * 10.0 ** rng.uniform(-11, -0.3))
            place = away + far * u + (apart.distance - wanted) * apart.normal
            gap = distance(Placed(core_a, away, turns[0]), Placed(core_b, place, turns[1])) - reach
            status = overlap(Placed(a, away, turns[0]), Placed(b, place, turns[1])).status
            expected = "overlapping" if gap < -room else "separated" if gap > room else status
            if status != expected:
                yield f"{status}, with cores {gap:.3g} m beyond the reach of their radii: {a}, {b}"


def test_rounded_hulls_overlap_where_their_cores_are_nearer_than_the_radii_reach():
    assert not list(false_statuses(7, 20000))


def test_a_false_status_is_named(monkeypatch):
    monkeypatch.setitem(globals(), "distance", lambda *_: 1e9)
    assert "overlapping, with cores 1e+09 m beyond" in next(false_statuses(7, 64))
