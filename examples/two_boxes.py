"""The overlap of two boxes: volume, centroid, depth, and the direction that pushes them apart."""

import numpy as np

from overlapper import Box, Placed, overlap

cube = Box([0.5, 0.5, 0.5])  # half extents, in m
fixed = Placed(cube)
pushed = Placed(cube, position=(0.75, 0.5, 0.25))

common = overlap(fixed, pushed)
print(f"volume    {common.volume:.6f} m³, wrong by {common.volume_error:.0e} m³ at most")
print(f"centroid  {np.round(common.centroid, 6)} m")
print(f"depth     {common.depth:.6f} m, along the normal {np.round(common.normal, 6) + 0.0}")

# The normal points from the second body to the first: moving the first by depth times normal separates them.
apart = overlap(Placed(cube, fixed.position + 1.001 * common.depth * common.normal), pushed)
print(f"moved     {apart.status}, {1e3 * apart.distance:.3f} mm between them")
