# SPDX-License-Identifier: Apache-2.0
"""The gains of the control law, in named sets, and the settle test, which ends an action (thesis 6.1)."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from numbers import Real
from typing import Any, Literal, get_args

import numpy as np

from mobee._core import law as core
from mobee.arrays import Array, is_number
from mobee.errors import InvalidValue, UnknownName
from mobee.robot.motor_units import LIMIT_WIDTH, motor_units
from mobee.robot.robot import Robot

Law = Literal["default", "published_2014"]
ClientSquash = Literal["each", "direction"]

_ANGLES = ("max_spring", "limit_width", "max_limit", "max_client")  # gains in units of rad
_OF_MOTORS = ("damping", "stiffness", "max_spring", "limit_width", "max_limit", "client_slope", "max_client", "weight")
_NO_NUMBERS = ("law", "settle", "client_squash", "weights", "motors", "groups")
Changes = tuple[tuple[str, float], ...]  # (name of a gain, or pattern of motor names; value)


Verdict = Literal["moving", "settled", "timeout"]
VERDICTS: tuple[Verdict, ...] = ("moving", "settled", "timeout")
"""The possible results of the settle test, in the order of their numbers in the compiled core."""


@dataclass(frozen=True, slots=True)
class Settle:
    """The thresholds of the settle test. They influence the results of learning, because they decide which states are hard to reach.

    A part has settled when the commanded speed and acceleration of all its motors are at most `speed` [rad/s] and `acceleration` [rad/s^2].
    The test is made `first_check` s after the start of the action and then every `interval` s; after `timeout` s the action ends without
    having settled. For a motor that slides, 1 rad stands for 7.2 % of the motor's range (`mobee.robot.motor_units.fine_units`): a `speed`
    of 3 deg/s is then 0.4 % of the range per second.
    """

    speed: float
    acceleration: float
    first_check: float = 1.0
    interval: float = 0.2
    timeout: float = 20.0

    def __post_init__(self) -> None:
        for name in ("speed", "acceleration", "interval", "timeout"):
            value = getattr(self, name)
            if not (is_number(value) and 0 < value < np.inf):
                raise InvalidValue(f"settle {name} {value!r}: must be finite and above 0")
        if not (is_number(self.first_check) and 0 <= self.first_check < np.inf):
            raise InvalidValue(f"settle first_check {self.first_check!r} s: must be a finite time, not negative")


@dataclass(frozen=True, slots=True, kw_only=True)
class Gains:
    """The numbers of the control law of thesis eq. 5.7, and the variant of the law.

    The mass is 1, so a force is an acceleration in rad/s^2. All numbers are for motors that turn. For a motor that slides, 1 rad stands for
    29 % of the motor's range (`mobee.robot.motor_units`): a `limit_width` of 10 degrees is 5 % of the range, a force of 12 rad/s^2 is 3.4
    ranges/s^2. Gains can be stored as JSON: write `dataclasses.asdict(gains)`, and make `Gains(**read)` from what was read.

    A clause is a constraint on several joints: a.q + b > 0 must hold for at least one of its rows (`mobee.robot.robot.Clause`). The lever
    of a contact is the change of its depth if the motors move by 1 rad. A client is the program that uses the controller; its forces are
    those given to `Controller.force` and `Controller.push`.

    Attributes:
        law: the variant of the law, which decides how constraints and contacts become forces (see `mobee.reference.forces`).
        damping: C in 1/s; the damping force is -C dq/dt.
        stiffness: K in 1/s^2, of the spring that pulls each motor to the attractor (its goal position).
        max_spring, max_contact, max_client: largest size of the force of the spring, of contacts and of a client, rad/s^2.
        max_limit, max_constraint: force at a limit, or at the boundary of a clause, rad/s^2; the force increases further beyond it. In the
            published law `max_constraint` is the largest force.
        limit_width: width of the zone before each limit, rad.
        constraint_width: width of the zone before the boundary of a clause, in rad along the normal a / |a| of the row; in the published
            law in units of a.q + b.
        contact_gain: default law: the force is contact_gain * depth * lever, in rad/s^2, before it is bounded. Published law: this product
            is squared, and the square is the force in deg/s^2.
        contact_slope, client_slope: slope at 0 of the function that bounds the force (k of eq. 5.8).
        client_squash: "each" bounds a client's force motor by motor (eq. 5.8 as printed), "direction" bounds its norm in each part.
        settle: thresholds of the settle test, which decides when an action ends.
        weights: pairs (pattern of motor names, 0 or 1). A motor of weight 0 is never moved. The first pattern that matches a motor counts;
            a motor without a match has weight 1.
        motors: pairs (pattern of motor names, gains of the motors that match it), as `with_motors` adds them.
        groups: pairs as in `motors`, with lower priority; here a pattern that matches no motor of a robot is ignored.
    """

    law: Law
    damping: float
    stiffness: float
    max_spring: float
    limit_width: float
    max_limit: float
    constraint_width: float
    max_constraint: float
    contact_gain: float
    contact_slope: float
    max_contact: float
    client_slope: float
    max_client: float
    settle: Settle
    client_squash: ClientSquash = "each"
    weights: tuple[tuple[str, float], ...] = ()
    motors: tuple[tuple[str, Changes], ...] = ()
    groups: tuple[tuple[str, Changes], ...] = ()

    def __post_init__(self) -> None:
        for name in self.__slots__:
            value = getattr(self, name)
            if isinstance(value, list):  # read from JSON
                object.__setattr__(self, name, _tuples(value))
            if name not in _NO_NUMBERS and value != self.__dataclass_fields__[name].default:  # a default of 0: no such force
                _require_positive(name, value)
        if self.law not in get_args(Law):
            raise UnknownName("law", self.law, get_args(Law))
        if isinstance(self.settle, dict):
            object.__setattr__(self, "settle", Settle(**self.settle))
        if self.client_squash not in ("each", "direction"):
            raise UnknownName("client_squash", self.client_squash, ("each", "direction"))
        for pattern, changes in (*self.motors, *self.groups):
            for name, value in changes:
                if name not in _OF_MOTORS:
                    raise UnknownName("gain of single motors", name, _OF_MOTORS)
                if name != "weight":
                    _require_positive(f"{name} of the motors {pattern!r}", value)
        for pattern, weight in (*self.weights, *self._changed("weight")):
            if weight not in (0, 1):
                raise InvalidValue(f"weight {weight} of the motors {pattern!r}: must be 0 (never moved) or 1")

    @classmethod
    def default(cls) -> Gains:
        """Return the default gains: the equations of the thesis with our own tuning.

        A field is a shape around the solids of a link; two fields that overlap repel each other. With these gains fields can be pressed
        into each other, but their forces stop the links before the solids touch.

        The time constant C/K is 0.32 s. The experiment `gain-tuning` chose the numbers, with simulated motors that have lag and delay, and
        commands up to three ticks old at 100 Hz. With a stiffer contact the robot begins to oscillate; with stronger springs, which pull
        the motors to the attractor (their goal positions), its links pass through the fields. The springs of torso and shoulders are
        weaker, because the forces of the springs of many motors add up at a hand. The contact force on a part is bounded by its norm, 35
        rad/s^2. This is more than the norm of the largest spring forces of the seven motors of an arm without its hand, 28 rad/s^2. So the
        force can rise steeply with the depth of a contact, but cannot grow without limit.
        """
        return cls(
            law="default",
            damping=40.0,
            stiffness=125.0,
            max_spring=12.0,
            limit_width=LIMIT_WIDTH,
            max_limit=40.0,
            constraint_width=np.deg2rad(12.0),
            max_constraint=80.0,
            contact_gain=1800.0,
            contact_slope=1.0,
            max_contact=35.0,
            client_slope=1.0,
            max_client=12.0,
            settle=Settle(speed=np.deg2rad(3.0), acceleration=np.deg2rad(300.0)),
            groups=(("torso_*", (("max_spring", 8.0),)), ("?_shoulder_*", (("max_spring", 8.0),))),
        )

    @classmethod
    def published_2014(cls) -> Gains:
        """Return the gains of the original program of 2014, converted from degrees. They are needed to reproduce the published findings.

        With these gains the fingers and eyes do not move, because their weight is 0. Obstacles come several centimetres deep into the
        fields, the shapes around the links that cause repulsive forces.
        """
        return cls(
            law="published_2014",
            damping=50.0,
            stiffness=50.0,
            max_spring=np.deg2rad(1000.0),
            limit_width=LIMIT_WIDTH,
            max_limit=np.deg2rad(1000.0),
            constraint_width=np.deg2rad(40.0),
            max_constraint=np.deg2rad(1500.0),
            contact_gain=1000.0,
            contact_slope=50.0,
            max_contact=np.deg2rad(1200.0),
            client_slope=50.0,
            max_client=np.deg2rad(1000.0),
            client_squash="direction",
            settle=Settle(speed=np.deg2rad(1.0), acceleration=np.deg2rad(50.0)),
            weights=tuple((p, 0.0) for p in ("eyes_*", "?_hand_*", "?_thumb_*", "?_index_*", "?_middle_*", "?_pinky")),
        )

    @classmethod
    def derived(cls) -> Gains:
        """Return the default gains with a larger bound of the contact force (50 rad/s^2), for robots whose fields `mobee.derive` computed.

        A field is a shape around a link; its contacts cause repulsive forces. The lever of a contact is the change of its depth if the
        motors move by 1 rad. For such robots the force is divided by the squared lever, so that contacts have the same stiffness for all
        levers well above `Robot.least_lever`: contact_gain * LEVER^2 = 450 1/s^2 (LEVER: 0.5 m). The bound of the default gains is tuned
        for the wide fields of the iCub. With that bound, strong springs, which pull the motors to their goals, would press the fields of
        two links of these other robots into each other.
        """
        return replace(cls.default(), max_contact=50.0)

    @classmethod
    def named(cls, name: str) -> Gains:
        """Return the set of gains with the name "default", "derived" or "published_2014"; raises UnknownName for another name.

        "derived" is for robots whose fields `mobee.derive` computed; "published_2014" are the gains of the original program.
        """
        sets = {"default": cls.default, "derived": cls.derived, "published_2014": cls.published_2014}
        if name not in sets:
            raise UnknownName("gain set", name, sets)
        return sets[name]()

    def with_motors(self, pattern: str, **gains: float) -> Gains:
        """Return gains with other values for the motors that match a pattern, for example `gains.with_motors("*_elbow", stiffness=50.0)`.

        If several calls match a motor, the last call counts. Values are in the unit of the motor: for a motor that slides, `limit_width` is
        in m and each `max_` in m/s^2. (Such gains that are not changed here are converted from rad to m by the range of the motor.) These
        gains can be set for single motors: damping, stiffness, max_spring, limit_width, max_limit, client_slope, max_client and weight.
        Clauses (constraints on several joints) and contacts involve several motors and have one set of gains.
        """
        return replace(self, motors=((pattern, tuple(sorted(gains.items()))), *self.motors))

    def of_motors(self, name: str, motors: tuple[str, ...]) -> Array:
        """Return the gain `name` of each motor, (n,), without conversion of units.

        For a motor that slides, a gain in units of rad is not converted to m here; `of_robot` does this. `motors`: the names of the motors.
        Raises UnknownName if a pattern that was given to `with_motors` matches none of them.
        """
        for pattern, _ in self.motors:
            if not any(fnmatchcase(m, pattern) for m in motors):
                raise UnknownName("motor pattern", pattern, motors)
        common: float = getattr(self, name)
        return _first_match(self._changed(name), motors, common)

    def of_robot(self, name: str, robot: Robot) -> Array:
        """Return the gain `name` of each motor of a robot, (n,), in units of rad, or converted to units of m for a motor that slides.

        Raises UnknownName if a pattern that was given to `with_motors` matches no motor of the robot.
        """
        values = self.of_motors(name, robot.motors)
        if name not in _ANGLES:
            return values
        own = [pattern for pattern, changes in self.motors if name in dict(changes)]  # given in the unit of the motor
        return values * np.where([any(fnmatchcase(m, p) for p in own) for m in robot.motors], 1.0, motor_units(robot))

    def weight(self, motors: tuple[str, ...]) -> Array:
        """Return the weight of each motor, (n,): 1, or 0 for a motor that is never moved. `motors`: the names of the motors."""
        return _first_match((*self._changed("weight"), *self.weights), motors, 1.0)

    def _changed(self, name: str) -> Changes:
        """Return pairs (pattern of motor names, value) from `motors` and `groups` that change the gain `name`, highest priority first."""
        chosen = (*self.motors, *self.groups)
        return tuple((pattern, value) for pattern, changes in chosen for changed, value in changes if changed == name)


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list | tuple) else value


def _first_match(values: Changes, motors: tuple[str, ...], common: float) -> Array:
    return np.array([next((value for pattern, value in values if fnmatchcase(m, pattern)), common) for m in motors])


def _require_positive(name: str, value: float) -> None:
    if not (isinstance(value, Real) and value > 0 and np.isfinite(value)):
        raise InvalidValue(f"gain {name} {value!r}: must be a finite number above 0")


class SettleTest:
    """The settle test of one action: decides at intervals, from the commanded motion, whether the part has settled (thesis 6.1)."""

    def __init__(self, settle: Settle, start: float) -> None:
        """Begin the test of an action that starts at time `start` [s]."""
        self.settle = settle
        self._thresholds = core.Settle(*(getattr(settle, name) for name in core.SETTLE))
        self._memory = core.SettleTest(start, start + settle.first_check)
        self._check = core.calls().settle_check

    def update(self, t: float, speeds: Array, accelerations: Array) -> Verdict:
        """Return "settled" if a check is due at time t [s] and the part is slow, "timeout" if the time is over, else "moving".

        `speeds` (n_part,) rad/s and `accelerations` (n_part,) rad/s^2: commanded motion of the part's motors. For a motor that slides,
        convert both from m to rad: divide speed and acceleration by the motor's entry of `mobee.robot.motor_units.fine_units`. The part is
        slow if no value exceeds its threshold in `Settle`.
        """
        motion = np.array([speeds, accelerations], dtype=np.float64)
        verdict: int = self._check(ctypes.byref(self._thresholds), ctypes.byref(self._memory), t, motion.tobytes(), motion.shape[1])
        return VERDICTS[verdict]
