# SPDX-License-Identifier: Apache-2.0
"""Babbling: collisions and completed commands under random position moves of 23 motors at 20 % speed, at a table (thesis 4.1.1).

Claim: without MoBeE the robot hits itself and the table hundreds of times in two hours; with MoBeE it never does, and MoBeE 2.0 completes
more of the commands, and more smoothly, than MoBeE 1.0.  Source: thesis 4.1.1; published: "approximately two hours over several trials of 5
to 20 minutes each with joint velocity limited to 20% of maximum ... MoBeE effectively prevented all of them", on the robot.  Here the robot
is simulated by PyBullet (with --backend mujoco: by MuJoCo), with all processes in lockstep (every tick waits for all of them).  The
postures are uniform over the whole ranges of torso (3 motors), head with eyes (6) and arms without hands (7 each), and their sequence is
the same in all modes: without MoBeE, with MoBeE 1.0 (a reflex, which moves the robot back along its recent poses) and with MoBeE 2.0 (a
controller with repulsive forces).  A command is a posture of one part.  It is completed if all motors of the part end within 10 degrees of
it, returned if the part ends within 5 degrees of where it began, and else deflected.

Run time: about an hour for 2 h of robot time in each of the three modes; --resume continues an interrupted run.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from experiments.claims.ch4_reflex.babbling_trial import (
    MODES,
    RATE,
    ROBOT,
    TITLES,
    Judged,
    Outcome,
    Trial,
    TrialFailed,
    measure,
    read_trial,
    run_trial,
    write_trial,
)
from experiments.kit.command_line import Progress, positive_number
from experiments.kit.experiment import Experiment, Steps
from experiments.kit.live.launch import add_backend
from experiments.kit.live.system import POSITIONS, Touch
from experiments.kit.plots import new_figure, saved
from mobee import load_robot
from mobee.errors import InvalidValue
from mobee.robot.robot import Robot

TRIAL = "trial.json"
SEED_STRIDE = 10_000  # seeds reserved for the trials of a run
MAX_ATTEMPTS = 3  # of a trial in which a process was late for a tick

OUTCOMES: tuple[Outcome, ...] = ("completed", "deflected", "returned")
MAX_DEPTH = 2e-3  # m, allowed with MoBeE 2.0
MAX_BEYOND = float(np.deg2rad(0.5))  # rad beyond a limit, allowed with MoBeE 2.0
STRICT = float(np.deg2rad(5.0))  # rad, a stricter criterion that is reported too
MIN_RATE = 100.0 / 7200.0  # events per second of robot time without MoBeE: a hundred in two hours
EDGES = (0.1, 0.2, 0.5, 1.0, 2.0)  # mm, of the depth histogram

LABEL, COLUMN = 38, 14
LIMITS = {"completed": ", within 10 deg", "deflected": "", "returned": ", within 5 deg"}
PRINTED_PAIRS = 8  # the most frequent first

COLORS = {"off": "tab:red", "one": "tab:orange", "two": "tab:blue"}
OUTCOME_COLORS = ("tab:green", "tab:olive", "0.7")
DRAWN_PAIRS = 12

Rows = Mapping[str, Mapping[str, Any]]  # by mode


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command-line options of this experiment to the parser."""
    add_backend(parser)
    parser.add_argument("--minutes", type=positive_number, default=120.0, metavar="M", help="of robot time in each mode (default: 120)")
    parser.add_argument("--trial", type=positive_number, default=10.0, metavar="M", help="robot time of a trial (default: 10)")
    parser.add_argument("--modes", nargs="+", choices=MODES, default=list(MODES), metavar="MODE", help=f"of {', '.join(MODES)}")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Run the trials that are not in `folder` yet, and return the results of all trials.

    Keys: "judged", a dict from the text of each claim to whether it holds; "passed", whether all claims hold; with --json also "modes", a
    dict from the mode to the measurements that `summarise` returns.  Modes: "off" (without MoBeE), "one" (MoBeE 1.0), "two" (MoBeE 2.0).
    Without --json a table is printed.  Raises TrialFailed if this machine is too busy for a trial.
    """
    robot = load_robot(ROBOT)
    lengths = trial_lengths(arguments.minutes, arguments.trial)
    total, done = len(lengths) * len(arguments.modes), 0
    with Progress() as progress:
        for number, minutes in enumerate(lengths):
            for mode in arguments.modes:
                place = folder / mode / f"{number:03}"
                if not (place / TRIAL).exists():
                    text = f"{TITLES[mode]}, trial {number + 1} of {len(lengths)}"
                    seed, ticks = SEED_STRIDE * arguments.seed + number, round(60.0 * minutes * RATE)
                    _run_until_repeatable(place, mode, robot, seed, ticks, _shower(progress, done, total, text), arguments.backend)
                done += 1
    rows = {mode: summarise(read_trials(folder, mode)) for mode in arguments.modes}
    judged = verdict(rows)
    if not arguments.json:
        print(as_table(rows))
    return {"passed": all(judged.values()), "judged": judged, **({"modes": rows} if arguments.json else {})}


def _run_until_repeatable(place: Path, mode: str, robot: Robot, seed: int, ticks: int, show: Callable[[float], None], backend: str) -> None:
    """Run a trial, and repeat it until no process was late for a tick; then write its measurements to the folder `place`.

    `ticks`: duration of the trial.  `show`: is called with the finished share of the trial, 0 to 1.  Raises TrialFailed if a process was
    late in each of 3 attempts.
    """
    for _ in range(MAX_ATTEMPTS):
        run_trial(place, mode, robot, seed, ticks, show, backend)
        trial = measure(place, robot, 1.0 / RATE)
        if trial.lockstep.repeatable:
            write_trial(place / TRIAL, trial)
            (place / POSITIONS).unlink()
            return
    raise TrialFailed(f"{mode}: in {MAX_ATTEMPTS} trials a process was late for a tick: this machine is too busy; see {place / 'launch'}")


def _shower(progress: Progress, done: int, total: int, text: str) -> Callable[[float], None]:
    """Return a function that shows the finished share of all trials, given that of the current trial."""
    return lambda share: progress.show((done + share) / total, text)


def trial_lengths(minutes: float, trial: float) -> list[float]:
    """Return the durations [min] of trials that last `minutes` in all.  Each lasts `trial` min; the last may be shorter."""
    whole = int(minutes / trial + 1e-9)
    rest = minutes - whole * trial
    return [trial] * whole + ([rest] if rest > 1e-6 * trial else [])


def read_trials(folder: Path, mode: str) -> list[Trial]:
    """Read the measurements of each finished trial of a mode from the folder of a run, in the order of the trials.

    `mode`: a key of TITLES ("off", "one" or "two").
    """
    return [read_trial(path) for path in sorted(folder.glob(f"{mode}/*/{TRIAL}"))]


def summarise(trials: Sequence[Trial]) -> dict[str, Any]:
    """Return the numbers of one mode (without MoBeE, MoBeE 1.0 or MoBeE 2.0) over all its trials.

    Main keys: "collisions", number of solid contacts; "deepest_mm", depth of the deepest one; "pairs", dict from a pair of shapes to its
    number of contacts; "commands", number of commands to a part; "completed", "deflected" and "returned", how many commands had this
    outcome (as in `babbling_trial.Judged`); "worst_beyond_limit_deg", largest distance of a motor beyond a limit, negative inside;
    "jerk_over_speed", rms jerk divided by rms speed [1/s^2].  Angles are in degrees where the key says so, else in rad.
    """
    touches = [touch for trial in trials for touch in trial.touches]
    commands = [command for trial in trials for command in trial.commands]
    seconds = sum(trial.seconds for trial in trials)
    furthest = max(trials, key=lambda trial: trial.beyond)
    pairs = Counter(touch.pair for touch in touches)
    left = [distance for command in commands for distance in command.left.values()]
    jerk = _rms([trial.jerk_squared for trial in trials], trials)
    speed = _rms([trial.speed_squared for trial in trials], trials)
    whole = sum(set(command.outcomes.values()) == {"completed"} for command in commands)
    return {
        "minutes": round(seconds / 60.0, 2),
        "trials": len(trials),
        "times_real_time": round(seconds / sum(trial.seconds / trial.lockstep.speed for trial in trials), 2),
        "collisions": len(touches),
        "deepest_mm": round(1e3 * max((touch.depth for touch in touches), default=0.0), 3),
        "depth_histogram_mm": depth_histogram(touches),
        "pairs": dict(pairs.most_common()),
        "worst_beyond_limit_deg": round(float(np.rad2deg(furthest.beyond)), 3),
        "worst_motor": furthest.motor,
        "postures": len(commands),
        "postures_completed": whole,
        "commands": sum(len(command.outcomes) for command in commands),
        **{outcome: _count(commands, outcome) for outcome in OUTCOMES},
        "within_5_deg": sum(distance <= STRICT for distance in left),
        "left_median_deg": round(float(np.rad2deg(np.median(left))), 2) if left else None,
        "endings": dict(Counter(ending for command in commands for ending in command.endings.values())),
        "seconds_a_posture": _mean([command.duration for command in commands]),
        "path_rad": _mean([command.path for command in commands]),
        "straight_path_rad": _mean([command.way for command in commands]),
        "path_a_minute_rad": round(60.0 * sum(trial.path for trial in trials) / seconds, 2),
        "speed_rms": round(speed, 4),
        "jerk_rms": round(jerk, 2),
        "jerk_over_speed": round(jerk / max(speed, 1e-9), 1),
        "jerk_max": round(max(trial.jerk_max for trial in trials), 1),
    }


def verdict(rows: Rows) -> dict[str, bool]:
    """Return a dict from the text of each claim to whether it holds.  A claim is absent if the modes that it compares were not run.

    `rows`: a dict from the mode ("off", "one", "two": without MoBeE, MoBeE 1.0, MoBeE 2.0) to the result of `summarise`.
    """
    claims: dict[str, bool] = {}
    off, one, two = (rows.get(mode) for mode in ("off", "one", "two"))
    if off:
        hundreds = max(1.0, MIN_RATE * 60.0 * off["minutes"])
        claims["without MoBeE it collides, hundreds of times in two hours"] = off["collisions"] >= hundreds
    if two:
        claims["with 2.0 no listed contact is deeper than 2 mm"] = two["deepest_mm"] <= 1e3 * MAX_DEPTH
        claims["with 2.0 no joint is beyond its limit by more than 0.5 degrees"] = two["worst_beyond_limit_deg"] <= np.rad2deg(MAX_BEYOND)
    if one and two:
        claims["2.0 completes a larger share of the commands than 1.0"] = share(two, "completed") > share(one, "completed")
        claims["2.0 moves more smoothly than 1.0"] = two["jerk_over_speed"] < one["jerk_over_speed"]
    return {claim: bool(holds) for claim, holds in claims.items()}


def share(row: Mapping[str, Any], count: str) -> float:
    """Return a count as a share of the commands, in [0, 1]; 0 if there are no commands.

    `row`: a result of `summarise`.  `count`: a key of it with a count, as "completed".
    """
    return float(row[count] / row["commands"]) if row["commands"] else 0.0


def _count(commands: Sequence[Judged], outcome: Outcome) -> int:
    return sum(each == outcome for command in commands for each in command.outcomes.values())


def _rms(squares: Sequence[float], trials: Sequence[Trial]) -> float:
    """Return the root mean square of a quantity over all trials.

    `squares`: for each trial, the mean of the squared quantity; it is weighted by the duration of the trial.
    """
    return float(np.sqrt(np.average(squares, weights=[trial.seconds for trial in trials])))


def _mean(values: Sequence[float]) -> float | None:
    return round(float(np.mean(values)), 2) if values else None


def depth_histogram(events: Iterable[Touch]) -> dict[str, int]:
    """Return the number of contacts in each range of depth.  The keys are the ranges in mm, as text.

    `events`: the contacts.
    """
    depths = [1e3 * event.depth for event in events]
    bounds = (0.0, *EDGES, float("inf"))
    labels = [f"<{EDGES[0]:g}", *(f"{low:g}-{high:g}" for low, high in zip(EDGES, EDGES[1:], strict=False)), f">{EDGES[-1]:g}"]
    return {label: sum(low <= depth < high for depth in depths) for label, low, high in zip(labels, bounds[:-1], bounds[1:], strict=True)}


def as_table(rows: Rows) -> str:
    """Return the results as a text table with a column for each mode.

    `rows`: a dict from the mode ("off", "one", "two": without MoBeE, MoBeE 1.0, MoBeE 2.0) to the result of `summarise`.
    """
    lines = [_line("", [TITLES[mode] for mode in rows])]

    def add(label: str, text: Mapping[str, str]) -> None:
        lines.append(_line(label, list(text.values())))

    def plain(label: str, key: str, digits: int = 0) -> None:
        add(label, {mode: _number(row[key], digits) for mode, row in rows.items()})

    plain("robot time [min]", "minutes", 1)
    plain("trials", "trials")
    plain("  times real time", "times_real_time", 1)
    plain("collisions (solid contacts)", "collisions")
    for depth in next(iter(rows.values()))["depth_histogram_mm"]:
        add(f"  {depth} mm deep", {mode: str(row["depth_histogram_mm"][depth]) for mode, row in rows.items()})
    plain("  deepest [mm]", "deepest_mm", 2)
    plain("furthest beyond a joint limit [deg]", "worst_beyond_limit_deg", 2)
    plain("commands (postures of a part)", "commands")
    for outcome in OUTCOMES:
        add(f"  {outcome}{LIMITS[outcome]}", {mode: f"{share(row, outcome):.0%}" for mode, row in rows.items()})
    add("  within 5 deg", {mode: f"{share(row, 'within_5_deg'):.0%}" for mode, row in rows.items()})
    plain("  remaining error, median [deg]", "left_median_deg", 1)
    add("postures of all parts completed", {mode: f"{row['postures_completed']} of {row['postures']}" for mode, row in rows.items()})
    plain("time per posture [s]", "seconds_a_posture", 1)
    plain("path per posture [rad, all motors]", "path_rad", 1)
    plain("  straight path to it [rad]", "straight_path_rad", 1)
    plain("speed, rms [rad/s]", "speed_rms", 3)
    plain("jerk, rms [rad/s^3]", "jerk_rms", 1)
    plain("  largest [rad/s^3]", "jerk_max", 0)
    plain("  over speed, rms [1/s^2]", "jerk_over_speed", 0)
    return "\n".join([*lines, *_pairs(rows)])


def _ranked(rows: Rows) -> list[str]:
    """Return the pairs that touched, the most frequent first."""
    total = sum((Counter(row["pairs"]) for row in rows.values()), Counter[str]())
    return sorted(total, key=lambda pair: (-total[pair], pair))


def _pairs(rows: Rows) -> list[str]:
    """Return lines with the pairs that touched, the most frequent first."""
    ranked = _ranked(rows)
    lines = ["collisions by pair:"] if ranked else []
    lines += [
        _line(f"  {pair.replace(' ', ' - ')}", [str(row["pairs"].get(pair, 0)) for row in rows.values()]) for pair in ranked[:PRINTED_PAIRS]
    ]
    rest = [str(sum(row["pairs"].get(pair, 0) for pair in ranked[PRINTED_PAIRS:])) for row in rows.values()]
    return [*lines, _line(f"  {len(ranked) - PRINTED_PAIRS} more", rest)] if len(ranked) > PRINTED_PAIRS else lines


def _line(label: str, cells: list[str]) -> str:
    return f"{label:<{LABEL}}" + "".join(f"{cell:>{COLUMN}}" for cell in cells)


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def figure(folder: Path) -> Path:
    """Draw the finished trials of the run in `folder` to a file.  Returns its path; raises InvalidValue if there are none."""
    trials = {mode: found for mode in MODES if (found := read_trials(folder, mode))}
    if not trials:
        raise InvalidValue(f"{folder} has no finished trial: the run was stopped before the first was over.")
    return saved(plot({mode: summarise(found) for mode, found in trials.items()}), folder)


def plot(rows: Rows) -> Any:
    """Return a figure of collisions by pair and by depth, of the outcomes of the commands, and of the jerk of the motion.

    `rows`: a dict from the mode ("off", "one", "two": without MoBeE, MoBeE 1.0, MoBeE 2.0) to the result of `summarise`.
    """
    drawing = new_figure(11.0, 7.5)
    axes = drawing.subplots(2, 2)
    minutes = ", ".join(f"{TITLES[mode]} {row['minutes']:g} min" for mode, row in rows.items())
    drawing.suptitle(f"Motor babbling at 20 % speed, thesis 4.1.1 ({minutes} of robot time)")
    _by_pair(axes[0, 0], rows)
    _by_depth(axes[0, 1], rows)
    _outcomes(axes[1, 0], rows)
    _smoothness(axes[1, 1], rows)
    return drawing


def _by_pair(axes: Any, rows: Rows) -> None:
    pairs = _ranked(rows)[:DRAWN_PAIRS]
    _bars(axes.barh, rows, [[row["pairs"].get(pair, 0) for pair in pairs] for row in rows.values()])
    axes.set_yticks(range(len(pairs)), [pair.replace(" ", " - ") for pair in pairs], fontsize=8)
    axes.invert_yaxis()
    axes.set(title="Collisions by pair" if pairs else "No collisions", xlabel="events")
    axes.set_xlim(0.0, max(1.0, axes.get_xlim()[1]))


def _by_depth(axes: Any, rows: Rows) -> None:
    depths = list(next(iter(rows.values()))["depth_histogram_mm"])
    _bars(axes.bar, rows, [list(row["depth_histogram_mm"].values()) for row in rows.values()])
    axes.set_xticks(range(len(depths)), depths)
    axes.set(title=f"Depth of the collisions (allowed with 2.0: {1e3 * MAX_DEPTH:g} mm)", xlabel="mm", ylabel="events")
    axes.set_ylim(0.0, max(1.0, axes.get_ylim()[1]))
    axes.legend(fontsize=8)


def _outcomes(axes: Any, rows: Rows) -> None:
    bottom = [0.0] * len(rows)
    for outcome, color in zip(OUTCOMES, OUTCOME_COLORS, strict=True):
        heights = [share(row, outcome) for row in rows.values()]
        axes.bar(range(len(rows)), heights, bottom=bottom, color=color, label=outcome)
        bottom = [below + height for below, height in zip(bottom, heights, strict=True)]
    axes.set_xticks(range(len(rows)), [f"{TITLES[mode]}\n{row['commands']} commands" for mode, row in rows.items()])
    axes.set(ylabel="share", ylim=(0.0, 1.0))
    axes.set_title("Outcomes of the commands", pad=22.0)
    axes.legend(fontsize=8, ncols=len(OUTCOMES), loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False)


def _smoothness(axes: Any, rows: Rows) -> None:
    axes.bar(range(len(rows)), [row["jerk_over_speed"] for row in rows.values()], color=[COLORS[mode] for mode in rows])
    axes.set_xticks(range(len(rows)), [TITLES[mode] for mode in rows])
    axes.set(title="Roughness: jerk over speed, each rms", ylabel="1/s$^2$")


def _bars(bars: Callable[..., Any], rows: Rows, heights: list[list[int]]) -> None:
    """Draw grouped bars: a group for each category, such as a pair of solids, and in it one bar for each mode.

    `bars`: the method `bar` or `barh` of matplotlib axes.  `rows`: a dict with the modes as keys.  `heights`: for each mode, in the order
    of `rows`, a list with the height of its bar in each group.
    """
    width = 0.8 / len(rows)
    for i, (mode, values) in enumerate(zip(rows, heights, strict=True)):
        shift = (i - (len(rows) - 1) / 2.0) * width
        bars([x + shift for x in range(len(values))], values, width, color=COLORS[mode], label=TITLES[mode])


EXPERIMENT = Experiment(
    claim="random position moves cause no collisions under MoBeE, and 2.0 deflects them less than 1.0",
    source="thesis 4.1.1",
    method=Steps(add_arguments, run, figure),
)
