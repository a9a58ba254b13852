"""The core asks one header for what compilers have of their own, and does without where they have nothing."""

import re
import subprocess
from pathlib import Path

import pytest

NATIVE = Path(__file__).parents[2] / "overlapper" / "native"
LANES = NATIVE / "geometry" / "lanes.h"
SOURCES = sorted(path for ending in ("h", "cpp") for path in NATIVE.rglob(f"*.{ending}"))
OF_ONE_COMPILER = re.compile(
    r"__(?:attribute__|builtin_\w+|GNUC__|clang__|extension__|restrict|int128|float128|AVX\w+|FMA__|SSE\w+|x86_64__)\b"
    r"|_MSC_VER|__declspec|\b_mm\d*_\w+|\w*intrin\.h|#pragma (?!once)|<(?:unistd|dlfcn|pthread|sys/\w+|bits/\S+)"
)
IN_LANES = [path for path in SOURCES if path.suffix == ".cpp" and re.search(r"\b(?:TwoLanes|Quad)\b", path.read_text())]


def compiled(source, *options):
    command = ["c++", "-std=c++20", "-fsyntax-only", "-I", NATIVE, "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    return subprocess.run([*command, *options, source], capture_output=True, text=True)


def test_only_one_header_is_written_for_a_compiler():
    special = {path.name for path in SOURCES if OF_ONE_COMPILER.search(path.read_text(encoding="utf-8"))}
    assert special == {LANES.name}


@pytest.mark.parametrize("source", IN_LANES, ids=lambda path: path.name)
def test_rows_of_doubles_need_no_vectors_of_the_compiler(source):
    done = compiled(source, "-DOVERLAPPER_PLAIN_LANES")
    assert done.returncode == 0, done.stderr


def test_a_library_whose_fma_rounds_twice_is_refused():
    refused = compiled(NATIVE / "methods" / "clipping" / "wide_corners.cpp", "-D__MINGW32__")
    assert refused.returncode != 0
    assert "The fma of MinGW's library rounds twice" in refused.stderr
