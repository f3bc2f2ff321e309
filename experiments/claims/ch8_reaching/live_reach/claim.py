"""Live reach: the learned reacher on the live PyBullet robot, in lockstep, beside the planner.

Claim: trained offline and refined live, it brings the palm to within 2 cm of the surface of at least 95 % of the thesis' 27 targets that
can be reached, and of 90 % of fresh random ones, from random poses, without a solid contact deeper than 2 mm.
Source: aim of this reproduction (thesis 8, 9.3).  Published: no number.  Run time: 10 to 25 minutes a start on 2 cores.

The robot `icub` at its table under the default law, seven joints of its right arm, ticks of 20 ms; PyBullet, with gravity.  A start: a
learner (gp, ucb, alike) of 3000 curious transitions and 800 tries of the 27 targets on the offline plant with the identified motors, then
54 live tries in the same record; then, without learning, each of the 27 and 50 fresh targets from a pose of its own, up to three
reaches a try.  The planner peer (inverse kinematics and RRT-Connect, planned anew on every change) has the same targets, poses and
robot, and the true model; the target repels nothing while it moves, for it plans around it.  Besides, 8 targets that move to and fro over
15 cm at 3 cm/s, and 8 with a ball of 8 cm, in model and simulator, that crosses the hand's path as fast.
A target can be reached if inverse kinematics finds a pose that holds limits and cables, with the palm within 2 cm of the surface, and in
which no solid touches anything but the hand the target (experiments/kit/reaching/README.md has which grid it is).  Fresh targets are such.
Judged by the simulator's joints, not by encoders: where the palm was when the force ended, or the planner held that it was there.
First motion is measured with ticks of 2 ms: from the tick of the request to the first in which another command is in force.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

from experiments.claims.ch8_reaching.live_reach.problems import (
    AIM,
    FRESH,
    GAINS,
    GOOD,
    GRID,
    OBSTACLE_MOVES,
    RATE,
    ROBOT,
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
from experiments.kit.experiment import Claim, Experiment, Steps
from experiments.kit.live.launch import TABLE, summary_of, write_job
from experiments.kit.live.recordings import POSITIONS
from experiments.kit.plots import new_figure
from mobee.errors import InvalidValue
from mobee.reach import ReachTarget
from mobee.roadmap.ompl import require_ompl
from mobee.store import STORE

TRIES, LIVE, FRESH_TARGETS, MOVING_THINGS = 800, 54, 50, 8
PIECE = 27  # tries of a launch
FAST, FIRST = 500.0, 10  # Hz; reaches whose first motion is timed
CONTESTANTS, MOVING = ("learner", "peer"), "moving"
NAMES = {"learner": "learned reacher", "peer": "IK + RRT-Connect through MoBeE"}
LEAST = {GRID: 0.95, FRESH: 0.9}
SOON = 5e-3  # s
FEW = 20  # tries: of fewer no verdict is made
CLAIMS = (
    Claim(
        "aim of this reproduction",
        "live, refined live: palm within 2 cm of the surface of those of the 27 targets that can be reached, from random poses",
        "at least 0.95",
    ),
    Claim("aim of this reproduction", "live: palm within 2 cm of the surface of fresh random targets, from random poses", "at least 0.90"),
    Claim("aim of this reproduction", "no listed solid contact of PyBullet deeper than 2 mm while it reaches for what rests", "0"),
    Claim("aim of this reproduction", "a reach moves within 5 ms of the request, on robot_sim's clock", "at most 5 ms"),
    Claim("aim of this reproduction", "live, the learned reacher is no worse than inverse kinematics and RRT-Connect", "-"),
)

COLORS = {"learner": "tab:red", "peer": "tab:blue"}
TITLES = {GRID: "of the 27, those that can be reached", FRESH: "fresh random targets"}

WITH_OBSTACLE = Path(__file__).with_name("obstacle.xml")
LONGEST = 120.0  # s of robot time for a try, on average over a block
PATIENCE = 60.0  # s for a tick: a plan is made in one

_SCENARIO = """# Written by the experiment `live-reach`.
title = "Reaching with PyBullet: {kind}"

[shared]
robot = "{robot}"
world = "{world}"
gains = "{gains}"
seed = {seed}
mode = "lock"
patience = {patience}

[services.robot_sim]
rate = {rate}
record = "{folder}"

[services.model]
[services.controller]

[services.performer]
module = "experiments.claims.ch8_reaching.live_reach.performer"
run_dir = "{folder}"
"""


@dataclass(frozen=True)
class Sizes:
    """The sizes of a start's parts."""

    transitions: int = TRANSITIONS
    tries: int = TRIES
    live: int = LIVE
    grid: int = 27
    fresh: int = FRESH_TARGETS
    moving: int = MOVING_THINGS
    first: int = FIRST


QUICK = Sizes(500, 30, 2, 2, 2, 1, 2)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the experiment."""
    parser.add_argument(
        "--starts", type=positive_whole, default=3, metavar="N", help="learners, with poses and fresh targets of their own (default: 3)"
    )
    parser.add_argument("--quick", action="store_true", help="a short version that shows whether it works")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Train, refine and evaluate; finished blocks are not repeated.  Raises OmplMissing before anything is begun."""
    require_ompl()
    sizes, starts = QUICK if arguments.quick else Sizes(), 1 if arguments.quick else arguments.starts
    with Progress() as progress:
        for number in range(starts):
            seed, place = arguments.seed + number, folder / f"start-{number}"
            place.mkdir(exist_ok=True)
            progress.show(number / starts, f"start {number + 1} of {starts}: learns offline")
            train(place / STORE, seed, sizes.transitions, sizes.tries)
            jobs = list(_jobs(place, seed, sizes))
            for done, (name, job, rate) in enumerate(jobs):
                progress.show((number + done / len(jobs)) / starts, f"start {number + 1} of {starts}: {name}")
                _do(place / name, job, seed, rate)
    blocks, known = _blocks(folder), _touchable()
    targets = grid_targets()
    left = frozenset(number for number in known if _nearest(tuple(targets[number].position.tolist()))[0] <= GOOD)
    return {
        "claims": [claim.record() for claim in measured(blocks, known, left)],
        "tries": table(blocks, known),
        "missed": misses(blocks, known, _why),
        "reachable": sorted(known),
        "held off by the robot's own fields": sorted(known - left),
        "repeatable": all(block.repeatable for block in blocks if block.kind != "moving"),  # what is moved is moved from outside
    }


def _jobs(place: Path, seed: int, sizes: Sizes) -> Iterator[tuple[str, Job, float]]:
    """The blocks of a start in their order: name, what is done, ticks a second."""
    store = str((place / STORE).resolve())
    grid, fresh = grid_problems(seed)[: sizes.grid], fresh_problems(seed, sizes.fresh)
    for made in range(0, sizes.live, PIECE):
        yield f"refine-{made:03}", Job("refine", seed, store, tries=sizes.tries + min(made + PIECE, sizes.live)), RATE
    pieces = [grid, *(fresh[i : i + PIECE] for i in range(0, len(fresh), PIECE))]
    for contestant in ("learner", "peer"):
        for number, piece in enumerate(pieces):
            yield f"{contestant}-{number}", Job(contestant, seed, store, piece), RATE
    yield "moving", Job("moving", seed, store, moving_problems(seed, sizes.moving)), RATE
    yield "first", Job("first motion", seed, store, fresh[: sizes.first]), FAST


def _do(folder: Path, job: Job, seed: int, rate: float) -> None:
    if not (folder / BLOCK).exists():
        repeatable = perform(folder, job, seed, rate)
        write_block(folder, measure(folder, job, rate, repeatable))
        (folder / POSITIONS).unlink()


@cache
def _nearest(place: tuple[float, float, float]) -> tuple[float, str]:
    """The least remaining error of a reach from any state, offline, and the contacts there."""
    return nearest_reach(offline_plant(0), ReachTarget(np.array(place), aim=AIM))


def _why(place: tuple[float, float, float]) -> str:
    off, felt = _nearest(place)
    return f"offline the nearest reach from any state ends {1e3 * off:.0f} mm off" + (f", kept by {felt} mm" if off > GOOD else "")


def _blocks(folder: Path) -> list[Block]:
    blocks = [read_block(path.parent) for path in sorted(folder.glob(f"start-*/*/{BLOCK}"))]
    if not blocks:
        raise InvalidValue(f"{folder} has no finished block: it was stopped before the first was over.")
    return blocks


def _touchable() -> frozenset[int]:
    """The numbers of those of the 27 targets that can be reached."""
    known = belief()
    return frozenset(number for number, target in enumerate(grid_targets()) if touchable(known, target))


def perform(folder: Path, job: Job, seed: int, rate: float = RATE) -> bool:
    """Launch a system with one job, which leaves a record of every tick in the folder; returns whether the run is repeatable.

    `seed`: of the simulated robot.  Raises LaunchFailed.
    """
    write_job(folder, job)
    world = WITH_OBSTACLE if job.kind == "moving" else TABLE
    text = _SCENARIO.format(
        kind=job.kind, robot=ROBOT, world=world, gains=GAINS, seed=seed, patience=PATIENCE, rate=rate, folder=folder.resolve()
    )
    scenario = folder / "scenario.toml"
    scenario.write_text(text)
    tries = max(1, len(job.problems) + job.tries)
    summary = summary_of(str(scenario), ticks=round(LONGEST * rate * tries), runs=folder / "launches")
    return bool(summary["lockstep"]["repeatable"])


def tries_of(blocks: Sequence[Block], contestant: str, kind: str, numbers: frozenset[int] | None = None) -> list[Judged]:
    """All tries of a contestant on one set of targets, or on those numbers of it."""
    found = [tried for block in blocks if block.kind == contestant for tried in block.tries if tried.kind == kind]
    return [tried for tried in found if numbers is None or tried.number in numbers]


def share(tries: Sequence[Judged]) -> str:
    """Successes of tries, and the 95 % interval of their share (Wilson)."""
    made = sum(tried.success for tried in tries)
    if not tries:
        return "none"
    low, high = binomtest(made, len(tries)).proportion_ci(method="wilson")
    return f"{made} of {len(tries)}, {made / len(tries):.2f} [{low:.2f}, {high:.2f}]"


def enough(tries: Sequence[Judged], least: float) -> bool | None:
    """Whether their share of successes is as large as that; None: less, but by chance perhaps."""
    if len(tries) < FEW:
        return None
    made = sum(tried.success for tried in tries)
    if made >= least * len(tries):
        return True
    return False if binomtest(made, len(tries)).proportion_ci(method="wilson").high < least else None


def measured(blocks: Sequence[Block], touchable: frozenset[int], left: frozenset[int]) -> list[Claim]:
    """The claims with our numbers; `touchable`: those of the 27, `left`: those of them that MoBeE's fields let a palm come to."""
    grid, fresh = tries_of(blocks, "learner", GRID, touchable), tries_of(blocks, "learner", FRESH)
    deep = [touch for block in blocks if block.kind in ("refine", "learner") for touch in block.deep]
    hours = sum(block.seconds for block in blocks if block.kind in ("refine", "learner")) / 3600.0
    first = [1e3 * tried.first / block.rate for block in blocks if block.kind == "first motion" for tried in block.tries if tried.first > 0]
    ticks = sorted({1e3 / block.rate for block in blocks if block.kind == "first motion"})
    rivals = {contestant: tries_of(blocks, contestant, GRID, touchable) + tries_of(blocks, contestant, FRESH) for contestant in CONTESTANTS}
    worst = f"deepest {1e3 * max(touch.depth for touch in deep):.1f} mm ({max(deep, key=lambda t: t.depth).pair}), " if deep else ""
    apart = (
        f"of the {len(left)} that the robot's own fields let a palm come to {share(tries_of(blocks, 'learner', GRID, left))}; "
        f"of all 27 {share(tries_of(blocks, 'learner', GRID))}"
    )
    return [
        CLAIMS[0].measured(f"{share(grid)} of {len(touchable)}; {apart}", enough(grid, LEAST[GRID])),
        CLAIMS[1].measured(share(fresh), enough(fresh, LEAST[FRESH])),
        CLAIMS[2].measured(f"{len(deep)}, {worst}in {hours:.1f} h of robot time", not deep if len(grid) + len(fresh) >= FEW else None),
        CLAIMS[3].measured(
            f"{max(first):g} ms at most to the first command that moves ({len(first)} reaches, ticks of {ticks[0]:g} ms)"
            if first
            else "none",
            max(first) <= 1e3 * SOON if first else None,
        ),
        CLAIMS[4].measured("; ".join(f"{NAMES[contestant]} {share(made)}" for contestant, made in rivals.items()), _no_worse(rivals)),
    ]


def _no_worse(rivals: Mapping[str, Sequence[Judged]]) -> bool | None:
    """Whether the learner succeeds at least as often in the tries, which are the same for both."""
    learner, peer = (np.array([tried.success for tried in rivals[contestant]]) for contestant in CONTESTANTS)
    if len(learner) < FEW or len(learner) != len(peer):
        return None
    return bool(learner.mean() >= peer.mean()) or None


def table(blocks: Sequence[Block], touchable: frozenset[int]) -> list[dict[str, Any]]:
    """A row a contestant and set of targets."""
    sets = {
        f"{len(touchable)} of the 27": (GRID, touchable),
        f"the {27 - len(touchable)} others": (GRID, frozenset(range(27)) - touchable),
        "fresh": (FRESH, None),
    }
    sets |= {TARGET_MOVES: (TARGET_MOVES, None), OBSTACLE_MOVES: (OBSTACLE_MOVES, None)}
    rows = []
    for contestant in (*CONTESTANTS, MOVING):
        for name, (kind, numbers) in sets.items():
            tries = tries_of(blocks, contestant, kind, numbers)
            if tries:
                rows.append({"who": NAMES.get(contestant, NAMES["learner"]), "targets": name, "success": share(tries), **_spent(tries)})
    return rows


def _spent(tries: Sequence[Judged]) -> dict[str, Any]:
    ended = [tried for tried in tries if not tried.why]
    return {
        "off, median [mm]": round(1e3 * float(np.median([min(tried.off, 9.0) for tried in tries])), 1),
        "robot time, median [s]": round(float(np.median([tried.seconds for tried in ended])), 1) if ended else None,
        "actions": round(float(np.mean([tried.actions for tried in ended])), 1) if ended else None,
        "planning, mean [ms]": round(1e3 * float(np.mean([tried.thinking for tried in ended])), 1) if ended else None,
        "solid contacts > 2 mm": sum(len(tried.deep) for tried in tries),
    }


def misses(blocks: Sequence[Block], touchable: frozenset[int], why: Callable[[tuple[float, float, float]], str]) -> list[dict[str, Any]]:
    """The touchable targets that were missed, by whom and by how much; `why` explains those that the learner missed."""
    return [
        {
            "who": block.kind,
            "target": f"{tried.kind} {tried.number} at {tuple(round(x, 2) for x in tried.position)}",
            "off [mm]": None if np.isinf(tried.off) else round(1e3 * tried.off),
            "reaches": tried.reaches,
            "why": tried.why or (why((tried.position[0], tried.position[1], tried.position[2])) if block.kind == CONTESTANTS[0] else ""),
        }
        for block in blocks
        if block.kind in CONTESTANTS
        for tried in block.tries
        if not tried.success and (tried.kind == FRESH or tried.number in touchable)
    ]


def plot(blocks: Sequence[Block], touchable: frozenset[int]) -> Any:
    """Distances of the palm from the target's surface by contestant, two panels, and robot times, one."""
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
        axes.axvline(1e3 * GOOD, color="0.5", linestyle="--", linewidth=0.8)
        axes.set(title=TITLES[kind], xlabel="palm to surface at the end, in truth [mm]", ylabel="share of tries", ylim=(0.0, 1.02))
        axes.set_xlim(-1.0, 100.0)
        axes.grid(alpha=0.2)
        axes.legend(fontsize=8, loc="lower right")
    for contestant in CONTESTANTS:
        took = np.sort([t.seconds for kind in (GRID, FRESH) for t in tries_of(blocks, contestant, kind) if t.success])
        if len(took):
            times.step(took, np.arange(1, len(took) + 1) / len(took), where="post", color=COLORS[contestant], label=NAMES[contestant])
    times.set(title="those that succeeded", xlabel="robot time to the target [s]", ylabel="share", ylim=(0.0, 1.02))
    times.grid(alpha=0.2)
    return drawing


def figure(folder: Path) -> Path:
    """Draw the finished blocks."""
    path = folder / "figure.png"
    plot(_blocks(folder), _touchable()).savefig(path, dpi=150)
    return path


EXPERIMENT = Experiment(
    name="live-reach",
    claim="the learned reacher puts the palm on what can be reached, live, and touches nothing else",
    source="aim of this reproduction; thesis 8, 9.3",
    notes=__doc__,
    method=Steps(add_arguments, run, figure),
    claims=CLAIMS,
)
