"""Another program's answer for the same shapes and poses, and which is nearer to the truth if it differs from ours.

`Fcl` asks FCL about any pair. `Mujoco` asks MuJoCo about the geoms of a running simulation.

FCL (python-fcl) runs in a separate process. For some pairs that barely touch, its signed distance ends the process by a
C++ exception that no `except` in Python can catch.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import TracebackType
from typing import Any, Literal, Protocol

import numpy as np

from overlapper import Ellipsoid, Overlap
from overlapper.install import hint
from overlapper.jobs.worker import Ended, NotStarted, Worker
from overlapper.proof.signed_distance import signed_distance_bounds
from overlapper.shapes.facts import FclModel
from overlapper.shapes.table import facts

try:
    import fcl
except ImportError:
    fcl = None

# For each of the two bodies its model and its pose: quaternion wxyz, position.
Request = tuple[tuple[FclModel, tuple[Any, Any]], ...]

# FCL's default distance_tolerance, in m, which python-fcl cannot change, and MuJoCo's default ccd_tolerance. EPA stops
# when its bounds of the depth differ by less. FCL's distance search stops when a step gains less, which does not bound
# its error. Beside curved shapes, its result has been 2e-4 m too large. Such pairs are disagreements and are settled
# exactly.
TOLERANCE = 1e-6

By = Literal["fcl", "mujoco"]
NAMES: dict[By, str] = {"fcl": "FCL", "mujoco": "MuJoCo"}
OF_FIELD = "MuJoCo answers for a whole height field, not for the part of it in this pair."

# The exact value is computed to this fraction of the difference of the two sides. This suffices to say which is nearer.
RESOLUTION = 1e-3

# The message of FCL before it aborts, or of Python.
CAUSE = r"Original error message: .*?\): (.*)|^(\w*(?:Error|Exception): .*)"


@dataclass(frozen=True, slots=True)
class Figures:
    """One side's answer for a pair.

    `signed_distance` is in m: the distance if separated, minus the depth if overlapping; None if FCL gives no value.
    """

    overlapping: bool
    signed_distance: float | None

    def __str__(self) -> str:
        word = "overlapping" if self.overlapping else "touching" if self.signed_distance == 0.0 else "apart"
        return f"unknown ({word})" if self.signed_distance is None else f"{self.signed_distance + 0.0:.9g} m ({word})"


@dataclass(frozen=True, slots=True)
class Comparison:
    """Another program's answer for a pair, beside ours. `by` names the program.

    `theirs` is None if the program gave no answer. `exact` = (lower, upper), in m, bounds the exact signed distance. It
    is computed unless the two sides agree at once. It is None for ellipsoids, whose exact distance is not known.
    `nearer` is the side nearer to the exact value in a disagreement; None if `exact` does not decide. `explanation` is
    one sentence.
    """

    verdict: Literal["agree", "disagree", "crashed", "unsupported"]
    ours: Figures
    theirs: Figures | None
    explanation: str
    nearer: Literal["ours", "fcl", "mujoco"] | None = None
    exact: tuple[float, float] | None = None
    by: By = "fcl"


class ContactLike(Protocol):
    """A contact of a simulation."""

    @property
    def overlap(self) -> Overlap: ...


class Reference(Protocol):
    """A program that is asked about the contacts of a simulation."""

    by: By

    def compare_contacts(self, bodies: Any, contacts: Sequence[ContactLike]) -> list[Comparison]:
        """The program's answers for the contacts of `bodies` at their last update."""

    def close(self) -> None:
        """End what the program needs."""


def reference(check: By | None) -> Reference | None:
    """The program with this name, or None for None. ValueError for another name. ImportError without FCL."""
    if check is None:
        return None
    if check not in NAMES:
        raise ValueError(f"check must be 'fcl', 'mujoco' or None, not {check!r}")
    return Fcl() if check == "fcl" else Mujoco()


class Mujoco:
    """Checks overlaps of a MuJoCo simulation with MuJoCo's own contacts and distances.

    A pair overlaps by MuJoCo if one of its contacts has a negative `dist`. If MuJoCo does not test the pair for
    contacts, the sign of the distance decides. The distance, or minus the depth, is that of `mj_geomDistance`. A pair
    with a part of a height field gets the verdict "unsupported": MuJoCo only answers for the whole height field.
    """

    by: By = "mujoco"

    def compare_contacts(self, bodies: Any, contacts: Sequence[ContactLike]) -> list[Comparison]:
        """MuJoCo's answers for the contacts of `bodies` at their last update.

        ValueError if `bodies` are not those of MuJoCo.
        """
        if not hasattr(bodies, "own_distances"):
            raise ValueError("check='mujoco' needs a simulation of MuJoCo, but another simulator runs this one")
        overlapping, distances = bodies.own_distances(contacts)
        return [
            Comparison("unsupported", _ours(contact.overlap), None, OF_FIELD, by=self.by)
            if math.isnan(distance)
            else _judged(contact.overlap, Figures(told, distance), None, self.by)
            for contact, told, distance in zip(contacts, overlapping.tolist(), distances.tolist())
        ]

    def close(self) -> None:
        return


class Fcl:
    """Checks overlaps with python-fcl: a context manager that keeps the process in which FCL runs.

    A pair that ends the process, or takes longer than `time_limit` seconds, gets the verdict "crashed". The process is
    then started again for the next pair. ImportError without python-fcl.
    """

    by: By = "fcl"

    def __init__(self, time_limit: float = 10.0) -> None:
        if fcl is None:
            raise ImportError(f"overlapper.reference needs {hint('python-fcl')}")
        self.time_limit = time_limit
        self._worker: Worker | None = None

    def __enter__(self) -> Fcl:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Ends the process. A later comparison starts another."""
        if self._worker is not None:
            self._worker.close()
            self._worker = None

    def compare(self, overlap: Overlap) -> Comparison:
        """Asks FCL about the two shapes of `overlap`, in the same poses."""
        return self.compare_many([overlap])[0]

    def compare_contacts(self, bodies: Any, contacts: Sequence[ContactLike]) -> list[Comparison]:
        """As `compare_many`, for the contacts of a simulation."""
        return self.compare_many(contact.overlap for contact in contacts)

    def compare_many(self, overlaps: Iterable[Overlap]) -> list[Comparison]:
        """As `compare`, for many pairs in one exchange with the process. If a pair ends it, other pairs get answers."""
        overlaps = list(overlaps)
        reasons = [_unsupported(overlap) for overlap in overlaps]
        answers = iter(self._ask([_request(overlap) for overlap, reason in zip(overlaps, reasons) if not reason]))
        return [
            Comparison("unsupported", _ours(overlap), None, reason)
            if reason
            else _judged(overlap, *next(answers), self.by)
            for overlap, reason in zip(overlaps, reasons)
        ]

    def _ask(self, requests: list[Request]) -> list[tuple[Figures | None, str | None]]:
        """For each request: FCL's figures, if they arrived, and how the process ended, if this request ended it."""
        answers: list[tuple[Figures | None, str | None]] = []
        try:
            while len(answers) < len(requests):
                if self._worker is None or not self._worker.alive():
                    self.close()
                    self._worker = self._started()
                self._worker.send(requests[len(answers) :])
                end = None
                while end is None and len(answers) < len(requests):
                    figures, end = self._answer(self._worker)
                    answers.append((figures, end))
        except BaseException:
            self.close()  # otherwise answers still on their way would be taken for answers to later pairs
            raise
        return answers

    def _started(self) -> Worker:
        try:
            return Worker(_answers, CAUSE)
        except Ended as ended:
            raise NotStarted(f"overlapper.reference cannot start FCL: its process {ended}") from None

    def _answer(self, worker: Worker) -> tuple[Figures | None, str | None]:
        figures = None
        try:
            figures = Figures(worker.receive(self.time_limit), None)
            return Figures(figures.overlapping, worker.receive(self.time_limit)), None
        except Ended as ended:
            return figures, str(ended)


def _answers(requests: list[Request]) -> Iterator[Any]:
    """Runs in FCL's process. Yields for each pair whether FCL finds contact, then its signed distance."""
    for request in requests:
        bodies = [fcl.CollisionObject(_geometry(model), fcl.Transform(*pose)) for model, pose in request]
        contacts = fcl.CollisionResult()
        yield fcl.collide(*bodies, fcl.CollisionRequest(enable_contact=True), contacts) > 0
        yield _signed_distance(request, bodies, contacts)


def _signed_distance(request: Request, bodies: list[Any], contacts: Any) -> float | None:
    if all(name != "Halfspace" for (name, _), _ in request):
        return float(fcl.distance(*bodies, fcl.DistanceRequest(enable_signed_distance=True)))
    # FCL's distance from a half-space reads a null pointer (FCL issue 383). FCL's contact has the exact depth.
    return -float(contacts.contacts[0].penetration_depth) if contacts.contacts else None


@lru_cache(maxsize=4096)
def _geometry(model: FclModel) -> Any:
    name, values = model
    if name == "Convex":
        vertices, faces, count = values
        return fcl.Convex(np.frombuffer(vertices).reshape(-1, 3), count, np.frombuffer(faces, np.int32))
    if name == "Halfspace":
        return fcl.Halfspace(np.array(values[:3]), values[3])
    return getattr(fcl, name)(*values)


def _unsupported(overlap: Overlap) -> str | None:
    if len(overlap.shapes) != 2:
        return f"FCL is asked about two bodies at a time, not {len(overlap.shapes)}."
    known = [facts(body.shape) for body in overlap.shapes]
    if not any(each.bounded for each in known):
        return "FCL gives no depth or distance of two half-spaces."
    return next((said for said in (each.fcl() for each in known) if isinstance(said, str)), None)


def _request(overlap: Overlap) -> Request:
    """The request for a pair that FCL supports."""
    models = [facts(body.shape).fcl() for body in overlap.shapes]
    poses = [(np.roll(body.orientation, 1), body.position) for body in overlap.shapes]
    return tuple((model, pose) for model, pose in zip(models, poses) if not isinstance(model, str))


def _ours(overlap: Overlap) -> Figures:
    if overlap.depth is None or overlap.distance is None:  # of three bodies or more
        return Figures(bool(overlap), None)
    return Figures(bool(overlap), -overlap.depth if overlap else overlap.distance)


def _judged(overlap: Overlap, theirs: Figures | None, end: str | None, by: By) -> Comparison:
    ours, name = _ours(overlap), NAMES[by]
    difference = 0.0 if theirs is None else _difference(ours, theirs)
    claims = f"Signed distance by {name} {theirs}, by us {ours}"
    if theirs is not None and end is None and theirs.overlapping == ours.overlapping and difference <= TOLERANCE:
        return Comparison("agree", ours, theirs, f"{claims}.", by=by)
    a, b = overlap.shapes
    if isinstance(a.shape, Ellipsoid) or isinstance(b.shape, Ellipsoid):
        words = f"{claims}: the exact distance of an ellipsoid is not known."
        both = [each.signed_distance for each in (ours, theirs) if each is not None]
        touching = all(each is not None and abs(each) <= TOLERANCE for each in both)
        return Comparison("agree" if touching else "disagree", ours, theirs, words, by=by)
    assert overlap.normal is not None
    exact = signed_distance_bounds(a, b, [-overlap.normal], RESOLUTION * difference)
    truth = f"exactly {sum(exact) / 2:.9g} m ± {(exact[1] - exact[0]) / 2:.1g}"
    if theirs is None or end is not None:
        asked = "whether they overlap" if theirs is None else "for the signed distance"
        return Comparison(
            "crashed", ours, theirs, f"{name} {end} when asked {asked}: by us {ours}, {truth}.", None, exact, by
        )
    if difference <= TOLERANCE and max(map(abs, exact)) <= TOLERANCE:
        words = f"{claims}, {truth}: touching within {name}'s tolerance of {TOLERANCE:g} m."
        return Comparison("agree", ours, theirs, words, None, exact, by)
    nearer = _nearer(ours, theirs, exact, by)
    end = f"so {'ours' if nearer == 'ours' else name} is nearer" if nearer else "which does not decide which is nearer"
    return Comparison("disagree", ours, theirs, f"{claims}, {truth}, {end}.", nearer, exact, by)


def _difference(ours: Figures, theirs: Figures) -> float:
    """The difference of the two signed distances, m; 0 if one is missing."""
    if ours.signed_distance is None or theirs.signed_distance is None:
        return 0.0
    return abs(ours.signed_distance - theirs.signed_distance)


def _nearer(
    ours: Figures, theirs: Figures, exact: tuple[float, float], by: By
) -> Literal["ours", "fcl", "mujoco"] | None:
    """The side that is nearer to every value within `exact`: by signed distance if these differ, else by yes or no."""
    lower, upper = exact
    threshold, ours_is_below = 0.0, ours.overlapping
    mine, other = ours.signed_distance, theirs.signed_distance
    if mine is not None and other is not None and abs(mine - other) > TOLERANCE:
        threshold, ours_is_below = (mine + other) / 2, mine < other
    if lower <= threshold <= upper:
        return None
    return "ours" if ours_is_below == (upper < threshold) else by
