"""A laikago drops a few millimetres and stands on its four toes.

Hard: ninety-two hulls, almost all of which touch nothing, so that what is left out decides how long it takes. Four
spheres are in a half-space without bounds, and no polytope meets their shallow caps exactly.
"""

import pybullet as p
import pybullet_data

STEPS = 200
LEG = (0.0, 0.67, -1.25)  # abduction, hip and knee of every leg, radians: a stance with the toes under the hips


def build(client: int) -> None:
    p.setAdditionalSearchPath(pybullet_data.getDataPath(), physicsClientId=client)
    p.setGravity(0, 0, -9.81, physicsClientId=client)
    p.loadURDF("plane_implicit.urdf", physicsClientId=client)
    robot = p.loadURDF("laikago/laikago_toes_zup.urdf", [0, 0, 0.432], physicsClientId=client)
    joints = range(p.getNumJoints(robot, physicsClientId=client))
    motors = [j for j in joints if p.getJointInfo(robot, j, physicsClientId=client)[2] == p.JOINT_REVOLUTE]
    stance = LEG * 4
    for motor, angle in zip(motors, stance):
        p.resetJointState(robot, motor, angle, physicsClientId=client)
    p.setJointMotorControlArray(
        robot, motors, p.POSITION_CONTROL, stance, forces=[60] * len(motors), physicsClientId=client
    )
