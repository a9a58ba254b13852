"""The page about IoU of boxes, docs/boxes.md, from the results file."""

from __future__ import annotations

from pathlib import Path

from harness import results
from harness.page import duration, named, table, times, write

TRUE = {"#1054": "1/7", "#1082": "0.944907", "#1429": "0.887689", "#1551": "1"}


def beside(path: Path, name: str) -> Path:
    """The results file of that name: beside another one, or that of this machine."""
    return path.with_name(name) if path.with_name(name).exists() else results.of_machine(name)


def million(path: Path) -> tuple[dict[str, object], str]:
    """The figures of a million pairs, and their table."""
    _, rows = results.read(path)
    found: dict[tuple[str, str], dict[str, float]] = {}
    for row in rows:
        found.setdefault((row["rotation"], row["offset"]), {})[row["figure"]] = float(row["value"])
    offsets = list(dict.fromkeys(offset for _, offset in found))
    lines = []
    for offset in offsets:
        both = [each for (_, of), each in found.items() if of == offset]
        total = {name: sum(each[name] for each in both) for name in ("pairs", "overlapping", "above", "proved")}
        worst = {name: max(each[name] for each in both) for name in ("stated", "off")}
        lines.append(
            [
                offset,
                f"{total['pairs']:,.0f}",
                f"{total['overlapping']:,.0f}",
                f"{worst['stated']:.0e}",
                f"{total['above']:.0f}",
                f"{total['proved']:,.0f}",
                f"{worst['off']:.0e}",
            ]
        )
    figures = {name: sum(each[name] for each in found.values()) for name in ("pairs", "proved", "above")}
    figures["off"] = max(each["off"] for each in found.values())
    heading = ["offset", "pairs", "overlapping", "largest stated", "> 1e-12", "proved", "largest proved"]
    return figures, table(heading, lines)


def write_page(path: Path, folder: Path) -> Path:
    path, path_of_million = beside(path, "boxes.csv"), beside(path, "million_boxes.csv")
    (note,), rows = results.read(path)
    figures, table_of_million = million(path_of_million)
    found: dict[tuple[str, str], dict[str, float]] = {}
    for row in rows:
        found.setdefault((row["part"], row["name"]), {})[row["figure"]] = float(row["value"])

    def of(part: str) -> dict[str, dict[str, float]]:
        return {name: each for (of_part, name), each in found.items() if of_part == part}

    errors = [
        [
            f"{name} m",
            f"{each['median IoU']:.3f}",
            f"{each['ours']:.0e}",
            f"{each['points']:.0e}",
            *(f"{each[figure]:.0f}" for figure in ("over 1e-3", "over 0.05", "above 1", "refused")),
            f"{each['largest']:.2g}",
        ]
        for name, each in of("errors").items()
    ]
    cases = [
        [issue, TRUE[issue], f"{each['ours']:.6f}", f"{each['pytorch3d']:.6f}"]
        for issue, each in of("published").items()
    ]
    speed = []
    for name, each in of("times").items():
        for who, us in each.items():
            speed.append([name, who, duration(us), times(us / each["ours"])])
    flat = of("flat")["rectangles"]
    widths: dict[str, dict[str, float]] = {}
    for row in results.read(beside(path, "vectors.csv"))[1]:
        widths.setdefault(row["name"], {})[row["figure"]] = float(row["value"])
    longer = {name: times(each["without AVX2"] / each["AVX2"]) for name, each in widths.items()}
    return write(
        Path(__file__).with_suffix(".md"),
        folder / "boxes.md",
        results=named(path),
        note=note,
        errors=table(
            ["offset", "median IoU", "ours", "100,000 points", "> 1e-3", "> 0.05", "IoU > 1", "refused", "largest"],
            errors,
        ),
        million=table_of_million,
        million_pairs=f"{figures['pairs']:,.0f}",
        million_proved=f"{figures['proved']:,.0f}",
        million_off=f"{figures['off']:.0e}",
        cases=table(["issue", "true IoU", "ours", "pytorch3d"], cases),
        speed=table(["boxes", "library", "per pair", "times ours"], speed, left=2),
        difference=f"{flat['difference']:.0e}",
        with_avx=duration(widths["any rotation"]["AVX2"] / 1e3),
        without=duration(widths["any rotation"]["without AVX2"] / 1e3),
        avx=f"{longer['any rotation']} times",
        avx_street=f"{longer['street of 80 m']} times",
        flat_ours=duration(flat["ours"]),
        flat_shapely=duration(flat["shapely"]),
    )
