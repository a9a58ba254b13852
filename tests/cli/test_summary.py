"""The summary of a run has the right sentences for its numbers."""

import io
from collections import Counter
from pathlib import Path

from rich.console import Console

from overlapper.cli.summary import overlaps_table, remarks
from overlapper.simulation import Decomposed, Report, Skipped
from overlapper.tables.summary import Disagreement, PairSummary, Summary


def printed(table):
    text = io.StringIO()
    Console(file=text, width=140).print(table)
    return text.getvalue()


def pair(number, volume=1e-3):
    return PairSummary((f"a/{number}", f"b/{number}"), 2, volume / number, 1e-9, 3, 0.01, 4, (0.0, 0.0, 1.0))


def test_the_table_says_how_many_pairs_it_leaves_out():
    summary = Summary("pile", 5, 0.1, {(0, n, 1, n): pair(n) for n in range(1, 24)})
    text = printed(overlaps_table(summary))
    assert "The 20 largest of 23 pairs." in text and "b/20" in text and "b/21" not in text
    del summary.pairs[0, 1, 1, 1], summary.pairs[0, 2, 1, 2], summary.pairs[0, 3, 1, 3]
    assert "largest of" not in printed(overlaps_table(summary))


def test_volumes_have_the_largest_unit_that_gives_a_tenth_or_more():
    for volume, unit in ((0.2, "m³"), (0.02, "cm³"), (1e-8, "mm³"), (1e-12, "µm³"), (1e-30, "µm³")):
        assert f"   {unit} " in printed(overlaps_table(Summary("pile", pairs={(0, 0, 1, 0): pair(1, volume)})))


def test_ten_disagreements_are_listed_and_the_rest_is_counted():
    many = [Disagreement(step, ("a/base", "b/base"), "disagree", "By a hair.") for step in range(1, 13)]
    summary = Summary("pile", verdicts=Counter({"agree": 1_000, "disagree": 12}), disagreements=many)
    lines = remarks(summary)
    assert lines[0] == "FCL on 1,012 pairs that overlap or touch: 1,000 agree, 12 disagree."
    assert lines[1] == "  step 1, a/base – b/base, disagree: By a hair."
    assert lines[11:] == ["  and 2 more, each explained in the table of --out and in the output of --json."]
    assert len(remarks(Summary("pile", verdicts=summary.verdicts, disagreements=many[:10]))) == 11


def test_a_concave_mesh_is_reported_with_its_parts_volume_and_cache_file():
    meshes = [
        Decomposed(0, -1, "cup/base", range(1), 2e-3, None, None),
        Decomposed(1, 0, "bent/base", range(3), 3.0, 3.1, Path("parts")),
    ]
    assert remarks(Summary("pile", decomposed=meshes)) == [
        "Concave: cup/base is one convex part of 0.002 m³ together, the surface is open.",
        "Concave: bent/base is 3 convex parts of 3 m³ together, the mesh bounds 3.1 m³; kept in parts.",
    ]


def test_skipped_shapes_and_examined_pairs_are_reported():
    net = {Skipped(0, -1, "net", "it is soft"): 1, Skipped(2, -1, "duck", "it is nowhere", diverged=True): 7}
    summary = Summary("pile", report=Report(1, 3, 2, 1, 1, 1, 0, 9, 8), skipped=net)
    first, *rest = remarks(summary)
    assert first == "1 bodies, 2 of 3 shapes read"
    assert rest[-3:] == [
        "1 overlap, none of them measured again in wider arithmetic",
        "Not modelled: net, it is soft.",
        "Not modelled from step 7 on: duck, it is nowhere.",
    ]
    assert [(each["name"], each["first_step"]) for each in summary.as_dict()["skipped"]] == [("net", 1), ("duck", 7)]
    assert "1 of them measured again" in str(Report(1, 3, 2, 1, 1, 1, 1, 9, 8))


def test_pairs_that_only_margins_separate_are_reported():
    summary = Summary("pile", report=Report(1, 3, 2, 1, 1, 0, 0, 9, 8, pairs_within_margins=147))
    assert remarks(summary)[-1].startswith("147 more pairs of links touch only with the collision margins of Bullet")
    assert summary.as_dict()["report"]["pairs_within_margins"] == 147
