"""Physics: the motor model asks for velocities, PyBullet's joints follow as far as torque and contacts let them."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pybullet

from mobee.collision.world import World
from mobee.robot.robot import Robot
from mobee.simulation.motors import MotorParameters, Motors
from services.robot_sim.backend import SolidContact
from services.robot_sim.bullet_scene import BulletScene
from services.robot_sim.pairs import load_solid_pairs

TOUCHING = ("forearm", "hand")  # links whose distance from the table is measured
FAR = 2.0  # m, beyond it a gap is not searched
NO_CONTACT = SolidContact()


class BulletBackend:
    """The upper body of iCub v2.5 with gravity; fingers and eyes are the motor model alone.

    A joint is a velocity constraint with the motor's torque as its limit, also in torque mode, where the motor model turns torque
    into velocity: the gear carries the weight, as it does on the robot.
    """

    def __init__(self, robot: Robot, load_world: Callable[[], World], parameters: MotorParameters, seed: int, dt: float) -> None:
        """`dt`: the tick, s.  Raises BackendUnavailable or MobeeError."""
        self._robot, self._load_world, self._parameters = robot, load_world, parameters
        self._substeps = parameters.substeps(dt)
        self._substep = dt / self._substeps
        self._listed = load_solid_pairs()
        self._build(seed)

    def reset(self, seed: int) -> None:
        """Back home, at rest, in hold, the world as it was."""
        self._scene.close()
        self._build(seed)

    def step(self, dt: float) -> None:
        """Advance by a tick of dt [s], the same as at the start."""
        self._deepest.clear()
        for _ in range(self._substeps):
            self._advance(self._substep)
            self._look_for_contacts()

    def place(self, name: str, position: tuple[float, float, float]) -> None:
        """Put a world object somewhere, m; raises MobeeError."""
        self.world.move(name, position=position)
        self._scene.move(name, position)

    def contact(self) -> SolidContact:
        """The deepest solid contact of the last tick."""
        if not self._deepest:
            return NO_CONTACT
        pair = max(self._deepest, key=self._deepest.__getitem__)
        return SolidContact(self._deepest[pair], pair)

    def contacts(self) -> Mapping[str, float]:
        """Depth [m] of every solid contact of the last tick, by pair, at its deepest."""
        return self._deepest

    def gap(self) -> float:
        """Closest distance of hands and forearms to the obstacles, m; -1 when there is none."""
        links = [link for link in self._scene.links if link.endswith(TOUCHING)]
        gaps = [self._scene.distance(link, obstacle, FAR) for link in links for obstacle in self._obstacles]
        return max(min(gaps), 0.0) if gaps else -1.0

    def _build(self, seed: int) -> None:
        self.world = self._load_world()
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
        self._forces = [self._robot.motor_table[motor].max_torque for motor in scene.motors]
        self._deepest: dict[str, float] = {}  # m, by pair, in the last tick

    def _advance(self, h: float) -> None:
        scene, motors = self._scene, self.motors
        velocity = motors.drive(h)
        q = motors.q + velocity * h
        here = motors.q[scene.motors]
        target = np.clip(velocity[scene.motors], (self._lower - here) / h, (self._upper - here) / h)
        scene.client.setJointMotorControlArray(
            scene.body, scene.joints, pybullet.VELOCITY_CONTROL, targetVelocities=target.tolist(), forces=self._forces
        )
        scene.client.stepSimulation()
        joints = scene.client.getJointStates(scene.body, scene.joints)
        q = np.clip(q, self._robot.limits[:, 0], self._robot.limits[:, 1])  # of the motors that the URDF lacks
        q[scene.motors] = [joint[0] for joint in joints]
        motors.adopt(q)
        motors.efforts[scene.motors] = [joint[3] for joint in joints]

    def _look_for_contacts(self) -> None:
        scene = self._scene
        for point in scene.client.getContactPoints(scene.body):
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
