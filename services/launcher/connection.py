# SPDX-License-Identifier: Apache-2.0
"""The bus of a launch: either the router that this launcher opens, or a session with the router of another host."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from services.common.config import ConfigError
from services.common.identity import DEFAULT_ENDPOINT, assume, is_local, secured
from services.common.refusals import RefusalLog
from services.common.session import (
    LEASE,
    BusUnreachable,
    Session,
    local_endpoint,
    open_client,
    open_router,
    spare_threads,
)
from services.launcher.checks import check_endpoint, check_ports
from services.launcher.hosts import LAUNCHER, Agreement, JoinRefused, agreement, check_agreement, check_free, name_of, request_agreement
from services.launcher.scenario import Scenario
from services.launcher.security import Security

JOIN_PATIENCE = 10.0  # s within which the router of another host must answer


@dataclass(frozen=True)
class Connection:
    """How this launcher and its services reach the bus.

    `who`: name of this launcher on the bus. `endpoint`: address at which its services reach the router. `session`: the launcher's session.
    `router`: the router, if this launcher has opened it; None: the router is on another host. `local`: second address of the router, for
    services of this host in lockstep (every tick waits for all participants); empty: none. `security`: keys with which the connections are
    secured; None: they are not secured. `refusals`: log of what a secured router refuses. `first`: what the first launcher, whose host runs
    the router, has prescribed (version, and settings of the services); None: this launcher is the first.
    """

    who: str
    endpoint: str
    session: Session
    router: Session | None = None
    local: str = ""
    security: Security | None = None
    refusals: RefusalLog | None = None
    first: Agreement | None = None


def open_bus(
    scenario: Scenario, here: Scenario, endpoint: str, keys: Path | None, insecure: bool, elsewhere: Sequence[str], stack: ExitStack
) -> Connection:
    """Open the router of a system, and a session with the router; return both in a `Connection`.

    Args:
        scenario: all services.
        here: the services that this host starts.
        endpoint: address at which the router listens.
        keys: folder of keys; None: the system is not secured.
        insecure: whether other hosts may reach the endpoint without keys.
        elsewhere: names of the services that other hosts start.
        stack: the router and its local address are closed when the caller closes this stack.

    Raises:
        ConfigError: other hosts can reach the endpoint, and neither `keys` nor `insecure` is given.
        SystemRuns: a system already runs at the endpoint.
        PortInUse: a port of a service is in use.
        BusUnreachable: the router cannot be opened or reached.
        BadKeys: a key cannot be used.
    """
    place = endpoint if keys is None else secured(endpoint)
    security = None if keys is None else Security(keys, here, elsewhere=elsewhere)
    _assume(security, LAUNCHER)
    if security is None and not is_local(place):
        if not insecure:
            raise ConfigError(
                f"other hosts can reach {place}: launch with --secure, for which `mobee keys new` makes the keys, or with "
                "--insecure: then every program that reaches it can move the robot"
            )
        _warn(f"every program that reaches {place} can move the robot")
    if elsewhere and is_local(place):
        _warn(f"only this computer reaches {place}: for services of another host give --endpoint, as in docs/hosts.md")
    refusals = None if security is None else RefusalLog.open()
    check_endpoint(here, place)
    check_ports(here)
    lease, local = LEASE, ""
    if scenario.is_locked:
        spare_threads()
        lease = max(part.config.patience for part in scenario.parts)
        local = "" if security else stack.enter_context(local_endpoint())  # a socket shows no certificate
    identity, access = (security.router, security.access) if security else (None, None)
    router = stack.enter_context(open_router(place, lease, local, identity, access))
    session = open_client(local or place, lease=lease)  # the router itself runs no Python, so that nothing here delays a message
    return Connection(LAUNCHER, place, session, router, local, security, refusals)


def join_bus(scenario: Scenario, here: Scenario, endpoint: str, host: str, keys: Path | None) -> Connection:
    """Open a session with the router of another host, if the launchers of both hosts agree about the scenario.

    Args:
        scenario: all services.
        here: the services that this host starts.
        endpoint: address of the router.
        host: name of this host.
        keys: folder of keys; None: the system is not secured.

    Raises:
        ConfigError: `host` is not a valid name.
        PortInUse: a port of a service is in use.
        BadKeys: a key cannot be used.
        JoinRefused: the connection fails, the first launcher does not answer, or the launchers do not agree.
    """
    who, place = name_of(host), endpoint if keys is None else secured(endpoint)
    security = None if keys is None else Security(keys, here, launcher=who)
    _assume(security, who)
    check_ports(here)
    if scenario.is_locked:
        spare_threads()
    try:
        session = open_client(place, patience=JOIN_PATIENCE, lease=LEASE)
    except BusUnreachable as error:
        raise JoinRefused(
            f"{str(error).partition('. ')[0]}. Does the system run there, and is its --endpoint one that this host reaches? "
            "If it is secured, join with --secure"
        ) from None
    with ExitStack() as refused:
        refused.enter_context(session)
        only = [part.who for part in here.parts]
        first = request_agreement(session, who, place)
        check_agreement(first, agreement(scenario), only, place)
        check_free(session, who, only, place)
        refused.pop_all()
    return Connection(who, place, session, security=security, first=first)


def default_endpoint(scenario: Scenario) -> str:
    """Return the address at which the scenario's router listens if the user gives no other address."""
    return str(scenario.shared.get("endpoint", DEFAULT_ENDPOINT))


def _assume(security: Security | None, who: str) -> None:
    assume(None if security is None else security.identity(who))
    if security is not None and security.expiring:
        _warn(f"keys expire soon, renew them with `mobee keys add`: {', '.join(security.expiring)}")


def _warn(text: str) -> None:
    print(f"mobee launch: {text}", file=sys.stderr)
