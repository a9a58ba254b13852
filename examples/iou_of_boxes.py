"""Intersection over union of boxes, axis-aligned and turned, and of any convex hulls."""

import numpy as np

from overlapper import Box, Placed, iou

cube = Box([0.5, 0.5, 0.5])


def turned(degrees: float) -> tuple[float, float, float, float]:
    """The quaternion xyzw of a turn about z."""
    half = np.radians(degrees) / 2
    return 0.0, 0.0, np.sin(half), np.cos(half)


print(f"a box with itself      {iou(cube, cube):.9f}")
print(f"shifted by half        {iou(cube, Placed(cube, (0.5, 0, 0))):.9f}  (exactly 1/3)")
print(f"turned by 45 degrees   {iou(cube, Placed(cube, orientation=turned(45))):.9f}  (exactly 1/√2)")
print(f"apart                  {iou(cube, Placed(cube, (2, 0, 0))):.9f}")

# Corners of detected boxes, (8, 3) in any order, go in as they are.
corners = np.array([[x, y, z] for x in (0, 4) for y in (0, 2) for z in (0, 1.5)])
yaw = np.array([[np.cos(0.1), -np.sin(0.1), 0], [np.sin(0.1), np.cos(0.1), 0], [0, 0, 1]])
print(f"a car and its guess    {iou(corners, corners @ yaw.T + [0.2, 0.1, 0.0]):.9f}")
