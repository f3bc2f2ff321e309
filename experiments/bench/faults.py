# SPDX-License-Identifier: Apache-2.0
"""A live system under schedules of faults: time until parts hold, time until all follow commands again, and lost or changed transitions.

Claim: the parts of the robot that depend on a process hold (brake and stand still) within 30 ms after it is killed, and within 120 ms after
it freezes, in 95 of 100 cases, on a machine that does nothing else; every part follows commands again within 5 s of the last fault; no
transition is lost, stored twice or stored with other values; no motor is faster than the gate (the check of commands before the motors)
allows, and none obeys a command that answers a tick of more than 100 ms ago.  A schedule is a random sequence of faults; its number is the
seed with which it is drawn; all schedules are performed on one running system.  If a schedule breaks a guarantee (such as that on motor
speeds), faults can be removed from it while a guarantee is still broken (`shrink`).  Times are judged only in real time and if the load was
low; the load is part of the result.  If there is a quiet period before the schedules: under faults the agents make at least four fifths as
many transitions a second as in this period.  Run time: about 10 s for each schedule.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.command_line import Progress
from experiments.kit.live.faults import VITAL, Fault, FaultInjector, draw, shrunk
from experiments.kit.live.launch import LaunchFailed
from experiments.kit.live.system import (
    Kept,
    Moment,
    Observer,
    System,
    compare_transitions,
    running,
    stop_after,
    survived,
    too_old,
    violations,
    wait_for,
)
from mobee.robot.load import load_robot
from services.common.observe import alive
from services.common.session import open_client

AGENTS = ("torso", "left_arm", "right_arm")
SERVICES = (*VITAL, *(f"agent_{part}" for part in AGENTS))
OTHERS = ("renderer", "vision")  # faults concern these too where a scenario has them
NOISE = np.deg2rad(0.2)  # rad, of the encoders
HOLD_AT_MOST = {"kill": 30.0, "freeze": 120.0}  # ms, p95
BACK_AT_MOST = 5.0  # s
COST_AT_MOST = 0.2  # of the transitions of the quiet period
QUIET = 1.0  # load of the machine up to which times are judged; the system itself takes about that
_BACK_PATIENCE = 40.0  # s
_ENDED = {"agent": "an agent", "model": "the model"}
_NOTICED = 0.5  # s; a process that is frozen for less may be late only
_ALONE = 1.0  # s between two faults, so that their effects can be distinguished


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of the benchmark.

    `schedules`: number of schedules of faults.  `seed`: seed of the first schedule; each next one has the next seed.  `seconds`: duration
    of each schedule [s].  `period`: mean time between two faults [s].  `shrink`: if a schedule breaks a guarantee, up to `shrink` schedules
    with fewer of its faults are performed, to find a shorter one that breaks a guarantee; 0: none.  `scenario`: name or path of the file
    that lists the system's services.  `quiet`: time without faults [s] before the first schedule, to compare the transitions a second with
    those under faults; 0: no comparison.
    """

    schedules: int = 20
    seed: int = 1
    seconds: float = 10.0
    period: float = 4.0
    shrink: int = 0
    scenario: str = "kinematic"
    quiet: float = 0.0


QUICK = Settings(schedules=2)


class _DisturbedSystem:
    """One system on which schedules of faults are performed, one after the other."""

    def __init__(self, system: System, session: Any) -> None:
        self.system, self._robot = system, load_robot("icub")
        self.observer = Observer()
        self.observer.attach(session)
        self._injector = FaultInjector(session, system.endpoint)
        self._wait_until_back()

    def _wait_until_back(self) -> None:
        """Wait until all parts follow commands."""
        wait_for(lambda: self.observer.all_armed(len(self._robot.parts)), _BACK_PATIENCE, "every part follows commands again")

    @property
    def published(self) -> int:
        """The number of transitions that agents have published so far."""
        with self.observer.lock:
            return len(self.observer.published)

    def transitions_within(self, seconds: float) -> int | None:
        """Wait `seconds` [s] and return the number of transitions that were published meanwhile; None if `seconds` is 0."""
        before = self.published
        time.sleep(seconds)
        return self.published - before if seconds else None

    def disturb(self, schedule: Sequence[Fault]) -> dict[str, Any]:
        """Perform a schedule; return the measurements and the broken guarantees."""
        self.observer.take()
        times, broken = self._injector.perform(schedule), list[str]()
        over = max(at + fault.duration for at, fault in zip(times, schedule, strict=True))
        time.sleep(_ALONE)  # the last fault has its effect
        try:
            self._wait_until_back()
        except LaunchFailed as failed:
            broken.append(str(failed))
        if self.system.process.poll() is not None:
            raise LaunchFailed(f"the launcher has ended: {(self.system.says.splitlines() or ['no message'])[-1]}")
        states, ages = self.observer.take()
        broken += violations(states, self._robot, NOISE)
        if self.observer.locked:  # time stands still while a process is absent
            return {"back_s": None, "oldest_ms": None, "broken": broken, "stops": [], "actions": []}
        back = max([0.0, *(moment.at - over for moments in states.values() for moment in moments if moment.gate != "armed")])
        effects = self._effects(list(_alone(schedule, times)), states)
        return {"back_s": back, "oldest_ms": 1e3 * max(ages, default=0.0), "broken": [*broken, *too_old(ages)], **effects}

    def _effects(self, alone: Sequence[tuple[Fault, float, float]], states: Mapping[str, list[Moment]]) -> dict[str, Any]:
        """Return the effects of faults of controller or model on the parts, and of killed processes on actions.

        Keys: "stops", a list with (kind of fault, `Stop`) for each part that was moving; "actions", a list with (killed process, "model" or
        "agent"; whether the action survived) for each action that was under way in a part whose own agent was not killed.  `alone`: faults
        as `_alone` yields them.  `states`: the states of each part.
        """
        stops = [
            (fault.kind, stop)
            for fault, at, until in alone
            if fault.kind in HOLD_AT_MOST and fault.target in ("controller", "model") and not 0.0 < fault.duration < _NOTICED
            for moments in states.values()
            if (stop := stop_after(moments, at, min(until, at + 2.0))) is not None
        ]
        with self.observer.lock:
            actions = [
                ("model" if fault.target == "model" else "agent", lasted)
                for fault, at, until in alone
                if fault.kind == "kill" and (fault.target == "model" or fault.target.startswith("agent_"))
                for part, changes in self.observer.motions.items()
                if fault.target != f"agent_{part}" and (lasted := survived(changes, at, until)) is not None
            ]
        return {"stops": stops, "actions": actions}


def _alone(schedule: Sequence[Fault], times: Sequence[float]) -> Iterator[tuple[Fault, float, float]]:
    """Yield each fault whose effect can be distinguished from that of others, with its time and the time until which it is alone."""
    for n, (fault, at) in enumerate(zip(schedule, times, strict=True)):
        following = times[n + 1] if n + 1 < len(times) else at + 10.0
        earlier = max((times[i] + schedule[i].duration for i in range(n)), default=0.0)
        if following - at > _ALONE and earlier + _ALONE < at:
            yield fault, at, following


def measure(settings: Settings) -> dict[str, Any]:
    """Perform the schedules on one running system and return the measurements and the verdict as a dict.

    A schedule is a sequence of faults, such as a process that is killed.  A part of the robot *holds* if it brakes and stands still.
    `settings`: see `Settings`.  Raises LaunchFailed if the system does not start or ends early.

    Main keys of the result:
    - "hold_ms": dict from the kind of fault ("kill" or "freeze" of controller or model) to statistics of the times from a fault until a
      moving part holds [ms].  Statistics are dicts with the keys "count", "p50" and "p95" (percentiles), and "max".
    - "back_s": statistics of the times from the end of a schedule's last fault until all parts follow commands again [s].
    - "transitions": dict with numbers of transitions of the agents.  "kept": on disk.  "lost": published, but not on disk.  "differing": on
      disk with other values than published, or published twice with different values.  "repeated": on disk under a number that another
      transition of the same agent has too.
    - "broken": list with a text for each broken guarantee.  The guarantees are: in a run the tick number increases; no motor is faster than
      the gate (the check of commands before the motors) allows; no command is obeyed more than 100 ms after the tick that it answers; all
      parts follow commands again within 40 s.
    - "rows": list with the measurements of each schedule, as dicts.
    - "passed": the verdict.

    "passed" is True if all of these conditions hold:
    - No guarantee is broken.
    - Every part that had to hold did so.
    - The numbers "lost", "differing" and "repeated" are 0.
    - Faults reduce the transitions per second by at most a fifth, if the settings have a quiet period for the comparison.
    - The 95th percentiles of "hold_ms" are at most 30 ms ("kill") and 120 ms ("freeze"), and the maximum of "back_s" is at most 5 s.  Times
      are not judged if the load of the machine was above 1, or if the robot ran in lockstep (every tick waits for all services).
    """
    rows: list[dict[str, Any]] = []
    with Progress() as progress, tempfile.TemporaryDirectory() as scratch, running(Path(scratch), settings.scenario) as system:
        with open_client(system.endpoint) as session:
            disturbed = _DisturbedSystem(system, session)
            services = (*SERVICES, *(who for who in OTHERS if who in alive(session)))
            progress.show(0.0, "quiet")
            quiet, before = disturbed.transitions_within(settings.quiet), disturbed.published
            begun = time.monotonic()
            for n in range(settings.schedules):
                progress.show(n / settings.schedules, f"schedule {settings.seed + n}")
                rows.append(_performed(disturbed, services, settings.seed + n, settings))
            seconds, made = time.monotonic() - begun, disturbed.published - before
            time.sleep(1.0)  # the last published messages arrive
            kept = compare_transitions(disturbed.observer, system.run_dir, list(AGENTS))
    rates = None if quiet is None else (quiet / settings.quiet, made / seconds)
    return _result(settings, rows, kept, seconds, rates)


def _performed(system: _DisturbedSystem, services: Sequence[str], seed: int, settings: Settings) -> dict[str, Any]:
    schedule = draw(seed, services, settings.seconds, settings.period)
    result = system.disturb(schedule)
    if result["broken"] and settings.shrink:
        schedule = shrunk(schedule, lambda shorter: bool(system.disturb(shorter)["broken"]), settings.shrink)
    return {"seed": seed, "schedule": [str(fault) for fault in schedule], "load": os.getloadavg()[0], **result}


def _result(
    settings: Settings, rows: list[dict[str, Any]], kept: Kept, seconds: float, rates: tuple[float, float] | None = None
) -> dict[str, Any]:
    """Return the measurements and the verdict; `rates`: transitions a second without and with faults."""
    stops = [each for row in rows for each in row.pop("stops")]
    actions = [each for row in rows for each in row.pop("actions")]
    load = float(np.median([row["load"] for row in rows]))
    held = {kind: _summary([1e3 * stop.hold for one, stop in stops if one == kind and stop.hold is not None]) for kind in HOLD_AT_MOST}
    never = sum(stop.hold is None for _, stop in stops)
    distance = {
        kind: _summary([float(np.rad2deg(stop.distance)) for one, stop in stops if one == kind and stop.distance is not None])
        for kind in HOLD_AT_MOST
    }
    back = _summary([row["back_s"] for row in rows if row["back_s"] is not None])
    broken = [f"schedule {row['seed']}: {line}" for row in rows for line in row["broken"]]
    quiet = load <= QUIET and back["count"] == len(rows)
    in_time = all(held[kind]["p95"] is None or held[kind]["p95"] <= most for kind, most in HOLD_AT_MOST.items())
    unharmed = not broken and not never and kept.lost == kept.differing == kept.repeated == 0
    cost = None if rates is None else 1.0 - rates[1] / max(rates[0], 1e-9)
    return {
        "schedules": settings.schedules,
        "seed": settings.seed,
        "seconds": seconds,
        "faults": sum(len(row["schedule"]) for row in rows),
        "load": load,
        "hold_ms": held,
        "never_held": never,
        "stopping_distance_deg": distance,
        "back_s": back,
        "oldest_ms": max((row["oldest_ms"] for row in rows if row["oldest_ms"] is not None), default=None),
        "rates": rates,
        "cost": cost,
        "actions_survived": {
            who: {"survived": sum(lasted for one, lasted in actions if one == who), "of": sum(one == who for one, _ in actions)}
            for who in ("agent", "model")
        },
        "transitions": {"kept": kept.kept, "lost": kept.lost, "differing": kept.differing, "repeated": kept.repeated},
        "broken": broken,
        "rows": rows,
        "times_judged": quiet,
        "passed": unharmed and (cost is None or cost <= COST_AT_MOST) and (not quiet or (in_time and back["max"] <= BACK_AT_MOST)),
    }


def _summary(values: list[float]) -> dict[str, Any]:
    if not values:
        return {"count": 0, "p50": None, "p95": None, "max": None}
    p50, p95 = np.percentile(values, [50, 95])
    return {"count": len(values), "p50": float(p50), "p95": float(p95), "max": max(values)}


def report(result: dict[str, Any]) -> str:
    """Return the result of `measure` as text: times, counts of transitions, and the broken guarantees."""
    kept = result["transitions"]
    lines = [
        f"{result['schedules']} schedules from number {result['seed']}, {result['faults']} faults in {result['seconds']:.0f} s; "
        f"load of the machine {result['load']:.1f}",
        f"{'':<30}{'count':>7}{'p50':>9}{'p95':>9}{'largest':>9}",
    ]
    for kind in HOLD_AT_MOST:
        lines.append(f"{f'hold after a {kind} [ms]':<30}{_cells(result['hold_ms'][kind])}")
        lines.append(f"{f'stopping distance, {kind} [deg]':<30}{_cells(result['stopping_distance_deg'][kind])}")
    lines.append(f"{'all parts back [s]':<30}{_cells(result['back_s'])}")
    for who, those in result["actions_survived"].items():
        lines.append(f"actions of other parts that survived the end of {_ENDED[who]}: {those['survived']} of {those['of']}")
    if result["oldest_ms"] is not None:
        lines.append(f"oldest command obeyed: {result['oldest_ms']:.0f} ms")
    if result["rates"] is not None:
        without, with_faults = result["rates"]
        lines.append(f"transitions a second: {without:.2f} without faults, {with_faults:.2f} with: {100.0 * result['cost']:.0f} % less")
    lines.append(f"transitions: {kept['kept']} kept, {kept['lost']} lost, {kept['differing']} differ, {kept['repeated']} repeated")
    lines += result["broken"] or ["no promise broken"]
    if not result["times_judged"]:
        lines.append(f"times are not judged: the load was above {QUIET:g}, or the robot ran in lockstep")
    return "\n".join(lines)


def _cells(summary: dict[str, Any]) -> str:
    numbers = (f"{'-' if summary[name] is None else format(summary[name], '.1f'):>9}" for name in ("p50", "p95", "max"))
    return f"{summary['count']:>7}{''.join(numbers)}"
