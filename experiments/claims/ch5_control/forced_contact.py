# SPDX-License-Identifier: Apache-2.0
"""Forced contact: growing forces push a hand into table, body and joint limits, and pull it to and through singular poses.

Claim: with the default gains no force of a client drives a solid deeper than 2 mm into anything or an arm beyond a constraint or a limit;
and a hand that is pulled to a target, reachable or not, through singular poses or not, does not stop before it arrives and does not
oscillate by more than 1 mm at rest.  Source: thesis 5.2.2-5.2.4 (f_config and f_work are bounded so that they "not dominate the constraint
forces") and 5.1 (J^T control of an unreachable target "will cause the robot to oscillate").  Published: no numbers.  Run time: about six
minutes.

The experiment has two parts, for the gain sets "default" and "published_2014".  Walls: a force that rises in levels of three seconds
presses the robot into table, body or limits.  Targets: `mobee.Reacher` pulls the hand to targets with all motors of the body.  Depths are
measured at the true joint positions.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from experiments.kit.control.measures import clause_violations, deepest, limit_violations, oscillation
from experiments.kit.control.plant_runs import COLORS, GAINS, PERIOD, PUSHES, icub, icub_at_table, place, run_plant
from experiments.kit.experiment import Experiment
from experiments.kit.plots import new_figure
from experiments.kit.run_folder import rounded
from experiments.kit.sweep import Cells, Condition, Sweep
from mobee import Gains
from mobee.arrays import Array
from mobee.control import Reacher
from mobee.simulation import OfflinePlant

SOLID, CLAUSE, LIMIT = 2.0, 2.0, 0.0  # mm; degrees beyond constraints and limits: allowed with the default gains
OSCILLATION, DEAD = 1.0, 0.3  # mm at rest; s without motion before the end: allowed

LEVELS = (0.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0)  # N/kg at a marker; rad/s^2 at a motor; before the squash
QUICK_LEVELS, QUICK_CASES = LEVELS[::3], 3  # walls and targets
LEVEL_SECONDS, LEVEL_REST = 3.0, 2.0  # s, duration of a level; its end, in which oscillation is measured
INSIDE = np.deg2rad(1.0)  # rad; motors nearer to their limits at home are not judged
SAMPLING = 0.02  # s between two postures whose contacts are evaluated
PALMS = ("left_palm", "right_palm")

MARKER, ARM = "left_palm", "left_arm"
DRAWN_SECONDS, DRAWN_REST = 60.0, 3.0  # s, the run; its end, in which oscillation is measured
# m/s, s, m: a hand slower than this during the window, farther than this from its end position, has stopped early.
SLOW, WINDOW, NEAR = 2e-4, 0.5, 0.01

Record = dict[str, Any]
PANELS = (
    ("field_mm", "deepest field [mm]"),
    ("solid_mm", "deepest solid [mm]"),
    ("clause_deg", "violation of a constraint [deg]"),
    ("limit_deg", "beyond the nearest limit [deg]"),
)


@dataclass(frozen=True, slots=True)
class Goal:
    """A start of the left arm and the targets to which its hand is pulled one after the other.

    `start`: angles of the arm's first motors [deg].  `targets`: positions relative to the palm at home [m], root frame.
    """

    start: tuple[float, ...]
    targets: tuple[tuple[float, float, float], ...]


HOME = (-26.0, 20.0, 0.0, 60.0, 0.0, 0.0, 0.0)
STRETCHED = (-70.0, 30.0, 0.0, 16.0, 0.0, -40.0, 0.0)
ALIGNED = (-26.0, 20.0, 0.0, 60.0, 0.0, 0.0, 0.0)  # at wrist pitch 0 the axes of prosup and wrist yaw are aligned
GOALS = {
    "in-reach": Goal(HOME, ((-0.05, 0.0, 0.15),)),
    "stretched-ahead": Goal(HOME, ((-0.5, 0.0, 0.1),)),
    "stretched-aside": Goal(HOME, ((0.1, -0.6, 0.1),)),
    "stretched-above": Goal(HOME, ((0.0, 0.0, 0.8),)),
    "behind-the-robot": Goal(HOME, ((0.8, -0.1, 0.2),)),
    "out-of-a-stretched-arm": Goal(STRETCHED, ((-0.02, 0.05, 0.05),)),
    "stretched-and-back": Goal(HOME, ((-0.5, 0.0, 0.15), (0.0, 0.0, 0.1))),
    "wrist-axes-aligned": Goal(ALIGNED, ((-0.05, 0.1, 0.1), (-0.05, -0.1, 0.1))),
}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options --gains, --walls and --targets to the parser."""
    walls, targets = list(PUSHES), list(GOALS)
    parser.add_argument("--gains", nargs="+", choices=GAINS, default=list(GAINS), metavar="SET", help=f"of {', '.join(GAINS)}")
    parser.add_argument("--walls", nargs="+", choices=walls, default=walls, metavar="WALL", help=f"of {', '.join(walls)}")
    parser.add_argument("--targets", nargs="*", choices=targets, default=targets, metavar="TARGET", help=f"of {', '.join(targets)}")


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the conditions of the sweep: every wall and every target with each gain set.

    A wall is a key of PUSHES: the name of a push of the robot into the table, its own body or joint limits.  A target is a key of GOALS.
    With --quick: the first three walls and targets, with three levels of force.
    """
    levels, cases = (QUICK_LEVELS, QUICK_CASES) if arguments.quick else (LEVELS, None)
    found = []
    for gains in arguments.gains:
        for wall in arguments.walls[:cases]:
            settings = {"gains": gains, "wall": wall, "levels": list(levels)}
            found.append(Condition(f"{gains}-{wall}", settings, LEVEL_SECONDS * len(levels)))
        for target in arguments.targets[:cases]:
            found.append(Condition(f"{gains}-drawn-{target}", {"gains": gains, "target": target}, DRAWN_SECONDS))
    return found


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Run the trial that the settings name: press the robot into a wall, or pull its hand to targets.

    For a wall: {"pressed": the result of `press`}.  For a target: "drawn", "times" (T,) s and "distances" (T,) m, the results of
    `draw_hand`.  `settings`: "gains" and either "wall" and "levels" or "target", the arguments of these functions.  `seed`: of the plant.
    """
    if "wall" in settings:
        return {"pressed": press(settings["gains"], settings["wall"], settings["levels"], seed)}
    drawn, times, distances = draw_hand(settings["gains"], settings["target"], seed)
    return {"drawn": drawn, "times": times, "distances": distances}


def press(gains: str, wall: str, levels: Sequence[float], seed: int) -> list[Record]:
    """Push the robot from home with one level of force after the other, and return a record for each level.

    `gains`: name of the gain set.  `wall`: a key of PUSHES, the markers or motors that are pushed and the direction.  `seed`: of the plant.
    `levels`: forces before they are bounded by the control law (squash, eq. 5.8), in N/kg at a marker or rad/s^2 at a motor.

    Each record has the worst values during the level: "solid_mm", depth of contacts of solids with an object of the world, or of two links
    of the robot that are in the simulator's list of pairs; "pair", the deepest of these pairs, "" without contact; "beside_mm", depth of
    contacts of all other pairs of solids; "field_mm", depth of contacts of fields, volumes that are not solid; "clause_deg" and
    "limit_deg", distances beyond constraints and limits, negative inside; "restless_mm", oscillation of the palms in the last 2 s of the
    level.
    """
    plant = OfflinePlant(icub_at_table(), seed, Gains.named(gains), dt=PERIOD[gains])
    robot, step = plant.robot, max(1, round(SAMPLING / plant.dt))
    free = limit_violations(robot, robot.home[None])[0] < -INSIDE
    found = []
    for force in levels:
        PUSHES[wall](plant.controller, force)
        run = run_plant(plant, LEVEL_SECONDS)
        depths, rest = deepest(icub_at_table(), run.q[::step]), run.last(LEVEL_REST)
        record = rounded(
            gains=gains,
            wall=wall,
            force=force,
            solid_mm=1e3 * depths.solid,
            field_mm=1e3 * depths.field,
            clause_deg=_worst(clause_violations(robot, run.q)),
            limit_deg=_worst(limit_violations(robot, run.q)[:, free]),
            restless_mm=1e3 * max(oscillation(icub_at_table(), rest, marker) for marker in PALMS),
            beside_mm=1e3 * depths.beside,
            pair=depths.pair,
        )
        found.append(record)
    return found


def _worst(angles: Array) -> float:
    return float(np.rad2deg(angles.max()))


def draw_hand(gains: str, name: str, seed: int) -> tuple[Record, Array, Array]:
    """Pull the left hand from a start posture to one target after the other.

    `gains`: name of the gain set, "default" or "published_2014".  `name`: a key of GOALS, which gives the start posture and the targets.
    `seed`: of the plant.

    Returns the measurements, times (T,) s, and the distances (T,) m of the hand from the current target at these times.  The measurements
    are "oscillation_mm" and "from_target_mm", oscillation and distance from the last target at the end; "dead_s", the longest time for
    which the hand stood still before it was at its end position; and the names "gains" and "target".
    """
    goal, robot = GOALS[name], icub().robot
    plant = OfflinePlant(icub(), seed, Gains.named(gains), dt=PERIOD[gains])
    start = robot.home.copy()
    first = robot.parts[ARM].start
    start[first : first + len(goal.start)] = np.deg2rad(goal.start)
    place(plant, start)
    home = icub().evaluate(robot.home).position(MARKER)
    targets = [home + np.array(target) for target in goal.targets]
    ticks = round(DRAWN_SECONDS / plant.dt / len(targets))
    reacher = Reacher(plant.controller, MARKER, targets[0])

    def pull(tick: int) -> None:
        nonlocal reacher
        q = plant.q
        if tick and tick % ticks == 0:
            reacher.stop(q)
            reacher = Reacher(plant.controller, MARKER, targets[tick // ticks])
        reacher.update(q, plant.dt)

    run = run_plant(plant, ticks * plant.dt * len(targets), pull)
    hand = icub().evaluate(run.q).position(MARKER)
    dead = max(dead_time(hand[i * ticks : (i + 1) * ticks], plant.dt) for i in range(len(targets)))
    distances = np.linalg.norm(hand - np.repeat(targets, ticks, axis=0), axis=1)
    still = 1e3 * oscillation(icub(), run.last(DRAWN_REST), MARKER)
    drawn = rounded(gains=gains, target=name, oscillation_mm=still, dead_s=dead, from_target_mm=1e3 * float(distances[-1]))
    return drawn, run.times, distances


def dead_time(hand: Array, dt: float) -> float:
    """Return the longest time [s] for which the hand stopped before it arrived at its end position; 0 if it did not stop.

    `hand`: positions (T, 3) m.  `dt`: time between two of them [s].  The hand has stopped if it moves at less than 0.2 mm/s over 0.5 s and
    is more than 1 cm from its end position.  Shorter stops are ignored.
    """
    window = max(1, round(WINDOW / dt))  # single ticks are meaningless because of the motors' play
    speed = np.linalg.norm(hand[window:] - hand[:-window], axis=1) / (window * dt)
    stopped = (speed < SLOW) & (np.linalg.norm(hand[:-window] - hand[-1], axis=1) > NEAR)
    begins = np.flatnonzero(stopped & ~np.r_[False, stopped[:-1]])
    ends = np.flatnonzero(stopped & ~np.r_[stopped[1:], False])
    return float(((ends - begins).max() + window) * dt) if len(begins) else 0.0


def findings(found: Cells) -> dict[str, Any]:
    """Return the largest measurements for each gain set, and "passed".

    The value of a gain set is a dict; its keys are the walls, and for each target "drawn: TARGET".  Its values are dicts with the largest
    measurements, with keys as in the results of `press` and `draw_hand`.  "passed": whether with the default gains solids are at most 2 mm
    deep, constraints violated by at most 2 degrees, limits not exceeded, oscillations at most 1 mm, and times without motion at most 0.3 s;
    None if the default gains were not run.
    """
    pressed, drawn = _grouped(found)
    table: dict[str, Any] = {gains: {} for gains in GAINS}
    for (gains, wall), levels in pressed.items():
        deep = max(levels, key=lambda level: float(level["solid_mm"]))
        others = _largest(levels, "field_mm", "clause_deg", "limit_deg", "restless_mm")
        table[gains][wall] = {"solid_mm": deep["solid_mm"], "pair": deep["pair"] or "none", **others}
    for (gains, target), runs in drawn.items():
        table[gains][f"drawn: {target}"] = _largest(runs, "oscillation_mm", "dead_s", "from_target_mm")
    of_default = [row for (gains, _), rows in (pressed | drawn).items() if gains == "default" for row in rows]
    allowed = {"solid_mm": SOLID, "clause_deg": CLAUSE, "limit_deg": LIMIT, "oscillation_mm": OSCILLATION, "dead_s": DEAD}
    passed = all(row[name] <= most for row in of_default for name, most in allowed.items() if name in row)
    rows = {gains: rows for gains, rows in table.items() if rows}
    return {"passed": passed if of_default else None, **rows}  # the claim is about the default gains


def _grouped(found: Cells) -> tuple[dict[tuple[str, str], list[Record]], dict[tuple[str, str], list[Record]]]:
    """Return two dicts that group the measurements: of pressed robots by (gain set, wall), and of pulled hands by (gain set, target).

    Each value is a list of the records that `press` (one per level of force) or `draw_hand` (one per seed) returned.  Groups without
    records are left out.
    """
    pressed: dict[tuple[str, str], list[Record]] = {key: [] for key in product(GAINS, PUSHES)}
    drawn: dict[tuple[str, str], list[Record]] = {key: [] for key in product(GAINS, GOALS)}
    for result in found.values():
        for record in result.values.get("pressed", ()):
            pressed[record["gains"], record["wall"]].append(record)
        if "drawn" in result.values:
            drawn[result.values["drawn"]["gains"], result.values["drawn"]["target"]].append(result.values["drawn"])
    return {key: mine for key, mine in pressed.items() if mine}, {key: mine for key, mine in drawn.items() if mine}


def _largest(records: Sequence[Record], *names: str) -> Record:
    return {name: max(record[name] for record in records) for name in names}


def plot(found: Cells) -> Any:
    """Return a figure of depths and violations over the force, and of the distance of the hand from its targets over time."""
    drawing = new_figure(15.0, 8.0)
    above, below = drawing.subfigures(2, 1, height_ratios=(1.0, 1.1))
    _plot_pressing(above.subplots(1, len(PANELS)), _grouped(found)[0])
    names = [name for name in GOALS if any(result.cell.settings.get("target") == name for result in found.values())]
    if names:
        panels = np.ravel(below.subplots(2, (len(names) + 1) // 2, squeeze=False))
        for axes, name in zip(panels, names, strict=False):
            _plot_distances(axes, name, {key: result.values for key, result in found.items() if result.cell.settings.get("target") == name})
        for axes in panels[len(names) :]:
            axes.set_axis_off()
    return drawing


def _plot_pressing(panels: Any, pressed: Mapping[tuple[str, str], Sequence[Record]]) -> None:
    for axes, (quantity, label) in zip(panels, PANELS, strict=True):
        for (gains, _), mine in pressed.items():
            forces, values = [level["force"] for level in mine], [level[quantity] for level in mine]
            axes.plot(forces, values, ".-", color=COLORS[gains], alpha=0.6, linewidth=0.9)
        axes.set_xscale("symlog", linthresh=LEVELS[1])
        axes.set(xlabel="force before the squash [per unit mass]", ylabel=label)
        axes.grid(alpha=0.2)
    panels[1].set_ylim(-0.2, max(5.0, panels[1].get_ylim()[1]))
    for axes in panels[2:]:
        axes.axhline(0.0, color="0.3", linewidth=0.8)
    for gains, color in COLORS.items():
        panels[0].plot([], [], color=color, label=f"{gains}, one line per wall")
    panels[0].legend(fontsize=7)


def _plot_distances(axes: Any, name: str, runs: dict[str, dict[str, Any]]) -> None:
    for values in runs.values():
        drawn = values["drawn"]
        label = f"{drawn['gains']}: at rest ±{drawn['oscillation_mm']:.2f} mm, stopped {drawn['dead_s']:.1f} s"
        axes.plot(values["times"], values["distances"], color=COLORS[drawn["gains"]], label=label)
    axes.set_title(f"drawn: {name.replace('-', ' ')}", fontsize=8)
    axes.set(xlabel="time [s]", ylabel="from the target [m]", ylim=(0.0, None))
    axes.legend(fontsize=6)
    axes.grid(alpha=0.2)


EXPERIMENT = Experiment(
    claim="no force of a client drives the robot into table, body or limits, and a hand drawn through singular poses does not oscillate",
    source="thesis 5.1 and 5.2.2-5.2.4",
    method=Sweep(conditions, trial, findings, plot, seeds=1, add_options=add_options),
)
