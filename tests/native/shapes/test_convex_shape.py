"""The compiler checks that a shape answers every question. No other file asks which kind a shape is."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
NATIVE = ROOT / "overlapper" / "native"
CONE = Path(__file__).with_name("cone.h")

# Questions about two given kinds, and lanes that hold all sides of a box.
MAY_ASK_FOR_A_KIND = {
    "batch/box_volumes.cpp",
    "batch/shape_array.cpp",
    "distance/box_axes.cpp",
    "methods/clipping/wide_corners.cpp",
    "overlap/centroid_gradient.cpp",
    "overlap/second_derivatives.cpp",
    "overlap/shape_gradient.cpp",
    "python/shape_arrays.cpp",
}

# The concept does not ask for these. Their users do not compile without them: the class in Python, constructors.
NOT_IN_THE_CONCEPT = re.compile(r"fields\(\)|make\(|^Cone\(|^double radius = 0")


def askers(native: Path) -> set[str]:
    """The files of the core that tell kinds of shapes apart."""
    asks = re.compile(
        r"\b(get_if|holds_alternative)<|\bstd::get<(Sphere|Box|Capsule|Cylinder|\w*Hull|HalfSpace|Ellipsoid)>"
    )
    files = [path for path in native.rglob("*") if path.suffix in (".h", ".cpp") and "fuzz" not in path.parts]
    return {path.relative_to(native).as_posix() for path in files if asks.search(path.read_text(encoding="utf-8"))}


def test_no_file_of_the_core_tells_kinds_of_shapes_apart():
    assert askers(NATIVE) == MAY_ASK_FOR_A_KIND


def test_a_file_that_asks_for_a_kind_is_named(tmp_path):
    (tmp_path / "distance").mkdir()
    (tmp_path / "distance" / "gjk.cpp").write_text("const Box* box = std::get_if<Box>(&shape);\n")
    assert askers(tmp_path) == {"distance/gjk.cpp"}


def without_one_answer(header: str) -> dict[str, str]:
    """The header of the cone without each of its answers in turn, by what is left out."""
    head, body = header.split("struct Cone : ", 1)
    bases, body = body.split(" {\n", 1)
    answers, rest_of_header = body.split("\n private:", 1)
    tail = "\n private:" + rest_of_header
    choices = re.split(r",\s*", bases)
    blocks = answers.split("\n\n")
    left_out = {}
    for choice in choices:
        rest = ", ".join(other for other in choices if other != choice)
        left_out[choice] = f"{head}struct Cone : {rest} {{\n{answers}{tail}"
    for block in blocks:
        name = block.strip().splitlines()[0]
        if NOT_IN_THE_CONCEPT.search(name):
            continue
        rest = "\n\n".join(other for other in blocks if other != block)
        left_out[name] = f"{head}struct Cone : {bases} {{\n{rest}{tail}"
    return left_out


def test_a_shape_that_leaves_an_answer_out_is_no_convex_shape(tmp_path):
    compiler = next(filter(None, map(shutil.which, ("c++", "g++", "clang++"))), None)
    assert compiler, "a C++ compiler has built the core"
    header = CONE.read_text(encoding="utf-8").split("\n#define OVERLAPPER_MORE_KINDS")[0]
    left_out = without_one_answer(header)
    assert len(left_out) >= 29
    lines = [
        '#include "shapes/shape.h"',
        f'#include "{CONE}"',
        "static_assert(overlapper::ConvexShape<overlapper::Cone>);",
    ]
    for number, text in enumerate(left_out.values()):
        name = f"Cone{number}"
        (tmp_path / f"{name}.h").write_text(re.sub(r"\bCone\b", name, text), encoding="utf-8")
        lines += [f'#include "{name}.h"', f"static_assert(!overlapper::ConvexShape<overlapper::{name}>);"]
    source = tmp_path / "cones.cpp"
    source.write_text("\n".join(lines) + "\n")
    command = [compiler, "-std=c++20", "-fsyntax-only", f"-I{NATIVE}", str(source)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    named = [list(left_out)[int(number)] for number in re.findall(r"ConvexShape<overlapper::Cone(\d+)>", done.stderr)]
    assert done.returncode == 0, f"{sorted(set(named))} may be left out\n{done.stderr[:4000]}"


@pytest.mark.parametrize(
    "name", ["Bounded", "double volume() const { return std::numbers::pi * radius * radius * length / 3; }"]
)
def test_answers_of_the_cone_are_left_out_by_name(name):
    assert name in without_one_answer(CONE.read_text(encoding="utf-8"))
