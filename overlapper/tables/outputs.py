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
from overlapper.tables.table import COLUMNS, FORCES, IMPACTS, MUJOCO, link_rows, rows
from overlapper.tables.table_file import LEFT_OUT, TABLES, must_be_a_table
from overlapper.whole_file import must_be_writable, unfinished

if TYPE_CHECKING:
    from overlapper.reference import By, Comparison, Reference
    from overlapper.simulation.bodies import AnyBodies
    from overlapper.simulation.contacts import Contacts
    from overlapper.simulation.first_overlaps import FirstOverlaps
    from overlapper.simulation.forces.forces import Forces
    from overlapper.simulation.model import Skipped
    from overlapper.tables.frame import Frame
    from overlapper.tables.still import Still
    from overlapper.viewer.look import Look

PICTURES_PER_SECOND = 30  # of simulated time: as smooth as a film, and a tenth of the size that every step would take

Per = Literal["shape", "link"]


def can_be_written(out: Path | None, html: Path | None, *others: Path | None) -> None:
    """Check that a table, a page and other files can be written, before much has been computed.

    ValueError, OSError or ImportError if one of them cannot be.
    """
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
    """A table of overlaps that grows by the rows of each step. Its heading has the `settings`.

    `per` says whether a row is about two shapes or two links as a whole. `forces` and `between` say whether there are
    columns of forces and of first overlaps between steps, too. `check` names the program that is asked about each pair.
    ValueError for a name with an ending that is not in TABLES. OSError if the file cannot be made. ImportError without
    the library that writes it.
    """

    def __init__(
        self,
        path: Path,
        settings: Mapping[str, Any],
        per: Per = "shape",
        forces: bool = False,
        check: By | None = None,
        between: bool = False,
    ) -> None:
        must_be_a_table(path)
        if per not in ("shape", "link"):
            raise ValueError(f"per must be 'shape' or 'link', not {per!r}")
        self.path, self._per = path, per
        self._left_out: dict[Skipped, int] = {}
        texts = {name: str(value) for name, value in settings.items()}
        columns = COLUMNS | (MUJOCO if check == "mujoco" else {}) | (FORCES if forces else {})
        columns |= IMPACTS if between else {}
        self._table = TABLES[path.suffix](path, texts | {"per": per}, columns)

    def add(
        self,
        step: int,
        time: float,
        bodies: AnyBodies | Still,
        contacts: Contacts,
        opinions: Sequence[Comparison] = (),
        forces: Forces | None = None,
        first: FirstOverlaps | None = None,
    ) -> None:
        """Write the rows of a step at once.

        `opinions` are those of FCL or MuJoCo on the same contacts, if it was asked. `first` are the first overlaps
        since the step before. A body or link that is left out for
        the first time is metadata from then on.
        """
        for each in bodies.skipped:
            if each not in self._left_out:
                self._left_out[each] = step
                said = f"{each.name} from step {step} on, {each.reason}"
                self._table.remark(f"{LEFT_OUT}{len(self._left_out)}", said)
        if self._per == "link":
            self._table.write(link_rows(step, time, bodies, link_contacts(contacts), forces, first))
        else:
            self._table.write(rows(step, time, bodies, contacts, opinions, forces, first))

    @property
    def growing(self) -> Path:
        """The file that has the rows until the table is closed."""
        return self._table.growing

    def close(self) -> None:
        """Put the finished table in its place."""
        self._table.close()

    def leave(self) -> Path | None:
        """Leave the rows beside the place of the table, and return their path.

        If there are no rows, no file is left, and the result is None.
        """
        return self._table.leave()


@contextmanager
def outputs(
    summary: Summary,
    settings: Mapping[str, Any],
    written: list[Path],
    out: Path | None = None,
    html: Path | None = None,
    per: Per = "shape",
    check: Reference | None = None,
    forces: bool = False,
    growing: list[Path] | None = None,
    between: bool = False,
) -> Iterator[Callable[[Frame[Any]], None]]:
    """Give a function that takes frames, and writes them to the summary, the table `out` and the page `html`.

    Folders of `out` and `html` are made if they do not exist. The table has columns of `forces`, if frames have any,
    and of first overlaps, if frames have those `between` steps.
    `written` gets the files that exist in the end: in their place, or, if the run fails, beside it. `growing` gets the
    file that has the rows of the table until then.
    """
    for path in filter(None, (out, html)):
        path.parent.mkdir(parents=True, exist_ok=True)
    if check:
        summary.check = check.by
    with ExitStack() as stack:
        # The page is written last, and checked first.
        record = stack.enter_context(recorder(html, written)) if html else None
        table = stack.enter_context(_table(out, settings, per, forces, check, written, between)) if out else None
        if table and growing is not None:
            growing.append(table.growing)

        def take(frame: Frame[Any]) -> None:
            opinions = check.compare_contacts(frame.bodies, frame.contacts) if check else []
            if table:
                table.add(frame.step, frame.time, frame.bodies, frame.contacts, opinions, frame.forces, frame.first)
            summary.add(frame, opinions)
            if record:
                record(frame)

        yield take


@contextmanager
def _table(
    path: Path,
    settings: Mapping[str, Any],
    per: Per,
    forces: bool,
    check: Reference | None,
    written: list[Path],
    between: bool,
) -> Iterator[StepTable]:
    """Give a table to be written.

    It is named in `written` if it has rows, or if the run came to its end.
    """
    table = StepTable(path, settings, per, forces, check.by if check else None, between)
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
    """Give a function that records some of the frames it is called with, and write the page in the end.

    It records `rate` frames per second and, so that no pair is missing, each first frame in which a pair overlaps, and
    each frame in which a pair has tunnelled.
    After an error, the frames recorded until then are beside the page and named in `written`. Otherwise the page is
    named there. Without a frame, nothing is written.
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
        if due or not overlapping <= met or (frame.first and frame.first.tunnelled):
            recording.add(frame.bodies, found, frame.time, forces=frame.forces, first=frame.first or ())
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
