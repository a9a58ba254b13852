"""r3d (Powell and Abel, 2015): a C library without a package, compiled from a folder that the variable R3D names.

git clone https://github.com/devonmpowell/r3d
R3D=r3d python benchmarks chart
"""

from __future__ import annotations

import ctypes
import os
import subprocess
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np

from harness.bodies import Unfit
from harness.command import ROOT
from overlapper import Hull

MOST = 512  # vertices in r3d's buffer; each plane clears flags for all of them
OPTIONS = ("-O3", "-march=x86-64-v2", "-DNDEBUG", "-ffp-contract=off")  # as the core of this package is compiled


def volume(first: Hull, cuts: np.ndarray) -> Callable[[], float]:
    """A hull cut by planes (k, 4), rows [n, b] with n · x + b <= 0 inside. One call makes r3d's polytope, cuts it, and
    sums its volume."""
    ask = library()
    rings = [np.array(ring, np.int32) for ring in first.facets]
    vertices = np.array(first.vertices)
    ring, sizes = np.concatenate(rings), np.array([len(each) for each in rings], np.int32)
    kept = np.array(-cuts)
    # The arrays live as long as the function that holds their addresses.
    held = vertices, ring, sizes, kept
    where = [each.ctypes.data for each in held]
    arguments = where[0], len(vertices), where[1], where[2], len(rings), where[3], len(kept)

    def asked() -> float:
        assert held
        return ask(*arguments)

    if asked() < 0:
        raise Unfit(f"more than {MOST} vertices")
    return asked


@lru_cache(1)
def library() -> Callable[..., float]:
    """The function `r3d_volume`. ImportError if R3D names no folder."""
    source = Path(os.environ.get("R3D", "")) / "src" / "r3d.c"
    if not source.is_file():
        raise ImportError("the variable R3D names no folder with the sources of r3d", name="r3d")
    built = ROOT / "build" / "r3d"
    built.mkdir(parents=True, exist_ok=True)
    # As its Readme recommends for polytopes far from the origin, moments are about a vertex.
    (built / "r3d-config.h").write_text(f"#define R3D_MAX_VERTS {MOST}\n#define SHIFT_POLY\n")
    sources = [source, Path(__file__).with_name("r3d_volume.c")]
    path = built / f"r3d.{os.getpid()}.so"  # processes that start together do not overwrite each other's
    include = [f"-I{built}", f"-I{source.parent}"]
    subprocess.run(["cc", *OPTIONS, "-shared", "-fPIC", *include, *sources, "-o", path, "-lm"], check=True)
    ask = ctypes.CDLL(str(path)).r3d_volume
    path.unlink()
    pointer, number = ctypes.c_void_p, ctypes.c_int
    ask.argtypes = [pointer, number, pointer, pointer, number, pointer, number]
    ask.restype = ctypes.c_double
    return ask
