"""Run a Python script as Python does, and let the caller do something before the process ends."""

from __future__ import annotations

import sys
import threading
from collections.abc import Sequence
from contextlib import suppress
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType, TracebackType

STANDS_IN = "__stands_in__"
"""A global name of modules whose functions replace those of a simulator, to report their calls."""


def run_script(path: Path, arguments: Sequence[str]) -> BaseException | None:
    """Run the script as __main__, and wait for its threads. Returns the exception that ended it, if any.

    The traceback of the exception has been shown, without frames of this package; `end_as` does the rest. OSError if
    the file cannot be read.
    """
    place = path.absolute()
    source = path.read_bytes()
    main = ModuleType("__main__")
    main.__dict__.update(
        __file__=str(place),
        __builtins__=__builtins__,
        __loader__=SourceFileLoader("__main__", str(place)),
        __annotations__={},
        __cached__=None,
    )
    # Keep the former __main__ alive, as code may still hold objects of it.
    sys.modules["__main__"], main.__dict__["__overlapper__"] = main, sys.modules["__main__"]
    sys.argv[:] = [str(path), *arguments]
    sys.path[0] = str(place.resolve().parent)
    try:
        exec(compile(source, str(place), "exec", dont_inherit=True), main.__dict__)
        _wait_for_threads()
    except SystemExit as ended:
        with suppress(KeyboardInterrupt):
            _wait_for_threads()
        return ended
    except BaseException as error:
        shown = error.with_traceback(_of_script(error.__traceback__, str(place)))
        sys.excepthook(type(error), shown, shown.__traceback__)
        return error
    return None


def _wait_for_threads() -> None:
    for thread in threading.enumerate():
        if not thread.daemon and thread is not threading.current_thread():
            thread.join()


def _of_script(trace: TracebackType | None, place: str) -> TracebackType | None:
    """The part of a traceback from the script's first line to a replaced function of a simulator, if there is one."""
    entries: list[TracebackType] = []
    while trace:
        if entries and STANDS_IN in trace.tb_frame.f_globals:
            break
        if entries or trace.tb_frame.f_code.co_filename == place:
            entries.append(trace)
        trace = trace.tb_next
    kept = None
    for entry in reversed(entries):
        kept = TracebackType(kept, entry.tb_frame, entry.tb_lasti, entry.tb_lineno)
    return kept


def end_as(ended: BaseException | None) -> None:
    """Let Python end the process as it would after the script: with the same exit code, signal and messages."""
    if ended is None:
        return
    if not isinstance(ended, SystemExit):
        sys.excepthook = lambda *_: None  # the traceback has been shown
    raise ended
