# SPDX-License-Identifier: Apache-2.0
"""Inverse kinematics of a palm among boxes: how often and how fast the library, mink and other optimisers reach a target pose."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

import mobee
from experiments.bench.ik_rivals import MARKER, MinkPeer, Target, annealing, cma, load_mink, particles, xnes
from experiments.bench.peers import load_cma
from experiments.bench.scenes import boxes_world
from experiments.bench.timing import Calibration, one_core, processor_time
from experiments.bench.verdicts import Requirement, report_text, verdict
from experiments.kit.command_line import Progress
from mobee.arrays import Array
from mobee.roadmap.ik.problem import Problem

_ARM = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_prosup", "wrist_pitch", "wrist_yaw")
MOTORS = ("torso", *(f"r_{name}" for name in _ARM))
BOXES = 100
BATCH = 500  # random postures that are evaluated at once
MAX_EVALUATIONS = 20_000  # of one target
TARGETS_PER_TURN = 20  # targets of one solver before the next one's turn: fewer would measure cold caches

NES, HYBRID, ALL_MOTORS = "NES", "least squares, then NES", "NES, all 41 motors"
FINE_NES, FINE_HYBRID = "NES, 1 mm and 1 degree", "least squares first, 1 mm"
MINK = "mink, restarts"
CMA, CMA_BATCHED = "CMA-ES, pose by pose", "CMA-ES, a generation at once"
ANNEALING, PARTICLES, XNES = "simulated annealing", "particle filter", "xNES, as published"
RIVALS: dict[str, Callable[[Problem, int, int], Array | None]] = {
    CMA: lambda problem, seed, most: cma(problem, seed, most, batched=False),
    CMA_BATCHED: lambda problem, seed, most: cma(problem, seed, most, batched=True),
    ANNEALING: annealing,
    PARTICLES: particles,
    XNES: xnes,
}
Solve = Callable[[Target, int], tuple[bool, int]]  # of a target and a seed: whether it was reached, and evaluations
Motors = Sequence[str] | None  # that may move; None: all

REQUIREMENTS = (
    Requirement("NES, share reached", ("rows", NES, "reached"), at_least=0.99),
    Requirement("NES, ms, median", ("rows", NES, "standard_ms"), at_most=25.0),
    Requirement("NES, ms, 95 %", ("rows", NES, "standard_ms_95"), at_most=50.0),
    Requirement("NES, times CMA-ES pose by pose", ("rows", NES, "times_cma"), at_least=4.0),
    Requirement("hybrid, share reached", ("rows", HYBRID, "reached"), at_least=1.0),
    Requirement("hybrid, ms, median", ("rows", HYBRID, "standard_ms"), at_most=1.0),
    Requirement("hybrid, times CMA-ES pose by pose", ("rows", HYBRID, "times_cma"), at_least=100.0),
    Requirement("all 41 motors, share reached", ("rows", ALL_MOTORS, "reached"), at_least=0.97),
    Requirement("all 41 motors, ms, median", ("rows", ALL_MOTORS, "standard_ms"), at_most=100.0),
)


@dataclass(frozen=True, slots=True)
class Settings:
    """Numbers of targets: `targets` for torso and arm, `whole` for all 41 motors, `rivals` for each optimiser in RIVALS."""

    targets: int = 300
    whole: int = 60
    rivals: int = 40


QUICK = Settings(targets=20, whole=5, rivals=5)


def measure(settings: Settings) -> dict[str, Any]:
    """Run this benchmark and return its result; raises NotInstalled without cma, mink or MuJoCo.

    Main keys: "rows", a dict from the name of a solver to its statistics, as `Tries.row` returns them, and "times_cma", the median time of
    the CMA-ES that evaluates pose by pose, divided by that of the solver; "requirements", a list with the dict that `Requirement.judge`
    returns for each requirement; "passed", whether all are met.
    """
    load_cma()
    load_mink()
    model = scene()
    aims = targets(model, max(settings.targets, settings.whole, settings.rivals))
    fine = [fine_target(aim) for aim in aims]
    hybrid, nes = (library(model, method, MOTORS) for method in ("hybrid", "nes"))
    entrants = {
        HYBRID: Entrant(hybrid, aims[: settings.targets]),
        NES: Entrant(nes, aims[: settings.targets]),
        ALL_MOTORS: Entrant(library(model, "nes", None), aims[: settings.whole]),
        FINE_HYBRID: Entrant(hybrid, fine[: settings.targets]),
        FINE_NES: Entrant(nes, fine[: settings.targets]),
        MINK: Entrant(mink(model), aims[: settings.targets]),
        **{name: Entrant(rival(model, name, MOTORS), aims[: settings.rivals]) for name in RIVALS},
    }
    speeds = Calibration()
    with one_core() as core, Progress() as progress:
        found = solve_by_turns(entrants, speeds, lambda done, name: progress.show(done / len(aims), name))
    rows = {name: tries.row() for name, tries in found.items()}
    for row in rows.values():
        row["times_cma"] = rows[CMA]["standard_ms"] / row["standard_ms"]
    result = {"core": core, "speed": speeds.median, "rows": rows}
    return result | verdict(result, REQUIREMENTS)


def report(result: dict[str, Any]) -> str:
    """Return the result of `measure` as text: a table with one line for each solver, then the requirements."""
    lines = [
        "Right palm among 100 boxes: 5 mm, 5 degrees, no contact; torso and arm move.",
        "Median / 95 % of a target; processor time of one core; times faster than CMA-ES:",
        f"  {'':<29}{'targets':>7}{'reached':>8}{'evaluations':>14}{'ms':>14}{'times':>6}",
    ]
    for name, row in result["rows"].items():
        evaluations = f"{row['evaluations']:.0f} / {row['evaluations_95']:.0f}"
        ms = f"{_three_digits(row['ms'])} / {_three_digits(row['ms_95'])}"
        counts = f"{row['targets']:>7}{100.0 * row['reached']:>6.1f} %{evaluations:>14}{ms:>14}"
        lines.append(f"  {name:<29}{counts}{_three_digits(row['times_cma']):>6}")
    return report_text(lines, result)


def _three_digits(value: float) -> str:
    """Return a value as text with three significant digits, but with all digits before the decimal point."""
    return f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"


def scene() -> mobee.Model:
    """Return a model of the iCub among BOXES (100) boxes.

    They are the first boxes of `boxes_world` that do not touch the robot at home.
    """
    robot, world = mobee.load_robot("icub"), mobee.World()
    model = mobee.Model(robot, world)
    candidates = boxes_world(1000).snapshot.objects
    free = 0
    for name, box in candidates.items():
        world.add(name, mobee.box(*box.size), position=box.position, rotation=box.rotation)
        if model.evaluate(robot.home).count:
            world.remove(name)
            continue
        free += 1
        if free == BOXES:
            return model
    raise ValueError(f"only {free} boxes do not touch the robot at home, {BOXES} are needed")


def targets(model: mobee.Model, count: int, seed: int = 0) -> list[Target]:
    """Return `count` target poses of the palm that can be reached: its poses in random postures of torso and arm without a contact.

    `seed`: of the postures.
    """
    robot, rng = model.robot, np.random.default_rng(seed)
    columns = [robot.motor_index(name) for name in (*robot.part("torso").motors, *MOTORS[1:])]
    low, high = robot.limits[columns].T
    found: list[Target] = []
    while len(found) < count:
        q = np.repeat(robot.home[None], BATCH, axis=0)
        q[:, columns] = rng.uniform(low, high, (BATCH, len(columns)))
        pose = model.evaluate(q)
        positions, rotations = pose.position(MARKER), pose.rotation(MARKER)
        found += [Target(positions[k], rotations[k]) for k in np.flatnonzero(np.asarray(pose.count) == 0)]
    return found[:count]


def fine_target(aim: Target) -> Target:
    """Return the same pose with tolerances of 1 mm and 1 degree instead of its own."""
    return replace(aim, metres=0.001, radians=float(np.deg2rad(1.0)))


def library(model: mobee.Model, method: Literal["hybrid", "nes"], motors: Motors) -> Solve:
    """Return a solver that calls `mobee.solve_ik`.

    A solver is called with a target and a seed, and returns whether it found a pose and how many poses it evaluated.  `motors`: names of
    the motors that may move; None: all.
    """

    def solve(aim: Target, seed: int) -> tuple[bool, int]:
        ik = mobee.solve_ik(model, aim.costs(), seed=seed, motors=motors, method=method, evaluations=MAX_EVALUATIONS)
        return ik.reached, ik.evaluations

    return solve


def rival(model: mobee.Model, name: str, motors: Motors) -> Solve:
    """Return one of the optimisers with which the thesis compares NES (rivals) as a solver.  `name`: a key of RIVALS.

    A solver is called with a target and a seed, and returns whether it found a pose and how many poses it evaluated.  `motors`: names of
    the motors that may move; None: all.
    """

    def solve(aim: Target, seed: int) -> tuple[bool, int]:
        problem = Problem(model, aim.costs(), None, motors)
        return RIVALS[name](problem, seed, MAX_EVALUATIONS) is not None, problem.evaluations

    return solve


def mink(model: mobee.Model) -> Solve:
    """Return a solver that calls mink and moves torso and arm; raises NotInstalled without mink or MuJoCo.

    A solver is called with a target and a seed, and returns whether it found a pose and how many poses it evaluated.
    """
    peer = MinkPeer(model.robot)

    def solve(aim: Target, seed: int) -> tuple[bool, int]:
        problem = Problem(model, aim.costs(), None, MOTORS)
        return peer.solve(problem, aim, seed, MAX_EVALUATIONS) is not None, problem.evaluations

    return solve


def timed(solve: Solve, aim: Target, seed: int) -> tuple[bool, int, float]:
    """Solve the inverse kinematics of one target.

    Returns whether a pose was found, the number of evaluations, and the processor time [ms].  `seed`: for the solver.
    """
    (reached, evaluations), seconds = processor_time(lambda: solve(aim, seed))
    return reached, evaluations, 1e3 * seconds


@dataclass(slots=True)
class Tries:
    """Results of a solver for each of its targets, in the order of the targets, also of those that it did not reach.

    `reached`: whether it found a pose within the tolerances.  `evaluations`: number of evaluated poses.  `ms`: processor time [ms].
    `standard_ms`: the same on the standard machine (the one for which the requirements were set).
    """

    reached: list[bool] = field(default_factory=list)
    evaluations: list[int] = field(default_factory=list)
    ms: list[float] = field(default_factory=list)  # processor time
    standard_ms: list[float] = field(default_factory=list)  # on the standard machine, see timing.py

    def add(self, solve: Solve, aim: Target, seed: int, speeds: Calibration) -> None:
        """Solve one more target and append the result.  `seed`: for the solver.  `speeds` measures the speed of this machine."""
        (reached, evaluations, ms), speed = speeds.around(lambda: timed(solve, aim, seed))
        self.reached.append(reached)
        self.evaluations.append(evaluations)
        self.ms.append(ms)
        self.standard_ms.append(ms * speed)

    def row(self) -> dict[str, float]:
        """Return the statistics of all tries.

        Keys: "targets", their number; "reached", the share that the solver reached; "evaluations", "ms" and "standard_ms", medians over the
        targets, and their 95 % quantiles with the ending "_95".
        """
        row: dict[str, float] = {"targets": len(self.reached), "reached": float(np.mean(self.reached))}
        for key in ("evaluations", "ms", "standard_ms"):
            values = getattr(self, key)
            row |= {key: float(np.median(values)), f"{key}_95": float(np.quantile(values, 0.95))}
        return row


@dataclass(frozen=True, slots=True)
class Entrant:
    """A solver (`solve`) and the targets that it must solve (`aims`)."""

    solve: Solve
    aims: Sequence[Target]


def solve_by_turns(entrants: Mapping[str, Entrant], speeds: Calibration, show: Callable[[int, str], None]) -> dict[str, Tries]:
    """Solve all targets, a few with each solver in turn, so that a slow minute of the machine affects all solvers equally.

    `entrants`: the solvers with their targets, by the solver's name.  Returns the tries of each solver, by the same names.  `speeds`
    measures the speed of this machine.  `show` is called with the number of targets done and the name of the solver.
    """
    for one in entrants.values():
        one.solve(one.aims[0], 0)  # fills caches, does lazy set-up
    found = {name: Tries() for name in entrants}
    for begin in range(0, max(len(one.aims) for one in entrants.values()), TARGETS_PER_TURN):
        for name, one in entrants.items():
            show(begin, name)
            for seed, aim in enumerate(one.aims[begin : begin + TARGETS_PER_TURN], begin):
                found[name].add(one.solve, aim, seed, speeds)
    return found
