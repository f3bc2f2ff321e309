# SPDX-License-Identifier: Apache-2.0
"""Describes a problem of the system in one sentence, with a remedy."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

from bus_schema.messages import EStop
from services.monitor.story.words import listed, title_of

STALE = 5.0  # s of real time without the robot's clock, or the patience of lockstep
HELD = 1.0  # s of real time for which a part must hold before it is reported: every action of a filter or a start holds for a moment


@dataclass
class Seen:
    """What the monitor knows about the state of the system.

    `clock_age`: s of real time since the last tick; None: no tick yet. `mode`: mode of the clock, such as "paused". `gates`: state of the
    safety gate, by part. `held_for`: s of real time for which each part has been in hold (it stands still and follows no commands).
    `why_held`: the controller's reason for the hold, by part. `stop`: the present emergency stop; None: there is none. `services`: running
    services. `known`: services that have run at some time. `patience`: s of real time without a tick, after which the page reports that
    the robot does not answer. `ended`: the monitor was asked to end.
    """

    clock_age: float | None = None
    mode: str = ""
    gates: Mapping[str, str] = field(default_factory=dict)
    held_for: Mapping[str, float] = field(default_factory=dict)
    why_held: Mapping[str, str] = field(default_factory=dict)
    stop: EStop | None = None
    services: Collection[str] = ()
    known: Collection[str] = ()  # that have been up: a scenario may have no model or controller
    patience: float = STALE
    ended: bool = False


def banner(seen: Seen) -> dict[str, Any] | None:
    """Return the warning that the web page shows in large letters, as a dict of four texts: "level", "title", "text" and "todo".

    "level": kind of warning: ended, waiting, stop, fault, paused or hold (parts stand still and follow no commands). "title": the
    warning in a few words. "text": explanation. "todo": remedy. Returns None if there is nothing to warn of.
    """
    names = sorted(seen.services)
    if seen.ended:
        return _said(
            "ended",
            "The system has ended",
            "This is the last picture of it.",
            "Start it again: mobee launch. See the run again: mobee replay RUN.",
        )
    if seen.clock_age is None:
        text = f"Running so far: {', '.join(names)}." if names else "No service is up yet."
        return _said("waiting", "Waiting for the robot", text, "If this takes more than a minute: mobee status")
    stopped = [part for part, gate in seen.gates.items() if gate == "estop"]
    if seen.stop is not None or stopped:
        why = f"{seen.stop.reason[:1].upper()}{seen.stop.reason[1:]}." if seen.stop is not None else "All motors are stopped."
        return _said(
            "stop",
            "EMERGENCY STOP",
            why,
            "Release: key R, or mobee estop --reset. The controller then arms all parts; agents continue.",
        )
    faulty = [title_of(part) for part, gate in seen.gates.items() if gate == "fault"]
    if faulty:
        return _said(
            "fault",
            f"FAULT: {listed(faulty)}",
            "The gate before the motors has stopped this part.",
            "Reset: key 0. Reasons: the events below, mobee status",
        )
    if "robot_sim" not in seen.services:
        return _said("fault", "The robot is gone", "robot_sim has ended.", "The launcher starts it again; if not: mobee status")
    if seen.mode == "paused":
        return _said("paused", "Paused", "The robot's time stands still, and all parts hold.", "Resume: space bar")
    if seen.clock_age > seen.patience:
        return _said(
            "fault", "The robot does not answer", f"No tick of its clock for {seen.clock_age:.0f} s.", "mobee status shows what runs"
        )
    for name in ("model", "controller"):
        if name in seen.known and name not in seen.services:
            return _said("fault", f"The {name} is gone", "The whole robot holds.", "The launcher starts it again; if not: mobee status")
    held = [part for part, since in seen.held_for.items() if since > HELD]
    if held:
        reasons = sorted({seen.why_held.get(part, "") for part in held} - {""})
        return _said(
            "hold",
            f"HOLD: {listed([title_of(part) for part in held])}",
            f"Why: {'; '.join(reasons)}." if reasons else "These parts take no commands.",
            "They are armed again by themselves when all is well. If not: mobee status",
        )
    return None


def _said(level: str, title: str, text: str, todo: str) -> dict[str, Any]:
    return {"level": level, "title": title, "text": text, "todo": todo}
