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
    """The deepest solid contact of a tick, between two links, or a link and an object.

    `depth`: m; 0 without a contact. `pair`: the two names, sorted, with a blank between them; empty without a contact.
    """

    depth: float = 0.0
    pair: str = ""


def require_simulated(robot: Robot) -> None:
    """Raise BackendUnavailable if the robot is not the iCub, the only robot that PyBullet can move here."""
    if robot.name != SIMULATED:
        raise BackendUnavailable(
            f'backend = "pybullet" cannot move {robot.name!r}: the physics simulates the links and motors of the {SIMULATED} only. '
            'Set backend = "mujoco", physics for every robot, or "kinematic": the motor model alone.'
        )


def unmoved(world: World) -> tuple[str, ...]:
    """Return a note for the user that the movable objects of a world do not move in this back-end when they are pushed.

    The tuple has this one text, with the names of the objects; it is empty if the world has no movable objects.
    """
    names = ", ".join(name for name, thing in world.objects.items() if thing.movable)
    return (f'objects with a mass do not move here when they are pushed ({names}): backend = "mujoco" moves them',) if names else ()


class Backend(Protocol):
    """A simulated robot: its motors, and the body and world around it. Arrays are (n,) in the order of `robot.motors`."""

    name: str
    """Name of the back-end, as in the settings."""
    notes: Sequence[str]
    """Assumptions of the back-end about the robot, for the user, one sentence each."""
    pairs_watched: int
    """Number of pairs (of links, or of a link and an object) that the back-end tests for solid contact."""

    @property
    def motors(self) -> Motors:
        """The motors of the robot, with their positions and velocities."""
        ...

    @property
    def world(self) -> World:
        """The world with all objects at their present poses."""
        ...

    def step(self, dt: float) -> None:
        """Advance the simulation by a tick of dt [s]."""
        ...

    def reset(self, seed: int) -> None:
        """Put the robot at home, at rest, with all motors in hold, and the world in its initial state.

        In hold a motor keeps its position and follows no commands. `seed`: of the encoder noise.
        """
        ...

    def place(self, name: str, position: tuple[float, float, float]) -> None:
        """Move a world object to a position (x, y, z) m, root frame.

        Raises MobeeError if there is no such object, if it is attached to a link, or if a number is not finite.
        """
        ...

    def contact(self) -> SolidContact:
        """Return the deepest solid contact of the last tick; its depth is 0 if there was none."""
        ...

    def contacts(self) -> Mapping[str, float]:
        """Return a dict from each pair in solid contact ("NAME NAME", sorted) to the largest depth [m] in the last tick."""
        ...

    def gap(self) -> float:
        """Return the present smallest distance of hands and forearms from the obstacles of the world, m; -1 if it is not measured."""
        ...


class KinematicBackend:
    """The motor model without physics: joints follow their motors exactly, and nothing is in contact."""

    name = "kinematic"
    pairs_watched = 0

    def __init__(self, robot: Robot, load_world: Callable[[], World], parameters: MotorParameters, seed: int) -> None:
        self._robot, self._load_world, self._parameters = robot, load_world, parameters
        self.reset(seed)

    def reset(self, seed: int) -> None:
        """Put the robot at home, at rest, with all motors in hold, and the world in its initial state.

        In hold a motor keeps its position and follows no commands. `seed`: of the encoder noise.
        """
        self.motors = Motors(self._robot, self._parameters, seed, self._robot.home)
        self.world = self._load_world()
        self.notes: Sequence[str] = unmoved(self.world)

    def step(self, dt: float) -> None:
        """Advance the motors by a tick of dt [s]; in torque mode gravity acts on them."""
        substeps, motors = self._parameters.substeps(dt), self.motors
        if not motors.in_torque.any():
            motors.move(substeps, dt / substeps)
            return
        for _ in range(substeps):
            motors.load = gravity_torque(self._robot, motors.q)
            motors.move(1, dt / substeps)

    def place(self, name: str, position: tuple[float, float, float]) -> None:
        """Move a world object to a position (x, y, z) m, root frame.

        Raises MobeeError if there is no such object, if it is attached to a link, or if a number is not finite.
        """
        self.world.move(name, position=position)

    def contact(self) -> SolidContact:
        """Return a contact of depth 0, because this back-end computes no contacts."""
        return SolidContact()

    def contacts(self) -> Mapping[str, float]:
        """Return an empty dict, because this back-end computes no contacts."""
        return {}

    def gap(self) -> float:
        """Return -1.0, because this back-end does not measure the distance to the obstacles."""
        return -1.0
