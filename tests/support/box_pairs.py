"""Pairs of boxes for tests of derivatives: away from kinks, where sides would lie in one plane."""

from __future__ import annotations

import numpy as np


def general_boxes(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sizes, positions, and quaternions of any length."""
    return rng.uniform(0.5, 2, (n, 3)), rng.uniform(-0.5, 0.5, (n, 3)), rng.normal(size=(n, 4))
