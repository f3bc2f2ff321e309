from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from experiments.babbling.command_log import COMMANDS, Commanded, CommandLog, read_commands
from experiments.babbling.measured import CONTACTS, POSITIONS, REACHED, RETURNED, SUMMARY, judge, measure, read_trial, write_trial
from experiments.babbling.moved import moved_motors
from mobee import load_robot

ROBOT = load_robot("icub")
DT = 0.02
TICKS = 100
ENDINGS = dict.fromkeys(ROBOT.parts, "over")


def part(name: str) -> slice:
    return ROBOT.parts[name].slice


def ramp(target: np.ndarray) -> np.ndarray:
    """From home to a posture in all ticks, (ticks, n)."""
    return ROBOT.home + np.linspace(0.0, 1.0, TICKS)[:, None] * (target - ROBOT.home)


def commanded(target: np.ndarray) -> Commanded:
    return Commanded(2, TICKS + 1, target.tolist(), ENDINGS)


def test_a_command_is_completed_deflected_or_returned_part_by_part() -> None:
    target = ROBOT.home.copy()
    target[[part("torso").start, part("head").start, part("left_arm").start]] += 0.3
    end = target.copy()
    end[part("torso").start] -= 0.9 * REACHED
    end[part("head").start] -= 1.1 * REACHED
    end[part("left_arm").start] = ROBOT.home[part("left_arm").start] + 0.5 * RETURNED
    judged = judge(commanded(target), ramp(end), ROBOT, DT)
    assert judged.outcomes == {"torso": "completed", "head": "deflected", "left_arm": "returned", "right_arm": "completed"}
    assert judged.duration == pytest.approx((TICKS - 1) * DT)
    assert judged.way == pytest.approx(0.9)
    assert judged.path == pytest.approx(0.6 - 2.0 * REACHED + 0.5 * RETURNED)
    assert judged.left == pytest.approx({"torso": 0.9 * REACHED, "head": 1.1 * REACHED, "left_arm": 0.3 - 0.5 * RETURNED, "right_arm": 0.0})


def test_the_hands_do_not_count() -> None:
    target = ROBOT.home.copy()
    target[part("left_arm").stop - 1] += 0.5
    assert set(judge(commanded(target), ramp(ROBOT.home), ROBOT, DT).outcomes.values()) == {"completed"}


def left_by_a_trial(folder: Path) -> None:
    target = ROBOT.home.copy()
    target[0] = ROBOT.limits[0, 1] + np.deg2rad(2.0)
    ramp(target).tofile(folder / POSITIONS)
    (folder / CONTACTS).write_text("k,pair,depth\n5,l_hand table,0.004\n")
    lockstep = {"ticks": TICKS, "speed": 8.5, "repeatable": True, "states_sha256": "c0ffee"}
    (folder / SUMMARY).write_text(json.dumps({"scenario": "off", "faults": [], "lockstep": lockstep}))
    CommandLog(folder / COMMANDS).note(commanded(target))


def test_a_trial_is_measured_from_what_was_recorded(tmp_path: Path) -> None:
    left_by_a_trial(tmp_path)
    trial = measure(tmp_path, ROBOT, DT)
    assert trial.seconds == pytest.approx(TICKS * DT)
    assert trial.motor == ROBOT.motors[0]
    assert np.rad2deg(trial.beyond) == pytest.approx(2.0)
    assert [(touch.pair, touch.depth) for touch in trial.touches] == [("l_hand table", 0.004)]
    assert len(trial.commands) == 1
    assert (trial.lockstep.repeatable, trial.lockstep.states_sha256) == (True, "c0ffee")
    assert trial.jerk_squared == pytest.approx(0.0, abs=1e-9)


def test_what_is_kept_of_a_trial_is_read_as_it_was_written(tmp_path: Path) -> None:
    left_by_a_trial(tmp_path)
    trial = measure(tmp_path, ROBOT, DT)
    write_trial(tmp_path / "trial.json", trial)
    assert read_trial(tmp_path / "trial.json") == trial
    assert not list(tmp_path.glob("*.new"))


def test_a_command_is_in_the_log_when_it_has_ended_and_what_a_kill_has_cut_is_not(tmp_path: Path) -> None:
    path = tmp_path / "deep" / COMMANDS
    log = CommandLog(path)
    assert read_commands(path) == []
    log.note(commanded(ROBOT.home))
    assert read_commands(path) == [commanded(ROBOT.home)]
    with path.open("a") as file:
        file.write('{"begin":2,"en')
    assert read_commands(path) == [commanded(ROBOT.home)]


def test_only_the_babbling_motors_are_judged_against_their_limits(tmp_path: Path) -> None:
    left_by_a_trial(tmp_path)
    q = np.fromfile(tmp_path / POSITIONS).reshape(-1, len(ROBOT.motors))
    still = np.setdiff1d(np.arange(len(ROBOT.motors)), moved_motors(ROBOT))
    q[:, still] += 9.0
    q.tofile(tmp_path / POSITIONS)
    assert measure(tmp_path, ROBOT, DT).motor == ROBOT.motors[0]
