"""A table of the overlaps in a loop of your own."""

from __future__ import annotations

import math
from array import array
from numbers import Real
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal

from numpy.typing import NDArray

from overlapper.columns import Tabular
from overlapper.simulation.bodies import AnyBodies
from overlapper.simulation.contacts import Contacts
from overlapper.simulation.first_overlaps import FirstOverlaps
from overlapper.tables.outputs import StepTable
from overlapper.tables.table_chart import drawn
from overlapper.tables.table_file import origin
from overlapper.whole_number import whole

if TYPE_CHECKING:
    from overlapper.simulation import Forces


class Log:
    """The table of `overlapper run` for a loop of your own: a row for each contact of each step.

        with Log("run.parquet", bodies) as log:
            for _ in range(240):
                pybullet.stepSimulation()
                bodies.update()
                log.add(bodies.overlaps())

    A step is on disk when `add` returns. The table grows beside its place, as `run.unfinished.csv`. It moves to its
    place at the end of the `with`, or by `close()`, also if Ctrl-C or sys.exit() ends the loop. After an error, or if
    the process is killed, it stays where it is. It is then a table like any other, and `unfinished` is its path. A
    Parquet table grows as CSV, too.

    Parameters
    ----------
    path : str or Path
        The file, which ends in .csv, .parquet or .sqlite. Its folder is made if it does not exist.
    bodies : Bodies
        The bodies of a simulation. The heading has their settings and the versions of package and simulator.
    per : {'shape', 'link'}, default 'shape'
        A row is a pair of shapes, or a pair of whole links.
    forces : bool, default False
        Whether the table has columns for the forces that `add` takes.
    between : bool, default False
        Whether the table has columns for the first overlaps that `add` takes.
    **settings : Any
        Further entries of the heading, as in Log("run.csv", bodies, tolerance=1e-6, mu=0.5).

    Raises
    ------
    TypeError
        If `bodies` is not the Bodies of a simulation.
    ValueError
        If the file has another ending, or `per` is unknown.
    OSError
        If the file cannot be made.
    ImportError
        Without the library that writes the file.
    """

    def __init__(
        self,
        path: str | Path,
        bodies: AnyBodies,
        *,
        per: Literal["shape", "link"] = "shape",
        forces: bool = False,
        between: bool = False,
        **settings: Any,
    ) -> None:
        if not isinstance(path, (str, PathLike)):
            raise TypeError(f"path must be the name of a file, not {path!r}")
        if not isinstance(bodies, AnyBodies):
            raise TypeError(f"bodies must be the Bodies of a simulation, not {bodies!r}")
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        self.steps = 0
        """The number of the last step added."""
        self.unfinished: Path | None = None
        """Where the rows are that an error has kept from their place, if there are any."""
        self._bodies, self._forces, self._between = bodies, forces, between
        self._moments = array("q"), array("d")
        self._written: Path | None = None
        heading = origin(bodies.engine) | bodies.settings | settings
        self._table: StepTable | None = StepTable(Path(path), heading, per, forces, between=between)

    def add(
        self,
        contacts: Contacts,
        step: int | None = None,
        time: float | None = None,
        forces: Forces | None = None,
        first: FirstOverlaps | None = None,
    ) -> None:
        """Write the contacts of a step. Call it before the next `bodies.update()`.

        Parameters
        ----------
        contacts : Contacts
            What `bodies.overlaps()` returns.
        step : int, optional
            Number of the step, larger than the last one. Default: the last one plus 1.
        time : float, optional
            Simulated time, s. Default: `step` times the time step of the simulator.
        forces : Forces, optional
            Forces between these bodies, as `VolumetricContact.mean()` returns them. Pairs without forces have empty
            cells.
        first : FirstOverlaps, optional
            Pairs that met since the step before, as `bodies.first_overlaps()` returns them. Pairs that passed through
            each other get rows with the status "tunnelled".

        Raises
        ------
        TypeError
            If `contacts` is something else.
        ValueError
            If `step` is not larger than the last one, `time` is not finite, or `contacts` are of other bodies. Also if
            there are `forces` or `first` but no columns for them, or if the log is closed.
        OSError
            If the rows cannot be written.
        """
        if self._table is None:
            raise ValueError(f"this Log is closed, so {contacts!r} cannot be added")
        if not isinstance(contacts, Contacts):
            raise TypeError(f"contacts must be what Bodies.overlaps() returns, not {contacts!r}")
        if forces is not None and not self._forces:
            raise ValueError("this Log has no columns for forces: make it with Log(..., forces=True)")
        if forces is not None and not isinstance(forces, Tabular):
            raise TypeError(f"forces must be what VolumetricContact.mean() returns, not {forces!r}")
        if first is not None and not self._between:
            raise ValueError("this Log has no columns for first overlaps: make it with Log(..., between=True)")
        if first is not None and not isinstance(first, FirstOverlaps):
            raise TypeError(f"first must be what Bodies.first_overlaps() returns, not {first!r}")
        step = self.steps + 1 if step is None else whole(step, "step")
        if step <= self.steps:
            raise ValueError(f"step must be larger from one add() to the next: {step} came after {self.steps}")
        if time is None:
            time = step * self._bodies.time_step
        if not (isinstance(time, Real) and math.isfinite(time)):
            raise ValueError(f"time must be a finite number of seconds, not {time!r}")
        used = [*contacts.keys.tolist(), *(each.key for each in first or ())]
        strange = {key for row in used for key in (tuple(row[:3]), tuple(row[3:]))}
        if strange := strange.difference(self._bodies.keys):
            body, link, shape = min(strange)
            raise ValueError(f"contacts has shape {shape} of link {link} of body {body}, which is not among the bodies")
        self._table.add(step, time, self._bodies, contacts, forces=forces, first=first)
        self.steps = step
        for each, value in zip(self._moments, (step, time)):
            each.append(value)

    def plot(self, most: int = 8) -> NDArray[Any]:
        """Draw the depth, volume and force of the pairs over time, as far as the loop has come.

        The chart is one of pyplot: a notebook shows it, `matplotlib.pyplot.show()` opens a window, and
        `log.plot()[0].figure.savefig("run.png")` needs no display. A line is a row of the table: a pair of shapes, or
        a pair of links with `per="link"`. A pair is drawn as 0 in a step without contact. The force is the length of
        the force between the two. The rows are read from the table.

        Parameters
        ----------
        most : int, default 8
            The most pairs to draw: those with the largest volumes. The chart says if there are more.

        Returns
        -------
        (2,) or (3,) ndarray of matplotlib.axes.Axes
            The panels of depth and volume, and of force if the log has columns for forces.

        Raises
        ------
        TypeError
            If `most` is not a whole number.
        ValueError
            If the log has no steps yet, or `most` is less than 1.
        OSError
            If the table was moved or removed.
        ImportError
            Without matplotlib.
        """
        if not self.steps:
            raise ValueError("this Log has no steps to draw: add() writes one")
        path = self._table.growing if self._table else self._written
        return drawn(path, self._forces, *self._moments, most)

    def close(self) -> None:
        """Put the finished table in its place."""
        table, self._table = self._table, None
        if table:
            self._written = table.growing  # where the rows stay if the table cannot be put in its place
            table.close()
            self._written = table.path

    def __enter__(self) -> Log:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # A loop that ends without an error has not failed. Without a step nothing is written.
        if error is None or (self.steps and not isinstance(error, Exception)):
            self.close()
        elif self._table:
            self._written = self.unfinished = self._table.leave()
            self._table = None
