"""The kinds of shapes. Each kind has a file that implements the protocol `facts.Facts`."""

from overlapper._core import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, RoundedHull, Sphere

Shape = Box | Sphere | Capsule | Cylinder | Ellipsoid | Hull | RoundedHull | HalfSpace
