"""A model that is frozen: forces come late, the robot slows down and holds, and nothing jumps, on robot_sim's own clock."""

from __future__ import annotations

import os
import signal
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from mobee import load_robot
from tests.system.live import AGENTS, PARTS, running, until

ROBOT = load_robot("icub")
pytestmark = pytest.mark.system

TICK = 0.01  # s
FROZEN = 0.3  # s: longer than forces stay fresh, shorter than the launcher bears
GRACE = 0.2  # s until it holds: three ticks of old forces, or the commands' time to live
BRAKES = 0.3  # s: from 60 deg/s at 600 deg/s^2, and the motors' delay and lag
AT_REST = 0.01  # rad/s


def test_late_forces_make_the_robot_slow_down_and_hold_and_never_jump(tmp_path: Path) -> None:
    with running(tmp_path, "kinematic", "services.robot_sim.encoder_noise=0.0") as (_, watcher):
        until(lambda: any(watcher.speed(part) > 0.15 for part in AGENTS), 40.0, "a part moves")
        pid, k = watcher.pid("model"), watcher.k
        os.kill(pid, signal.SIGSTOP)
        try:
            until(lambda: watcher.k >= k + round(FROZEN / TICK), 10.0, "ticks without forces")
        finally:
            os.kill(pid, signal.SIGCONT)
        until(lambda: all(watcher.states[part][-1].mode == "velocity" for part in PARTS), 20.0, "all obey again")
        until(lambda: any(watcher.speed(part) > 0.05 for part in AGENTS), 20.0, "a part moves again")
    for part in PARTS:
        seen = [state for state in watcher.states[part] if state.k >= k - 5]
        held = next(state.k for state in seen if state.mode == "hold" and state.k > k)
        assert (held - k) * TICK <= GRACE
        rest = next(state.k for state in seen if state.k > held and max(map(abs, state.dq)) < AT_REST)
        assert (rest - held) * TICK <= BRAKES
        motors = [ROBOT.motor_table[ROBOT.motor_index(name)] for name in ROBOT.part(part).motors]
        fastest = np.array([motor.max_velocity for motor in motors])
        hardest = np.array([motor.max_acceleration for motor in motors])
        for before, after in pairwise(seen):
            passed = (after.t - before.t) * 1e-9 + TICK  # both are means over the tick before them
            assert (np.abs(np.subtract(after.q, before.q)) <= fastest * passed).all()
            assert (np.abs(np.subtract(after.dq, before.dq)) <= hardest * passed).all()
