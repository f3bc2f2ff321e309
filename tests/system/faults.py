# SPDX-License-Identifier: Apache-2.0
"""Schedules of faults around an emergency stop."""

from __future__ import annotations

import numpy as np

from experiments.kit.live.faults import FORGED, Culprit, Fault
from services.common.bus import Bus
from tests.system.live import PARTS, Launch, Watcher

VITAL = ("robot_sim", "controller", "model", "launcher")  # the launcher is the router
STOP_AT = 1.0  # s after the beginning of a schedule


def draw_stop_schedule(seed: int) -> list[Fault]:
    """An emergency stop among up to five faults; some come before it, so that robot_sim or controller may not hear it at once.

    The launcher, which is the router, fails only after it: without a router nobody hears a stop, which `mobee estop` reports.
    """
    rng = np.random.default_rng(seed)
    faults = [Fault(STOP_AT, "stop")]
    for _ in range(rng.integers(2, 6)):
        at = float(rng.uniform(0.7, 4.0))
        kind = str(rng.choice(["kill", "kill", "freeze", "forge"]))
        if kind == "forge":
            faults.append(Fault(at, str(rng.choice(FORGED))))
        else:
            duration = float(rng.choice([0.3, 1.0, 3.0])) if kind == "freeze" else 0.0
            who = str(rng.choice(VITAL if at > STOP_AT + 0.05 else VITAL[:-1]))
            faults.append(Fault(at, kind, who, duration))
    return sorted(faults, key=lambda fault: fault.at)


def culprit(system: Launch, watcher: Watcher, bus: Bus) -> Culprit:
    """One who performs faults on a system."""

    def epoch(part: str) -> int | None:
        states = watcher.states[part]
        return states[-1].epoch if states else None

    pids = {who: watcher.pid(who) for who in VITAL if who != "launcher"} | {"launcher": system.process.pid}
    return Culprit(watcher.session, system.endpoint, pids, bus, epoch, PARTS[2])
