"""The core asks one header for what compilers have of their own, and does without where they have nothing."""

import ctypes
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

NATIVE = Path(__file__).parents[2] / "overlapper" / "native"
LANES = NATIVE / "geometry" / "lanes.h"
COUNT = 167  # of doubles that lanes.cpp writes
SUPPORT = Path(__file__).parents[1] / "support"
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


@pytest.mark.parametrize("machine", [(), ("-mavx2", "-mfma")], ids=["any machine", "AVX2"])
def test_rows_of_doubles_have_the_bits_of_vectors_of_the_compiler(machine, tmp_path):
    """In every operation; the coverage build passes the recorded answers of the core without vectors."""
    if machine and "fma" not in Path("/proc/cpuinfo").read_text():
        pytest.skip("This machine has no AVX2")
    rng = np.random.default_rng(0)
    special = [0.0, -0.0, 1.0, np.inf, -np.inf, np.nan, 5e-324, 1e300]
    drawn = [rng.normal(size=9) * 10.0 ** rng.integers(-20, 20, 9) for _ in range(100)]
    drawn += [rng.choice(special[:3], 9) for _ in range(20)] + [rng.choice(special, 9) for _ in range(20)]
    answers = []
    for variant in ((), ("-DOVERLAPPER_PLAIN_LANES",)):
        library = tmp_path / f"lanes{len(variant)}.so"
        command = ["c++", "-std=c++20", "-O1", "-w", "-ffp-contract=off", "-shared", "-fPIC", *machine, *variant]
        subprocess.run([*command, "-I", NATIVE, "-o", library, SUPPORT / "lanes.cpp"], check=True)
        lanes = ctypes.CDLL(str(library)).lanes
        written = np.zeros((len(drawn), COUNT))
        assert {lanes(*(ctypes.c_void_p(row.ctypes.data) for row in rows)) for rows in zip(drawn, written)} == {COUNT}
        answers.append(written)
    one, other = answers
    numbers = np.isnan(one) & np.isnan(other)  # whose signs and payloads differ
    np.testing.assert_array_equal(np.where(numbers, 0, one).view(np.int64), np.where(numbers, 0, other).view(np.int64))


def test_a_library_whose_fma_rounds_twice_is_refused():
    refused = compiled(NATIVE / "methods" / "clipping" / "wide_corners.cpp", "-D__MINGW32__")
    assert refused.returncode != 0
    assert "The fma of MinGW's library rounds twice" in refused.stderr
