"""A count of the steps of a run, on the terminal."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TypeVar

from rich.console import Console
from rich.progress import Progress

Item = TypeVar("Item")


def with_progress(frames: Iterable[Item], name: str, steps: int) -> Iterator[Item]:
    """The frames, counted by a bar on stderr if that is a terminal."""
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        yield from progress.track(frames, total=steps, description=name)
