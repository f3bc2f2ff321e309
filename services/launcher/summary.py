# SPDX-License-Identifier: Apache-2.0
"""Summarises a run as JSON and as text: what its services have counted and measured since all of them were ready."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from bus_schema.authority import AGENT
from bus_schema.rpc import Stat
from services.launcher.child import Watched


def summarise(children: Iterable[Watched]) -> dict[str, Any]:
    """Return the measurements of a run by name, as JSON data; None for a number that was not measured.

    The counts begin when every service was ready, or at the last restart of their service.

    "agents": for the agent of each part, the counts of transitions, timeouts and interruptions, and the mean time of an action [s].
    "ticks": number of ticks. "hold_ticks": number of ticks in which a part was in hold (stood still, followed no commands). "missed_ticks":
    number of skipped ticks. "table_contact_ticks": number of ticks in which the table overlapped a solid or a field of a part (a field is a
    larger volume that causes repulsive forces). "field_contact_ticks", "solid_contact_ticks": number of ticks in which any field, or any
    solid, was in contact. "closest_gap_m": smallest distance of hands and forearms from obstacles. "deepest_solid_contact_m": depth of the
    deepest solid contact. "pairs_watched": number of pairs of bodies that are tested for contact. "rejected_commands": number of refused
    commands, by reason. "command_age_ticks": age of commands in ticks: percentiles "p50" and "p99", and "max". "lockstep": for a run in
    lockstep (every tick waits for all participants), the number of ticks, the speed (times real time), whether the run is repeatable, and
    the hash of its states; otherwise None. "restarts": number of restarts of each service. "services": all numbers of each service.
    """
    stats = {child.who: child.stat for child in children if child.stat is not None}
    sim, model = _Numbers(stats.get("robot_sim")), _Numbers(stats.get("model"))
    return {
        "agents": {who.removeprefix(AGENT): _agent(_Numbers(stat)) for who, stat in stats.items() if who.startswith(AGENT)},
        "table_contact_ticks": model.count("table_ticks"),
        "field_contact_ticks": model.count("field_ticks"),
        "closest_gap_m": sim.number("gap_min"),
        "deepest_solid_contact_m": sim.number("solid_depth_max"),
        "solid_contact_ticks": sim.count("solid_ticks"),
        "pairs_watched": sim.count("pairs_watched"),
        "rejected_commands": {} if "robot_sim" not in stats else dict(sorted(stats["robot_sim"].rejected.items())),
        "command_age_ticks": {name: sim.count(f"age_{name}") for name in ("p50", "p99", "max")},
        "ticks": sim.count("ticks"),
        "hold_ticks": sim.count("hold_ticks"),
        "missed_ticks": sim.count("missed_ticks"),
        "lockstep": None if sim.number("flaws") is None else _lockstep(sim, stats["robot_sim"]),
        "restarts": {child.who: child.restarts for child in children},
        "services": {who: {"rejected": stat.rejected, **stat.numbers} for who, stat in stats.items()},
    }


class _Numbers:
    """The numbers in the last statistics of a service (reply Stat). A number that the service has not sent is None."""

    def __init__(self, stat: Stat | None) -> None:
        self._numbers = {} if stat is None else stat.numbers

    def number(self, name: str) -> float | None:
        return self._numbers.get(name)

    def count(self, name: str) -> int | None:
        value = self.number(name)
        return None if value is None else round(value)


def _lockstep(sim: _Numbers, stat: Stat) -> dict[str, Any]:
    return {
        "ticks": sim.count("tick"),
        "speed": sim.number("speed"),
        "repeatable": sim.count("flaws") == 0,
        "states_sha256": stat.words.get("states"),
    }


def _agent(numbers: _Numbers) -> dict[str, Any]:
    return {
        "transitions": numbers.count("transitions"),
        "timeouts": numbers.count("timeouts"),
        "mean_action_time_s": numbers.number("action_time_mean"),
        "interrupted": numbers.count("interrupted"),
    }


def as_text(summary: dict[str, Any]) -> str:
    """Return the summary of a run as a small table in text.

    `summary`: the result of `summarise` and the entries that the launcher adds, such as "scenario" and "run".
    """
    ready = summary["seconds_to_ready"]
    course = "never ready" if ready is None else f"ready after {ready:.1f} s, then ran for {summary['duration_s']:.1f} s"
    lines = [
        f"{summary['scenario']}: {course}",
        f"  run             {summary['run']}",
    ]
    for name, agent in summary["agents"].items():
        lines.append(
            f"  {name:<15} {_text(agent['transitions'])} transitions, {_text(agent['timeouts'])} timeouts, "
            f"mean action {_text(agent['mean_action_time_s'], 's', 2)}"
        )
    if summary["ticks"] is not None:
        lines += _robot_lines(summary)
    if summary["lockstep"] is not None:
        lines += _lockstep_lines(summary["lockstep"])
    restarts = {who: count for who, count in summary["restarts"].items() if count}
    lines.append(f"  restarts        {_counts(restarts)}")
    lines += [f"  FAULT           {fault}" for fault in summary["faults"]]
    return "\n".join(lines)


def _robot_lines(summary: dict[str, Any]) -> list[str]:
    age = summary["command_age_ticks"]
    return [
        f"  table           {_text(summary['table_contact_ticks'])} ticks of contact, closest gap {_mm(summary['closest_gap_m'])}",
        f"  solid contact   deepest {_mm(summary['deepest_solid_contact_m'])} of {_text(summary['pairs_watched'])} watched pairs",
        f"  command age     p50 {_text(age['p50'], '', 0)}, p99 {_text(age['p99'], '', 0)}, worst {_text(age['max'], '', 0)} ticks",
        f"  ticks           {summary['ticks']}, {_text(summary['hold_ticks'])} in hold, {_text(summary['missed_ticks'])} missed",
        f"  rejected        {_counts(summary['rejected_commands'])}",
    ]


def _lockstep_lines(lockstep: dict[str, Any]) -> list[str]:
    verdict = "repeatable" if lockstep["repeatable"] else "not repeatable, see the events in the logs"
    if not lockstep["ticks"]:
        verdict = "not started: a participant did not answer tick 0"
    return [
        f"  lockstep        {lockstep['ticks']} ticks at {_text(lockstep['speed'], '', 1)} x real time; {verdict}",
        f"  states          sha256 {lockstep['states_sha256']}",
    ]


def _text(value: float | None, unit: str = "", digits: int = 0) -> str:
    return "-" if value is None else f"{value:.{digits}f}{unit and ' ' + unit}"


def _mm(value: float | None) -> str:
    return "-" if value is None else f"{value * 1000:.1f} mm"


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in counts.items()) or "none"
