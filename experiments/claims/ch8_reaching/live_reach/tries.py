# SPDX-License-Identifier: Apache-2.0
"""Tries on the live robot: the job of a launch (one run of the live system), the record of each try, and its measures.

The measures are computed from the simulator's joint positions.

    python -m experiments.claims.ch8_reaching.live_reach.tries

simulates reaches on the offline plant, for minutes.  For each of the thesis' 27 targets that the palm can touch, it prints the distance of
the palm from the target's surface after the best reach, and, if this reach misses, the contacts at its end.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Literal

import numpy as np
from msgspec import Struct

from experiments.claims.ch8_reaching.live_reach.problems import (
    MIN_DEPTH,
    SUCCESS_DISTANCE,
    Problem,
    belief,
    grid_targets,
    offline_plant,
    robot,
    space,
    touchable,
)
from experiments.kit.control.plant_runs import place
from experiments.kit.live.launch import read_done
from experiments.kit.live.system import CONTACTS, POSITIONS, Touch, read_touches
from experiments.kit.reaching.arm import MARKER, PART
from experiments.kit.run_folder import decoded, encoded
from mobee import Model, OfflinePlant
from mobee.arrays import Array
from mobee.reach import RADIUS, ReachTarget

BLOCK = "block.json"
STILL = 20  # ticks before a request in which the motion of joints at rest is measured
MOVED = 1e-5  # rad beyond the motion at rest, from which a joint moves
NAMED_CONTACTS = 2  # the deepest contacts, which a miss names

Kind = Literal["refine", "learner", "peer", "offline", "moving", "first motion"]


class Job(Struct, frozen=True):
    """A block of tries in one launch of the live system.

    `kind`: the contestant, which makes the tries.  "learner": the learner; "offline": the learner on the offline plant; "moving": the
    learner, while a target or an obstacle moves; "peer": the planner; "first motion": single reaches, timed; "refine": the learner
    continues to learn.  `seed`: of the contestant.  `problems`: targets that are tried, with the first postures of the arm.
    """

    kind: Kind
    seed: int
    store: str
    """The path of the file with the learned transitions and reaches."""
    problems: list[Problem] = []
    tries: int = 0
    """The number of tries that the learner has made, offline and live, when a block of the kind "refine" ends."""


class Tried(Struct, frozen=True):
    """The record of one try by the learner, the planner or a single reach; times are ticks of the simulator (service robot_sim).

    `kind`, `number`: of the `Problem` (target and first posture).  `out`: tick at which the arm started towards its first posture.
    `begin`: tick at which the target was presented.  `ends`: ticks at which reaches ended; of the planner, ticks at which it measured its
    remaining distance from the target.  `over`: tick at which the arm was at rest again.  `off`: largest error of a joint in the first
    posture, rad.  `actions`: number of actions, reaches included.  `believed`: distance of the palm from the target's surface at the end,
    by the encoders, m.  `thinking`: processor time for plans, s.  `why`: reason if the try ended without a reach.  `asked`: tick of the
    last request that was sent to the arm.  `there`: position of a moving target at the last tick in `ends`, m; None: the target is at rest.
    `first`: ticks from `asked` to the first command that moves the arm; -1: not timed.
    """

    kind: str
    number: int
    out: int
    begin: int
    ends: list[int]
    over: int
    off: float
    actions: int
    believed: float
    thinking: float
    why: str = ""
    asked: int = 0
    there: list[float] | None = None
    first: int = -1


class Judged(Struct, frozen=True):
    """The measures of one try, computed from the simulator's joint positions.

    `kind`, `number`: of the `Problem` (target and first posture).  `position`: of the target's centre, m, root frame.  `off`: distance of
    the palm from the target's surface at the end of the try (of its last reach, or of the planner's last motion), m.  `success`: whether
    this is at most 2 cm.  `seconds`: robot time from the presentation of the target to the end of the try.  `actions`: number of actions,
    including the `reaches`.  `thinking`: processor time for plans, s.  `deep`: contacts of solids deeper than 2 mm.  `begun_off`: largest
    error of a joint in the first posture, rad.  `why`: reason if the try was interrupted.  `first`: ticks from the last request
    (`Tried.asked`) to the first command that moves the arm; `first_motion`: ticks from that request to the first motion of a joint; -1: not
    timed.
    """

    kind: str
    number: int
    position: list[float]
    off: float
    success: bool
    seconds: float  # robot time from the presentation to that moment
    actions: int
    reaches: int
    thinking: float
    deep: list[Touch]  # contacts of solids deeper than 2 mm, from the start at home until the arm is at rest again
    begun_off: float
    why: str
    first: int
    first_motion: int


class Block(Struct, frozen=True):
    """All tries of one job with their measures.

    `kind`: as in `Job`.  `rate`: ticks per second.  `seconds`: robot time of the launch.  `repeatable`: whether the run can be repeated
    exactly.  `deep`: contacts of solids deeper than 2 mm in the whole launch.
    """

    kind: str
    rate: float
    seconds: float
    repeatable: bool
    tries: list[Judged]
    deep: list[Touch]


def measure(folder: Path, job: Job, rate: float, repeatable: bool) -> Block:
    """Return the block of a finished launch: the measures of its tries, in order, computed from the records in its folder.

    A launch is one run of the system, in which the tries of `job` were made.  `rate`: ticks per second [Hz].  `repeatable`: whether the
    launch can be repeated exactly.
    """
    q = np.fromfile(folder / POSITIONS).reshape(-1, len(robot().motors))
    deep = [touch for touch in read_touches(folder / CONTACTS, 1.0 / rate) if touch.depth > MIN_DEPTH]
    done = read_done(folder, Tried)
    problems = {(problem.kind, problem.number): problem for problem in job.problems}
    model = Model(robot())
    judged = [judge(tried, np.array(tried.there or problems[tried.kind, tried.number].position), q, deep, model, rate) for tried in done]
    return Block(job.kind, rate, len(q) / rate, repeatable, judged, deep)


def judge(tried: Tried, position: Array, q: Array, deep: list[Touch], model: Model, rate: float) -> Judged:
    """Return the measures of one try, such as its success.

    `tried`: record of the try.  `position`: of the target's centre (3,) m.  `q`: (T, n) rad, joint positions of the simulator; those at
    the beginning of tick k are in row k - 2.  `deep`: contacts of solids deeper than 2 mm in the launch.  `model`: of the robot; it
    computes the position of the palm.  `rate`: ticks per second.
    """
    off = np.inf
    if tried.ends:
        palm = model.evaluate(q[tried.ends[-1] - 2]).position(MARKER)
        off = max(0.0, float(np.linalg.norm(palm - position)) - RADIUS)
    return Judged(
        kind=tried.kind,
        number=tried.number,
        position=position.tolist(),
        off=off,
        success=off <= SUCCESS_DISTANCE,
        seconds=(tried.ends[-1] - tried.begin) / rate if tried.ends else 0.0,
        actions=tried.actions,
        reaches=len(tried.ends),
        thinking=tried.thinking,
        deep=[touch for touch in deep if tried.out <= touch.begin <= tried.over],
        begun_off=tried.off,
        why=tried.why,
        first=tried.first,
        first_motion=_first_motion(q, tried.asked) if tried.first >= 0 else -1,
    )


def _first_motion(q: Array, asked: int) -> int:
    """Return the ticks from a request in tick `asked` to the first tick in which a joint of the arm moves; -1 if none moves.

    A joint moves if its distance from its position before the request exceeds MOVED plus the largest range of a joint while the arm was at
    rest.  `q`: joint positions (T, n) rad, as in `judge`.
    """
    arm = q[:, robot().parts[PART].slice]
    before, after = arm[asked - STILL : asked], arm[asked:]
    bound = MOVED + np.ptp(before, axis=0).max()
    moved = np.abs(after - before[-1]).max(axis=1) > bound
    return int(np.argmax(moved)) + 1 if moved.any() else -1


def write_block(folder: Path, block: Block) -> None:
    """Write a block to the file block.json in the folder, completely or not at all."""
    new = (folder / BLOCK).with_suffix(".new")
    new.write_text(encoded(block, indent=1))
    new.replace(folder / BLOCK)


def read_block(folder: Path) -> Block:
    """Read the block (all tries of one job with their measures) that `write_block` has written to the folder."""
    return decoded((folder / BLOCK).read_text(), Block)


def nearest_reach(plant: OfflinePlant, target: ReachTarget) -> tuple[float, str]:
    """Simulate a reach for the target from every state, and return the smallest remaining error [m] and the contacts at its end.

    The contacts are the deepest two, as text with the names of both volumes and the depth in mm.  The search stops at the first reach that
    ends within 2 cm of the surface.
    """
    best, ending = np.inf, plant.robot.home
    arm = plant.robot.part(PART).slice
    for state in range(len(space())):
        whole = plant.robot.home.copy()
        whole[arm] = space().target(state)
        plant.present(None)
        place(plant, whole)
        plant.present(target)
        made = plant.reach(PART, MARKER, stay=True)
        if made.missing < best:
            best, ending = made.missing, whole.copy()
            ending[arm] = made.q
        if best <= SUCCESS_DISTANCE:
            break
    return best, _contacts(plant, ending)


def _contacts(plant: OfflinePlant, q: Array) -> str:
    """Return the two deepest contacts in the pose `q` (n,) rad as text, each with the names of both volumes and the depth [mm].

    As in a reach, contacts of the hand with the target are left out.
    """
    contacts = sorted(plant.model.evaluate(q, reaching=MARKER).contacts, key=lambda contact: -contact.depth)
    return ", ".join(f"{one.first} {one.second} {1e3 * one.depth:.0f}" for one in contacts[:NAMED_CONTACTS])


def main() -> None:
    """Simulate reaches for the thesis' targets that the palm can touch, and print a Markdown table with the best reach for each.

    A row has the number of the target, its position [m], the distance [mm] of the palm from its surface after the best reach, and the
    contacts there if this reach missed.
    """
    known, plant = belief(), offline_plant(0)
    lines = ["| target | x | y | z | best reach [mm] | contacts there [mm] |", "| --- | --- | --- | --- | --- | --- |"]
    for number, target in enumerate(grid_targets()):
        if touchable(known, target):
            off, contacts = nearest_reach(plant, target)
            where = " | ".join(f"{x:.1f}" for x in target.position)
            lines.append(f"| {number} | {where} | {1e3 * off:.0f} | {contacts if off > SUCCESS_DISTANCE else ''} |")
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
