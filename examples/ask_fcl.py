"""A second opinion: the same pairs asked of FCL, and who is right where it differs."""

from overlapper import Box, Cylinder, Placed, Sphere, overlap
from overlapper.reference import Fcl

cube, speck = Box([0.5, 0.5, 0.5]), Box([5e-5, 5e-5, 5e-5])
pairs = {
    "cubes": (Placed(cube), Placed(cube, (0.75, 0.1, 0.2))),
    "ball and cylinder, apart": (Placed(Sphere(0.5)), Placed(Cylinder(0.3, 1.0), (2.0, 0.5, 1.5), (1, 2, 3, 4))),
    "specks of 0.1 mm": (Placed(speck), Placed(speck, (9e-5, 1e-5, 2e-5))),
    "cubes, edge on edge": (Placed(cube), Placed(cube, (1 - 1e-9, 0.75, -1.0))),
}

with Fcl() as fcl:
    comparisons = fcl.compare_many(overlap(*pair) for pair in pairs.values())
for name, comparison in zip(pairs, comparisons, strict=True):
    print(f"{name}: {comparison.verdict}\n    {comparison.explanation}")
