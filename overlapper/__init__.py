"""The volume that convex bodies share, with an error bound, centroid, normal, depth, patch and gradient."""

from typing import TYPE_CHECKING

from overlapper._core import (
    Batch,
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Overlap,
    Overlaps,
    Placed,
    RoundedHull,
    Sphere,
    TimeOfImpact,
    TimesOfImpact,
    distance,
    iou,
    overlap,
    overlaps,
    penetration_depth,
    time_of_impact,
    times_of_impact,
)
from overlapper.face import lazily as _lazily
from overlapper.functions import introspect as _introspect
from overlapper.functions import introspectable as _introspectable
from overlapper.shapes import Shape

if TYPE_CHECKING:
    from overlapper.motion.maximum import Maximum, maximum_depth, maximum_volume
    from overlapper.motion.swept import SweptHull, swept_hull
    from overlapper.polytopes.database import read_polytopes as read_polytopes
    from overlapper.polytopes.database import write_polytopes as write_polytopes
    from overlapper.polytopes.mesh_file import read_hull as read_hull
    from overlapper.polytopes.mesh_file import write_mesh as write_mesh
    from overlapper.polytopes.random import random_polytope
    from overlapper.scenes.watching import Watch
    from overlapper.tables.log import Log as Log
    from overlapper.version import __version__ as __version__

    watch = Watch

__all__ = [
    "Batch",
    "Box",
    "Capsule",
    "Cylinder",
    "Ellipsoid",
    "HalfSpace",
    "Hull",
    "Maximum",
    "Overlap",
    "Overlaps",
    "Placed",
    "RoundedHull",
    "Shape",
    "Sphere",
    "SweptHull",
    "TimeOfImpact",
    "TimesOfImpact",
    "distance",
    "iou",
    "maximum_depth",
    "maximum_volume",
    "overlap",
    "overlaps",
    "penetration_depth",
    "random_polytope",
    "swept_hull",
    "time_of_impact",
    "times_of_impact",
]

distance = _introspectable(distance)
iou = _introspectable(iou)
overlap = _introspectable(overlap)
overlaps = _introspectable(overlaps)
penetration_depth = _introspectable(penetration_depth)
time_of_impact = _introspectable(time_of_impact)
times_of_impact = _introspectable(times_of_impact)
for _kind in (
    Batch,
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Overlap,
    Overlaps,
    Placed,
    RoundedHull,
    Sphere,
    TimeOfImpact,
    TimesOfImpact,
):
    _introspect(_kind)
del _kind

# These names are imported on first access. The pytest plugin is a module of this package, so an import of numpy here
# would delay every start of pytest. The module that knows the version would take half of the import of this package. An
# import by * leaves out names that need more than numpy.
__getattr__ = _lazily(
    __name__,
    {
        "motion.maximum": ("Maximum", "maximum_depth", "maximum_volume"),
        "motion.swept": ("SweptHull", "swept_hull"),
        "polytopes.database": ("read_polytopes", "write_polytopes"),
        "polytopes.mesh_file": ("read_hull", "write_mesh"),
        "polytopes.random": ("random_polytope",),
        "tables.log": ("Log",),
        "version": ("__version__",),
        "watch": ("watch",),
    },
)
