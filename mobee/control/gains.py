# SPDX-License-Identifier: Apache-2.0
"""The gains of the control law, in two named sets, and the test that ends an action (thesis 6.1)."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from numbers import Real
from typing import Any, Literal, get_args

import numpy as np

from mobee._core import law as core
from mobee.arrays import Array
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
"""The verdicts, in the order of the core."""


@dataclass(frozen=True, slots=True)
class Settle:
    """The thresholds of the settle test. They are part of the physics: they decide which states are hard to reach.

    A part has settled when no motor is commanded beyond `speed` and `acceleration`. For a motor that slides both are in its fine unit
    (`mobee.robot.motor_units`): 3 deg/s are 0.4 % of its range per second.
    """

    speed: float  # rad/s
    acceleration: float  # rad/s^2
    first_check: float = 1.0  # s from the start of the action to the first check
    interval: float = 0.2  # s between checks
    timeout: float = 20.0  # s

    def __post_init__(self) -> None:
        for name in ("speed", "acceleration", "interval", "timeout"):
            if not 0 < getattr(self, name) < np.inf:
                raise InvalidValue(f"settle {name} {getattr(self, name)}: must be finite and above 0")
        if not 0 <= self.first_check < np.inf:
            raise InvalidValue(f"settle first_check {self.first_check} s: must be a finite time, not negative")


@dataclass(frozen=True, slots=True, kw_only=True)
class Gains:
    """The numbers of the law of thesis eq. 5.7, and its variant. The mass is 1, so a force is an acceleration in rad/s^2.

    All numbers are for motors that turn. For a motor that slides, 1 rad is a share of its range (`mobee.robot.motor_units`), so that
    the law is the same in that unit: `limit_width` of 10 degrees is 5 % of its range, a `max_` of 12 rad/s^2 is 3.4 ranges/s^2.
    `dataclasses.asdict` of a set of gains goes through JSON and back by `Gains(**read)`.

    Attributes:
        law: the variant: how constraints and contacts become forces (see `mobee.reference.forces`).
        damping: C in 1/s.
        stiffness: K in 1/s^2.
        max_spring, max_limit, max_constraint, max_contact, max_client: bounds of the forces, rad/s^2.
        limit_width: width of the zone before each limit, rad.
        constraint_width: width of the zone of a clause, rad along the row's normal; published law: in units of a.q + b.
        contact_gain: default law: rad/s^2 for a lever and a depth of 1 m; published law: deg/s^2 before it is squared.
        contact_slope, client_slope: slope of the squash at 0.
        client_squash: "each" bounds a client's force motor by motor (eq. 5.8 as printed), "direction" bounds its norm in each part.
        settle: thresholds of the settle test.
        weights: (pattern of motor names, 0 or 1); the first match counts, 1 without a match. A motor of weight 0 is never moved.
        motors: (pattern, gains of these motors), see `with_motors`.
        groups: the same, applied after `motors`; patterns that match no motor of a robot are ignored.
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
        """Return the thesis' equations with our own tuning: time constant C/K = 0.32 s, contacts that stay within the fields.

        Tuned by the experiment `gain-tuning`, with the lag and delay of the motors and commands up to three ticks old at 100 Hz. With a
        stiffer contact the robot begins to oscillate; with stronger springs it passes through the fields. The springs of torso and
        shoulders are weaker, because many motors push a hand together. The bound of the contact force is a little above the springs
        of an arm together, so that the force is stiff where a field begins.
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
        """Return the gains of the 2014 program, converted from its degrees; with them the published findings appear.

        Fingers and eyes do not move. Contacts are centimetres deep in the fields of the robot model.
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
        """Return the default gains for robots whose fields were derived, see `mobee.derive`: contact forces have a larger bound.

        Such robots have a least lever, so contacts of all levers have the stiffness contact_gain * LEVER^2 = 450 1/s^2. With the bound of
        the default gains, tuned for the wide fields of the iCub, limbs with strong springs press their fields together.
        """
        return replace(cls.default(), max_contact=50.0)

    @classmethod
    def named(cls, name: str) -> Gains:
        """Return the gains named "default", "derived" or "published_2014"; raises UnknownName."""
        sets = {"default": cls.default, "derived": cls.derived, "published_2014": cls.published_2014}
        if name not in sets:
            raise UnknownName("gain set", name, sets)
        return sets[name]()

    def with_motors(self, pattern: str, **gains: float) -> Gains:
        """Return gains with other values for the motors that match a pattern, for example `gains.with_motors("*_elbow", stiffness=50.0)`.

        The last setting has priority. Values are in the unit of the motor: for one that slides, limit_width in m and each `max_` in
        m/s^2; its other gains still follow its range. Motors can have their own damping, stiffness, max_spring, limit_width, max_limit,
        client_slope, max_client and weight. Clauses and contacts involve several motors and have one set of gains.
        """
        return replace(self, motors=((pattern, tuple(sorted(gains.items()))), *self.motors))

    def of_motors(self, name: str, motors: tuple[str, ...]) -> Array:
        """Return the gain `name` of each motor, (n,), as it was set, without a conversion for motors that slide.

        `motors`: the names of the motors.  Raises UnknownName if a pattern that was given to `with_motors` matches none of them.
        """
        for pattern, _ in self.motors:
            if not any(fnmatchcase(m, pattern) for m in motors):
                raise UnknownName("motor pattern", pattern, motors)
        common: float = getattr(self, name)
        return _first_match(self._changed(name), motors, common)

    def of_robot(self, name: str, robot: Robot) -> Array:
        """Return the gain `name` of each motor of a robot, (n,), in units of rad, or m for a motor that slides; raises UnknownName."""
        values = self.of_motors(name, robot.motors)
        if name not in _ANGLES:
            return values
        own = [pattern for pattern, changes in self.motors if name in dict(changes)]  # given in the unit of the motor
        return values * np.where([any(fnmatchcase(m, p) for p in own) for m in robot.motors], 1.0, motor_units(robot))

    def weight(self, motors: tuple[str, ...]) -> Array:
        """Return the weight of each motor, (n,)."""
        return _first_match((*self._changed("weight"), *self.weights), motors, 1.0)

    def _changed(self, name: str) -> Changes:
        """Return the patterns that change a gain, each with the value."""
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
    """The settle test of one action: checks the commanded motion at intervals, as the original did."""

    def __init__(self, settle: Settle, start: float) -> None:
        """`start`: when the action begins [s]."""
        self.settle = settle
        self._thresholds = core.Settle(*(getattr(settle, name) for name in core.SETTLE))
        self._memory = core.SettleTest(start, start + settle.first_check)
        self._check = core.calls().settle_check

    def update(self, t: float, speeds: Array, accelerations: Array) -> Verdict:
        """Return the verdict on the part's motion at time t [s]; always "moving" between two checks.

        `speeds` rad/s and `accelerations` rad/s^2: the commands to the part's motors, (n_part,); those of motors that slide are
        divided by their `fine_units`.
        """
        motion = np.array([speeds, accelerations], dtype=np.float64)
        verdict: int = self._check(ctypes.byref(self._thresholds), ctypes.byref(self._memory), t, motion.tobytes(), motion.shape[1])
        return VERDICTS[verdict]
