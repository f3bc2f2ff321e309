# SPDX-License-Identifier: Apache-2.0
"""Terms of the cost of a pose: the terms of thesis table 3.1, further terms, and user functions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, real_array
from mobee.errors import InvalidValue
from mobee.model.contact import ContactTable
from mobee.model.masses import centre_of_mass, centre_of_mass_at_home
from mobee.model.pose import Pose
from mobee.roadmap.ik.terms import (
    ALONG,
    FACING,
    HOLD,
    METRES,
    PER_METRE,
    PER_RAD,
    PLACE,
    RADIANS,
    TURNED,
    UPRIGHT,
    Aim,
    Function,
    Term,
    below,
    checked_term,
    direction_frame,
    level,
)
from mobee.robot.robot import Robot


def vector(name: str, given: ArrayLike) -> Array:
    """Return a copy of the vector `given` (3,); raise InvalidValue, with `name` in its text, unless `given` has three finite numbers."""
    found = real_array(name, given)
    if found.shape != (3,) or not np.isfinite(found).all():
        raise InvalidValue(f"{name} is {given!r}; it must be (3,) finite numbers.")
    return found


def unit_vector(name: str, given: ArrayLike) -> Array:
    """Return the unit vector (3,) along the vector `given`; raise InvalidValue, with `name` in its text, if it is 0 or not finite."""
    found = vector(name, given)
    if not np.linalg.norm(found) > 0.0:
        raise InvalidValue(f"{name} is {given!r}; it must be a direction (3,), or a rotation (3, 3).")
    return units(found)


def lengths(vectors: Array) -> Array:
    """Return the lengths (...,) of vectors (..., d)."""
    found: Array = np.sqrt((vectors**2).sum(axis=-1))
    return found


def finite(name: str, given: float) -> float:
    """Return the number `given`; raise InvalidValue, with `name` in its text, if it is not one finite number."""
    number = real_array(name, given)
    if number.size != 1 or not np.isfinite(number).all():
        raise InvalidValue(f"{name} is {given!r}; it must be a finite number.")
    return given


def units(vectors: Array) -> Array:
    """Return vectors (..., d) scaled to length 1; zero vectors stay zero."""
    found: Array = vectors / np.maximum(lengths(vectors)[..., None], 1e-12)
    return found


def angle_between(one: Array, other: Array) -> Array:
    """Return the angles (...,) rad between the unit vectors `one` and `other`, (..., 3) each; exact also near 0 and near pi."""
    angle: Array = 2.0 * np.arctan2(lengths(one - other), lengths(one + other))
    return angle


def rotation(name: str, given: ArrayLike) -> Array:
    """Return a copy of the matrix `given` (3, 3); raise InvalidValue, with `name` in its text, if it is not a rotation."""
    found = real_array(name, given)
    if found.shape != (3, 3) or not np.allclose(found @ found.T, np.eye(3), atol=1e-6) or np.linalg.det(found) < 0.0:
        raise InvalidValue(f"{name} is no rotation: its rows must be a right-handed set of three unit vectors.")
    return found


def turn_between(one: Array, other: Array) -> Array:
    """Return the angles (...,) rad of the rotations that turn the frames `one` (..., 3, 3) into the frames `other` (..., 3, 3)."""
    apart = np.sqrt(((one - other) ** 2).sum(axis=(-2, -1)) / 8.0)  # sin(angle / 2)
    angle: Array = 2.0 * np.arcsin(np.minimum(apart, 1.0))
    return angle


PER_DEPTH = 20.0
_NONE = np.zeros(3)


def position(marker: str, place: ArrayLike, tolerance: float = METRES, weight: float = PER_METRE, offset: ArrayLike | None = None) -> Term:
    """Return the term that brings a marker to a place (3,) m, root frame (thesis table 3.1). The residual is the distance [m].

    `offset`: (3,) m in the marker's frame; the point there, instead of the marker itself, is brought to the place. A residual of at most
    `tolerance` (5 mm) meets the term; the cost is `weight` (20 per m) times the residual.
    """
    goal = vector("place", place)
    aside = None if offset is None else vector("offset", offset)

    def residual(pose: Pose) -> Array:
        return lengths(pose.position(marker) - goal if aside is None else pose.position(marker) + pose.rotation(marker) @ aside - goal)

    def aims(robot: Robot) -> tuple[Aim, ...]:
        m = robot.marker(marker)
        point = m.position if aside is None else m.position + m.rotation @ aside
        return (Aim(PLACE, m.link, point, UPRIGHT, 0, goal, UPRIGHT),)

    return checked_term(f"position {marker}", residual, weight, tolerance, aims)


def orientation(
    marker: str, goal: ArrayLike, tolerance: float = RADIANS, weight: float = PER_RAD, direction: ArrayLike | None = None
) -> Term:
    """Return the term for the orientation of a marker (thesis table 3.1). The residual is the remaining angle [rad].

    `goal`: a direction (3,), root frame, to which the marker's normal is turned; or a rotation (3, 3) of the marker, root frame.
    `direction`: (3,) in the marker's frame, is used instead of the normal. The residual that the thesis prints, u.u* + 1, is not used: it
    is smallest for opposite directions, and its slope is 0 at both ends. A residual of at most `tolerance` (5 degrees) meets the term; the
    cost is `weight` (2 per rad) times the residual.
    """
    wanted = real_array("goal", goal)
    if wanted.shape == (3, 3):
        return _rotation(marker, wanted, tolerance, weight)
    there = unit_vector("goal", wanted)
    own = None if direction is None else unit_vector("direction", direction)

    def residual(pose: Pose) -> Array:
        return angle_between(pose.normal(marker) if own is None else pose.rotation(marker) @ own, there)

    def aims(robot: Robot) -> tuple[Aim, ...]:
        m = robot.marker(marker)
        here = m.normal if own is None else m.rotation @ own
        return (Aim(ALONG, m.link, m.position, direction_frame(here), 0, _NONE, direction_frame(there)),)

    return checked_term(f"orientation {marker}", residual, weight, tolerance, aims)


def hold(first: str, second: str, distance: float, tolerance: float = METRES, weight: float = PER_METRE) -> Term:
    """Return the term that keeps two markers at a `distance` [m] from each other (thesis table 3.1).

    The residual is the absolute error of the distance [m]. A residual of at most `tolerance` (5 mm) meets the term; the cost is `weight`
    (20 per m) times the residual. `first`, `second`: names of the markers.
    """
    finite("distance", distance)

    def residual(pose: Pose) -> Array:
        found: Array = np.abs(lengths(pose.position(first) - pose.position(second)) - distance)
        return found

    def aims(robot: Robot) -> tuple[Aim, ...]:
        a, b = robot.marker(first), robot.marker(second)
        return (Aim(HOLD, a.link, a.position, UPRIGHT, b.link, b.position, UPRIGHT, distance),)

    return checked_term(f"hold {first} {second}", residual, weight, tolerance, aims)


def palm_to_palm(first: str = "left_palm", second: str = "right_palm", tolerance: float = RADIANS, weight: float = PER_RAD) -> Term:
    """Return the term that points the normal of each of two markers at the other marker; its residual is the larger angle [rad].

    A residual of at most `tolerance` (5 degrees) meets the term; the cost is `weight` (2 per rad) times the residual. `first`, `second`:
    names of the markers.
    """

    def residual(pose: Pose) -> Array:
        between = units(pose.position(second) - pose.position(first))
        found: Array = np.maximum(angle_between(pose.normal(first), between), angle_between(pose.normal(second), -between))
        return found

    def aims(robot: Robot) -> tuple[Aim, ...]:
        a, b = robot.marker(first), robot.marker(second)
        return (
            Aim(FACING, a.link, a.position, direction_frame(a.normal), b.link, b.position, UPRIGHT),
            Aim(FACING, b.link, b.position, direction_frame(b.normal), a.link, a.position, UPRIGHT),
        )

    return checked_term(f"palm_to_palm {first} {second}", residual, weight, tolerance, aims)


def gaze(goal: str | ArrayLike, marker: str = "head", tolerance: float = RADIANS, weight: float = PER_RAD) -> Term:
    """Return the term that points a marker's normal at a goal; its residual is the angle between the normal and the goal [rad].

    `goal`: a place (3,) m in the root frame, or the name of another marker. A residual of at most `tolerance` (5 degrees) meets the term;
    the cost is `weight` (2 per rad) times the residual.
    """
    at = goal if isinstance(goal, str) else vector("goal", goal)

    def residual(pose: Pose) -> Array:
        there = pose.position(at) if isinstance(at, str) else at
        return angle_between(pose.normal(marker), units(there - pose.position(marker)))

    def aims(robot: Robot) -> tuple[Aim, ...]:
        m = robot.marker(marker)
        link, point = (robot.marker(at).link, robot.marker(at).position) if isinstance(at, str) else (0, at)
        return (Aim(FACING, m.link, m.position, direction_frame(m.normal), link, point, UPRIGHT),)

    return checked_term(f"gaze {marker}", residual, weight, tolerance, aims)


def collision(by: str = "depth", weight: float | None = None) -> Term:
    """Return the term against contacts of solids, with tolerance 0 (thesis table 3.1).

    `by`: "depth": the residual is the sum of the depths [m], whose gradient leads out of contact; "count": it is the number of contacts.
    `weight`: None: 20 per m, or 1 per contact.
    """
    if by not in ("depth", "count"):
        raise InvalidValue(f"collision by {by!r}: valid are 'depth' and 'count'.")

    def residual(pose: Pose) -> Array:
        table = pose.table
        solid = table.kind == 0
        depths = table.depth[solid] if by == "depth" else None
        found: Array = np.bincount(table.pose[solid], depths, minlength=len(pose.q)).astype(np.float64)
        return found

    heavy = (PER_DEPTH if by == "depth" else 1.0) if weight is None else weight
    return checked_term("collision", residual, heavy, 0.0)


def home(posture: ArrayLike | None = None, weight: float = 0.05) -> Term:
    """Return the term that prefers poses near a posture (n,) rad; None: near the home pose (thesis table 3.1).

    The residual is the Euclidean distance, where each motor is divided by its range. The term is only minimised; it has no tolerance. The
    cost is `weight` times the residual.
    """
    given = None if posture is None else real_array("posture", posture)
    if given is not None and (given.ndim != 1 or not np.isfinite(given).all()):
        raise InvalidValue(f"posture has shape {given.shape}; it must be (n,) rad, finite, a position for every motor.")

    def residual(pose: Pose) -> Array:
        limits = pose.robot.limits
        if given is not None and len(given) != len(limits):
            raise InvalidValue(f"posture has {len(given)} numbers; it must be ({len(limits)},) rad, a position for every motor.")
        return lengths((pose.q - (pose.robot.home if given is None else given)) / (limits[:, 1] - limits[:, 0]))

    return checked_term("home", residual, weight, None)


def comfort(weight: float = 0.5) -> Term:
    """Return the term that prefers poses far from the motors' limits; it has no tolerance.

    The residual is the mean over all motors of ((q - middle) / half range)^4; it is 1 if all motors are at a limit. The cost is `weight`
    times the residual.
    """

    def residual(pose: Pose) -> Array:
        low, high = pose.robot.limits.T
        found: Array = (((2.0 * pose.q - low - high) / (high - low)) ** 4).mean(axis=-1)
        return found

    return checked_term("comfort", residual, weight, None)


def balance(place: ArrayLike | None = None, tolerance: float | None = None, weight: float = PER_METRE) -> Term:
    """Return the term that keeps the robot's centre of mass above a place; its residual is the horizontal distance from the place [m].

    `place`: (2,) m, x and y in the root frame; None: the place above which the centre of mass is at the home pose. A residual of at most
    `tolerance` [m] meets the term; None: it is only minimised. The cost is `weight` (20 per m) times the residual.
    """
    above = None if place is None else real_array("place", place)
    if above is not None and (above.shape != (2,) or not np.isfinite(above).all()):
        raise InvalidValue(f"place has shape {above.shape}; it must be (2,) m, finite, x and y in the root frame.")

    def residual(pose: Pose) -> Array:
        wanted = centre_of_mass_at_home(pose.robot)[:2] if above is None else above
        return lengths(centre_of_mass(pose.robot, pose.transforms)[..., :2] - wanted)

    return checked_term("balance", residual, weight, tolerance)


def constraints(weight: float = PER_RAD) -> Term:
    """Return the term that keeps the robot's clauses satisfied, with tolerance 0.

    A clause is a condition on motor positions (thesis eqs. 5.14-5.17), for example from cables that couple several motors. The residual is
    the sum of the amounts by which the clauses are violated [rad]. The cost is `weight` (2 per rad) times the residual.
    """

    def residual(pose: Pose) -> Array:
        distance: Array = np.zeros(pose.q.shape[:-1])
        for clause in pose.robot.clauses:
            distance = distance + np.maximum(0.0, -(pose.q @ clause.a.T + clause.b).max(axis=-1))
        return distance

    return checked_term("constraints", residual, weight, 0.0)


def term(
    function: Callable[[Pose, ContactTable], ArrayLike], tolerance: float | None = METRES, weight: float | None = None, name: str = ""
) -> Term:
    """Return a user's function of pose and contacts as a term of the cost.

    Args:
        function: takes a batch of N poses (`pose.q` (N, n), `pose.position(marker)` (N, 3), ...) and the table of all their contacts, and
            returns N numbers.  A function for one pose (`pose.position(marker)` (3,), contacts a tuple of Contact) that returns one number
            is also accepted; it is called for each pose, which takes longer.  inf: the pose is not valid; NaN raises InvalidValue.
        tolerance: largest value at which the term counts as met; None: the term is only minimised.
        weight: factor on the value. None: 0.1 / tolerance, so that the cost is 1 at ten times the tolerance; or 1 if the tolerance is None
            or 0.
        name: name of the term; "": the name of the function.
    """
    if not callable(function):
        raise InvalidValue(f"{function!r} is no cost: it must be a function of pose and contacts, or of mobee.costs.")
    if weight is None:
        weight = 0.1 / tolerance if tolerance else 1.0
    called, values = name or getattr(function, "__name__", "term"), Function(function)

    def residual(pose: Pose) -> Array:
        found = values(pose)
        if np.isnan(found).any():  # no comparison with the tolerance is true, so a pose could seem to meet the term
            raise InvalidValue(f"cost {called!r} is nan in a pose; it must be a number in all poses, inf where a pose is not valid.")
        return found

    return checked_term(called, residual, weight, tolerance)


def _rotation(marker: str, wanted: Array, tolerance: float, weight: float) -> Term:
    rotation(f"goal of {marker!r}", wanted)

    def residual(pose: Pose) -> Array:
        return turn_between(pose.rotation(marker), wanted)

    def aims(robot: Robot) -> tuple[Aim, ...]:
        m = robot.marker(marker)
        return (Aim(TURNED, m.link, m.position, m.rotation, 0, _NONE, wanted),)

    return checked_term(f"orientation {marker}", residual, weight, tolerance, aims)


def relative_position(marker: str, to: str, place: ArrayLike, tolerance: float = METRES, weight: float = PER_METRE) -> Term:
    """Return the term that brings a marker to a place (3,) m in the frame of the marker `to`; its residual is the distance [m].

    Use it, for example, for two hands on one object. A residual of at most `tolerance` (5 mm) meets the term; the cost is `weight` (20 per
    m) times the residual.
    """
    goal = vector("place", place)

    def residual(pose: Pose) -> Array:
        return lengths(pose.position(marker) - pose.position(to) - pose.rotation(to) @ goal)

    def aims(robot: Robot) -> tuple[Aim, ...]:
        m, other = robot.marker(marker), robot.marker(to)
        return (Aim(PLACE, m.link, m.position, UPRIGHT, other.link, other.position + other.rotation @ goal, UPRIGHT),)

    return checked_term(f"relative_position {marker} {to}", residual, weight, tolerance, aims)


def relative_orientation(marker: str, to: str, goal: ArrayLike, tolerance: float = RADIANS, weight: float = PER_RAD) -> Term:
    """Return the term that turns a marker to the rotation `goal` (3, 3) in the frame of the marker `to`; its residual is the angle [rad].

    With the identity both markers have the same orientation. A residual of at most `tolerance` (5 degrees) meets the term; the cost is
    `weight` (2 per rad) times the residual.
    """
    wanted = rotation("goal", goal)

    def residual(pose: Pose) -> Array:
        return turn_between(pose.rotation(marker), pose.rotation(to) @ wanted)

    def aims(robot: Robot) -> tuple[Aim, ...]:
        m, other = robot.marker(marker), robot.marker(to)
        return (Aim(TURNED, m.link, m.position, m.rotation, other.link, other.position, other.rotation @ wanted),)

    return checked_term(f"relative_orientation {marker} {to}", residual, weight, tolerance, aims)


def aligned(
    first: str, second: str, direction: ArrayLike, other: ArrayLike | None = None, tolerance: float = RADIANS, weight: float = PER_RAD
) -> Term:
    """Return the term that turns a direction of one marker to a direction of another; its residual is the angle between them [rad].

    `direction`: (3,) in the frame of `first`. `other`: (3,) in the frame of `second`; None: the same three numbers as `direction`. For
    opposite directions the residual is pi. A residual of at most `tolerance` (5 degrees) meets the term; the cost is `weight` (2 per rad)
    times the residual.
    """
    one = unit_vector("direction", direction)
    two = one if other is None else unit_vector("other", other)

    def residual(pose: Pose) -> Array:
        return angle_between(pose.rotation(first) @ one, pose.rotation(second) @ two)

    def aims(robot: Robot) -> tuple[Aim, ...]:
        a, b = robot.marker(first), robot.marker(second)
        here, there = direction_frame(a.rotation @ one), direction_frame(b.rotation @ two)
        return (Aim(ALONG, a.link, a.position, here, b.link, b.position, there),)

    return checked_term(f"aligned {first} {second}", residual, weight, tolerance, aims)


def across(marker: str, axis: ArrayLike, direction: ArrayLike | None = None, tolerance: float = RADIANS, weight: float = PER_RAD) -> Term:
    """Return the term that keeps a marker's normal perpendicular to an axis (3,), root frame; its residual is the error angle [rad].

    `direction`: (3,) in the marker's frame, is used instead of the normal. The term has no derivative, so the inverse kinematics by least
    squares does not minimise it, but only checks it at the end. Therefore use it together with the task coordinate `mobee.tasks.angle` of
    the same direction about the same axis: for this coordinate, least squares also makes the direction perpendicular to the axis. A
    residual of at most `tolerance` (5 degrees) meets the term; the cost is `weight` (2 per rad) times the residual.
    """
    along, own = unit_vector("axis", axis), None if direction is None else unit_vector("direction", direction)

    def residual(pose: Pose) -> Array:
        axis = pose.normal(marker) if own is None else pose.rotation(marker) @ own
        found: Array = np.arcsin(np.minimum(np.abs(axis @ along), 1.0))
        return found

    return checked_term(f"across {marker}", residual, weight, tolerance)


def plane(marker: str, normal: ArrayLike, offset: float, tolerance: float = METRES, weight: float = PER_METRE) -> Term:
    """Return the term that keeps a marker in a plane; its residual is the distance from the plane [m].

    The plane consists of all points x with normal . x = offset [m], root frame; `normal` (3,) is scaled to length 1. The normal (0, 0, 1)
    gives a horizontal plane at a height. A residual of at most `tolerance` (5 mm) meets the term; the cost is `weight` (20 per m) times the
    residual.
    """
    across = unit_vector("normal", normal)
    finite("offset", offset)

    def residual(pose: Pose) -> Array:
        found: Array = np.abs(pose.position(marker) @ across - offset)
        return found

    def aims(robot: Robot) -> tuple[Aim, ...]:
        return (level(robot.marker(marker), across, offset),)

    return checked_term(f"plane {marker}", residual, weight, tolerance, aims)


def at_most(marker: str, direction: ArrayLike, most: float, tolerance: float = METRES, weight: float = PER_METRE) -> Term:
    """Return the term that keeps a marker on one side of a plane; its residual is the distance beyond the plane [m].

    Allowed are the positions x with direction . x <= most [m], root frame; `direction` (3,) is scaled to length 1. The direction (0, 0, 1)
    limits the height. A residual of at most `tolerance` (5 mm) meets the term; the cost is `weight` (20 per m) times the residual.
    """
    along = unit_vector("direction", direction)
    finite("most", most)

    def residual(pose: Pose) -> Array:
        found: Array = np.maximum(pose.position(marker) @ along - most, 0.0)
        return found

    def aims(robot: Robot) -> tuple[Aim, ...]:
        return (below(robot.marker(marker), along, most),)

    return checked_term(f"at_most {marker}", residual, weight, tolerance, aims)
