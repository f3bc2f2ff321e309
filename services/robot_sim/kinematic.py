# SPDX-License-Identifier: Apache-2.0
"""The back-end interface, and the kinematic back-end: motors without physics."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from mobee.errors import InvalidValue
from mobee.model.masses import gravity_torque
from mobee.model.world import World
from mobee.robot.robot import Robot
from mobee.simulation.motors import MotorParameters, Motors

GAP_LINKS = ("forearm", "hand")  # links whose distance from the table is measured
MAX_GAP = 2.0  # m; larger distances are not searched for

SIMULATED = "icub"  # the robot that PyBullet's URDF describes


class BackendUnavailable(InvalidValue):
    """Raised if a back-end cannot be used; the message gives the alternative."""


@dataclass(frozen=True, slots=True)
class SolidContact:
    """The deepest solid contact of a listed pair; depth 0 without contact."""

    depth: float = 0.0  # m
    pair: str = ""


def require_simulated(robot: Robot) -> None:
    """Raise BackendUnavailable for a robot that PyBullet cannot move."""
    if robot.name != SIMULATED:
        raise BackendUnavailable(
            f'backend = "pybullet" cannot move {robot.name!r}: the physics simulates the links and motors of the {SIMULATED} only. '
            'Set backend = "mujoco", physics for every robot, or "kinematic": the motor model alone.'
        )


def unmoved(world: World) -> tuple[str, ...]:
    """Return the note of a back-end that moves no object about the movable ones of a world."""
    names = ", ".join(name for name, thing in world.objects.items() if thing.movable)
    return (f'objects with a mass do not move here when they are pushed ({names}): backend = "mujoco" moves them',) if names else ()


class Backend(Protocol):
    """Motors and the body that they move; arrays (n,) in the order of `robot.motors`."""

    name: str
    """As in the settings."""
    notes: Sequence[str]
    """Assumptions of the back-end about the robot, one sentence each."""
    pairs_watched: int

    @property
    def motors(self) -> Motors:
        """Positions and velocities of the motors."""
        ...

    @property
    def world(self) -> World:
        """The objects around the robot."""
        ...

    def step(self, dt: float) -> None:
        """Advance by a tick of dt [s]."""
        ...

    def reset(self, seed: int) -> None:
        """Set the home posture, at rest, in hold, and the world in its initial state."""
        ...

    def place(self, name: str, position: tuple[float, float, float]) -> None:
        """Set the position of a world object, m; raises MobeeError."""
        ...

    def contact(self) -> SolidContact:
        """Return the deepest solid contact of the last tick."""
        ...

    def contacts(self) -> Mapping[str, float]:
        """Return the depth [m] of every solid contact of the last tick, by pair, at its deepest."""
        ...

    def gap(self) -> float:
        """Return the closest distance of hands and forearms to the table, m; -1 if it is not measured."""
        ...


class KinematicBackend:
    """The motor model alone: joints follow their motors exactly."""

    name = "kinematic"
    pairs_watched = 0

    def __init__(self, robot: Robot, load_world: Callable[[], World], parameters: MotorParameters, seed: int) -> None:
        self._robot, self._load_world, self._parameters = robot, load_world, parameters
        self.reset(seed)

    def reset(self, seed: int) -> None:
        """Set the home posture, at rest, in hold, and the world in its initial state."""
        self.motors = Motors(self._robot, self._parameters, seed, self._robot.home)
        self.world = self._load_world()
        self.notes: Sequence[str] = unmoved(self.world)

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
        """Set the position of a world object, m; raises MobeeError."""
        self.world.move(name, position=position)

    def contact(self) -> SolidContact:
        """Return a contact of depth 0: this back-end has no solids."""
        return SolidContact()

    def contacts(self) -> Mapping[str, float]:
        """Return no contacts: this back-end has no solids."""
        return {}

    def gap(self) -> float:
        """Return -1.0: this backend does not measure the distance to the table."""
        return -1.0
