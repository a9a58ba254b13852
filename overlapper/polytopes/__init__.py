"""Convex polytopes from mesh files, from databases, at random, and as parts of concave meshes."""
