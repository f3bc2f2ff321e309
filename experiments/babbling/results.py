"""What all trials of a mode amount to, and whether the claim stands."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.babbling.contacts import depth_histogram
from experiments.babbling.measured import Judged, Outcome, Trial

OUTCOMES: tuple[Outcome, ...] = ("completed", "deflected", "returned")
DEEPEST = 2e-3  # m, allowed with MoBeE 2.0
BEYOND = float(np.deg2rad(0.5))  # rad, allowed with MoBeE 2.0
STRICT = float(np.deg2rad(5.0))  # rad, told beside what counts as completed
HUNDREDS = 100.0 / 7200.0  # events a second of robot time without MoBeE: hundreds in two hours


def summarise(trials: Sequence[Trial]) -> dict[str, Any]:
    """The row of a mode: lengths in mm, angles in degrees, paths in rad."""
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
        "straight_way_rad": _mean([command.way for command in commands]),
        "path_a_minute_rad": round(60.0 * sum(trial.path for trial in trials) / seconds, 2),
        "speed_rms": round(speed, 4),
        "jerk_rms": round(jerk, 2),
        "jerk_over_speed": round(jerk / max(speed, 1e-9), 1),
        "jerk_max": round(max(trial.jerk_max for trial in trials), 1),
    }


def verdict(rows: Mapping[str, Mapping[str, Any]]) -> dict[str, bool]:
    """The claims that can be judged with the modes that were run."""
    claims: dict[str, bool] = {}
    off, one, two = (rows.get(mode) for mode in ("off", "one", "two"))
    if off:
        hundreds = max(1.0, HUNDREDS * 60.0 * off["minutes"])
        claims["without MoBeE it collides, hundreds of times in two hours"] = off["collisions"] >= hundreds
    if two:
        claims["with 2.0 no listed contact is deeper than 2 mm"] = two["deepest_mm"] <= 1e3 * DEEPEST
        claims["with 2.0 no joint is beyond its limit by more than 0.5 degrees"] = two["worst_beyond_limit_deg"] <= np.rad2deg(BEYOND)
    if one and two:
        claims["2.0 completes a larger share of the commands than 1.0"] = share(two, "completed") > share(one, "completed")
        claims["2.0 moves more smoothly than 1.0"] = two["jerk_over_speed"] < one["jerk_over_speed"]
    return {claim: bool(stands) for claim, stands in claims.items()}


def share(row: Mapping[str, Any], count: str) -> float:
    """What share of the commands a count is; 0 when there are none."""
    return float(row[count] / row["commands"]) if row["commands"] else 0.0


def _count(commands: Sequence[Judged], outcome: Outcome) -> int:
    return sum(each == outcome for command in commands for each in command.outcomes.values())


def _rms(squares: Sequence[float], trials: Sequence[Trial]) -> float:
    """Of mean squares, one a trial."""
    return float(np.sqrt(np.average(squares, weights=[trial.seconds for trial in trials])))


def _mean(values: Sequence[float]) -> float | None:
    return round(float(np.mean(values)), 2) if values else None
