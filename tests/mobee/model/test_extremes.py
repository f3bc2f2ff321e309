# SPDX-License-Identifier: Apache-2.0
"""The least and the greatest that the engine takes: sizes, chains, motors, objects, and arrays of every kind."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import mobee
from mobee._core.narrow import KINDS
from mobee.errors import InvalidValue
from mobee.model.model import engine_of
from mobee.model.world_object import LARGEST, SMALLEST
from mobee.reference.kinematics import jacobian, link_frames
from mobee.robot.robot import Motor, Part, Robot
from tests.mobee.model.narrow.solids import Solid, farthest, overlap, overlap_along, random_turn, sampled_depth, solid
from tests.mobee.model.random_scenes import loaded, random_robot, random_world
from tests.mobee.model.test_engine import assert_same

PAIRS = [(first, second) for i, first in enumerate(KINDS) for second in KINDS[i:]]
SCALES = (SMALLEST, 1e-4, 1.0, LARGEST)
FORMS = ((1.0, 1.0, 1.0), (1.0, 1e-3, 1.0), (1e-3, 1.0, 1e-3), (1.0, 1e-9, 1.0), (1e-9, 1.0, 1e-9))  # also flat and thin ones
NUMBERS = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3}
EXACT = 2e-9  # m: no reference is more exact
COARSE = 1e-8  # of the size of a hull: how exactly the direction to something round beside it is known, which may be far smaller


def drawn(rng: np.random.Generator, kind: str, scale: float) -> Solid:
    """A volume of that scale and of any form."""
    form = scale * np.array(FORMS[rng.integers(len(FORMS))])
    half = rng.normal(size=(12, 3)) * form if kind == "convex" else form[: NUMBERS[kind]]
    return solid(kind, half, rotation=random_turn(rng))


@pytest.mark.parametrize(("first", "second"), PAIRS)
def test_for_volumes_of_any_size_the_depth_is_the_smallest_separation(first: str, second: str, rng: np.random.Generator) -> None:
    touching = 0
    for scales, deep in product(product(SCALES, SCALES), [False, True] * 2):
        a, b = drawn(rng, first, scales[0]), drawn(rng, second, scales[1])
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        reaches = farthest(a, axis[None])[0], farthest(b, -axis[None])[0]
        b = b.moved(axis * (0.3 * min(reaches) if deep else sum(reaches) - 0.3 * min(reaches)))
        found, rounding = overlap(a, b), EXACT + 1e-12 * max(scales)
        turned = COARSE * max(scales) if second == "convex" and first in ("sphere", "capsule") else 0.0
        assert np.isfinite(found.depth)
        shortest = min(sampled_depth(a, b, np.random.default_rng(0)), overlap_along(a, b, np.array([axis, -axis])).min())
        assert found.depth <= max(shortest, 0.0) + rounding + 1e-6 * min(scales)  # cylinders: as near to the shortest as is searched
        if found.depth > 0.0:
            touching += 1
            assert np.linalg.norm(found.normal) == pytest.approx(1.0, abs=1e-12)
            assert overlap_along(a, b, found.normal[None])[0] == pytest.approx(found.depth, abs=rounding + turned)
            assert np.isfinite(found.point).all()
    assert touching > 20


def chain(rng: np.random.Generator, joints: int, shapes: int = 40) -> Robot:
    """A robot of one chain with a motor for each joint."""
    robot = random_robot(rng, joints, shapes)
    split = joints // 2
    motors = tuple(Motor(f"m{j}", "one" if j < split else "two", np.array([-3.0, 3.0]), 0.0, ((j, 1.0, 0.0),)) for j in range(joints))
    names = [motor.name for motor in motors]
    parts = {"one": Part("one", tuple(names[:split]), 0), "two": Part("two", tuple(names[split:]), split)}
    return replace(robot, joints=tuple(replace(one, parent=j) for j, one in enumerate(robot.joints)), motor_table=motors, parts=parts)


def test_a_thousand_links_are_where_the_readable_definition_puts_them(rng: np.random.Generator) -> None:
    robot = chain(rng, 1000)
    q = rng.uniform(-3.0, 3.0, 1000)
    frames, pose = link_frames(robot, q), mobee.Model(robot, mobee.World()).evaluate(q)
    reach = np.abs(frames[:, :3, 3]).max()
    assert pose.transforms == pytest.approx(frames, abs=1000 * np.finfo(float).eps * reach)
    point = np.array([0.1, 0.2, 0.3])
    found = engine_of(robot).jacobians(q[None], 1000, point)[0]
    at = frames[1000] @ np.append(point, 1.0)
    assert found == pytest.approx(jacobian(robot, frames, 1000, at[:3]), abs=1000 * np.finfo(float).eps * reach)
    assert_same(robot, q, mobee.World())


def test_two_hundred_motors_go_where_they_are_sent(rng: np.random.Generator) -> None:
    robot = replace(chain(rng, 200, shapes=0), clauses=())
    plant = mobee.OfflinePlant(mobee.Model(robot, mobee.World()), hashed=True)
    target = rng.uniform(-1.0, 1.0, 100)
    outcome = plant.act("one", target)
    assert outcome.settled
    assert outcome.q == pytest.approx(target, abs=0.02)


@pytest.mark.parametrize("count", [0, 2000])
def test_no_objects_and_thousands(count: int, rng: np.random.Generator) -> None:
    robot = loaded("katana")
    world = random_world(rng, robot, max(count, 1), scale=3.0)
    if count == 0:
        world.remove("o0")
    assert (assert_same(robot, robot.home, world) > 0) == (count > 0)


def test_poses_in_arrays_of_every_kind_are_the_same_poses(rng: np.random.Generator) -> None:
    model = mobee.Model(loaded("icub"), mobee.load_world("table"))
    q = np.round(rng.uniform(*model.robot.limits.T, (6, len(model.robot.motors))), 2).astype(np.float32).astype(np.float64)
    wide = np.zeros((12, 2 * q.shape[1]))
    wide[::2, 1::2] = q
    expected = model.evaluate(q)
    read_only = q.copy()
    read_only.flags.writeable = False
    for given in (np.asfortranarray(q), wide[::2, 1::2], q.astype(np.float32), q.astype(">f8"), q.tolist(), read_only, q[::-1][::-1]):
        pose = model.evaluate(given)
        assert pose.table.reals.tobytes() == expected.table.reals.tobytes()
        assert pose.transforms.tobytes() == expected.transforms.tobytes()
    assert model.evaluate(q[:0]).table.reals.shape == (0, 7)
    assert model.evaluate(q.reshape(2, 3, -1)).projection.shape == (2, 3, q.shape[1])


@pytest.mark.parametrize(
    "wrong",
    [np.nan, np.inf, -np.inf, 1j, "pose", None, [[0.0], [0.0, 1.0]], np.zeros(3), np.zeros((2, 40)), np.array(["0"] * 41), np.array(0.0)],
    ids=lambda wrong: type(wrong).__name__ if isinstance(wrong, np.ndarray) else repr(wrong),
)
def test_an_invalid_pose_is_refused_in_one_line(wrong: object) -> None:
    model = mobee.Model(loaded("icub"), mobee.World())
    given = np.full(41, wrong) if isinstance(wrong, float | complex) else wrong
    with pytest.raises(InvalidValue) as refused:
        model.evaluate(given)  # type: ignore[arg-type]  # what a caller without a type checker gives
    assert "\n" not in str(refused.value)
    assert str(refused.value).startswith("q ")
