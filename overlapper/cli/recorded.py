"""Steps as they come: counted on the terminal, and recorded to a page."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from rich.console import Console
from rich.progress import Progress

if TYPE_CHECKING:
    from overlapper.scenes.playback import View
    from overlapper.viewer.look import Look

Item = TypeVar("Item")

PICTURES_PER_SECOND = 30  # of simulated time: as smooth as a film, and a tenth of the size that every step would take


def with_progress(frames: Iterable[Item], name: str, steps: int) -> Iterator[Item]:
    """The frames, counted by a bar on stderr if that is a terminal."""
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        yield from progress.track(frames, total=steps, description=name)


@contextmanager
def recorder(
    path: Path, looks: Sequence[Look] = (), rate: float = PICTURES_PER_SECOND
) -> Iterator[Callable[[View], None]]:
    """Records some of the frames it is called with, and writes the page in the end, however that comes."""
    from overlapper.viewer import Recording

    path.touch()  # better refused now than after the run
    recording = Recording(*looks)
    shown = 0

    def record(frame: View) -> None:
        nonlocal shown
        if frame.time * rate >= shown:
            recording.add(frame.bodies, frame.contacts, frame.time)
            shown += 1

    try:
        yield record
    finally:
        if shown:
            recording.save(path)
