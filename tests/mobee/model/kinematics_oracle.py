# SPDX-License-Identifier: Apache-2.0
"""The same robots in pinocchio, an independent implementation of rigid-body kinematics."""

from __future__ import annotations

import numpy as np
import pinocchio

from mobee.arrays import Array
from mobee.robot.robot import Robot


class Pinocchio:
    """Placements and Jacobians of a robot's links, its zero-pose frames all laid into the root frame."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.model = pinocchio.Model()
        self.origins = np.zeros((len(robot.links), 3))  # pinocchio's joint frames at zero pose: on the axis, not turned
        ids = [0]
        for j, joint in enumerate(robot.joints):
            kind = pinocchio.JointModelRevoluteUnaligned if joint.kind == "revolute" else pinocchio.JointModelPrismaticUnaligned
            self.origins[j + 1] = joint.point
            placement = pinocchio.SE3(np.eye(3), joint.point - self.origins[joint.parent])
            ids.append(self.model.addJoint(ids[joint.parent], kind(joint.axis), placement, joint.name))
        self.ids = ids
        self.columns = [self.model.joints[i].idx_q for i in ids[1:]]
        self.data = self.model.createData()

    def configuration(self, q: Array) -> Array:
        matrix, offset = self.robot.coupling
        out = np.empty(self.model.nq)
        out[self.columns] = matrix @ q + offset
        return out

    def moved(self, q: Array, link: int, point: Array) -> Array:
        """Where a point of the root frame at zero pose goes with a link."""
        pinocchio.forwardKinematics(self.model, self.data, self.configuration(q))
        return self.data.oMi[self.ids[link]].act(point - self.origins[link])

    def jacobian(self, q: Array, link: int, point: Array) -> Array:
        """(6, n) of a point given in the root frame at zero pose, linear rows first."""
        pinocchio.computeJointJacobians(self.model, self.data, self.configuration(q))
        if link == 0:
            return np.zeros((6, len(q)))
        j6 = pinocchio.getJointJacobian(self.model, self.data, self.ids[link], pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        arm = self.data.oMi[self.ids[link]].rotation @ (point - self.origins[link])
        linear = j6[:3] + np.cross(j6[3:].T, arm).T
        return np.vstack([linear, j6[3:]])[:, self.columns] @ self.robot.coupling[0]
