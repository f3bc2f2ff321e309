"""The motors of a simulated robot: lag, delay, backlash, friction, encoder noise, hard stops."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mobee.errors import InvalidValue
from mobee.kinematics.gravity import gravity_torque
from mobee.robot.motor_units import fine_units
from mobee.robot.robot import Array, Ints, Robot
from mobee.simulation import layout
from mobee.simulation.layout import SERVO_GAIN as SERVO_GAIN
from mobee.simulation.load import compiled
from mobee.simulation.parameters import MotorParameters as MotorParameters

Mode = Literal["position", "velocity", "torque", "hold"]

NOISE_PERIOD = 0.02  # s, the tick for which the encoder noise is given
_MODES: dict[Mode, int] = {
    "position": layout.POSITION,
    "velocity": layout.VELOCITY_MODE,
    "torque": layout.TORQUE,
    "hold": layout.HOLD,
}


class Motors:
    """All motors of a robot, advanced together; arrays are (n,) in the order of `robot.motors`, and copies.

    Each substep: `drive`, then either `integrate` (the joint side is this class's own, with hard stops) or
    `adopt` (the joint side is what a physics engine says it has become).
    """

    def __init__(self, robot: Robot, parameters: MotorParameters, seed: int, q: Array, alive: NDArray[np.bool_] | None = None) -> None:
        """Start at rest at q (n,) rad, every motor in hold; motors that are not `alive` (n,) never move and are read without noise."""
        n = len(robot.motor_table)
        if np.shape(q) != (n,):
            raise InvalidValue(f"q of shape {np.shape(q)}: must be ({n},), a position for every motor of {robot.name}")
        if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
            raise InvalidValue(f"seed {seed!r}: must be a whole number, 0 or more")
        self._robot = robot
        self.parameters = parameters
        self.seed = int(seed) % 2**64
        self.living: Ints = np.arange(n) if alive is None else np.flatnonzero(alive)
        """Indices of the motors that live, ascending."""
        self._compiled = compiled()
        self.state = np.zeros((layout.STATE, n))
        """What `layout` says, for compiled code."""
        for row in (layout.Q, layout.MOTOR_Q, layout.DRAGGED, layout.REST):
            self.state[row] = q
        self.whole = np.zeros((layout.WHOLE, n), dtype=np.int64)
        self.whole[layout.MODE], self.whole[layout.RESTING] = layout.HOLD, 1
        self.fixed = np.zeros((layout.FIXED, n))
        self.fixed[[layout.LOW, layout.HIGH]] = robot.limits.T
        for row, name in (
            (layout.MAX_VELOCITY, "max_velocity"),
            (layout.MAX_ACCELERATION, "max_acceleration"),
            (layout.MAX_TORQUE, "max_torque"),
        ):
            self.fixed[row] = [getattr(motor, name) for motor in robot.motor_table]
        self.fixed[layout.PLAY] = parameters.of_robot("backlash", robot) / 2.0
        self.fixed[layout.FRICTION] = parameters.of_robot("friction", robot)
        self._lag, self._delay = parameters.of_robot("lag", robot), parameters.of_robot("delay", robot)
        self.line, self.at = np.zeros((1, n)), np.zeros(1, dtype=np.int64)
        self._dt = 0.0
        self.begin_substeps(parameters.substep)

    @property
    def q(self) -> Array:
        """Positions of the joint sides [rad]."""
        return self._row(layout.Q)

    @property
    def velocities(self) -> Array:
        """Velocities of the joint sides [rad/s]."""
        return self._row(layout.VELOCITY)

    @property
    def efforts(self) -> Array:
        """What the motors exert [N m]."""
        return self._row(layout.EFFORT)

    @efforts.setter
    def efforts(self, torque: Array) -> None:
        self.state[layout.EFFORT] = torque

    @property
    def motor_velocities(self) -> Array:
        """Velocities on the motor side of the play [rad/s]."""
        return self._row(layout.MOTOR_V)

    @property
    def torques(self) -> Array:
        """What left the delay line in the last substep [N m], 0 where a motor is not in torque mode."""
        return self._row(layout.LEFT)

    @property
    def in_torque(self) -> NDArray[np.bool_]:
        """Which motors are in torque mode."""
        found: NDArray[np.bool_] = self.whole[layout.MODE] == layout.TORQUE
        return found

    @property
    def load(self) -> Array:
        """What pulls from outside against the motors in torque mode, gravity for one [N m]: for them a torque to overcome."""
        return self._row(layout.LOAD)

    @load.setter
    def load(self, torque: Array) -> None:
        self.state[layout.LOAD] = torque

    def command(self, where: slice, mode: Mode, reference: Array | None = None) -> None:
        """Set what is in force for the motors `where`: rad, rad/s or N m by mode; a hold has no reference.

        A hold decelerates at once, without the delay of the line, and then keeps the position reached.  Motors that enter torque mode
        carry their weight until the first torque arrives.
        """
        if reference is not None:
            self.state[layout.REFERENCE, where] = reference
        code = _MODES[mode]
        if (self.whole[layout.MODE, where] != code).any():
            if mode == "torque":
                self.load = gravity_torque(self._robot, self.q)
            entering = np.arange(self.state.shape[1])[where]
            self._compiled.drive.enter_all(entering, self.whole, self.state, self.line, code)

    def drive(self, dt: float) -> Array:
        """Advance the motor side by one substep of dt [s]; the joint-side velocity [rad/s] it asks for, (n,).

        That is zero while the play is not taken up.
        """
        self.begin_substeps(dt)
        self._compiled.drive.drive_all(self.living, self.whole, self.fixed, self.state, self.line, self.at, dt)
        velocity: Array = (self.state[layout.DRAGGED] - self.state[layout.Q]) / dt
        return velocity

    def integrate(self) -> None:
        """Kinematic joint side: go where `drive` asked, as far as the hard stops."""
        self._compiled.drive.integrate_all(self.living, self.whole, self.fixed, self.state, self._dt)

    def adopt(self, q: Array) -> None:
        """Take the joint side (n,) rad at the end of the substep, as a physics engine says.

        The motor side follows into the play: nothing winds up while a joint is blocked.  In torque mode it goes with the joint.
        """
        given = np.array(q, dtype=np.float64)
        self._compiled.drive.adopt_all(self.living, self.whole, self.fixed, self.state, given, self._dt)

    def encoders(self, k: int, dt: float, where: slice = slice(None)) -> Array:
        """The joint positions [rad] at tick k with white noise whose strength does not depend on the tick's length dt [s].

        The noise is a pure function of seed, tick and motor: asked twice, it is the same.
        """
        noisy = self.q
        self._compiled.noise.read(self.seed, k, self.noise(dt), self.living, self.state[layout.Q], noisy)
        return noisy[where]

    def _row(self, row: int) -> Array:
        copied: Array = self.state[row].copy()
        return copied

    def noise(self, dt: float) -> Array:
        """The standard deviations of the encoders at ticks of dt [s], (n,) [rad], or [m] of motors that slide."""
        common = float(self.parameters.encoder_noise * np.sqrt(NOISE_PERIOD / dt))
        return common * fine_units(self._robot)

    def begin_substeps(self, dt: float) -> None:
        """Let substeps last dt [s] from now on; what is on its way to the motors stays in order, the newest last."""
        if dt == self._dt:
            return
        self._dt = dt
        with np.errstate(divide="ignore"):
            self.fixed[layout.SHARE] = np.where(self._lag > 0.0, 1.0 - np.exp(-dt / self._lag), 1.0)
        before, delay = self.whole[layout.DELAY].copy(), np.round(self._delay / dt).astype(np.int64)
        rows, old = int(delay.max()) + 1, len(self.line)
        oldest_first = np.roll(self.line, old - 1 - int(self.at[0]), axis=0)
        still = np.where(self.in_torque, self.state[layout.LOAD], self.state[layout.MOTOR_V])
        line = np.tile(still, (rows, 1))
        for motor, steps in enumerate(np.minimum(before, delay)):
            if steps:
                line[rows - steps :, motor] = oldest_first[old - steps :, motor]
        self.whole[layout.DELAY] = delay
        self.line, self.at = line, np.array([rows - 1])
