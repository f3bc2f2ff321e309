"""The comparison as text of 80 columns."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from experiments.babbling.modes import TITLES
from experiments.babbling.results import OUTCOMES, share

LABEL, COLUMN = 38, 14
LIMITS = {"completed": ", within 10 deg", "deflected": "", "returned": ", within 5 deg"}
PAIRS = 8  # that are told, the most frequent first

_Row = Mapping[str, Any]


def as_table(rows: Mapping[str, _Row]) -> str:
    """A column a mode."""
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
    plain("  left to go, median [deg]", "left_median_deg", 1)
    add("postures of all parts completed", {mode: f"{row['postures_completed']} of {row['postures']}" for mode, row in rows.items()})
    plain("time a posture [s]", "seconds_a_posture", 1)
    plain("path a posture [rad, all motors]", "path_rad", 1)
    plain("  straight way to it [rad]", "straight_way_rad", 1)
    plain("speed, rms [rad/s]", "speed_rms", 3)
    plain("jerk, rms [rad/s^3]", "jerk_rms", 1)
    plain("  largest [rad/s^3]", "jerk_max", 0)
    plain("  over speed, rms [1/s^2]", "jerk_over_speed", 0)
    return "\n".join([*lines, *_pairs(rows)])


def _pairs(rows: Mapping[str, _Row]) -> list[str]:
    """The pairs that touched, the most frequent first."""
    total: dict[str, int] = {}
    for row in rows.values():
        for pair, count in row["pairs"].items():
            total[pair] = total.get(pair, 0) + count
    ranked = sorted(total, key=lambda pair: (-total[pair], pair))
    lines = ["collisions by pair:"] if ranked else []
    lines += [_line(f"  {pair.replace(' ', ' - ')}", [str(row["pairs"].get(pair, 0)) for row in rows.values()]) for pair in ranked[:PAIRS]]
    rest = [str(sum(row["pairs"].get(pair, 0) for pair in ranked[PAIRS:])) for row in rows.values()]
    return [*lines, _line(f"  {len(ranked) - PAIRS} more", rest)] if len(ranked) > PAIRS else lines


def _line(label: str, cells: list[str]) -> str:
    return f"{label:<{LABEL}}" + "".join(f"{cell:>{COLUMN}}" for cell in cells)


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
