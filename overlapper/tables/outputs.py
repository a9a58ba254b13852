"""The outputs of a run: a table, a page and a summary, written frame by frame, for scenes and for scripts."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from overlapper import Overlaps
from overlapper.simulation.links import link_contacts
from overlapper.tables.summary import Summary
from overlapper.tables.table import COLUMNS, FORCES, link_rows, rows
from overlapper.tables.table_file import LEFT_OUT, TABLES, must_be_a_table
from overlapper.whole_file import must_be_writable, unfinished

if TYPE_CHECKING:
    from overlapper.reference import Comparison, Fcl
    from overlapper.simulation.bodies import AnyBodies
    from overlapper.simulation.contacts import Contacts
    from overlapper.simulation.forces.forces import Forces
    from overlapper.simulation.model import Skipped
    from overlapper.tables.frame import Frame
    from overlapper.tables.still import Still
    from overlapper.viewer.look import Look

PICTURES_PER_SECOND = 30  # of simulated time: as smooth as a film, and a tenth of the size that every step would take

Per = Literal["shape", "link"]


def can_be_written(out: Path | None, html: Path | None, *others: Path | None) -> None:
    """Now, not when much has been computed: ValueError, OSError or ImportError of a table, a page or a file that cannot
    be."""
    if out:
        must_be_a_table(out)
    if html:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of meshcat's imports, and no business of the user's
            import overlapper.viewer.recording  # noqa: F401
    for path in filter(None, (out, html, *others)):
        path.parent.mkdir(parents=True, exist_ok=True)
        must_be_writable(path)


class StepTable:
    """A table of overlaps that grows by what a step has found; the heading has the `settings`.

    `per` says whether a row is of two shapes or of two links as a whole, `forces` whether there are columns of forces,
    too. ValueError for a name of another ending than those of TABLES, OSError if there can be no such file, ImportError
    without the library that writes it.
    """

    def __init__(self, path: Path, settings: Mapping[str, Any], per: Per = "shape", forces: bool = False) -> None:
        must_be_a_table(path)
        if per not in ("shape", "link"):
            raise ValueError(f"per must be 'shape' or 'link', not {per!r}")
        self.path, self._per = path, per
        self._left_out: dict[Skipped, int] = {}
        texts = {name: str(value) for name, value in settings.items()}
        self._table = TABLES[path.suffix](path, texts | {"per": per}, COLUMNS | FORCES if forces else COLUMNS)

    def add(
        self,
        step: int,
        time: float,
        bodies: AnyBodies | Still,
        contacts: Contacts,
        opinions: Sequence[Comparison] = (),
        forces: Forces | None = None,
    ) -> None:
        """Write the rows of a step at once; `opinions` are FCL's of the same contacts, if it was asked.

        A body or link that is left out for the first time is metadata from then on.
        """
        for each in bodies.skipped:
            if each not in self._left_out:
                self._left_out[each] = step
                said = f"{each.name} from step {step} on, {each.reason}"
                self._table.remark(f"{LEFT_OUT}{len(self._left_out)}", said)
        if self._per == "link":
            self._table.write(link_rows(step, time, bodies, link_contacts(contacts), forces))
        else:
            self._table.write(rows(step, time, bodies, contacts, opinions, forces))

    def close(self) -> None:
        """Put the table in its place."""
        self._table.close()

    def leave(self) -> Path | None:
        """Leave the rows beside the place, and say where they are; None, and nothing is left, if there are none."""
        return self._table.leave()


@contextmanager
def outputs(
    summary: Summary,
    settings: Mapping[str, Any],
    written: list[Path],
    out: Path | None = None,
    html: Path | None = None,
    per: Per = "shape",
    fcl: Fcl | None = None,
    forces: bool = False,
) -> Iterator[Callable[[Frame[Any]], None]]:
    """Takes frames in: into the summary, the table `out` and the page `html`, in whose folders there may be none yet.

    The table has columns of `forces`, if frames have any. `written` gets the files that there are in the end: in their
    place, or, if the run fails, beside it.
    """
    for path in filter(None, (out, html)):
        path.parent.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        # The page is written last, and checked first.
        record = stack.enter_context(recorder(html, written)) if html else None
        table = stack.enter_context(_table(out, settings, per, forces, written)) if out else None

        def take(frame: Frame[Any]) -> None:
            opinions = fcl.compare_many(contact.overlap for contact in frame.contacts) if fcl else []
            if table:
                table.add(frame.step, frame.time, frame.bodies, frame.contacts, opinions, frame.forces)
            summary.add(frame, opinions)
            if record:
                record(frame)

        yield take


@contextmanager
def _table(path: Path, settings: Mapping[str, Any], per: Per, forces: bool, written: list[Path]) -> Iterator[StepTable]:
    """A table to be written; named in `written` if it has rows, or the run came to its end."""
    table = StepTable(path, settings, per, forces)
    try:
        yield table
    except BaseException as error:
        left = table.leave()
        if isinstance(error, Exception) and left:
            written.append(left)
        raise
    table.close()
    written.append(path)


@contextmanager
def recorder(
    path: Path, written: list[Path], looks: Sequence[Look] = (), rate: float = PICTURES_PER_SECOND
) -> Iterator[Callable[[Frame[Any]], None]]:
    """Records some of the frames it is called with, and writes the page in the end.

    Besides `rate` frames per second these are the first in which a pair overlaps, so that none is missing.
    After an error, what was recorded until then is beside the page, and named in `written`, as the page is else.
    Nothing is written of no frame.
    """
    from overlapper.viewer import Recording

    must_be_writable(path)
    recording = Recording(*looks)
    shown = 0
    met: set[tuple[int, ...]] = set()

    def record(frame: Frame[Any]) -> None:
        nonlocal shown
        found = frame.contacts
        overlapping = set(map(tuple, found.keys[found.overlaps.status == Overlaps.OVERLAPPING].tolist()))
        due = frame.time * rate >= shown
        if due or not overlapping <= met:
            recording.add(frame.bodies, found, frame.time, forces=frame.forces)
            met.update(overlapping)
            shown += due

    try:
        yield record
    except Exception:
        if shown:
            with suppress(OSError):  # the error says enough
                written.append(recording.save(unfinished(path)))
        raise
    if shown:
        written.append(recording.save(path))
