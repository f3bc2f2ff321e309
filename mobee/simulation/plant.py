"""The offline plant: model, controller and motors in one process, tick by tick as the live system runs them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mobee.collision.touch import touched
from mobee.control import Command, Controller, Gains, SettleTest
from mobee.control.forces import Propagate
from mobee.control.modality import Modality
from mobee.errors import ActionInterrupted, InvalidValue
from mobee.plant import Outcome
from mobee.robot.robot import Array
from mobee.simulation.motors import MotorParameters, Motors

if TYPE_CHECKING:
    from mobee.model import Model, Pose


@dataclass(slots=True)
class _Action:
    start: float  # s
    test: SettleTest


class OfflinePlant:
    """A Plant (see `mobee.plant`) without processes, bus and clock; the seed decides everything.

    A command formed from the encoders of tick k moves the motors from tick k + 1 on, as live.  Several parts may be acting
    at once: `begin` starts an action, `advance` runs until one or more are over, `act` does both for one part.
    Parts that are not acting stay under control, at their attractors.
    """

    def __init__(
        self,
        model: Model,
        seed: int = 0,
        gains: Gains | None = None,
        motors: MotorParameters | None = None,
        dt: float = 0.01,
        propagate: Propagate = "tree",
        modality: Modality = "velocity",
        speed_scale: float = 1.0,
        contact_forces: bool = True,
    ) -> None:
        """Start at rest at the robot's home posture; `dt` [s] is the control tick."""
        self.model = model
        self.robot = model.robot
        self.controller = Controller(model, gains, modality, propagate, speed_scale, contact_forces)
        if not 0 < dt < self.controller.max_dt:
            raise InvalidValue(f"tick of {dt} s: the gains need more than 0 and less than {self.controller.max_dt:.4g} s")
        self.dt = dt
        parameters = motors if motors is not None else MotorParameters()
        self.motors = Motors(self.robot, parameters, seed, self.robot.home)
        self._substeps = parameters.substeps(dt)
        self._ticks = 0
        self._actions: dict[str, _Action] = {}
        self._command: Command | None = None
        self._q = self.motors.encoders(dt)
        self._track = model.track()
        self.pose: Pose | None = None  # the model at the last tick

    @property
    def time(self) -> float:
        """Plant time in s."""
        return self._ticks * self.dt

    def measure(self, part: str) -> Array:
        """The part's motor positions as the encoders said at the last tick, shape (n_part,), in [rad]."""
        return self._q[self.robot.part(part).slice].copy()

    def act(self, part: str, target: Array) -> Outcome:
        """Go towards `target` (n_part,) rad and run until this part has settled or timed out.

        Raises InvalidValue while another part is acting (then use `begin` and `advance`).
        """
        if others := [name for name in self._actions if name != part]:
            raise InvalidValue(f"act({part!r}) while {', '.join(others)} is acting: use begin and advance for several parts")
        self.begin(part, target)
        return self.advance()[0][1]

    def begin(self, part: str, target: Array) -> None:
        """Set the part's attractor, (n_part,) rad within the motors' limits, and start its settle test."""
        where = self.robot.part(part)
        limits = self.robot.limits[where.slice]
        if np.shape(target) == (len(where),):
            outside = ~((target >= limits[:, 0]) & (target <= limits[:, 1]))
            for i in np.flatnonzero(outside)[:1]:
                low, high = limits[i]
                raise InvalidValue(f"target {target[i]:.4g} rad for {where.motors[i]}: must be within {low:.4g} to {high:.4g} rad")
        self.controller.set_attractor(part, target)
        asked = self.time - self.dt  # in the tick just over, as live: the next one is the first to see it
        self._actions[part] = _Action(asked, SettleTest(self.controller.gains.settle, asked))

    def advance(self) -> list[tuple[str, Outcome]]:
        """Run until one or more of the acting parts are done; their names and outcomes, in the order of the parts."""
        if not self._actions:
            raise InvalidValue("no part is acting: call begin first")
        while True:
            self.tick()
            if done := self._finished():
                return done

    def tick(self) -> None:
        """One control tick: encoders, model, controller; then the motors run under the command of the tick before."""
        if self._command is not None:
            self.motors.command(slice(None), self.controller.modality, getattr(self._command, self.controller.modality))
        self._q = self.motors.encoders(self.dt)
        if not np.isfinite(self._q).all():
            self._actions.clear()
            raise ActionInterrupted(f"the motors' state is not finite at {self.time:.3f} s: nothing was observed")
        self.pose = self._track.evaluate(self._q)
        self._command = self.controller.step(self._q, self.dt, self.controller.forces(self.pose))
        step = self.dt / self._substeps
        for _ in range(self._substeps):
            self.motors.drive(step)
            self.motors.integrate()
        self._ticks += 1

    def _finished(self) -> list[tuple[str, Outcome]]:
        done = []
        sampled = self.time - self.dt
        for name, part in self.robot.parts.items():
            if name not in self._actions:
                continue
            action = self._actions[name]
            verdict = action.test.look(sampled, self.controller.velocity[part.slice], self.controller.acceleration[part.slice])
            if verdict != "moving":
                del self._actions[name]
                done.append((name, Outcome(self.measure(name), verdict == "settled", sampled - action.start, self._touched(name))))
        return done

    def _touched(self, part: str) -> tuple[str, ...]:
        return () if self.pose is None else touched(self.pose)[part]
