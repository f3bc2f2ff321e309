# SPDX-License-Identifier: Apache-2.0
"""The iCub, table and ball in PyBullet, and which pairs of links count as solid contact."""

from __future__ import annotations

import tempfile
from collections.abc import Collection, Iterable
from pathlib import Path

import msgspec
import numpy as np
import pybullet
from msgspec import Struct
from pybullet_utils.bullet_client import BulletClient

from mobee.arrays import Array
from mobee.model.kinematics import quaternion_from_matrix
from mobee.model.masses import gravity_torque
from mobee.model.world import World, WorldObject
from mobee.robot.icub_urdf import write_upper_body_urdf
from mobee.robot.robot import Robot
from services.robot_sim.bullet_torque import Motion
from services.robot_sim.kinematic import require_simulated

SOLID_PAIRS = Path(__file__).with_name("solid_pairs.json")
TABLE = "table"  # in the list it stands for every obstacle of the world


class SolidPairs(Struct, frozen=True, forbid_unknown_fields=True):
    """The list of pairs of links whose contacts count as solid contacts, and how the list was made.

    `always`: pairs that are listed without a test, because the robot must avoid their contacts: hands and forearms against torso, head,
    other arm and table. `apart`: pairs that are listed because of a test: their convex hulls were more than `distance` [m] apart in all of
    `poses` random poses within the limits. `seed`: of these random poses. `model`: the robot's name in icub-models.
    """

    model: str
    distance: float
    poses: int
    seed: int
    always: list[list[str]]
    apart: list[list[str]]

    def links(self) -> set[frozenset[str]]:
        """Return the pairs of the robot's links whose contacts count as solid contacts, as sets of two names."""
        return {frozenset(pair) for pair in self.always + self.apart if TABLE not in pair}

    def against_table(self) -> list[str]:
        """Return the links whose contacts with obstacles count as solid contacts, sorted by name.

        In the list, "table" stands for every obstacle of the world.
        """
        return sorted(first if second == TABLE else second for first, second in self.always + self.apart if TABLE in (first, second))


def load_solid_pairs() -> SolidPairs:
    """Return the list of pairs whose contacts count as solid contacts, read from this repository's file solid_pairs.json."""
    return msgspec.json.decode(SOLID_PAIRS.read_bytes(), type=SolidPairs)


GRAVITY = -9.81  # m/s^2
BASE = -1  # PyBullet's index of the base link


class BulletScene:
    """The robot and its world in PyBullet: the bodies and their names.

    `motors`: indices of the robot's motors that PyBullet moves; the others (fingers, eyes) are not in the URDF. `joints`: PyBullet's
    indices of the joints of these motors, in the same order.
    """

    def __init__(self, robot: Robot, world: World, substep: float) -> None:
        """Load the robot and the world; `substep`: time step of the physics, s.

        Raises BackendUnavailable for a robot other than the iCub, which the URDF describes.
        """
        require_simulated(robot)
        self.client = BulletClient(pybullet.DIRECT)
        self.client.setPhysicsEngineParameter(fixedTimeStep=substep, numSubSteps=1, deterministicOverlappingPairs=1)
        self.client.setGravity(0.0, 0.0, GRAVITY)
        self.body = self._load_robot()
        self.links = {"root_link": BASE}
        joints = {}
        for index in range(self.client.getNumJoints(self.body)):
            info = self.client.getJointInfo(self.body, index)
            self.links[info[12].decode()] = index
            if info[2] == pybullet.JOINT_REVOLUTE:
                joints[info[1].decode()] = index
        driven = [(i, joints[name]) for i, name in enumerate(robot.motors) if name in joints]
        self.motors = np.array([motor for motor, _ in driven])
        self.joints = [joint for _, joint in driven]
        self._order = np.argsort(self.joints)  # PyBullet's vectors are in the order of its joints
        self._back = np.argsort(self._order)
        self._robot = robot
        for joint in self.joints:  # the URDF's own friction: there is that of the motors, and at 5 ms this one shakes a wrist
            self.client.changeDynamics(self.body, joint, jointDamping=0.0)
        self.objects = {thing.name: self._add(thing) for thing in world.objects.values()}

    def close(self) -> None:
        """End the connection with PyBullet, which frees its memory."""
        self.client.disconnect()

    def set_posture(self, q: Array) -> None:
        """Put the joints at q (n,) rad, the positions of all motors of the robot, at rest."""
        for joint, position in zip(self.joints, q[self.motors].tolist(), strict=True):
            self.client.resetJointState(self.body, joint, position)

    def motion(self, q: Array) -> Motion:
        """Return the equation of motion of the joints that PyBullet moves, at their present velocities, in the order of the field `motors`.

        `q`: (n,) rad, positions of all motors of the robot.
        """
        velocity = np.array([state[1] for state in self.client.getJointStates(self.body, self.joints)])
        at, moving = q[self.motors][self._order].tolist(), velocity[self._order].tolist()
        still = [0.0] * len(at)
        mass = np.array(self.client.calculateMassMatrix(self.body, at))
        # PyBullet's own gravity is wrong here (it turns it by the base's inertial frame), its Coriolis terms are right
        fast, slow = (self.client.calculateInverseDynamics(self.body, at, rates, still) for rates in (moving, still))
        coriolis = (np.array(fast) - np.array(slow))[self._back]
        return Motion(mass[np.ix_(self._back, self._back)], coriolis + gravity_torque(self._robot, q)[self.motors], velocity)

    def move(self, name: str, position: Iterable[float]) -> None:
        """Move a world object to `position` (3,) m, root frame; its orientation stays the same."""
        _, turn = self.client.getBasePositionAndOrientation(self.objects[name])
        self.client.resetBasePositionAndOrientation(self.objects[name], tuple(position), turn)

    def watch(self, links: Collection[frozenset[str]], against: Iterable[tuple[str, str]]) -> None:
        """Let only these pairs collide: `links`, sets of two links of the robot, and `against`, pairs of a link and an object."""
        names = list(self.links)
        for i, first in enumerate(names):
            for second in names[:i]:
                on = frozenset((first, second)) in links
                self.client.setCollisionFilterPair(self.body, self.body, self.links[first], self.links[second], int(on))
        wanted = set(against)
        for name, index in self.links.items():
            for thing, body in self.objects.items():
                self.client.setCollisionFilterPair(self.body, body, index, BASE, int((name, thing) in wanted))

    def distance(self, link: str, other: str, within: float) -> float:
        """Return the distance [m] of a link from `other`, a link or a world object; negative if they overlap.

        The result is infinite if the distance is larger than `within` [m].
        """
        body, index = (self.objects[other], BASE) if other in self.objects else (self.body, self.links[other])
        points = self.client.getClosestPoints(self.body, body, within, self.links[link], index)
        return min((point[8] for point in points), default=np.inf)

    def _load_robot(self) -> int:
        flags = pybullet.URDF_USE_SELF_COLLISION | pybullet.URDF_USE_INERTIA_FROM_FILE
        with tempfile.TemporaryDirectory() as folder:
            path = write_upper_body_urdf(Path(folder) / "icub.urdf")
            return int(self.client.loadURDF(str(path), useFixedBase=True, flags=flags))

    def _add(self, thing: WorldObject) -> int:
        client, size = self.client, thing.size
        if thing.kind == "box":
            shape = client.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[edge / 2.0 for edge in size])
        elif thing.kind == "sphere":
            shape = client.createCollisionShape(pybullet.GEOM_SPHERE, radius=size[0])
        else:
            kind = pybullet.GEOM_CYLINDER if thing.kind == "cylinder" else pybullet.GEOM_CAPSULE
            shape = client.createCollisionShape(kind, radius=size[0], height=size[1])
        w, x, y, z = quaternion_from_matrix(thing.rotation).tolist()
        return int(client.createMultiBody(0.0, shape, basePosition=thing.position.tolist(), baseOrientation=[x, y, z, w]))
