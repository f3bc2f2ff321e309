"""Costs of how two markers are to each other, and on which side of a plane one is; see `mobee.roadmap.ik.costs`."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mobee.pose import Pose
from mobee.roadmap.ik.aim_kinds import ALONG, PLACE, TURNED
from mobee.roadmap.ik.aims import below, level
from mobee.roadmap.ik.term import METRES, PER_METRE, PER_RAD, RADIANS, UPRIGHT, Aim, Term, checked_term, direction_frame
from mobee.roadmap.ik.vectors import angle_between, lengths, rotation, turn_between, unit_vector, vector
from mobee.robot.robot import Array, Robot


def relative_position(marker: str, to: str, place: ArrayLike, tolerance: float = METRES, weight: float = PER_METRE) -> Term:
    """Put a marker on a place (3,) m in the frame of another marker, as what both hold would."""
    goal = vector("place", place)

    def residual(pose: Pose) -> Array:
        return lengths(pose.position(marker) - pose.position(to) - pose.rotation(to) @ goal)

    def aims(robot: Robot) -> tuple[Aim, ...]:
        m, other = robot.marker(marker), robot.marker(to)
        return (Aim(PLACE, m.link, m.position, UPRIGHT, other.link, other.position + other.rotation @ goal, UPRIGHT),)

    return checked_term(f"relative_position {marker} {to}", residual, weight, tolerance, aims)


def relative_orientation(marker: str, to: str, goal: ArrayLike, tolerance: float = RADIANS, weight: float = PER_RAD) -> Term:
    """Turn a marker to a rotation (3, 3) in the frame of another marker; the identity: both are turned alike."""
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
    """Let a direction (3,) in the frame of a marker be parallel to one in that of another, None: the same numbers in that frame."""
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
    """Keep a marker's normal, or a direction (3,) in its frame, across an axis (3,): the residual is the angle to the plane across it.

    It has no derivative of its own; beside an angle about the same axis as task coordinate least squares needs none.
    """
    along, own = unit_vector("axis", axis), None if direction is None else unit_vector("direction", direction)

    def residual(pose: Pose) -> Array:
        way = pose.normal(marker) if own is None else pose.rotation(marker) @ own
        found: Array = np.arcsin(np.minimum(np.abs(way @ along), 1.0))
        return found

    return checked_term(f"across {marker}", residual, weight, tolerance)


def plane(marker: str, normal: ArrayLike, offset: float, tolerance: float = METRES, weight: float = PER_METRE) -> Term:
    """Keep a marker in the plane of all x with normal . x = offset [m]; with (0, 0, 1) it is a height."""
    across = unit_vector("normal", normal)

    def residual(pose: Pose) -> Array:
        found: Array = np.abs(pose.position(marker) @ across - offset)
        return found

    def aims(robot: Robot) -> tuple[Aim, ...]:
        return (level(robot.marker(marker), across, offset),)

    return checked_term(f"plane {marker}", residual, weight, tolerance, aims)


def at_most(marker: str, direction: ArrayLike, most: float, tolerance: float = METRES, weight: float = PER_METRE) -> Term:
    """Let a marker be no further in a direction (3,) than direction . x = most [m]; with (0, 0, 1) it stays below a height."""
    along = unit_vector("direction", direction)

    def residual(pose: Pose) -> Array:
        found: Array = np.maximum(pose.position(marker) @ along - most, 0.0)
        return found

    def aims(robot: Robot) -> tuple[Aim, ...]:
        return (below(robot.marker(marker), along, most),)

    return checked_term(f"at_most {marker}", residual, weight, tolerance, aims)
