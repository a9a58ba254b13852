"""Motions of shapes: the largest depth and the largest common volume of two, and the space that one passes through."""
