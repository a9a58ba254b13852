"""The options that choose where tasks run: in processes of this machine, or on a Ray cluster."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from overlapper.cli.refusals import Refused

if TYPE_CHECKING:
    from overlapper.jobs.executor import Executor

EngineOption = Annotated[
    Literal["processes", "ray"],
    typer.Option(help="Where tasks run: in processes of this machine, or on a Ray cluster."),
]

AddressOption = Annotated[
    str | None, typer.Option(help="Address of the Ray cluster: host:port or auto. Default: a cluster on this machine.")
]

WorkersOption = Annotated[
    int | None, typer.Option(min=1, help="Number of tasks at a time. Default: one on each core.", show_default=False)
]


def working(
    workers: WorkersOption = None, engine: EngineOption = "processes", address: AddressOption = None
) -> AbstractContextManager[Executor]:
    """The executor, for a `with`. Entering it raises NotStarted if there is no cluster, ImportError without Ray."""
    if address and engine != "ray":
        raise Refused("--address needs --engine ray")
    return _engine(engine, address, workers)


@contextmanager
def _engine(name: str, address: str | None, workers: int | None) -> Iterator[Executor]:
    if name == "processes":
        from overlapper.jobs.processes import Processes

        yield Processes(workers)
        return
    from overlapper.jobs.cluster import Cluster

    cluster = Cluster(address, workers)
    try:
        yield cluster
    finally:
        cluster.close()
