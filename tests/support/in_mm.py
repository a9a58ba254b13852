"""A cube by its corners and an L as the text of an .obj file, in mm."""

import numpy as np

CUBE = np.array(np.meshgrid([0, 10], [0, 10], [0, 10.0])).reshape(3, 8).T
L_SHAPE = """
v 0 0 0\nv 20 0 0\nv 20 10 0\nv 10 10 0\nv 10 20 0\nv 0 20 0
v 0 0 10\nv 20 0 10\nv 20 10 10\nv 10 10 10\nv 10 20 10\nv 0 20 10
f 4 3 2 1\nf 6 5 4 1\nf 7 8 9 10\nf 7 10 11 12
f 1 2 8 7\nf 2 3 9 8\nf 3 4 10 9\nf 4 5 11 10\nf 5 6 12 11\nf 6 1 7 12
"""
