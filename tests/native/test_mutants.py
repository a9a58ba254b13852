"""The faults that are made by hand to see whether tests notice them."""

import pytest
from mutants import (
    all_mutants,
    draw,
    expression_around,
    known_equivalent,
    mutants_of,
    mutants_of_python,
    report,
    switched,
)


def changed(line):
    return {mutant.after for mutant in mutants_of("file.cpp", line)}


def test_each_operator_and_constant_is_changed_once():
    assert changed("  if (a < b && !c) return std::min(a, -b) + 4;") == {
        "  if (a <= b && !c) return std::min(a, -b) + 4;",
        "  if (a < b || !c) return std::min(a, -b) + 4;",
        "  if (a < b && c) return std::min(a, -b) + 4;",
        "  if (a < b && !c) return std::max(a, -b) + 4;",
        "  if (a < b && !c) return std::min(a, b) + 4;",
        "  if (a < b && !c) return std::min(a, -b) - 4;",
        "  if (a < b && !c) return std::min(a, -b) + 8;",
    }


@pytest.mark.parametrize(
    "line",
    [
        "  // a + b, as 1 < 2",
        "/// Six times: a + 1.",
        '  name("a + 1");',
        "  assert(a < b);",
        "#include <a/b>",
        "  std::vector<int*> f(const Vec3& a, T&& b);",
        "template <int N>",
    ],
)
def test_comments_strings_and_templates_are_not_changed(line):
    assert changed(line) == set()


@pytest.mark.parametrize(
    ("text", "operator", "whole"),
    [
        ("x = a + b * f(c, d);", "*", "a + b * f(c, d)"),
        ("if (a < b && c) {", "&&", "a < b && c"),
        ("return p ? a + 1 : b;", "+", "a + 1"),
        ("f(a, std::max(b, c) - 1);", "-", "std::max(b, c) - 1"),
        ("for (int i = 0; i < n; ++i)", "<", "i < n"),
        ("f();\n}\nint a[2]{x + y};", "+", "x + y"),
    ],
)
def test_an_expression_is_chosen_as_a_whole(text, operator, whole):
    at = text.index(f" {operator} ") + 1
    left, right = expression_around(text, at, at + len(operator))
    assert text[left:right] == whole


def test_two_changes_of_one_expression_are_two_choices_of_it():
    text = "int f() {\n  return a + b * c;\n}\n"
    numbered = dict(enumerate(mutants_of("file.cpp", text), 1))
    found, lines = switched(text, numbered)
    one, other = (f"overlapper_mutant == {i} ? ({m.after.strip()[7:-1]})" for i, m in numbered.items())
    assert found == f"int f() {{\n  return ({one} : {other} : (a + b * c));\n}}\n"
    assert lines == {1: [1, 2]}


@pytest.mark.parametrize(
    ("line", "after"),
    [
        ("    if a < b and not c:", {"    if a <= b and not c:", "    if a < b or not c:", "    if a < b and  c:"}),
        ("    return min(-a, [*b][1:])", {"    return max(-a, [*b][1:])", "    return min(a, [*b][1:])",
                                          "    return min(-a, [*b][0:])"}),
        ("    raise ValueError(1 + 1)", set()),
        ('    x = folder / "0 + 1"  # 0 + 1', set()),
        ("def f(a, /, *, b=1):", set()),
    ],
)  # fmt: skip
def test_operators_and_constants_of_python_are_changed(line, after):
    assert {mutant.after for mutant in mutants_of_python("file.py", line + "\n")} == after


def test_a_mutant_is_named_without_the_comment_of_its_line():
    (native,) = mutants_of("f.cpp", "  c = a + b;  // a sum")
    (python,) = mutants_of_python("f.py", "c = a + b  # a sum\n")
    assert native.name == ("f.cpp", "c = a + b;", "c = a - b;")
    assert python.name == ("f.py", "c = a + b", "c = a - b")


def test_the_report_says_what_was_noticed_and_what_was_left_out():
    everything = mutants_of("f.cpp", "a + b;\nc < d;\n") + mutants_of("g.cpp", "a * b;\n")
    drawn = draw(everything, 0, 1, "f")
    assert (len(drawn.asked), drawn.elsewhere, drawn.known, drawn.not_drawn) == (1, 1, 0, 1)
    noticed, survived, _ = made = everything
    said = "\n".join(report(drawn, made, 2, {noticed.name: "test_f.py::test_sum", survived.name: ""}))
    assert said.startswith(
        "survived: f.cpp:2\n  - c < d;\n  + c <= d;\n1 of 2 mutants are noticed.\nLeft out:\n- 0 mut"
    )
    assert "- 1 mutants not drawn, 1 elsewhere" in said
    assert "- 1 mutants not shown before the end, 2 shown by earlier runs only" in said


def test_faults_that_are_said_to_change_nothing_can_still_be_made():
    assert known_equivalent().keys() <= {mutant.name for mutant in all_mutants() + all_mutants(python=True)}
    assert all(known_equivalent().values())
