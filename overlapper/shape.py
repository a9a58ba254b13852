"""The closed set of shapes."""

from overlapper._core import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, RoundedHull, Sphere

Shape = Box | Sphere | Capsule | Cylinder | Ellipsoid | Hull | RoundedHull | HalfSpace
