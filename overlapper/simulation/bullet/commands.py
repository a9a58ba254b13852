"""Commands of a script to motors, constraints and bodies between two steps. They are repeated in each substep."""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from functools import lru_cache
from typing import Any, Literal, NamedTuple

import pybullet

from overlapper.simulation.bullet.calls import Arguments, unheard

ARRAYS = frozenset({"setJointMotorControlArray", "setJointMotorControlMultiDofArray"})
MOTORS = ARRAYS | {"setJointMotorControl2", "setJointMotorControlMultiDof"}
PUSHES = frozenset({"applyExternalForce", "applyExternalTorque"})

COMMANDS = MOTORS | PUSHES | {"changeConstraint", "resetSimulation"}

# The default gains of pybullet: the fraction of an error that a step removes.
DEFAULT_GAINS = {"positionGain": 0.1, "velocityGain": 1.0}

# The arguments that make a `Servo`, for one joint and for many, and their defaults.
AIMS = {
    ("targetPosition", "targetPositions"): 0.0,
    ("targetVelocity", "targetVelocities"): 0.0,
    ("positionGain", "positionGains"): DEFAULT_GAINS["positionGain"],
    ("velocityGain", "velocityGains"): DEFAULT_GAINS["velocityGain"],
    ("force", "forces"): 1e5,
    ("maxVelocity", ""): 0.0,
}
POSITION_GAIN = 2

MAX_FORCE, DEFAULT_MAX_FORCE = 10, 500.0  # of getConstraintInfo
# The defaults of pybullet for two numbers that it does not report: `erp`, and `solverResidualThreshold` in m/s squared.
ERROR_REDUCTION, THRESHOLD = 0.2, 1e-7

Command = tuple[str, Arguments]

StateCall = tuple[Literal["saved", "restored", "removed"], int | None]
"""What a call of the script did to a state, and the number of the state. States in files have no number."""


class Servo(NamedTuple):
    """A motor of a joint with one coordinate, as pybullet was told of it: what it aims at, its gains and limits."""

    position: float
    velocity: float
    position_gain: float
    velocity_gain: float
    force: float
    """N or N m"""
    fastest: float

    def in_a_step(self, at: float, length: float, share: float) -> tuple[float, float, float]:
        """Return target, gain and limit of `ContactSolver.solve` for a joint that is `at` a position.

        The step takes `length` (s), which is a `share` of the time step of the script.
        """
        proportional, gain = shorter(self.position_gain, self.velocity_gain, share)
        target = proportional * (self.position - at) / length + gain * self.velocity
        if self.fastest > 0:
            target = min(max(target, -self.fastest), self.fastest)
        return target, gain, self.force


class Commands:
    """The commands of a client that depend on the length of a step, as far as they are heard.

    pybullet keeps the force of a motor or a constraint as an impulse: force times the length of a step at that time. In
    shorter steps the force would be stronger. A gain is the fraction of an error that a step removes. In shorter steps
    a motor would be faster. Forces, and torques of joints, act in one step only.
    """

    def __init__(self, client: int) -> None:
        self._client = client
        self.states: list[StateCall] = []
        """The calls about saved states of the bodies."""
        self._lasting: dict[Any, Command] = {}  # by body and joint, or by constraint, in the order of the calls
        self._momentary: list[Command] = []
        self.servos: dict[tuple[int, int], Servo] = {}
        """The motors that are known, by body and joint."""
        self.error_reduction = ERROR_REDUCTION
        """The fraction of an error of position that constraints remove in a step, as far as it was heard."""
        self.threshold: float | None = None
        """The solverResidualThreshold that the script has set, as far as it was heard."""
        self._length = 0.0  # of the steps for which the lasting commands were last repeated
        self._whole = False  # whether these steps were those of the script

    def learn(self) -> None:
        """Read from pybullet the forces of constraints that were set before anybody listened.

        If no force was set for a constraint, pybullet reports the default, which is not kept as an impulse.
        """
        client = self._client
        for k in range(pybullet.getNumConstraints(client)):
            constraint = pybullet.getConstraintUniqueId(k, client)
            force = pybullet.getConstraintInfo(constraint, client)[MAX_FORCE]
            if force != DEFAULT_MAX_FORCE and constraint not in self._lasting:
                told = {"userConstraintUniqueId": constraint, "maxForce": force, "physicsClientId": client}
                self._keep([constraint], ("changeConstraint", told))

    def changes(self) -> dict[int, Arguments]:
        """The arguments of changeConstraint by constraint, as far as they are known."""
        return {key: arguments for key, (name, arguments) in self._lasting.items() if name == "changeConstraint"}

    def prepare(self, length: float, first: bool, share: float = 1.0) -> None:
        """Repeat the commands for a substep of this `length` (s), the `first` of a step or a later one.

        The simulator's time step must already have this length. `share` is the length divided by the script's time
        step.
        """
        if length != self._length:
            for name, arguments in {id(each): each for each in self._lasting.values()}.values():
                self._tell(name, arguments | _gains(name, arguments, share), arguments)
            self._length, self._whole = length, share == 1
        if not first:
            for name, arguments in self._momentary:
                self._tell(name, arguments)

    def stepped(self) -> None:
        """A step is over: forces of the script no longer act."""
        self._momentary.clear()

    def _tell(self, name: str, arguments: Arguments, kept: Arguments | None = None) -> None:
        try:
            unheard(name)(**arguments)
        except pybullet.error:
            # The body or the constraint is gone.
            self._lasting = {key: each for key, each in self._lasting.items() if each[1] is not kept}

    def hear(self, name: str, arguments: Arguments, result: Any) -> None:
        """A listener of calls."""
        if arguments.get("physicsClientId", 0) != self._client:
            return
        if name == "saveState":
            self.states.append(("saved", result))
        elif name == "restoreState":
            self.states.append(("restored", arguments.get("stateId")))
        elif name == "removeState":
            self.states.append(("removed", arguments["stateUniqueId"]))
        if name == "setPhysicsEngineParameter":
            self.error_reduction = arguments.get("erp", self.error_reduction)
            self.threshold = arguments.get("solverResidualThreshold", self.threshold)
        if name == "stepSimulation":
            self.stepped()
        if name not in COMMANDS:
            return
        # The script may change its lists later.
        command = name, deepcopy(arguments)
        if name in PUSHES or (name in MOTORS and arguments.get("controlMode") == pybullet.TORQUE_CONTROL):
            self._momentary.append(command)
        elif name in MOTORS:
            body = arguments["bodyUniqueId"]
            joints = arguments["jointIndices"] if name in ARRAYS else [arguments["jointIndex"]]
            self._keep([(body, joint) for joint in joints], command)
            for joint, servo in zip(joints, _servos(name, command[1], len(joints))):
                self.servos.pop((body, joint), None)
                if servo:
                    self.servos[body, joint] = servo
        elif name == "changeConstraint":
            # An argument that a call leaves out keeps its value.
            constraint = arguments["userConstraintUniqueId"]
            before = self._lasting.get(constraint, command)[1]
            self._keep([constraint], (name, before | command[1]))
        else:
            self._lasting, self._momentary = {}, []
            self.servos.clear()
            self.error_reduction, self.threshold = ERROR_REDUCTION, None
        # pybullet took the command for the script's step length. Substeps of another length need all commands again.
        if not self._whole:
            self._length = 0.0

    def _keep(self, keys: list[Any], command: Command) -> None:
        for key in keys:
            self._lasting.pop(key, None)
            self._lasting[key] = command


def _servos(name: str, arguments: Arguments, count: int) -> Iterator[Servo | None]:
    """Yield the motors of a command to `count` joints, None for other kinds and for gains that overshoot."""
    mode = arguments.get("controlMode")
    if mode not in (pybullet.POSITION_CONTROL, pybullet.VELOCITY_CONTROL) or "MultiDof" in name:
        yield from [None] * count
        return
    columns = [_by_joint(arguments, aim, count) for aim in AIMS]
    if mode == pybullet.VELOCITY_CONTROL:
        columns[POSITION_GAIN] = [0.0] * count
    for servo in map(Servo, *columns):
        yield servo if 0 <= servo.velocity_gain <= 1 else None


def _by_joint(arguments: Arguments, aim: tuple[str, str], count: int) -> list[float]:
    """Return the values of a key of `AIMS` for `count` joints."""
    one, many = aim
    return [*arguments[many]] if many in arguments else [arguments.get(one, AIMS[aim])] * count


@lru_cache
def shorter(position_gain: float, velocity_gain: float, share: float) -> tuple[float, float]:
    """Return gains for steps whose length is this share of the script's time step.

    After all substeps of a step, the same velocity error is left as after one whole step.
    """
    slower = 1 - (1 - velocity_gain) ** share if 0 <= velocity_gain <= 1 else velocity_gain
    return position_gain * share * (slower / velocity_gain if velocity_gain else share), slower


def _gains(name: str, arguments: Arguments, share: float) -> Arguments:
    """The gains of a motor for steps whose length is this share of the script's time step."""
    mode = arguments.get("controlMode")
    if share == 1 or mode not in (pybullet.POSITION_CONTROL, pybullet.VELOCITY_CONTROL):
        return {}
    told: Arguments
    if name in ARRAYS:
        joints = len(arguments["jointIndices"])
        gains = zip(*(_by_joint(arguments, (gain, gain + "s"), joints) for gain in DEFAULT_GAINS))
        short = [shorter(*each, share) for each in gains]
        told = {"positionGains": [each for each, _ in short], "velocityGains": [each for _, each in short]}
    else:
        position, velocity = shorter(*(arguments.get(*each) for each in DEFAULT_GAINS.items()), share)
        told = {"positionGain": position, "velocityGain": velocity}
    if mode == pybullet.VELOCITY_CONTROL:
        del told["positionGains" if name in ARRAYS else "positionGain"]
    return told
