# SPDX-License-Identifier: Apache-2.0
"""Compare an agent that has learned to reach for targets (the learned reacher) with a planner on the live robot, in lockstep.

Claim: a learned reacher that was trained offline and refined live brings the palm from random poses to within 2 cm of a target's surface:
for at least 95 % of the reachable ones among the thesis' 27 targets, and for 90 % of new random targets, without a solid contact deeper
than 2 mm.  Source: aim of this reproduction (thesis 8, 9.3).  Published: no number.  Run time: 10 to 25 minutes per start on 2 cores.

Seven joints of the right arm of the robot `icub` move at its table, under the default control law, with ticks of 20 ms; PyBullet (with
--backend mujoco: MuJoCo) simulates the robot, with gravity.  In each start (independent repetition) a learner (`ReachAgent` with predictor
"gp", strategy "ucb" and failures "alike") makes 3000 curious transitions (actions for information gain, without a target) and 800 tries of
the 27 targets on the offline plant (simulation in one process) with the identified motors, then 54 live tries.  Then, without learning, it
tries each of the 27 and 50 new targets, each from another pose, with up to three reaches per try.  The planner ("peer": inverse kinematics
and RRT-Connect, with a new plan after every change) has the same targets, poses and robot, and the true model; the target exerts no force
while the planner moves the arm, because the planner avoids it.  The learner also tries 8 targets that move back and forth over 15 cm at 3
cm/s, and 8 targets at rest, while a ball with a diameter of 8 cm crosses the hand's path at the same speed.  The ball is in the model and
in the simulator.

A target can be reached if inverse kinematics finds a pose within limits and cables, with the palm within 2 cm of the surface, in which the
only contact of solids is that of hand and target (experiments/kit/reaching/README.md shows which).  All new targets can be reached.  A try
is judged by the simulator's joint positions, not the encoders: by the position of the palm when the force of the reach ended, or when the
planner had finished.  The learner makes the same tries on the offline plant too.  The time to the first motion is measured with ticks of 2
ms, from the tick of the request to the first tick with another command.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from experiments.claims.ch8_reaching.live_reach.contestants import learned_offline
from experiments.claims.ch8_reaching.live_reach.problems import (
    AIM,
    FRESH,
    GRID,
    OBSTACLE_MOVES,
    RATE,
    SUCCESS_DISTANCE,
    TARGET_MOVES,
    TRANSITIONS,
    belief,
    fresh_problems,
    grid_problems,
    grid_targets,
    moving_problems,
    offline_plant,
    touchable,
    train,
)
from experiments.claims.ch8_reaching.live_reach.tries import BLOCK, Block, Job, Judged, measure, nearest_reach, read_block, write_block
from experiments.kit.command_line import Progress, positive_whole
from experiments.kit.experiment import OUR_AIM, Experiment, Measured, Steps, claim, judged
from experiments.kit.live.launch import PHYSICS, TABLE, add_backend, launch, write_job
from experiments.kit.live.system import POSITIONS
from experiments.kit.plots import new_figure, saved
from experiments.kit.rules import decides
from experiments.kit.statistics import LEVEL, interval, share_interval
from mobee.errors import InvalidValue
from mobee.reach import ReachTarget
from mobee.roadmap.ompl import require_ompl
from mobee.store import STORE

TRIES, LIVE_TRIES, FRESH_TARGETS, MOVING_OBJECTS = 800, 54, 50, 8
TRIES_PER_LAUNCH = 27
FAST_RATE, TIMED_REACHES = 500.0, 10  # Hz of the launch in which first motions are timed, and their number
CONTESTANTS, OFFLINE, MOVING = ("learner", "peer"), "offline", "moving"
NAMES = {"learner": "learned reacher", "peer": "IK + RRT-Connect through MoBeE", OFFLINE: "learned reacher, offline plant"}
MIN_SUCCESS = {GRID: 0.95, FRESH: 0.9}
WORSE = 0.05  # of success, by which the learner may be below the planner
SAME = 0.05  # of success, within which live and offline tries are equivalent
MAX_FIRST_MOTION = 5e-3  # s
MIN_TRIES = 20  # from which there is a verdict
COLORS = {"learner": "tab:red", "peer": "tab:blue"}
TITLES = {GRID: "those of the 27 targets that can be reached", FRESH: "new random targets"}

WITH_OBSTACLE = Path(__file__).with_name("obstacle.xml")
MAX_TRY = 120.0  # s of robot time for a try, on average over a block

PERFORM = "experiments.claims.ch8_reaching.live_reach.contestants:perform"


@dataclass(frozen=True)
class Sizes:
    """The numbers of tries in one start (independent repetition) of the experiment, in which one learner is trained and tested.

    `transitions`: curious transitions before the first target.  `tries`: offline tries of the 27 targets.  `live`: live tries while the
    learner still learns.  Targets that are tried without learning: `grid`, of the thesis; `fresh`, new ones; `moving`, new ones that move,
    and as many with a moving obstacle.  `timed`: reaches whose first motion is timed.
    """

    transitions: int = TRANSITIONS
    tries: int = TRIES
    live: int = LIVE_TRIES
    grid: int = 27
    fresh: int = FRESH_TARGETS
    moving: int = MOVING_OBJECTS
    timed: int = TIMED_REACHES


QUICK = Sizes(500, 30, 2, 2, 2, 1, 2)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options --starts, --quick and --backend."""
    add_backend(parser)
    parser.add_argument(
        "--starts", type=positive_whole, default=3, metavar="N", help="learners, each with other poses and new targets (default: 3)"
    )
    parser.add_argument("--quick", action="store_true", help="a short version that shows whether it works")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Train the learners offline, refine them live, let learner and planner try to reach the targets, and return the results.

    The tries are made in blocks, one block for each launch of the live system or each job offline; blocks that are already in the folder
    are not repeated.  Raises OmplMissing before the first block.
    """
    require_ompl()
    sizes, starts = QUICK if arguments.quick else Sizes(), 1 if arguments.quick else arguments.starts
    with Progress() as progress:
        for number in range(starts):
            seed, place = arguments.seed + number, folder / f"start-{number}"
            place.mkdir(exist_ok=True)
            progress.show(number / starts, f"start {number + 1} of {starts}: learning offline")
            train(place / STORE, seed, sizes.transitions, sizes.tries)
            jobs = list(_jobs(place, seed, sizes))
            for done, (name, job, rate) in enumerate(jobs):
                progress.show((number + done / len(jobs)) / starts, f"start {number + 1} of {starts}: {name}")
                _do(place / name, job, seed, rate, arguments.backend)
    return results(folder)


def judged_claims(folder: Path) -> dict[str, Any]:
    """Return the judged claims under "claims", computed from the finished blocks in the folder of a run."""
    return {"claims": judged(CLAIMS, Runs(_blocks(folder), _touchable(), _left()))}


def results(folder: Path) -> dict[str, Any]:
    """Return the claims and the tables, computed from the finished blocks (all tries of one job) in the folder of a run.

    Keys: "claims", a list with the judged claims, as dicts (`Claim.record`); "tries", a list with the rows of `table`; "missed", a list
    with the rows of `misses`; "targets that can be reached" and "targets that the robot's own fields keep the palm from", lists of their
    numbers; "repeatable", whether all runs in which nothing is moved can be repeated exactly.  To explain each missed try of the learner,
    reaches from all states are simulated offline.
    """
    blocks, known, left = _blocks(folder), _touchable(), _left()
    return {
        **judged_claims(folder),
        "tries": table(blocks, known),
        "missed": misses(blocks, known, _why),
        "targets that can be reached": sorted(known),
        "targets that the robot's own fields keep the palm from": sorted(known - left),
        "repeatable": all(block.repeatable for block in blocks if block.kind != "moving"),  # objects are moved from outside the lockstep
    }


def _jobs(place: Path, seed: int, sizes: Sizes) -> Iterator[tuple[str, Job, float]]:
    """Yield the jobs of one start (independent repetition of the experiment) in the order in which they are performed.

    Each item is the name of the job's folder, the job, and the rate of the simulator in ticks per second.  `place`: the start's folder.
    """
    store = str((place / STORE).resolve())
    grid, fresh = grid_problems(seed)[: sizes.grid], fresh_problems(seed, sizes.fresh)
    for first in range(0, sizes.live, TRIES_PER_LAUNCH):
        yield f"refine-{first:03}", Job("refine", seed, store, tries=sizes.tries + min(first + TRIES_PER_LAUNCH, sizes.live)), RATE
    pieces = [grid, *(fresh[i : i + TRIES_PER_LAUNCH] for i in range(0, len(fresh), TRIES_PER_LAUNCH))]
    for contestant in ("learner", "offline", "peer"):
        for number, piece in enumerate(pieces):
            yield f"{contestant}-{number}", Job(contestant, seed, store, piece), RATE
    yield "moving", Job("moving", seed, store, moving_problems(seed, sizes.moving)), RATE
    yield "first", Job("first motion", seed, store, fresh[: sizes.timed]), FAST_RATE


def _do(folder: Path, job: Job, seed: int, rate: float, backend: str) -> None:
    if (folder / BLOCK).exists():
        return
    if job.kind == "offline":
        folder.mkdir(exist_ok=True)
        write_block(folder, learned_offline(job))
    else:
        repeatable = perform(folder, job, seed, rate, backend)
        write_block(folder, measure(folder, job, rate, repeatable))
        (folder / POSITIONS).unlink()


@cache
def _nearest(place: tuple[float, float, float]) -> tuple[float, str]:
    """Return the smallest remaining error [m] of a reach from any state on the offline plant, and the contacts at its end as text.

    `place`: position of the target's centre [m], root frame.  See `nearest_reach`.
    """
    return nearest_reach(offline_plant(0), ReachTarget(np.array(place), aim=AIM))


def _why(place: tuple[float, float, float]) -> str:
    off, contacts = _nearest(place)
    text = f"offline the best reach from any state ends {1e3 * off:.0f} mm from the surface"
    return text + (f", with the contacts {contacts} mm" if off > SUCCESS_DISTANCE else "")


def _blocks(folder: Path) -> list[Block]:
    blocks = [read_block(path.parent) for path in sorted(folder.glob(f"start-*/*/{BLOCK}"))]
    if not blocks:
        raise InvalidValue(f"{folder} has no finished block: continue the run with --resume.")
    return blocks


def _touchable() -> frozenset[int]:
    """Return the indices of the reachable targets among the 27."""
    known = belief()
    return frozenset(number for number, target in enumerate(grid_targets()) if touchable(known, target))


def _left() -> frozenset[int]:
    """Return the indices of the reachable targets from which the robot's own fields do not keep the palm."""
    targets = grid_targets()
    return frozenset(number for number in _touchable() if _nearest(tuple(targets[number].position.tolist()))[0] <= SUCCESS_DISTANCE)


def perform(folder: Path, job: Job, seed: int, rate: float = RATE, backend: str = PHYSICS[0]) -> bool:
    """Launch a live system that performs one job, and records every tick in the folder; returns whether the run is repeatable.

    `job`: a block of tries (see `Job`).  `seed`: of the simulated robot.  `rate`: ticks per second.  `backend`: physics engine.  Raises
    LaunchFailed if the live system fails or does not end in time.
    """
    write_job(folder, job)
    world, seconds = WITH_OBSTACLE if job.kind == "moving" else TABLE, MAX_TRY * max(1, len(job.problems) + job.tries)
    names: dict[str, Any] = {"title": f"Reaching with {backend}: {job.kind}", "world": str(world), "simulator": {"backend": backend}}
    summary = launch(folder, PERFORM, seed=seed, rate=rate, speed=1.0, seconds=seconds, **names)
    return bool(summary["lockstep"]["repeatable"])


def tries_of(blocks: Sequence[Block], contestant: str, kind: str, numbers: frozenset[int] | None = None) -> list[Judged]:
    """Return all tries of a contestant on one kind of target, or with `numbers` only the tries of targets with these numbers.

    `contestant`: kind of the blocks, as "learner" or "peer" (the planner); a block has all tries of one `Job`.  `kind`: "grid", "fresh",
    "target moves" or "obstacle moves".
    """
    found = [tried for block in blocks if block.kind == contestant for tried in block.tries if tried.kind == kind]
    return [tried for tried in found if numbers is None or tried.number in numbers]


def share(tries: Sequence[Judged]) -> str:
    """Return the number of successes and the 95 % interval of their share (Wilson) as text; "none" without tries."""
    made = sum(tried.success for tried in tries)
    if not tries:
        return "none"
    low, high = share_interval(made, len(tries), LEVEL)
    return f"{made} of {len(tries)}, {made / len(tries):.2f} [{low:.2f}, {high:.2f}]"


def enough(tries: Sequence[Judged], least: float) -> bool | None:
    """Return whether the interval of the share of successes is above `least` (True), below (False), or contains it (None).

    None also for fewer than 20 tries.
    """
    if len(tries) < MIN_TRIES:
        return None
    return decides(share_interval(sum(tried.success for tried in tries), len(tries)), least=least)


@dataclass(frozen=True)
class Runs:
    """The finished blocks (each with all tries of one job), and which of the thesis' 27 targets can be reached, by number.

    `touchable`: targets for which inverse kinematics finds a valid pose with the palm within 2 cm of the surface.  `left`: those of them to
    which a reach of the offline plant comes as near.  From the others in `touchable`, the robot's own repulsive fields keep the palm away.
    """

    blocks: Sequence[Block]
    touchable: frozenset[int]
    left: frozenset[int]

    def tries(self, contestant: str, kind: str) -> list[Judged]:
        """Return the tries of a contestant on one kind of target, "grid" or "fresh"; of "grid" only targets that can be reached."""
        return tries_of(self.blocks, contestant, kind, self.touchable if kind == GRID else None)

    def learning(self) -> list[Block]:
        """Return the blocks of the learner's live tries for targets at rest: those in which it learned, and those of the test."""
        return [block for block in self.blocks if block.kind in ("refine", "learner")]


_LIVE = "on the live robot the learned reacher"
_SURFACE = f"{_LIVE} brings the palm within 2 cm of the surface of"


@claim(
    OUR_AIM,
    f"{_SURFACE} those of the thesis' 27 targets that can be reached, from random poses: share of tries",
    "at least 0.95",
)
def reaches_grid(runs: Runs) -> Measured:
    grid = runs.tries("learner", GRID)
    apart = (
        f"for the {len(runs.left)} from which the robot's own fields do not keep the palm "
        f"{share(tries_of(runs.blocks, 'learner', GRID, runs.left))}; for all 27 {share(tries_of(runs.blocks, 'learner', GRID))}"
    )
    return f"{share(grid)} for {len(runs.touchable)} targets; {apart}", enough(grid, MIN_SUCCESS[GRID])


@claim(OUR_AIM, f"{_SURFACE} new random targets: share of tries", "at least 0.90")
def reaches_new(runs: Runs) -> Measured:
    fresh = runs.tries("learner", FRESH)
    return share(fresh), enough(fresh, MIN_SUCCESS[FRESH])


@claim(OUR_AIM, f"{_LIVE} causes no contact of solids deeper than 2 mm while it reaches for targets at rest", "0")
def harmless(runs: Runs) -> Measured:
    deep = [touch for block in runs.learning() for touch in block.deep]
    hours = sum(block.seconds for block in runs.learning()) / 3600.0
    worst = f"deepest {1e3 * max(touch.depth for touch in deep):.1f} mm ({max(deep, key=lambda t: t.depth).pair}), " if deep else ""
    judgeable = len(runs.tries("learner", GRID)) + len(runs.tries("learner", FRESH)) >= MIN_TRIES
    return f"{len(deep)}, {worst}in {hours:.1f} h of robot time", not deep if judgeable else None


@claim(OUR_AIM, "on the live robot a reach begins to move within 5 ms of the request, on robot_sim's clock", "at most 5 ms")
def quick(runs: Runs) -> Measured:
    timed = [block for block in runs.blocks if block.kind == "first motion"]
    first = [1e3 * tried.first / block.rate for block in timed for tried in block.tries if tried.first > 0]
    if not first:
        return "none", None
    tick = min(1e3 / block.rate for block in timed)
    text = f"at most {max(first):g} ms to the first command that moves ({len(first)} reaches, ticks of {tick:g} ms)"
    return text, max(first) <= 1e3 * MAX_FIRST_MOTION


@claim(OUR_AIM, f"{_LIVE} is no worse than inverse kinematics and RRT-Connect (at most {100 * WORSE:.0f} points of success below)", "-")
def no_worse(runs: Runs) -> Measured:
    """Return the successes of learner and planner in the same tries as text, and the verdict; None (undecided) for fewer than 20 tries."""
    rivals = {name: runs.tries(name, GRID) + runs.tries(name, FRESH) for name in CONTESTANTS}
    learner, peer = (np.array([tried.success for tried in made]) for made in rivals.values())
    text = "; ".join(f"{NAMES[contestant]} {share(made)}" for contestant, made in rivals.items())
    if len(learner) < MIN_TRIES or len(learner) != len(peer):
        return text, None
    lead = learner.astype(float) - peer.astype(float)
    return text, decides(interval(lead, lambda drawn: np.asarray(drawn.mean(axis=-1))), least=-WORSE)


@claim(
    OUR_AIM,
    f"{_LIVE} succeeds as often as on the offline plant, from the same poses: difference of the shares of tries within {SAME}",
    "equivalent",
)
def as_offline(runs: Runs) -> Measured:
    made = {name: runs.tries(name, GRID) + runs.tries(name, FRESH) for name in (CONTESTANTS[0], OFFLINE)}
    live, offline = (np.array([tried.success for tried in tries], dtype=float) for tries in made.values())
    text = "; ".join(f"{NAMES[name]} {share(tries)}" for name, tries in made.items())
    if len(live) < MIN_TRIES or len(live) != len(offline):
        return text, None
    return text, decides(interval(live - offline, lambda drawn: np.asarray(drawn.mean(axis=-1))), -SAME, SAME)


CLAIMS = (reaches_grid, reaches_new, harmless, quick, no_worse, as_offline)


def table(blocks: Sequence[Block], touchable: frozenset[int]) -> list[dict[str, Any]]:
    """Return the table of results: a row for each contestant and set of targets, with the successes and the costs of its tries.

    `touchable`: numbers of the targets among the 27 that can be reached.
    """
    sets = {
        f"{len(touchable)} of the 27 that can be reached": (GRID, touchable),
        f"the {27 - len(touchable)} others": (GRID, frozenset(range(27)) - touchable),
        "new random targets": (FRESH, None),
    }
    sets |= {TARGET_MOVES: (TARGET_MOVES, None), OBSTACLE_MOVES: (OBSTACLE_MOVES, None)}
    rows = []
    for contestant in (*CONTESTANTS, OFFLINE, MOVING):
        for name, (kind, numbers) in sets.items():
            tries = tries_of(blocks, contestant, kind, numbers)
            if tries:
                rows.append(
                    {"contestant": NAMES.get(contestant, NAMES["learner"]), "targets": name, "success": share(tries), **_spent(tries)}
                )
    return rows


def _spent(tries: Sequence[Judged]) -> dict[str, Any]:
    ended = [tried for tried in tries if not tried.why]
    return {
        "distance from the surface, median [mm]": round(1e3 * float(np.median([min(tried.off, 9.0) for tried in tries])), 1),
        "robot time, median [s]": round(float(np.median([tried.seconds for tried in ended])), 1) if ended else None,
        "actions per try": round(float(np.mean([tried.actions for tried in ended])), 1) if ended else None,
        "planning per try, mean [ms]": round(1e3 * float(np.mean([tried.thinking for tried in ended])), 1) if ended else None,
        "solid contacts > 2 mm": sum(len(tried.deep) for tried in tries),
    }


def misses(blocks: Sequence[Block], touchable: frozenset[int], why: Callable[[tuple[float, float, float]], str]) -> list[dict[str, Any]]:
    """Return a row for each missed try of learner and planner, for targets that can be reached.

    Keys of a row: "contestant", "target", "distance from the surface [mm]", "reaches" (their number) and "why".  `touchable`: numbers of
    these targets among the 27.  `why`: function that explains a miss of the learner from the target's position [m].
    """
    return [
        {
            "contestant": NAMES[block.kind],
            "target": f"{tried.kind} {tried.number} at {tuple(round(x, 2) for x in tried.position)}",
            "distance from the surface [mm]": None if np.isinf(tried.off) else round(1e3 * tried.off),
            "reaches": tried.reaches,
            "why": tried.why or (why((tried.position[0], tried.position[1], tried.position[2])) if block.kind == CONTESTANTS[0] else ""),
        }
        for block in blocks
        if block.kind in CONTESTANTS
        for tried in block.tries
        if not tried.success and (tried.kind == FRESH or tried.number in touchable)
    ]


def plot(blocks: Sequence[Block], touchable: frozenset[int]) -> Any:
    """Draw the distances of the palm from the target's surface for both sets of targets, and the robot times of successful tries.

    `touchable`: numbers of the targets among the 27 that can be reached.  Returns a matplotlib figure.
    """
    drawing = new_figure(14.0, 4.2)
    *distances, times = drawing.subplots(1, 3)
    for axes, kind in zip(distances, (GRID, FRESH), strict=True):
        for contestant in CONTESTANTS:
            off = np.sort([1e3 * tried.off for tried in tries_of(blocks, contestant, kind, touchable if kind == GRID else None)])
            if len(off):
                axes.step(
                    np.minimum(off, 200.0),
                    np.arange(1, len(off) + 1) / len(off),
                    where="post",
                    color=COLORS[contestant],
                    label=NAMES[contestant],
                )
        axes.axvline(1e3 * SUCCESS_DISTANCE, color="0.5", linestyle="--", linewidth=0.8)
        axes.set(title=TITLES[kind], xlabel="true distance of palm and surface at the end [mm]", ylabel="share of tries", ylim=(0.0, 1.02))
        axes.set_xlim(-1.0, 100.0)
        axes.grid(alpha=0.2)
        axes.legend(fontsize=8, loc="lower right")
    for contestant in CONTESTANTS:
        took = np.sort([t.seconds for kind in (GRID, FRESH) for t in tries_of(blocks, contestant, kind) if t.success])
        if len(took):
            times.step(took, np.arange(1, len(took) + 1) / len(took), where="post", color=COLORS[contestant], label=NAMES[contestant])
    times.set(title="tries that succeeded", xlabel="robot time to the target [s]", ylabel="share of these tries", ylim=(0.0, 1.02))
    times.grid(alpha=0.2)
    return drawing


def figure(folder: Path) -> Path:
    """Draw the results of the finished blocks in the folder of a run, and return the path of the picture."""
    return saved(plot(_blocks(folder), _touchable()), folder)


EXPERIMENT = Experiment(
    claim="on the live robot the learned reacher brings the palm to the targets that can be reached, without other contacts",
    source="aim of this reproduction; thesis 8, 9.3",
    method=Steps(add_arguments, run, figure, judged_claims, (f"start-*/*/{BLOCK}",)),
    claims=CLAIMS,
    repeats="starts",
)
