"""Three hundred boxes at random, all pairs in one call; then one moves, and only its pairs are computed again."""

import time

import numpy as np

from overlapper import Batch, Box

rng = np.random.default_rng(0)
shapes = [Box(half_extents) for half_extents in rng.uniform(0.02, 0.1, (300, 3))]
positions, orientations = rng.uniform(0, 0.7, (300, 3)), rng.normal(size=(300, 4))

batch = Batch(shapes)
for moved in ("all", "one"):
    begin = time.perf_counter()
    found = batch.overlaps(positions, orientations, threads=2)
    print(f"{moved} moved: {len(found):,} pairs share {found.volume.sum():.6f} m³, {time.perf_counter() - begin:.4f} s")
    positions[0] += 0.01

# Arrays for all pairs, and everything else about one of them.
deepest = found.depth.argmax()
a, b = found.pairs[deepest]
print(f"deepest: {a} and {b}, {found.depth[deepest]:.4f} m along {found.normal[deepest].round(3)}")
print(f"their common polytope has {len(found[deepest].vertices)} corners")

# The force on each box if shared volume is squeezed out at 1 MPa.
pull = np.zeros((300, 3))
for side in (0, 1):
    np.add.at(pull, found.pairs[:, side], -1e6 * found.gradient[:, side, :3])
print(f"largest force {np.linalg.norm(pull, axis=1).max():.3g} N, sum {np.abs(pull.sum(axis=0)).max():.1g} N")
