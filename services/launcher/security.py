# SPDX-License-Identifier: Apache-2.0
"""Security of a launched system: checks the keys before the start, makes the access list of the router, and reports what it refuses."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

from services.common.access import access_list
from services.common.identity import ROUTER, Identity
from services.common.refusals import Refusal, RefusalLog
from services.common.service import Service
from services.common.session import NAMESPACE
from services.launcher.scenario import Scenario

LAUNCHER = "launcher"
_PERIOD = 0.2  # s between two checks for refusals
_SAY_AGAIN = 10.0  # s after which a refusal that continues is reported again
_MOST = 1000  # different refusals that are remembered
_AT_ONCE = 4  # reports of one check: who tries a new key each time must not fill the log


class Security:
    """The keys of one run of the system (`mobee launch`).

    `folder`: folder of the keys. `router`: identity (private key and certificate) of the router. `access`: access list of the router:
    the topics of the bus that each identity may use. `expiring`: texts about identities that expire soon.
    """

    def __init__(self, folder: Path, here: Scenario, *, launcher: str = LAUNCHER, elsewhere: Sequence[str] = ()) -> None:
        """Check the keys of this host. Raises BadKeys, with a remedy, for the first one that cannot be used.

        `folder`: folder of the keys. `here`: services of this host. `launcher`: name of its launcher. `elsewhere`: services of other hosts;
        only their certificates are needed here.
        """
        from services.common.certificates import SOON, KeyFolder  # 0.1 s, which a launch without keys does not wait for

        keys = KeyFolder(folder.resolve())
        keys.require([*([ROUTER] if launcher == LAUNCHER else []), launcher, *(part.who for part in here.parts)])
        keys.require_certificates(elsewhere)
        issued = keys.issued()
        self.folder = keys.path
        self.router = Identity(keys.path, ROUTER)
        clients = next((part.config.clients for part in here.parts if hasattr(part.config, "clients")), "")
        self.access = access_list({one.name: one.party for one in issued if one.party is not None}, NAMESPACE, clients)
        self.expiring = [f"{one.name} on {one.until:%Y-%m-%d}" for one in issued if one.days_left() < SOON]

    def identity(self, who: str) -> Identity:
        """Return the identity (private key and certificate) of the service `who`."""
        return Identity(self.folder, who)


class Refusals:
    """Publishes an event for each connection or message that a secured router refuses.

    The same refusal is published at most once in 10 s, with the number of times that it occurred.
    """

    def __init__(self, service: Service, log: RefusalLog) -> None:
        self._service, self._log = service, log
        self._said: dict[Refusal, float] = {}  # monotonic time of the last report
        self._unsaid: dict[Refusal, int] = {}
        self._check()

    def _check(self) -> None:
        now = time.monotonic()
        for refusal, times in self._log.take().items():
            self._service.bus.rejected["access"] += times
            if refusal in self._unsaid or len(self._unsaid) < _MOST:
                self._unsaid[refusal] = self._unsaid.get(refusal, 0) + times
        due = [one for one in self._unsaid if now - self._said.get(one, -_SAY_AGAIN) >= _SAY_AGAIN]
        for refusal in due[:_AT_ONCE]:
            times = self._unsaid.pop(refusal)
            if len(self._said) >= _MOST:
                self._said.clear()
            self._said[refusal] = now
            self._service.bus.event("warning", "access", refusal.text, times=times)
        self._service.inbox.at(now + _PERIOD, self._check)
