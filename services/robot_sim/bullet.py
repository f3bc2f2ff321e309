# SPDX-License-Identifier: Apache-2.0
"""The physics back-end: PyBullet's joints follow the velocities or torques of the motor model."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pybullet

from mobee.arrays import Array
from mobee.model.world import World
from mobee.robot.robot import Robot
from mobee.simulation.motors import MotorParameters, Motors
from services.robot_sim.bullet_scene import BulletScene, load_solid_pairs
from services.robot_sim.bullet_torque import Gears, Mask, Share
from services.robot_sim.kinematic import GAP_LINKS, MAX_GAP, SolidContact, unmoved

NO_CONTACT = SolidContact()


class BulletBackend:
    """The upper body of iCub v2.5 with gravity in PyBullet. Fingers and eyes have no physics, only the motor model.

    PyBullet moves each joint at the velocity that the motor model computes, with at most the largest torque of the motor. The joint
    therefore carries the weight by itself, as with the servo of the real robot. In torque mode the commanded torque acts on the joint
    through a gear (bullet_torque.py), and must include the torque that carries the weight.
    """

    name = "pybullet"

    def __init__(self, robot: Robot, load_world: Callable[[], World], parameters: MotorParameters, seed: int, dt: float) -> None:
        """Build the robot and its world.

        `load_world`: returns a new world. `seed`: of the encoder noise. `dt`: the tick, s. Raises BackendUnavailable for a robot other than
        the iCub, and MobeeError if a motor parameter or the world is invalid.
        """
        self._robot, self._load_world, self._parameters = robot, load_world, parameters
        self._substeps = parameters.substeps(dt)
        self._substep = dt / self._substeps
        self._listed = load_solid_pairs()
        self._build(seed)

    def reset(self, seed: int) -> None:
        """Put the robot at home, at rest, with all motors in hold, and the world in its initial state.

        In hold a motor keeps its position and follows no commands. `seed`: of the encoder noise.
        """
        self._scene.close()
        self._build(seed)

    def step(self, dt: float) -> None:
        """Advance by one tick; `dt` [s] must be the one that was given at the start."""
        self._deepest.clear()
        for _ in range(self._substeps):
            self._advance(self._substep)
            self._find_contacts()

    def place(self, name: str, position: tuple[float, float, float]) -> None:
        """Move a world object to a position (x, y, z) m, root frame.

        Raises MobeeError if there is no such object, if it is attached to a link, or if a number is not finite.
        """
        self.world.move(name, position=position)
        self._scene.move(name, position)

    def contact(self) -> SolidContact:
        """Return the deepest solid contact of the last tick; its depth is 0 if there was none."""
        if not self._deepest:
            return NO_CONTACT
        pair = max(self._deepest, key=self._deepest.__getitem__)
        return SolidContact(self._deepest[pair], pair)

    def contacts(self) -> Mapping[str, float]:
        """Return the largest depth [m] in the last tick of each pair in solid contact; key: "NAME NAME", the names sorted by alphabet."""
        return self._deepest

    def gap(self) -> float:
        """Return the smallest distance of hands and forearms from the obstacles, m; 0 in contact, -1 without obstacles.

        The result is MAX_GAP (2 m) if all obstacles are farther.
        """
        links = [link for link in self._scene.links if link.endswith(GAP_LINKS)]
        gaps = [self._scene.distance(link, obstacle, MAX_GAP) for link in links for obstacle in self._obstacles]
        return min(max(min(gaps), 0.0), MAX_GAP) if gaps else -1.0

    def _build(self, seed: int) -> None:
        self.world = self._load_world()
        self.notes: Sequence[str] = unmoved(self.world)
        self.motors = Motors(self._robot, self._parameters, seed, self._robot.home)
        self._scene = scene = BulletScene(self._robot, self.world, self._substep)
        scene.set_posture(self._robot.home)
        self._obstacles = [name for name, thing in self.world.objects.items() if thing.role == "obstacle"]
        others = [name for name in self.world.objects if name not in self._obstacles]
        links, against = self._listed.links(), self._listed.against_table()
        watched = [(link, obstacle) for link in against for obstacle in self._obstacles]
        scene.watch(links, watched + [(link, other) for link in scene.links for other in others])
        self.pairs_watched = len(links) + len(watched)
        self._names = {index: name for name, index in scene.links.items()}
        driven = self._robot.limits[scene.motors]
        self._lower, self._upper = driven[:, 0], driven[:, 1]
        self._forces = np.array([self._robot.motor_table[motor].max_torque for motor in scene.motors])
        self._fastest = np.array([self._robot.motor_table[motor].max_velocity for motor in scene.motors])
        self._gears = Gears(len(scene.joints))
        self._touched = False  # in the last substep
        self._deepest: dict[str, float] = {}  # m, by pair, in the last tick

    def _advance(self, h: float) -> None:
        scene, motors = self._scene, self.motors
        velocity = motors.drive(h)
        q = motors.q + velocity * h
        here = motors.q[scene.motors]
        slowest, fastest = (self._lower - here) / h, (self._upper - here) / h
        target = np.clip(velocity[scene.motors], slowest, fastest)
        in_torque = motors.in_torque[scene.motors]
        if in_torque.any():
            share = self._apply_torques(in_torque, target, (np.maximum(slowest, -self._fastest), np.minimum(fastest, self._fastest)), h)
        else:
            share = None
            self._gears.forget()
            self._apply_velocities(target, self._forces)
        scene.client.stepSimulation()
        joints = scene.client.getJointStates(scene.body, scene.joints)
        q = np.clip(q, self._robot.limits[:, 0], self._robot.limits[:, 1])  # of the motors that the URDF lacks
        q[scene.motors] = [joint[0] for joint in joints]
        motors.adopt(q)
        efforts = motors.efforts
        exerted = np.array([joint[3] for joint in joints])  # for a constraint that is switched off PyBullet returns the last value
        efforts[scene.motors] = exerted if share is None else np.where(share.free, share.torque, exerted)
        motors.efforts = efforts

    def _apply_torques(self, in_torque: Mask, target: Array, fastest: tuple[Array, Array], h: float) -> Share:
        """Set, for a substep of `h` [s], the torques of the joints in torque mode and the velocities of the others; return these commands.

        `in_torque`: which joints are in torque mode. `target`: velocities [rad/s] of the others. `fastest`: lowest and highest velocity of
        each joint [rad/s]. All arrays are (d,), by joint.
        """
        scene = self._scene
        torque = self.motors.torques[scene.motors]
        share = self._gears.transmit(scene.motion(self.motors.q), torque, in_torque, target, fastest, self._touched, h)
        self._apply_velocities(share.velocity, np.where(share.free, 0.0, self._forces))
        free = np.flatnonzero(share.free)
        joints = [scene.joints[index] for index in free]
        scene.client.setJointMotorControlArray(scene.body, joints, pybullet.TORQUE_CONTROL, forces=share.torque[free].tolist())
        return share

    def _apply_velocities(self, velocity: Array, force: Array) -> None:
        """Set the velocities of the joints, rad/s, and their largest torques, N m."""
        scene = self._scene
        scene.client.setJointMotorControlArray(
            scene.body, scene.joints, pybullet.VELOCITY_CONTROL, targetVelocities=velocity.tolist(), forces=force.tolist()
        )

    def _find_contacts(self) -> None:
        scene = self._scene
        points = scene.client.getContactPoints(scene.body)
        self._touched = bool(points)
        for point in points:
            depth = -point[8]
            if depth > 0.0:
                self._keep(depth, *point[1:5])

    def _keep(self, depth: float, first_body: int, second_body: int, first_link: int, second_link: int) -> None:
        scene = self._scene
        names = [
            self._names[link] if body == scene.body else next(name for name, b in scene.objects.items() if b == body)
            for body, link in ((first_body, first_link), (second_body, second_link))
        ]
        if all(name in scene.links or name in self._obstacles for name in names):  # the ball is there to be touched
            pair = " ".join(sorted(names))
            self._deepest[pair] = max(depth, self._deepest.get(pair, 0.0))
