"""Results as a table of pyarrow, pandas or polars: columns with units in their names, one row per pair."""

from __future__ import annotations

import html
import importlib
from abc import ABC, abstractmethod
from collections.abc import Sequence
from itertools import chain
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from overlapper.install import hint
from overlapper.plots import of_a_moment

if TYPE_CHECKING:
    import pandas
    import polars
    import pyarrow

# The measures of a pair, by the attribute of `Overlap`, `Overlaps` and `LinkContact`, each with its columns. The unit
# is in the name of a column. A pair that only touches has no centroid. `normal` points from B to A.
MEASURES = {
    "volume": ["volume_m3"],
    "volume_error": ["volume_error_m3"],
    "centroid": [f"centroid_{axis}_m" for axis in "xyz"],
    "area": ["area_m2"],
    "depth": ["depth_m"],
    "normal": [f"normal_{axis}" for axis in "xyz"],
}

# The columns of volumetric contact, by the attribute of `Forces`: force and torque on A, the torque about the centroid,
# the energy that pressures store, and the velocity of A over B at the centroid.
FORCE_MEASURES = {
    "force": [f"force_{axis}_n" for axis in "xyz"],
    "torque": [f"torque_{axis}_nm" for axis in "xyz"],
    "energy": ["energy_j"],
    "slip": [f"slip_{axis}_m_s" for axis in "xyz"],
}

MEASURE_COLUMNS, FORCE_COLUMNS = ([*chain.from_iterable(each.values())] for each in (MEASURES, FORCE_MEASURES))

# The columns of a first overlap between two poses: the part of the motion before it, and its point in the world.
IMPACT_COLUMNS = ["impact_fraction", *(f"impact_{axis}_m" for axis in "xyz")]

MOST_ROWS = 20  # the most rows that a notebook shows

Columns = dict[str, NDArray[Any] | Sequence[Any]]


def measures_of(pair: object) -> dict[str, float | None]:
    """The values of MEASURE_COLUMNS of an Overlap or a LinkContact; None for a measure that it does not have."""
    row: dict[str, float | None] = dict.fromkeys(MEASURE_COLUMNS)
    for name, columns in MEASURES.items():
        value = getattr(pair, name, None)
        if value is not None:
            row |= zip(columns, [value] if isinstance(value, float) else value.tolist())
    return row


class Rows(ABC):
    """Rows with named columns. A missing number is null; in pandas, it is NaN."""

    __slots__ = ()

    @abstractmethod
    def columns(self) -> Columns:
        """The columns by name, all of the same length. A missing number is NaN."""

    def to_arrow(self) -> pyarrow.Table:
        """A table of pyarrow with the columns of `overlapper run`.

        Returns
        -------
        pyarrow.Table
            A row for each pair.

        Raises
        ------
        ImportError
            Without pyarrow.
        """
        arrow = _library("pyarrow")
        return arrow.table({name: arrow.array(values, from_pandas=True) for name, values in self.columns().items()})

    def to_pandas(self) -> pandas.DataFrame:
        """A table of pandas with the columns of `overlapper run`.

        Returns
        -------
        pandas.DataFrame
            A row for each pair.

        Raises
        ------
        ImportError
            Without pandas.
        """
        frame: pandas.DataFrame = _library("pandas").DataFrame(self.columns())
        return frame

    def to_polars(self) -> polars.DataFrame:
        """A table of polars with the columns of `overlapper run`.

        Returns
        -------
        polars.DataFrame
            A row for each pair.

        Raises
        ------
        ImportError
            Without polars.
        """
        frame: polars.DataFrame = _library("polars").DataFrame(self.columns(), nan_to_null=True)
        return frame

    def _repr_html_(self) -> str:
        """The first rows, as notebooks show a table."""
        columns = self.columns()
        count = len(next(iter(columns.values())))
        shown = range(min(count, MOST_ROWS))
        rows = ["".join(f"<th>{name}</th>" for name in columns)]
        rows += ["".join(f"<td>{_cell(values[i])}</td>" for values in columns.values()) for i in shown]
        more = f"<p>{count - MOST_ROWS:,} more</p>" if count > MOST_ROWS else ""
        return (
            f"<p>{type(self).__name__}, {count:,}</p><table>{''.join(f'<tr>{row}</tr>' for row in rows)}</table>{more}"
        )


class Tabular(Rows):
    """Rows with volumes and depths, which can be drawn."""

    __slots__ = ()

    def plot(self, most: int = 8) -> NDArray[Any]:
        """Draw the depth, volume and force of the pairs as bars.

        The chart is one of pyplot, as for `Log.plot`, which draws the pairs over time.

        Parameters
        ----------
        most : int, default 8
            The most pairs to draw: those with the largest volumes. The chart says if there are more.

        Returns
        -------
        (2,) or (3,) ndarray of matplotlib.axes.Axes
            The panels of depth and volume, and of force for `Forces`.

        Raises
        ------
        TypeError
            If `most` is not a whole number.
        ValueError
            If `most` is less than 1.
        ImportError
            Without matplotlib.
        """
        return of_a_moment(self.columns(), most)


def _cell(value: Any) -> str:
    if value is None or value != value:
        return ""
    return html.escape(f"{value:.5g}" if isinstance(value, float) else str(value))


def _library(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(f"a table of {name} needs {hint(name)}") from error
