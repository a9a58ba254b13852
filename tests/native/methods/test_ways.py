"""The page on how an overlap is computed says what the code does: tables, limits, and the way of typical bodies."""

import re
from pathlib import Path

import pytest
from families import prism

from overlapper import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Overlap,
    Overlaps,
    Placed,
    RoundedHull,
    Sphere,
    overlap,
    overlaps,
    random_polytope,
)
from speed.ways import AROUND, CUBE, FLOOR, TURN, TYPICAL

ROOT = Path(__file__).resolve().parents[3]
PAGE = (ROOT / "docs" / "how.md").read_text(encoding="utf-8")
NATIVE = ROOT / "overlapper" / "native"
CHOOSE = (NATIVE / "methods" / "choose.h").read_text(encoding="utf-8")
CHOOSING = (NATIVE / "methods" / "choose.cpp").read_text(encoding="utf-8")
MEASURES = (NATIVE / "geometry" / "measures.h").read_text(encoding="utf-8")
THRESHOLDS = (NATIVE / "geometry" / "thresholds.h").read_text(encoding="utf-8")


def rows_below(*heading):
    """The cells of the page's table with this heading."""
    table = re.search(re.escape(f"| {' | '.join(heading)} |") + r"\n\|[-:|]+\|\n((?:\|.*\n)+)", PAGE)
    assert table, heading
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table[1].splitlines()]


def names_of_ways():
    """kClipping and so on with the names that users read, from the enumeration in C++."""
    enumeration = re.search(r"enum class Way \{(.*?)\};", MEASURES, re.DOTALL)[1]
    return dict(zip(re.findall(r"^ *(k\w+),", enumeration, re.MULTILINE), Overlaps.WAYS, strict=True))


def test_the_lines_of_the_table_are_those_of_the_code():
    names = names_of_ways()
    lines = re.findall(r'\{"([^"]+)",\s*\[\].*?\},\s*\{(Way::[^}]*)\}\}', CHOOSE, re.DOTALL)
    in_code = [[bodies, ", ".join(names[way] for way in re.findall(r"Way::(k\w+)", ways))] for bodies, ways in lines]
    assert len(in_code) == int(re.search(r"std::array<Choice, (\d+)>", CHOOSE)[1])
    assert rows_below("bodies", "ways, in turn") == in_code


def test_every_way_is_explained_once():
    assert [row[0] for row in rows_below("`Overlap.way`", "the answer", "code")] == [
        f"`{way}`" for way in Overlaps.WAYS
    ]


def test_the_docstring_of_way_explains_every_way():
    assert [way for way in Overlaps.WAYS if f"'{way.removeprefix('wide ')}'" not in Overlap.way.__doc__] == []


def test_limits_are_those_by_which_the_code_chooses():
    on_page = {name.strip("`"): float(value) for name, value, _ in rows_below("limit", "is", "means")}
    in_code = {
        name: float(value)
        for source in (THRESHOLDS, MEASURES)
        for name, value in re.findall(r"^inline constexpr (?:double|size_t) (k\w+) = ([\de.-]+);", source, re.MULTILINE)
        if re.search(rf"\b{name}\b", CHOOSING)
    }
    assert on_page == in_code


def test_links_lead_to_files():
    for target in re.findall(r"\]\(([^)#]+)", PAGE):
        assert (ROOT / "docs" / target).exists(), target


def test_the_measured_table_has_every_typical_case_by_its_way():
    rows = rows_below("bodies", "way", "µs", "by the dual hull", "by the article")
    assert [row[:2] for row in rows] == [[name, typical.way] for name, typical in TYPICAL.items()]
    assert all(float(row[2].replace(",", "")) > 0 for row in rows)


def test_typical_cases_use_every_method_but_the_articles():
    assert {typical.way for typical in TYPICAL.values()} == set(Overlaps.WAYS) - {"paper"}


@pytest.mark.parametrize("name", TYPICAL)
def test_typical_bodies_are_answered_by_the_way_that_the_page_says(name):
    bodies, way = TYPICAL[name]
    assert overlap(*bodies).way == way
    assert overlap(*bodies[::-1]).way == way


def in_batch(bodies, **settings):
    return overlaps(
        [body.shape for body in bodies],
        [body.position for body in bodies],
        [body.orientation for body in bodies],
        pairs=[(0, 1)],
        **settings,
    )


@pytest.mark.parametrize("name", [name for name, typical in TYPICAL.items() if len(typical.bodies) == 2])
def test_a_batch_answers_typical_pairs_by_the_same_way(name):
    bodies, way = TYPICAL[name]
    found = in_batch(bodies)
    assert [Overlaps.WAYS[k] for k in found.way] == [way]
    assert found[0].way == way


WITH_A_ROUNDED_HULL = {
    "half-space": (HalfSpace([0, 0, 1], 0), "closed form"),
    "box": (Box([0.5, 0.5, 0.5]), "closed form"),
    "hull": (Hull([[-1, -1, -1], [1, -1, -1], [0, 1, -1], [0, 0, 1]]), "closed form"),
    "ball": (Sphere(0.5), "closed form"),
    "capsule": (Capsule(0.3, 1.0), "closed form"),
    "cylinder": (Cylinder(0.3, 1.0), "closed form"),
    "ellipsoid": (Ellipsoid([0.3, 0.4, 0.5]), "closed form"),
    "rounded hull": (RoundedHull([[-1, -1, -1], [1, -1, -1], [0, 1, -1], [0, 0, 1]], 0.1), "closed form"),
}


@pytest.mark.parametrize("kind", WITH_A_ROUNDED_HULL)
def test_a_rounded_hull_and_each_kind_of_shape_have_their_way(kind):
    other, way = WITH_A_ROUNDED_HULL[kind]
    body = Placed(RoundedHull([[0, 0, 0], [0.9, 0.1, 0], [0, 0.8, 0.2], [0.1, 0, 0.7]], 0.05), (0.2, 0.1, -0.3), TURN)
    found = overlap(body, Placed(other))
    assert found.way == way
    assert in_batch((body, Placed(other)))[0].way == way


# With a box around them, which leaves what they share as it is.
IN_A_BOX = {
    "two boxes, apart": "separation",
    "two boxes": "clipping",
    "a box in the floor": "clipping",
    "two meshes of 80 facets": "clipping",
    "two meshes of 1,280 facets": "dual hull",
    "a ball in the floor": "slicing",
    "two cylinders": "slicing",
    "a rounded hull of 80 facets and a box": "slicing",
    "a box resting on another, 1 µm deep": "wide dual hull",
    "two boxes that touch": "doubt",
}


@pytest.mark.parametrize("name", IN_A_BOX)
def test_a_group_of_bodies_is_answered_by_its_line_of_the_table(name):
    assert overlap(*TYPICAL[name].bodies, Placed(Box([3, 3, 3]))).way == IN_A_BOX[name]


def test_groups_with_an_ellipsoid_try_only_the_dual_hull():
    for name in ("two boxes", "two meshes of 80 facets", "a ball in the floor"):
        assert overlap(*TYPICAL[name].bodies, AROUND).way == "dual hull"


def test_the_articles_method_runs_only_on_request():
    for name in ("two boxes, apart", "two boxes", "two boxes that touch"):
        bodies = TYPICAL[name].bodies
        assert overlap(*bodies, method="paper").way == "paper"
        assert overlap(*bodies, Placed(Box([3, 3, 3])), method="paper").way == "paper"
        assert [Overlaps.WAYS[k] for k in in_batch(bodies, method="paper").way] == ["paper"]


def limit(name):
    return next(float(value) for row, value, _ in rows_below("limit", "is", "means") if row == f"`{name}`")


def test_pairs_of_facets_decide_between_clipping_and_tracing():
    most = int(limit("kLeastPairsTraced") / 6)  # facets of a hull that is clipped with a box of six
    for facets, way in ((most, "clipping"), (most + 1, "tracing")):
        drum = Hull(prism(facets - 2))
        assert len(drum.facets) == facets
        assert overlap(Placed(CUBE), Placed(drum, (0.4, 0.3, 0.2), TURN)).way == way


def test_the_number_of_facets_decides_whether_a_hull_is_clipped():
    most = int(limit("kMostFacetsClipped"))
    for facets, way in ((most, "clipping"), (most + 2, "dual hull")):
        ball = random_polytope(facets // 2 + 2, "sphere", rng=1)  # all of whose facets are triangles
        assert len(ball.facets) == facets
        assert overlap(Placed(ball, (0, 0, 0.1)), FLOOR).way == way
