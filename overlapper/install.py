"""What to install where a library is missing: its own name, as this package may be on no index."""

from __future__ import annotations


def hint(*packages: str) -> str:
    """The packages, and the command that installs them: the end of a sentence of what needs them."""
    return f"{' and '.join(packages)}: pip install {' '.join(packages)}"
