# SPDX-License-Identifier: Apache-2.0
"""User-defined forces in the control law (thesis eq. 5.7), as Python functions."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mobee._core.law import term_names
from mobee.arrays import Array
from mobee.control.forces import Forces, checked_force
from mobee.errors import InvalidValue
from mobee.robot.robot import Robot

if TYPE_CHECKING:
    from mobee.model.pose import Pose

_NAME = re.compile("[a-z][a-z0-9_]{0,63}")


class State:
    """The input of the function of a user-defined force in one tick; arrays are read-only.

    `q`: (n,) rad, measured positions. `velocity`: (n,) rad/s, the velocity that the control law has computed; it is not measured. `dt`: s,
    duration of the tick. `robot`: the robot. `pose`: the robot at q in its world. `evaluate`: a function that returns this pose; it is
    called when `pose` is read for the first time.
    """

    __slots__ = ("_evaluate", "_pose", "dt", "q", "robot", "velocity")

    def __init__(self, robot: Robot, q: Array, velocity: Array, dt: float, evaluate: Callable[[], Pose]) -> None:
        self.robot, self.q, self.velocity, self.dt = robot, _kept(q), _kept(velocity), dt
        self._evaluate = evaluate
        self._pose: Pose | None = None

    @property
    def pose(self) -> Pose:
        """The robot at q in the present world, with its contacts. It is computed when this property is read for the first time."""
        if self._pose is None:
            self._pose = self._evaluate()
        return self._pose


@dataclass(frozen=True, slots=True)
class Term:
    """A user-defined force, added on the right-hand side of thesis eq. 5.7.

    `name`: of a-z, 0-9 and _, a letter first, different from the names of the control law's forces. `function`: takes a `State` and returns
    the force on the motors, (n,) rad/s^2, or m/s^2 for a motor of a prismatic joint. It is called in every tick (control cycle).
    """

    name: str
    function: Callable[[State], Array]

    def __post_init__(self) -> None:
        if not (isinstance(self.name, str) and _NAME.fullmatch(self.name)):
            raise InvalidValue(f"name of a term {self.name!r}: must be at most 64 of a-z, 0-9 and _, a letter first")
        if not callable(self.function):
            raise InvalidValue(f"term {self.name!r}: its function is {self.function!r}; it must be a function of the state.")

    def force(self, state: State) -> Array:
        """Call the function and return the force, (n,) rad/s^2, or m/s^2 for a motor of a prismatic joint.

        Raises InvalidValue, with the name of the term, if the function fails or its result is not valid.
        """
        try:
            given = self.function(state)
        except Exception as error:  # code of the user, which may raise anything
            raise InvalidValue(f"term {self.name!r}: its function raised {type(error).__name__}: {error}") from error
        return checked_force(f"term {self.name!r}", given, len(state.q))


def _kept(array: Array) -> Array:
    """Return a read-only view."""
    seen = array.view()
    seen.flags.writeable = False
    return seen


def valid_terms(given: Sequence[Term]) -> tuple[Term, ...]:
    """Return the given terms as a tuple.

    Raises InvalidValue if two names are equal, or if one is a name of the control law's forces or of an attribute of `Forces`.
    """
    terms, taken = tuple(given), set(term_names())
    for term in terms:
        if not isinstance(term, Term):
            raise InvalidValue(f"terms has {term!r}; each must be a Term, as Term(name, function).")
        if term.name in taken or hasattr(Forces, term.name):
            raise InvalidValue(f"term {term.name!r}: the name is taken; taken are {', '.join(sorted(taken))} and the members of Forces")
        taken.add(term.name)
    return terms
