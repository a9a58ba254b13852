"""The commands that a script gives motors, constraints and bodies between two steps, given again in each substep."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import pybullet

from overlapper.simulation.bullet.calls import Arguments, unheard

ARRAYS = frozenset({"setJointMotorControlArray", "setJointMotorControlMultiDofArray"})
MOTORS = ARRAYS | {"setJointMotorControl2", "setJointMotorControlMultiDof"}
PUSHES = frozenset({"applyExternalForce", "applyExternalTorque"})

COMMANDS = MOTORS | PUSHES | {"changeConstraint", "resetSimulation", "stepSimulation"}

# The gains that pybullet takes by default: parts of an error that a step takes away.
DEFAULT_GAINS = {"positionGain": 0.1, "velocityGain": 1.0}

MAX_FORCE, DEFAULT_MAX_FORCE = 10, 500.0  # of getConstraintInfo

Command = tuple[str, Arguments]


class Commands:
    """The commands of a client that depend on the length of a step, as far as they are heard.

    pybullet keeps the force of a motor or a constraint as an impulse, by the length that a step has then. In shorter
    steps it would be so much stronger. Gains are parts of an error that a step takes away: in shorter steps a motor
    would be so much faster. Forces, and torques of joints, act in one step alone.
    """

    def __init__(self, client: int) -> None:
        self._client = client
        self.restored = 0
        """How often the bodies were put back to a state that was saved."""
        self._lasting: dict[Any, Command] = {}  # by body and joint, or by constraint, in the order that they came
        self._momentary: list[Command] = []
        self._length = 0.0  # of the steps that lasting ones have been told for

    def learn(self) -> None:
        """Take the forces of constraints from pybullet that were set before anybody listened.

        For a constraint without a force of its own pybullet reports its default, which is not an impulse of a step.
        """
        client = self._client
        for k in range(pybullet.getNumConstraints(client)):
            constraint = pybullet.getConstraintUniqueId(k, client)
            force = pybullet.getConstraintInfo(constraint, client)[MAX_FORCE]
            if force != DEFAULT_MAX_FORCE and constraint not in self._lasting:
                told = {"userConstraintUniqueId": constraint, "maxForce": force, "physicsClientId": client}
                self._keep([constraint], ("changeConstraint", told))

    def prepare(self, length: float, first: bool, share: float = 1.0) -> None:
        """Tell them again for a substep as long as that (s), the `first` of a step or a later one.

        The simulator's time step has to be that long already, which is that `share` of what the script takes for one.
        """
        if length != self._length:
            for name, arguments in {id(each): each for each in self._lasting.values()}.values():
                self._tell(name, arguments | _gains(name, arguments, share), arguments)
            self._length = length
        if not first:
            for name, arguments in self._momentary:
                self._tell(name, arguments)

    def stepped(self) -> None:
        """A step is over: forces act no more."""
        self._momentary.clear()

    def _tell(self, name: str, arguments: Arguments, kept: Arguments | None = None) -> None:
        try:
            unheard(name)(**arguments)
        except pybullet.error:
            # The body or the constraint is gone.
            self._lasting = {key: each for key, each in self._lasting.items() if each[1] is not kept}

    def hear(self, name: str, arguments: Arguments, _: Any) -> None:
        """A listener of calls."""
        if arguments.get("physicsClientId", 0) != self._client:
            return
        self.restored += name == "restoreState"
        if name not in COMMANDS:
            return
        # A script may use its lists again.
        command = name, deepcopy(arguments)
        if name in PUSHES or (name in MOTORS and arguments.get("controlMode") == pybullet.TORQUE_CONTROL):
            self._momentary.append(command)
        elif name in MOTORS:
            body = arguments["bodyUniqueId"]
            joints = arguments["jointIndices"] if name in ARRAYS else [arguments["jointIndex"]]
            self._keep([(body, joint) for joint in joints], command)
        elif name == "changeConstraint":
            # An argument that a call leaves out stays as it was.
            constraint = arguments["userConstraintUniqueId"]
            before = self._lasting.get(constraint, command)[1]
            self._keep([constraint], (name, before | command[1]))
        elif name == "stepSimulation":
            self.stepped()
            return
        else:
            self._lasting, self._momentary = {}, []
        # It was told for the length that steps have between two of ours.
        self._length = 0.0

    def _keep(self, keys: list[Any], command: Command) -> None:
        for key in keys:
            self._lasting.pop(key, None)
            self._lasting[key] = command


def _gains(name: str, arguments: Arguments, share: float) -> Arguments:
    """The gains of a motor, for steps that are that share of those that it was meant for."""
    mode = arguments.get("controlMode")
    if share == 1 or mode not in (pybullet.POSITION_CONTROL, pybullet.VELOCITY_CONTROL):
        return {}
    many = len(arguments["jointIndices"]) if name in ARRAYS else 1
    s = "s" if name in ARRAYS else ""
    positions, velocities = (
        [*arguments[gain + s]] if name in ARRAYS and gain + s in arguments else [arguments.get(gain, default)] * many
        for gain, default in DEFAULT_GAINS.items()
    )
    # After all parts of a step, as much of an error in the velocity is left as after one whole step.
    slower = [1 - (1 - each) ** share if 0 <= each <= 1 else each for each in velocities]
    told: dict[str, list[float]] = {"velocityGain": slower}
    if mode == pybullet.POSITION_CONTROL:
        quotients = [share * (new / old if old else share) for new, old in zip(slower, velocities)]
        told["positionGain"] = [gain * quotient for gain, quotient in zip(positions, quotients)]
    return {gain + s: each if name in ARRAYS else each[0] for gain, each in told.items()}
