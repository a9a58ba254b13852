"""The settings of runs, tables and sweeps: how bodies are modelled, and which pairs are measured and how."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from numbers import Real
from typing import TYPE_CHECKING, Any, Literal, TypeVar, get_args

if TYPE_CHECKING:
    from overlapper.simulation.asked_pairs import Among

Concave = Literal["decompose", "enclose", "skip"]
Surface = Literal["nominal", "margin"]
Method = Literal["auto", "paper"]


@dataclass(frozen=True, slots=True)
class Modelling:
    """How shapes are modelled: see `simulation.Bodies`. ValueError for an invalid choice."""

    concave: Concave = "decompose"
    concave_threshold: float = 0.05
    surface: Surface = "nominal"

    def __post_init__(self) -> None:
        _must_be_one_of(self.concave, "concave", Concave)
        _must_be_one_of(self.surface, "surface", Surface)
        from overlapper.polytopes.decomposition import check_threshold

        check_threshold(self.concave_threshold)


@dataclass(frozen=True, slots=True)
class Asking:
    """Which pairs are measured, and how: see `simulation.Bodies.overlaps`. ValueError for an invalid value.

    If `pairs` is None, the scene chooses the pairs.
    """

    pairs: Among | None = None
    tolerance: float = 1e-3
    method: Method = "auto"

    def __post_init__(self) -> None:
        if not (self.pairs is None or (isinstance(self.pairs, str) and self.pairs in ("simulated", "all"))):
            from overlapper.simulation.asked_pairs import listed

            object.__setattr__(self, "pairs", listed(self.pairs))
        if not (isinstance(self.tolerance, Real) and 0 < self.tolerance < 1):
            raise ValueError(f"tolerance must be a number greater than 0 and less than 1, not {self.tolerance!r}")
        _must_be_one_of(self.method, "method", Method)


def _must_be_one_of(chosen: object, name: str, choices: Any) -> None:
    if chosen not in get_args(choices):
        raise ValueError(f"{name} must be one of {', '.join(map(repr, get_args(choices)))}, not {chosen!r}")


Settings = TypeVar("Settings", Modelling, Asking)


def settings_of(*values: Modelling | Asking) -> dict[str, Any]:
    """The settings by name, for keyword arguments and headings of tables."""
    return {each.name: getattr(value, each.name) for value in values for each in fields(value)}


def read_settings(kind: type[Settings], heading: Mapping[str, str]) -> Settings:
    """The settings in the heading of a table. Missing ones have their defaults. ValueError for an invalid one."""
    told = {
        each.name: float(heading[each.name]) if isinstance(each.default, float) else heading[each.name]
        for each in fields(kind)
        if heading.get(each.name, "None") != "None"
    }
    return kind(**told)  # type: ignore[arg-type]  # an invalid text is refused
