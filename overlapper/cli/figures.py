"""Volumes and their errors in the tables of commands."""

from __future__ import annotations

from decimal import ROUND_UP, Context

# Units for the volumes of one table, in m³: the largest of them that makes the largest volume a tenth or more.
VOLUME_UNITS = {"m³": 1.0, "cm³": 1e-6, "mm³": 1e-9, "µm³": 1e-18}


# One digit of an error bound, which must remain one.
ROUNDED_UP = Context(prec=1, rounding=ROUND_UP)


def volume_unit(largest: float) -> str:
    """The unit for the volumes of a table, by the largest of them in m³."""
    return next((unit for unit, size in VOLUME_UNITS.items() if largest >= 0.1 * size), "µm³")
