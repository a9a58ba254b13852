"""What a claim that is not proved raises, and how bounds are written."""

from __future__ import annotations

from fractions import Fraction

Bounds = tuple[Fraction, Fraction]


class CertificateError(ValueError):
    """A claim that is false, or a case for which no certificate was found; one sentence says which."""
