"""Listeners to the calls of pybullet's functions, with their arguments and results."""

from __future__ import annotations

import functools
import os
import threading
import types
from collections.abc import Callable
from contextlib import nullcontext
from typing import Any

import pybullet

__stands_in__ = "pybullet"  # so that tracebacks of scripts end before the frames of this module

# The calls that can be heard, with the needed parameters in pybullet's order.
CALLS: dict[str, tuple[str, ...]] = {
    "connect": ("method",),
    "stepSimulation": ("physicsClientId",),
    "setRealTimeSimulation": ("enableRealTimeSimulation", "physicsClientId"),
    "setCollisionFilterPair": (
        *("bodyUniqueIdA", "bodyUniqueIdB", "linkIndexA", "linkIndexB", "enableCollision", "physicsClientId"),
    ),
    "setCollisionFilterGroupMask": (
        *("bodyUniqueId", "linkIndexA", "collisionFilterGroup", "collisionFilterMask", "physicsClientId"),
    ),
    "setPhysicsEngineParameter": (
        *("fixedTimeStep", "numSolverIterations", "useSplitImpulse", "splitImpulsePenetrationThreshold"),
        *("numSubSteps", "collisionFilterMode"),
    ),
    "setAdditionalSearchPath": ("path", "physicsClientId"),
    "loadURDF": (
        *("fileName", "basePosition", "baseOrientation", "useMaximalCoordinates", "useFixedBase", "flags"),
        *("globalScaling", "physicsClientId"),
    ),
    "loadSDF": ("sdfFileName", "useMaximalCoordinates", "globalScaling", "physicsClientId"),
    "loadMJCF": ("mjcfFileName", "flags", "useMultiBody", "physicsClientId"),
    "createMultiBody": (
        *("baseMass", "baseCollisionShapeIndex", "baseVisualShapeIndex", "basePosition", "baseOrientation"),
        *("baseInertialFramePosition", "baseInertialFrameOrientation", "linkMasses", "linkCollisionShapeIndices"),
        *("linkVisualShapeIndices", "linkPositions", "linkOrientations", "linkInertialFramePositions"),
        *("linkInertialFrameOrientations", "linkParentIndices", "linkJointTypes", "linkJointAxis"),
        *("useMaximalCoordinates", "flags", "batchPositions", "physicsClientId"),
    ),
    "createCollisionShape": (
        *("shapeType", "radius", "halfExtents", "height", "fileName", "meshScale", "planeNormal", "flags"),
        *("collisionFramePosition", "collisionFrameOrientation", "vertices", "indices", "heightfieldTextureScaling"),
        *("heightfieldData", "numHeightfieldRows", "numHeightfieldColumns", "replaceHeightfieldIndex"),
        "physicsClientId",
    ),
    "setJointMotorControl2": (
        *("bodyUniqueId", "jointIndex", "controlMode", "targetPosition", "targetVelocity", "force", "positionGain"),
        *("velocityGain", "maxVelocity", "physicsClientId"),
    ),
    "setJointMotorControlArray": (
        *("bodyUniqueId", "jointIndices", "controlMode", "targetPositions", "targetVelocities", "forces"),
        *("positionGains", "velocityGains", "physicsClientId"),
    ),
    "setJointMotorControlMultiDof": (
        *("bodyUniqueId", "jointIndex", "controlMode", "targetPosition", "targetVelocity", "force", "positionGain"),
        *("velocityGain", "maxVelocity", "physicsClientId"),
    ),
    "setJointMotorControlMultiDofArray": (
        *("bodyUniqueId", "jointIndices", "controlMode", "targetPositions", "targetVelocities", "forces"),
        *("positionGains", "velocityGains", "maxVelocities", "physicsClientId"),
    ),
    "applyExternalForce": ("objectUniqueId", "linkIndex", "forceObj", "posObj", "flags", "physicsClientId"),
    "applyExternalTorque": ("objectUniqueId", "linkIndex", "torqueObj", "flags", "physicsClientId"),
    "changeConstraint": (
        *("userConstraintUniqueId", "jointChildPivot", "jointChildFrameOrientation", "maxForce", "gearRatio"),
        *("gearAuxLink", "relativePositionTarget", "erp", "physicsClientId"),
    ),
    "saveState": ("physicsClientId",),
    "removeState": ("stateUniqueId", "physicsClientId"),
    "restoreState": ("stateId", "fileName", "physicsClientId"),
    "loadBullet": ("bulletFileName", "physicsClientId"),
    "removeBody": ("bodyUniqueId", "physicsClientId"),
    "resetSimulation": ("flags", "physicsClientId"),
    "disconnect": ("physicsClientId",),
}

Arguments = dict[str, Any]
Listener = Callable[[str, Arguments, Any], None]
"""Called after a call, with its name, its arguments by name and its result; and before a step, as BEGINS."""

BEGINS = "stepSimulation begins"

_ORIGINALS: dict[str, Callable[..., Any]] = {}
_listeners: list[Listener] = []
_steps: dict[int, Callable[[], None]] = {}  # what makes the steps of clients in place of stepSimulation

busy = threading.RLock()
"""Held during a call and its listeners. A thread that reads a client holds it, so that no body goes meanwhile."""

_NOT_BUSY = {"setRealTimeSimulation", "disconnect"}  # a listener to these waits for threads, which may hold `busy`


def _renew() -> None:
    global busy
    busy = threading.RLock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_renew)  # the thread that holds it does not exist in the child


def listen(listener: Listener) -> None:
    """Add a listener to all CALLS of all clients. The functions of `pybullet` are replaced by wrappers meanwhile."""
    if not _listeners:
        _ORIGINALS.update({name: getattr(pybullet, name) for name in CALLS})
        for name in CALLS:
            setattr(pybullet, name, _Heard(name))
    _listeners.append(listener)


def unlisten(listener: Listener) -> None:
    """Remove a listener. After the last listener is removed, pybullet has its own functions again."""
    if listener in _listeners:
        _listeners.remove(listener)
        if not _listeners:
            for name, original in _ORIGINALS.items():
                setattr(pybullet, name, original)


def replace_steps(client: int, step: Callable[[], None] | None) -> None:
    """Let calls of stepSimulation for a client call `step`, which tells listeners itself. None ends this.

    It needs a listener.
    """
    _steps.pop(client, None)
    if step:
        _steps[client] = step


def unheard(name: str) -> Callable[..., Any]:
    """The function of pybullet with that name. Listeners do not hear its calls."""
    function: Callable[..., Any] = _ORIGINALS[name] if _listeners else getattr(pybullet, name)
    return function


def tell(name: str, arguments: Arguments) -> None:
    """Report to the listeners one call that was made by one or more unheard calls, or that a step begins."""
    with busy:
        for listener in tuple(_listeners):
            listener(name, arguments, None)


class _Heard:
    """A function of pybullet whose calls are reported to listeners."""

    def __init__(self, name: str) -> None:
        functools.update_wrapper(self, _ORIGINALS[name])
        self._name = name

    @property  # type: ignore[misc]
    def __class__(self) -> type:
        # pybullet_utils.bullet_client passes its client id only to functions for which inspect.isbuiltin is true.
        return types.BuiltinFunctionType

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        with nullcontext() if self._name in _NOT_BUSY else busy:
            arguments = dict(zip(CALLS[self._name], args)) | kwargs
            step = _steps.get(arguments.get("physicsClientId", 0)) if self._name == "stepSimulation" else None
            if step and pybullet.isConnected(*args, **kwargs):  # it refuses the arguments that stepSimulation refuses
                step()
                return ()  # as stepSimulation
            if self._name == "stepSimulation":
                tell(BEGINS, arguments)
            result = _ORIGINALS[self._name](*args, **kwargs)
            for listener in tuple(_listeners):
                listener(self._name, arguments, result)
            return result
