"""Proofs of what is claimed of an overlap, in rational arithmetic and without the native core."""
