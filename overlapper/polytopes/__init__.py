"""Convex polytopes from files, from databases, from chance, and as parts of concave meshes."""
