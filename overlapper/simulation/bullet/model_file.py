"""Files for pybullet, read in a separate process, as some files crash pybullet."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from overlapper.install import simulator_hint
from overlapper.jobs.confined import MEGABYTES, SECONDS, out_of_memory
from overlapper.jobs.worker import Ended, Worker

LOADED = "loaded"  # the first reply. Decomposition of meshes follows, which may take long and has its own limits

ENDINGS = (".urdf", ".sdf", ".xml", ".bullet")


class NotRead(Exception):
    """A file cannot be read. The message is one sentence."""


def read_apart(
    path: Path,
    answers: Callable[[Any], Iterator[Any]],
    request: tuple[Any, ...],
    endings: Sequence[str] = ENDINGS,
) -> Any:
    """The last reply of `answers` to a request, in a separate process. A reply that is a text is why reading failed.

    `answers` yields LOADED when pybullet has loaded the file. Loading has limits of time and memory. NotRead if the
    file is missing, breaks a limit, is refused by pybullet or crashes it. ImportError without pybullet.
    """
    if find_spec("pybullet") is None:
        raise ImportError(f"overlapper.simulation needs {simulator_hint()}")
    if path.suffix.lower() not in endings:
        raise NotRead(f"the name must end in {', '.join(endings)}, not {path.name!r}")
    if not path.is_file():
        raise NotRead(f"there is no file {path}")
    try:
        with Worker(answers, megabytes=MEGABYTES) as worker:
            worker.send(request)
            found = worker.receive(SECONDS)
            if found == LOADED:
                found = worker.receive()
    except Ended as ended:
        if ended.limit is not None:
            raise NotRead(f"{path} cannot be read: pybullet takes longer than {ended.limit:g} s") from None
        if out_of_memory(ended):
            raise NotRead(f"{path} cannot be read: pybullet needs more than {MEGABYTES:,} MB") from None
        if ended.code is not None and ended.code < 0:
            raise NotRead(f"pybullet crashes on {path} with signal {signal.Signals(-ended.code).name}") from None
        if not ended.words:
            raise NotRead(f"{path} cannot be read: the process that reads it {ended}") from None
        raise RuntimeError(f"the process that reads {path} {ended}:\n{ended.words}") from None
    if isinstance(found, str):
        raise NotRead(f"{path} cannot be read: {found}")
    return found


def load(path: Path, client: int, flags: int = 0) -> None:
    """Load a URDF, SDF or MJCF file, by its ending; `flags` are those of loadURDF and loadMJCF.

    Models of pybullet_data are found by their names. NotRead if pybullet refuses it.
    """
    import pybullet
    import pybullet_data

    pybullet.setAdditionalSearchPath(pybullet_data.getDataPath(), physicsClientId=client)
    try:
        match path.suffix.lower():
            case ".urdf":
                pybullet.loadURDF(str(path), flags=flags, physicsClientId=client)
            case ".xml":
                pybullet.loadMJCF(str(path), flags=flags, physicsClientId=client)
            case _:
                pybullet.loadSDF(str(path), physicsClientId=client)
    except pybullet.error as error:
        raise NotRead(f"pybullet says {str(error).strip().rstrip('.')!r}") from error
