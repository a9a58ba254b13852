"""The volume that convex bodies share, with an error bound, centroid, normal, depth, patch and gradient."""

from importlib import import_module as _import_module
from importlib.metadata import version as _version
from typing import TYPE_CHECKING

from overlapper._core import (
    Batch,
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    Hull,
    Overlap,
    Overlaps,
    Placed,
    RoundedHull,
    Sphere,
    distance,
    iou,
    overlap,
    overlaps,
    penetration_depth,
)

if TYPE_CHECKING:
    from overlapper.database import read_polytopes as read_polytopes
    from overlapper.database import write_polytopes as write_polytopes
    from overlapper.mesh_file import read_hull as read_hull
    from overlapper.mesh_file import write_mesh as write_mesh
    from overlapper.sampling import random_polytope

Shape = Box | Sphere | Capsule | Cylinder | Hull | RoundedHull | HalfSpace

__version__ = _version("overlapper")
__all__ = [
    "Batch",
    "Box",
    "Capsule",
    "Cylinder",
    "HalfSpace",
    "Hull",
    "Overlap",
    "Overlaps",
    "Placed",
    "RoundedHull",
    "Shape",
    "Sphere",
    "distance",
    "iou",
    "overlap",
    "overlaps",
    "penetration_depth",
    "random_polytope",
]

# Imported when asked for. What needs more than numpy is not imported by *, either; what needs numpy would make every
# start of pytest wait for it, as the plugin is a module of this package.
_LAZY = {
    "random_polytope": "sampling",
    "read_polytopes": "database",
    "write_polytopes": "database",
    "read_hull": "mesh_file",
    "write_mesh": "mesh_file",
}


def __getattr__(name: str) -> object:
    if name not in _LAZY:
        raise AttributeError(f"module 'overlapper' has no attribute {name!r}")
    return getattr(_import_module(f"overlapper.{_LAZY[name]}"), name)
