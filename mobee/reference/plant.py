# SPDX-License-Identifier: Apache-2.0
"""A simulated robot in plain Python, tick by tick: motors, model, and the control law as a list of forces.

It is for trying a new force (see `mobee.reference.law`) before the force is compiled. It is hundreds of times slower than
`mobee.OfflinePlant`, with the same numbers up to rounding. Its motors have delay, lag, friction, play, hard stops and encoder noise
(docs/plant.md). Each has a motor side and a joint side, the input and the output of its gear, with play (backlash) between them. The
encoders measure the joint side.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array
from mobee.control.gains import Gains
from mobee.control.law import FRICTION as VISCOUS
from mobee.control.law import INERTIA
from mobee.reference import law
from mobee.reference.forces import State
from mobee.robot.motor_units import fine_units
from mobee.robot.robot import Robot
from mobee.simulation.motors import MotorParameters

if TYPE_CHECKING:
    from mobee.model.model import Model

ROUNDING = 1e-9  # s: tolerance of times, which are sums of ticks
SERVO_GAIN = 8.0  # 1/s: velocity per distance, in position mode and in a hold that has come to rest
NOISE_PERIOD = 0.02  # s, the tick for which the encoder noise is specified
WORD = 2**64 - 1  # mask of 64 bits


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
        self.motors = at_rest(self.robot, self.parameters, self.robot.home.copy(), dt / self._substeps)
        self.q = self.robot.home.copy()  # the last encoder values, rad

    def tick(self) -> None:
        """Run one control tick: apply the last command, read the encoders, compute contacts and the control law, and move the motors."""
        self.ticks += 1
        if self.ticks > 1:
            command(self.motors, slice(None), "velocity", self.motion.velocity)
        self.q = encoders(self.robot, self.parameters, self.motors, self.seed, self.ticks, self.dt)
        self.motion = law.step(self.robot, self.gains, self.motion, self.q, law.acceleration(self.state, self.terms), self.dt)
        for _ in range(self._substeps):
            substep(self.robot, self.parameters, self.motors, self.dt / self._substeps)

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


@dataclass(slots=True, eq=False)
class MotorState:
    """The state of all n motors of a robot; arrays (n,). A motor has a motor side and a joint side (input and output of its gear).

    `q` (rad), `velocity` (rad/s): of the joint side. `motor_q`, `motor_velocity`: of the motor side. `mode`: "position", "velocity",
    "torque" or "hold". `reference`: the command, in rad (position), rad/s (velocity) or N m (torque). `resting`: whether a motor in hold
    has come to rest. `rest`: rad, the position that it then keeps. `load`: N m, the robot's weight, which acts on motors in torque mode.
    `line`: the delayed commands (rad/s; N m in torque mode), one (n,) for each substep, the newest last.
    """

    q: Array
    velocity: Array
    motor_q: Array
    motor_velocity: Array
    mode: NDArray[np.str_]
    reference: Array
    resting: NDArray[np.bool_]
    rest: Array
    load: Array
    line: list[Array]


def at_rest(robot: Robot, parameters: MotorParameters, q: Array, dt: float) -> MotorState:
    """Return the state of the motors with every motor in hold and at rest at q (n,) rad.

    In hold a motor keeps its position. `dt`: the length of a substep [s].
    """
    n, zero = len(q), np.zeros(len(q))
    line = [zero] * (int(substeps_late(robot, parameters, dt).max(initial=0)) + 1)
    return MotorState(q, zero, q, zero, np.full(n, "hold", dtype="<U8"), zero, np.ones(n, dtype=bool), q, zero, line)


def substeps_late(robot: Robot, parameters: MotorParameters, dt: float) -> NDArray[np.int_]:
    """Return the delay of each motor's commands, (n,), as a whole number of substeps of dt [s]."""
    return np.round(parameters.of_robot("delay", robot) / dt).astype(int)


def command(s: MotorState, where: slice, mode: str, reference: Array | None = None) -> None:
    """Set the kind of command (`mode`) and the reference of some motors, in place; `where`: their slice of q.

    `mode`: "position" (reference in rad), "velocity" (rad/s), "torque" (N m) or "hold" (None). If the mode of a motor changes, its delayed
    commands, which may have another unit, are replaced: in torque mode by the torque that carries its load, else by its present velocity.
    In torque mode the gear is rigid, so the motor side starts at the joint's position.
    """
    if reference is not None:
        s.reference = s.reference.copy()
        s.reference[where] = reference
    entering = np.zeros(len(s.q), dtype=bool)
    entering[where] = s.mode[where] != mode
    s.mode = np.where(entering, mode, s.mode).astype("<U8")
    s.resting = s.resting & ~entering
    now = s.load if mode == "torque" else s.motor_velocity
    s.line = [np.where(entering, now, row) for row in s.line]
    if mode == "torque":
        s.motor_q = np.where(entering, s.q, s.motor_q)


def drive(robot: Robot, parameters: MotorParameters, s: MotorState, dt: float) -> Array:
    """Advance the motor sides by a substep of dt [s]; return the positions (n,) rad to which they push the joint sides.

    Motor side and joint side are the input and the output of a gear, with play between them. A joint side moves only if the motor side has
    reached the end of the play; in torque mode there is no play.
    """
    fastest = np.array([motor.max_velocity for motor in robot.motor_table])
    hardest = np.array([motor.max_acceleration for motor in robot.motor_table])
    strongest = np.array([motor.max_torque for motor in robot.motor_table])
    lag, backlash, friction = (parameters.of_robot(name, robot) for name in ("lag", "backlash", "friction"))
    torque, position = s.mode == "torque", s.mode == "position"
    commanded = np.where(torque, np.clip(s.reference, -strongest, strongest), np.clip(s.reference, -fastest, fastest))
    commanded = np.where(position, servo(s, s.reference, fastest), commanded)
    s.line = [*s.line[1:], commanded]
    asked = np.array([s.line[-1 - late][i] for i, late in enumerate(substeps_late(robot, parameters, dt))])
    velocity = np.where(torque, torque_response(s, asked, friction, fastest, hardest, dt), velocity_response(s, asked, lag, friction, dt))
    velocity = np.where(s.mode == "hold", held(s, fastest, hardest * dt), velocity)
    s.motor_velocity = velocity
    s.motor_q = s.motor_q + velocity * dt
    play = np.where(torque, 0.0, backlash / 2.0)
    return np.clip(s.q, s.motor_q - play, s.motor_q + play)


def servo(s: MotorState, position: Array, fastest: Array) -> Array:
    """Return the velocity (n,) rad/s with which the motors move towards a position (n,) rad, proportional to the distance.

    `fastest` (n,) rad/s: the largest velocities.
    """
    return np.clip(SERVO_GAIN * (position - s.motor_q), -fastest, fastest)


def velocity_response(s: MotorState, asked: Array, lag: Array, friction: Array, dt: float) -> Array:
    """Return the velocity (n,) rad/s after a substep of dt [s] under the velocity command u = `asked` (n,) rad/s.

    It is the exact solution of lag dv/dt = u - v - friction sign(v), with `lag` (n,) s and `friction` (n,) rad/s.
    """
    share = np.where(lag > 0.0, 1.0 - np.exp(-dt / np.where(lag > 0.0, lag, 1.0)), 1.0)
    return nearer_to_zero(s.motor_velocity + share * (asked - s.motor_velocity), share * friction)


def torque_response(s: MotorState, asked: Array, friction: Array, fastest: Array, hardest: Array, dt: float) -> Array:
    """Return the velocity (n,) rad/s after a substep of dt [s] under the torque tau = `asked` (n,) N m.

    I dv/dt = tau - load - B v - B friction sign(v), with the load of `s`, `friction` (n,) rad/s, and the control law's inertia I = 0.5 kg
    m^2 and viscous friction B = 5 N m s/rad. `fastest` (n,) rad/s and `hardest` (n,) rad/s^2 bound velocity and acceleration.
    """
    push = np.clip((asked - s.load - VISCOUS * s.motor_velocity) / INERTIA, -hardest, hardest)
    slowed = nearer_to_zero(s.motor_velocity + push * dt, VISCOUS * friction / INERTIA * dt)
    return np.clip(slowed, -fastest, fastest)


def held(s: MotorState, fastest: Array, change: Array) -> Array:
    """Return the velocity (n,) rad/s of motors in hold, which brake to rest and then keep their position; updates `rest`, `resting`.

    `fastest` (n,) rad/s: the largest velocities. `change` (n,) rad/s: the largest change of the velocity in this substep.
    """
    arrived = (s.mode == "hold") & ~s.resting & (np.abs(s.motor_velocity) <= change)
    s.rest = np.where(arrived, s.motor_q, s.rest)
    s.resting = s.resting | arrived
    braked = s.motor_velocity - np.clip(s.motor_velocity, -change, change)
    return np.where(s.resting, servo(s, s.rest, fastest), braked)


def nearer_to_zero(x: Array, by: Array) -> Array:
    """Return x with its absolute value reduced by `by`, but not below 0, element by element (Coulomb friction)."""
    return np.copysign(np.maximum(np.abs(x) - by, 0.0), x)


def adopt(robot: Robot, parameters: MotorParameters, s: MotorState, q: Array, dt: float) -> None:
    """Set the positions q (n,) rad of the joint sides at the end of a substep of dt [s], and their velocities, in place.

    Motor side and joint side are the input and the output of a gear. The motor side is moved to within half the play of the joint side, so
    if the joint is blocked, the motor side stops too. In torque mode the motor side takes over the position and the velocity of the joint
    side.
    """
    torque, half = s.mode == "torque", parameters.of_robot("backlash", robot) / 2.0
    s.velocity, s.q = (q - s.q) / dt, q
    s.motor_q = np.where(torque, q, np.clip(s.motor_q, q - half, q + half))
    s.motor_velocity = np.where(torque, s.velocity, s.motor_velocity)


def substep(robot: Robot, parameters: MotorParameters, s: MotorState, dt: float) -> None:
    """Advance the motors of a robot without a physics engine by dt [s], in place: the joints follow their motors up to the hard stops."""
    adopt(robot, parameters, s, np.clip(drive(robot, parameters, s, dt), *robot.limits.T), dt)


def encoders(robot: Robot, parameters: MotorParameters, s: MotorState, seed: int, k: int, dt: float) -> Array:
    """Return the encoder values (n,) rad, the positions of the joint sides, at tick k, with white noise that depends on `seed`.

    A tick is one period of the controller, of length dt [s]. The standard deviation of the noise is `parameters.encoder_noise` for
    ticks of 20 ms, and proportional to 1 / sqrt(dt) for others, so that the spectral density of the noise does not depend on dt. For a
    motor that slides it is multiplied by a length [m] that counts as 1 rad (`mobee.robot.motor_units.fine_units`).
    """
    strength = parameters.encoder_noise * math.sqrt(NOISE_PERIOD / dt) * fine_units(robot)
    read: Array = s.q + strength * np.array([normal(seed, k, motor) for motor in range(len(s.q))])
    return read


def normal(seed: int, k: int, motor: int) -> float:
    """Return a random number of the standard normal distribution, a pure function of the seed, the tick k and the motor (Box-Muller)."""
    one = mixed(mixed(mixed(seed & WORD) ^ k) ^ mixed(motor // 2))
    radius = math.sqrt(-2.0 * math.log(((one >> 11) + 1) * 2.0**-53))
    angle = 2.0 * math.pi * ((mixed(one) >> 11) * 2.0**-53)
    return radius * (math.sin(angle) if motor % 2 else math.cos(angle))


def mixed(x: int) -> int:
    """Return a 64-bit hash of the 64-bit number x: one step of the generator splitmix64 (Steele, Lea, Flood 2014)."""
    x = (x + 0x9E3779B97F4A7C15) & WORD
    x = ((x ^ (x >> 30)) * 0xBF58476D1CE4E5B9) & WORD
    x = ((x ^ (x >> 27)) * 0x94D049BB133111EB) & WORD
    return x ^ (x >> 31)
