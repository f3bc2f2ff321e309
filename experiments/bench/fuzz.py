# SPDX-License-Identifier: Apache-2.0
"""Nearly valid messages, calls and liveliness tokens (of Zenoh), sent to a live system: which processes end, and how memory grows.

Claim: no process ends by itself or is ended by the launcher; 15 s after the last message the memory of each has grown by less than 20 MB;
afterwards every agent makes transitions.  The robot moves by the motor model at 100 Hz, with its three agents; no monitor runs.
`experiments.kit.live.malformed` draws and sends the messages.  They are not dropped: a service that does not read fast enough delays the
sender.  Run time: some minutes for a million on 2 cores.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from bus_schema import keys
from bus_schema.rpc import Done, Empty, Stat
from experiments.kit.command_line import Progress
from experiments.kit.live.faults import VITAL
from experiments.kit.live.launch import LaunchFailed
from experiments.kit.live.system import System, running, stat_of, wait_for
from mobee import load_robot
from mobee.store import STORE, TransitionStore
from services.common import rpc
from services.common.session import open_client

MOST_GROWTH = 20.0  # MB
AGENTS = ("torso", "left_arm", "right_arm")
WATCHED = (*VITAL, "launcher", "recorder", *(f"agent_{part}" for part in AGENTS))
_SENDERS = 2  # processes
_BATCH = 20_000  # messages of each sender between two checks that all processes answer
_REST = 15.0  # s after the last message until memory is measured: the recorder empties its queue, and returns free memory each 10 s
_WARM = 2 * _BATCH  # messages before memory is measured: caches and queues fill
_PATIENCE = 90.0  # s until a process answers, and until every agent has learned again


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of the benchmark.  `messages`: number of messages, calls and tokens together.  `seed`: the first of the senders' seeds."""

    messages: int = 1_000_000
    seed: int = 1


QUICK = Settings(messages=40_000)


def measure(settings: Settings) -> dict[str, Any]:
    """Send nearly valid messages, calls and liveliness tokens to a live system and return the result; raises LaunchFailed if it fails.

    Main keys: "sent", dict of the numbers of sent "messages", "calls" and "tokens"; "refused", dict from a process to the number of
    messages that it refused; "grown_mb", dict from a process to the growth of its memory at the end [MB]; "largest_growth_mb", the same for
    the largest growth during the run; "ended", list of the processes that ended; "learned", list of the agents that made a transition
    afterwards; "passed", whether no process ended, no memory grew too much, and all agents learned.
    """
    sent: Counter[str] = Counter()
    begun = time.monotonic()
    with Progress() as progress, tempfile.TemporaryDirectory() as scratch, running(Path(scratch), "kinematic") as system:
        with open_client(system.endpoint) as session:
            _send(system, settings.seed, _WARM)
            before, batch, rows = _stats(session), 0, []
            while sent.total() < settings.messages:
                batch += 1
                sent += _send(system, settings.seed + _SENDERS * batch, min(_BATCH * _SENDERS, settings.messages - sent.total()))
                rows.append(_memory(_stats(session)))
                progress.show(min(1.0, sent.total() / settings.messages), f"{sent.total()} sent")
            took = time.monotonic() - begun
            time.sleep(_REST)
            after = _stats(session)
            learned = _learns_again(system, session)
    kept, first = _memory(after), _memory(before)
    grown = {who: kept[who] - first[who] for who in WATCHED}
    largest = {who: max(row[who] for row in rows) - first[who] for who in WATCHED}
    ended = [who for who in WATCHED if after[who].pid != before[who].pid]
    return {
        "sent": dict(sent),
        "seconds": took,
        "refused": {who: sum(after[who].rejected.values()) for who in WATCHED},
        "grown_mb": grown,
        "largest_growth_mb": largest,
        "memory_mb": rows,
        "most_grown_mb": MOST_GROWTH,
        "ended": ended,
        "learned": learned,
        "load": os.getloadavg()[0],
        "passed": not ended and max(grown.values()) < MOST_GROWTH and len(learned) == len(AGENTS),
    }


def _send(system: System, seed: int, count: int) -> Counter[str]:
    """Send `count` drawn messages, calls and tokens from several processes; return how many of each."""
    parts = json.dumps({name: len(part) for name, part in load_robot("icub").parts.items()})
    argv = [sys.executable, "-m", "mobee_system.run", "experiments.kit.live.malformed", system.endpoint]
    each = str(-(-count // _SENDERS))  # rounded up, so that the last ones are sent too
    senders = [subprocess.Popen([*argv, str(seed + n), each, parts], stdout=subprocess.PIPE, text=True) for n in range(_SENDERS)]
    outputs = [sender.communicate()[0] for sender in senders]
    if codes := [sender.returncode for sender in senders if sender.returncode]:
        raise LaunchFailed(f"a process that sends has ended with code {codes[0]}")
    return sum((Counter(json.loads(output)) for output in outputs), Counter[str]())


def _stats(session: Any) -> dict[str, Stat]:
    """Return the status of all processes; raises LaunchFailed if one does not answer."""
    return {who: wait_for(partial(stat_of, session, who, 2.0), _PATIENCE, f"{who} answers") for who in WATCHED}


def _memory(stats: dict[str, Stat]) -> dict[str, float]:
    """Return the memory of each process [MB]; raises LaunchFailed where the system does not report it."""
    memory = {who: stat.health.get("memory_mb") for who, stat in stats.items()}
    if unknown := [who for who, value in memory.items() if value is None]:
        raise LaunchFailed(f"{', '.join(unknown)}: the memory is not known; this system does not report it")
    return {who: float(value) for who, value in memory.items() if value is not None}


def _learns_again(system: System, session: Any) -> list[str]:
    """Release the robot from stops, pauses and holds; return the agents that then record a new transition.

    Waits at most _PATIENCE (90 s) for all agents.  Raises LaunchFailed if the robot cannot be released.
    """

    def released() -> bool:
        try:
            for key in (keys.ESTOP_RESET, keys.sim("resume")):
                rpc.call(session, "bench", key, Empty, Done, timeout=1.0)
            for part in AGENTS:
                rpc.call(session, "bench", keys.service_rpc(f"agent_{part}", "resume"), Empty, Done, timeout=1.0)
        except rpc.CallFailed:
            return False
        return True

    wait_for(released, _PATIENCE, "the robot is released")
    before = _transitions(system)
    try:
        wait_for(lambda: all(_transitions(system)[agent] > before[agent] for agent in AGENTS), _PATIENCE, "every agent learns", period=0.5)
    except LaunchFailed:  # the result names the agents
        pass
    after = _transitions(system)
    return [agent for agent in AGENTS if after[agent] > before[agent]]


def _transitions(system: System) -> Counter[str]:
    with TransitionStore(system.run_dir / STORE, "", read_only=True) as store:
        return Counter({agent: len(store.times(agent)) for agent in store.agents()})


def report(result: dict[str, Any]) -> str:
    """Return the result of `measure` as text: a table with one line for each process."""
    sent = ", ".join(f"{number} {kind}" for kind, number in result["sent"].items())
    lines = [f"Sent in {result['seconds']:.0f} s: {sent}; load of the machine {result['load']:.1f}"]
    lines.append(f"{'process':<20}{'refused':>10}{'memory grown, MB':>18}{'largest growth':>18}")
    rows = zip(result["grown_mb"].items(), result["largest_growth_mb"].values(), strict=True)
    lines += [f"{who:<20}{result['refused'][who]:>10}{grown:>18.1f}{largest:>18.1f}" for (who, grown), largest in rows]
    ended, learned = (", ".join(result[name]) or "none" for name in ("ended", "learned"))
    lines.append(f"Ended processes: {ended}. Agents that learned again: {learned}.")
    return "\n".join(lines)
