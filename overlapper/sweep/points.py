"""The parameter values at which a scene is run: products of grids, seeds, samples and tables of points."""

from __future__ import annotations

import csv
import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overlapper.install import hint
from overlapper.scenes.parameters import Parameter, known, value_of

Point = dict[str, Parameter]

MOST = 10_000_000  # tasks of a sweep; a larger number is taken for a typing error


class Axis(Sequence[Point]):
    """The points of an axis, as columns of values by parameter. Dictionaries would take ten times as much memory."""

    def __init__(self, columns: Mapping[str, Sequence[Parameter]]) -> None:
        self.columns = columns

    @classmethod
    def of(cls, names: Sequence[str], rows: Iterable[Sequence[Parameter]]) -> Axis:
        """The axis of some rows, at least one."""
        return cls(dict(zip(names, zip(*rows))))

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def __getitem__(self, number: Any) -> Any:
        return {name: values[number] for name, values in self.columns.items()}

    def unique(self) -> Axis:
        """Each point once."""
        if any(isinstance(values, range) for values in self.columns.values()):
            return self
        if len(self.columns) == 1:  # avoids a tuple for each value
            ((name, values),) = self.columns.items()
            return Axis({name: [*dict.fromkeys(values)]})
        return Axis.of([*self.columns], [*dict.fromkeys(zip(*self.columns.values()))])


class Points(Sequence[Point]):
    """All parameters of each point of the product of axes, computed on access. The last axis varies fastest."""

    def __init__(self, start: Mapping[str, Parameter], axes: Sequence[Axis]) -> None:
        self._start, self._axes = dict(start), axes

    def __len__(self) -> int:
        return math.prod(map(len, self._axes))

    def __getitem__(self, number: Any) -> Any:
        if not 0 <= number < len(self):
            raise IndexError(number)
        point = self._start.copy()
        for axis in reversed(self._axes):
            number, at = divmod(number, len(axis))
            point.update(axis[at])
        return point

    def values(self, name: str, numbers: NDArray[np.intp]) -> NDArray[Any]:
        """A parameter of some points; texts stay as they are."""
        for axis in reversed(self._axes):
            numbers, at = np.divmod(numbers, len(axis))
            if name in axis.columns:
                return array_of(axis.columns[name])[at]
        return array_of([self._start[name]]).repeat(len(numbers))


def array_of(values: Sequence[Parameter]) -> NDArray[Any]:
    """The values of a parameter as an array, in which texts stay as they are."""
    return np.array(values, object if isinstance(values[0], str) else None)


@dataclass(frozen=True, slots=True)
class Space:
    """The parameters of a scene: their defaults, by name, and which of them are `settled`, the same for all points."""

    scene: str
    defaults: Mapping[str, Parameter]
    settled: Collection[str] = ()

    def grid(self, text: str) -> Axis:
        """The axis of one parameter: listed values, "friction=0.3,0.5", or a range with a count, "mass=0.1:10:20".

        A range has equal steps or, with ":log" at the end, equal factors.
        """
        name, values = self._named(text, "--grid")
        default = self.defaults[name]
        parts = values.split(":")
        if len(parts) == 1 or isinstance(default, (str, bool)):
            return Axis({name: [value_of(name, each, default) for each in values.split(",")]})
        log = parts[-1] == "log"
        if len(parts) != 3 + log:
            raise ValueError(f"--grid {text} must be {name}=FROM:TO:COUNT, {name}=FROM:TO:COUNT:log or {name}=A,B,...")
        low, high = self._bounds(name, parts[:2], log, f"--grid {text}")
        if not (parts[2].isdecimal() and 0 < (count := int(parts[2])) <= MOST):
            raise ValueError(f"--grid {text}: the count must be a whole number from 1 to {MOST:,}, not {parts[2]!r}")
        found = (np.geomspace if log else np.linspace)(low, high, count).tolist()
        return Axis({name: [round(each) for each in found] if type(default) is int else found})

    def seeds(self, count: int) -> Axis:
        """The parameter `seed` with `count` values, from 0 on."""
        if type(self.defaults.get("seed")) is not int:
            raise ValueError(f"--seeds needs a scene with a parameter `seed`, a whole number; {self.scene} has none")
        return Axis({"seed": range(count)})

    def samples(self, count: int, ranges: Sequence[str], seed: int) -> Axis:
        """A Latin hypercube sample of the ranges: "mass=0.1:10" is uniform, "mass=0.1:10:log" is log-uniform."""
        if not ranges:
            raise ValueError("--sample needs a --range NAME=FROM:TO for each parameter that it draws")
        asked = [self._range(text) for text in ranges]
        names = [name for name, *_ in asked]
        if twice := {name for name in names if names.count(name) > 1}:
            raise ValueError(f"--range gives {min(twice)} twice")
        try:
            from scipy.stats import qmc
        except ImportError as error:
            raise ImportError(f"--sample needs {hint('scipy')}") from error
        drawn = qmc.LatinHypercube(len(asked), seed=seed).random(count)
        columns = ([self._drawn(each, part) for part in parts] for each, parts in zip(asked, drawn.T.tolist()))
        return Axis(dict(zip(names, columns)))

    def _range(self, text: str) -> tuple[str, float, float, bool]:
        name, bounds = self._named(text, "--range")
        parts = bounds.split(":")
        log = parts[-1] == "log"
        if isinstance(self.defaults[name], (str, bool)) or len(parts) != 2 + log:
            raise ValueError(f"--range {text} must be {name}=FROM:TO or {name}=FROM:TO:log, with two numbers")
        return name, *self._bounds(name, parts[:2], log, f"--range {text}"), log

    def _drawn(self, asked: tuple[str, float, float, bool], part: float) -> Parameter:
        name, low, high, log = asked
        if type(self.defaults[name]) is int:  # the first and the last integer get as much room as the others
            low, high = low - 0.5 + log * 0.5, high + 0.5
        value = math.exp(math.log(low) + part * math.log(high / low)) if log else low + part * (high - low)
        if type(self.defaults[name]) is int:
            return min(max(round(value), math.ceil(low)), math.floor(high))
        return min(max(value, low), high)

    def read(self, path: Path) -> Axis:
        """The points of a CSV table. Parameters without a column keep their defaults."""
        with path.open(encoding="utf-8", newline="") as file:
            reader = csv.reader(file)
            rows = (cells for cells in reader if cells and not cells[0].startswith("#"))
            names = [name.strip() for name in next(rows, [])]
            for name in names:
                known(name, self.defaults, self.scene)
            if not names or len(set(names)) < len(names):
                raise ValueError(f"{path} must have the names of the parameters, each once, in its first line")
            points: list[list[Parameter]] = []
            for cells in rows:
                if len(cells) != len(names):
                    raise ValueError(f"{path}, line {reader.line_num}: it has {len(cells)} cells, not {len(names)}")
                try:
                    points.append([value_of(name, cell, self.defaults[name]) for name, cell in zip(names, cells)])
                except ValueError as error:
                    raise ValueError(f"{path}, line {reader.line_num}: {error}") from error
        if not points:
            raise ValueError(f"{path} has no points")
        return Axis.of(names, points)

    def crossed(self, axes: Iterable[Axis]) -> Points:
        """All parameters of each point of the product of the axes, no point twice. The last axis varies fastest."""
        axes = [*axes]
        taken = set(self.settled)
        for axis in axes:
            if twice := taken & axis.columns.keys():
                raise ValueError(f"{min(twice)} is given by two of --set, --grid, --seeds, --points and --range")
            taken |= axis.columns.keys()
        if (count := math.prod(map(len, axes))) > MOST:
            raise ValueError(f"that would be {count:,} tasks, more than {MOST:,}")
        return Points(self.defaults, [axis.unique() for axis in axes])

    def _named(self, text: str, option: str) -> tuple[str, str]:
        name, sign, values = text.partition("=")
        if not (name and sign and values):
            raise ValueError(f"{option} must be NAME=VALUES, not {text!r}")
        known(name, self.defaults, self.scene)
        return name, values

    def _bounds(self, name: str, parts: Sequence[str], log: bool, option: str) -> tuple[float, float]:
        default = self.defaults[name]
        try:
            low, high = (float(value_of(name, part, default)) for part in parts)
        except ValueError as error:
            raise ValueError(f"{option}: {error}") from error
        if not low <= high or (log and low <= 0):
            above = " above 0" if log else ""
            raise ValueError(
                f"{option} must go from a number{above} to a larger one, not from {parts[0]} to {parts[1]}"
            )
        return low, high
