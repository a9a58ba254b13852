"""Prints the table of docs/concave.md: what the threshold of CoACD costs two rings of a chain, in time and in truth.

    python benchmarks concave

Times are by the clock, of one run: CoACD runs in a process of its own.
"""

from __future__ import annotations

import os
import tempfile
import time
from argparse import ArgumentParser, Namespace

import manifold3d
import numpy as np
import pybullet_data
import trimesh

from harness.timing import Stopwatch
from overlapper import Placed
from overlapper.polytopes.decomposition import decompose
from overlapper.union import union_overlap, union_volume

SHIFT, QUARTER_TURN = np.array([0.06, 0.0, 0.0]), [0.5**0.5, 0.0, 0.0, 0.5**0.5]
CM3 = 1e-6


def options(parser: ArgumentParser) -> None:
    parser.add_argument("thresholds", nargs="*", type=float, default=[0.3, 0.1, 0.05, 0.02, 0.01])


def main(chosen: Namespace) -> None:
    ring = trimesh.load_mesh(f"{pybullet_data.getDataPath()}/torus/torus_textured.obj")
    ring.merge_vertices(merge_tex=True, merge_norm=True)
    vertices = 0.1 * np.asarray(ring.vertices)
    turned = vertices @ [[1, 0, 0], [0, 0, 1], [0, -1, 0]] + SHIFT
    solids = [manifold3d.Manifold(manifold3d.Mesh64(each, ring.faces.astype(np.uint64))) for each in (vertices, turned)]
    exact = (solids[0] ^ solids[1]).volume()
    print(f"{len(ring.faces):,} triangles, {solids[0].volume() / CM3:.2f} cm³ each, {exact / CM3:.4f} cm³ shared")
    print("threshold  parts  CoACD s  a ring cm³  shared cm³  error  links ms")
    watch = Stopwatch(time.perf_counter_ns)
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_CACHE_HOME"] = folder
        for threshold in chosen.thresholds:
            parts = watch("CoACD", decompose, vertices[ring.faces], threshold).parts
            a, b = ([Placed(part, *pose) for part in parts] for pose in ((), (SHIFT, QUARTER_TURN)))
            shared = watch("links", union_overlap, a, b)
            us = watch.take()
            print(
                f"{threshold:9}  {len(parts):5}  {us['CoACD'] / 1e6:7.1f}  {union_volume(a)[0] / CM3:10.2f}  "
                f"{shared.volume / CM3:10.2f}  {shared.volume / exact - 1:5.0%}  {us['links'] / 1e3:8.1f}"
            )
