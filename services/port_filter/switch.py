"""The switch between clients and reflex (thesis figure 4.1)."""

from __future__ import annotations

import numpy as np

from mobee import Model
from mobee.arrays import Array
from mobee.control.reflex import KINDS, Reflex, Violation, Watch
from mobee.robot.robot import Robot
from services.port_filter.config import Config


class Switch:
    """The model, the watch over its poses and the reflex of one run."""

    def __init__(self, config: Config, robot: Robot) -> None:
        self._settings = config.reflex
        model = Model(robot, config.load_world())
        for name, item in list(model.world.objects.items()):
            if item.role == "target":  # left to be perceived, as in the model's own process
                model.world.remove(name)
        self._track, self._watch = model.track(), Watch(robot, KINDS if config.contacts == "both" else (config.contacts,), config.tolerance)
        self._max_velocity = np.array([motor.max_velocity for motor in robot.motor_table])
        self._track.evaluate(robot.home).contacts  # noqa: B018  # what is built once is built before the robot moves
        self.q: Array = robot.home
        self.violations: tuple[Violation, ...] = ()
        self.restart(0.01)

    def restart(self, dt: float) -> None:
        """A new run with ticks of dt s: nothing is recorded."""
        self.reflex = Reflex(self._settings, dt, self._max_velocity)

    def tick(self, q: Array) -> Array | None:
        """The target (n,) rad of the reflex at the measured pose q (n,) rad; None while the clients command."""
        self.q = q
        self.violations = self._watch.look(self._track.evaluate(q))
        return self.reflex.tick(q, self.violations)
