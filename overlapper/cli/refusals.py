"""Errors that the user can correct, as one sentence on stderr. Stdout is kept for the answer."""

from __future__ import annotations

import ctypes
import os
import sys
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from pathlib import Path
from typing import BinaryIO, NoReturn, TextIO

from overlapper.jobs.worker import NotStarted
from overlapper.printable import first_line, printable
from overlapper.scenes.scene import SceneError, engine_in, find_scene
from overlapper.simulation.cautions import NoDirectionWarning, SubstepsWarning, UnknownBodyWarning, UnsettledWarning
from overlapper.simulation.engine import engine

LIBC = ctypes.CDLL("ucrtbase" if sys.platform == "win32" else None)


class Refused(Exception):
    """The request cannot be carried out. The message is one sentence for the user."""


class Interrupted(Exception):
    """Ctrl-C came before there was anything to keep."""


def say(line: str, file: TextIO | None = None) -> None:
    """Print a line to `file`, by default stdout. Control characters of terminals are spelled out."""
    print(printable(line), file=file or sys.stdout, flush=True)


def give_up(sentence: str) -> NoReturn:
    say(f"overlapper: {sentence}", sys.stderr)
    sys.exit(2)


@contextmanager
def input_refusals() -> Iterator[None]:
    """Turns errors of files and databases into one sentence, and Ctrl-C into Interrupted."""
    try:
        yield
    except KeyboardInterrupt as error:
        raise Interrupted from error
    except OSError as error:
        raise Refused(f"{error.filename}: {error.strerror}" if error.filename else first_line(error)) from error
    except (ImportError, ValueError, NotStarted) as error:
        raise Refused(str(error)) from error
    except Exception as error:
        # SQLAlchemy may not be there to name the class; its message goes on for lines about itself.
        if not type(error).__module__.startswith("sqlalchemy."):
            raise
        raise Refused(f"the database says: {first_line(getattr(error, 'orig', None) or error)}") from error


@contextmanager
def scene_refusals(noise: BinaryIO) -> Iterator[None]:
    """Turns errors that the user can correct into one sentence. The last line that C has printed may add the cause."""
    try:
        yield
    except KeyboardInterrupt as error:
        raise Interrupted from error
    except (ImportError, NotStarted) as error:
        raise Refused(str(error)) from error
    except OSError as error:
        raise Refused(f"cannot write {error.filename or 'the results'}: {error.strerror or error}") from error
    except SceneError as error:
        LIBC.fflush(None)
        noise.seek(0)
        last_words = noise.read().decode(errors="replace").strip().rpartition("\n")[2]
        raise Refused(f"{error} ({last_words})" if last_words else str(error)) from error


@contextmanager
def quiet() -> Iterator[BinaryIO]:
    """Keeps stdout for the answer. Output of Python goes to stderr, output of C (as pybullet) to the yielded file."""
    with tempfile.TemporaryFile() as noise, redirect_stdout(sys.stderr), warnings.catch_warnings(), diverted(1, noise):
        warnings.simplefilter("ignore", UserWarning)  # of shapes left out: the summary names them
        _tell_some_warnings()
        yield noise


def _tell_some_warnings() -> None:
    """Write warnings of volumetric contact, and of names without a body, to stderr, a sentence each."""
    told = NoDirectionWarning, SubstepsWarning, UnknownBodyWarning, UnsettledWarning
    others = warnings.showwarning
    for category in told:
        warnings.simplefilter("always", category)

    def show(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        if issubclass(category, told):
            say(f"overlapper: {message}", sys.stderr)
        else:
            others(message, category, filename, lineno, file, line)

    warnings.showwarning = show


@contextmanager
def diverted(descriptor: int, file: BinaryIO) -> Iterator[None]:
    """Redirects all output to a file descriptor to `file`, within the block."""
    kept = os.dup(descriptor)
    os.dup2(file.fileno(), descriptor)
    try:
        yield
    finally:
        LIBC.fflush(None)  # or what C still holds would follow later
        os.dup2(kept, descriptor)
        os.close(kept)


def import_engine(scene: str | Path) -> None:
    """Import the engine of a scene, if the scene and the engine exist. ImportError says what to install.

    A missing scene and an unknown engine are refused where the scene is loaded. Output to stderr is dropped, because
    pybullet prints its build time on import.
    """
    with suppress(SceneError, OSError, ValueError), open(os.devnull, "wb") as nowhere, diverted(2, nowhere):
        path = find_scene(scene)
        engine(engine_in(path, path.read_bytes()))
