# SPDX-License-Identifier: Apache-2.0
"""A live try is judged by the simulator's joints, at the tick at which its last reach ended."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from experiments.claims.ch8_reaching.live_reach.problems import FRESH, MARKER, PART, Problem, robot
from experiments.claims.ch8_reaching.live_reach.tries import Job, Tried, measure, read_block, write_block
from experiments.kit.live.launch import append_done
from experiments.kit.live.system import CONTACTS, POSITIONS
from mobee import Model
from mobee.reach import RADIUS

ARM = robot().parts[PART].slice
T, END, RATE = 100, 61, 50.0


def tried(number: int, ends: list[int], **how: object) -> Tried:
    known = {"kind": FRESH, "number": number, "out": 2, "begin": 11, "ends": ends, "over": 90, "off": 0.0, "actions": 2, "believed": 0.0}
    return Tried(**{**known, "thinking": 0.0, **how})  # type: ignore[arg-type]  # fields by name, the dict of all has no type for each field


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The arm bends its elbow by 0.3 rad in one tick, the 60th, and has contacts before and after that."""
    q = np.tile(robot().home, (T, 1))
    q[END - 2 :, ARM.start + 3] += 0.3
    q.tofile(tmp_path / POSITIONS)
    (tmp_path / CONTACTS).write_text("k,pair,depth\n5,r_hand table,0.001\n30,r_hand table,0.003\n95,l_hand table,0.004\n")
    return tmp_path


def palm(bent: float) -> np.ndarray:
    q = robot().home.copy()
    q[ARM.start + 3] += bent
    return Model(robot()).evaluate(q).position(MARKER)


def problem(number: int, off: float) -> Problem:
    """A sphere whose surface is `off` above the palm at the end."""
    return Problem(FRESH, number, (palm(0.3) + [0.0, 0.0, RADIUS + off]).tolist(), [])


def test_success_is_the_palm_within_two_centimetres_of_the_surface_when_the_force_ended(folder: Path) -> None:
    problems = [problem(0, 0.019), problem(1, 0.021), problem(2, 0.0)]
    for one in (tried(0, [20, END]), tried(1, [END]), tried(2, [], why="held")):
        append_done(folder, one)
    near, far, none = measure(folder, Job("learner", 0, "", problems), RATE, True).tries
    assert near.success and near.off == pytest.approx(0.019)
    assert near.seconds == pytest.approx((END - 11) / RATE) and near.reaches == 2
    assert not far.success and far.off == pytest.approx(0.021)
    assert not none.success and none.off == np.inf


def test_a_try_that_was_interrupted_before_its_first_posture_is_kept(folder: Path) -> None:
    append_done(folder, tried(0, [], off=np.inf, believed=np.inf, why="held"))
    block = measure(folder, Job("learner", 0, "", [problem(0, 0.0)]), RATE, True)
    write_block(folder, block)
    assert read_block(folder) == block and block.tries[0].off == block.tries[0].begun_off == np.inf


def test_the_pose_of_a_tick_is_that_which_its_encoders_measured(folder: Path) -> None:
    append_done(folder, tried(0, [END - 1]))
    before = measure(folder, Job("learner", 0, "", [problem(0, 0.0)]), RATE, True).tries[0]
    assert before.off > 0.03


def test_a_moving_target_is_judged_at_its_position_at_the_end(folder: Path) -> None:
    append_done(folder, tried(0, [END], there=problem(0, 0.005).position))
    assert measure(folder, Job("moving", 0, "", [problem(0, 0.2)]), RATE, True).tries[0].off == pytest.approx(0.005)


def test_deep_contacts_belong_to_the_block_and_to_the_try_in_which_they_began(folder: Path) -> None:
    append_done(folder, tried(0, [END]))
    block = measure(folder, Job("learner", 0, "", [problem(0, 0.0)]), RATE, True)
    assert [touch.depth for touch in block.deep] == [0.003, 0.004]
    assert [touch.depth for touch in block.tries[0].deep] == [0.003]


def test_the_first_motion_is_counted_in_ticks_from_the_request(folder: Path) -> None:
    append_done(folder, tried(0, [END], asked=50, first=2))
    found = measure(folder, Job("first motion", 0, "", [problem(0, 0.0)]), RATE, True).tries[0]
    assert (found.first, found.first_motion) == (2, END - 1 - 50)
