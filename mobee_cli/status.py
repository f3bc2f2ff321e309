# SPDX-License-Identifier: Apache-2.0
"""`mobee status`: shows the services, the state of each part's safety gate (it checks the commands to the motors), and the agents."""

from __future__ import annotations

import argparse
import json
import re
import shutil
import time
from typing import Any

from bus_schema.messages import State
from bus_schema.rpc import Stat
from mobee_cli.connect import add_endpoint, connected
from services.common.exit_codes import FAILED
from services.common.observe import Received, alive, listen, stats
from services.common.text import printable

_LISTEN = 0.3  # s: longer than the pause between two states of a part
_RESTARTS = "restarts_"
_HOST = "host_"
_AGENT = "agent_"
NO_COMMAND = -1  # age of the command in force, in a State


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee status` to the parser."""
    parser.epilog = "Exit code: 0 all services are ready, 1 a service is down or does not answer, \n3 no system is running."
    add_endpoint(parser)
    parser.add_argument("--json", action="store_true", help="print as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee status`: ask all services, print their states, and return the exit code (0: all are ready, 1: one is not)."""
    states: dict[str, Received] = {}
    with connected(arguments.endpoint) as session:
        listen(session, State.stream.keys(), lambda received: states.update({received.key: received}))
        begun = time.monotonic()
        present = alive(session)
        answers = stats(session, [who for who in present if who != "router"])
        time.sleep(max(0.0, begun + _LISTEN - time.monotonic()))
    status = {
        "endpoint": arguments.endpoint,
        "services": _services(present, answers),
        "parts": {received.key.partition("/")[0]: _part(received) for received in list(states.values())},
        "agents": {who.removeprefix(_AGENT): stat.numbers for who, stat in answers.items() if who.startswith(_AGENT)},
    }
    print(json.dumps(status, indent=2) if arguments.json else _as_text(status))
    return 0 if all(service["state"] == "ready" for service in status["services"].values()) else FAILED


def _services(present: dict[str, list[str]], answers: dict[str, Stat]) -> dict[str, Any]:
    """Return the state of each service that is on the bus, or that the launcher supervises, as a dict by name.

    `present`: instances on the bus, by name. `answers`: replies to the call `stat`. The entry "host" of a service is None on the host of
    the launcher.
    """
    launcher = answers.get("launcher")
    words = launcher.words if launcher else {}
    restarts = {
        name.removeprefix(_RESTARTS): int(count or 0)
        for name, count in (launcher.numbers if launcher else {}).items()
        if name.startswith(_RESTARTS)
    }
    services = {}
    for who in dict.fromkeys(["launcher", *restarts, *sorted(present)]):
        stat = answers.get(who)
        if who == "router" or (who == "launcher" and who not in present):
            continue
        services[who] = {
            "state": "down" if who not in present else "silent" if stat is None else "ready" if stat.ready else "starting",
            "host": words.get(f"{_HOST}{who}"),
            "pid": stat.pid if stat else None,
            "uptime_s": stat.uptime if stat else None,
            "restarts": restarts.get(who),
            "rejected": stat.rejected if stat else {},
            "numbers": dict(stat.numbers) if stat else {},
            "health": dict(stat.health) if stat else {},
            "warnings": stat.warnings if stat else [],
            "text": stat.text if stat else "",
        }
    return services


def _part(received: Received) -> dict[str, Any]:
    try:
        state = received.content()
        part = {name: state[name] for name in ("gate", "mode", "epoch", "cmd_age", "faults")}
        return part | {"cmd_age": None if part["cmd_age"] == NO_COMMAND else part["cmd_age"]}
    except (ValueError, KeyError, TypeError):
        return {"gate": "unreadable"}


def _as_text(status: dict[str, Any]) -> str:
    columns = shutil.get_terminal_size().columns  # 80 in a pipe
    width = 11 if any(service["host"] for service in status["services"].values()) else 0  # on one host there is no such column
    lines = [f"{'service':<16}{'state':<9}{'pid':>7}{'up s':>7}{'restarts':>10}  {'host'[:width]:<{width}}says"]
    cut = []
    for who, service in status["services"].items():
        refused = sum(service["rejected"].values())
        says = f"refused {refused}; {service['text']}" if refused else service["text"]
        says = printable(" ".join(says.split()))
        line = (
            f"{who:<16}{service['state']:<9}{_say(service['pid']):>7}{_say(service['uptime_s']):>7}{_say(service['restarts']):>10}  "
            f"{_say(service['host'])[: max(0, width - 1)]:<{width}}{says}"
        )
        lines.append(line[:columns].rstrip())
        if len(line) > columns and not says.startswith("http"):
            cut.append(f"{who}: {says}")
    lines += ["", *cut] if cut else []  # such as the reason of an emergency stop; not cut to the width of the terminal
    pages = [page for service in status["services"].values() for page in re.findall(r"https?://\S+", service["text"])]
    lines += [f"page  {page}" for page in pages]  # not cut to the width of the terminal
    lines += _health_lines(status["services"])
    if status["parts"]:
        lines += ["", f"{'part':<16}{'gate':<9}{'mode':<10}{'epoch':>14}{'command age':>13}{'faults':>8}"]
        for part, state in sorted(status["parts"].items()):
            lines.append(
                f"{part:<16}{state['gate']:<9}{_say(state.get('mode')):<10}{_say(state.get('epoch')):>14}"
                f"{_say(state.get('cmd_age')):>13}{_say(state.get('faults')):>8}"
            )
    if status["agents"]:
        lines += ["", f"{'agent':<16}{'transitions':>12}{'timeouts':>10}{'interrupted':>13}{'mean action s':>15}"]
        for agent, numbers in status["agents"].items():
            mean = numbers.get("action_time_mean")
            lines.append(
                f"{agent:<16}{_say(numbers.get('transitions')):>12}{_say(numbers.get('timeouts')):>10}"
                f"{_say(numbers.get('interrupted')):>13}{'-' if mean is None else f'{mean:.2f}':>15}"
            )
    return "\n".join(lines)


_HEALTH = {
    "rate": "rate Hz",
    "age_ms": "age ms",
    "gap_ms": "gap ms",
    "refused_rate": "ref. /s",
    "memory_mb": "MB",
    "files": "files",
    "waiting": "waiting",
}
_BEYOND = {"gap": "gap_ms", "refused": "refused_rate", "memory": "memory_mb"}  # columns of warnings whose names differ


def _health_lines(services: dict[str, Any]) -> list[str]:
    """Return a table of the resources that each process uses and its messages; a number beyond its limit is marked with !."""
    known = {who: service for who, service in services.items() if service["health"]}
    if not known:
        return []
    lines = ["", f"{'process':<16}{''.join(f'{title:>9}' for title in _HEALTH.values())}"]
    for who, service in known.items():
        marked = {_BEYOND.get(name, name) for name in service["warnings"]}
        cells = (f"{'!' if name in marked else ''}{_say(service['health'].get(name))}" for name in _HEALTH)
        lines.append(f"{who:<16}{''.join(f'{cell:>9}' for cell in cells)}")
    return lines


def _say(value: Any) -> str:
    return "-" if value is None else f"{value:.0f}" if isinstance(value, float) else str(value)
