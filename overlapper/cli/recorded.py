"""Steps as they come: counted on the terminal, and recorded to a page."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from rich.console import Console
from rich.progress import Progress

from overlapper.whole_file import must_be_writable, unfinished

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
    path: Path, written: list[Path], looks: Sequence[Look] = (), rate: float = PICTURES_PER_SECOND
) -> Iterator[Callable[[View], None]]:
    """Records some of the frames it is called with, and writes the page in the end.

    After an error, what was recorded until then is beside the page, and named in `written`, as the page is else.
    Nothing is written of no frame.
    """
    from overlapper.viewer import Recording

    must_be_writable(path)
    recording = Recording(*looks)
    shown = 0

    def record(frame: View) -> None:
        nonlocal shown
        if frame.time * rate >= shown:
            recording.add(frame.bodies, frame.contacts, frame.time)
            shown += 1

    try:
        yield record
    except Exception:
        if shown:
            with suppress(OSError):  # the error says enough
                written.append(recording.save(unfinished(path)))
        raise
    if shown:
        written.append(recording.save(path))
