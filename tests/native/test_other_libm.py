"""Answers keep their stated errors whatever the last bits of the mathematical library are.

Other systems have other libraries. Their last bits decide which of equally far points of a round body comes first, so
that polytopes around it have other corners. Measures must agree within their errors all the same.
"""

import ctypes
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
from plain_cases import GROUPS, plain_cases

from overlapper import Box, HalfSpace, Hull, overlap

SOURCE = Path(__file__).parents[1] / "support" / "other_libm.c"
POLYHEDRA = Box, Hull, HalfSpace
ULPS = 4  # glibc's own are off by up to 1, those of other libraries by up to 4


def answers(cases):
    found = []
    for case in cases:
        try:
            common = overlap(*case.bodies, tolerance=case.tolerance, method=case.method)
            measures = {"volume": (common.volume, common.volume_error), "area": (common.area, common.errors.area)}
            if len(case.bodies) == 2:
                measures["depth"] = common.depth, common.errors.depth
            if common and not all(isinstance(body.shape, POLYHEDRA) for body in case.bodies):
                arms = common.vertices - common.centroid
                enclosed = float(np.linalg.det(arms[common.faces]).sum() / 6)
                measures["polytope"] = enclosed, case.tolerance * enclosed
            found.append((common.status, measures))
        except ValueError as refusal:
            found.append((str(refusal), {}))
    return found


def differences():
    """The cases whose answers disagree by more than both errors, and how many answers have other bits."""
    ulps = ctypes.c_int.in_dll(ctypes.CDLL(None), "most_ulps")
    wrong, moved = [], 0
    for group in GROUPS:
        cases = [case for case in plain_cases(group) if case.method != "paper"]
        ulps.value = 0
        here = answers(cases)
        ulps.value = ULPS
        for case, (status, one), (other_status, other) in zip(cases, here, answers(cases)):
            if status != other_status:
                wrong.append(f"{group}, {case.name}: {status} and {other_status}")
                continue
            for name, (value, error) in one.items():
                moved += value != other[name][0]
                if not abs(value - other[name][0]) <= error + other[name][1]:
                    wrong.append(f"{group}, {case.name}: {name} {value} ± {error} and {other[name]}")
    return wrong, moved


def test_answers_agree_with_those_of_another_mathematical_library(tmp_path):
    library = tmp_path / "other_libm.so"
    subprocess.run(["cc", "-O2", "-fno-builtin", "-shared", "-fPIC", SOURCE, "-o", library, "-ldl"], check=True)
    code = f"import sys; sys.path[:0] = {sys.path!r}; import test_other_libm; print(test_other_libm.differences())"
    environment = {**os.environ, "LD_PRELOAD": f"{os.environ.get('LD_PRELOAD', '')} {library}"}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=Path(__file__).parent, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    wrong, moved = eval(done.stdout)
    assert not wrong, "\n".join(wrong[:20])
    assert moved > 100, "the library must have changed the last bits of some answers"
