"""Files that are there whole or not at all: written beside their place, and renamed.

What is being written to `run.csv` is in `run.unfinished.csv`, or, if another run is at it or was killed there, in
`run.unfinished-2.csv`, and so on. A name that is taken is never written to, so that no run disturbs another, and
nothing that a run has left is lost.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


def unfinished(place: Path, number: int = 1, ending: str | None = None) -> Path:
    """The name beside `place` of what is not to take it, or not yet; `ending` is that of `place` by default."""
    more = f"-{number}" if number > 1 else ""
    return place.with_name(f"{place.stem}.unfinished{more}{place.suffix if ending is None else ending}")


def claim(place: Path, ending: str | None = None) -> Path:
    """A new and empty file beside `place`, to be written and then moved to it; `ending` is that of `place` by default.

    OSError if there can be none, or if `place` is what no file should replace: a folder, a device.
    """
    with suppress(FileNotFoundError):
        kind = place.stat().st_mode
        if not stat.S_ISREG(kind):
            reason = errno.EISDIR if stat.S_ISDIR(kind) else errno.EINVAL
            raise OSError(reason, os.strerror(reason), str(place))
    number = 1
    while True:
        path = unfinished(place, number, ending)
        try:
            os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
            return path
        except FileExistsError:
            number += 1
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(place)) from error


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
    path = claim(Path(place))
    try:
        yield path
        settle(path, Path(place))
    except BaseException:
        path.unlink(missing_ok=True)
        raise


def must_be_writable(place: Path) -> None:
    """OSError if a file could not be put there: better now than after a run."""
    claim(place).unlink()
