# SPDX-License-Identifier: Apache-2.0
"""Draw selected reaches as filmstrips (thesis figs. A.1-A.3).

    python -m experiments.claims.ch8_reaching.reach_film [RUN.sqlite] [--out reach_film.png]

The robot is the iCub at its table under the default law, simulated offline; its right arm reaches.  RUN is the file that a `ReachStore` of
a learner wrote; if it does not exist, a new learner makes 3000 curious transitions and 800 problem-tries on the 27 targets of the thesis.
Then it reaches 60 times for random targets from random states.  The clearest example of each of three kinds is drawn: a reach from above, a
far one, and one around the target.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

import mobee
from experiments.kit.learning.arm import ARM_NEIGHBOURS, RANK3, RIGHT
from experiments.kit.reaching.arm import MARKER, PART, TRANSITIONS
from experiments.kit.reaching.learning import LEARNERS
from experiments.kit.reaching.targets import grid, targets_at
from mobee import CuriousAgent, Lattice, MobeeError, Model, OfflinePlant, ReachAgent
from mobee.arrays import Array
from mobee.learning.reaching.record import load_reaches
from mobee.learning.reaching.store import ReachStore, Try
from mobee.reach import TARGET, ReachTarget
from mobee.rendering.camera import camera_axes
from mobee.rendering.sheet import Motion, Strip, filmstrip, recorded
from mobee.store import TransitionStore

TRIES, EPISODES = 800, 60
REACHED = 0.02  # m from the target's surface, within which a reach succeeds
ARRIVED = 0.002  # m beyond its least distance, within which the hand has arrived
VIEWS = ("oblique", "left")
LAST_PIECE = 0.10  # m, of a path, whose slope says whether it comes from above; also the least distance that a detour is divided by
MIN_LENGTH = 0.15  # m, of a path that is shown


@dataclass(frozen=True, slots=True, eq=False)
class Episode:
    """A reach that succeeded.

    `target`: the target that was reached.  `done`: the whole try, with the actions before the reach.  `motion`: motion of the robot until
    the hand arrived.
    """

    target: ReachTarget
    done: Try
    motion: Motion


def table_plant(seed: int, joints: Sequence[str] = RIGHT) -> OfflinePlant:
    """Return an offline plant of the iCub at the table, without the ball; only these joints of the right arm move.

    `seed`: of the plant.
    """
    world = mobee.load_world("table")
    world.remove("ball")
    return OfflinePlant(Model(mobee.load_robot("icub"), world), seed, active=joints)


def learn(file: Path, seed: int = 0, tries: int = TRIES, transitions: int = TRANSITIONS) -> None:
    """Learn transitions and then to reach for the 27 targets at the table; everything is recorded in `file`.

    `seed`: of agent and plant.  `tries`, `transitions`: their numbers.
    """
    plant = table_plant(seed)
    space = Lattice(plant.robot, RIGHT, RANK3, ARM_NEIGHBOURS)
    with TransitionStore(file, PART) as store:
        curious = CuriousAgent(space, plant, seed=seed, store=store)
        curious.run(transitions)
    with ReachStore(file, PART) as reaches:
        beliefs = curious.model.debiased()
        agent = LEARNERS["gp-ucb-alike"].agent(space, plant, beliefs, marker=MARKER, seed=seed, store=reaches)
        agent.learn(targets_at(grid(), "surface"), tries)


def episodes(agent: ReachAgent, plant: OfflinePlant, count: int, seed: int) -> list[Episode]:
    """Try `count` times to reach a random target of the agent from a random state; returns the reaches that succeeded.

    `seed`: of the draws.
    """
    rng, found = np.random.default_rng([seed, 8]), []
    for _ in range(count):
        agent.evaluate([], 1)  # puts the robot in a random state
        target = agent.problems.targets[int(rng.integers(len(agent.problems.targets)))]
        plant.present(target)
        with recorded(plant) as recording:
            done = agent.try_problem(target)
        if done.reach_state is not None and done.missing <= REACHED:
            motion = recording.motion()
            away = np.linalg.norm(motion.path(agent.marker) - target.position, axis=1)
            found.append(Episode(target, done, motion.part(0, int(np.argmax(away <= away.min() + ARRIVED)))))
    return found


def selected(paths: Sequence[Array]) -> dict[str, int]:
    """Return a dict from the kind of path to the index of its clearest example among paths (T, 3) m of the hand.

    "From above": the path with the steepest descent at its end.  "Far": with the largest distance between start and end.  "Around the
    target": with the largest detour.  Each path is chosen for at most one kind, and paths shorter than 15 cm are not chosen.  A kind for
    which no path remains is absent.
    """
    left = [number for number, path in enumerate(paths) if _length(path) >= MIN_LENGTH]
    chosen: dict[str, int] = {}
    for name, measure in KINDS.items():
        if left:
            chosen[name] = left.pop(int(np.argmax([measure(paths[number]) for number in left])))
    return chosen


def _length(path: Array) -> float:
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def _descent(path: Array) -> float:
    """Return the slope of the last piece of a path: 1 vertically down, 0 level."""
    before = path[np.linalg.norm(path - path[-1], axis=1) >= LAST_PIECE]
    if not len(before):
        return -np.inf
    return float((before[-1] - path[-1])[2] / np.linalg.norm(before[-1] - path[-1]))


def _distance(path: Array) -> float:
    return float(np.linalg.norm(path[-1] - path[0]))


def _detour(path: Array) -> float:
    """Return the length over the straight distance."""
    return _length(path) / max(float(np.linalg.norm(path[-1] - path[0])), LAST_PIECE)


KINDS = {"From above": _descent, "Far": _distance, "Around the target": _detour}


def _strip(name: str, one: Episode, marker: str, poses: int) -> Strip:
    """Return the filmstrip of a reach, from the view in which the target hides least of the hand."""
    behind = one.motion.poses[-1].position(marker) - one.target.position
    view = min(VIEWS, key=lambda view: float(camera_axes(view)[2] @ behind))
    return Strip(one.motion, marker, (view,), poses, _title(name, one), partial(_caption, marker))


def _title(name: str, one: Episode) -> str:
    states = [s for s, *_ in one.done.path] + [one.done.reach_state]
    return f"{name}: state {' → '.join(map(str, states))}, then reach: {1000 * one.done.missing:.0f} mm from the target"


def _caption(marker: str, motion: Motion, moment: int) -> str:
    target = motion.objects[moment][TARGET]
    left = float(np.linalg.norm(motion.poses[moment].position(marker) - target.position)) - target.size[0]
    return f"{motion.times[moment]:.1f} s, {100 * max(left, 0.0):.0f} cm"


def film(file: Path, out: Path, seed: int, poses: int, height: int) -> list[str]:
    """Draw filmstrips of selected reaches of the learner that is recorded in `file`, and return their titles.

    `out`: path of the picture.  `seed`: of the plant and of the random targets, of which some are filmed.  `poses`: pictures per reach.
    `height`: of each, pixels.  Raises MobeeError if no reach has succeeded with a path of the hand of at least 15 cm.
    """
    with ReachStore(file, PART, read_only=True) as store:
        joints = store.settings()["space"]["joints"]
    plant = table_plant(seed + 1, joints)
    agent = load_reaches(file, plant, PART)
    found = episodes(agent, plant, EPISODES, seed)
    chosen = [(name, found[number]) for name, number in selected([one.motion.path(agent.marker) for one in found]).items()]
    if not chosen:
        raise MobeeError(f"{file}: none of {EPISODES} reaches ended within {REACHED} m of its target; let the agent learn more.")
    strips = [_strip(name, one, agent.marker, poses) for name, one in chosen]
    filmstrip(strips, out, height)
    return [strip.title for strip in strips]


def main(argv: Sequence[str] | None = None) -> None:
    """Draw the filmstrips of the learner in a file; if the file does not exist, a learner is trained and written to it before.

    `argv`: command-line arguments; None: those of the process.  Prints the title of each filmstrip and the path of the picture.
    """
    parser = argparse.ArgumentParser(description="Draw selected reaches of a learner.")
    parser.add_argument(
        "run",
        nargs="?",
        type=Path,
        metavar="RUN.sqlite",
        help="file of a learner; written if it does not exist (default: a temporary file)",
    )
    parser.add_argument("--out", type=Path, default=Path("reach_film.png"), metavar="PNG", help="default: %(default)s")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the random states and targets (default: %(default)s)")
    parser.add_argument("--poses", type=int, default=6, metavar="N", help="pictures per reach (default: %(default)s)")
    parser.add_argument("--height", type=int, default=260, metavar="PIXELS", help="height of each picture (default: %(default)s)")
    options = parser.parse_args(argv)
    with tempfile.TemporaryDirectory() as folder:
        file = options.run or Path(folder) / "run.sqlite"
        try:
            if not file.exists():
                learn(Path(folder) / "learning.sqlite")
                shutil.move(Path(folder) / "learning.sqlite", file)  # whole, or not there
            titles = film(file, options.out, options.seed, options.poses, options.height)
        except MobeeError as error:
            raise SystemExit(str(error)) from None
    for title in titles:
        print(title)
    print(options.out)


if __name__ == "__main__":
    main()
