"""A table of the overlaps in a loop of your own."""

from __future__ import annotations

import math
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal

from overlapper.simulation.bodies import AnyBodies
from overlapper.simulation.contacts import Contacts
from overlapper.tables.outputs import StepTable
from overlapper.tables.table_file import origin

if TYPE_CHECKING:
    from overlapper.simulation import Forces


class Log:
    """The table of `overlapper run` for a loop of your own: a row for each contact of each step.

        with Log("run.parquet", bodies) as log:
            for _ in range(240):
                pybullet.stepSimulation()
                bodies.update()
                log.add(bodies.overlaps())

    `path` ends in .csv, .parquet or .sqlite. Its folder is made if it does not exist. `per` says what a row is about:
    "shape" for two shapes, or "link" for two links as a whole. With `forces`, the table has columns of forces, which
    you give to `add`. The heading has the versions of this package and of the simulator, and how `bodies` treats
    surfaces and concave meshes. `settings` are further entries of the heading, as in
    `Log("run.csv", bodies, tolerance=1e-6, mu=0.5)`.

    A step is on disk when `add` returns. The table grows beside its place, as `run.unfinished.csv`. It moves to its
    place at the end of the `with`, or by `close()`, also if Ctrl-C or sys.exit() ends the loop. After an error, or if
    the process is killed, it stays where it is. It is then a table like any other, and `unfinished` says where. A
    Parquet table grows as CSV, too.

    ValueError for another ending or another `per`. TypeError without bodies. OSError if the file cannot be made.
    ImportError without the library that writes it.
    """

    def __init__(
        self,
        path: str | Path,
        bodies: AnyBodies,
        *,
        per: Literal["shape", "link"] = "shape",
        forces: bool = False,
        **settings: Any,
    ) -> None:
        if not isinstance(bodies, AnyBodies):
            raise TypeError(f"bodies must be the Bodies of a simulation, not {bodies!r}")
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        self.steps = 0
        """The number of the last step added."""
        self.unfinished: Path | None = None
        """Where the rows are that an error has kept from their place, if there are any."""
        self._bodies, self._time, self._forces = bodies, 0.0, forces
        heading = origin(bodies.engine) | bodies.settings | settings
        self._table: StepTable | None = StepTable(Path(path), heading, per, forces)

    def add(
        self, contacts: Contacts, step: int | None = None, time: float | None = None, forces: Forces | None = None
    ) -> None:
        """Write what `bodies.overlaps()` has found. Call it before the next `bodies.update()`.

        `forces` are the forces between these bodies, as `VolumetricContact.mean()` returns them. Pairs without forces
        have empty cells. `step` is by default the one after the last. `time` (s) is by default `step` times the time
        step of the simulator.

        ValueError if a step comes no later than the last, if `time` is not finite, or if `contacts` are not of these
        bodies. ValueError, too, if there are `forces` and no columns for them, or if the log is closed. OSError if the
        rows cannot be written.
        """
        if self._table is None:
            raise ValueError(f"this Log is closed: {contacts!r} came too late")
        if not isinstance(contacts, Contacts):
            raise TypeError(f"contacts must be what Bodies.overlaps() returns, not {contacts!r}")
        if forces is not None and not self._forces:
            raise ValueError("this Log has no columns of forces: say Log(..., forces=True)")
        step = self.steps + 1 if step is None else step
        if step <= self.steps:
            raise ValueError(f"step must be larger from one add() to the next: {step} came after {self.steps}")
        if time is None:
            time = step * self._bodies.time_step
        if not math.isfinite(time):
            raise ValueError(f"time must be finite, not {time}")
        strange = {key for row in contacts.keys.tolist() for key in (tuple(row[:3]), tuple(row[3:]))}
        if strange := strange.difference(self._bodies.keys):
            body, link, shape = min(strange)
            raise ValueError(f"contacts has shape {shape} of link {link} of body {body}, which is not among the bodies")
        self._table.add(step, time, self._bodies, contacts, forces=forces)
        self.steps = step

    def close(self) -> None:
        """Put the finished table in its place."""
        table, self._table = self._table, None
        if table:
            table.close()

    def __enter__(self) -> Log:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # A loop that ends without an error has not failed. Without a step nothing is written.
        if error is None or (self.steps and not isinstance(error, Exception)):
            self.close()
        elif self._table:
            self.unfinished, self._table = self._table.leave(), None
