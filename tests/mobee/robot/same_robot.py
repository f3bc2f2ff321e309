# SPDX-License-Identifier: Apache-2.0
"""Checks whether two robots are the same, in any order of their links and shapes."""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array, Ints
from mobee.model.kinematics import link_transforms
from mobee.robot.robot import Robot, Shape


def assert_same_motors(one: Robot, other: Robot) -> None:
    """Parts, motors, limits and home."""
    assert one.motors == other.motors
    assert [(part.name, part.motors, part.start) for part in one.parts.values()] == [
        (part.name, part.motors, part.start) for part in other.parts.values()
    ]
    assert np.abs(one.limits - other.limits).max() < 1e-9
    assert np.abs(one.home - other.home).max() < 1e-9
    for attribute in ("max_velocity", "max_acceleration", "max_torque"):
        values = [[getattr(motor, attribute) for motor in robot.motor_table] for robot in (one, other)]
        assert np.allclose(*values, rtol=1e-12)


def assert_same_motion(one: Robot, other: Robot, poses: int = 50) -> None:
    """Require that every link has the same pose at random q, and every joint the same limits."""
    links = [other.links.index(name) for name in one.links]
    assert len(other.links) == len(links)
    q = np.random.default_rng(9).uniform(*one.limits.T, size=(poses, len(one.motors)))
    assert np.abs(link_transforms(one, q) - link_transforms(other, q)[:, links]).max() < 1e-9
    joints = {joint.name: joint for joint in other.joints}
    for joint in one.joints:
        assert joint.kind == joints[joint.name].kind
        assert np.abs(joint.limits - joints[joint.name].limits).max() < 1e-9


def assert_same_shapes(one: Robot, other: Robot) -> None:
    """Kind, role, part, link, and the volume itself."""
    theirs = {shape.name: shape for shape in other.shapes}
    assert {shape.name for shape in one.shapes} == set(theirs)
    for shape in one.shapes:
        twin = theirs[shape.name]
        assert (shape.kind, shape.role, shape.part) == (twin.kind, twin.role, twin.part)
        assert one.links[shape.link] == other.links[twin.link]
        assert np.allclose(shape.size, twin.size, atol=1e-12)
        assert _apart(shape, twin) < 1e-9, shape.name
    assert {one.shapes[k].name for k in one.base_shapes} == {other.shapes[k].name for k in other.base_shapes}


def _apart(shape: Shape, twin: Shape) -> float:
    if shape.kind == "convex":
        gaps = np.abs(_corners(shape)[:, None] - _corners(twin)).max(axis=2)
        return float(max(gaps.min(axis=0).max(), gaps.min(axis=1).max()))
    apart = float(np.abs(shape.position - twin.position).max())
    turned = np.abs(shape.rotation.T @ twin.rotation)  # every primitive is symmetric about the middle of its axes
    match shape.kind:
        case "sphere":
            return apart
        case "box":
            return max(apart, float(np.abs(turned - np.eye(3)).max()))
        case _:
            return max(apart, float(np.abs(turned[:, 2] - [0, 0, 1]).max()))


def _corners(shape: Shape) -> Array:
    assert shape.vertices is not None
    corners: Array = shape.position + shape.vertices @ shape.rotation.T
    return corners


def assert_same_pairs(one: Robot, other: Robot) -> None:
    """The pairs that are tested, and the links that are never tested."""

    def pairs(robot: Robot, table: Ints) -> set[frozenset[str]]:
        return {frozenset((robot.shapes[a].name, robot.shapes[b].name)) for a, b in table.tolist()}

    assert pairs(one, one.solid_pairs) == pairs(other, other.solid_pairs)
    assert pairs(one, one.field_pairs) == pairs(other, other.field_pairs)
    links = [{frozenset(robot.links[k] for k in pair) for pair in robot.untested} for robot in (one, other)]
    assert links[0] == links[1]


def assert_same_markers(one: Robot, other: Robot) -> None:
    """All markers of the first robot; the other may have more."""
    for marker in one.markers.values():
        twin = other.markers[marker.name]
        assert one.links[marker.link] == other.links[twin.link]
        for attribute in ("position", "rotation", "normal"):
            assert np.abs(getattr(marker, attribute) - getattr(twin, attribute)).max() < 1e-9, (marker.name, attribute)


def assert_same_bodies(one: Robot, other: Robot) -> None:
    """Masses, their centres and their moments of inertia."""
    theirs = {other.links[body.link]: body for body in other.bodies}
    assert {one.links[body.link] for body in one.bodies} == set(theirs)
    for body in one.bodies:
        twin = theirs[one.links[body.link]]
        assert abs(body.mass - twin.mass) < 1e-12 * body.mass
        assert np.abs(body.centre - twin.centre).max() < 1e-9
        assert (body.inertia is None) == (twin.inertia is None)
        if body.inertia is not None and twin.inertia is not None:
            assert np.abs(body.inertia - twin.inertia).max() < 1e-9 * max(1.0, float(np.abs(body.inertia).max()))


def assert_same_robot(one: Robot, other: Robot) -> None:
    assert one.name == other.name
    assert one.links[0] == other.links[0]
    assert abs(one.least_lever - other.least_lever) < 1e-9
    assert_same_motors(one, other)
    assert_same_motion(one, other)
    assert_same_shapes(one, other)
    assert_same_pairs(one, other)
    assert_same_markers(one, other)
    assert_same_bodies(one, other)
