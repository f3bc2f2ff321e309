# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.claims.ch4_reflex import babbling
from experiments.claims.ch4_reflex.babbling import EXPERIMENT, summarise, verdict
from experiments.claims.ch4_reflex.babbling_trial import (
    COMMANDS,
    COUNT,
    FILTERED,
    MODES,
    REACHED,
    RETURNED,
    SUMMARY,
    Commanded,
    CommandLog,
    Judged,
    Lockstep,
    PositionMove,
    Targets,
    Trial,
    TrialFailed,
    beyond_limits,
    jerk,
    judge,
    measure,
    moved_motors,
    path_length,
    read_commands,
    scenario,
)
from experiments.kit.live.system import CONTACTS, POSITIONS, Touch
from mobee import load_robot
from mobee.errors import InvalidValue
from mobee_cli.__main__ import main
from tests.experiments.options import options_of

ROBOT = load_robot("icub")
DT = 0.02
PARTS = ("torso", "head", "left_arm", "right_arm")
TICKS = 100
ENDINGS = dict.fromkeys(ROBOT.parts, "over")
angles = st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3).map(np.array)


def trial(
    depths: tuple[float, ...] = (),
    completed: int = 4,
    jerk: float = 4.0,
    beyond: float = -0.1,
    seconds: float = 60.0,
    repeatable: bool = True,
) -> Trial:
    outcomes = {part: "completed" if i < completed else "deflected" for i, part in enumerate(PARTS)}
    left = {part: 0.1 if i < completed else 0.5 for i, part in enumerate(PARTS)}
    command = Judged(outcomes, dict.fromkeys(PARTS, "over"), left, 10.0, 12.0, 11.0)
    touches = [Touch("l_forearm table", 10 * i, 10 * i, depth) for i, depth in enumerate(depths)]
    return Trial(seconds, [command], touches, beyond, "torso_yaw", 0.25, jerk**2, 50.0, 12.0, Lockstep(3000, 8.0, repeatable, ""))


GOOD = {"off": trial((0.001, 0.003)), "one": trial(completed=1, jerk=9.0), "two": trial(completed=3)}


def rows(**changed: Trial) -> dict[str, dict[str, Any]]:
    return {mode: summarise([each]) for mode, each in {**GOOD, **changed}.items()}


def test_all_claims_hold_for_good_trials() -> None:
    claims = verdict(rows())
    assert len(claims) == 5
    assert all(claims.values())


@pytest.mark.parametrize(
    ("mode", "spoiled", "claim"),
    [
        ("off", trial(), "without MoBeE it collides"),
        ("off", trial((0.001,), seconds=7200.0), "without MoBeE it collides"),
        ("two", trial((0.0021,), completed=3), "no listed contact is deeper"),
        ("two", trial(completed=3, beyond=0.01), "no joint is beyond"),
        ("one", trial(completed=3, jerk=9.0), "completes a larger share"),
        ("one", trial(completed=1, jerk=3.0), "moves more smoothly"),
    ],
)
def test_a_claim_fails_with_a_contradicting_trial(mode: str, spoiled: Trial, claim: str) -> None:
    fallen = [name for name, stands in verdict(rows(**{mode: spoiled})).items() if not stands]
    assert len(fallen) == 1
    assert claim in fallen[0]


def test_of_one_mode_only_its_own_claims_are_judged() -> None:
    assert len(verdict({"two": summarise([GOOD["two"]])})) == 2
    assert not verdict({"one": summarise([GOOD["one"]])})


def test_trials_add_up() -> None:
    row = summarise([trial((0.001,), jerk=3.0, seconds=60.0), trial((0.004, 0.0), completed=1, jerk=5.0, seconds=120.0, beyond=0.0)])
    assert (row["minutes"], row["collisions"], row["deepest_mm"], row["worst_beyond_limit_deg"]) == (3.0, 3, 4.0, 0.0)
    assert (row["trials"], row["times_real_time"]) == (2, 8.0)
    assert (row["commands"], row["completed"], row["deflected"], row["postures_completed"]) == (8, 5, 3, 1)
    assert (row["within_5_deg"], row["left_median_deg"]) == (0, 5.73)
    assert row["jerk_rms"] == pytest.approx(((9.0 + 2 * 25.0) / 3.0) ** 0.5, abs=0.01)
    assert row["jerk_over_speed"] == pytest.approx(row["jerk_rms"] / 0.5, abs=0.1)
    assert row["path_a_minute_rad"] == 8.0


def test_a_finished_run_is_printed_as_a_table_with_the_verdicts_below(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(babbling, "_run_until_repeatable", lambda *settings: None)
    monkeypatch.setattr(babbling, "read_trials", lambda folder, mode: [GOOD[mode]])
    assert main(["experiment", "run", "babbling", "--minutes", "1", "--runs", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "collisions (solid contacts)" in said and "passed: yes" in said
    assert "2.0 moves more smoothly than 1.0: yes" in said
    assert all(len(line) <= 80 for line in said.splitlines() if not line.startswith("run: "))


def test_every_mode_is_a_scenario_that_the_launcher_accepts(tmp_path: Path) -> None:
    from services.launcher.scenario import read_scenario

    for mode in MODES:
        file = tmp_path / f"{mode}.toml"
        file.write_text(scenario(mode, tmp_path / 'a "quoted" folder', seed=3, backend="mujoco"))
        read = {part.who: part.config for part in read_scenario(str(file)).parts}
        assert read["robot_sim"].mode == read["babbler"].mode == "lock" and read["robot_sim"].backend == "mujoco"
        assert read["robot_sim"].record == read["babbler"].run_dir
        assert ("controller" in read, "port_filter" in read) == (mode == "two", mode == "one")
        if mode == "two":
            assert (read["model"].gains, read["controller"].gains, read["controller"].speed_scale) == ("default", "default", 0.2)
        if mode == "one":
            assert read["babbler"].robot_of == read["port_filter"].clients == FILTERED


class Trials:
    """In place of real ones: notes which are run, leaves their files, and fails at the number `breaks_at`."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.run: list[tuple[str, int, int]] = []
        self.breaks_at = 99
        monkeypatch.setattr(babbling, "run_trial", self._run)
        self.late = 0  # in so many of the next trials a process is late
        monkeypatch.setattr(babbling, "measure", self._measure)

    def _measure(self, folder: Path, robot: Any, dt: float) -> Trial:
        self.late -= 1
        return trial(repeatable=False) if self.late >= 0 else GOOD[folder.parent.name]

    def _run(self, folder: Path, mode: str, robot: Any, seed: int, ticks: int, show: Any, backend: str) -> None:
        if len(self.run) == self.breaks_at:
            raise TrialFailed("made to fail")
        self.run.append((mode, seed, ticks))
        folder.mkdir(parents=True, exist_ok=True)
        (folder / POSITIONS).write_bytes(b"much")


def options(*given: str) -> argparse.Namespace:
    return options_of(EXPERIMENT, "--minutes", "15", "--seed", "2", *given)


def test_an_interrupted_run_continues_after_its_finished_trials(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    trials = Trials(monkeypatch)
    trials.breaks_at = 4
    with pytest.raises(TrialFailed):
        EXPERIMENT.method.run(options(), tmp_path)
    trials.breaks_at = 99
    results = EXPERIMENT.method.run(options(), tmp_path)
    assert trials.run == [(mode, 20_000 + number, ticks) for number, ticks in ((0, 30_000), (1, 15_000)) for mode in MODES]
    assert results["passed"] and "modes" not in results
    assert "MoBeE 2.0" in capsys.readouterr().out
    assert not list(tmp_path.rglob(POSITIONS))
    again = EXPERIMENT.method.run(options("--json"), tmp_path)
    assert len(trials.run) == 6
    assert again["modes"]["two"]["commands"] == 8


def test_a_trial_in_which_a_process_was_late_is_repeated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    trials = Trials(monkeypatch)
    trials.late = 2
    EXPERIMENT.method.run(options("--minutes", "1", "--modes", "two", "--json"), tmp_path)
    assert trials.run == [("two", 20_000, 3000)] * 3
    assert babbling.read_trials(tmp_path, "two") == [GOOD["two"]]
    trials.late = 3
    with pytest.raises(TrialFailed, match="too busy"):
        EXPERIMENT.method.run(options("--minutes", "1", "--modes", "one", "--json"), tmp_path)
    assert not babbling.read_trials(tmp_path, "one")


def test_the_figure_shows_the_finished_trials(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("matplotlib")
    with pytest.raises(InvalidValue, match="no finished trial"):
        EXPERIMENT.method.figure(tmp_path)
    Trials(monkeypatch)
    EXPERIMENT.method.run(options("--modes", "off", "two", "--json"), tmp_path)
    assert EXPERIMENT.method.figure(tmp_path).read_bytes().startswith(b"\x89PNG")


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


def test_a_trial_is_measured_from_its_recordings(tmp_path: Path) -> None:
    left_by_a_trial(tmp_path)
    measured = measure(tmp_path, ROBOT, DT)
    assert measured.seconds == pytest.approx(TICKS * DT)
    assert measured.motor == ROBOT.motors[0]
    assert np.rad2deg(measured.beyond) == pytest.approx(2.0)
    assert [(touch.pair, touch.depth) for touch in measured.touches] == [("l_hand table", 0.004)]
    assert len(measured.commands) == 1
    assert (measured.lockstep.repeatable, measured.lockstep.states_sha256) == (True, "c0ffee")
    assert measured.jerk_squared == pytest.approx(0.0, abs=1e-9)


def test_ended_commands_are_in_the_log_and_an_incomplete_line_is_ignored(tmp_path: Path) -> None:
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


def test_beyond_a_limit_is_positive_and_inside_negative() -> None:
    q = np.array([[0.0, 0.5], [0.2, 1.25], [-1.5, 0.0]])
    limits = np.array([[-1.0, 1.0], [-1.0, 1.0]])
    assert np.allclose(beyond_limits(q, limits), [0.5, 0.25])
    assert np.allclose(beyond_limits(0.5 * q, limits), [-0.25, -0.375])


def test_the_jerk_of_a_cubic_is_constant() -> None:
    t = np.arange(10) * DT
    assert np.allclose(jerk(np.column_stack([t**3, -2.0 * t**3]), DT), [6.0, -12.0])


def test_the_23_motors_are_torso_head_and_arms_without_hands() -> None:
    moved = moved_motors(ROBOT)
    by_part = {name: int(((moved >= part.slice.start) & (moved < part.slice.stop)).sum()) for name, part in ROBOT.parts.items()}
    assert len(moved) == COUNT
    assert by_part == {"torso": 3, "head": 6, "left_arm": 7, "right_arm": 7}


def test_postures_fill_the_ranges_and_leave_the_hands_at_home() -> None:
    targets, moved = Targets(ROBOT, 1), moved_motors(ROBOT)
    q = np.array([targets.next() for _ in range(500)])
    lower, upper = ROBOT.limits[moved].T
    share = (q[:, moved] - lower) / (upper - lower)
    assert share.min() >= 0.0 and share.max() <= 1.0
    assert (share.min(axis=0) < 0.02).all() and (share.max(axis=0) > 0.98).all()
    still = np.setdiff1d(np.arange(len(ROBOT.motors)), moved)
    assert (q[:, still] == ROBOT.home[still]).all()


@given(start=angles, target=angles, speed=st.floats(0.05, 2.0))
def test_a_move_goes_from_start_to_target_within_its_speed(start: np.ndarray, target: np.ndarray, speed: float) -> None:
    move = PositionMove(start, target, np.full(3, speed))
    times = np.linspace(0.0, move.duration, 400)
    course = np.array([move.at(t) for t in times])
    assert np.array_equal(course[0], start)
    assert np.allclose(course[-1], target) and np.allclose(move.at(move.duration + 9.0), target)
    if move.duration > 0.0:
        assert np.abs(np.diff(course, axis=0)).max() / (times[1] - times[0]) <= speed * (1.0 + 1e-6)
    assert (np.diff(course, axis=0) * np.sign(target - start) >= -1e-12).all()


def test_the_path_counts_motion_back() -> None:
    assert path_length(np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 0.5]])) == pytest.approx(2.0)
