# SPDX-License-Identifier: Apache-2.0
"""One scenario (a set of services with their settings) on several hosts.

It determines which host starts which services, and checks a second launcher before that joins the first.
"""

from __future__ import annotations

import hashlib
import json
import re
import time
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct, to_builtins

import mobee
from bus_schema import keys
from bus_schema.authority import HOST_LAUNCHER
from bus_schema.rpc import Config, Empty
from services.common import rpc
from services.common.config import ConfigError, nearest
from services.common.observe import alive, stats
from services.common.session import Session
from services.common.worlds import is_path
from services.launcher.scenario import FILES, Part, Scenario

LAUNCHER = "launcher"
# Settings that may differ between hosts, as all ports may.
_OF_A_HOST = ("endpoint", "run_dir", "stop_record", "stop_address", "bind", "serve", "record")
_PATIENCE = 5.0  # s within which the first launcher must be ready
_TRIES = 4  # of the first call, for a router that is at work


class JoinRefused(Exception):
    """Raised if a launcher cannot join the system of another host. The message gives the reason and the remedy."""


class Agreement(Struct, frozen=True, kw_only=True):
    """What the launchers of two hosts must agree on.

    The first launcher, whose host runs the router, sends it as JSON in its answer to the call `config`.

    `version`: version of MoBeE. `instance`: id of the first launcher's process. `elsewhere`: services that other hosts start. `services`:
    settings of all services, by name, without settings that may differ between hosts, such as ports.
    """

    version: str
    instance: str
    elsewhere: tuple[str, ...]
    services: dict[str, dict[str, Any]]


def name_of(host: str) -> str:
    """Return the name that the launcher of a host has on the bus.

    Raises ConfigError if `host` contains other characters than a-z, 0-9 and _.
    """
    if not re.fullmatch(r"[a-z0-9_]+", host):
        raise ConfigError(f"--host {host}: a name of a host consists of a-z, 0-9 and _")
    return f"{HOST_LAUNCHER}{host}"


def check_names(option: str, names: Iterable[str], scenario: Scenario) -> None:
    """Raise ConfigError for the first of the `names` that is not a service of the scenario.

    `option`: the command-line option that gave the names, for the error message.
    """
    known = [part.who for part in scenario.parts]
    for name in names:
        if name not in known:
            raise ConfigError(f"{option} {name}: {scenario.name} has no service {name!r}.{nearest(name, known)}")


def check_elsewhere(elsewhere: Collection[str], scenario: Scenario) -> None:
    """Raise ConfigError if other hosts cannot start the services `elsewhere`.

    This is so if a name is unknown or no service remains for this host. In lockstep it is also so if one of the services is robot_sim, or a
    participant: every tick waits for these.
    """
    check_names("--elsewhere", elsewhere, scenario)
    if all(part.who in elsewhere for part in scenario.parts):
        raise ConfigError("--elsewhere names all services: leave at least one for this host")
    for part in scenario.parts:
        if scenario.is_locked and part.who in elsewhere and (part.entry.participates or part.who == "robot_sim"):
            raise ConfigError(f"--elsewhere {part.who}: in lockstep every tick waits for {part.who}: start it on this host")


def agreement(scenario: Scenario, instance: str = "", elsewhere: Sequence[str] = ()) -> Agreement:
    """Return the version and the settings of this host's scenario, which the launchers of two hosts compare.

    `instance`: id of this launcher's process. `elsewhere`: services that other hosts start.
    """
    services = {part.who: _settings(part) for part in scenario.parts}
    return Agreement(version=mobee.__version__, instance=instance, elsewhere=tuple(elsewhere), services=services)


def _settings(part: Part) -> dict[str, Any]:
    """Return a service's settings as JSON has them; of a file that it reads, a digest in place of the path."""
    found: dict[str, Any] = {"module": part.entry.module}
    for name, value in to_builtins(part.config).items():
        if name in _OF_A_HOST or name.endswith("_port"):
            continue
        found[name] = _digest(Path(value)) if name in FILES and isinstance(value, str) and is_path(value) else value
    return dict(json.loads(json.dumps(found)))


def _digest(path: Path) -> str:
    try:
        return f"a file with the SHA-256 {hashlib.sha256(path.read_bytes()).hexdigest()[:16]}"
    except OSError as error:
        return f"a file that cannot be read ({error.strerror})"


def request_agreement(session: Session, who: str, endpoint: str) -> Agreement:
    """Ask the first launcher for its version and settings, which the launcher of this host must share; return them as an `Agreement`.

    `endpoint`: address of the first launcher's router, for error messages. `who`: name of this launcher. Raises JoinRefused if the first
    launcher does not answer, or has another version.
    """
    give_up = time.monotonic() + _PATIENCE
    while LAUNCHER not in alive(session) and time.monotonic() < give_up:
        time.sleep(0.1)
    try:
        answer = rpc.call(session, who, keys.service_rpc(LAUNCHER, "config"), Empty, Config, timeout=1.0, tries=_TRIES)
        return msgspec.json.decode(answer.config, type=Agreement)
    except rpc.CallFailed as failed:
        if failed.code == "no_answer":
            raise JoinRefused(
                f"there is a router at {endpoint}, but no launcher that answers ({failed}). Start the system on that host with "
                "`mobee launch SCENARIO --elsewhere SERVICES`"
            ) from None
        raise JoinRefused(f"the launcher at {endpoint} is of another version ({failed}): install the same MoBeE on both hosts") from None
    except (msgspec.DecodeError, msgspec.ValidationError) as error:
        raise JoinRefused(f"the launcher at {endpoint} is of another version ({error}): install the same MoBeE on both hosts") from None


def check_agreement(first: Agreement, own: Agreement, only: Collection[str], endpoint: str) -> None:
    """Raise JoinRefused if the agreement of the first host does not fit that of this host.

    It does not fit if the versions or the settings differ, or if one of the services `only`, which this host wants to start, is not in the
    scenario of the first host or is started by the first host itself. `first`, `own`: the agreements of the first host and of this host.
    `endpoint`: address of the first host, for the error message.
    """
    if first.version != own.version:
        raise JoinRefused(f"MoBeE is {own.version} here and {first.version} at {endpoint}: install the same version on both hosts")
    for who in only:
        if who not in first.services:
            raise JoinRefused(
                f"{who} is not in the scenario at {endpoint}, which has {', '.join(first.services)}: launch the same one here"
            )
        if who not in first.elsewhere:
            raise JoinRefused(
                f"the launcher at {endpoint} starts {who} itself. Launch there with --elsewhere {','.join([*first.elsewhere, who])}, "
                f"or leave {who} out of --only"
            )
    for difference in _differences(first.services, own.services):
        raise JoinRefused(f"the scenarios differ: {difference} at {endpoint}. Give both hosts the same file and the same --set")


def _differences(first: Mapping[str, dict[str, Any]], own: Mapping[str, dict[str, Any]]) -> Iterator[str]:
    for who in (who for who in own if who in first):
        for name in sorted({*own[who], *first[who]}):
            here, there = own[who].get(name), first[who].get(name)
            if here != there:
                yield f"services.{who}.{name} is {_shown(here)} here and {_shown(there)}"


def _shown(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def check_free(session: Session, who: str, only: Collection[str], endpoint: str) -> None:
    """Raise JoinRefused if a launcher with the name of this one, or a service that this host wants to start, is already on the bus.

    `who`: name of this launcher. `only`: names of the services that this host wants to start. `endpoint`: address of the router, for the
    error message.
    """
    present = alive(session)
    for name in (who, *only):
        if name not in present:
            continue
        stat = stats(session, [name]).get(name)
        process = f" (process {stat.pid})" if stat else ""
        if name == who:
            host = who.removeprefix(HOST_LAUNCHER)
            raise JoinRefused(f"a host named {host} has joined {endpoint} already{process}: end its launcher, or give another --host")
        raise JoinRefused(
            f"{name} runs already at {endpoint}{process}: end its launcher first. Services whose launcher was killed end within 12 s"
        )
