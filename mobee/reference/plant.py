# SPDX-License-Identifier: Apache-2.0
"""A simulated robot in plain Python, tick by tick: motors, model, and the control law as a list of forces.

It is for trying a new force (see `mobee.reference.law`) before the force is compiled. It is hundreds of times slower than
`mobee.OfflinePlant`, with the same numbers up to rounding.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from mobee.arrays import Array
from mobee.control.gains import Gains
from mobee.reference import law, motors
from mobee.reference.forces import State
from mobee.simulation.motors import MotorParameters

if TYPE_CHECKING:
    from mobee.model.model import Model

ROUNDING = 1e-9  # s: tolerance of times, which are sums of ticks


class Plant:
    """A simulated robot whose motors receive velocity commands, as in the MoBeE program of 2014.

    A command moves the motors from the next tick on.
    """

    def __init__(
        self,
        model: Model,
        seed: int = 0,
        gains: Gains | None = None,
        parameters: MotorParameters | None = None,
        dt: float = 0.01,
        terms: Sequence[law.Term] = law.TERMS,
    ) -> None:
        """Make a plant at rest at the robot's home.

        `seed`: of the encoders' noise. `gains`, `parameters`: of the control law and the motors; None: the defaults. `dt`: length of a tick
        [s]. `terms`: the forces of eq. 5.7, each a function of the `State`.
        """
        self.model, self.robot, self.seed, self.dt, self.terms = model, model.robot, seed, dt, terms
        self.gains = Gains.default() if gains is None else gains
        self.parameters = MotorParameters() if parameters is None else parameters
        self.ticks = 0
        self.attractor = self.robot.home.copy()
        self.force: Array | None = None  # f of eq. 5.9, see `State`
        self.pushes: dict[str, Array] = {}
        self.motion = law.at_rest(self.robot, self.gains, self.attractor)
        self._substeps = self.parameters.substeps(dt)
        self.motors = motors.at_rest(self.robot, self.parameters, self.robot.home.copy(), dt / self._substeps)
        self.q = self.robot.home.copy()  # the last encoder values, rad

    def tick(self) -> None:
        """Run one control tick: apply the last command, read the encoders, compute contacts and the control law, and move the motors."""
        self.ticks += 1
        if self.ticks > 1:
            motors.command(self.motors, slice(None), "velocity", self.motion.velocity)
        self.q = motors.encoders(self.robot, self.parameters, self.motors, self.seed, self.ticks, self.dt)
        self.motion = law.step(self.robot, self.gains, self.motion, self.q, law.acceleration(self.state, self.terms), self.dt)
        for _ in range(self._substeps):
            motors.substep(self.robot, self.parameters, self.motors, self.dt / self._substeps)

    @property
    def state(self) -> State:
        """The input of the control law at the last encoder values; each access computes the contacts again."""
        contacts = self.model.evaluate(self.q).contacts
        return State(self.robot, self.gains, self.q, self.motion.velocity, self.attractor, contacts, self.force, self.pushes)

    def act(self, part: str, target: Array) -> bool:
        """Set the part's attractor to `target` (n_part,) rad and run ticks until the part has settled (thesis 6.1).

        The attractor is the pose to which the spring of the control law pulls the motors. Returns True, or False if the part has not
        settled before the timeout of the settle test.
        """
        self.attractor[self.robot.part(part).slice] = target
        settle, since = self.gains.settle, 0.0
        look = settle.first_check
        while since < settle.timeout - ROUNDING:
            self.tick()
            since += self.dt
            if since >= look - ROUNDING:
                look += settle.interval
                if law.is_settled(self.robot, self.gains, self.motion, part):
                    return True
        return False
