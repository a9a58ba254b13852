"""The page of speed and its charts, from the results files and nothing else."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from harness import results
from harness.page import duration, filled, indented, named, table
from harness.peers import PEERS
from paper.claims import VERTICES, Claim
from speed.figures import Growth, accuracy, growth, start
from speed.turns import Row
from speed.workloads import FAMILIES, SIZES

# The panels of the first chart that the README shows.
CHOSEN = [
    "box deep", "box on ground", "h50", "i1280 shallow", "i5120 deep", "box sliver", "ball at box corner",
    "crossing cylinders",
]  # fmt: skip

# Times as fast as manifold3d on meshes made before, for a single call and for a pair of a batch: what was aimed at.
TARGETS: dict[str, tuple[float, float | None]] = {
    "box deep": (60, 110),
    "box sliver": (40, 80),
    "box on ground": (30, 80),
    "tetra": (30, 80),
    "h20": (20, None),
    "h50": (18, None),
    "h100": (10, None),
    "h500": (6, None),
    "i320 deep": (5, None),
    "i320 shallow": (15, None),
    "i1280 deep": (4, None),
    "i1280 shallow": (25, None),
    "i5120 deep": (3, None),
    "i5120 shallow": (35, None),
    "prism 64 and box": (60, None),
}

# Beyond this, a method that has no setting for its accuracy is wrong, not inexact.
WRONG = 1e-6


@dataclass(frozen=True)
class Results:
    """All that was measured, and the folder that it was read from, as the page names it."""

    folder: str
    notes: list[str]
    rows: list[Row]
    claims: list[Claim]
    steps: bool  # whether the steps of a simulation were measured, too
    round: bool  # and all classes of round bodies


def results_in(folder: Path) -> Results:
    notes, rows = results.read(folder / "speed.csv")
    there = {name: (folder / f"{name}.csv").exists() for name in ("claims", "steps", "round")}
    claims = results.read(folder / "claims.csv")[1] if there["claims"] else []
    made = [Row(**row) for row in rows], [Claim(**claim) for claim in claims]
    return Results(str(named(folder)), notes, *made, there["steps"], there["round"])


def write_page(path: Path, folder: Path) -> Path:
    found = results_in(path.parent)
    start()
    at_hand = {row.family for row in found.rows}
    families = [name for name in FAMILIES if name in at_hand]
    if families:
        accuracy(found.rows, [name for name in CHOSEN if name in at_hand] or families, 4, folder / "speed.png")
        accuracy(found.rows, families, 4, folder / "speed_families.png", folder / "speed.html")
    by_size, by_claim = panels(found)
    if all(panel.lines for panel in by_size):
        growth(by_size, folder / "speed_sizes.png")
    if found.claims:
        growth(by_claim, folder / "speed_claims.png")
    page = folder / "speed.md"
    page.write_text(text(found), encoding="utf-8")
    return page


def panels(found: Results) -> tuple[list[Growth], list[Growth]]:
    """The panels of the chart of time over size, and those of the article's claims."""
    by_size = [sizes(found.rows, way) for way in ("deep", "shallow")]
    return by_size, [of_pairs(found.claims), of_groups(found.claims)]


def find(rows: Iterable[Row], family: str, method: str, setting: str | None = None) -> Row | None:
    """The row that has a time; the first if no setting is named."""
    found = (row for row in rows if row.family == family and row.method == method and row.us)
    return next((row for row in found if setting in (None, row.setting)), None)


def best(rows: Iterable[Row], family: str, method: str) -> Row | None:
    """At the setting that is a method's default or needs least to be done."""
    setting = {"auto": "0.001", "manifold3d": "prebuilt", "scipy": "point given"}.get(method)
    return find(rows, family, method, setting)


# Time over size


def sizes(rows: list[Row], way: str) -> Growth:
    lines = {}
    for name in ("auto", "auto, batch", "paper", "scipy", "manifold3d", "trimesh"):
        found = [(size, best(rows, f"i{size} {way}", name)) for size in SIZES]
        lines[name] = [(float(size), float(row.us)) for size, row in found if row]
    lines = {name: points for name, points in lines.items() if points}
    return Growth(way, "facets of either mesh", lines, powers_of(lines, 320))


def of_pairs(claims: list[Claim]) -> Growth:
    return of_claim(claims, "pair", "a pair", "vertices of either body", "vertices", 50)


def of_groups(claims: list[Claim]) -> Growth:
    return of_claim(claims, "bodies", f"many bodies of {VERTICES} vertices", "bodies", "bodies", 8)


def of_claim(claims: list[Claim], name: str, title: str, along: str, size: str, least: float) -> Growth:
    lines: dict[str, list[tuple[float, float]]] = {}
    for claim in claims:
        if claim.claim == name:
            lines.setdefault(claim.way, []).append((float(getattr(claim, size)), float(claim.us)))
    return Growth(title, along, lines, powers_of(lines, least))


def powers_of(lines: dict[str, list[tuple[float, float]]], least: float) -> dict[str, float]:
    """The power of the size with which time grows, fitted from a size on to at least three points."""
    fitted = {}
    for name, points in lines.items():
        large = [point for point in points if point[0] >= least]
        if len(large) > 2:
            x, y = np.log(large).T
            fitted[name] = float(np.polyfit(x, y, 1)[0])
    return fitted


# Words


def text(found: Results) -> str:
    by_size, by_claim = panels(found)
    rows = found.rows
    pairs = {row.family: int(row.pairs) for row in rows if row.method == "auto"}
    parts = {
        "families": str(len(pairs)),
        "pairs": str(sum(pairs.values())),
        "targets": targets(rows),
        **clocks(found),
        "wrong": wrong(rows),
        "powers": power_table(by_size),
        "per_facet": per_facet(rows),
        "warm": warm(rows),
        "depths": depths(rows),
        "missing": missing(rows),
        "results": found.folder,
        "notes": indented(found.notes),
        "round": ROUND if found.round else "This was not measured.",
        "steps": STEPS if found.steps else "This was not measured.",
        "claims": claims_text(found.claims, *by_claim) if found.claims else "They were not measured.",
    }
    return filled(Path(__file__).with_name("page.md"), **parts)


STEPS = """[Where the time of a step goes](steps.md) is a page of its own: piles of boxes, beside pybullet's own step.

![Time of a step per box, by its parts, and of the whole, over the number of boxes](steps.png)"""

ROUND = """[Round bodies beside boxes](round.md) is a page of its own: every two kinds of shapes, in single calls and in
batches, meshes with margins, and scenes.

![The median and the slowest hundredth of every class of pairs, over the time of a call](round.png)"""


def claims_text(claims: list[Claim], pair: Growth, groups: Growth) -> str:
    def power(panel: Growth, name: str) -> str:
        return f"{panel.powers[name]:.2f}" if name in panel.powers else "?"

    def last(panel: Growth, name: str) -> str:
        return duration(panel.lines[name][-1][1])

    most, bodies = pair.lines["paper"][-1][0], groups.lines["paper"][-1][0]
    n_log_n = 1 + np.log(np.log(most) / np.log(50)) / np.log(most / 50)
    return filled(
        Path(__file__).with_name("claims.md"),
        most=f"{most:,.0f}",
        bodies=f"{bodies:.0f}",
        n_log_n=f"{n_log_n:.2f}",
        pair_holds=holds(pair.powers.get("paper"), n_log_n),
        groups_hold=holds(groups.powers.get("paper"), 1.0),
        auto_group=last(groups, "auto"),
        paper_group=last(groups, "paper"),
        paper=power(pair, "paper"),
        paper_m=power(groups, "paper"),
        auto_m=power(groups, "auto"),
        cutting=power(pair, "cutting"),
        duality=power(pair, "duality"),
        auto_pair=last(pair, "auto"),
        paper_pair=last(pair, "paper"),
        one_hull=last(groups, "one hull"),
        tree=last(groups, "tree"),
        cores=cores(claims),
    )


def holds(measured: float | None, claimed: float) -> str:
    """To a tenth, which is what times at so few sizes can tell."""
    return "it cannot be told" if measured is None else "it holds" if measured < claimed + 0.1 else "it does not hold"


def cores(claims: list[Claim]) -> str:
    times: dict[tuple[int, int], list[float]] = {}
    for claim in claims:
        if claim.claim == "cores":
            times.setdefault((claim.bodies, claim.vertices), []).append(float(claim.us))
    lines = [
        [f"{bodies} bodies of {vertices} vertices", *map(duration, us), f"{us[0] / us[-1]:.2f}"]
        for (bodies, vertices), us in times.items()
    ]
    return table(["", "one core", "two cores", "times faster"], lines)


BY_CLOCK = "manifold3d, by the clock"


def clocks(found: Results) -> dict[str, str]:
    """On how many processors the clock was read, and how much slower one of them made manifold3d at most."""
    ratios = {
        f"{row.family}{f', {row.setting} segments' if row.setting.isdigit() else ''}": float(bound.us) / float(row.us)
        for row in found.rows
        if row.method == BY_CLOCK
        and row.us
        and float(row.us) >= 1e3
        and (bound := find(found.rows, row.family, "manifold3d", row.setting))
    }
    cores = re.search(r"(\d+) cores", " ".join(found.notes))
    worst = max(ratios, key=lambda name: ratios[name], default="none, as it was not asked")
    return {
        "processors": cores[1] if cores else "its",
        "slower": f"{ratios.get(worst, 1.0):.1f}",
        "slower_at": worst,
    }


def targets(rows: list[Row]) -> str:
    lines = []
    for family, (aim, aim_batch) in TARGETS.items():
        peer, alone, many = (best(rows, family, name) for name in ("manifold3d", "auto", "auto, batch"))
        if not (peer and alone):
            continue
        clock = find(rows, family, BY_CLOCK, "prebuilt")
        cells = [family, duration(float(peer.us)), duration(float(clock.us)) if clock else ""]
        cells += [duration(float(alone.us)), held(peer, alone, aim)]
        cells += [duration(float(many.us)), held(peer, many, aim_batch)] if many else ["", ""]
        lines.append(cells)
    return table(
        ["", "manifold3d", "by the clock", "a call", "times faster (aim)", "a pair of a batch", "times faster (aim)"],
        lines,
    )


def held(peer: Row, ours: Row, aim: float | None) -> str:
    """Times faster, in bold where it reaches the aim."""
    ratio = float(peer.us) / float(ours.us)
    said = f"{ratio:.0f}" if ratio >= 10 else f"{ratio:.1f}"
    if aim is None:
        return said
    return f"**{said}** ({aim:g})" if ratio >= aim else f"{said} ({aim:g})"


def depths(rows: list[Row]) -> str:
    times = ((family, find(rows, family, "auto, depth")) for family in TARGETS)
    return ", ".join(f"{family} {duration(float(row.us))}" for family, row in times if row)


def warm(rows: list[Row]) -> str:
    lines = []
    for family in [*TARGETS, "boxes apart"]:
        cold, again = best(rows, family, "auto, batch"), best(rows, family, "auto, warm batch")
        if cold and again:
            ratio = float(cold.us) / float(again.us)
            lines.append([family, duration(float(cold.us)), duration(float(again.us)), f"{ratio:.2f}"])
    return table(["", "first call", "the next, a little moved", "times faster"], lines)


def wrong(rows: list[Row]) -> str:
    """The peers that answered beside the truth at a setting that promises exact answers."""
    off: dict[str, list[Row]] = {}
    for row in rows:
        exact = row.facets and (row.method not in PEERS["volume"] or PEERS["volume"][row.method].exact)
        if row.error and exact and float(row.error) > WRONG:
            off.setdefault(" ".join(filter(None, (row.method, row.setting))), []).append(row)
    if not off:
        return "Among the polyhedra, nobody is off by more than 1e-6."
    lines = []
    for name, found in sorted(off.items(), key=lambda item: -max(float(row.error) for row in item[1])):
        worst = sorted(found, key=lambda row: -float(row.error))
        said = ", ".join(f"{row.family} {float(row.error):.0e}" for row in worst[:4])
        lines.append([name, str(len(found)), said + (", ..." if len(worst) > 4 else "")])
    return table(["", "families", "relative error, the worst first"], lines)


def power_table(panels: list[Growth]) -> str:
    names = dict.fromkeys(name for panel in panels for name in panel.powers)
    lines = [[name, *(f"{p.powers[name]:.2f}" if name in p.powers else "" for p in panels)] for name in names]
    return table(["time grows with the facets to the power of", *(panel.title for panel in panels)], lines)


def per_facet(rows: list[Row]) -> str:
    """The cost of a facet of the answer in shallow pairs, over the size of the meshes."""
    lines = []
    for size in SIZES:
        alone, many = (best(rows, f"i{size} shallow", name) for name in ("auto", "auto, batch"))
        if alone and many:
            facets = float(alone.facets)
            costs = [f"{float(row.us) / facets:.2f} µs" for row in (alone, many)]
            lines.append([f"{size:,}", f"{facets:.3g}", *costs])
    return table(["facets of either mesh", "facets in common", "a facet, by a call", "by a batch"], lines)


def missing(rows: list[Row]) -> str:
    found: dict[tuple[str, str], tuple[dict[str, None], dict[str, None]]] = {}
    for row in rows:
        if row.note and not row.us:
            settings, families = found.setdefault((row.method, row.note), ({}, {}))
            settings[row.setting], families[row.family] = None, None
    lines = [
        f"- {method} {', '.join(settings)}: {note} ({', '.join(families)})".replace(" :", ":")
        for (method, note), (settings, families) in sorted(found.items())
    ]
    return "\n".join(lines) or "Everybody was asked everything."
