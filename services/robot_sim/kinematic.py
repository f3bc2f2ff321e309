"""The motor model alone: no contacts, every Python version; weight acts on motors in torque mode only."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from mobee.collision.world import World
from mobee.kinematics.gravity import gravity_torque
from mobee.robot.robot import Robot
from mobee.simulation.motors import MotorParameters, Motors
from services.robot_sim.backend import SolidContact


class KinematicBackend:
    """Joints are where the motors take them."""

    pairs_watched = 0

    def __init__(self, robot: Robot, load_world: Callable[[], World], parameters: MotorParameters, seed: int) -> None:
        self._robot, self._load_world, self._parameters = robot, load_world, parameters
        self.reset(seed)

    def reset(self, seed: int) -> None:
        """Back home, at rest, in hold, the world as it was."""
        self.motors = Motors(self._robot, self._parameters, seed, self._robot.home)
        self.world = self._load_world()

    def step(self, dt: float) -> None:
        """Advance by a tick of dt [s]."""
        substeps, motors = self._parameters.substeps(dt), self.motors
        if not motors.in_torque.any():
            motors.move(substeps, dt / substeps)
            return
        for _ in range(substeps):
            motors.load = gravity_torque(self._robot, motors.q)
            motors.move(1, dt / substeps)

    def place(self, name: str, position: tuple[float, float, float]) -> None:
        """Put a world object somewhere, m; raises MobeeError."""
        self.world.move(name, position=position)

    def contact(self) -> SolidContact:
        """Nothing here is solid."""
        return SolidContact()

    def contacts(self) -> Mapping[str, float]:
        """Nothing here is solid."""
        return {}

    def gap(self) -> float:
        """Not measured."""
        return -1.0
