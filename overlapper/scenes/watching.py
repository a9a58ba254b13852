"""Simulations that are stepped by other code, noticed and measured."""

from __future__ import annotations

import math
import os
import signal
import threading
import time
import warnings
from array import array
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from functools import partial
from mmap import mmap
from pathlib import Path
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, Any, get_args

from numpy.typing import NDArray

from overlapper.reference import By, reference
from overlapper.scenes.other_processes import OtherProcesses
from overlapper.simulation.asked_pairs import Among
from overlapper.simulation.bodies import AnyBodies
from overlapper.simulation.cautions import SkippedShapeWarning, UnknownBodyWarning
from overlapper.simulation.engine import LIBRARIES, Happening, engine_that_has
from overlapper.simulation.engine import engine as engine_of
from overlapper.simulation.first_overlaps import FirstOverlaps
from overlapper.simulation.imports import when_imported
from overlapper.simulation.settings import Asking, Concave, Method, Modelling, Surface, settings_of
from overlapper.tables.frame import Frame
from overlapper.tables.outputs import Per, can_be_written, outputs
from overlapper.tables.summary import Summary
from overlapper.tables.table_chart import drawn
from overlapper.tables.table_file import origin
from overlapper.whole_number import whole

if TYPE_CHECKING:
    from overlapper.simulation import Recorder


class Watch:
    """Measures a simulation after each step by any code, as `overlapper run` does with scenes.

        with overlapper.watch(client, "run.parquet", "run.html") as watch:
            ...  # any code that calls pybullet.stepSimulation()
        watch.summary.as_dict()

    The files are written beside their places. They move to their places at the end of the `with`, by `close()`, or when
    the client disconnects. After an error they stay where they are, and `written` names them.

    The watch notices calls of `pybullet.stepSimulation` and `mujoco.mj_step`. It does not notice calls by a name that
    was imported from these modules earlier, and steps in other processes. If a step cannot be measured or written, the
    call that made the step raises the error, and the watch ends.

    After `pybullet.setRealTimeSimulation(1)`, a thread measures `rate` times a second and counts each measurement as a
    step. The simulation is held meanwhile, so that all poses are of one moment. Its time is therefore less than that of
    the clock. `close()` raises the error of a failed measurement.

    pybullet cannot be asked for pair filters, the filter mode, self-collision, height fields and files. They are known
    if they were set after the watch began, or if `recorder` has noted them.

    Parameters
    ----------
    physicsClientId : int or mujoco.MjData, default 0
        The number of a pybullet client, or the data of a MuJoCo simulation.
    out : str or Path, optional
        Table to write: .csv, .parquet or .sqlite.
    html : str or Path, optional
        Page to write, for a browser.
    every : int, default 1
        Measure one step in this many.
    rate : float, default 60
        Most measurements a second, 1/s, of a simulation that runs in real time.
    pairs : {'simulated', 'all'} or list of pairs, default 'simulated'
        The pairs to measure, as in `Bodies.pairs`.
    surface : {'nominal', 'margin'}, default 'nominal'
        As in `simulation.Bodies`.
    concave : {'decompose', 'enclose', 'skip'}, default 'decompose'
        As in `simulation.Bodies`.
    concave_threshold : float, default 0.05
        As in `simulation.Bodies`.
    tolerance : float, default 0.001
        Allowed relative error of the volume for curved shapes.
    method : {'auto', 'paper'}, default 'auto'
        Method of computation, as in `overlapper.overlap`.
    per : {'shape', 'link'}, default 'shape'
        A row of the table is a pair of shapes, or a pair of whole links.
    check : {'fcl', 'mujoco'}, optional
        Compare every pair with FCL, or with the answer of MuJoCo itself, if MuJoCo runs the simulation.
    between : bool, default False
        Find pairs that passed through each other between two steps, as `Bodies.first_overlaps` does. It needs every
        step. Bodies that something but a step has moved, such as a reset, have not passed through others.
    recorder : Recorder, optional
        A recorder that was set up earlier.
    names : dict of int to str, optional
        Names of bodies by their numbers.
    name : str, default 'the simulation'
        Name of the simulation in the summary.
    engine : str, optional
        Name of the simulator, as ENGINE of a scene. Default: it follows from the kind of `physicsClientId`.

    Raises
    ------
    ValueError
        If the client is not connected, or an option is invalid.
    OSError
        If a file cannot be written.
    ImportError
        Without the library that writes a file.
    """

    def __init__(
        self,
        physicsClientId: int | Any = 0,
        out: str | Path | None = None,
        html: str | Path | None = None,
        *,
        every: int = 1,
        rate: float = 60,
        pairs: Among = "simulated",
        surface: Surface = "nominal",
        concave: Concave = "decompose",
        concave_threshold: float = 0.05,
        tolerance: float = 1e-3,
        method: Method = "auto",
        per: Per = "shape",
        check: By | None = None,
        between: bool = False,
        recorder: Recorder | None = None,
        names: Mapping[int, str] | None = None,
        name: str = "the simulation",
        engine: str | None = None,
    ) -> None:
        engine = engine or engine_that_has(physicsClientId)
        of_engine = engine_of(engine)
        if whole(every, "every") < 1:
            raise ValueError(f"every must be a number of steps from 1, not {every}")
        if not (isinstance(rate, (int, float)) and 0 < rate < math.inf):
            raise ValueError(f"rate must be a number of measurements a second above 0, not {rate!r}")
        if between and every > 1:
            raise ValueError(f"between needs every step, so every must be 1, not {every}")
        if per not in get_args(Per):
            raise ValueError(f"per must be 'shape' or 'link', not {per!r}")
        self._modelling = Modelling(concave, concave_threshold, surface)
        self._asking = Asking(pairs, tolerance, method)
        self.physicsClientId = physicsClientId
        self.out, self.html = (Path(path) if path else None for path in (out, html))
        can_be_written(self.out, self.html)
        self.every, self.rate, self._per = every, rate, per
        self.steps, self.time = 0, 0.0
        """Number of steps since the watch began, measured or not, and their simulated time, s."""
        self.measured = 0
        """The number of steps that were measured."""
        self.sampled = 0
        """How many of the steps are samples of a simulation that ran in real time."""
        self.summary = Summary(name)
        self.written: list[Path] = []
        """The files that were written, known when the watch is over."""
        self.open = True
        self._names, self._between = names, between
        self._met: set[int] = set()  # the bodies of all measured steps, if there are names
        self._check = reference(check)
        if self._check and self._check.by == "mujoco" != engine:
            raise ValueError(
                f"check='mujoco' needs a simulation of MuJoCo, but {LIBRARIES.get(engine, engine)} runs this one"
            )
        self._simulation = of_engine.running(physicsClientId, recorder)
        self._bodies: AnyBodies | None = None
        self._files = ExitStack()
        self._growing: list[Path] = []
        self._moments = array("q"), array("d")  # numbers and times of the measured steps
        self._take: Callable[[Frame[AnyBodies]], None] | None = None
        self._rhythm = 0, 0.0, 0.0  # steps and time at the last change of the time step, and the time step
        self._sampler: threading.Thread | None = None
        self._enough = threading.Event()  # ends the sampler
        self._error: Exception | None = None  # of the sampler
        self._process = os.getpid()
        self._unlisten = of_engine.listen(self._hear)

    def _hear(self, happening: Happening, which: Hashable) -> None:
        # A forked process has its own simulations and must not write our files.
        if which != self.physicsClientId or os.getpid() != self._process:
            return
        if happening == "stepped":
            self._stepped()
        elif happening == "step begins":
            self._step_begins()
        elif happening == "real time begins" and not self._sampler:
            self._enough.clear()
            self._sampler = threading.Thread(target=self._sample, daemon=True)
            self._sampler.start()
        elif happening == "real time ends":
            self._end_real_time()
        elif happening == "ended":
            self.close()

    def _sample(self) -> None:
        last = due = time.monotonic()
        while not self._enough.wait(max(0, due - time.monotonic())):
            try:
                with self._simulation.held() as held:
                    if not held:
                        continue
                    due = max(due + 1 / self.rate, time.monotonic())
                    self.steps += 1
                    self.time += time.monotonic() - last
                    self._rhythm = 0, 0.0, 0.0  # later steps count from here
                    if self.steps % self.every == 0:
                        self._measure()
                    self.sampled += 1  # the client may have been disconnected meanwhile
                last = time.monotonic()
            except Exception as error:
                if self._simulation.running:
                    self._error = error
                return

    def _end_real_time(self) -> None:
        if self._sampler:
            self._enough.set()
            self._sampler.join()
            self._sampler = None

    def _step_begins(self) -> None:
        if self._between and self._bodies is not None:
            with self._left_after_errors():
                self._bodies.step_begins()

    @contextmanager
    def _left_after_errors(self) -> Iterator[None]:
        try:
            yield
        except KeyboardInterrupt:
            self._bodies = None  # it may have been interrupted in any state
            raise
        except Exception:
            self.leave()
            raise

    def _stepped(self) -> None:
        seconds = self._simulation.time_step
        if seconds != self._rhythm[2]:
            self._rhythm = self.steps, self.time, seconds
        self.steps += 1
        self.time = self._rhythm[1] + (self.steps - self._rhythm[0]) * seconds
        if self.steps % self.every:
            return
        with self._left_after_errors():
            self._measure()

    def _measure(self) -> None:
        if self._bodies is None:
            # The summary names the skipped shapes, and `unnamed` the names without a body.
            for kind in (SkippedShapeWarning, UnknownBodyWarning):
                warnings.filterwarnings("ignore", category=kind, module=rf"{__name__}$")
            self._bodies = self._simulation.bodies(**settings_of(self._modelling), names=self._names)
            first = FirstOverlaps() if self._between else None  # poses before the first step are unknown
        else:
            self._bodies.update()
            first = self._bodies.first_overlaps(self._asking.pairs or "simulated") if self._between else None
        if self._names:
            self._met.update(self._bodies.labels)
        contacts = self._bodies.overlaps(**settings_of(self._asking))
        with interrupted_later():
            if self._take is None:
                self._take = self._begun(self._bodies)
            self._take(Frame(self.steps, self.time, self._bodies, contacts, first=first))
            self.measured += 1
            if self.out:  # else nothing can be drawn, and memory should not grow with the steps
                self._moments[0].append(self.steps)
                self._moments[1].append(self.time)

    def _begun(self, bodies: AnyBodies) -> Callable[[Frame[AnyBodies]], None]:
        """The function that takes the frames. It creates the files."""
        watched = {"simulation": self.summary.scene, "every": self.every}
        settings = origin(bodies.engine) | watched | settings_of(self._asking) | bodies.settings
        files = outputs(
            self.summary,
            settings,
            self.written,
            self.out,
            self.html,
            self._per,
            self._check,
            growing=self._growing,
            between=self._between,
        )
        return self._files.enter_context(files)

    @property
    def unnamed(self) -> dict[int, str]:
        """The names given to bodies that were in the simulation in no measured step."""
        return {body: name for body, name in (self._names or {}).items() if body not in self._met}

    def plot(self, most: int = 8) -> NDArray[Any]:
        """Draw the depth and volume of the pairs over time, as far as the simulation has come.

        The chart is that of `Log.plot`. The rows are read from the table, so the watch needs `out`.

        Parameters
        ----------
        most : int, default 8
            The most pairs to draw: those with the largest volumes. The chart says if there are more.

        Returns
        -------
        (2,) ndarray of matplotlib.axes.Axes
            The panels of depth and volume.

        Raises
        ------
        TypeError
            If `most` is not a whole number.
        ValueError
            If the watch writes no table, nothing was measured yet, or `most` is less than 1.
        OSError
            If the table was moved or removed.
        ImportError
            Without matplotlib.
        """
        if not self.out:
            raise ValueError("this watch writes no table to draw: name one, as in overlapper.watch(client, 'run.csv')")
        if not self._growing:
            raise ValueError("this watch has measured no step to draw")
        path = self.out if self.out in self.written else self._growing[0]
        return drawn(path, False, *self._moments, most)

    def close(self) -> None:
        """End the watch and put the files in their places. OSError if this fails.

        Raises the error that has ended the measurements in real time, if there was one.
        """
        self._end_real_time()
        if self._error:
            self.leave()
            raise self._error
        self._end()
        self._files.close()

    def leave(self) -> None:
        """End the watch after a failure. Files stay beside their places, and `written` names them."""
        self._end()
        self._files.__exit__(RuntimeError, RuntimeError(), None)

    def _end(self) -> None:
        self.open = False
        self._end_real_time()
        self._unlisten()
        self._simulation.leave()
        if self._bodies:
            self._bodies.close()
        if self._check:
            self._check.close()

    def __enter__(self) -> Watch:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if isinstance(error, Exception):
            self.leave()
        else:
            self.close()


class Watches:
    """Watches all simulations of this process from their beginning. Each measured simulation has its own files.

    The first simulation has the files `out` and `html`, the second has `out-2`, and so on. A failure to measure or
    write ends the watch of that simulation. The error goes to `failed`, not to the code that makes steps.
    """

    def __init__(self, name: str, out: Path | None, html: Path | None, how: Mapping[str, Any]) -> None:
        self._name, self._out, self._html, self._how = name, out, html, how
        self.all: list[Watch] = []
        """The watches that have measured something, in the order of their first measurements."""
        self.failed: list[tuple[Watch, Exception]] = []
        self.steps = 0
        """The number of steps of all simulations, measured or not."""
        self.without_real_time = False
        """Whether real time was set where it has no effect."""
        self._elsewhere = mmap(-1, 1)  # shared memory that forked processes write to
        self._others = OtherProcesses(LIBRARIES["bullet"])
        self._of: dict[Hashable, Watch] = {}
        self._process = os.getpid()
        self._unlisten: list[Callable[[], None]] = []
        for name, library in LIBRARIES.items():
            when_imported(library, partial(self._listen, name))

    def _listen(self, engine: str) -> None:
        self._unlisten.append(engine_of(engine).listen(self._hear))

    def _hear(self, happening: Happening, which: Hashable) -> None:
        if os.getpid() != self._process:
            if happening == "stepped":
                self._elsewhere[0] = 1
        elif happening == "began":
            self._of[which] = _Kept(which, self._number, self.failed, name=self._name, **self._how)
        elif happening == "stepped":
            self.steps += 1
        elif happening == "has no real time":
            self.without_real_time = True
        elif happening == "ended":
            self._of.pop(which, None)

    @property
    def stepped_elsewhere(self) -> bool:
        """Whether a forked process has made steps, which are not watched."""
        return bool(self._elsewhere[0])

    @property
    def loaded_elsewhere(self) -> int:
        """The number of started processes that have loaded the simulator. Their steps are not watched."""
        return len(self._others.found)

    @property
    def complete(self) -> bool:
        """Whether something was measured, and nothing was left out."""
        elsewhere = self.stepped_elsewhere or self.loaded_elsewhere
        left_out = self.failed or elsewhere or any(watch.summary.skipped for watch in self.all)
        return bool(self.all and not left_out)

    def _number(self, watch: Watch) -> None:
        """Assign files to a watch before its first measurement."""
        self.all.append(watch)
        number = len(self.all)
        if number > 1:
            watch.summary.scene += f", simulation {number}"
        watch.out, watch.html = (
            path and (path if number == 1 else path.with_name(f"{path.stem}-{number}{path.suffix}"))
            for path in (self._out, self._html)
        )

    def end(self, failed: bool) -> None:
        """End all watches. Their files stay beside their places if the watched script has `failed`."""
        if os.getpid() != self._process:
            return
        for unlisten in self._unlisten:
            unlisten()
        for watch in self._of.values():
            if watch.open:
                watch.leave() if failed else watch.close()


class _Kept(Watch):
    """A watch that does not raise its failures in the code that makes the steps."""

    def __init__(
        self, client: Any, number: Callable[[Watch], None], failed: list[tuple[Watch, Exception]], **how: Any
    ) -> None:
        # The script must not get the error of a check of another simulator. The first measurement fails instead.
        super().__init__(client, **{**how, "check": None})
        self._check = reference(how["check"])
        self._number, self._failed = number, failed

    def _stepped(self) -> None:
        try:
            super()._stepped()
        except Exception as error:
            self._failed.append((self, error))

    def _step_begins(self) -> None:
        try:
            super()._step_begins()
        except Exception as error:
            self._failed.append((self, error))

    def _begun(self, bodies: AnyBodies) -> Callable[[Frame[AnyBodies]], None]:
        self._number(self)
        return super()._begun(bodies)

    def close(self) -> None:
        try:
            super().close()
        except Exception as error:
            self._failed.append((self, error))


@contextmanager
def interrupted_later() -> Iterator[None]:
    """Delay Ctrl-C until the end of the block, so that writing is not interrupted."""
    handler = signal.getsignal(signal.SIGINT)
    if not callable(handler) or threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[tuple[int, FrameType | None]] = []
    signal.signal(signal.SIGINT, lambda number, frame: came.append((number, frame)))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        if came:
            handler(*came[0])
