"""Agents on the live processes in lockstep, until they have made their transitions; what is made stays on disk."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from experiments.kit.live import LaunchFailed, summary_of
from experiments.transfer.settings import GAINS, JOINTS, RATE, ROBOT, TASKS
from mobee.store import STORE, TransitionStore

ROBOTS = {  # settings of robot_sim; PyBullet has physics of its own, its motors are what was identified
    "pybullet": {"backend": "pybullet", "motors": "published"},
    "kinematic": {"backend": "kinematic", "motors": "identified"},
}
_ACTION = 7.0  # s of robot time, a little more than the torso's take on average at the table
_PIECE = 200  # transitions a part of one launch
_TRIES = 3  # launches without a single new transition

_SCENARIO = """# Written by the experiment `transfer`.
title = "Learning on {robot}, to be compared with the offline plant"

[shared]
robot = "{model}"
world = "{world}"
gains = "{gains}"
seed = {seed}
mode = "lock"

[services.robot_sim]
backend = "{backend}"
motors = "{motors}"
rate = {rate}

[services.model]
[services.controller]
"""
_AGENT = """
[services.agent_{part}]
joints = {joints}
neighbours = {neighbours}
seed = {agent_seed}
run_dir = "{folder}"
transitions = {transitions}
"""


def learn(task: str, robot: str, seed: int, transitions: int, folder: Path, told: Callable[[int], None], piece: int = _PIECE) -> None:
    """Let every part of a task make that many transitions on one of the ROBOTS; goes on where an earlier call was broken off.

    `told`: called with the number that the slowest part has, before each launch of `piece` transitions a part.  Raises LaunchFailed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    idle = 0
    while (slowest := min((made := _made(folder, task)).values())) < transitions:
        told(slowest)
        more = min(transitions - slowest, piece)
        scenario = folder / "scenario.toml"
        # Each part makes as many more, also one that has enough: who had nothing to do would end before the run begins, and be waited for.
        scenario.write_text(_scenario(task, robot, seed, {part: made[part] + more for part in made}, slowest, folder.resolve()))
        summary_of(str(scenario), ticks=round(_ACTION * RATE * more), runs=folder / "launches")
        idle = 0 if min(_made(folder, task).values()) > slowest else idle + 1
        if idle == _TRIES:
            raise LaunchFailed(f"{folder}: {_TRIES} launches in a row made no transition; see their logs in {folder / 'launches'}")


def _made(folder: Path, task: str) -> dict[str, int]:
    """Transitions that each part has."""
    path = folder / STORE
    if not path.exists():
        return dict.fromkeys(TASKS[task].parts, 0)
    with TransitionStore(path, "", read_only=True) as store:
        return {part: len(store.load(part)) for part in TASKS[task].parts}


def _scenario(task: str, robot: str, seed: int, goals: Mapping[str, int], slowest: int, folder: Path) -> str:
    """The seed of robot and encoders differs from piece to piece, that of the agents, which their store holds, does not."""
    wanted = TASKS[task]
    text = _SCENARIO.format(
        robot=robot, model=ROBOT, world=wanted.world, gains=GAINS, rate=RATE, seed=1000 * seed + slowest, **ROBOTS[robot]
    )
    for part in wanted.parts:
        joints = str(list(JOINTS[part])).replace("'", '"')
        text += _AGENT.format(
            part=part, joints=joints, neighbours=wanted.neighbours[part], agent_seed=seed, folder=folder, transitions=goals[part]
        )
    return text
