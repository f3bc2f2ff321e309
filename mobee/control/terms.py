"""User-defined forces of eq. 5.7, as Python functions."""

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
    """What a force may depend on: `q` (n,) rad measured, `velocity` (n,) rad/s, the law's own, the tick `dt` s, `robot` and `pose`."""

    __slots__ = ("_evaluate", "_pose", "dt", "q", "robot", "velocity")

    def __init__(self, robot: Robot, q: Array, velocity: Array, dt: float, evaluate: Callable[[], Pose]) -> None:
        self.robot, self.q, self.velocity, self.dt = robot, _kept(q), _kept(velocity), dt
        self._evaluate = evaluate
        self._pose: Pose | None = None

    @property
    def pose(self) -> Pose:
        """The robot at q in the world of now, with its contacts; evaluated when it is first asked for."""
        if self._pose is None:
            self._pose = self._evaluate()
        return self._pose


@dataclass(frozen=True, slots=True)
class Term:
    """A force of one's own on the right-hand side of eq. 5.7.

    `name`: of a-z, 0-9 and _, and none that the law has.  `function`: gives the force on the motors (n,), rad/s^2, or m/s^2 of one
    that slides.  It is called in every tick.
    """

    name: str
    function: Callable[[State], Array]

    def __post_init__(self) -> None:
        if not (isinstance(self.name, str) and _NAME.fullmatch(self.name)):
            raise InvalidValue(f"name of a term {self.name!r}: must be at most 64 of a-z, 0-9 and _, a letter first")
        if not callable(self.function):
            raise InvalidValue(f"term {self.name!r}: its function is {self.function!r}; it must be a function of the state.")

    def force(self, state: State) -> Array:
        """What the function gives, checked; raises InvalidValue, which names the term."""
        try:
            given = self.function(state)
        except Exception as error:
            raise InvalidValue(f"term {self.name!r}: its function raised {type(error).__name__}: {error}") from error
        return checked_force(f"term {self.name!r}", given, len(state.q))


def _kept(array: Array) -> Array:
    """The same numbers, which nobody can change by this array."""
    seen = array.view()
    seen.flags.writeable = False
    return seen


def valid_terms(given: Sequence[Term]) -> tuple[Term, ...]:
    """Terms that can stand beside those of the law and each other; raises InvalidValue."""
    terms, taken = tuple(given), set(term_names())
    for term in terms:
        if not isinstance(term, Term):
            raise InvalidValue(f"terms has {term!r}; each must be a Term, as Term(name, function).")
        if term.name in taken or hasattr(Forces, term.name):
            raise InvalidValue(f"term {term.name!r}: there is one of that name; taken are {', '.join(sorted(taken))} and what Forces has")
        taken.add(term.name)
    return terms
