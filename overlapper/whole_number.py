"""Arguments that must be whole numbers."""

from __future__ import annotations

import numpy as np


def whole(value: object, name: str) -> int:
    """The value of the argument `name` as an int. TypeError if it is not a whole number."""
    if not isinstance(value, (int, np.integer)) or isinstance(value, bool):
        raise TypeError(f"{name} must be a whole number, not {value!r}")
    return int(value)
