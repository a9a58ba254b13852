"""Files that are written atomically: first beside their place, and then renamed.

`run.csv` is first written to `run.unfinished.csv`. If another run uses that name or was killed there, the file is
`run.unfinished-2.csv`, and so on. An existing file is never written to, so that no run disturbs another, and the data
of a killed run are not lost.

Pages, meshes and similar files are written at once, to a hidden file that is locked meanwhile. An incomplete page is of
no use, so the next run reuses the file of a killed run. Without locks (Windows, some network disks) this file stays.
"""

from __future__ import annotations

import errno
import itertools
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

try:
    import fcntl
except ImportError:  # on Windows
    fcntl = None  # type: ignore[assignment]


def unfinished(place: Path, number: int = 1, ending: str | None = None) -> Path:
    """The name beside `place` of a file that does not replace it, or not yet. Without `ending`, that of `place`."""
    more = f"-{number}" if number > 1 else ""
    return place.with_name(f"{place.stem}.unfinished{more}{place.suffix if ending is None else ending}")


def claim(place: Path, ending: str | None = None) -> Path:
    """A new, empty file beside `place`, to be written and then moved to it. The default `ending` is that of `place`.

    OSError if the file cannot be made, or if `place` is a folder or a device, which no file should replace.
    """
    _must_be_replaceable(place)
    number = 1
    while True:
        path = unfinished(place, number, ending)
        try:
            os.close(_opened(path, place, os.O_EXCL))
            return path
        except FileExistsError:
            number += 1


def _must_be_replaceable(place: Path) -> None:
    with suppress(FileNotFoundError):
        kind = place.stat().st_mode
        if not stat.S_ISREG(kind):
            reason = errno.EISDIR if stat.S_ISDIR(kind) else errno.EINVAL
            raise OSError(reason, os.strerror(reason), str(place))


def _opened(path: Path, place: Path, flags: int) -> int:
    """Open a file, and make it if it is missing. FileExistsError is about the file, any other OSError about `place`."""
    try:
        return os.open(path, os.O_RDWR | os.O_CREAT | flags, 0o666)
    except FileExistsError:
        raise
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(place)) from error


def _own(place: Path) -> tuple[Path, int | None]:
    """An empty file beside `place` and the descriptor that locks it: a new file, or the file of a killed process."""
    for number in itertools.count(1) if fcntl else ():
        path = place.with_name(f".{place.stem}.begun-by-overlapper-{number}{place.suffix}")
        descriptor = _opened(path, place, 0)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            os.close(descriptor)
            if isinstance(error, BlockingIOError):
                continue
            path.unlink(missing_ok=True)
            break  # this file system has no locks
        # Another process may have moved the file to its place since it was opened.
        if path.exists() and os.path.samestat(os.fstat(descriptor), path.stat()):
            os.ftruncate(descriptor, 0)
            return path, descriptor
        os.close(descriptor)
    return claim(place), None


def _disown(path: Path, lock: int | None, remove: bool) -> None:
    if remove:
        path.unlink(missing_ok=True)
    if lock is not None:
        os.close(lock)


def settle(written: Path, place: Path) -> None:
    """Flush the written file to the disk and move it to its place, where it replaces the earlier file."""
    # A link stays a link: its target is replaced.
    target = Path(os.path.realpath(place))
    descriptor = os.open(written, os.O_RDWR)  # Windows cannot flush a file that is open only for reading
    try:
        os.fsync(descriptor)  # a full or missing disk may raise its error only here
    finally:
        os.close(descriptor)
    with suppress(FileNotFoundError):
        os.chmod(written, stat.S_IMODE(target.stat().st_mode))
    os.replace(written, target)


@contextmanager
def beside(place: str | Path) -> Iterator[Path]:
    """An empty file to be written. It takes its place when the block ends; if the block raises, nothing changes."""
    place = Path(place)
    _must_be_replaceable(place)
    path, lock = _own(place)
    moved = False
    try:
        yield path
        settle(path, place)
        moved = True
    finally:
        _disown(path, lock, remove=not moved)


def must_be_writable(place: Path) -> None:
    """OSError if a file cannot be put at `place`, so that the error comes before a run and not after it."""
    _must_be_replaceable(place)
    _disown(*_own(place), remove=True)
