"""The error of claims that are not proved, and the type of bounds."""

from __future__ import annotations

from fractions import Fraction

Bounds = tuple[Fraction, Fraction]


class CertificateError(ValueError):
    """A claim that is false, or a case for which no certificate was found. The text is one sentence."""
