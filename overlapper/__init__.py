"""The volume that convex bodies share, with an error bound, centroid, normal, depth, patch and gradient."""

from importlib.metadata import version as _version

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
    Sphere,
    distance,
    iou,
    overlap,
    overlaps,
    penetration_depth,
)

Shape = Box | Sphere | Capsule | Cylinder | Hull | HalfSpace

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
    "Shape",
    "Sphere",
    "distance",
    "iou",
    "overlap",
    "overlaps",
    "penetration_depth",
]
