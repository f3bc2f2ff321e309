# SPDX-License-Identifier: Apache-2.0
"""kill -9 of each service while its parts move: which parts hold, how fast, and the remaining state."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator

import numpy as np
import pytest

from experiments.kit.live.launch import free_port
from services.common.rpc import CallFailed
from tests.system.live import AGENTS, PARTS, Launch, Watcher, running, transitions, until

pytestmark = pytest.mark.system

BY_LIVENESS, BY_AGE = 0.120, 0.160  # s of robot_sim's clock until it holds: token gone; or forces, then commands too old
STOPPED = 0.01  # rad/s


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Launch, Watcher]]:
    settings = [f"services.monitor.web_port={free_port()}"]
    with running(tmp_path_factory.mktemp("kill"), "default", *settings, headless=False) as pair:
        yield pair


@pytest.fixture(scope="module")
def made() -> dict[str, list[tuple[object, ...]]]:
    """The transitions on disk when robot_sim was back, after the last kill that holds the robot; none if it was not killed."""
    return {}


def kill(watcher: Watcher, who: str) -> tuple[int, int]:
    """kill -9; the tick at which it happened, and the pid that is no more."""
    pid = watcher.pid(who)
    watcher.wait_until_it_keeps_up()
    k = watcher.k
    os.kill(pid, signal.SIGKILL)
    return k, pid


def wait_back(watcher: Watcher, who: str, old_pid: int) -> None:
    def is_back() -> bool:
        try:
            return watcher.stat(who).pid != old_pid
        except CallFailed:  # no answer yet
            return False

    until(is_back, 20.0, f"{who} is back")


def all_continue(live: tuple[Launch, Watcher], before: dict[str, list[tuple[object, ...]]]) -> None:
    """Every agent's part moves again, and the transitions that were on disk before are still there, in order."""
    system, watcher = live
    watcher.wait_until_moved(AGENTS)
    after = transitions(system.run_dir)
    for agent in AGENTS:
        assert after[agent][: len(before[agent])] == before[agent]
        assert [row[0] for row in after[agent]] == list(range(1, len(after[agent]) + 1))


@pytest.mark.parametrize(("who", "limit"), [("controller", BY_LIVENESS), ("model", BY_AGE)])
def test_the_whole_robot_holds(live: tuple[Launch, Watcher], who: str, limit: float) -> None:
    system, watcher = live
    before = transitions(system.run_dir)
    until(lambda: any(watcher.speed(part) > 0.15 for part in AGENTS), 40.0, "a part moves")
    k, pid = kill(watcher, who)
    held, rested, turned = [], [], []
    for part in PARTS:
        first = until(lambda part=part: next((s for s in watcher.states[part] if s.k > k and s.gate == "hold"), None), 5.0, f"{part} holds")
        rest = until(
            lambda part=part: next((s for s in watcher.states[part] if s.k > k and max(map(abs, s.dq)) < STOPPED), None),
            5.0,
            f"{part} rests",
        )
        start = next(s for s in watcher.states[part] if s.k >= k)
        held.append((first.k - k) * 0.01)
        rested.append((rest.k - k) * 0.01)
        turned.append(float(np.abs(np.subtract(rest.q, start.q)).max()))
    degrees = np.rad2deg(turned)
    print(
        f"{who} killed (median, worst): holds after {np.median(held):.3f}, {max(held):.3f} s; at rest after {np.median(rested):.3f}, "
        f"{max(rested):.3f} s; stopping distance {np.median(degrees):.2f}, {max(degrees):.2f} deg"
    )
    assert max(held) <= limit
    assert max(rested) <= limit + 0.2  # 60 deg/s at 600 deg/s^2 is 0.1 s, and the motors' delay and lag
    wait_back(watcher, who, pid)
    all_continue(live, before)
    if who == "controller":
        for part in AGENTS:
            motions = watcher.motions[part]
            new = next(i for i, motion in enumerate(motions) if motion.k > k and not motion.action_id)  # it knows no action yet
            last, following = motions[new - 1], next(motion.action_id for motion in motions[new:] if motion.action_id)
            assert last.status != "moving" or following == last.action_id, f"the action of {part} was lost"


def test_an_agent_alone_stops_its_part(live: tuple[Launch, Watcher]) -> None:
    system, watcher = live
    before = transitions(system.run_dir)
    watcher.wait_moving(("left_arm",), 0.15)
    k, pid = kill(watcher, "agent_left_arm")
    gone = until(lambda: next((m for m in watcher.motions["left_arm"] if m.k > k and m.epoch == 0), None), 3.0, "the goal is nobody's")
    print(f"agent killed: its goal is dropped after {gone.k - k} ticks")
    assert np.allclose(gone.goal, gone.q, atol=np.deg2rad(1.5))  # q* is the measured q, of the same or the tick before
    end = gone.k + 15  # before its successor's start takes a core
    until(lambda: watcher.k > end, 3.0, "the others to continue")
    for part in ("torso", "right_arm"):
        assert all(m.status != "held" for m in watcher.motions[part] if k < m.k <= end)
    assert all(s.gate == "armed" for part in PARTS for s in watcher.states[part] if k < s.k <= end)
    wait_back(watcher, "agent_left_arm", pid)
    all_continue(live, before)


def test_robot_sim_starts_again_at_home_as_a_new_run(live: tuple[Launch, Watcher], made: dict[str, list[tuple[object, ...]]]) -> None:
    system, watcher = live
    before = transitions(system.run_dir)
    until(lambda: any(watcher.speed(part) > 0.15 for part in AGENTS), 40.0, "a part moves")
    run = watcher.run
    _, pid = kill(watcher, "robot_sim")
    until(lambda: watcher.run not in ("", run), 20.0, "a new run")
    first = until(lambda: next((s for s in watcher.states["left_arm"] if s.run == watcher.run), None), 5.0, "its first state")
    assert first.gate in ("idle", "hold")
    assert max(map(abs, first.dq)) < 0.05
    wait_back(watcher, "robot_sim", pid)
    all_continue(live, before)
    made.update(transitions(system.run_dir))


@pytest.mark.parametrize("who", ["vision", "renderer", "monitor"])
def test_observers_cause_no_hold(live: tuple[Launch, Watcher], who: str) -> None:
    """A stall of the machine may hold the robot at any time; a dependence on the one killed would at every kill."""
    _, watcher = live
    held = []
    for _ in range(3):
        until(lambda: all(watcher.states[part][-1].gate == "armed" for part in PARTS), 20.0, "every part obeys")
        until(lambda: any(watcher.speed(part) > 0.1 for part in AGENTS), 40.0, "a part moves")
        before, run = watcher.k, watcher.run
        _, pid = kill(watcher, who)
        wait_back(watcher, who, pid)
        held.append(sum(s.gate != "armed" for part in PARTS for s in watcher.states[part] if s.run == run and s.k > before))
        if not held[-1]:
            return
    raise AssertionError(f"states in hold after each kill of {who}: {held}")


def test_after_all_kills_every_agent_learns_on(live: tuple[Launch, Watcher], made: dict[str, list[tuple[object, ...]]]) -> None:
    """Since robot_sim was back: while the observers are killed, the actions continue, which take seconds."""
    system, _ = live
    before = made or transitions(system.run_dir)
    until(
        lambda: all(len(after) > len(before[agent]) for agent, after in transitions(system.run_dir).items()),
        90.0,
        "one more transition of each agent",
    )
    all_continue(live, before)
