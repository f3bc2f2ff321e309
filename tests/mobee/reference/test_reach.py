# SPDX-License-Identifier: Apache-2.0
"""The reach force of the definition: its specification, and equality with the force of the controller."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mobee.control import Controller, Forces, Gains
from mobee.errors import InvalidValue
from mobee.model.model import Model
from mobee.reach import AIMS, ReachTarget
from mobee.reference import reach
from mobee.reference.forces import State, damping, spring
from mobee.reference.kinematics import link_frames, marker_at
from mobee.reference.law import at_rest, step
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from tests.mobee.planar import planar_arm, tree
from tests.mobee.reference.drawn import Rng, apart

SEEDS = st.integers(0, 2**32 - 1)
BOTH = pytest.mark.parametrize("gains", [Gains.default(), Gains.published_2014()], ids=lambda g: g.law)
REACHES = (("right_arm", "right_palm"), ("left_arm", "left_elbow"), ("torso", "left_palm"), (None, "right_palm"))
ICUBS = [load_robot("icub"), load_robot("icub_2014")]
# Sums in another order, the solution of a linear system of size one, and at most some hundred turns of the power iteration; a small part
# of them is multiplied by the size of the system where the pose is nearly singular.
ROUNDING = 1e-10
ZERO = np.zeros(3)


def drawn_target(rng: Rng, robot: Robot, marker: str) -> ReachTarget:
    """Where the marker may be, close by it or far out of reach."""
    place = marker_at(robot, link_frames(robot, rng.uniform(*robot.limits.T)), marker)[0]
    place = place + rng.normal(size=3) * rng.choice([0.0, 0.01, 0.3, 3.0])
    turning = rng.random()
    normal = rng.normal(size=3) if turning < 0.4 else None
    return ReachTarget(place, float(rng.uniform(0.01, 0.2)), AIMS[rng.integers(2)], normal, faces=bool(turning > 0.7))


def agree(robot: Robot, gains: Gains, part: str | None, marker: str, rng: Rng, ticks: int = 16) -> None:
    """Controller and definition from a pose and on, held back now and then by forces of any direction."""
    controller, n = Controller(Model(robot), gains), len(robot.motors)
    target = drawn_target(rng, robot, marker)
    try:
        controller.reach_toward(part, marker, target)
    except InvalidValue:  # nothing of the part moves the marker
        assert not len(reach.begin(robot, gains, part, marker, target).motors)
        return
    mine = reach.begin(robot, gains, part, marker, target)
    q = robot.home.copy() if rng.random() < 0.3 else rng.uniform(*robot.limits.T)
    controller.reset(q)
    controller.attractor = goal = rng.uniform(*robot.limits.T)
    motion = at_rest(robot, gains, q)
    for tick in range(ticks):
        if tick == ticks // 2:
            mine.target = target = drawn_target(rng, robot, marker)
            controller.reach_toward(part, marker, target)
        held = Forces(np.zeros(n), np.zeros(n), rng.normal(size=n) * rng.choice([0.0, 0.1, 10.0]))
        state = State(robot, gains, q, motion.velocity, goal)
        wanted = spring(state) + damping(state) + held.total + reach.reach_force(mine, state, 0.01, held.total)
        motion = step(robot, gains, motion, q, wanted, 0.01)
        assert apart(controller.step(q, 0.01, held).velocity, motion.velocity) < ROUNDING
        if gains.law == "default":
            assert controller.is_approaching(part) == mine.is_approaching
        q = q + 0.01 * motion.velocity + 1e-4 * rng.normal(size=n)


@BOTH
@settings(max_examples=8)
@given(seed=SEEDS)
def test_a_humanoids_reach_is_this(gains: Gains, seed: int) -> None:
    rng = np.random.default_rng(seed)
    part, marker = REACHES[rng.integers(len(REACHES))]
    agree(ICUBS[rng.integers(2)], replace(gains, client_squash=("each", "direction")[rng.integers(2)]), part, marker, rng)


@BOTH
@settings(max_examples=15)
@given(seed=SEEDS)
def test_the_reach_of_any_tree_is_this(gains: Gains, seed: int) -> None:
    """With joints that slide, joints that two motors drive, and motors that drive two joints."""
    rng = np.random.default_rng(seed)
    agree(tree(int(rng.integers(10_000))), gains, "body", f"marker{rng.integers(1, 13)}", rng)


@settings(max_examples=25)
@given(SEEDS)
def test_the_reach_of_a_planar_arm_is_this_also_where_it_is_stretched(seed: int) -> None:
    agree(planar_arm(), Gains.default(), "arm", "tip", np.random.default_rng(seed))


def tip_target(x: float, y: float) -> ReachTarget:
    return ReachTarget(np.array([x, y, 0.0]))


def drawn_to(target: ReachTarget, start: np.ndarray, seconds: float = 8.0) -> np.ndarray:
    """Return the position of the tip at the end, for motors that follow their commands without delay."""
    robot, gains, q = planar_arm(), Gains.default(), start
    motion, mine = at_rest(robot, gains, q), reach.begin(planar_arm(), gains, "arm", "tip", target)
    for _ in range(round(seconds / 0.01)):
        state = State(robot, gains, q, motion.velocity, start)
        wanted = spring(state) + damping(state) + reach.reach_force(mine, state, 0.01, ZERO)
        motion = step(robot, gains, motion, q, wanted, 0.01)
        q = q + 0.01 * motion.velocity
    return marker_at(robot, link_frames(robot, q), "tip")[0]


def test_a_target_in_reach_is_reached_and_one_out_of_reach_approached() -> None:
    bent = np.array([0.3, 0.7, 0.4])
    assert drawn_to(tip_target(0.3, 0.5), bent) == pytest.approx([0.3, 0.5, 0.0], abs=2e-3)
    assert np.linalg.norm(drawn_to(tip_target(0.0, 1.1), bent) - [0.0, 1.1, 0.0]) == pytest.approx(0.2, abs=0.01)


def test_there_is_an_escape_direction_for_a_stretched_arm() -> None:
    assert drawn_to(tip_target(0.5, 0.0), ZERO) == pytest.approx([0.5, 0.0, 0.0], abs=2e-3)


def test_the_published_force_by_hand() -> None:
    """Levers .9, .6, .3 m times 5000 times .1 m are 450, 300, 150, of norm 561; 1000 v / (20 + 561) deg/s^2."""
    robot, gains = planar_arm(), Gains.published_2014()
    mine = reach.begin(robot, gains, "arm", "tip", tip_target(0.9, 0.1))
    force = reach.reach_force(mine, State(robot, gains, ZERO, ZERO, ZERO), 0.02, ZERO)
    assert np.rad2deg(force) == pytest.approx(1000.0 * np.array([450.0, 300.0, 150.0]) / (20.0 + np.linalg.norm([450.0, 300.0, 150.0])))


@BOTH
def test_inside_the_surface_nothing_pulls(gains: Gains) -> None:
    robot = planar_arm()
    mine = reach.begin(robot, gains, "arm", "tip", ReachTarget(np.array([0.9, 0.02, 0.0]), 0.05, "surface"))
    assert not reach.reach_force(mine, State(robot, gains, ZERO, ZERO, ZERO), 0.01, ZERO).any()
