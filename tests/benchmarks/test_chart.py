"""The chart of speed: its truths, its peers, and that a wrong volume of ours ends it while one of a peer is shown."""

import os
import time
from fractions import Fraction
from pathlib import Path

import exact
import families
import numpy as np
import pytest

from harness import bodies, command, peers, results, watched
from overlapper import HalfSpace, Hull, Placed, Sphere, overlap, penetration_depth
from overlapper.cli import bench
from speed import chart, groups, page, truth, turns, workloads

ROOT = Path(__file__).parents[2]


def test_the_sum_over_parts_is_the_exact_volume():
    a, b = families.icosphere(1) * 1.25, families.icosphere(1) + [0.5, 0.25, 0.125]
    assert len(truth.polytope(a).facets) == 80
    assert truth.SMALL < 80 * 80
    assert truth.common_volume(a, b) == exact.common(exact.hull(a), exact.hull(b)).volume


def test_qhull_triangles_are_used_only_if_they_form_a_convex_surface():
    cloud = [exact.point(p) for p in families.CORNERS]
    triangles = {ring: exact.plane_through(*ring) for ring in truth.exact.first_simplex(cloud[:3] + cloud[4:5])}
    assert not truth.is_convex(triangles, cloud)
    assert truth.polytope(families.CORNERS).volume == 8


def test_the_depth_is_that_of_the_exact_difference():
    for seed in range(4):
        a, b = families.make("general", seed).bodies
        square = exact.depth_squared(exact.hull(a), exact.hull(b))
        assert abs(truth.depth(a, b) ** 2 - square) < Fraction(1, 10**35)
    assert truth.depth(families.CORNERS, families.CORNERS + 3) == 0


ROUND = [name for name in workloads.FAMILIES if workloads.pairs_of(name)[0].volume_of_round is not None]


@pytest.mark.parametrize("family", ROUND)
def test_round_shapes_have_the_volume_and_depth_of_their_truth(family):
    for pair in workloads.pairs_of(family)[:1]:
        found = overlap(*pair.bodies)
        assert abs(Fraction(found.volume) - pair.volume) <= found.volume_error + pair.volume_within
        assert found.volume_error < 1e-2 * found.volume and pair.volume_within < 1e-14 * found.volume
        if pair.depth is not None:
            assert penetration_depth(*pair.bodies) == pytest.approx(float(pair.depth), rel=1e-12)


def test_points_are_counted_inside_of_every_kind_of_shape():
    rng = np.random.default_rng(0)
    for family in ("balls", "ball on ground", "crossing cylinders", "tetra", "two capsules", "ellipsoid and hull"):
        pair = workloads.pairs_of(family)[0]
        lower, upper = bodies.box_of_both(pair.bodies)
        where = lower[:, None] + (upper - lower)[:, None] * rng.random((3, 20))
        for body in pair.bodies:
            kept = bodies.inside_test(body)(where)
            speck = Sphere(1e-9)
            assert kept.shape[1] == sum(bool(overlap(Placed(speck, point), body)) for point in where.T)


@pytest.mark.parametrize("family", ["ball and box", "two capsules", "ellipsoid and hull", "meshes with margins"])
def test_tessellations_converge_from_below_with_segments(family):
    pair = workloads.pairs_of(family)[0]
    volumes = [overlap(*(bodies.points(body, n) for body in pair.bodies)).volume for n in (8, 32)]
    assert volumes[0] < volumes[1] < pair.volume
    assert volumes[1] == pytest.approx(float(pair.volume), rel=2e-2)


def test_strobl_s_package_gets_the_corners_in_its_own_order():
    ball = Placed(Sphere(0.7), (0.1, 0.2, 0))
    elements = [families.TETRA, families.TETRA[[1, 0, 2, 3]]]
    pairs = [workloads.Pair(ball, Placed(Hull(some)), workloads.by_slices) for some in elements]
    for pair in pairs + workloads.pairs_of("ball and box")[:3]:
        assert peers.strobl(pair.bodies, None)() == pytest.approx(float(pair.volume), rel=1e-12)


def test_estimates_converge_with_samples_and_pitch():
    pair = workloads.pairs_of("box deep")[0]
    for name, setting in (("Monte Carlo", 100_000), ("voxels", 32)):
        found = peers.PEERS["volume"][name].prepare(pair.bodies, setting)()
        assert found == pytest.approx(float(pair.volume), rel=2e-2)


@pytest.mark.parametrize("name", ["auto", "auto, batch", "auto, warm batch", "paper", "scipy"])
def test_exact_methods_are_exact_on_a_family_of_polyhedra(name):
    pairs = workloads.pairs_of("tetra")[:3]
    _, count, error, _ = turns.first_answers(pairs, name, peers.TIMED[name].settings[0])
    assert count == 3 and float(error) < 1e-9


def test_a_peer_that_cannot_be_asked_says_why():
    slanted = workloads.Pair(Placed(Sphere(1)), Placed(HalfSpace([1, 1, 1], 0)), Fraction(1))
    with pytest.raises(bodies.Unfit, match="slanted"):
        bodies.bounded(slanted.bodies)
    with pytest.raises(bodies.Unfit, match="round"):
        peers.r3d(slanted.bodies, None)
    margins = workloads.pairs_of("meshes with margins")[0]
    for asked in (peers.monte_carlo, peers.paper):
        with pytest.raises(bodies.Unfit, match="rounded hull"):
            asked(margins.bodies, 10)


def test_strobl_s_package_is_asked_for_what_it_knows():
    with pytest.raises(bodies.Unfit, match="balls with"):
        peers.strobl(workloads.pairs_of("two capsules")[0].bodies, None)


def test_threads_of_a_peer_s_own_are_timed_by_the_clock_in_a_process_that_has_all_processors():
    pairs = workloads.pairs_of("box deep")[:2]
    rows = turns.rows_of("box deep", pairs, ["auto", "manifold3d, by the clock"], 0.1)
    assert [row.method for row in rows] == ["auto"] * 3 + ["manifold3d, by the clock"]
    assert float(rows[-1].us) > 0 and float(rows[-1].error) < 1e-12
    words = page.text(page.Results("", ["here, 2 cores"], rows, [])).split()
    assert "its wall-clock time on 2 processors" in " ".join(words)


def test_a_wrong_volume_of_ours_is_noticed():
    pairs = workloads.pairs_of("box deep")[:1]
    turns.check_ours("box deep", pairs)
    pairs[0].__dict__["volume"] = pairs[0].volume * (1 + Fraction(1, 10**11))
    with pytest.raises(command.Wrong, match=r"box deep 0: .* truly"):
        turns.check_ours("box deep", pairs)


def test_a_wrong_volume_of_ours_ends_the_run_and_what_was_measured_is_kept(tmp_path, monkeypatch, capsys):
    def rows_of(family, pairs, methods, seconds):
        if family == "tetra":
            raise command.Wrong("tetra 3: 1.0, truly 2.0")
        return [turns.Row(family, len(pairs), "auto", "", "volume", us="1.5", error="0.00e+00")]

    monkeypatch.setattr(chart, "rows_of", rows_of)
    assert command.main(["chart", "--family=box deep", "--family=tetra", f"--out={tmp_path}"]) == 1
    assert capsys.readouterr().err.endswith("overlapper: wrong: tetra 3: 1.0, truly 2.0\n")
    assert [row["family"] for row in results.read(tmp_path / "speed.csv")[1]] == ["box deep"]


def test_a_wrong_volume_of_a_peer_is_its_error(monkeypatch):
    pairs = workloads.pairs_of("box deep")
    pairs[0].__dict__["volume"] = pairs[0].volume * 2
    monkeypatch.setattr(turns, "on_one_processor", lambda: None)
    assert turns.first_answers(pairs, "paper", None)[2] == "5.00e-01"


# Peers that fail; functions of this module, so that another process can import them.


def is_not_installed(bodies, setting):
    import a_package_that_nobody_has  # noqa: F401


def raises(bodies, setting):
    raise ZeroDivisionError


def aborts(bodies, setting):
    os.abort()


class Here:
    """In the place of a watched process: the peers of this process are asked."""

    def __init__(self, function, *_):
        self.function = function

    def __enter__(self):
        return self

    def __exit__(self, *_): ...

    def ask(self, *arguments):
        try:
            return self.function(*arguments)
        except ZeroDivisionError as error:
            return f"raises {type(error).__name__}"


def test_missing_slow_and_failing_peers_are_named(monkeypatch):
    for name, prepare in (("missing", is_not_installed), ("failing", raises)):
        monkeypatch.setitem(peers.TIMED, name, peers.Peer(prepare))
    monkeypatch.setitem(peers.TIMED, "slow", peers.Peer(peers.auto, (1e-1, 1e-2)))
    monkeypatch.setattr(turns, "Watched", Here)
    monkeypatch.setattr(turns, "on_one_processor", lambda: None)
    monkeypatch.setattr(turns, "DEAR", 0.0)
    pairs = workloads.pairs_of("box deep")[:1]
    rows = turns.rows_in_turn("box deep", pairs, [{}], ["missing", "failing", "paper", "slow"], 0.001)
    assert [row.note for row in rows[:4]] == ["missing: a_package_that_nobody_has", "raises ZeroDivisionError", "", ""]
    assert rows[4].note.startswith("not asked: 0.1 takes ")
    assert [bool(row.us) for row in rows] == [False, False, True, True, False]


def test_a_process_that_takes_too_long_is_named_by_its_processor_time():
    with watched.Watched(busy, 0.2, (0.0,), patience=20.0) as process:
        assert process.ask(60.0) == "not waited for beyond 0.2 s"


def busy(seconds):
    begin = time.perf_counter()
    while time.perf_counter() < begin + seconds:
        pass


def test_the_command_writes_results_page_and_charts(tmp_path):
    methods = ["auto", "auto, batch", "paper", "manifold3d"]
    asked = [f"--method={name}" for name in methods]
    assert command.main(["chart", "--family=box deep", "--seconds=0.01", f"--out={tmp_path}", *asked]) == 0
    notes, rows = results.read(tmp_path / "speed.csv")
    assert "overlapper" in notes[0]
    assert {row["method"] for row in rows} == set(methods)
    assert all(row["us"] or row["note"].startswith("missing: ") for row in rows)
    ours = [row for row in rows if row["method"].startswith("auto")]
    assert all(float(row["us"]) > 0 and float(row["error"]) < 1e-12 for row in ours)
    text = (tmp_path / "speed.md").read_text(encoding="utf-8")
    assert "speed_families.png" in text
    written = {path.name for path in tmp_path.iterdir()}
    assert {"speed.png", "speed_families.png"} <= written


def test_a_peer_is_one_line_for_all_charts(monkeypatch):
    assert {"scipy", "overlap", "trimesh"} <= set(peers.hard_cases("volume")) & set(peers.TIMED)
    assert "auto, batch" not in peers.hard_cases("volume") and "voxels" not in peers.hard_cases("volume")
    monkeypatch.setitem(peers.PEERS["volume"], "new", peers.Peer(peers.paper))
    assert "new" in peers.hard_cases("volume")
    assert peers.HardCase("volume", "new")(families.CORNERS, families.CORNERS + 1.0) == 1.0
    assert peers.HardCase("volume", "overlap")(families.CORNERS, families.CORNERS + 1.0) == peers.NOT_ASKED


def test_time_over_size_names_its_power(tmp_path):
    times = {80: 1.0, 320: 4.0, 1280: 32.0, 5120: 256.0}
    rows = [turns.Row(f"i{n} deep", 1, "auto", "0.001", "volume", us=str(us)) for n, us in times.items()]
    rows += [turns.Row("i80 shallow", 1, "paper", "", "volume", us="3")]
    deep, shallow = (page.by_size(rows, way) for way in ("deep", "shallow"))
    assert deep.powers["auto"] == pytest.approx(1.5)
    assert shallow.powers == {}
    (line,) = page.growth_panel(deep, {}).series
    assert line.label == "auto, 1.50"
    page.growth([deep, shallow], tmp_path / "sizes.png")
    assert (tmp_path / "sizes.png").stat().st_size > 10_000


def test_many_bodies_are_timed_by_each_peer(monkeypatch):
    monkeypatch.setattr(groups, "COUNTS", (2, 4))
    monkeypatch.setattr(groups, "ASKED", ("paper", "auto"))
    rows = list(groups.measured(0.01))
    assert [(row.method, row.bodies) for row in rows] == [("paper", 2), ("auto", 2), ("paper", 4), ("auto", 4)]
    assert all(float(row.us) > 0 and float(row.error) < 1e-12 for row in rows)


def test_a_wrong_volume_of_many_bodies_ends_the_run(monkeypatch):
    monkeypatch.setattr(groups, "error_of", lambda *_: 1e-6)
    with pytest.raises(command.Wrong, match="2 bodies: auto is off by"):
        next(groups.measured(0.01))


def test_the_page_says_what_the_committed_results_say():
    (path,) = (ROOT / "benchmarks" / "results").glob("*/speed.csv")
    found = page.results_in(path.parent)
    assert len(found.rows) > 100
    assert {row.method for row in found.rows} == set(peers.TIMED)
    assert (ROOT / "docs" / "speed.md").read_text(encoding="utf-8") == page.text(found)


def test_time_over_the_number_of_bodies_names_its_power():
    rows = [groups.Row("paper", 32, count, f"{100 * count}", "0") for count in (8, 16, 32)]
    assert page.by_number(rows).powers == {"paper": pytest.approx(1.0)}


def test_without_a_checkout_the_command_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr(bench, "__file__", str(tmp_path / "overlapper" / "cli" / "bench.py"))
    with pytest.raises(bench.Refused, match="chart needs a checkout"):
        bench.chart()
