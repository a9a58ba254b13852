"""A gripper opens until each finger shares 20 mm³ with a stone: Newton's method with exact second derivatives."""

import numpy as np

from overlapper import Box, Hull, Placed, overlap, random_polytope

TARGET = 20e-9  # m³
stone = Hull(0.03 * random_polytope(60, rng=3).vertices)
finger = Box((0.004, 0.008, 0.015))
gripper = np.array([0, 0, 0, 0.052])  # the place of its centre, and the distance of the fingers' centres, m

for step in range(12):
    off, slope, bend, words = 0.0, np.zeros(4), np.zeros((4, 4)), []
    for side in (-1, 1):
        move = np.c_[np.eye(3), [side / 2, 0, 0]]  # of the finger, by the four numbers of the gripper
        shared = overlap(Placed(finger, move @ gripper), stone)
        more = shared.volume / TARGET - 1
        by = move.T @ shared.gradient[0, :3] / TARGET
        off += more**2 / 2
        slope += more * by
        bend += np.outer(by, by) + more * (move.T @ shared.hessian[:3, :3] @ move) / TARGET
        words.append(f"{1e9 * shared.volume:9.4f} mm³, {1e3 * shared.depth:.3f} mm deep")
    print(f"step {step}: left {words[0]}; right {words[1]}")
    if off < 1e-18:
        break
    # Fingers that slide along a face change nothing: directions without a slope or a bend stay as they are.
    gripper -= np.linalg.lstsq(bend, slope, rcond=1e-9)[0]
