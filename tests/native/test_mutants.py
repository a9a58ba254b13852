"""The faults that are made by hand to see whether tests notice them."""

import pytest
from mutants import ROOT, all_mutants, expression_around, known_equivalent, mutants_of, switched


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


def test_faults_that_are_said_to_change_nothing_can_still_be_made():
    assert known_equivalent().keys() <= {mutant.name for mutant in all_mutants(ROOT / "overlapper" / "native")}
    assert all(known_equivalent().values())
