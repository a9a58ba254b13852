"""Files that are there whole or not at all: written beside their place, and renamed.

What is being written to `run.csv` is in `run.unfinished.csv`, or, if another run is at it or was killed there, in
`run.unfinished-2.csv`, and so on. A name that is taken is never written to, so that no run disturbs another, and
nothing that a run has left is lost.

Pages, meshes and the like are written at once, to a hidden file that is locked meanwhile. A part of a page is of no
use: the next run takes over what a killed one has left. Without locks (Windows, some network disks) it stays.
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
    """The name beside `place` of what is not to take it, or not yet; `ending` is that of `place` by default."""
    more = f"-{number}" if number > 1 else ""
    return place.with_name(f"{place.stem}.unfinished{more}{place.suffix if ending is None else ending}")


def claim(place: Path, ending: str | None = None) -> Path:
    """A new and empty file beside `place`, to be written and then moved to it; `ending` is that of `place` by default.

    OSError if there can be none, or if `place` is what no file should replace: a folder, a device.
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
    """A file that is made if it is not there. FileExistsError is of the file, any other OSError of its place."""
    try:
        return os.open(path, os.O_RDWR | os.O_CREAT | flags, 0o666)
    except FileExistsError:
        raise
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(place)) from error


def _own(place: Path) -> tuple[Path, int | None]:
    """An empty file beside `place` and the descriptor that locks it: a new file, or what a killed process has left."""
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
    """Move what was written to its place, on the disk itself; what was there is gone from then on."""
    # A link stays one: what it points to is replaced.
    target = Path(os.path.realpath(place))
    descriptor = os.open(written, os.O_RDWR)  # Windows puts no file on the disk that is open to be read alone
    try:
        os.fsync(descriptor)  # a disk that is full, or gone, may say so no earlier
    finally:
        os.close(descriptor)
    with suppress(FileNotFoundError):
        os.chmod(written, stat.S_IMODE(target.stat().st_mode))
    os.replace(written, target)


@contextmanager
def beside(place: str | Path) -> Iterator[Path]:
    """An empty file to be written, which takes its place when the block ends; if that raises, all is as it was."""
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
    """OSError if a file could not be put there: better now than after a run."""
    _must_be_replaceable(place)
    _disown(*_own(place), remove=True)
