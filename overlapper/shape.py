"""The closed set of shapes."""

from overlapper._core import Box, Capsule, Cylinder, HalfSpace, Hull, RoundedHull, Sphere

Shape = Box | Sphere | Capsule | Cylinder | Hull | RoundedHull | HalfSpace
