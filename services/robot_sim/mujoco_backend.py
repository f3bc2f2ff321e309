# SPDX-License-Identifier: Apache-2.0
"""The physics back-end for every robot: MuJoCo's joints follow the velocities or torques of the motor model."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array
from mobee.control.law import FRICTION, INERTIA
from mobee.model.world import World
from mobee.robot.robot import Robot
from mobee.simulation.motors import MotorParameters, Motors
from services.robot_sim.kinematic import GAP_LINKS, MAX_GAP, SolidContact
from services.robot_sim.mujoco_scene import MujocoScene, reflected_inertia

STOP = 1e6  # N m, of a mechanical stop: more than any motor has

Mask = NDArray[np.bool_]


class MujocoBackend:
    """Simulates all joints of any robot in MuJoCo, with gravity; the base of the robot is fixed.

    Except in torque mode, a motor is a constraint on the velocity of its joint. The torque of this constraint is limited to the
    largest torque of the motor, and holds the robot against gravity. In torque mode the commanded torque acts through a gear with the
    inertia and the friction of the control law; the command must include the torque against gravity.
    """

    name = "mujoco"

    def __init__(self, robot: Robot, load_world: Callable[[], World], parameters: MotorParameters, seed: int, dt: float) -> None:
        """Build the robot and its world.

        `load_world`: returns a new world. `seed`: of the encoder noise. `dt`: the tick, s. Raises MobeeError if a motor parameter or the
        world is invalid.
        """
        self._robot, self._load_world, self._parameters = robot, load_world, parameters
        self._substeps = parameters.substeps(dt)
        self._substep = dt / self._substeps
        self._lower, self._upper = robot.limits.T
        self._torques = np.array([motor.max_torque for motor in robot.motor_table])
        self._fastest = np.array([motor.max_velocity for motor in robot.motor_table])
        self._near = _links_near(robot)
        self.reset(seed)

    def reset(self, seed: int) -> None:
        """Put the robot at home, at rest, with all motors in hold, and the world in its initial state.

        In hold a motor keeps its position and follows no commands. `seed`: of the encoder noise.
        """
        self._world = self._load_world()
        self.motors = Motors(self._robot, self._parameters, seed, self._robot.home)
        self._scene = MujocoScene(self._robot, self._world, self._substep)
        self.pairs_watched = self._scene.pairs_watched
        self.notes: Sequence[str] = self._scene.notes
        self._obstacles = [name for name, thing in self._world.objects.items() if thing.role == "obstacle"]
        self._untouchable = {*self._robot.links, *self._obstacles}  # the ball is there to be touched
        self._pull = (
            self._scene.data.efc_KBIP[self._scene.rows, 1] * self._scene.scale
        )  # 1/s, acceleration of a joint for a motor's velocity
        self._geared = np.zeros(len(self._robot.motors), dtype=np.bool_)
        self._some_geared = False
        self._deepest: dict[str, float] = {}  # m, by pair, in the last tick

    @property
    def world(self) -> World:
        """The world with all objects at their present poses; the physics moves the movable ones."""
        for name in self._scene.movable:
            position, rotation = self._scene.pose_of(name)
            self._world.move(name, position=position, rotation=rotation)
        return self._world

    def step(self, dt: float) -> None:
        """Advance by one tick; `dt` [s] must be the `dt` that the constructor got."""
        self._deepest.clear()
        for _ in range(self._substeps):
            self._advance(self._substep)
            for pair, depth in self._scene.contacts().items():
                if self._untouchable.issuperset(pair):
                    name = " ".join(pair)
                    self._deepest[name] = max(depth, self._deepest.get(name, 0.0))

    def place(self, name: str, position: tuple[float, float, float]) -> None:
        """Move a world object to a position (x, y, z) m, root frame.

        A movable object is then at rest, with the orientation in the world's file. Raises MobeeError if there is no such object, if it is
        attached to a link, or if a number is not finite.
        """
        self._world.move(name, position=position)
        self._scene.move(name, position)

    def set_posture(self, q: Array) -> None:
        """Put the motors at q (n,) rad, at rest and in hold (they keep their positions and follow no commands)."""
        self._scene.set_posture(q)
        self.motors.restart(self.motors.seed, q)

    def contact(self) -> SolidContact:
        """Return the deepest solid contact of links and obstacles in the last tick; its depth is 0 if there was none."""
        if not self._deepest:
            return SolidContact()
        pair = max(self._deepest, key=self._deepest.__getitem__)
        return SolidContact(self._deepest[pair], pair)

    def contacts(self) -> Mapping[str, float]:
        """Return a dict from each pair in solid contact ("NAME NAME", sorted) to the largest depth [m] in the last tick.

        The pairs are of links and obstacles. Contacts with other objects, such as targets, are left out.
        """
        return self._deepest

    def gap(self) -> float:
        """Return the smallest distance of hands and forearms from the obstacles, m; 0 in contact, -1 without obstacles.

        If the robot has no links of hands and forearms, the distance of the last link of each chain is measured instead. A distance of more
        than MAX_GAP (2 m) is returned as 2 m.
        """
        if not self._obstacles or not self._near:
            return -1.0
        return max(self._scene.distance(self._near, self._obstacles, MAX_GAP), 0.0)

    def _advance(self, h: float) -> None:
        scene, motors = self._scene, self.motors
        velocity, q, in_torque = motors.drive(h), motors.q, motors.in_torque
        some_in_torque = bool(in_torque.any())
        if some_in_torque or self._some_geared:
            self._change_gears(in_torque)
        reached = np.minimum(np.maximum(q + velocity * h, self._lower), self._upper)
        target = (reached - q) / h
        data, rows = scene.data, scene.rows
        if some_in_torque:
            free, target = self._apply_torques(in_torque, target, q, h)
            data.efc_frictionloss[rows[free]], data.efc_frictionloss[rows[in_torque & ~free]] = 0.0, STOP
        data.efc_aref[rows] += self._pull * target
        mujoco.mj_step2(scene.model, data)
        efforts = data.efc_force[rows] * scene.scale
        if some_in_torque:
            passed = motors.torques - FRICTION * data.qvel[scene.dofs] / scene.scale - INERTIA * data.qacc[scene.dofs] / scene.scale
            efforts = np.where(free, passed, np.clip(efforts, -self._torques, self._torques))
        scene.refresh()
        motors.adopt(scene.motor_positions())
        motors.efforts = efforts

    def _apply_torques(self, in_torque: Mask, target: Array, q: Array, h: float) -> tuple[Mask, Array]:
        """Give the motors in torque mode their torques; returns which motors are free, and the velocities (n,) rad/s of the others.

        A motor that would leave its range, or be faster than it may, is not free: it moves at the limit of the range.
        """
        scene = self._scene
        data = scene.data
        torques = np.where(in_torque, self.motors.torques / scene.scale, 0.0)
        data.qfrc_applied[scene.dofs] = torques
        mujoco.mj_fwdActuation(scene.model, data)
        mujoco.mj_fwdAcceleration(scene.model, data)
        coming = (data.qvel + h * data.qacc_smooth)[scene.dofs] / scene.scale
        slowest = np.maximum((self._lower - q) / h, -self._fastest)
        fastest = np.minimum((self._upper - q) / h, self._fastest)
        within = np.clip(coming, slowest, fastest)
        free = in_torque & (within == coming)
        data.qfrc_applied[scene.dofs] = np.where(free, torques, 0.0)
        return free, np.where(in_torque, within, target)

    def _change_gears(self, in_torque: Mask) -> None:
        """Set the inertia and friction of the motors: in torque mode those of the control law (`mobee.control.law`), else their own."""
        if (in_torque == self._geared).all():
            return
        scene = self._scene
        for index, (motor, geared) in enumerate(zip(self._robot.motor_table, in_torque.tolist(), strict=True)):
            scene.set_gear(motor, INERTIA if geared else reflected_inertia(motor), FRICTION if geared else 0.0)
            if not geared:
                scene.data.qfrc_applied[scene.dofs[index]] = 0.0
        self._geared, self._some_geared = in_torque, bool(in_torque.any())
        scene.refresh()


def _links_near(robot: Robot) -> list[str]:
    """Return the links whose distance from obstacles is measured: forearms, hands and their fingers, else the last link of each chain."""
    near = np.array([link.endswith(GAP_LINKS) for link in robot.links])
    for index, joint in enumerate(robot.joints):
        near[index + 1] |= near[joint.parent]
    if not near.any():
        near = ~np.isin(np.arange(len(robot.links)), [joint.parent for joint in robot.joints])
    return [link for link, is_near in zip(robot.links, near.tolist(), strict=True) if is_near]
