# SPDX-License-Identifier: Apache-2.0
"""Replanning: the time to a new path when a ball becomes solid in front of the moving hand.

Claim: when the ball is made solid, "the planner/controller immediately finds the alternative path around it".  Source: thesis 4.3.2, fig.
4.7.  Published: no number; aim of this reproduction: the new path under way within 200 ms of the bump, live, on the clock of robot_sim (the
simulator).  Run time: 6 minutes on 2 cores, in real time.

The roadmap has three poses of the right arm of `icub`: at the right of a ball, at its left, and above it.  The path from right to left
through the ball is shorter than the path over it.  The real processes run with PyBullet (with --backend mujoco: MuJoCo), with ticks of 10
ms that follow the clock (free mode), and the default control law at full speed.  A crossing is a motion from right to left, and begins with
a new roadmap; 0.1 to 1.2 s after its start the ball becomes an obstacle in the model, and a body in the simulator.  The bump is the first
tick at which the model reports a contact of the arm with the ball; overlap with a field, the larger volume around a link, counts too.  Then
the motion ends, its edge is removed from the roadmap, and a motion to the next vertex of the new path is requested at once.  The new path
is under way from the first tick in which the motors execute a command that was computed after this request.  Also measured: when the joints
stop approaching the old goal, which depends on the control law.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import Struct

from experiments.claims.ch3_roadmaps.replanning_live import (
    ABOVE,
    BALL,
    LEFT,
    MARKER,
    PART,
    RATE,
    RIGHT,
    SIMULATED,
    SPEED,
    WORLD,
    Crossing,
    Job,
    model,
    new_map,
    robot,
)
from experiments.kit.command_line import Progress, positive_whole
from experiments.kit.experiment import OUR_AIM, Experiment, Measured, Steps, claim, judged
from experiments.kit.live.launch import PHYSICS, add_backend, launch, read_done, write_job
from experiments.kit.live.system import CONTACTS, POSITIONS, read_positions, read_touches
from experiments.kit.plots import finish, new_figure
from experiments.kit.run_folder import decoded, encoded
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.rendering.sheet import Motion, Strip, filmstrip

SOONEST, LATEST = 0.1, 1.2  # s after the start of a crossing
PIECE = 5  # crossings of a launch
QUICK_CROSSINGS = 2
LONGEST = 60.0  # s for a crossing
PERFORM = "experiments.claims.ch3_roadmaps.replanning_live:perform"
MEASURED, POSES = "measured.json", "poses.npz"
EVERY = 5  # ticks, of the poses that are kept for pictures
VIEW = (20.0, 35.0)  # azimuth and elevation, degrees
STEPS = 40

SOON = 200.0  # ms
FEW = 10  # crossings with a bump: of fewer no verdict is made
DEEP = 2e-3  # m


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command-line options of this experiment to the parser."""
    add_backend(parser)
    parser.add_argument("--crossings", type=positive_whole, default=20, metavar="N", help="number of crossings (default: 20)")
    parser.add_argument("--lockstep", action="store_true", help="in lockstep instead of real time: the same result on any machine")
    parser.add_argument("--quick", action="store_true", help="a short version, to check that the experiment works")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Make the crossings that are not in `folder` yet, in launches of five, and return the results of all crossings.

    A launch is one run of the system.  In a crossing, the arm moves from the right of a ball to its left, and the ball becomes solid during
    the motion.
    """
    count = QUICK_CROSSINGS if arguments.quick else arguments.crossings
    after = np.random.default_rng([arguments.seed, 432]).uniform(SOONEST, LATEST, count)
    pieces = [after[i : i + PIECE].tolist() for i in range(0, len(after), PIECE)]
    with Progress() as progress:
        for number, piece in enumerate(pieces):
            place = folder / f"launch-{number:03}"
            progress.show(number / len(pieces), f"launch {number + 1} of {len(pieces)}")
            if not (place / MEASURED).exists():
                cross(place, Job(piece), arguments.seed + number, arguments.lockstep, arguments.backend)
                keep_poses(place)
                measure(place)
                for name in (POSITIONS, CONTACTS):
                    (place / name).unlink()
    return results(folder)


def results(folder: Path) -> dict[str, Any]:
    """Compute the results of the measured crossings in `folder`, as `findings` returns them; raises InvalidValue if there are none.

    Keys: "live", a dict of counts and times; "claims", a list with the judged claims, as dicts (`Claim.record`).
    """
    return findings(_crossings(folder))


def cross(folder: Path, job: Job, seed: int, lockstep: bool = False, backend: str = PHYSICS[0]) -> dict[str, Any]:
    """Launch a system that makes and records the crossings of a job in `folder`, and return the launcher's summary of the run.

    `job`: the crossings.  `seed`: of the simulated robot.  `lockstep`: True: every tick waits for all services; False: ticks follow the
    clock.  `backend`: physics engine, "pybullet" or "mujoco".  Raises LaunchFailed if the system fails or does not end.
    """
    write_job(folder, job)
    names: dict[str, Any] = {"world": str(WORLD), "simulator": {"world": str(SIMULATED), "backend": backend}}
    seconds = LONGEST * (1 + len(job.after))
    return launch(folder, PERFORM, title="Replanning", seed=seed, rate=RATE, speed=SPEED, seconds=seconds, lockstep=lockstep, **names)


def _crossings(folder: Path) -> list[Measures]:
    found = [one for path in sorted(folder.glob(f"launch-*/{MEASURED}")) for one in read_measured(path.parent)]
    if not found:
        raise InvalidValue(f"{folder} has no finished launch: the run was stopped before the first was over.")
    return found


class Measures(Struct, frozen=True):
    """Measurements of one crossing: a motion of the arm from the right of the ball to its left.

    `bumped`: whether the arm touched the ball on the short path; this first contact is the bump.  `command`: time [ms] from the bump until
    the motors execute a command that was computed after the request of the new goal.  `turn`: time [ms] from the bump until the joints stop
    approaching the old goal.  Both are -1 without a bump, inf if no motion followed.  `on`: the vertices to which the arm was commanded, in
    order; motions that ended early are included.  `arrived`: whether the arm reached the other side.  `seconds`: duration.  `deepest`:
    depth [m] of the deepest solid contact with the ball, by the simulator.  `thinking`: processor time [ms] from the end of the failed
    motion to the request of the next motion.
    """

    bumped: bool
    command: float
    turn: float
    on: list[int]
    arrived: bool
    seconds: float  # from the start to the other side
    deepest: float
    thinking: float


def measure(folder: Path) -> list[Measures]:
    """Compute the measures of each crossing of a launch from its recording, write them into its folder, and return them in order.

    A crossing is a motion of the arm from the right of the ball to its left.  A launch is one start of the live system, with a few
    crossings.  `folder`: folder of the launch.
    """
    q = read_positions(folder, robot())
    touches = [touch for touch in read_touches(folder / CONTACTS, 1.0 / RATE) if BALL in touch.pair]
    found = []
    for crossing in read_done(folder, Crossing):
        first, last = crossing.motions[0].asked, crossing.motions[-1].ended
        deep = [touch.depth for touch in touches if first <= touch.begin <= last]
        found.append(_measured(crossing, q, max(deep, default=0.0)))
    (folder / MEASURED).write_text(encoded(found, indent=1))
    return found


def read_measured(folder: Path) -> list[Measures]:
    """Read the measures of each crossing of a launch, in order, from the file that `measure` wrote into the folder of the launch.

    A launch is one run of the system, with a few crossings.
    """
    return decoded((folder / MEASURED).read_text(), list[Measures])


def keep_poses(folder: Path) -> None:
    """Save poses of the first crossing of a launch (one run of the system) for pictures, in poses.npz of its folder.

    The file contains `q` (T, n) rad, `times` (T,) s from the start of the crossing, and the times [s] `solid` (the ball becomes solid) and
    `bump` (the arm touches the ball).
    """
    q, crossing = read_positions(folder, robot()), read_done(folder, Crossing)[0]
    ticks = np.arange(crossing.motions[0].asked, crossing.motions[-1].ended, EVERY)
    solid, bump = ((tick - ticks[0]) / RATE for tick in (crossing.solid, _bump(crossing)))
    np.savez_compressed(folder / POSES, q=q[ticks - 2], times=(ticks - ticks[0]) / RATE, solid=solid, bump=bump)


def _kept_poses(folder: Path) -> Mapping[str, Array]:
    """Return the poses that `keep_poses` saved, from the first launch with such a file; `folder`: of the run.

    The keys are the names `q`, `times`, `solid` and `bump` (see `keep_poses`).  Raises InvalidValue if no launch has the file.
    """
    found = sorted(folder.glob(f"launch-*/{POSES}"))
    if not found:
        raise InvalidValue(f"{folder} has no launch-*/{POSES}, from which the filmstrip is drawn: begin a new run without --resume.")
    kept: Mapping[str, Array] = np.load(found[0])
    return kept


def _bump(crossing: Crossing) -> int:
    return next((motion.bump for motion in crossing.motions if motion.bump >= 0), -1)


def _measured(crossing: Crossing, q: Array, deepest: float) -> Measures:
    motions = crossing.motions
    failed = next((number for number, motion in enumerate(motions) if motion.bump >= 0), None)
    common: dict[str, Any] = {"on": [motion.vertex for motion in motions], "arrived": motions[-1].vertex == LEFT and motions[-1].bump < 0}
    common |= {"seconds": (motions[-1].ended - motions[0].asked) / RATE, "deepest": deepest}
    if failed is None:
        return Measures(False, -1.0, -1.0, **common, thinking=0.0)
    if failed == len(motions) - 1:
        return Measures(True, math.inf, math.inf, **common, thinking=0.0)
    bump, new = motions[failed].bump, motions[failed + 1]
    turn = _turned(q, bump, motions[failed].vertex, new.ended)
    command = 1e3 * (new.commanded - bump) / RATE
    return Measures(True, command, 1e3 * turn / RATE, **common, thinking=1e3 * new.thinking)


def _turned(q: Array, bump: int, vertex: int, ended: int) -> int:
    """Return the number of ticks from `bump` until the arm is nearest to a vertex, before tick `ended`.

    `q`: (T, n) rad, postures of the recording; row k - 2 is the posture at the beginning of tick k.  `bump`: tick at which the arm touched
    the ball.  `vertex`: number of the goal that the arm was approaching then.
    """
    space = new_map().space
    arm = q[:, robot().parts[PART].slice][:, space.columns]
    return int(np.linalg.norm(arm[bump - 2 : ended - 2] - space.samples[vertex], axis=1).argmin())


def findings(crossings: Sequence[Measures]) -> dict[str, Any]:
    """Return the results of the crossings as a dict with the keys "live" and "claims".

    "live": a dict with the number of "crossings", the number "with_a_bump" (contact of the arm with the ball), and the number that
    "arrived" on the other side.  If there was a bump, it also has the median and the maximum [ms] of the times "command", "turn" and
    "thinking" of `Measures`, with keys such as "command_ms_median" and "command_ms_most"; and "at_once_around", the number of crossings in
    which the arm, after the bump, moved to the vertex above the ball and from there to its left, without other motions.  "claims": a list
    with the judged claims, as dicts (`Claim.record`).
    """
    bumped = [one for one in crossings if one.bumped]
    row: dict[str, Any] = {"crossings": len(crossings), "with_a_bump": len(bumped), "arrived": sum(one.arrived for one in crossings)}
    if bumped:
        for name in ("command", "turn", "thinking"):
            values = np.array([getattr(one, name) for one in bumped])
            row |= {f"{name}_ms_median": float(np.median(values)), f"{name}_ms_most": float(values.max())}
        row |= {"at_once_around": sum(one.on[1:] == [ABOVE, LEFT] for one in bumped)}
    return {"live": row, "claims": judged(CLAIMS, crossings, bool(bumped))}


Crossings = Sequence[Measures]


def _if_enough(crossings: Crossings, holds: bool) -> bool | None:
    return holds if sum(one.bumped for one in crossings) >= FEW else None


@claim("thesis 4.3.2, fig. 4.7", "when the ball becomes solid the hand finds the path around it, to the other side", "immediately")
def around(crossings: Crossings) -> Measured:
    bumped = [one for one in crossings if one.bumped]
    arrived, straight = sum(one.arrived for one in bumped), sum(one.on[1:] == [ABOVE, LEFT] for one in bumped)
    seconds = float(np.median([one.seconds for one in bumped]))
    text = f"{arrived} of {len(bumped)} arrive, {straight} of them directly; {seconds:.1f} s in all"
    return text, _if_enough(crossings, arrived == len(bumped))


@claim(OUR_AIM, "the new path is under way within 200 ms of the bump, live, on robot_sim's clock", "at most 200 ms")
def soon(crossings: Crossings) -> Measured:
    command, turn = (np.array([getattr(one, name) for one in crossings if one.bumped]) for name in ("command", "turn"))
    text = (
        f"command in force after {np.median(command):.0f} ms, at most {command.max():.0f} ms; the joints stop approaching the old goal"
        f" after {np.median(turn):.0f} ms, at most {turn.max():.0f} ms"
    )
    return text, _if_enough(crossings, bool(command.max() <= SOON))


@claim(OUR_AIM, "no solid contact with the ball deeper than 2 mm while it re-plans", "0")
def harmless(crossings: Crossings) -> Measured:
    deepest, clear = 1e3 * max(one.deepest for one in crossings), sum(one.deepest == 0.0 for one in crossings)
    text = f"{deepest:.1f} mm; no contact in {clear} of {len(crossings)} crossings: the ball may become solid around the hand"
    return text, _if_enough(crossings, bool(deepest <= 1e3 * DEEP))


CLAIMS = (around, soon, harmless)


def figure(folder: Path) -> Path:
    """Draw two filmstrips as in thesis figure 4.7 into one file, and return the path of this file.

    The first strip shows the short motion through the ball, the second one the motion around it, in the first recorded crossing.  A second
    file gets the distributions of the times after the bump.  `folder`: of the run.  Raises InvalidValue if no crossing is finished, or if
    the poses of the first one are missing.
    """
    crossings, kept = _crossings(folder), _kept_poses(folder)
    plot_times(crossings).savefig(folder / "replanning-times.png", dpi=110)
    solid, bump = float(kept["solid"]), float(kept["bump"])

    def caption(motion: Motion, moment: int) -> str:
        t = motion.times[moment]
        state = "" if t < solid else ", solid" if t < bump else ", on around it"
        return f"{t:.1f} s{state}"

    through, around = _motion(_through_ball(), np.linspace(0.0, 1.0, STEPS), np.inf), _motion(kept["q"], kept["times"], solid)
    strips = [
        Strip(through, MARKER, (VIEW,), 6, "the ball is a ghost: the short path leads through it", lambda motion, moment: ""),
        Strip(around, MARKER, (VIEW,), 6, f"solid after {solid:.1f} s, contact after {bump:.1f} s: the hand goes around it", caption),
    ]
    return filmstrip(strips, folder / "replanning.png", height=260)


def _through_ball() -> Array:
    """Return T poses (T, n) rad on the straight line from the vertex RIGHT of the roadmap to the vertex LEFT.

    On this edge of the roadmap the hand would pass through the ball.
    """
    space = new_map().space
    q = np.repeat(robot().home[None], STEPS, axis=0)
    shares = np.linspace(0.0, 1.0, STEPS)[:, None]
    q[:, robot().parts[space.part].slice] = space.target(RIGHT) + shares * (space.target(LEFT) - space.target(RIGHT))
    return q


def _motion(q: Array, times: Array, solid: float) -> Motion:
    """Return the motion with these poses and times; the ball is solid from the time `solid` [s]."""
    known, poses, objects = model(), [], []
    for row, t in zip(q, times, strict=True):
        if t >= solid and known.world.objects[BALL].role == "ghost":
            known.world.set_role(BALL, "obstacle")
        poses.append(known.evaluate(row))
        objects.append(poses[-1].objects)
    return Motion(tuple(poses), np.asarray(times), tuple(objects))


def plot_times(crossings: Sequence[Measures]) -> Any:
    """Return a figure of the distributions of two times [ms] after the bump, the first contact of the arm with the ball.

    They are the time until the motors execute a command of the new path, and the time until the joints stop approaching the old goal.
    `crossings`: the measures of each crossing.
    """
    drawing = new_figure(6.0, 3.4)
    axes = drawing.subplots()
    for name, label in (("command", "a command of the new path is in force"), ("turn", "the joints stop approaching the old goal")):
        values = np.sort([getattr(one, name) for one in crossings if one.bumped])
        axes.step(values, np.arange(1, len(values) + 1) / max(len(values), 1), where="post", label=label)
    axes.axvline(SOON, color="0.5", linestyle="--", linewidth=0.8)
    xlabel = "ms from the bump, on robot_sim's clock"
    finish(axes, legend=8, xlabel=xlabel, ylabel="share of crossings", xlim=(0.0, None), ylim=(0.0, 1.02))
    return drawing


EXPERIMENT = Experiment(
    claim="when a ball on the path becomes solid, the hand takes the path around it at once",
    source="thesis 4.3.2, fig. 4.7",
    method=Steps(add_arguments, run, figure, results, (f"launch-*/{MEASURED}", f"launch-000/{POSES}")),
    claims=CLAIMS,
    repeats="crossings",
)
