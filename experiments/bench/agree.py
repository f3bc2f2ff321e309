# SPDX-License-Identifier: Apache-2.0
"""Compares the live system in lockstep with the offline plant: both must compute the same motions.

Claim: on the motor model, encoder noise included, every action of three curious agents ends at the same tick, in the same state and within
1e-9 rad of the same posture in both.  Run time: about 30 s for 100 actions.

The live system consists of real processes, which exchange messages; in lockstep every tick waits for all of them.  The offline plant
simulates the robot in one process.  The motor model simulates motors without a physics engine.

One difference is by design: robot_sim has a safety gate, which brakes a motor that could not stop before its limit; the plant has hard
stops only.  No action of these agents moves a motor so near to a limit that the gate brakes.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.live.launch import summary_of
from mobee import CuriousAgent, Gains, Lattice, Model, OfflinePlant, load_robot, load_world, run
from mobee.store import Transition, TransitionStore

TICK = 0.02  # s
ACTION_SECONDS = 2.2  # s of robot time between two ends of actions, at most: for the number of ticks
MAX_DIFFERENCE = 1e-9  # rad
PATIENCE = "shared.patience=20"  # s of wall time for a tick, as other programs may use the cores
AGENTS = {"torso": 8, "left_arm": 16, "right_arm": 16}  # part and neighbours, as published
JOINTS = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow")


Observed = Mapping[str, Sequence[Transition]]  # of each part


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of the benchmark.

    `actions`: approximate number of actions that are compared, of all agents together.  `seed`: seed of the agents and of the encoder
    noise.
    """

    actions: int = 100
    seed: int = 0


@dataclass(frozen=True, slots=True)
class Agreement:
    """Comparison of a live run and an offline run of equal agents, over the actions that occur in both runs.

    `actions`: number of compared actions.  `worst`: largest difference of a motor's position at the end of an action [rad].  `same`:
    whether states, actions, numbers of ticks and touched objects are equal, and the same actions timed out.  `first_difference`: text about
    the first action in which these differ; "" if all are equal.
    """

    actions: int
    worst: float  # rad, between the postures in which they ended
    same: bool  # states, ticks, settled or not, objects touched
    first_difference: str  # "" when there is none

    @property
    def passed(self) -> bool:
        """Whether both runs made the same motions, with postures equal within MAX_DIFFERENCE (1e-9 rad)."""
        return self.actions > 0 and self.same and self.worst <= MAX_DIFFERENCE


def lockstep(ticks: int, seed: int, folder: Path) -> tuple[dict[str, list[Transition]], dict[str, Any]]:
    """Run three live agents in lockstep (every tick waits for all participants) for `ticks` ticks.

    Returns the transitions of each part, by its name, and the launcher's summary of the run.  The files of the run are in a new folder in
    `folder`.  `seed`: seed of the agents and of the encoder noise.
    """
    summary = summary_of("lockstep", [f"shared.seed={seed}", PATIENCE], ticks=ticks, runs=folder)
    file = Path(summary["run"]) / "transitions.sqlite"
    return {part: TransitionStore(file, part).load() for part in AGENTS}, summary


def offline(actions: int, seed: int, folder: Path) -> dict[str, list[Transition]]:
    """Run three agents, with the settings of those in `lockstep`, on the offline plant for `actions` actions in all.

    Returns a dict from the name of a part to its transitions.  The file of the transitions is in `folder`.  `seed`: of plant and agents.
    """
    robot, world = load_robot("icub"), load_world("table")
    world.remove("ball")  # live, it is not seen without cameras
    plant = OfflinePlant(Model(robot, world), seed=seed, gains=Gains.named("published_2014"), dt=TICK)
    file = folder / "offline.sqlite"
    agents = []
    for part, neighbours in AGENTS.items():
        names = robot.part(part).motors
        joints = [name for name in names if part == "torso" or name.endswith(JOINTS)]
        agents.append(CuriousAgent(Lattice(robot, joints, neighbours=neighbours), plant, seed=seed, store=TransitionStore(file, part)))
    run(agents, actions)
    return {part: TransitionStore(file, part).load() for part in AGENTS}


def compare(live: Observed, plant: Observed) -> Agreement:
    """Compare the n-th action of each part in a live run with its n-th action in an offline run, for all n that both runs have.

    `live`, `plant`: the transitions of both runs, by the name of the part.
    """
    worst, actions, first = 0.0, 0, ""
    for part in live:
        for ours, theirs in zip(live[part], plant[part], strict=False):
            actions += 1
            worst = max(worst, float(np.abs(np.subtract(ours.q, theirs.q)).max()))
            if not first and _outcome(ours) != _outcome(theirs):
                first = f"{part}, action {ours.n}: {_outcome(ours)} live, {_outcome(theirs)} offline"
    return Agreement(actions, worst, not first, first)


def measure(settings: Settings) -> dict[str, Any]:
    """Run the agents live and offline, and return the comparison; raises LaunchFailed if the live system does not run.

    Keys: the fields of `Agreement`, such as "actions" (number of compared actions) and "worst" (largest difference of a motor's position at
    the end of an action [rad]); "passed", whether both runs made the same motions, up to 1e-9 rad; "lockstep", the part of the live run's
    summary about lockstep.
    """
    with tempfile.TemporaryDirectory() as folder:
        live, summary = lockstep(round(settings.actions * ACTION_SECONDS / TICK), settings.seed, Path(folder))
        count = sum(map(len, live.values())) + 2 * len(AGENTS)  # the actions that were under way at the end were begun in both
        agreement = compare(live, offline(count, settings.seed, Path(folder)))
    return {**asdict(agreement), "passed": agreement.passed, "lockstep": summary["lockstep"]}


def report(result: Mapping[str, Any]) -> str:
    """Return the result of `measure` as two lines of text."""
    first = result["first_difference"] or "in the same ticks and states, settled or not, touching the same objects"
    return f"{result['actions']} actions: they end within {result['worst']:.1e} rad of each other in lockstep and offline\n{first}"


def _outcome(t: Transition) -> tuple[Any, ...]:
    return (t.s, t.a, t.s_next, t.settled, round(t.duration / TICK), t.touched)
