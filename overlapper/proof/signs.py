"""Signs of numbers that are exact, or that lie in a ball that may be too wide to decide the sign."""

from __future__ import annotations

from flint import arb, fmpq


class Undecided(ArithmeticError):
    """A ball is too wide to decide a sign."""


def is_positive(x: arb | fmpq) -> bool:
    """Whether a number is positive. Exact numbers may be zero; Undecided for a ball that holds zero."""
    if x > 0:
        return True
    if x < 0 or x == 0:
        return False
    raise Undecided


def sign(x: arb | fmpq) -> int:
    if x > 0:
        return 1
    if x < 0:
        return -1
    if x == 0:
        return 0
    raise Undecided
