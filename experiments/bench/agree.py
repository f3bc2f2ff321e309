"""Whether the live processes in lockstep and the offline plant, two programs, are one law.

Claim: on the motor model, encoder noise included, every action of three curious agents ends at the same tick, in the same state and
within 1e-9 rad of the same posture in both.  Run time: about 30 s for 100 actions.

What differs by construction: robot_sim has a safety gate, which brakes a motor that could not stop before its limit any more; the
plant has hard stops only.  No action of these agents gets there.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.live.launch import summary_of
from mobee import CuriousAgent, Gains, Lattice, Model, OfflinePlant, load_robot, load_world, run
from mobee.store import Transition, TransitionStore

TICK = 0.02  # s
ACTION = 2.2  # s of robot time between two ends of actions, at most: for the number of ticks
EXACT = 1e-9  # rad
PATIENCE = "shared.patience=20"  # s on the wall for a tick, as others may have the cores
AGENTS = {"torso": 8, "left_arm": 16, "right_arm": 16}  # part and neighbours, as published
JOINTS = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow")


@dataclass(frozen=True, slots=True)
class Agreement:
    """How two runs of the same agents compare, over the actions that both made."""

    actions: int
    worst: float  # rad, of where they ended
    same: bool  # states, ticks, settled or not, what was touched
    first_difference: str  # "" when there is none

    @property
    def passed(self) -> bool:
        """Whether it is one law."""
        return self.actions > 0 and self.same and self.worst <= EXACT


def lockstep(ticks: int, seed: int, folder: Path) -> tuple[dict[str, list[Transition]], dict[str, Any]]:
    """What the live agents observed in so many ticks, by part, and the summary of their run, which stays in the folder."""
    summary = summary_of("lockstep", [f"shared.seed={seed}", PATIENCE], ticks=ticks, runs=folder)
    file = Path(summary["run"]) / "transitions.sqlite"
    return {part: TransitionStore(file, part).load() for part in AGENTS}, summary


def offline(actions: int, seed: int, folder: Path) -> dict[str, list[Transition]]:
    """What the same agents observe on the offline plant, by part."""
    robot, world = load_robot("icub"), load_world("table")
    world.remove("ball")  # live, nobody sees it without cameras
    plant = OfflinePlant(Model(robot, world), seed=seed, gains=Gains.named("published_2014"), dt=TICK)
    file = folder / "offline.sqlite"
    agents = []
    for part, neighbours in AGENTS.items():
        names = robot.part(part).motors
        joints = [name for name in names if part == "torso" or name.endswith(JOINTS)]
        agents.append(CuriousAgent(Lattice(robot, joints, neighbours=neighbours), plant, seed=seed, store=TransitionStore(file, part)))
    run(agents, actions)
    return {part: TransitionStore(file, part).load() for part in AGENTS}


def compare(live: dict[str, list[Transition]], plant: dict[str, list[Transition]]) -> Agreement:
    """Over the actions that both made, in order."""
    worst, actions, first = 0.0, 0, ""
    for part in live:
        for ours, theirs in zip(live[part], plant[part], strict=False):
            actions += 1
            worst = max(worst, float(np.abs(np.subtract(ours.q, theirs.q)).max()))
            if not first and _seen(ours) != _seen(theirs):
                first = f"{part}, action {ours.n}: {_seen(ours)} live, {_seen(theirs)} offline"
    return Agreement(actions, worst, not first, first)


def measure(actions: int, seed: int, folder: Path) -> tuple[Agreement, dict[str, Any]]:
    """Run both, for about that many actions; the summary is the live run's.  Raises LaunchFailed."""
    live, summary = lockstep(round(actions * ACTION / TICK), seed, folder)
    made = sum(map(len, live.values()))
    return compare(live, offline(made + 2 * len(AGENTS), seed, folder)), summary  # those under way at the end were begun in both


def _seen(t: Transition) -> tuple[Any, ...]:
    return (t.s, t.a, t.s_next, t.settled, round(t.duration / TICK), t.touched)
