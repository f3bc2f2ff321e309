# SPDX-License-Identifier: Apache-2.0
"""The forces of the control law by name: constraint forces, user-defined forces as Python functions, and checks of their values.

The sum of the forces is on the right-hand side of thesis eq. 5.7.
"""

from __future__ import annotations

import math
import re
import reprlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, reduce
from typing import TYPE_CHECKING, Literal

import numpy as np

from mobee._core import Table
from mobee._core.law import state_term_names, term_names
from mobee.arrays import Array, real_array
from mobee.control.gains import Gains
from mobee.control.law import Law
from mobee.errors import InvalidValue, UnknownName
from mobee.robot.robot import Robot

if TYPE_CHECKING:
    from mobee.model.pose import Pose

# "tree": a contact acts on all motors down to the base, so that a hand on the table also stops the torso; "part": on its part only.
Propagate = Literal["tree", "part"]
_FLOAT = np.dtype(np.float64)
LARGEST_FORCE = 1e9  # rad/s^2, or N/kg at a marker: far above what any squash lets through, far below an overflow in it
_NAME = re.compile("[a-z][a-z0-9_]{0,63}")


class Forces(Mapping[str, Array]):
    """The constraint forces by name, each (n,) in rad/s^2 (force per unit mass), already bounded.

    First are the forces of the control law, in the order in which they are added: `limits`, `constraints` and `collision`, which are f_lim,
    f_cst and f_coll of thesis eq. 5.7. Then come the forces of user-defined terms. A force can also be read as an attribute:
    `forces.limits`. The forces `limits`, `constraints` and `collision` depend only on the pose. The control law has more forces if they
    were added to the compiled core. Those that depend on the state of the law, such as its velocity, need not be given to the constructor.
    """

    __slots__ = ("_rows",)
    __eq__, __hash__ = object.__eq__, object.__hash__  # arrays are not compared

    def __init__(self, *rows: Array, **more: Array) -> None:
        """Store forces of the control law in their order (`rows`) or by name (`more`), and those of user-defined terms by name (`more`).

        Raises InvalidValue if a force that depends on the pose only is missing, or if one is given twice.
        """
        if not more and len(rows) == len(term_names()):
            self._rows = dict(zip(term_names(), rows, strict=True))
            return
        given = {**dict(zip(term_names(), rows, strict=False)), **more}
        if len(rows) > len(term_names()) or len(given) < len(rows) + len(more):
            raise InvalidValue(
                f"forces: {len(rows)} without a name, {', '.join(more) or 'none'} by name; the law has {', '.join(term_names())}"
            )
        if lacking := [name for name in published_terms() if name not in given]:
            raise InvalidValue(f"forces: {', '.join(lacking)} missing; give all of {', '.join(published_terms())}")
        self._rows = {name: given.pop(name) for name in term_names() if name in given} | given

    def __getitem__(self, name: str) -> Array:
        return self._rows[name]

    def __contains__(self, name: object) -> bool:
        return name in self._rows

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows)

    def __len__(self) -> int:
        return len(self._rows)

    def __getattr__(self, name: str) -> Array:
        if name.startswith("_") or name not in self:
            raise AttributeError(f"there is no force {name!r}")
        return self._rows[name]

    def __repr__(self) -> str:
        return f"Forces({', '.join(f'{name}={force!r}' for name, force in self.items())})"

    @property
    def total(self) -> Array:
        """The sum of all forces, (n,) rad/s^2."""
        return reduce(np.add, self._rows.values())


def published_terms() -> tuple[str, ...]:
    """Return the names of the control law's forces that depend on the pose only.

    In the live system the model service (the process that computes contacts) computes these forces and sends them to the controller
    service (the process that computes motor commands). The controller service computes all other forces.
    """
    return tuple(name for name in term_names() if name not in state_term_names())


def needs_contacts() -> bool:
    """Return whether some forces of the control law depend on the law's state, such as its velocity, and not on the pose only.

    If so, the controller service of the live system (the process that computes motor commands) computes these forces. It needs all contacts
    for this, so the model service (the process that computes contacts) publishes them too.
    """
    return bool(state_term_names())


def constraint_forces(pose: Pose, gains: Gains, propagate: Propagate = "tree", contact_forces: bool = True) -> Forces:
    """Return the constraint forces at one pose (thesis eqs. 5.11 to 5.17); raises InvalidValue for a batch of poses.

    `propagate`: the motors on which a contact of a link acts: "tree": all motors from the link down to the base; "part": only those of the
    part that the link belongs to. `contact_forces` False: f_coll is 0, for experiments in which contacts have no effect.
    """
    return forces_of(_law(pose.robot, gains, contact_forces), pose, propagate)


def forces_of(law: Law, pose: Pose, propagate: Propagate, state: Table | None = None) -> Forces:
    """Return the constraint forces of a law at one pose.

    `propagate`: the motors on which a contact of a link acts: "tree": all motors from the link down to the base; "part": only those of the
    part that the link belongs to. `state`: the state of the law, with the columns of `mobee._core.law.STATE`; None: at rest. Raises
    InvalidValue for a batch of poses, and UnknownName for another value of `propagate`.
    """
    if pose.q.ndim != 1:
        raise InvalidValue(f"a batch of poses, of shape {pose.q.shape}: forces belong to one pose")
    if propagate not in ("tree", "part"):
        raise UnknownName("propagation", propagate, ("tree", "part"))
    torque = pose.projection if propagate == "tree" else pose.projection_of_part
    return Forces(*law.forces(pose.q, torque, state))


@lru_cache(maxsize=8)
def _law(robot: Robot, gains: Gains, contact_forces: bool) -> Law:
    return Law(robot, gains, contact_forces=contact_forces)


def checked(what: str, value: Array, length: int) -> Array:
    """Return a copy of `value` as an array (length,) of finite numbers; raises InvalidValue, with the name `what`, if it is not valid."""
    # The first test is for the usual case: the general checks below take several times as long.
    if type(value) is np.ndarray and value.dtype is _FLOAT and value.shape == (length,) and all(map(math.isfinite, value.tolist())):
        return value.copy()
    array = real_array(what, value)
    if array.shape != (length,):
        raise InvalidValue(f"{what} of shape {array.shape}: must be {length} finite numbers")
    if not np.isfinite(array).all():
        worst = int(np.argmax(np.nan_to_num(np.abs(array), nan=np.inf)))
        raise InvalidValue(f"{what}: number {worst} is {array[worst]}; must be {length} finite numbers")
    return array


def checked_force(what: str, value: Array, length: int) -> Array:
    """Return a copy of `value` as an array (length,) of finite numbers of at most LARGEST_FORCE (1e9) in size.

    Raises InvalidValue, with the name `what`, if it is not valid.
    """
    array = checked(what, value, length)
    if np.abs(array).max(initial=0.0) > LARGEST_FORCE:
        raise InvalidValue(f"{what}: {array[np.abs(array).argmax()]:.3g}; must be at most {LARGEST_FORCE:g} in size")
    return array


def require_forces(given: Forces, length: int) -> None:
    """Raise InvalidValue, with the name of the force, unless all given forces are arrays (length,) of finite numbers.

    NumPy would spread a single number over all motors when forces are added.
    """
    rows = getattr(given, "_rows", None)
    if rows is None:
        raise InvalidValue(f"forces is {' '.join(reprlib.repr(given).split())}; it must be Forces, as controller.forces(pose), or None.")
    shape = (length,)
    for name, force in rows.items():
        if type(force) is not np.ndarray or force.shape != shape:
            checked(f"force {name!r}", force, length)


def require_pose_of(robot: Robot, pose: object) -> None:
    """Raise InvalidValue unless the pose is one of this robot, or of a robot with the same motors."""
    other = getattr(pose, "robot", None)
    if getattr(other, "motors", None) != robot.motors:
        what = repr(pose) if other is None else f"of {other.name!r}"
        raise InvalidValue(f"pose {what}: must be a pose of {robot.name!r}, as model.evaluate(q).")


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
