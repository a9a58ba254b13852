"""What a script tells motors, constraints and bodies between two steps, told again in each substep."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import pybullet

from overlapper.simulation.calls import Arguments, unheard

ARRAYS = frozenset({"setJointMotorControlArray", "setJointMotorControlMultiDofArray"})
MOTORS = ARRAYS | {"setJointMotorControl2", "setJointMotorControlMultiDof"}
PUSHES = frozenset({"applyExternalForce", "applyExternalTorque"})

COMMANDS = MOTORS | PUSHES | {"changeConstraint", "resetSimulation", "stepSimulation"}

Command = tuple[str, Arguments]


class Commands:
    """The commands of a client that depend on the length of a step, as far as they are heard.

    pybullet keeps the force of a motor or a constraint as an impulse, of the length that a step has when it is told: in
    shorter steps it would be so much stronger. Forces, and torques of joints, act in one step alone.
    """

    def __init__(self, client: int) -> None:
        self._client = client
        self._lasting: dict[Any, Command] = {}  # by body and joint, or by constraint, in the order that they came
        self._momentary: list[Command] = []
        self._length = 0.0  # of the steps that lasting ones have been told for

    def prepare(self, length: float, first: bool) -> None:
        """Tell them again for a substep as long as that (s), the `first` of a step or a later one.

        The simulator's time step has to be that long already.
        """
        if length != self._length:
            for name, arguments in {id(each): each for each in self._lasting.values()}.values():
                self._tell(name, arguments)
            self._length = length
        if not first:
            for name, arguments in self._momentary:
                self._tell(name, arguments)

    def stepped(self) -> None:
        """A step is over: forces act no more."""
        self._momentary.clear()

    def _tell(self, name: str, arguments: Arguments) -> None:
        try:
            unheard(name)(**arguments)
        except pybullet.error:
            # The body or the constraint is gone.
            self._lasting = {key: each for key, each in self._lasting.items() if each[1] is not arguments}

    def hear(self, name: str, arguments: Arguments, _: Any) -> None:
        """A listener of calls."""
        if name not in COMMANDS or arguments.get("physicsClientId", 0) != self._client:
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
            # What a call leaves out stays as it was.
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
