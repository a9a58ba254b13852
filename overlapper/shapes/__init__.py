"""The kinds of shapes: each has a file that answers the questions of `facts.Facts`."""

from overlapper._core import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, RoundedHull, Sphere

Shape = Box | Sphere | Capsule | Cylinder | Ellipsoid | Hull | RoundedHull | HalfSpace
