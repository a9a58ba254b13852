"""Charts of the depth, volume and force of pairs, over time or at one moment, by pyplot."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence, Sized
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overlapper.install import hint
from overlapper.whole_number import whole

Array = NDArray[np.float64]
Axes = NDArray[Any]

KEY = [f"{word}{side}" for side in "AB" for word in ("body", "link", "shape")]

# Each measure with its columns, and with its units in SI units, the largest first.
MEASURES = {
    "depth": (["depth_m"], {"m": 1.0, "mm": 1e-3, "µm": 1e-6}),
    "volume": (["volume_m3"], {"m³": 1.0, "cm³": 1e-6, "mm³": 1e-9}),
    "force": ([f"force_{axis}_n" for axis in "xyz"], {"N": 1.0}),
}

# The columns of a table that a chart over time needs, if the table has them.
NEEDED = {"step", "nameA", "nameB", *KEY, *chain.from_iterable(names for names, _ in MEASURES.values())}


def over_time(columns: Mapping[str, Any], steps: Sequence[int], times: Sequence[float], most: int) -> Axes:
    """Lines of the pairs with the largest volumes, from columns of a table. A pair is 0 in a step without its row."""
    keys = _keys(columns)
    measures = _measures(columns)
    largest: dict[Any, float] = {}
    for key, volume in zip(keys, measures["volume"].tolist()):
        largest[key] = max(volume, largest.get(key, 0.0))
    shown = _largest(largest, most)
    labels = _labels(columns, keys)
    place = {step: i for i, step in enumerate(steps)}
    figure, axes = _axes(len(measures), 1, figsize=(8, 0.8 + 1.8 * len(measures)), sharex=True)
    for ax, (name, values) in zip(axes, measures.items()):
        lines = {key: np.zeros(len(steps)) for key in shown}
        for key, step, value in zip(keys, columns["step"], values):
            if key in lines and step in place:  # Ctrl-C may have come between the rows of a step and its time
                lines[key][place[step]] = value
        unit, factor = _unit(name, lines.values())
        for k, (key, line) in enumerate(lines.items()):
            # matplotlib repeats its colours after ten lines.
            look = {"linestyle": ["-", "--", ":", "-."][k // 10 % 4], "marker": "." if len(steps) == 1 else None}
            ax.plot(times, line / factor, linewidth=1.2, label=labels[key], **look)
        ax.set(ylabel=f"{name}, {unit}")
        ax.grid(alpha=0.3)
    axes[-1].set(xlabel="time, s")
    if shown:
        handles = axes[0].get_legend_handles_labels()
        figure.legend(*handles, loc="outside lower center", ncols=2, fontsize=8)
    _say_what_is_left_out(figure, shown, largest)
    return axes


def of_a_moment(columns: Mapping[str, Any], most: int) -> Axes:
    """Bars of the pairs with the largest volumes, from columns of a table of one step."""
    keys = _keys(columns)
    measures = _measures(columns)
    labels = _labels(columns, keys)
    shown = _largest(dict(zip(keys, measures["volume"].tolist())), most)
    rows = [keys.index(key) for key in shown]
    size = (0.6 + 3.2 * len(measures), 1.2 + 0.28 * max(len(rows), 1))
    figure, axes = _axes(1, len(measures), figsize=size, sharey=True)
    for ax, (name, values) in zip(axes, measures.items()):
        unit, factor = _unit(name, [values[rows]])
        ax.barh(range(len(rows)), values[rows] / factor, height=0.6)
        ax.set(xlabel=f"{name}, {unit}", xlim=(0, None))
        ax.grid(axis="x", alpha=0.3)
    axes[0].set_yticks(range(len(rows)), [labels[key] for key in shown], fontsize=8)
    axes[0].invert_yaxis()
    _say_what_is_left_out(figure, shown, keys)
    return axes


def _axes(rows: int, columns: int, **how: Any) -> tuple[Any, Axes]:
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise ImportError(f"a plot needs {hint('matplotlib')}") from error
    figure, axes = pyplot.subplots(rows, columns, layout="constrained", squeeze=False, **how)
    return figure, axes.ravel()


def _keys(columns: Mapping[str, Any]) -> list[Any]:
    """The pair of each row. Pairs of links have no shapes."""
    return [*zip(*(columns.get(name, [None] * len(columns["nameA"])) for name in KEY))]


def _measures(columns: Mapping[str, Any]) -> dict[str, Array]:
    """The measures that have columns, each with a value for each row. A missing value is NaN."""
    return {
        name: np.linalg.norm(np.array([columns[each] for each in names], dtype=float), axis=0)
        for name, (names, _) in MEASURES.items()
        if names[0] in columns
    }


def _largest(volumes: Mapping[Any, float], most: int) -> list[Any]:
    if whole(most, "most") < 1:
        raise ValueError(f"most must be 1 or more, not {most}")
    return sorted(volumes, key=lambda key: -volumes[key])[:most]


def _labels(columns: Mapping[str, Any], keys: Sequence[Any]) -> dict[Any, str]:
    """The names of the two links of each pair, with the numbers of the shapes if several pairs have these names."""
    names = dict(zip(keys, zip(columns["nameA"], columns["nameB"])))
    known = Counter(names.values())

    def label(key: Any) -> str:
        a, b = names[key]
        return f"{a} and {b}" if known[a, b] == 1 or key[2] is None else f"{a}[{key[2]}] and {b}[{key[5]}]"

    return {key: label(key) for key in names}


def _unit(name: str, values: Iterable[Array]) -> tuple[str, float]:
    """The largest unit that is not larger than the largest value, with its size."""
    largest = max((float(np.fmax.reduce(each, initial=0.0)) for each in values), default=0.0)
    units = MEASURES[name][1]
    return next((each for each in units.items() if each[1] <= largest), [*units.items()][-1])


def _say_what_is_left_out(figure: Any, shown: Sequence[Any], known: Sized) -> None:
    if not known:
        figure.suptitle("no contacts", fontsize=9)
    elif len(known) > len(shown):
        figure.suptitle(f"the {len(shown)} of {len(known)} pairs with the largest volumes", fontsize=9)
